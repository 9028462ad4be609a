"""The clay as a table of cells, in which a run looks up resistance by place."""

from . import numbers, smooth

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


def region_of(table, p):
    """Indices along x and y of the region that contains a place; on a border, of that beyond."""
    return _region_along(table, 0, p[0]), _region_along(table, 1, p[1])


def _region_along(table, i, at):
    """Index of the region along one axis, from the last border at or before the place."""
    begin, high = numbers.whole(table[EDGES + i]), numbers.whole(table[EDGES + i + 1])
    low = begin + 1
    while low < high:
        middle = (low + high) // 2
        if at < table[middle]:
            high = middle
        else:
            low = middle + 1
    return low - 1 - begin


def enter_region(table, ix, iy, t):
    """The region that the handle enters at a time t [s]: borders and clay, a pair (x, y) each.

    (low, high, base, rate): borders [m] and clay as in damping.damping_at. The table records the
    time of first entry where the clay grows.
    """
    basex, ratex = _cell_law(table, 0, ix, iy, t)
    basey, ratey = _cell_law(table, 1, ix, iy, t)
    x, y = numbers.whole(table[EDGES]) + ix, numbers.whole(table[EDGES + 1]) + iy
    return (table[x], table[y]), (table[x + 1], table[y + 1]), (basex, basey), (ratex, ratey)


def enter_flow(table, axis, ix, iy):
    """Fy [N], K [N/(m/s)^n] and n of an axis in a region, for clay that yields somewhere."""
    at = numbers.whole(table[FLOWS + axis]) + 3 * _cell(table, axis, ix, iy)
    return table[at], table[at + 1], table[at + 2]


def spring_place(table, axis, ix, iy):
    """Index in the table of the spring of a region, for clay that springs back somewhere."""
    return numbers.whole(table[SPRINGS + axis]) + SPRING * _cell(table, axis, ix, iy)


def smooth_clay(table, which, x, y, bx, by):
    """Damping at a place in smooth clay, (x, y) [N.s/m].

    which: axes with such clay, see `Clay.smooth`; bx, by: damping of an axis whose clay is not
    smooth.
    """
    first, second = numbers.whole(table[SMOOTH]), numbers.whole(table[SMOOTH + 1])
    if which != 2:
        bx = smooth.smooth_damping(table, first, x, y)
    if which != 1:
        by = bx if first == second else smooth.smooth_damping(table, second, x, y)
    return bx, by


def is_identical(table, ix, iy, i, up):
    """Whether both sides of a border have the same clay, so that no step need end on it.

    i: coordinate of the border, 0 for x, 1 for y; up: 1 for the region's upper border, -1 for its
    lower one.
    """
    jx, jy = ix if i else ix + up, iy + up if i else iy
    if table[numbers.whole(table[LANDED + i]) + max(iy if i else ix, jy if i else jx)]:
        return False
    for axis in range(2):
        a, b = _cell(table, axis, ix, iy), _cell(table, axis, jx, jy)
        values, rates = numbers.whole(table[VALUES + axis]), numbers.whole(table[RATES + axis])
        if table[values + a] != table[values + b] or table[rates + a] or table[rates + b]:
            return False
        springs = numbers.whole(table[SPRINGS + axis])
        if springs and a != b:  # each spring has its own rest position
            for side in range(2):
                at = springs + SPRING * (b if side else a)
                if table[at] > 0.0 or table[at + 2] > 0.0:
                    return False
        flows = numbers.whole(table[FLOWS + axis])
        if flows:
            for j in range(3):
                if table[flows + 3 * a + j] != table[flows + 3 * b + j]:
                    return False
    return True


def _cell(table, axis, ix, iy):
    """Number of the cell of a region in the clay of an axis."""
    x, y = numbers.whole(table[OWN + 2 * axis]), numbers.whole(table[OWN + 2 * axis + 1])
    return numbers.whole(table[x + ix] + table[y + iy])


def _cell_law(table, axis, ix, iy, t):
    k = _cell(table, axis, ix, iy)
    value, rate = (
        table[numbers.whole(table[VALUES + axis]) + k],
        table[numbers.whole(table[RATES + axis]) + k],
    )
    if rate:
        entered = numbers.whole(table[ENTERED + axis]) + k
        if table[entered] != table[entered]:
            table[entered] = t
        value -= rate * table[entered]
    return value, rate
