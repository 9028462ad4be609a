"""Regions of the clay and the borders between them: where a step must end."""

from ..formulas import regions
from . import laws, search

TOUCH = 1e-13  # [m] a border is crossed when the handle is so far beyond it: hundreds of roundings


def side(z, p):
    """1 beyond the upper border of a region, -1 beyond the lower, 0 within; a NaN is within."""
    return 1 if p > z.high + TOUCH else -1 if p < z.low - TOUCH else 0


def place_of(s, i, up):
    """Place of a border of the region [m]."""
    return s.axis[i].high if up > 0 else s.axis[i].low


def is_identical_beyond(m, s, i, up):
    """Whether the clay beyond a border of the region is the same."""
    return regions.is_identical(m.table, s.x.index, s.y.index, i, up)


def border_at_handle(s, herex, herey, sx, sy):
    """Which border the handle is on or beyond: its coordinate and side; side 0 for none."""
    if sx != 0 and side(s.x, herex) != 0:
        return 0, sx
    if sy != 0 and side(s.y, herey) != 0:
        return 1, sy
    return 0, 0


# ---- into another region -------------------------------------------------------------------------


def enter(m, s, ix, iy, px, py, crossed, entered):
    """Puts the handle into a region; `entered`: 1.0 if a hit may begin."""
    low, high, b, rate = regions.enter_region(m.table, ix, iy, s.t)
    x, y = s.x, s.y
    x.index, y.index = ix, iy
    x.low, y.low = low
    x.high, y.high = high
    x.b, y.b = b
    x.b_rate, y.b_rate = rate
    if m.hits:
        s.entered = max(s.entered, entered)
    if m.special:
        laws.enter(m, s, px, py, crossed)


def enter_beyond(m, s, px, py, i, up, entered):
    """Enters the region beyond a border of coordinate i."""
    ix, iy, j, seen = s.x.index, s.y.index, 2 * i, s.seen
    if i:
        iy += up
    else:
        ix += up
    at = iy if i else ix
    if seen[j] <= at and at <= seen[j + 1]:
        s.returns += 1
    seen[j], seen[j + 1] = min(seen[j], at), max(seen[j + 1], at)
    enter(m, s, ix, iy, px, py, i, entered)


def skip_identical_regions(m, s, herex, herey, px, py):
    """Enters the last region before different clay, on the way to a place."""
    while True:
        sx, sy = side(s.x, px), side(s.y, py)
        i, up = (1, sy) if sx == 0 else (0, sx)
        if (sx == 0) == (sy == 0) or not is_identical_beyond(m, s, i, up):
            return
        enter_beyond(m, s, herex, herey, i, up, 0.0)


# ---- the step that ends on a border --------------------------------------------------------------


def first_border(m, s, after, px, py, sx, sy):
    """The step that ends on the first border ahead: its length [s], coordinate, side."""
    span, axis, up = after, -1, 0
    for i in range(2):
        at, p = sy if i else sx, py if i else px
        if at != 0:
            border = place_of(s, i, at)
            length = search.find_root(m, s, after, p - border, i, border)
            if axis < 0 or length < span:
                span, axis, up = length, i, at
    return span, axis, up
