"""Messages on stderr about a compilation: its expected time, its progress, its final time."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from typing import Any

TICK, EVERY = 1.0, 10.0  # between two messages, on a terminal and elsewhere [s]


class Notice:
    """Reports a compilation, from `begin` to the end of its block, and then the time.

    On a terminal one line counts the seconds. Elsewhere, as in a file or a notebook, each message
    is a line of its own. Without `begin` nothing is printed.

    Args:
        what: what is compiled.
        expected: time that it takes, measured [s]; None where it is not known.
    """

    def __init__(self, what: str, expected: float | None):
        time_ = "" if expected is None else f": about {expected:.0f} s"
        self.told = f"hapticclay: compiling {what}, this once{time_}"
        self.over = threading.Event()
        self.life = threading.Thread(target=self._live, daemon=True)
        self.since: float | None = None

    def begin(self) -> None:
        """Prints what is compiled and the expected time, once."""
        if self.since is not None or sys.stderr is None:
            return
        self.since, self.stream, self.terminal = time.monotonic(), sys.stderr, _on_terminal()
        self._say(self.told)
        self.life.start()

    def __enter__(self) -> Notice:
        return self

    def __exit__(self, kind: Any, *what: Any) -> None:
        if self.since is None:
            return
        self.over.set()
        self.life.join()
        if self.terminal:
            self._write("\r" + " " * self._width() + "\r")
        if kind is None:
            self._write(f"hapticclay: compiled in {time.monotonic() - self.since:.0f} s\n")

    def _live(self) -> None:
        while not self.over.wait(TICK if self.terminal else EVERY):
            gone = f"{time.monotonic() - self.since:.0f} s gone"  # type: ignore[operator]
            self._say(f"{self.told}, {gone}" if self.terminal else f"hapticclay: compiling, {gone}")

    def _say(self, text: str) -> None:
        self._write("\r" + text[: self._width()] if self.terminal else f"{text}\n")

    def _width(self) -> int:
        """Columns that can be overwritten; a longer line would wrap at every message."""
        with contextlib.suppress(OSError, ValueError):
            return (os.get_terminal_size(self.stream.fileno()).columns or 80) - 1
        return 79

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):  # the reader has gone
            self.stream.write(text)
            self.stream.flush()


def _on_terminal() -> bool:
    """Whether stderr can overwrite a line; a notebook cannot, whatever it reports."""
    notebook = type(sys.stderr).__module__.startswith("ipykernel")
    return not notebook and sys.stderr.isatty()
