"""The command line: `hapticclay`, or `python -m hapticclay`."""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from . import cli_view
from .cli_stability import Stability
from .errors import ParameterError, choice
from .experiments import SCENARIOS, constant_cut, free, irregularity, stability_test, variable_cut
from .params import AXES, Scenario
from .record import Record, atomic, versions, writable
from .removal import TOOL, Tool
from .sim import simulate
from .sweep_command import SweepCommand

Experiment = (
    Annotated[Scenario, tyro.conf.subcommand("constant", constructor=constant_cut)]
    | Annotated[Scenario, tyro.conf.subcommand("variable", constructor=variable_cut)]
    | Annotated[Scenario, tyro.conf.subcommand("stability", constructor=stability_test)]
    | Annotated[Scenario, tyro.conf.subcommand("free", constructor=free)]
)


def recorded(path: tyro.conf.Positional[Path]) -> Record:
    """A saved record.

    Args:
        path: its folder, or its record.npz.
    """
    return Record.load(path)


Recorded = Annotated[Record, tyro.conf.subcommand("record", constructor=recorded)]


@dataclass(frozen=True)
class Run:
    """Run one experiment: print a table, write the record, its summary and its plots."""

    scenario: Experiment
    out: Path = Path("out")
    """Folder for record.npz, summary.json and the plots."""
    every: int = 1
    """Keep every n-th sample in the record."""
    plots: bool = True
    """Draw the plots."""

    def __call__(self) -> int:
        writable(self.out)
        record = simulate_with_progress(self.scenario, self.every)
        try:
            record.save(self.out)
            if self.plots:
                draw(record, self.out)
        finally:  # a full disk must not hide what was found
            print(table(record))
        print(f"written to {self.out}")
        return 0


@dataclass(frozen=True)
class Reproduce:
    """Run the whole paper: every figure and number beside ours, on one page.

    The exit status is 1 if a number that should agree does not.
    """

    out: Path = Path("out/paper")
    """Folder for report.html (self-contained), report.md, ledger.json and figures/."""
    quick: bool = False
    """Leave out the map of Sh over the workspace."""
    page: Path | None = None
    """Also write the ledger alone, as Markdown, to this file."""

    def __call__(self) -> int:
        writable(self.out)
        from tqdm import tqdm

        from . import report

        with tqdm(total=0, delay=2.0, bar_format="{elapsed} {desc}", disable=None, leave=False) as bar:
            rows = report.reproduce(self.out, self.quick, lambda name: bar.set_description_str(name))
        if self.page:
            with atomic(self.page) as f:
                f.write(report.paper_page(rows).encode())
        wrong = [r for r in rows if r.agrees is False]
        for r in wrong:
            print(f"does not agree: {r.what} ({r.where}): {report.number(r.ours, r.unit)}, {report.error(r)}")
        agree = sum(r.agrees is True for r in rows)
        print(f"{agree} of {agree + len(wrong)} numbers agree; {len(rows) - agree - len(wrong)} more are explained")
        print(f"report: {(self.out / 'report.html').resolve()}")
        return 1 if wrong else 0


@dataclass(frozen=True)
class View:
    """Take part: pull the handle with the mouse, in a window or a browser; or replay a record (its folder).

    The person is the muscle: force, length and t_max of the experiment do not count. On exit the record, its
    summary and its plots are written.
    """

    scenario: Experiment | Recorded
    stiffness: float = 10.0
    """Of the hand, as a multiple of the spring of Th (Eq. 19): 1 is the paper's arm at rest."""
    tool_width: float = TOOL.width
    """Width of the tool [m]."""
    tool_depth: float = TOOL.depth
    """Depth of the cut [m]."""
    out: Path = Path("out")
    """Folder for record.npz, summary.json and the plots."""
    every: int = 10
    """Keep every n-th sample in the record."""
    plots: bool = True
    """Draw the plots."""
    web: bool = False
    """Show it in a browser, without a display of our own."""
    host: str = "127.0.0.1"
    """Address to serve the browser on; other than this machine's, a token guards it."""
    port: int = 8080
    """Port to serve the browser on."""

    def __call__(self) -> int:
        tool = Tool(self.tool_width, self.tool_depth)
        if isinstance(self.scenario, Record):
            if self.web:
                raise ParameterError("web", True, "shows sessions only: make a film of a record with hapticclay video")
            cli_view.replay(self.scenario, tool)
            return 0
        writable(self.out)
        record = cli_view.look(self.scenario, self.stiffness, tool, self.every, self.web, self.host, self.port)
        if record is None:
            print("nothing was recorded")
            return 0
        record.save(self.out)
        if self.plots:
            draw(record, self.out)
        print(table(record))
        print(f"written to {self.out}")
        return 0


@dataclass(frozen=True)
class Video:
    """Film a record (its folder) or an experiment: arm, clay and running plots side by side."""

    scenario: Experiment | Recorded
    out: Path = Path("out/film.mp4")
    """The file: .mp4, .webp or .gif."""
    camera: Literal["room", "top", "close"] = "room"
    """Where to look from."""
    speed: float = 1.0
    """1 is real time, 2 twice as fast."""
    size: tuple[int, int] = (960, 480)
    """Width and height [pixels]."""
    plots: bool = True
    """Run the plots on the right."""
    smooth: bool = False
    """Soften edges and shadows; takes twice as long without a graphics card."""
    tool_width: float = TOOL.width
    """Width of the tool [m]."""
    tool_depth: float = TOOL.depth
    """Depth of the cut [m]."""

    def __call__(self) -> int:
        tool = Tool(self.tool_width, self.tool_depth)
        writable(self.out.parent)
        s = self.scenario
        made = cli_view.film(
            lambda: s if isinstance(s, Record) else simulate_with_progress(s, 1),
            self.out, self.camera, self.speed, self.size, self.plots, tool, self.smooth,
        )  # fmt: skip
        print(f"written to {made}")
        return 0


@dataclass(frozen=True)
class Version:
    """Print the versions of hapticclay and of what it runs on."""

    def __call__(self) -> int:
        print("  ".join(f"{name} {number}" for name, number in versions().items()))
        return 0


MARKERS = (tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes, tyro.conf.CascadeSubcommandArgs)


@dataclass(frozen=True)
class Bench:
    """Error against run time beside peers, stiff and extreme scenes, throughput: diagrams, a page, the figures as JSON.

    Needs a checkout (the benchmarks are not installed); a peer whose package is missing is listed as left out.
    """

    out: Path = Path("out/bench")
    """Folder for bench.md, the data and the diagrams."""
    quick: bool = False
    """Fewer jobs, settings and scenes: about a minute."""

    def __call__(self) -> int:
        folder = Path(__file__).resolve().parents[1] / "benchmarks"
        if not (folder / "bench.py").is_file():
            raise ParameterError(
                "benchmarks", str(folder), "not found: run from a checkout, after pip install -e .[bench]"
            )
        writable(self.out)
        sys.path.insert(0, str(folder))
        import importlib

        importlib.import_module("bench").main(self.out, self.quick)
        return 0


@dataclass(frozen=True)
class Identify:
    """Identify G, Sh and Th on the simulated arm: frequency responses, fits, Figs. 4, 5, 6 (half a minute)."""

    out: Path = Path("out/identify")
    """Folder for identify.json, fig4.png, fig5.png, fig6.png and map.png."""
    axis: Literal["x", "y", "both"] = "both"
    """Which axis."""
    noise: bool = False
    """Record with noise: encoders of 65536 counts a turn, a force sensor of 0.02 N rms."""
    map: bool = False
    """Also how G and Sh drift over the workspace, with and without inertia shaping (two minutes more)."""
    quick: bool = False
    """Shorter signals, a coarser map."""
    seed: int = 0
    """Of the signals' phases and of the noise."""
    control: Literal["continuous", "sampled"] = "continuous"
    """Sampled control is slow: some ten minutes, two with --quick."""

    def __call__(self) -> int:
        from . import identify_command

        writable(self.out)
        axes = AXES if self.axis == "both" else (self.axis,)
        identify_command.run(self.out, axes, self.noise, self.map, self.quick, self.seed, self.control)
        print(f"written to {self.out}")
        return 0


Command = (
    Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Stability, tyro.conf.subcommand("stability")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[SweepCommand, tyro.conf.subcommand("sweep")]
    | Annotated[Identify, tyro.conf.subcommand("identify")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[View, tyro.conf.subcommand("view")]
    | Annotated[Video, tyro.conf.subcommand("video")]
    | Annotated[Version, tyro.conf.subcommand("version")]
)


def simulate_with_progress(scenario: Scenario, every: int) -> Record:
    """simulate() under a progress bar that shows itself after two seconds, on a terminal."""
    from tqdm import tqdm

    start, length = scenario.start[0], scenario.length
    form = "{desc} {percentage:3.0f}% |{bar}| {elapsed} <{remaining}"
    with tqdm(total=1.0, desc=scenario.name, delay=2.0, bar_format=form, disable=None, leave=False) as bar:

        def show(t: float, x: float) -> None:
            way = (x - start) / (length - start) if length is not None else 0.0
            bar.update(max(0.0, min(1.0, max(t / scenario.t_max, way)) - bar.n))

        return simulate(scenario, every=every, progress=show)


def table(record: Record) -> str:
    """What a person wants to know of a run at once."""
    from tabulate import tabulate

    def cell(x, form: str) -> str:
        return "-" if x is None else format(x, form)

    s = record.scenario
    ways = s.clay.x.along if s.clay else "x"
    if s.clay and s.clay.y.along != ways:
        ways = "xy"
    elif not s.clay and abs(s.force[1]) > abs(s.force[0]):
        ways = "y"
    rows = []
    pieces = [(way, piece[way]) for way in ways for piece in record.regions(way)]
    for way, r in pieces[:6]:
        fe, fh = r["fe_over_v"], r["steady_fh_over_v"]
        rows.append(
            [
                f"{way}: {100 * r['from_m']:.2f} - {100 * r['to_m']:.2f}",
                f"{r['b']:g}" if r["b"] == r["b_end"] else f"{r['b']:.4g} - {r['b_end']:.4g}",
                cell(fe["mean"] if fe and r["b"] == r["b_end"] else None, ".5g"),
                cell(fh and fh["mean"], ".5g"),
                cell(r["steady_speed"], ".6f"),
                cell(r["expected_speed"], ".6f"),
            ]
        )
    head = ["path [cm]", "b [N.s/m]", "fe/v [N.s/m]", "fh/v [N.s/m]", "steady v [m/s]", "expected v [m/s]"]
    lines = [tabulate(rows, head, colalign=("right",) * 6, disable_numparse=True), ""]
    if len(pieces) > 6:
        lines.insert(1, f"... and {len(pieces) - 6} more stretches")
    for c in record.crossings[:6]:
        lines.append(f"border {c.axis} = {100 * c.border:g} cm crossed at {c.time:.6f} s with {c.speed:.6f} m/s")
    if len(record.crossings) > 6:
        lines.append(f"... and {len(record.crossings) - 6} more crossings")
    if s.muscle is not None:
        axis = AXES[s.muscle.rms.index(max(s.muscle.rms))]
        rms = float((record.fh[:, AXES.index(axis)] ** 2).mean() ** 0.5)
        lines.append(f"operator's force along {axis}: rms {rms:.4g} N, irregularity {irregularity(record, axis):.4f}")
    lines.append(f"status: {record.status}")
    if record.outcome.advice:
        lines.append(f"advice: {record.outcome.advice}")
    speed = record.t[-1] / record.wall_time if len(record.t) and record.wall_time else 0.0
    lines.append(f"{record.steps} steps in {record.wall_time:.2f} s, {speed:.0f} times real time")
    return "\n".join(lines)


def draw(record: Record, folder: Path) -> None:
    """Writes the figures of a run as PNG."""
    from . import plot

    for name, figure in plot.figures(record).items():
        with atomic(folder / f"{name}.png") as f:
            figure.savefig(f, format="png")


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line; returns its exit status: 0, 2 for bad input, 130 for Ctrl-C."""
    complaint = io.StringIO()
    argv = list(sys.argv[1:] if argv is None else argv)
    with contextlib.suppress(AttributeError, ValueError):
        sys.stdout.reconfigure(errors="replace")  # a terminal that knows no frames or bullets
    try:
        try:
            with contextlib.redirect_stderr(complaint):
                command = tyro.cli(
                    Command,
                    prog="hapticclay",
                    description="Virtual clay, cut with a simulated haptic arm.",
                    args=cli_view.complete(argv),
                    config=MARKERS,
                )
        except SystemExit as stop:
            if stop.code in (0, None):
                return 0
            _check_names(argv)
            raise ParameterError("arguments", "", _one_line(complaint.getvalue())) from None
        code = command()
        sys.stdout.flush()
        return code
    except ParameterError as error:
        text = error.bound if error.field == "arguments" else str(error)
        print(f"hapticclay: {text}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # whoever read our output has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        print(f"hapticclay: {error}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        print("hapticclay: interrupted", file=sys.stderr)
        return 130


def _check_names(words: list[str]) -> None:
    """Says which command or experiment was meant, where a word is none of them."""
    if words and not words[0].startswith("-"):
        choice(
            "command",
            words[0],
            ("run", "view", "video", "reproduce", "stability", "identify", "sweep", "bench", "version"),
        )
    if words[:1] == ["run"] and not any(w in SCENARIOS for w in words) and words[1:2] and words[1][:1] != "-":
        choice("experiment", words[1], tuple(SCENARIOS))


def _one_line(box: str) -> str:
    """The message of tyro's framed complaint, without frame and hints on help."""
    lines = [re.sub(r"[\u2500-\u257f]+", " ", line).strip() for line in box.splitlines()]
    text: list[str] = []
    for line, raw in zip(lines[1:], box.splitlines()[1:], strict=False):
        if "\u2500" * 5 in raw and text:
            break
        if line:
            text.append(line)
    return " ".join(text) or " ".join(filter(None, lines)) or "bad arguments"
