"""The clay as a table of cells: the one place where a run looks up what resists it, and where."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .clay import Clay, Profile, Smooth, smooth_damping

# A table is one row of numbers. Its head says where the rest begins, two places each: END, one
# place, holds the end of the path itself [m], inf for none; EDGES, borders along x and along y
# between -inf and inf [m]; LANDED, beside them, 1.0 where steps end whatever clay lies beyond;
# OWN, for the clay of each axis, two lists that add up to the number of the cell in which that axis
# is, by region along x and along y; SMOOTH, for smooth clay of each axis, clay.Smooth.numbers, 0.0
# for none; of the cells, one for smooth clay, for each axis: VALUES, damping on entry [N.s/m];
# RATES, at which it grows [N.s/m per s], 0.0 for none; ENTERED, time of the first entry [s], NaN
# before.
END, EDGES, LANDED, OWN, SMOOTH, VALUES, RATES, ENTERED, HEAD = 0, 1, 3, 5, 9, 11, 13, 15, 17
NOTHING = Profile((), (0.0,))


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
    head, parts, size = [end], [], HEAD

    def put(values: Any) -> None:
        nonlocal size
        head.append(float(size))
        parts.append(values)
        size += len(values)

    for e in lines:
        put([-math.inf, *e, math.inf])
    for e in lines:
        put([1.0, *(float(x in always) for x in e), 1.0])
    for law in laws:
        for own, e, step in zip(law.borders, lines, (law.damping.shape[1], 1), strict=True):
            put([float(step * bisect.bisect_right(own, x)) for x in (-math.inf, *e)])
    smooth = [law.numbers if isinstance(law, Smooth) else None for law in given]
    for i, numbers in enumerate(smooth):
        if numbers is None:
            head.append(0.0)
        elif i == 1 and smooth[0] is not None and given[0] == given[1]:
            head.append(head[-1])
        else:
            put(numbers)
    cells = laws[:1] if laws[0] == laws[1] else laws  # those of both axes are one where they may be
    for part in ("damping", "rates", "entered"):
        for law in cells:
            values = (
                np.full(law.damping.size, math.nan) if part == "entered" else getattr(law, part)
            )
            put(values.ravel())
        if len(cells) < 2:
            head.append(head[-1])
    return np.concatenate((head, *parts))


def region_of(table: Any, p: Sequence[float]) -> tuple[int, int]:
    """Indices along x and along y of the region in which a place lies; on a border, of that beyond.

    Args:
        table: from `region_table`.
        p: the place, (x, y) [m].
    """
    edges = [table[int(table[EDGES + i]) : int(table[EDGES + i + 1])] for i in (0, 1)]
    x, y = (bisect.bisect_right(e, at, 1) - 1 for e, at in zip(edges, p, strict=True))
    return x, y


def keep_entries(table: np.ndarray, before: np.ndarray) -> None:
    """Takes over when the handle first entered each cell, from clay of the same borders.

    Args:
        table: from `region_table`; gets the times.
        before: the table up to now.
    """
    n = len(table) - int(table[ENTERED])
    table[-n:] = before[-n:]


def enter_region(table, ix, iy, t):
    """The region that the handle enters.

    Args:
        table: from `region_table`; notes the time of first entry where the clay grows.
        ix: index of the region along x.
        iy: index of the region along y.
        t: time of entry [s].

    Returns:
        (low, high, base, rate), a pair (x, y) each: borders [m] and clay, as in `clay.damping_at`.
    """
    basex, ratex = _cell_law(table, 0, ix, iy, t)
    basey, ratey = _cell_law(table, 1, ix, iy, t)
    x, y = int(table[EDGES]) + ix, int(table[EDGES + 1]) + iy
    return (table[x], table[y]), (table[x + 1], table[y + 1]), (basex, basey), (ratex, ratey)


def smooth_clay(table, which, x, y, bx, by):  # noqa: PLR0913  # plain numbers, for speed
    """Clay at a place, where it is smooth.

    Args:
        table: from `region_table`.
        which: axes with such clay, see `Clay.smooth`.
        x: the place, x [m].
        y: the place, y [m].
        bx: damping of x where it has other clay [N.s/m].
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
    """Whether both sides of a border have the same clay, so that no step has to end on it.

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
    return True


def _cell(table, axis, ix, iy):
    """Number of the cell that belongs to a region, in the clay of an axis."""
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
