"""A recorded force or motion drives the simulated arm; the recording lies beside the run.

A force replaces the muscle. A motion leads the handle by a hand: a spring and a damper between the
recorded place and the handle, and the recorded force, if there is one:
fh = f + k (p_recorded - p) + d d(p_recorded - p)/dt.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..arguments import checked, named
from ..columns.finding import find
from ..columns.log import Log, Reading, open_log
from ..display import brief
from ..errors import ParameterError, array_of, choice
from ..model.arm import Arm
from ..model.constants import AXES
from ..model.operator import Operator
from ..model.samples import Samples
from ..results import Result
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..simulation.simulate import simulate

COLUMNS = {  # columns of a recording and their contents
    "t": "time [s]",
    "x": "position x [m]",
    "y": "position y [m]",
    "fx": "force of the hand on the handle, x [N]",
    "fy": "force of the hand on the handle, y [N]",
}
UNITS = {"t": ("s",), "x": ("m",), "y": ("m",), "fx": ("N",), "fy": ("N",)}
GRIP = Operator(mass=0.0, damper=40.0, spring=500.0)
Drive = Literal["force", "motion"]


@named
@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded motion of a handle, the force of the hand on it, or both.

    Attributes:
        t: times [s], ascending, (n,), two at least; the run begins at the first.
        p: positions [m], (n, 2); None if only the force was recorded.
        f: force of the hand on the handle [N], (n, 2); None if only the motion was recorded.
        name: name in titles and files.

    Raises:
        ParameterError: a column is not such an array, or neither is given.
    """

    def __repr__(self) -> str:
        return brief(self)

    t: np.ndarray
    p: np.ndarray | None = None
    f: np.ndarray | None = None
    name: str = "recording"

    def __post_init__(self):
        if self.p is None and self.f is None:
            raise ParameterError("p", None, "must be given, or f")
        if array_of("t", self.t).size < 2:
            raise ParameterError("t", self.t, "must be two times or more")
        for name in ("p", "f"):
            value = getattr(self, name)
            if value is not None:
                samples = Samples(self.t, value)  # type: ignore[arg-type]  # which checks both
                object.__setattr__(self, name, array_of(name, samples.values))
                object.__setattr__(self, "t", array_of("t", samples.t))

    @classmethod
    @checked
    def load(
        cls,
        path: str | Path,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        counts: Mapping[str, Any] | None = None,
        rate: float | None = None,
    ) -> Recording:
        """Reads a log, text or binary; units stand in the heads, as "x [mm]".

        Args:
            path: the file.
            columns: names in the file of t, x, y, fx and fy; by default these. A coordinate that is
                missing beside the other is 0.
            units: unit of a column by name, in place of what the file says, as {"x": "mm"}.
            counts: of an encoder's column by name: the size of a count, as "0.01 mm".
            rate: rows in a second [Hz], of a file without a time or in place of its own.

        Raises:
            ParameterError: the file cannot be read, lacks a column that was named, the time, or
                both motion and force; or as `Recording`.
        """
        for key in dict(columns or {}):
            choice("columns", key, tuple(COLUMNS))
        try:
            reading = Reading(units or {}, counts or {}, rate=rate)
            return recorded(open_log("path", path, reading), dict(columns or {}))
        except OSError as error:
            bound = f"must be a readable file ({error.strerror})"
            raise ParameterError("path", str(path), bound) from None


def recorded(log: Log, columns: Mapping[str, str]) -> Recording:
    """The recording in the columns of a log."""
    names = {k: columns.get(k, k) for k in COLUMNS if k in columns or _has(log, k)}
    if "t" not in columns:
        names["t"] = find(log, "columns.t", "t", "time")
    cells = {key: log.values(names[key], UNITS[key]) for key in COLUMNS if key in names}
    p, f = (_pair(cells, x, y) for x, y in (AXES, ("fx", "fy")))
    if p is None and f is None:
        bound = f"must have a motion or a force: name its columns, as x=NAME of {log.names}"
        raise ParameterError("columns", str(log.path), bound)
    return Recording(cells["t"], p, f, log.path.stem)


def _has(log: Log, name: str) -> bool:
    try:
        log.place(name)
    except ParameterError:
        return False
    return True


def _pair(cells: Mapping[str, np.ndarray], x: str, y: str) -> np.ndarray | None:
    if x not in cells and y not in cells:
        return None
    return np.column_stack([cells.get(name, np.zeros_like(cells["t"])) for name in (x, y)])


@named
@dataclass(frozen=True, eq=False, repr=False)
class Replayed(Result):
    """A run under a recording, beside it.

    Attributes:
        name: name of the recording.
        drive: "force" or "motion".
        scenario: the scene that was run: `hc.simulate(replayed.scenario)` runs it again.
        status: how the run ended.
        t: times of the recording that the run reached, from 0 on [s], (n,).
        p: position of the run [m], (n, 2).
        f: force of the hand in the run [N], (n, 2).
        recorded_p: recorded position [m], (n, 2); None if there is none.
        recorded_f: recorded force [N], (n, 2); None if there is none.
    """

    drawn_by = "hapticclay.views.replay_plots:replay_plot"
    written_as = "replay"

    name: str
    drive: Drive
    scenario: Scenario
    status: str
    t: np.ndarray
    p: np.ndarray
    f: np.ndarray
    recorded_p: np.ndarray | None
    recorded_f: np.ndarray | None

    @property
    def off(self) -> float:
        """Distance of the run from the recorded motion, rms [m]; nan without one."""
        return _rms(self.p, self.recorded_p)

    @property
    def force_off(self) -> float:
        """Difference of the hand's force from the recorded one, rms [N]; nan without one."""
        return _rms(self.f, self.recorded_f)

    def headline(self) -> str:
        """How far run and recording are apart, in one line."""
        told = f"{self.name} as {self.drive}: {self.status}"
        if self.recorded_p is not None:
            told += f"; motion {1e3 * self.off:.3g} mm rms off the recording"
        if self.recorded_f is not None:
            told += f", force {self.force_off:.3g} N rms"
        return told

    def tables(self) -> dict[str, dict[str, Any]]:
        """How far apart, by axis; and all columns over time."""
        columns: dict[str, Any] = {"time [s]": self.t}
        rows = []
        for i, axis in enumerate(AXES):
            pairs = (
                ("position", "m", self.p, self.recorded_p),
                ("force", "N", self.f, self.recorded_f),
            )
            for what, unit, run, recorded in pairs:
                columns[f"{what} {axis} [{unit}]"] = run[:, i]
                if recorded is not None:
                    columns[f"recorded {what} {axis} [{unit}]"] = recorded[:, i]
                    rms = _rms(run[:, i : i + 1], recorded[:, i : i + 1])
                    rows.append((f"{what} {axis} [{unit}]", rms, float(np.ptp(recorded[:, i]))))
        names = ("", "off, rms", "recorded range")
        off = {name: [row[j] for row in rows] for j, name in enumerate(names)}
        return {"off": off, "columns": columns}

    def contents(self) -> dict[str, Any]:
        """How far run and recording are apart."""
        return {
            "name": self.name,
            "drive": self.drive,
            "status": self.status,
            "off": self.off,
            "force_off": self.force_off,
        }


def _rms(run: np.ndarray, recorded: np.ndarray | None) -> float:
    if recorded is None or not len(run):
        return math.nan
    return math.sqrt(float(np.mean(np.sum((run - recorded) ** 2, axis=1))))


def driven(
    scenario: Scenario, recording: Recording, drive: Drive = "force", grip: Operator = GRIP
) -> Scenario:
    """The scene that a recording drives."""
    if grip.mass:
        raise ParameterError("grip.mass", grip.mass, "must be 0: the recorded hand had its own")
    recording = placed(recording, scenario)
    t, p, f = recording.t - recording.t[0], recording.p, recording.f
    column = f if drive == "force" else p
    if column is None:
        bound = f"must be one that {recording.name} has"
        raise ParameterError("drive", drive, bound)
    changes: dict[str, Any] = {"force": (0.0, 0.0), "t_max": float(t[-1]), "length": None}
    if p is not None:
        v = np.gradient(p, t, axis=0)
        if isinstance(scenario.arm, Arm):
            changes |= {"start": tuple(p[0].tolist()), "velocity": tuple(v[0].tolist())}
        if drive == "motion":
            column = grip.spring * p + grip.damper * v + (0.0 if f is None else f)
    hand = grip if drive == "motion" else None
    muscle = Samples(t, column)  # type: ignore[arg-type]
    return replace(scenario, muscle=muscle, operator=hand, **changes)


def placed(recording: Recording, scenario: Scenario) -> Recording:
    """The recording, from the pose of an arm from a file on, which is its p = 0."""
    if recording.p is None or isinstance(scenario.arm, Arm):
        return recording
    return replace(recording, p=recording.p - recording.p[0])


@checked
def replay(
    scenario: Scenario,
    recording: Recording,
    drive: Drive = "force",
    grip: Operator = GRIP,
) -> Replayed:
    """Runs a scene under a recorded force or motion, from the recorded start.

    An arm from a file starts at rest at its pose; the recorded motion is moved there.

    A recorded force is that at the handle, so the hand has no impedance of its own. A recorded
    motion leads the handle by a spring and a damper, beside the recorded force if there is one. The
    handle is then off the recording by what the scene needs of force, more or less than recorded,
    over the stiffness of that spring.

    Args:
        scenario: the scene; its force, muscle, hand, start, length and duration are replaced.
        recording: what drives it.
        drive: "force" or "motion".
        grip: spring and damper that lead the handle along a motion; its mass must be 0. A much
            stiffer one may make the loop unstable, as any stiff hand.

    Raises:
        ParameterError: the recording lacks what drives, or leaves the reach of the arm.
    """
    scene = driven(scenario, recording, drive, grip)
    return beside(simulate(scene), recording, drive)


def beside(record: Record, recording: Recording, drive: Drive) -> Replayed:
    """A run and its recording, at the times of the recording that the run reached."""
    recording = placed(recording, record.scenario)
    t = recording.t - recording.t[0]
    t = t[t <= record.t[-1] + 1e-9] if len(record.t) else t[:0]
    p, f = (
        np.column_stack([np.interp(t, record.t, x[:, i]) for i in range(2)])
        for x in (record.p, record.fh)
    )
    n = len(t)
    recorded = [None if x is None else x[:n] for x in (recording.p, recording.f)]
    return Replayed(recording.name, drive, record.scenario, record.status, t, p, f, *recorded)
