"""`hapticclay run`: simulates one experiment, or the scenario of a file."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..files import writable
from ..model.constants import AXES
from . import console
from .options import ScenarioWord
from .unused import Unused, undrawn

if TYPE_CHECKING:
    from ..model.clay import Clay
    from ..scene.scenario import Scenario
    from ..simulation.record import Record

MOST_ROWS = 6  # of a kind that the table shows
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
        *undrawn("no-plots"),
    )

    def __call__(self) -> int:
        out = self.out or console.default_folder("run", self.scenario)
        writable(out)
        for line in unstable_axes(self.scenario):
            print(f"hapticclay: {line}", file=sys.stderr)
        with console.ctrl_c() as stop:
            record = simulate_with_progress(self.scenario, self.every, stop.is_set, self.error)
        deliver(record, out, self.figures if self.plots else None)
        return 130 if record.outcome.code == "interrupted" else 0


def unstable_axes(scenario: Scenario) -> list[str]:
    """A line if the linear loop of an axis, in continuous time, is unstable somewhere ahead.

    The limit is the least over clay and poses of the path. Clay that is not viscous is left out:
    the linear limit does not apply to it.
    """
    from ..theory.pose_limits import PoseLimits

    if scenario.clay is None or not scenario.clay.viscous:
        return []
    limits, told = PoseLimits(scenario), []
    for i, axis in enumerate(AXES):
        limit = limits.ahead(i)
        if scenario.gain[i] > limit.K:
            told.append(f"gain[{axis}] = {scenario.gain[i]:g} > {limit.K:.4g} {limit}")
    return [f"the linear loop is unstable: {', '.join(told)}"] if told else []


def simulate_with_progress(
    scenario: Scenario,
    every: int,
    stop: Callable[[], bool] | None = None,
    error: str | None = None,
) -> Record:
    """Runs simulate() under a progress bar."""
    from ..simulation.simulate import simulate

    start, length = scenario.start[0], scenario.length
    with console.fraction_bar(scenario.name) as show:

        def progress(t: float, x: float) -> bool:
            way = (x - start) / (length - start) if length is not None else 0.0
            show(max(t / scenario.t_max, way))
            return stop is not None and stop()

        return simulate(scenario, every=every, progress=progress, error=error)


def deliver(
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
    shown = _columns(s.clay)
    rows = [[text(way, r) for text in shown.values()] for way, r in pieces[:MOST_ROWS]]
    lines = [console.text_table(rows, list(shown), "r" * len(shown)), ""]
    if len(pieces) > MOST_ROWS:
        lines.insert(1, f"... and {len(pieces) - MOST_ROWS} more stretches")
    lines += _crossing_lines(record) + _stop_lines(record)
    if (
        isinstance(s.muscle, Multisine) and len(record.t) >= 32
    ):  # the fewest for out_of_band_ratio()
        lines.append(_maneuver_line(record, AXES[s.muscle.rms.index(max(s.muscle.rms))]))
    lines.append(f"status: {record.status}")
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
        lines.append(f"{at} crossed at {c.time:.6f} s with {console.fixed(c.speed, 6)} m/s")
    if len(record.crossings) > MOST_ROWS:
        lines.append(f"... and {len(record.crossings) - MOST_ROWS} more crossings")
    return lines


def _energy_lines(record: Record) -> list[str]:
    through = record.energy.get("throughput", 0.0)
    if not through:
        return []
    share = abs(record.energy["residual"]) / through
    return [f"energy: balanced within {share:.1e} of {through:.4g} J"]


def _stop_lines(record: Record) -> list[str]:
    lines = []
    told = [x for i, x in enumerate(record.stops) if i < MOST_ROWS or x.end is None]
    for x in told:
        until = "to the end" if x.end is None else f"to {x.end:.6f} s"
        lines.append(f"{' and '.join(x.axis)} held still from {x.start:.6f} s {until}")
    if len(record.stops) > len(told):
        lines.append(f"... and {len(record.stops) - len(told)} more stops")
    return lines


def _chatters(s: Scenario, stretches: list[dict[str, Any]]) -> bool:
    """Whether clay that should hold the handle is rendered by the motors from the velocity."""
    rendered = s.control == "sampled" and s.render == "held"
    if not rendered or (s.hardware and (s.hardware.coupling or s.hardware.passivity)):
        return False
    return any(r.get("Fy") and r["expected_speed"] == 0.0 for r in stretches)


def _columns(clay: Clay | None) -> dict[str, Callable[[str, dict[str, Any]], str]]:
    """Head of each column of the table, and its text for an axis and a stretch."""

    def value(name: str) -> Callable[[str, dict[str, Any]], str]:
        return lambda _, r: f"{r[name]:.4g}"

    def mean(name: str) -> Callable[[str, dict[str, Any]], str]:
        return lambda _, r: f"{r[name]['mean']:.5g}" if r[name] else "-"

    own = clay.columns if clay else []
    out = {"path\n[cm]": _stretch}
    out |= {f"{c.name}\n[{c.unit}]" if c.unit else c.name: value(c.name) for c in own}
    out["b\n[N.s/m]"] = _damping
    if clay and clay.holding:
        out["steady fe\n[N]"] = lambda _, r: (
            "-" if r["steady_fe"] is None else f"{r['steady_fe']:.5g}"
        )
        out["held\n[% of time]"] = lambda _, r: f"{100 * r['held']:.1f}"
    else:
        out["fe/v\n[N.s/m]"] = lambda way, r: "-" if _grows(r) else mean("fe_over_v")(way, r)
        out["fh/v\n[N.s/m]"] = mean("steady_fh_over_v")
    for name in ("steady", "expected"):
        out[f"{name} v\n[m/s]"] = lambda _, r, name=name: console.fixed(r[f"{name}_speed"], 6)
    return out


def _stretch(way: str, r: dict[str, Any]) -> str:
    return f"{way}: {console.fixed(100 * r['from_m'], 2)} - {console.fixed(100 * r['to_m'], 2)}"


def _grows(r: dict[str, Any]) -> bool:
    return r["b"] != r["b_end"]


def _damping(_: str, r: dict[str, Any]) -> str:
    return f"{r['b']:.4g} - {r['b_end']:.4g}" if _grows(r) else f"{r['b']:g}"


def _maneuver_line(record: Record, axis: str) -> str:
    from ..simulation.record import out_of_band_ratio

    rms = float((record.fh[:, AXES.index(axis)] ** 2).mean() ** 0.5)
    measured = f"rms {rms:.4g} N, out of band {out_of_band_ratio(record, axis):.4f}"
    return f"operator's force along {axis}: {measured}"
