"""Buttons of the grip, pressed by a script."""

from __future__ import annotations

import bisect
import os
from dataclasses import dataclass
from typing import Annotated

from ..arguments import checked, named
from ..columns.log import columns_of
from ..errors import Bound, ParameterError, Real, number

NAMES = ("a", "b", "c", "home")


@named
@dataclass(frozen=True)
class ButtonScript:
    """Which buttons are pressed over time.

    Attributes:
        t: times at which the buttons change [s], ascending.
        pressed: names of the buttons that are pressed from each time on.
    """

    t: Annotated[tuple[Real, ...], Bound(unit="s")] = ()
    pressed: tuple[frozenset[str], ...] = ()

    def __post_init__(self):
        if not isinstance(self.t, tuple):
            raise ParameterError("buttons.t", self.t, "must be a tuple of times")
        for i, x in enumerate(self.t):
            number(f"buttons.t[{i}]", x, -1e9, 1e9, unit="s")
        if not isinstance(self.pressed, tuple) or len(self.pressed) != len(self.t):
            raise ParameterError("buttons.pressed", self.pressed, "must have a set for each time")
        if any(b <= a for a, b in zip(self.t[:-1], self.t[1:], strict=True)):
            raise ParameterError("buttons.t", self.t, "must ascend")
        for names in self.pressed:
            if not isinstance(names, frozenset) or not names <= set(NAMES):
                raise ParameterError("buttons.pressed", names, f"must be of {', '.join(NAMES)}")

    def at(self, t: float) -> frozenset[str]:
        """Names of the buttons that are pressed at a time.

        Args:
            t: the time [s].
        """
        i = bisect.bisect_right(self.t, t)
        return self.pressed[i - 1] if i else frozenset()

    @classmethod
    @checked
    def of_file(cls, path: str | os.PathLike[str]) -> ButtonScript:
        """Reads a script from a log with the columns t [s], a, b, c, home (0 or 1).

        Args:
            path: the file.

        Raises:
            ParameterError: the file cannot be read, has other columns or other values, or its times
                do not ascend.
        """
        columns = columns_of("buttons", path, {"t": ("s",), **dict.fromkeys(NAMES, ())})
        rows = list(zip(*(x.tolist() for x in columns.values()), strict=True))
        for row in rows:
            for name, x in zip(NAMES, row[1:], strict=True):
                if x not in (0.0, 1.0):
                    bound = f"column {name!r} must be 0 or 1, is {x:g} at {row[0]:g} s"
                    raise ParameterError("buttons", str(path), bound)
        t = tuple(r[0] for r in rows)
        return cls(
            t, tuple(frozenset(n for n, x in zip(NAMES, r[1:], strict=True) if x) for r in rows)
        )
