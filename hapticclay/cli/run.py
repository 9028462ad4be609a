"""`hapticclay run`, and what the commands that run something share: the progress bar, the table, the files."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ..files import atomic, writable
from ..model.constants import AXES
from ..model.experiments import constant_cut, free, stability_test, variable_cut
from ..model.scenario import Scenario
from ..simulation.record import Record, irregularity
from ..simulation.simulate import simulate

Experiment = (
    Annotated[Scenario, tyro.conf.subcommand("constant", constructor=constant_cut)]
    | Annotated[Scenario, tyro.conf.subcommand("variable", constructor=variable_cut)]
    | Annotated[Scenario, tyro.conf.subcommand("stability", constructor=stability_test)]
    | Annotated[Scenario, tyro.conf.subcommand("free", constructor=free)]
)
ROWS = 6  # of a kind that the table shows


@dataclass(frozen=True)
class Run:
    """Run one experiment: print a table, write the record, its summary and its plots.

    Ctrl-C ends the run and keeps what was run.
    """

    scenario: Experiment
    out: Annotated[
        Path | None, tyro.conf.arg(help_behavior_hint="(default: out/run/EXPERIMENT)")
    ] = None
    """Folder for record.npz, summary.json and the plots."""
    every: int = 1
    """Keep every n-th sample in the record."""
    plots: bool = True
    """Draw the plots."""

    def __call__(self) -> int:
        out = self.out or Path("out/run", self.scenario.name)
        writable(out)
        with ctrl_c() as asked:
            record = simulate_with_progress(self.scenario, self.every, asked)
        deliver(record, out, self.plots)
        return 130 if record.outcome.code == "interrupted" else 0


@contextlib.contextmanager
def ctrl_c() -> Iterator[Callable[[], bool]]:
    """Yields what tells whether Ctrl-C has been pressed; a second one interrupts as ever."""
    pressed = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield pressed.is_set
        return
    before = signal.getsignal(signal.SIGINT)

    def note(number: int, frame: object) -> None:
        pressed.set()
        signal.signal(signal.SIGINT, before)

    if (
        before is signal.default_int_handler
    ):  # not where somebody ignores it, as nohup and shells do for jobs behind
        signal.signal(signal.SIGINT, note)
    try:
        yield pressed.is_set
    finally:
        signal.signal(signal.SIGINT, before)


def simulate_with_progress(
    scenario: Scenario, every: int, stop: Callable[[], bool] = lambda: False
) -> Record:
    """simulate() under a progress bar that shows itself after two seconds, on a terminal; until stop() is true."""
    from tqdm import tqdm

    start, length = scenario.start[0], scenario.length
    form = "{desc} {percentage:3.0f}% |{bar}| {elapsed} <{remaining}"
    with tqdm(
        total=1.0, desc=scenario.name, delay=2.0, bar_format=form, disable=None, leave=False
    ) as bar:

        def show(t: float, x: float) -> bool:
            way = (x - start) / (length - start) if length is not None else 0.0
            bar.update(max(0.0, min(1.0, max(t / scenario.t_max, way)) - bar.n))
            return stop()

        return simulate(scenario, every=every, progress=show)


def deliver(record: Record, folder: Path, plots: bool) -> None:
    """Prints the table of a record and writes it with its plots; plots of an earlier record in this folder go.

    Raises:
        ParameterError: something cannot be written.
    """
    try:
        _keep(record, folder, plots)
    finally:  # a full disk must not hide what was found
        print(table(record))
    print(f"written to {folder}")


def _keep(record: Record, folder: Path, plots: bool) -> None:
    earlier = (folder / "record.npz").exists()
    record.save(folder)
    if not (plots or earlier):
        return
    from ..views import run_plots

    drawn = run_plots.figures(record) if plots else {}
    for name, figure in drawn.items():
        with atomic(folder / f"{name}.png") as f:
            figure.savefig(f, format="png")
    for name in set(run_plots.FIGURES) - set(drawn) if earlier else ():
        (folder / f"{name}.png").unlink(missing_ok=True)


def table(record: Record) -> str:
    """What a person wants to know of a run at once."""
    from tabulate import tabulate

    s = record.scenario
    ways = s.clay.x.along if s.clay else "x"
    if s.clay and s.clay.y.along != ways:
        ways = "xy"
    elif not s.clay and abs(s.force[1]) > abs(s.force[0]):
        ways = "y"
    pieces = [(way, piece[way]) for way in ways for piece in record.regions(way)]
    rows = []
    for way, r in pieces[:ROWS]:
        fe, fh = r["fe_over_v"], r["steady_fh_over_v"]
        rows.append(
            [
                f"{way}: {fixed(100 * r['from_m'], 2)} - {fixed(100 * r['to_m'], 2)}",
                f"{r['b']:g}" if r["b"] == r["b_end"] else f"{r['b']:.4g} - {r['b_end']:.4g}",
                f"{fe['mean']:.5g}" if fe and r["b"] == r["b_end"] else "-",
                f"{fh['mean']:.5g}" if fh else "-",
                *(
                    "-" if r[k] is None else fixed(r[k], 6)
                    for k in ("steady_speed", "expected_speed")
                ),
            ]
        )
    force = "[N.s/m]"
    head = [
        "path\n[cm]",
        f"b\n{force}",
        f"fe/v\n{force}",
        f"fh/v\n{force}",
        "steady v\n[m/s]",
        "expected v\n[m/s]",
    ]
    lines = [tabulate(rows, head, colalign=("right",) * 6, disable_numparse=True), ""]
    if len(pieces) > ROWS:
        lines.insert(1, f"... and {len(pieces) - ROWS} more stretches")
    for c in record.crossings[:ROWS]:
        at = f"border {c.axis} = {100 * c.border + 0.0:g} cm"
        lines.append(f"{at} crossed at {c.time:.6f} s with {fixed(c.speed, 6)} m/s")
    if len(record.crossings) > ROWS:
        lines.append(f"... and {len(record.crossings) - ROWS} more crossings")
    if s.muscle is not None and len(record.t) >= 32:  # irregularity() asks for so many
        axis = AXES[s.muscle.rms.index(max(s.muscle.rms))]
        rms = float((record.fh[:, AXES.index(axis)] ** 2).mean() ** 0.5)
        lines.append(
            f"operator's force along {axis}: rms {rms:.4g} N, irregularity {irregularity(record, axis):.4f}"
        )
    lines.append(f"status: {record.status}")
    if record.outcome.advice:
        lines.append(f"advice: {record.outcome.advice}")
    speed = record.t[-1] / record.wall_time if len(record.t) and record.wall_time else 0.0
    lines.append(f"{record.steps} steps in {record.wall_time:.2f} s, {speed:.0f} times real time")
    return "\n".join(lines)


def fixed(x: float, digits: int) -> str:
    """x with so many decimals; never -0."""
    return f"{round(x, digits) + 0.0:.{digits}f}"
