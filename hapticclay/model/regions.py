"""The clay as a table of cells, in which a run looks up resistance by place."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..formulas.regions import EDGES, ENTERED, FLOWS, HEAD, LANDED, SPRINGS
from .cells import Profile
from .clay import NOTHING, Clay
from .smooth import Smooth


def region_table(clay: Clay | None, length: float | None) -> np.ndarray:
    """Clay, and the end of the path [m] (None for no end), as a table for `enter_region`."""
    given = clay.laws if clay else (NOTHING, NOTHING)
    laws = [NOTHING if isinstance(law, Smooth) else law for law in given]
    end = math.inf if length is None else length
    lines = [list(e) for e in (clay.edges if clay else ((), ()))]
    always = {e for f in laws if isinstance(f, Profile) for e in f.edges} | {end}
    if length is not None:
        lines[0] = sorted({e for e in lines[0] if e < end} | {end})
    out = _Columns(end)
    for e in lines:
        out.put([-math.inf, *e, math.inf])
    for e in lines:
        out.put([1.0, *(float(x in always) for x in e), 1.0])
    for law in laws:
        for own, e, step in zip(law.borders, lines, (law.damping.shape[1], 1), strict=True):
            out.put([float(step * bisect.bisect_right(own, x)) for x in (-math.inf, *e)])
    _put_smooth(out, given)
    # equal laws of both axes share their columns
    _put_cells(out, clay, laws[:1] if laws[0] == laws[1] else laws)
    return out.table()


class _Columns:
    """Columns in sequence, preceded by the index at which each begins; the end comes first."""

    def __init__(self, end: float):
        self._head: list[float] = [end]
        self._columns: list[Any] = []
        self._size = HEAD

    def put(self, values: Any) -> None:
        """Adds a column."""
        self._head.append(float(self._size))
        self._columns.append(values)
        self._size += len(values)

    def leave_out(self) -> None:
        """Marks a column as absent."""
        self._head.append(0.0)

    def repeat(self) -> None:
        """Marks the next column as equal to the previous one."""
        self._head.append(self._head[-1])

    def table(self) -> np.ndarray:
        """The whole table."""
        rest = [0.0] * (HEAD - len(self._head))
        return np.concatenate((self._head + rest, *self._columns))


def _put_smooth(out: _Columns, given: Sequence[Any]) -> None:
    """Adds the numbers of smooth clay of x and of y."""
    for i, law in enumerate(given):
        if not isinstance(law, Smooth):
            out.leave_out()
        elif i == 1 and isinstance(given[0], Smooth) and given[0] == law:
            out.repeat()
        else:
            out.put(law.numbers)


def _put_cells(out: _Columns, clay: Clay | None, laws: Sequence[Any]) -> None:
    """Adds the values of each cell, for each law."""
    yields, springs = bool(clay and clay.yields), bool(clay and clay.springs)
    for what in ["damping", "rates", "entered", *["flows"] * yields, *["elastic"] * springs]:
        if what == "elastic" and not yields:
            out.leave_out()
            out.leave_out()
        for law in laws:
            out.put(_of_cells(what, law))
        if len(laws) < 2:
            out.repeat()


def _of_cells(what: str, law: Any) -> np.ndarray:
    """One quantity of the cells of a law, cell by cell."""
    if what == "entered":
        return np.full(law.damping.size, math.nan)
    if what == "flows":
        return np.stack(law.flows, axis=-1).ravel()
    if what == "elastic":
        dent = np.full((*law.damping.shape, 1), math.nan)
        return np.concatenate((law.elastic, dent), axis=2).ravel()
    return getattr(law, what).ravel()


def border_count(table: np.ndarray) -> int:
    """Number of borders in a table, along x and along y."""
    return int(table[LANDED] - table[EDGES])


def keep_entries(table: np.ndarray, before: np.ndarray) -> None:
    """Copies the times of first entry into each cell from clay with the same borders."""
    begin = int(table[ENTERED])
    end = int(table[FLOWS]) or int(table[SPRINGS]) or len(table)
    table[begin:end] = before[begin:end]
