"""The command line: `hapticclay`, or `python -m hapticclay`."""

from __future__ import annotations

import contextlib
import functools
import inspect
import logging
import os
import shutil
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Union

import tyro

from ..display import one_line
from ..errors import ParameterError, Warning
from ..files import sources_kept
from .commands import COMMANDS, load_command
from .console import ends
from .words import check_words, ordered, sources, with_units

MARKERS = (
    tyro.conf.OmitSubcommandPrefixes,
    tyro.conf.OmitArgPrefixes,
    tyro.conf.CascadeSubcommandArgs,
)
NARROWEST = 20  # columns of a terminal in which help is laid out; in five that never ends


def _show_line(usual: Callable[..., None], message: Any, category: type, *where: Any) -> None:
    """Prints a warning of ours as a line, others as usual."""
    if issubclass(category, Warning):
        print(f"hapticclay: {message}", file=sys.stderr)
    else:
        usual(message, category, *where)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line."""
    # matplotlib warns of a home that cannot be written
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    with contextlib.suppress(AttributeError, ValueError):
        sys.stdout.reconfigure(errors="replace")  # terminals without frames or bullets
    if shutil.get_terminal_size().columns < NARROWEST:
        os.environ["COLUMNS"] = str(NARROWEST)
    with ends() as received:
        code = _exit_status(argv, received)
    return 128 + received[0] if received else code


def _exit_status(argv: Sequence[str] | None, received: list[int]) -> int:
    """Runs the command line under `ends`; returns the exit status without its signals."""
    try:
        words = list(sys.argv[1:] if argv is None else argv)
        command = parse_words(words)
        with warnings.catch_warnings():
            warnings.showwarning = functools.partial(_show_line, warnings.showwarning)
            with sources_kept(sources(words)):
                code = command() if command else 0
        if sys.stdout:  # None where it was closed before we came
            sys.stdout.flush()
        return code
    except SystemExit as stop:  # of what tyro refuses, in its own words
        return int(stop.code or 0)
    except Warning as error:  # by python -W error
        print(f"hapticclay: {error}", file=sys.stderr)
        return 2
    except ParameterError as error:
        text = error.bound if error.field == "arguments" else str(error)
        _tell(text)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except MemoryError as error:
        _tell(f"out of memory: {error or 'none is left'}")
        return 1
    except OSError as error:
        where = f"{one_line(error.filename, 200)}: " if error.filename else ""
        _tell(f"{where}{error.strerror or error}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        _tell(f"ended by {signal.Signals(received[0]).name}" if received else "interrupted")
        return 130


def _tell(text: str) -> None:
    """Prints a line about the end of a command, unless its terminal has gone."""
    with contextlib.suppress(OSError):
        print(f"hapticclay: {text}", file=sys.stderr, flush=True)


def parse_words(words: Sequence[str]) -> Callable[[], int] | None:
    """The command of a command line; None if it asked for help, which is then printed."""
    words = with_units(ordered(words))
    check_words(words)
    named = words[:1] and words[0] in COMMANDS
    tyro._experimental_options["ansi_codes"] = not os.environ.get("NO_COLOR")
    try:
        return tyro.cli(
            load_command(words[0]) if named else _overview(),  # type: ignore[arg-type]
            prog=f"hapticclay {words[0]}" if named else "hapticclay",
            description=None if named else "Virtual clay, cut with a simulated haptic arm.",
            args=words[1:] if named else words,
            config=MARKERS,
        )
    except SystemExit as stop:
        if stop.code in (0, None):
            return None
        raise


def _overview() -> Any:
    """All commands as subcommands that have a summary and nothing else."""
    summaries = {
        name: inspect.cleandoc(load_command(name).__doc__ or "").partition("\n\n")[0]
        for name in COMMANDS
    }
    return Union[  # noqa: UP007
        tuple(
            Annotated[Any, tyro.conf.subcommand(name, constructor=dict, description=summary)]
            for name, summary in summaries.items()
        )
    ]
