"""The result of a run: arrays over time, the outcome, and files that keep them."""

from __future__ import annotations

import dataclasses
import importlib
import json
import math
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..arguments import checked, named
from ..display import html_table, one_line
from ..errors import ParameterError, array_of, choice
from ..fields import make_part, plain_data
from ..files import DAMAGED, atomic, check_regular, parse_json, versions
from ..model.clay import Clay
from ..model.constants import AXES
from ..model.signals import Multisine
from ..scene.earlier_names import with_present_names
from ..scene.scenario import Scenario
from ..scene.text import scenario_rows
from ..theory import linear_loop
from ..theory.stability_margins import Verdict
from .accuracy import Accuracy
from .columns import ARRAYS, COLUMNS, EXTRA, parts_of
from .monitor import Outcome
from .run import Crossing, Run, Stop
from .stored import check_head, check_headers, check_times

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


VIEWS = "hapticclay.views.record_plots"  # draws the figures; imported on demand
RECORD_SCHEMA, RECORD_SCHEMA_0_2 = "hapticclay-record-2", "hapticclay-record-1"
UNITS = {"energy": "J", "crossings": "m, s, m/s", "regions": "m, N.s/m, m/s"}  # of a summary
STEADY = 1e-2  # a speed is steady if it would change by less than 1 % in 1 s ...
STEADY_SPAN = 0.05  # ... and has done so for so long before and after [s]


@named
@dataclass(frozen=True, eq=False)
class Record:
    """Arrays of one run over the same n samples; axes ordered (x, y).

    Those of an arm from a file have a column for each of the handle's axes, in the order of
    `MjcfArm.axes`, and for each joint.

    Attributes:
        t: time [s], shape (n,); in steps of dt, the last one shorter if the run ended between two.
        p: handle position [m], shape (n, 2).
        v: handle velocity [m/s], shape (n, 2).
        fh: force of the operator on the handle [N], shape (n, 2).
        fe: resisting force of the clay [N], shape (n, 2).
        b: damping of the clay at p [N.s/m], shape (n, 2).
        q: joint angles [rad], shape (n, 2).
        qd: joint rates [rad/s], shape (n, 2).
        tau: motor torques [N.m], shape (n, 2).
        delta: compensator output [m], shape (n, 2).
        scenario: what was run.
        outcome: how the run ended.
        crossings: of borders, in order.
        energy: work of the operator's muscle and of the motors, drives that run a joint law
            included; energy taken by the clay and by the damper of Th, gained by the arm (kinetic;
            of an arm from a file, weight and springs included) and by mass and spring of Th
            (hand_stored); of an arm from a file, what its dampers and a fluid take (joint_dampers);
            what these fail to balance by (residual), and the energy that came into play
            (throughput): that at the start, and the magnitudes of both works, step by step [J].
            For clay that springs back, the part of the clay's share that its springs store and
            have dissipated (springs_stored, springs_dissipated). Clay that the motors hold takes
            nothing itself (clay is 0): the work of its force, a part of motors, is rendered_clay.
            With hardware: friction, passivity_controller, coupling (docs/hardware.md).
        steps: number of engine steps.
        wall_time: run time [s].
        versions: of the packages used.
        extra: further arrays by name: removed clay and its rate, shape (n,); in sessions, the
            target of the hand and the gain K, shape (n, 2).
        notes: in sessions, how well they kept real time.
        stops: intervals in which yielding clay held the handle still, in order.
        error: for a run with a requested error, request and estimate; else None.
        ground: for clay that stays cut, remaining height of each cell at the end [m], shape
            (n, m), between the `edges` of its Groove; else None.
    """

    t: np.ndarray
    p: np.ndarray
    v: np.ndarray
    fh: np.ndarray
    fe: np.ndarray
    b: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    delta: np.ndarray
    scenario: Scenario
    outcome: Outcome
    crossings: tuple[Crossing, ...] = ()
    energy: dict[str, float] = dataclasses.field(default_factory=dict)
    steps: int = 0
    wall_time: float = 0.0
    versions: dict[str, str] = dataclasses.field(default_factory=lambda: dict(versions()))
    extra: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    notes: dict[str, Any] = dataclasses.field(default_factory=dict)
    stops: tuple[Stop, ...] = ()
    error: Accuracy | None = None
    ground: np.ndarray | None = None

    @classmethod
    @checked
    def of(cls, run: Run, wall: float) -> Record:
        """The record of a finished run.

        Args:
            run: the run.
            wall: run time [s].
        """
        assert run.outcome is not None
        arrays: Any = run.arrays()
        extra = {name: arrays.pop(name) for name in EXTRA if name in arrays}
        return cls(
            **arrays,
            extra=extra,
            ground=run.left_ground(),
            scenario=run.scenario,
            outcome=run.outcome,
            crossings=tuple(run.crossings),
            stops=tuple(run.stops),
            energy=run.balance(),
            steps=run.steps,
            wall_time=wall,
        )

    @property
    def status(self) -> str:
        """How the run ended, in one line: its code, the axis and time, and the cause."""
        return str(self.outcome)

    def __repr__(self) -> str:
        return f"<Record {one_line(self.scenario.name)}: {self.status}; {self._samples()}>"

    def _repr_html_(self) -> str:
        s = self.scenario
        rows = [("status", self.status), ("samples", self._samples())]
        rows += [("advice", self.outcome.advice)] * bool(self.outcome.advice)
        rows += [("error", str(self.error))] * (self.error is not None)
        kept = ", ".join(f"{name} [{unit}]" for name, unit in self._units().items())
        rows += [("arrays", kept), *scenario_rows(s)]
        return html_table(f"Record {s.name}", rows)

    def _samples(self) -> str:
        n = len(self.t)
        return f"{n} samples, {self.t[0]:.6g} to {self.t[-1]:.6g} s" if n else "no samples"

    def _units(self) -> dict[str, str]:
        """Unit of each array that the record has."""
        names = [*ARRAYS, *self.extra, *["ground"] * (self.ground is not None)]
        return {name: COLUMNS[name].unit for name in names}

    @property
    def plot(self) -> Any:
        """Draws the run: `plot()`, or `plot.velocity()`, `plot.force()`, `plot.path()`, ...

        It is a `views.record_plots.RecordPlots`.
        """
        return importlib.import_module(VIEWS).RecordPlots(self)

    def to_frame(self) -> DataFrame:
        """The arrays as a pandas DataFrame, one row per sample.

        Its index is t [s]; columns are p_x, p_y, v_x, ..., q_shoulder, q_elbow, ..., with those of
        `extra`. Its attrs have units, by column; title, source, status, outcome, end_time [s]; and
        scenario and summary, as JSON. `ground` is not in it.

        Raises:
            ParameterError: pandas is not installed.
        """
        from .tables import to_frame

        return to_frame(self)

    def to_xarray(self) -> Dataset:
        """The arrays as an xarray Dataset over time [s], axis (x, y) and joint (shoulder, elbow).

        Variables have units and long_name; the attributes are those of `to_frame`, without units.
        The remaining height of clay that stays cut is over cell_x and cell_y [m].

        Raises:
            ParameterError: xarray is not installed.
        """
        from .tables import to_xarray

        return to_xarray(self)

    def export(self, path: str | os.PathLike[str], format: str | None = None) -> Path:
        """Writes a file for other programs, whole or not at all: docs/data.md.

        Args:
            path: the file; an older one is replaced.
            format: "nc", "parquet", "csv", "mcap", "rrd" or "mat"; None takes it from the ending
                of the file's name.

        Returns:
            The file.

        Raises:
            ParameterError: there is no such format, a package for it is not installed, the record
                does not fit into it, or the file cannot be written.
        """
        from .export import export_record

        return export_record(self, path, format)

    def ratio(self, force: np.ndarray) -> np.ndarray:
        """force / v along each axis; NaN where the handle is at rest.

        Args:
            force: [N], shape (n, 2).

        Returns:
            [N.s/m], shape (n, 2).

        Raises:
            ParameterError: force is no array of numbers of that shape.
        """
        out, bound = np.full(self.v.shape, np.nan), f"must be numbers of shape {self.v.shape}"
        numbers = array_of("force", force, bound)
        try:
            return np.divide(numbers, self.v, out=out, where=np.abs(self.v) > 1e-12)
        except ValueError:
            raise ParameterError("force", force, bound) from None

    def steady(self) -> np.ndarray:
        """Samples of steady speed, shape (n, 2): less than 1 % of change in 1 s, for 0.1 s."""
        n = len(self.t)
        if n < 3:
            return np.zeros(self.v.shape, dtype=bool)
        a = np.gradient(self.v, self.t, axis=0)
        moving = np.abs(a) > STEADY * np.abs(self.v)
        count = np.concatenate((np.zeros((1, moving.shape[1])), np.cumsum(moving, axis=0)))
        span = max(1, round(STEADY_SPAN / float(self.t[1] - self.t[0])))
        low, high = np.maximum(np.arange(n) - span, 0), np.minimum(np.arange(n) + span + 1, n)
        return count[high] == count[low]

    @checked
    def stretches(self, axis: str | None = None) -> list[np.ndarray]:
        """Indices of the samples, split wherever the handle entered different clay.

        Args:
            axis: "x" or "y" for the clay of that axis; None for both.

        Returns:
            Arrays of indices, in order.

        Raises:
            ParameterError: the clay has no such axis.
        """
        if axis is not None:
            choice("axis", axis, AXES)
        s = self.scenario
        if s.clay and not s.clay.seen_in_b:
            along = "".join(getattr(s.clay, a).along for a in ([axis] if axis else AXES))
            cuts = np.searchsorted(self.t, [c.time for c in self.crossings if c.axis in along])
            change = np.unique(cuts[(cuts > 0) & (cuts < len(self.t) - 1)])
        else:
            b = self.b[:, AXES.index(axis)] if axis else self.b.sum(axis=1)
            change = np.flatnonzero(np.diff(b)) + 1
        return np.split(np.arange(len(self.t)), change)

    @checked
    def regions(self, axis: str | None = None) -> list[dict[str, Any]]:
        """Means over each of the `stretches`, in order of time.

        Each axis has fe/v against b over the stretch (mean and deviation). At steady speed it also
        has the speed, fe/v and fh/v, beside `expected_speed`. The other quantities of the clay
        (`Clay.columns`) are those in the middle of the stretch. Clay that can hold the handle adds
        fe at steady speed, and the share of time in which it held the handle.

        Args:
            axis: "x" or "y" for that axis and its stretches alone; None for both.

        Returns:
            One dictionary per stretch.

        Raises:
            ParameterError: the clay has no such axis.
        """
        pieces = self.stretches(axis)
        if not len(self.t):
            return []
        steady, fe_v, fh_v = self.steady(), self.ratio(self.fe), self.ratio(self.fh)
        still, clay = self.held(), self.scenario.clay
        out = []
        for piece in pieces:
            entry: dict[str, Any] = {
                "from_s": float(self.t[piece[0]]),
                "to_s": float(self.t[piece[-1]]),
            }
            for name in [axis] if axis else AXES:
                i = AXES.index(name)
                s = piece[steady[piece, i]]
                b, last = float(self.b[piece[0], i]), float(self.b[piece[-1], i])
                entry[name] = {
                    "from_m": float(self.p[piece[0], i]),
                    "to_m": float(self.p[piece[-1], i]),
                    "b": b,
                    "b_end": last,
                    "fe_over_v": _mean_and_std(fe_v[piece, i]),
                    "steady_speed": float(np.mean(self.v[s, i])) if len(s) else None,
                    "expected_speed": self.expected_speed(name, piece),
                    "steady_fe_over_v": _mean_and_std(fe_v[s, i]),
                    "steady_fh_over_v": _mean_and_std(fh_v[s, i]),
                }
                if clay and clay.holding:
                    held = float(np.mean(still[piece, i]))
                    fe = float(np.mean(self.fe[s, i])) if len(s) else None
                    entry[name] |= {"steady_fe": fe, "held": held}
                if clay:
                    entry[name] |= clay.values_at(i, self.p[piece[len(piece) // 2]])
            out.append(entry)
        return out

    def expected_speed(self, axis: str, piece: np.ndarray) -> float | None:
        """Steady speed under the scenario's force in the clay of a stretch [m/s].

        K f/(10 + K b) with the printed parts, where the clay is a damper. Where it yields, 0 up to
        the yield force, and beyond it the solution of f = (10/K + b) v + (Fy + K |v|^n) v/|v|.

        Args:
            axis: "x" or "y".
            piece: samples of one of the `stretches`.

        Returns:
            None where the force is not constant, a hand is at the handle, the clay changes over the
            stretch, stays cut, springs back or has rotated axes, or the controller is your own.
        """
        i, s = AXES.index(axis), self.scenario
        if s.clay and not s.clay.of_velocity:
            return None
        together = bool(s.clay and s.clay.hold(i).together)
        axes = [0, 1] if together else [i]
        alone = not any(s.operators[j] for j in axes) and s.muscle is None and not s.driven
        b = self.b[piece[0]]
        if (
            not alone
            or s.controller is not None
            or s.rotated
            or np.any(self.b[piece][:, axes] != b[axes])
        ):
            return None
        Fy, K, n = _flow_at(s.clay, i, self.p[piece[len(piece) // 2]])
        if not Fy and not K:
            return linear_loop.steady_speed(
                s.gain[i], s.force[i], float(b[i]), s.compensators[i], s.servo[i]
            )
        dampers = [
            linear_loop.steady_damper(s.gain[j], s.compensators[j], s.servo[j]) + b[j] for j in axes
        ]
        v = linear_loop.steady_velocity([s.force[j] for j in axes], dampers, Fy, K, n)
        return float(v[axes.index(i)])

    def held(self) -> np.ndarray:
        """Samples at which yielding clay held the handle, along each axis, shape (n, 2)."""
        out = np.zeros(self.v.shape, dtype=bool)
        for stop in self.stops:
            end = math.inf if stop.end is None else stop.end
            during = (self.t >= stop.start) & (self.t < end)
            for name in stop.axis:
                out[during, AXES.index(name)] = True
        return out

    def summary(self) -> dict[str, Any]:
        """All data of the run except its arrays, ready for JSON."""
        end = float(self.t[-1]) if len(self.t) else 0.0
        left_out: list[str] = []
        scenario = plain_data(self.scenario, left_out=left_out)
        notes = {**self.notes, "left_out": left_out} if left_out else self.notes
        more: dict[str, Any] = {"notes": notes} if notes else {}
        if self.error is not None:
            more["error"] = dataclasses.asdict(self.error)
        if self.stops:
            more["stops"] = [dataclasses.asdict(x) for x in self.stops]
        return {
            "schema": RECORD_SCHEMA,
            "status": self.status,
            "outcome": dataclasses.asdict(self.outcome),
            "scenario": scenario,
            "crossings": [dataclasses.asdict(c) for c in self.crossings],
            "energy": self.energy,
            "regions": self.regions(),
            "samples": len(self.t),
            "steps": self.steps,
            "simulated_time_s": end,
            "wall_time_s": self.wall_time,
            "real_time_factor": end / self.wall_time if self.wall_time > 0.0 else None,
            "units": UNITS | self._units(),
            "versions": self.versions,
            **more,
        }

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes record.npz, summary.json and scenario.toml, each whole or not at all.

        Args:
            path: the folder.

        Returns:
            The folder.

        Raises:
            ParameterError: the folder cannot be made or written.
        """
        folder = Path(path)
        head = {k: v for k, v in self.summary().items() if k != "regions"}
        arrays: dict[str, Any] = {name: getattr(self, name) for name in ARRAYS} | self.extra
        if self.ground is not None:
            arrays["ground"] = self.ground
        with atomic(folder / "record.npz") as f:
            np.savez(f, summary=np.array(json.dumps(head)), **arrays)
        with atomic(folder / "summary.json") as f:
            f.write((json.dumps(self.summary(), indent=2) + "\n").encode())
        if "left_out" in head.get("notes", {}):  # a function has no file; an older one misleads
            (folder / "scenario.toml").unlink(missing_ok=True)
        else:
            self.scenario.save(folder / "scenario.toml")
        return folder

    @classmethod
    @checked
    def load(cls, path: str | os.PathLike[str]) -> Record:
        """Reads what `save` wrote.

        Args:
            path: the folder, or its record.npz.

        The law of a controller is stored by name and imported when a run starts. A function that
        could not be stored is left out of the scenario; notes say so.

        Raises:
            ParameterError: there is no record, or it has another schema.
        """
        file = Path(path)
        file = file / "record.npz" if os.path.isdir(file) else file
        try:
            check_regular(file)
            if os.path.isdir(path) and not os.path.exists(file):
                raise ValueError(f"{file.name} is not in this folder")
            if os.path.isfile(file) and not zipfile.is_zipfile(file):
                raise ValueError("give its folder, or its record.npz; this is another file")
            with open(file, "rb") as f, np.load(f, allow_pickle=False) as z:
                check_headers(z.zip)
                head = parse_json(str(z["summary"]))
                arrays = {name: z[name] for name in ARRAYS}
                extra = {name: z[name] for name in EXTRA if name in z}
                ground = z["ground"] if "ground" in z else None
            schema = head["schema"]
            if schema in (RECORD_SCHEMA, RECORD_SCHEMA_0_2):
                check_head(head)
                scenario, lost = _scenario(with_present_names(head["scenario"]))
                _check(arrays | extra, scenario)
                _check_ground(ground, scenario)
                check_times(arrays["t"])
                return cls(
                    **arrays,
                    scenario=scenario,
                    outcome=Outcome(**head["outcome"]),
                    crossings=tuple(Crossing(**c) for c in head["crossings"]),
                    energy=with_present_names(head["energy"]),
                    steps=head["steps"],
                    wall_time=head["wall_time_s"],
                    versions=head["versions"],
                    extra=extra,
                    notes=head.get("notes", {}) | ({"left_out": lost} if lost else {}),
                    stops=tuple(Stop(**x) for x in head.get("stops", ())),
                    error=Accuracy(**head["error"]) if head.get("error") else None,
                    ground=ground,
                )
        except DAMAGED as error:
            text = getattr(error, "strerror", None) or " ".join(str(error).split())
            what = text or type(error).__name__
            raise ParameterError("record", str(path), f"must be a saved record ({what})") from None
        raise ParameterError("record", str(path), f"must have schema {RECORD_SCHEMA}, has {schema}")


def _check(arrays: dict[str, np.ndarray], scenario: Scenario) -> None:
    """Raises ValueError unless arrays are finite and have their shapes."""
    t = arrays["t"]
    for name, x in arrays.items():
        parts = parts_of(name, scenario)
        shape = (t.size, len(parts)) if parts else (t.size,)
        if x.shape != shape or x.dtype != np.float64:
            raise ValueError(
                f"array {name} must be float64 of shape {shape}, is {x.dtype} of shape {x.shape}"
            )
        if not np.isfinite(x).all():
            raise ValueError(f"array {name} must be finite, is {x[~np.isfinite(x)][0]} somewhere")


def _check_ground(ground: np.ndarray | None, scenario: Scenario) -> None:
    """Raises ValueError unless each cell of clay that stays cut, if any, has a height."""
    block = scenario.clay and scenario.clay.ground
    shape, got = block.shape if block else None, None if ground is None else ground.shape
    if shape != got or (ground is not None and not np.isfinite(ground).all()):
        raise ValueError(f"array ground must be finite and of shape {shape}, has {got}")


def _flow_at(clay: Clay | None, i: int, place: np.ndarray) -> tuple[float, float, float]:
    """Fy, K and n of an axis at a place."""
    if clay is None:
        return 0.0, 0.0, 1.0
    Fy, K, n = map(float, clay.laws[i].flows_at(*place))
    return Fy, K, n


def _scenario(data: dict[str, Any]) -> tuple[Scenario, list[str]]:
    """A scenario from its plain data, and what is left out: a controller whose law has no name."""
    try:
        return make_part(Scenario, data), []
    except ParameterError as error:
        if error.field != "controller.law":
            raise
    return make_part(Scenario, {**data, "controller": None}), ["controller"]


def _mean_and_std(x: np.ndarray) -> dict[str, float] | None:
    x = x[np.isfinite(x)]
    return {"mean": float(np.mean(x)), "std": float(np.std(x))} if len(x) else None


def in_plane(record: Record) -> Record:
    """The record along the two axes in which clay and forces lie."""
    if record.p.shape[1] == len(AXES):
        return record
    names = ("p", "v", "fh", "fe", "b", "delta")
    arrays: Any = {name: getattr(record, name)[:, : len(AXES)] for name in names}
    return dataclasses.replace(record, **arrays)


@checked
def port_energy(record: Record) -> np.ndarray:
    """Energy that the hand has put into the handle along each axis.

    The observer of Hannaford, Ryu (IEEE Trans. Robotics and Automation 18, 2002): the integral of
    fh v.

    Args:
        record: of a run.

    Returns:
        [J], shape (n, 2).
    """
    power = record.fh * record.v
    steps = 0.5 * np.diff(record.t)[:, None] * (power[1:] + power[:-1])
    return np.concatenate((np.zeros((1, power.shape[1])), np.cumsum(steps, axis=0)))


@checked
def observed_passivity(record: Record) -> Verdict:
    """Whether a recorded run took more energy from the hand than it returned, at every instant.

    Activity on one record proves that the device is not passive; passivity on one record proves
    nothing about others.

    Args:
        record: of a run, three samples or more.

    Returns:
        Verdict with the least energy [J]. An energy within the uncertainty of the quadrature (the
        integral over every other sample against that over all) counts as passive.

    Raises:
        ParameterError: fewer than three samples.
    """
    if len(record.t) < 3:
        raise ParameterError("record", len(record.t), "must have three samples or more")
    energy = port_energy(record).sum(axis=1)
    power = (record.fh * record.v).sum(axis=1)[::2]
    steps = 0.5 * np.diff(record.t[::2]) * (power[1:] + power[:-1])
    coarse = np.concatenate(([0.0], np.cumsum(steps)))
    uncertain, i = float(np.max(np.abs(coarse - energy[::2]))), int(np.argmin(energy))
    least, at = float(energy[i]), f"{record.t[i]:.4g} s"
    how = f"energy observer on the record, trapezoidal, to {uncertain:.1e} J; least at {at}"
    assumptions, what = ("the run started at rest", "this motion only"), "least energy put in [J]"
    return Verdict(least >= -uncertain, least, math.nan, assumptions, how, what)


@checked
def out_of_band_ratio(record: Record, axis: Literal["x", "y"] = "x") -> float:
    """Share of the rms of the operator's force above the band of the maneuver.

    A stable linear loop answers a maneuver within its band and gives 0; white noise gives nearly 1.
    The second half of the record counts, under a Hann window.

    Args:
        record: of a run with a multisine as its muscle force.
        axis: "x" or "y".

    Returns:
        The share, 0 to 1.

    Raises:
        ParameterError: the muscle force of the run is no multisine, or fewer than 32 samples were
            kept.
    """
    i, muscle = AXES.index(axis), record.scenario.muscle
    if not isinstance(muscle, Multisine) or len(record.t) < 32:
        raise ParameterError(
            "record", record.scenario.name, "must be of a run with a multisine as its muscle force"
        )
    n = len(record.t) // 2
    t, f = record.t[-n:-1], record.fh[-n:-1, i]  # the last step may be short
    power = np.abs(np.fft.rfft((f - f.mean()) * np.hanning(len(f)))) ** 2
    frequency = np.fft.rfftfreq(len(f), t[1] - t[0])
    leak = 4.0 / (t[-1] - t[0])  # main lobe of the window
    return float(np.sqrt(power[frequency > muscle.high + leak].sum() / (power.sum() or 1.0)))
