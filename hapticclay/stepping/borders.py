"""Regions of the clay and the borders between them: where a step must end."""

from __future__ import annotations

from ..model import regions
from . import grooves, springs, viscous
from .march import TOUCH
from .search import find_root
from .state import Clay, Flow, Growth, Hit, Laws, Region, State, Status


def side(p, low, high):
    """1 beyond the upper border, -1 beyond the lower, 0 within; a NaN is within."""
    return 1 if p > high + TOUCH else -1 if p < low - TOUCH else 0


def sides(r, p):
    """Borders of a region between it and a place, as `side`, (x, y)."""
    return side(p[0], r.low[0], r.high[0]), side(p[1], r.low[1], r.high[1])


def stood_on(r, p, sx, sy):
    """The border on or beyond which a place lies, of those on the sides (sx, sy): coordinate, side.

    Args:
        r: the region.
        p: the place, (x, y) [m].
        sx: side of x, 0 for none.
        sy: side of y, 0 for none.

    Returns:
        Coordinate and side; side 0 for none.
    """
    x, y = sides(r, p)
    if sx != 0 and x != 0:
        return 0, sx
    if sy != 0 and y != 0:
        return 1, sy
    return 0, 0


def border_of(r, i, up):
    """Place of a border of a region [m]."""
    if i == 0:
        return r.high[0] if up > 0 else r.low[0]
    return r.high[1] if up > 0 else r.low[1]


def is_same_beyond(table, r, i, up):
    """Whether the clay beyond a border of a region is the same."""
    return regions.is_alike(table, r.index[0], r.index[1], i, up)


# ---- into another region -------------------------------------------------------------------------


def flow_in(part, state, table, index):
    if part is None:
        return state
    ax, bx, cx = regions.enter_flow(table, 0, index[0], index[1])
    ay, by, cy = regions.enter_flow(table, 1, index[0], index[1])
    return Flow((ax, bx, cx, ay, by, cy), state.old)


def hit_in(part, hit, struck):
    if part is None:
        return hit
    return Hit(hit.fine, max(hit.struck, struck))


def clay_in(parts, clay, index, t, p, crossed, struck):
    """The clay of a region that the handle enters.

    Args:
        parts: the scene.
        clay: its state.
        index: of the region, (x, y).
        t: now [s].
        p: place of the handle [m].
        crossed: coordinate of the border crossed, -1 for none.
        struck: 1.0 where different clay lies behind it.
    """
    low, high, b, rate = regions.enter_region(parts.table, index[0], index[1], t)
    growth = grown_in(parts.clay, clay.growth, rate)
    hit, c = hit_in(parts.hits, clay.hit, struck), clay
    clay = Clay(Region(index, low, high), b, c.old, growth, hit, c.reaction, c.laws)
    return laws_in(parts.special, parts.table, clay, p, crossed)


def grown_in(part, growth, rate):
    if part is None:
        return growth
    return growing_in(part.growth, growth, rate)


def growing_in(part, growth, rate):
    if part is None:
        return growth
    return Growth(rate, growth.old)


def laws_in(special, table, c, p, crossed):
    if special is None:
        return c
    x, r = c.laws, c.region
    elastic = springs.entered(special.springs, x.elastic, r, table, p, crossed)
    b, cut = grooves.entered(special.groove, x.cut, c.b)
    laws = Laws(flow_in(special.flow, x.flow, table, r.index), elastic, cut, x.more)
    c = Clay(r, b, c.old, c.growth, c.hit, c.reaction, laws)
    return viscous.at_place(special.smooth, table, c, p)


def seen_with(x, i, at):
    """Status of a run whose region along coordinate i becomes `at`."""
    a, b, c, d = x.seen
    back = (a <= at <= b) if i == 0 else (c <= at <= d)
    seen = (min(a, at), max(b, at), c, d) if i == 0 else (a, b, min(c, at), max(d, at))
    return Status(x.code, x.closing, x.careful, x.landings + (1 if back else 0), seen)


def moved_on(parts, s, p, i, up, struck):
    """The state in the region beyond a border of coordinate i."""
    x, y = s.clay.region.index
    index = (x + up, y) if i == 0 else (x, y + up)
    clay = clay_in(parts, s.clay, index, s.clock.t, p, i, struck)
    return State(s.clock, s.body, s.loop, clay, s.work, seen_with(s.status, i, index[i]), s.filled)


def passed_alike(parts, s, here, p):
    """The state in the last region before different clay, on the way to a place."""
    while True:
        sx, sy = sides(s.clay.region, p)
        i, up = (1, sy) if sx == 0 else (0, sx)
        if (sx == 0) == (sy == 0) or not is_same_beyond(parts.table, s.clay.region, i, up):
            return s
        s = moved_on(parts, s, here, i, up, 0.0)


# ---- the step that ends on a border --------------------------------------------------------------


def first_border(probe, parts, s, after, p, sx, sy):
    """The step that ends on the first border ahead: its length [s], coordinate, side.

    Args:
        sx: side of x that the step would pass, 0 for none.
        sy: the same of y.
    """
    span, axis, up = after, -1, 0
    for i in range(2):
        at = sy if i else sx
        if at != 0:
            border = border_of(s.clay.region, i, at)
            length = find_root(after, p[i] - border, probe, parts, s, i, border)
            if axis < 0 or length < span:
                span, axis, up = length, i, at
    return span, axis, up
