"""The command line: `hapticclay`, or `python -m hapticclay`."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Union

import tyro

from ..errors import ParameterError
from ..model.scenario import AXES
from ..simulation.record import atomic, versions, writable
from . import words as cli_words
from .run import Run
from .stability import Stability
from .sweep import SweepCommand
from .view import Video, View


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

        from ..paper import report

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
class Version:
    """Print the versions of hapticclay and of what it runs on."""

    def __call__(self) -> int:
        print("  ".join(f"{name} {number}" for name, number in versions().items()))
        return 0


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
        folder = Path(__file__).resolve().parents[2] / "benchmarks"
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
        from . import identify

        writable(self.out)
        axes = AXES if self.axis == "both" else (self.axis,)
        identify.run(self.out, axes, self.noise, self.map, self.quick, self.seed, self.control)
        print(f"written to {self.out}")
        return 0


COMMANDS = {
    "run": Run,
    "stability": Stability,
    "reproduce": Reproduce,
    "sweep": SweepCommand,
    "identify": Identify,
    "bench": Bench,
    "view": View,
    "video": Video,
    "version": Version,
}
Command = Union[tuple(Annotated[kind, tyro.conf.subcommand(name)] for name, kind in COMMANDS.items())]  # noqa: UP007
MARKERS = (tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes, tyro.conf.CascadeSubcommandArgs)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line; returns its exit status: 0, 1 if it failed, 2 for bad input, 130 for Ctrl-C."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it warns of a home that cannot be written
    with contextlib.suppress(AttributeError, ValueError):
        sys.stdout.reconfigure(errors="replace")  # a terminal that knows no frames or bullets
    try:
        command = _parsed(list(sys.argv[1:] if argv is None else argv))
        code = command() if command else 0
        if sys.stdout:  # None where it was closed before we came
            sys.stdout.flush()
        return code
    except ParameterError as error:
        text = error.bound if error.field == "arguments" else str(error)
        print(f"hapticclay: {text}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # whoever read our output has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except MemoryError as error:
        print(f"hapticclay: out of memory: {error or 'it is all taken'}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"hapticclay: {error}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        print("hapticclay: interrupted", file=sys.stderr)
        return 130


def _parsed(words: list[str]) -> Callable[[], int] | None:
    """The command that the words stand for; None if they asked for help, which is then printed.

    Raises:
        ParameterError: they stand for none.
    """
    words = cli_words.ordered(words, COMMANDS)
    tyro._experimental_options["ansi_codes"] = not os.environ.get("NO_COLOR")
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            command, rest = tyro.cli(
                Command,  # type: ignore[arg-type]
                prog="hapticclay",
                description="Virtual clay, cut with a simulated haptic arm.",
                args=words,
                config=MARKERS,
                return_unknown_args=True,
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            return None
        raise cli_words.refused(words, complaint.getvalue(), COMMANDS) from None
    if rest:
        raise cli_words.unknown(words, rest, COMMANDS)
    return command
