"""`hapticclay run`: simulates one experiment, or the scenario of a file."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..display import text_table
from ..errors import ParameterError
from ..files import writable
from ..model.constants import AXES
from . import console
from .options import ScenarioWord
from .unused import Unused

if TYPE_CHECKING:
    from ..fields import Axis
    from ..model.clay import Clay
    from ..scene.scenario import Scenario
    from ..simulation.record import Record

MOST_ROWS = 6  # of a kind that the table shows
FORMATS = {
    "steady fe [N]": ".5g",
    "held [% of time]": ".1f",
    "fe/v [N.s/m]": ".5g",
    "fh/v [N.s/m]": ".5g",
    "steady v [m/s]": "z.6f",
    "expected v [m/s]": "z.6f",
}
MISSING = {  # speeds, and why a stretch has none
    "steady v": "the speed did not settle on that stretch",
    "expected v": "there is no formula with a hand, a varying force or varying clay",
}
LEAST_ENERGY = 1e-24  # [J] 1 kg at 1 pm/s has less
CHOSEN = "is chosen by --error: leave it out"


@dataclass(frozen=True)
class RunCommand:
    """Run one experiment, or a scenario file: print a table, write record, summary and plots.

    --set changes any part by name, as in --set arm.l1=0.3 servo.x.G.damping=50; hapticclay fields
    lists the names. Ctrl-C ends the run and keeps the samples recorded so far.

    Attributes:
        scenario: The experiment, or a scenario file.
        out: Folder for record.npz, scenario.toml, summary.json and the plots; by default
            out/run/EXPERIMENT.
        every: Keep every n-th sample in the record.
        error: Largest allowed error, as in 1e-6 (seconds, of the border-crossing times) or 1e-7m
            (of positions). dt and integrator are then chosen, and verified by runs at other steps.
        plots: Draw the plots.
        figures: Formats and style of the plots.
    """

    scenario: ScenarioWord
    out: Path | None = None
    every: int = 1
    error: str | None = None
    plots: bool = True
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("integrator",), CHOSEN, ("error",)),
        Unused(("dt",), CHOSEN, ("error",), ("control=sampled",)),
        Unused(("dt",), CHOSEN, ("error", "Ts")),
    )

    def __call__(self) -> int:
        out = self.out or console.default_folder("run", self.scenario)
        writable(out)
        for line in unstable_axes(self.scenario):
            print(f"hapticclay: {line}", file=sys.stderr)
        with console.ctrl_c() as stop:
            record = simulate_with_progress(self.scenario, self.every, stop.is_set, self.error)
        deliver_record(record, out, self.figures if self.plots else None)
        return 130 if record.outcome.code == "interrupted" else 0


def unstable_axes(scenario: Scenario) -> list[str]:
    """A line if the linear loop of an axis, in continuous time, is unstable somewhere ahead.

    The limit is the least over clay and poses of the path. Clay that is not viscous is left out:
    the linear limit does not apply to it.
    """
    from ..theory.pose_limits import PoseLimits

    if scenario.clay is None or not scenario.clay.viscous:
        return []
    limits, unstable = PoseLimits(scenario), []
    for i, axis in enumerate(AXES):
        limit = limits.ahead(i)
        if scenario.gain[i] > limit.K:
            unstable.append(f"gain[{axis}] = {scenario.gain[i]:g} > {limit.K:.4g} {limit}")
    return [f"the linear loop is unstable: {', '.join(unstable)}"] if unstable else []


def simulate_with_progress(
    scenario: Scenario,
    every: int,
    stop: Callable[[], bool] | None = None,
    error: str | None = None,
) -> Record:
    from ..simulation.simulate import simulate

    start, length = scenario.start[0], scenario.length
    with console.fraction_bar(scenario.name) as show:

        def progress(t: float, x: float) -> bool:
            way = (x - start) / (length - start) if length is not None else 0.0
            show(max(t / scenario.t_max, way))
            return stop is not None and stop()

        return simulate(scenario, every=every, progress=progress, error=error)


def deliver_record(
    record: Record, folder: Path, figures: console.FigureOptions | None, paced: bool = False
) -> None:
    """Writes a record and its plots, prints its table, and removes plots of an earlier record."""
    try:
        earlier = (folder / "record.npz").exists()
        record.save(folder)
        if figures or earlier:
            from ..views import run_figures

            drawn = run_figures.record_figures(record) if figures else {}
            written = console.save_figures(drawn, folder, figures)
            kept = {path for files in written.values() for path in files}
            for path in run_figures.figure_files(folder) - kept if earlier else ():
                path.unlink(missing_ok=True)
    finally:  # a full disk must not hide the results
        print(run_table(record, paced))
    print(f"written to {folder}")


def run_table(record: Record, paced: bool = False) -> str:
    """What happened in a run, for a terminal."""
    from ..model.signals import Multisine

    s = record.scenario
    ways = s.clay.along if s.clay else "x"
    if not s.clay and abs(s.force[1]) > abs(s.force[0]):
        ways = "y"
    pieces = [(way, piece[way]) for way in ways for piece in record.regions(way)]
    lines = [] if s.is_closed_form else [_joint_table(record), ""]
    if s.axes[:2] != AXES and s.clay is not None:
        lines += [f"x and y of the clay: {' and '.join(s.axes[:2])} of the world", ""]
    if s.is_closed_form or s.clay is not None:
        lines += [_stretch_table(s.clay, pieces[:MOST_ROWS]), ""]
    if len(pieces) > MOST_ROWS and (s.is_closed_form or s.clay is not None):
        lines.insert(len(lines) - 1, f"... and {len(pieces) - MOST_ROWS} more stretches")
    lines += _crossing_lines(record) + _stop_lines(record)
    if (
        isinstance(s.muscle, Multisine) and len(record.t) >= 32
    ):  # the fewest for out_of_band_ratio()
        lines.append(_maneuver_line(record, AXES[s.muscle.rms.index(max(s.muscle.rms))]))
    lines.append(f"status: {record.status}")
    lines += [] if s.is_closed_form else _motion_lines(record)
    if record.outcome.advice:
        lines.append(f"advice: {record.outcome.advice}")
    elif _chatters(s, [r for _, r in pieces]):
        lines.append("advice: --render physical; clay that motors render cannot hold the handle")
    if record.error is not None:
        lines.append(f"error: {record.error}")
        if record.error.note:
            lines.append(f"why: {record.error.note}")
    lines += _energy_lines(record)
    lines.append(_pace_line(record, paced))
    return "\n".join(lines)


def _joint_table(record: Record) -> str:
    """What the joints of an arm from a file did."""
    from ..arms.joint_units import table_of
    from ..scene.joint_numbers import references, torque_limits, turning

    s, some = record.scenario, len(record.t) > 0
    pulled, limits = references(s), torque_limits(s)
    table: dict[str, Any] = {"joint": s.joints}
    if some:
        table["start [rad]"], table["end [rad]"] = record.q[0].tolist(), record.q[-1].tolist()
    if pulled is not None:
        table["reference [rad]"] = pulled.tolist()
    if some:
        table["largest rate [rad/s]"] = abs(record.qd).max(axis=0).tolist()
        table["largest torque [N.m]"] = abs(record.tau).max(axis=0).tolist()
    if any(map(math.isfinite, limits)):
        table["limit [N.m]"] = [x if math.isfinite(x) else math.nan for x in limits]
    table = table_of(table, turning(s))
    return text_table(table, dict.fromkeys(table, "z.4g"))


def _motion_lines(record: Record) -> list[str]:
    """The swing of the joints, if there is one."""
    from ..studies.joint_motion import joint_motion

    try:
        return [f"motion: {joint_motion(record).headline()}"]
    except ParameterError:
        return []


def _pace_line(record: Record, paced: bool) -> str:
    """How long the steps took; a run that waits for a clock has no speed of its own."""
    end = float(record.t[-1]) if len(record.t) else 0.0
    if paced:
        share = f" of {end:.4g} s simulated" if end else ""
        return f"{record.steps} steps; computing took {record.wall_time:.2f} s{share}"
    speed = end / record.wall_time if record.wall_time else 0.0
    return f"{record.steps} steps in {record.wall_time:.2f} s, {speed:.0f} times real time"


def _crossing_lines(record: Record) -> list[str]:
    lines = []
    for c in record.crossings[:MOST_ROWS]:
        at = f"border {c.axis} = {100 * c.border + 0.0:g} cm"
        lines.append(f"{at} crossed at {c.time:.6f} s with {c.speed:z.6f} m/s")
    if len(record.crossings) > MOST_ROWS:
        lines.append(f"... and {len(record.crossings) - MOST_ROWS} more crossings")
    return lines


def _energy_lines(record: Record) -> list[str]:
    through = record.energy.get("throughput", 0.0)
    if through < LEAST_ENERGY:  # of an arm at rest: rounding
        return []
    share = abs(record.energy["residual"]) / through
    return [f"energy: balanced within {share:.1e} of {through:.4g} J"]


def _stop_lines(record: Record) -> list[str]:
    lines = []
    shown = [x for i, x in enumerate(record.stops) if i < MOST_ROWS or x.end is None]
    for x in shown:
        until = "to the end" if x.end is None else f"to {x.end:.6f} s"
        lines.append(f"{' and '.join(x.axis)} held still from {x.start:.6f} s {until}")
    if len(record.stops) > len(shown):
        lines.append(f"... and {len(record.stops) - len(shown)} more stops")
    return lines


def _chatters(s: Scenario, stretches: list[dict[str, Any]]) -> bool:
    """Whether clay that should hold the handle is rendered by the motors from the velocity."""
    rendered = s.control == "sampled" and s.render == "held"
    if not rendered or (s.hardware and (s.hardware.coupling or s.hardware.passivity)):
        return False
    return any(r.get("Fy") and r["expected_speed"] == 0.0 for r in stretches)


def _stretch_table(clay: Clay | None, pieces: list[tuple[str, dict[str, Any]]]) -> str:
    """Clay, forces and speeds on each stretch of an axis."""
    rows = [r for _, r in pieces]
    table: dict[str, list[Any]] = {"path [cm]": [_ends(way, r) for way, r in pieces]}
    for c in clay.columns if clay else []:
        table[f"{c.name} [{c.unit}]" if c.unit else c.name] = [r[c.name] for r in rows]
    table["b [N.s/m]"] = [_damping(r) for r in rows]
    if clay and clay.holding:
        table["steady fe [N]"] = [_known(r["steady_fe"]) for r in rows]
        table["held [% of time]"] = [100.0 * r["held"] for r in rows]
    else:
        ratios = [None if _grows(r) else r["fe_over_v"] for r in rows]
        felt = [r["steady_fh_over_v"] for r in rows]
        table["fe/v [N.s/m]"] = [x["mean"] if x else math.nan for x in ratios]
        table["fh/v [N.s/m]"] = [x["mean"] if x else math.nan for x in felt]
    table["steady v [m/s]"] = [_known(r["steady_speed"]) for r in rows]
    table["expected v [m/s]"] = [_known(r["expected_speed"]) for r in rows]
    notes = [
        f"{name} -: {why}"
        for name, why in MISSING.items()
        if any(map(math.isnan, table[f"{name} [m/s]"]))
    ]
    return "\n".join([text_table(table, FORMATS), *notes])


def _known(x: float | None) -> float:
    return math.nan if x is None else x


def _ends(way: str, r: dict[str, Any]) -> str:
    return f"{way}: {100 * r['from_m']:z.2f} - {100 * r['to_m']:z.2f}"


def _grows(r: dict[str, Any]) -> bool:
    return r["b"] != r["b_end"]


def _damping(r: dict[str, Any]) -> str:
    return f"{r['b']:.4g} - {r['b_end']:.4g}" if _grows(r) else f"{r['b']:g}"


def _maneuver_line(record: Record, axis: Axis) -> str:
    from ..simulation.record import out_of_band_ratio

    rms = float((record.fh[:, AXES.index(axis)] ** 2).mean() ** 0.5)
    measured = f"rms {rms:.4g} N, out of band {out_of_band_ratio(record, axis):.4f}"
    return f"operator's force along {axis}: {measured}"
