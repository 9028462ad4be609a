"""The clay as a table of cells, in which a run looks up resistance by place."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .cells import Profile
from .clay import NOTHING, Clay
from .smooth import Smooth, smooth_damping

# A table is one row of numbers. Its head says where the rest begins, two places each: END, one
# place, holds the end of the path itself [m], inf for none; EDGES, borders along x and along y
# between -inf and inf [m]; LANDED, beside them, 1.0 where steps end whatever clay lies beyond;
# OWN, for the clay of each axis, two lists that add up to the number of the cell in which that axis
# is, by region along x and along y; SMOOTH, for smooth clay of each axis, Smooth.numbers, 0.0
# for none; of the cells, one for smooth clay, for each axis: VALUES, damping on entry [N.s/m];
# RATES, at which it grows [N.s/m per s], 0.0 for none; ENTERED, time of the first entry [s], NaN
# before; FLOWS, where the clay yields, 0.0 elsewhere: Fy [N], K [N/(m/s)^n] and n of each cell;
# SPRINGS, where it springs back, 0.0 elsewhere: Spring.numbers of each cell, and the place of the
# dent in a surface [m], NaN before.
END, EDGES, LANDED, OWN, SMOOTH, VALUES, RATES, ENTERED = 0, 1, 3, 5, 9, 11, 13, 15
FLOWS, SPRINGS, HEAD, SPRING = 17, 19, 21, 6


def region_table(clay: Clay | None, length: float | None) -> np.ndarray:
    """Tabulates clay and the end of the path for `enter_region`.

    Args:
        clay: the clay; None for none.
        length: the run ends when p_x reaches this [m]; None for no end.

    Returns:
        The table, shape (n,); its parts are named above.
    """
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
    # those of both axes are one where they may be
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

    def lack(self) -> None:
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
            out.lack()
        elif i == 1 and isinstance(given[0], Smooth) and given[0] == law:
            out.repeat()
        else:
            out.put(law.numbers)


def _put_cells(out: _Columns, clay: Clay | None, laws: Sequence[Any]) -> None:
    """Adds the values of each cell, for each law."""
    yields, springs = bool(clay and clay.yields), bool(clay and clay.springs)
    for what in ["damping", "rates", "entered", *["flows"] * yields, *["elastic"] * springs]:
        if what == "elastic" and not yields:
            out.lack()
            out.lack()
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


def region_of(table, p):
    """Indices along x and y of the region that contains a place; on a border, of that beyond.

    Args:
        table: from `region_table`.
        p: the place, (x, y) [m].

    Returns:
        Indices (x, y).
    """
    return _region_along(table, 0, p[0]), _region_along(table, 1, p[1])


def _region_along(table, i, at):
    """Index of the region along one axis, from the last border at or before the place."""
    begin, high = int(table[EDGES + i]), int(table[EDGES + i + 1])
    low = begin + 1
    while low < high:
        middle = (low + high) // 2
        if at < table[middle]:
            high = middle
        else:
            low = middle + 1
    return low - 1 - begin


def keep_entries(table: np.ndarray, before: np.ndarray) -> None:
    """Copies the times of first entry into each cell from clay with the same borders.

    Args:
        table: from `region_table`; receives the times.
        before: the previous table.
    """
    begin = int(table[ENTERED])
    end = int(table[FLOWS]) or int(table[SPRINGS]) or len(table)
    table[begin:end] = before[begin:end]


def enter_region(table, ix, iy, t):
    """The region that the handle enters.

    Args:
        table: from `region_table`; records the time of first entry where the clay grows.
        ix: index of the region along x.
        iy: index of the region along y.
        t: time of entry [s].

    Returns:
        (low, high, base, rate), a pair (x, y) each: borders [m] and clay, see damping.damping_at.
    """
    basex, ratex = _cell_law(table, 0, ix, iy, t)
    basey, ratey = _cell_law(table, 1, ix, iy, t)
    x, y = int(table[EDGES]) + ix, int(table[EDGES + 1]) + iy
    return (table[x], table[y]), (table[x + 1], table[y + 1]), (basex, basey), (ratex, ratey)


def enter_flow(table, axis, ix, iy):
    """Yield law of an axis in a region, for clay that yields somewhere.

    Args:
        table: from `region_table`.
        axis: 0 for x, 1 for y.
        ix: index of the region along x.
        iy: index of the region along y.

    Returns:
        (Fy [N], K [N/(m/s)^n], n).
    """
    at = int(table[FLOWS + axis]) + 3 * _cell(table, axis, ix, iy)
    return table[at], table[at + 1], table[at + 2]


def spring_place(table, axis, ix, iy):
    """Index of the spring of a region in the table, for clay that springs back somewhere.

    Args:
        table: from `region_table`.
        axis: 0 for x, 1 for y.
        ix: index of the region along x.
        iy: index of the region along y.
    """
    return int(table[SPRINGS + axis]) + SPRING * _cell(table, axis, ix, iy)


def smooth_clay(table, which, x, y, bx, by):
    """Damping at a place in smooth clay.

    Args:
        table: from `region_table`.
        which: axes with such clay, see `Clay.smooth`.
        x: the place, x [m].
        y: the place, y [m].
        bx: damping of x if its clay is not smooth [N.s/m].
        by: the same, y [N.s/m].

    Returns:
        Damping (x, y) [N.s/m].
    """
    first, second = int(table[SMOOTH]), int(table[SMOOTH + 1])
    if which != 2:
        bx = smooth_damping(table, first, x, y)
    if which != 1:
        by = bx if first == second else smooth_damping(table, second, x, y)
    return bx, by


def is_alike(table, ix, iy, i, up):
    """Whether both sides of a border have the same clay, so that no step need end on it.

    Args:
        table: from `region_table`.
        ix: index of the region on this side along x.
        iy: index of the region on this side along y.
        i: coordinate of the border, 0 for x, 1 for y.
        up: 1 for the region's upper border, -1 for its lower one.
    """
    jx, jy = (ix, iy + up) if i else (ix + up, iy)
    if table[int(table[LANDED + i]) + max(iy if i else ix, jy if i else jx)]:
        return False
    for axis in range(2):
        a, b = _cell(table, axis, ix, iy), _cell(table, axis, jx, jy)
        values, rates = int(table[VALUES + axis]), int(table[RATES + axis])
        if table[values + a] != table[values + b] or table[rates + a] or table[rates + b]:
            return False
        springs = int(table[SPRINGS + axis])
        if springs and a != b:  # each spring has its own rest position
            for cell in (a, b):
                at = springs + SPRING * cell
                if table[at] > 0.0 or table[at + 2] > 0.0:
                    return False
        flows = int(table[FLOWS + axis])
        if flows:
            for j in range(3):
                if table[flows + 3 * a + j] != table[flows + 3 * b + j]:
                    return False
    return True


def _cell(table, axis, ix, iy):
    """Number of the cell of a region in the clay of an axis."""
    x, y = int(table[OWN + 2 * axis]), int(table[OWN + 2 * axis + 1])
    return int(table[x + ix] + table[y + iy])


def _cell_law(table, axis, ix, iy, t):
    k = _cell(table, axis, ix, iy)
    value, rate = table[int(table[VALUES + axis]) + k], table[int(table[RATES + axis]) + k]
    if rate:
        entered = int(table[ENTERED + axis]) + k
        if table[entered] != table[entered]:
            table[entered] = t
        value -= rate * table[entered]
    return value, rate
