"""The command line: `hapticclay`, or `python -m hapticclay`."""

from __future__ import annotations

import contextlib
import functools
import logging
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from ..display import one_line
from ..errors import ParameterError, Warning
from ..files import sources_kept
from . import parser
from .console import ends

HELP = frozenset(("-h", "--help"))

# Questions limit BLAS to one thread; a command has no other use for more, which NumPy would start
# and which child processes would inherit: 20 ms on two cores. Whoever sets it decides.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _show_line(usual: Callable[..., None], message: Any, category: type, *where: Any) -> None:
    """Prints a warning of ours as a line, others as usual."""
    if issubclass(category, Warning):
        print(f"hapticclay: {message}", file=sys.stderr)
    else:
        usual(message, category, *where)


def main(argv: Sequence[str] | None = None) -> int:
    # matplotlib warns of a home that cannot be written
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    with contextlib.suppress(AttributeError, ValueError):
        sys.stdout.reconfigure(errors="replace")  # terminals without frames or bullets
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
            with sources_kept(parser.sources(words)):
                code = command() if command else 0
        if sys.stdout:  # None where it was closed before we came
            sys.stdout.flush()
        return code
    except Warning as error:  # by python -W error
        print(f"hapticclay: {error}", file=sys.stderr)
        return 2
    except ParameterError as error:
        text = error.bound if error.field == "arguments" else str(error)
        _print_end(text)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except MemoryError as error:
        _print_end(f"out of memory: {error or 'none is left'}")
        return 1
    except OSError as error:
        where = f"{one_line(error.filename, 200)}: " if error.filename else ""
        _print_end(f"{where}{error.strerror or error}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        _print_end(f"ended by {signal.Signals(received[0]).name}" if received else "interrupted")
        return 130


def _print_end(text: str) -> None:
    """Prints a line about the end of a command, unless its terminal has gone."""
    with contextlib.suppress(OSError):
        print(f"hapticclay: {text}", file=sys.stderr, flush=True)


def parse_words(words: Sequence[str]) -> Callable[[], int] | None:
    """The command of a command line; None if it asked for help or nothing: then help is printed."""
    if words[:1] == ["--version"]:
        words = ["version"]
    if not words:
        from .manual import print_overview

        print_overview()
        return None
    if words[:1] == ["help"]:
        words = [*words[1:2], "--help"]
    if not HELP.isdisjoint(words):
        from .manual import print_help

        print_help([word for word in words if word not in HELP])
        return None
    return parser.read(words).command()
