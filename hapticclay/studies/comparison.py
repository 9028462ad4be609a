"""Controllers or bare devices side by side: key numbers, runs, and the fields that differ."""

from __future__ import annotations

import math
import os
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..arguments import checked, named
from ..errors import ParameterError
from ..fields import plain_data
from ..results import Result
from ..scene.files import file_data
from ..scene.scenario import Scenario
from ..scene.virtual_wall import WALL_SCHEMA, WALL_SCHEMA_0_2, VirtualWall
from ..simulation.record import Record
from ..simulation.simulate import simulate
from ..theory import design, hand_boxes, stability_margins, wall_limits
from ..theory.gain_limits import gain_limit
from ..theory.impedance import Impedance, loop_response, wall_response
from ..theory.loops import TIMING, Loop
from ..theory.mbk import dynamic_range, least_mass
from .replay import Drive, Recording, Replayed, beside, driven
from .zwidth import ZRegion, zwidth

MOST_COMPARED = 5  # the number of distinct curve styles
COMPARED_HANDS = hand_boxes.Box((0.0, 1.0), (0.0, 5.0), (0.0, 300.0))  # of the worst case
SLOW = 1e-4  # [rad/s] frequency taken as steady motion
FELT_AT = (1.0, 10.0)  # [Hz] of the impedance in the table, below and above the resonance
RANGE_AT = np.geomspace(0.5, 30.0, 41)  # [Hz] of the dynamic range
LEAST_DECAY = 10.0  # [1/s] B/M of the least mass: that of the paper's compensator
PUSHED = 0.01  # [m/s] of a device in its run
PUSHED_TIME = 0.5  # [s] of that run
WALL_WORDS = frozenset(
    ("device", "K", "B", "M", "velocity_window", "velocity_filter", "unilateral")
)


@named
@dataclass(frozen=True, eq=False)
class Compared:
    """One file: its scenario or wall, the theory of it, and its run.

    Attributes:
        name: name of the file.
        subject: the scenario, or the wall on its device.
        loop: one axis of a scenario; None for a wall.
        numbers: key numbers by name and unit; NaN where there is none.
        settings: every field by dotted name.
        record: its run.
        region: for a wall, the stiffness and damping that its device renders stably, by runs.
        replayed: the run beside the recording that drove it; None for a run of its own.
    """

    name: str
    subject: Scenario | VirtualWall
    loop: Loop | None
    numbers: dict[str, float]
    settings: dict[str, Any]
    record: Record
    region: ZRegion | None = None
    replayed: Replayed | None = None

    @property
    def wall(self) -> VirtualWall:
        """The subject that is not a scenario."""
        assert self.loop is None
        return cast(VirtualWall, self.subject)

    @property
    def top(self) -> float:
        """Half the sampling frequency of a wall [Hz]; inf for a scenario."""
        return math.inf if self.loop else 0.5 / self.wall.Ts

    def impedance(self, omega: np.ndarray) -> Impedance:
        """Impedance at a hand outside the loop; for a controller in continuous time.

        Args:
            omega: [rad/s], > 0, shape (n,).
        """
        if self.loop is None:
            return wall_response(replace(self.wall, operator=None), omega)
        return loop_response(replace(self.loop, operator=None, **TIMING), omega)


@named
@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Files side by side, in the order in which they were given.

    Attributes:
        files: the contents of each, its theory and its run.
    """

    drawn_by = "hapticclay.views.compare_plots:main_overlay"
    written_as = "compare"
    printed = {"side by side": ()}

    files: tuple[Compared, ...]

    def __iter__(self) -> Iterator[Compared]:
        return iter(self.files)

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, i: int) -> Compared:
        return self.files[i]

    def headline(self) -> str:
        """The files and how their runs ended, in one line."""
        return "; ".join(f"{x.name}: {x.record.status}" for x in self.files)

    def tables(self) -> dict[str, dict[str, list[Any]]]:
        """Key numbers of each file."""
        names = dict.fromkeys(n for x in self.files for n in x.numbers)
        columns = {n: [x.numbers.get(n, math.nan) for x in self.files] for n in names}
        known = {n: column for n, column in columns.items() if not all(map(math.isnan, column))}
        side: dict[str, list[Any]] = {"": [*known, "outcome of its run"]}
        for i, x in enumerate(self.files):
            side[x.name] = [*(column[i] for column in known.values()), x.record.status]
        numbers = {"file": [x.name for x in self.files], **columns}
        return {"numbers": numbers, "side by side": side}

    def remarks(self) -> list[str]:
        """Nothing: the table shows all."""
        return []

    def figures(self) -> dict[str, Any]:
        """Overlays of all files, as far as they apply."""
        drawn = pkgutil.resolve_name("hapticclay.views.compare_plots:compare_figures")(self)
        return {name: figure for name, (_, figure) in drawn.items()}

    def contents(self) -> dict[str, Any]:
        """Key numbers, and the fields that differ."""
        return {"files": {x.name: x.numbers for x in self}, "fields": differing_fields(self)}


@checked
def compare_files(
    paths: Sequence[str | os.PathLike[str]],
    axis: str = "x",
    progress: Callable[[Iterable], Iterable] = iter,
    recording: Recording | None = None,
    drive: Drive = "force",
) -> Comparison:
    """Loads, judges and runs controllers (scenario files) or bare devices (files of walls).

    Args:
        paths: two to MOST_COMPARED different files of one kind.
        axis: axis of the arm, for scenarios.
        progress: wraps the iterable of the files.
        recording: a recorded force or motion under which scenarios run, each beside it; None for
            the scenarios as they are.
        drive: what of the recording drives them.

    Raises:
        ParameterError: fewer or more files, one of them twice, files of both kinds, one that
            cannot be read, or a recording for walls.
    """
    for p in paths:
        if not isinstance(p, str | os.PathLike):
            raise ParameterError("files", p, "must be paths")
    given = [str(p) for p in paths]
    if not 2 <= len(paths) <= MOST_COMPARED:
        bound = f"must be 2 to {MOST_COMPARED} files, as in hapticclay compare A.toml B.toml"
        raise ParameterError("files", given, bound)
    if len({os.path.realpath(p) for p in paths}) < len(paths):
        raise ParameterError("files", given, "must be different files: one is named twice")
    kinds = {is_wall_file(p) for p in paths}
    if len(kinds) > 1:
        bound = "must be all scenarios or all walls: their numbers cannot be compared"
        raise ParameterError("files", given, bound)
    stems = [Path(p).stem for p in paths]
    names = stems if len(set(stems)) == len(stems) else [str(p) for p in paths]
    pairs = progress(list(zip(paths, names, strict=True)))
    if kinds == {True}:
        if recording is not None:
            bound = "is for scenarios: leave it out with walls"
            raise ParameterError("recording", recording.name, bound)
        return Comparison(tuple(compared_wall(p, n) for p, n in pairs))
    return Comparison(tuple(compared_scenario(p, n, axis, recording, drive) for p, n in pairs))


def is_wall_file(path: str | os.PathLike[str]) -> bool:
    """Whether a file is that of a virtual wall."""
    data = file_data(path)
    return data.get("schema") in (WALL_SCHEMA, WALL_SCHEMA_0_2) or bool(
        WALL_WORDS & {k.split(".")[0] for k in data}
    )


def compared_scenario(
    path: str | os.PathLike[str],
    name: str,
    axis: str,
    recording: Recording | None = None,
    drive: Drive = "force",
) -> Compared:
    """Judges and runs the controller of a scenario file, under a recording if there is one.

    Margins, worst hand, passivity and steady damper are computed in continuous time without delay;
    the gain limit is computed with the scenario's own sampling and delay.
    """
    scenario = Scenario.load(path)
    loop = Loop.of(scenario, axis)
    plain = replace(loop, **TIMING)
    record, error = run_and_error(driven(scenario, recording, drive) if recording else scenario)
    replayed = beside(record, recording, drive) if recording else None
    alone = replace(plain, operator=None)
    m = stability_margins.margins(plain)
    Z = loop_response(alone, np.array([SLOW])).Z[0]
    steady = Z.real - loop.b if SLOW * abs(Z.imag) < 1e-3 * max(abs(Z.real), 1.0) else math.nan
    numbers = {
        "gain K [1/kg]": loop.gain,
        "clay b [N.s/m]": loop.b,
        "gain limit, as sampled [1/kg]": gain_limit(loop),
        "gain margin": m.gain[1] if m.stable else math.nan,
        "phase margin [degrees]": math.degrees(m.phase) if m.stable else math.nan,
        "delay margin [ms]": 1e3 * m.delay if m.stable else math.nan,
        "disk margin": m.disk if m.stable else math.nan,
        "gain limit, worst hand [1/kg]": worst_limit(plain),
        "passivity margin [N.s/m]": _passivity_margin(alone),
        "steady damper [N.s/m]": steady,
        "error of transparency": design.transparency_error(plain) if loop.gain else math.nan,
        "least mass in free motion [kg]": least_mass(replace(loop, b=0.0, k=0.0), LEAST_DECAY)[0],
    }
    settings = _by_dotted_name(plain_data(scenario, left_out=[]))
    found = Compared(name, scenario, loop, numbers, settings, record, None, replayed)
    of_run = _run_numbers(record, error) | (_off_numbers(replayed) if replayed else {})
    return replace(found, numbers=numbers | _felt_numbers(found) | of_run)


def compared_wall(path: str | os.PathLike[str], name: str) -> Compared:
    """Judges and runs the wall of a file."""
    wall = VirtualWall.load(path)
    record, error = run_and_error(wall.scenario(PUSHED_TIME, push=PUSHED))
    low, high = wall_limits.stiffness_band(wall)
    passive = wall_limits.colgate_schenkel_limit(wall)
    region = zwidth(wall, quick=True).regions[0]
    linear = replace(wall, device=replace(wall.device, friction=0.0, quantum=0.0), unilateral=False)
    spread = dynamic_range(linear, 2.0 * math.pi * RANGE_AT[RANGE_AT < 0.5 / wall.Ts])
    edge = math.pi / wall.Ts
    omega = np.geomspace(1e-4 * edge, edge * (1.0 - 1e-9), 2000)
    numbers = {
        "stiffness K [N/m]": wall.K,
        "damping B [N.s/m]": wall.B,
        "stable K, at least [N/m]": low,
        "stable K, at most [N/m]": high,
        "stable K, worst hand [N/m]": wall_limits.hand_box_limit(wall, COMPARED_HANDS),
        "passive K, at most [N/m]": passive,
        "passivity margin [N.s/m]": float(np.min(wall_limits.passivity_index(wall, omega))),
        "stable K over passive K": high / passive if passive else math.nan,
        "Z-width by runs: largest K [N/m]": region.largest_K,
        "Z-width by runs: largest B [N.s/m]": region.largest_B,
        "runs off the exact linear loop [%]": 100.0 * region.gap(),
        "dynamic range, mean [dB]": spread.mean,
    }
    found = Compared(name, wall, None, numbers, _by_dotted_name(plain_data(wall)), record, region)
    return replace(found, numbers=numbers | _felt_numbers(found) | _run_numbers(record, error))


def worst_limit(loop: Loop) -> float:
    """Largest K up to which every hand of COMPARED_HANDS is stable; NaN for a gain of zero."""
    return hand_boxes.worst_case(loop, COMPARED_HANDS).limit if loop.gain else math.nan


def _passivity_margin(loop: Loop) -> float:
    from ..theory.loop_passivity import passivity

    return passivity(loop).margin


def run_and_error(scenario: Scenario) -> tuple[Record, float]:
    """Runs a scenario, and again at half the step."""
    sampled = scenario.control == "sampled"
    Ts = (scenario.Ts or scenario.dt) if sampled else None
    # first, so that the run time of the other excludes loading of compiled code
    finer = simulate(replace(scenario, dt=0.5 * scenario.dt, Ts=Ts))
    record = simulate(scenario)
    n = min(len(record.t), (len(finer.t) + 1) // 2) - 1
    if n < 1 or record.outcome.code != finer.outcome.code:
        return record, math.nan
    return record, float(np.abs(record.p[:n] - finer.p[::2][:n]).max())


def _felt_numbers(found: Compared) -> dict[str, float]:
    """Effective stiffness, damping and mass at FELT_AT; NaN where a wall has no such frequency."""
    out: dict[str, float] = {}
    for f in FELT_AT:
        Z = found.impedance(np.array([2.0 * math.pi * f])) if f < found.top else None
        for part, unit in (("stiffness", "N/m"), ("damping", "N.s/m"), ("mass", "kg")):
            value = float(getattr(Z, part)[0]) if Z else math.nan
            out[f"effective {part} at {f:g} Hz [{unit}]"] = value
    return out


def _run_numbers(record: Record, error: float) -> dict[str, float]:
    return {
        "simulated [s]": float(record.t[-1]) if len(record.t) else 0.0,
        "change of position at half the step [m]": error,
        "engine steps": float(record.steps),
        "run time [s]": record.wall_time,
    }


def _off_numbers(replayed: Replayed) -> dict[str, float]:
    """How far a run is from its recording."""
    return {
        "off the recorded motion, rms [mm]": 1e3 * replayed.off,
        "off the recorded force, rms [N]": replayed.force_off,
    }


def differing_fields(found: Comparison) -> dict[str, list[Any]]:
    """Fields that differ between files: the value of each file, None if it has no such field."""
    names = dict.fromkeys(name for x in found for name in x.settings if name != "name")
    rows = {name: [x.settings.get(name) for x in found] for name in names}
    return {name: row for name, row in rows.items() if any(v != row[0] for v in row[1:])}


def _by_dotted_name(data: Any, path: str = "") -> dict[str, Any]:
    if isinstance(data, dict):
        out: dict[str, Any] = {}
        for name, value in data.items():
            out |= _by_dotted_name(value, f"{path}.{name}" if path else str(name))
        return out
    return {path: data}
