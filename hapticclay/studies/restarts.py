"""Logs of several runs in one file: the column that tells the runs apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..columns.log import Log
from ..columns.stamps import Stamps, times_of

WORDS = ("episode", "trial", "run", "segment", "take")  # in the names of such columns


class Episodes(NamedTuple):
    """A column that has one value in each run, and its value in the first."""

    column: str
    first: float

    def where(self) -> str:
        """The rows of the first run, in words of a command line."""
        return f"{self.column}={self.first:g}"


def episodes(log: Log, time: str) -> Episodes | None:
    """The column that tells runs apart between which the time goes back; None without one."""
    t, _ = times_of(log, time, holes=True)
    back = Stamps(t).backward
    found = []
    for place, name in enumerate(log.names):
        x = log.table.loose_numbers(place)
        changes = np.flatnonzero(np.diff(x) != 0.0) + 1 if np.isfinite(x).all() else []
        whole = np.array_equal(x, np.round(x))
        if len(back) and whole and np.array_equal(changes, back):
            found.append(Episodes(name, float(x[0])))
    named = [x for x in found if any(word in x.column.lower() for word in WORDS)]
    return next(iter(named or found), None)
