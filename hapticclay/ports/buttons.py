"""Buttons of the grip, pressed by a script."""

from __future__ import annotations

import bisect
import os
from dataclasses import dataclass

from ..errors import ParameterError
from .device import read_columns

NAMES = ("a", "b", "c", "home")


@dataclass(frozen=True)
class ButtonScript:
    """Which buttons are pressed over time.

    Attributes:
        t: times at which they change [s], ascending.
        pressed: names of those pressed from each time on.
    """

    t: tuple[float, ...] = ()
    pressed: tuple[frozenset[str], ...] = ()

    def at(self, t: float) -> frozenset[str]:
        """Names of the buttons that are pressed at a time.

        Args:
            t: the time [s].
        """
        i = bisect.bisect_right(self.t, t)
        return self.pressed[i - 1] if i else frozenset()

    @classmethod
    def of_file(cls, path: str | os.PathLike[str]) -> ButtonScript:
        """The script of a CSV file with the columns t [s], a, b, c, home (0 or 1).

        Args:
            path: the file.

        Raises:
            ParameterError: the file cannot be read, has other columns, or its times do not ascend.
        """
        rows = read_columns("buttons", path, ("t", *NAMES))
        t = tuple(r[0] for r in rows)
        if list(t) != sorted(set(t)):
            raise ParameterError("buttons", str(path), "must have ascending times")
        return cls(
            t, tuple(frozenset(n for n, x in zip(NAMES, r[1:], strict=True) if x) for r in rows)
        )
