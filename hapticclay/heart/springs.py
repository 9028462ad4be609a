"""Clay that springs back: its force in a kick, and its state behind a step."""

from __future__ import annotations

import math

from ..model import regions
from ..model import spring as law
from .parts import INF
from .state import Elastic, Load


def pull(springs, elastic, L):
    """Mean force in a kick, (x, y) [N]; none where the motors render it."""
    if springs is None:
        return 0.0, 0.0
    return physical(springs.rendered, elastic, L)


def physical(rendered, elastic, L):
    if rendered is not None:
        return 0.0, 0.0
    a, b = elastic.before, elastic.force
    return L * a[0] + (1.0 - L) * b[0], L * a[1] + (1.0 - L) * b[1]


def with_pull(springs, load, f):
    """The load with a force of springs."""
    if springs is None:
        return load
    return Load((load.f[0] - f[0], load.f[1] - f[1]), load.d)


def longest(springs, elastic, after):
    """The longest step that resolves the springs [s]."""
    if springs is None:
        return after
    return min(after, elastic.resolved)


def moved(springs, elastic, region, table, p, h):
    """The springs after the handle has moved."""
    if springs is None:
        return elastic
    ix, iy = region.index
    return moved_both(elastic, table, ix, iy, p, h)


def moved_both(s, table, ix, iy, p, h):
    nx, ny = s.numbers
    x0, z0, f0, kept0, lost0 = moved_axis(nx, s.rest[0], s.stretch[0], s.at[0], p[0], h)
    x1, z1, f1, kept1, lost1 = moved_axis(ny, s.rest[1], s.stretch[1], s.at[1], p[1], h)
    dent(table, 0, ix, iy, nx[5], s.rest[0], x0)
    dent(table, 1, ix, iy, ny[5], s.rest[1], x1)
    now = f0, f1
    before = s.before
    if h > 0.0:
        before = now
    return Elastic(
        s.numbers, (x0, x1), (z0, z1), p, now, before, s.lost + (lost0 + lost1), kept0 + kept1,
        s.resolved,
    )  # fmt: skip


def moved_axis(n, rest, stretch, at, p, h):
    """Rest, elongation, force, energy stored and lost of one axis."""
    rest, f, kept, lost = law.spring_step(n[0], n[1], n[5], rest, p)
    z, f1, kept1, lost1 = law.relaxing_step(n[2], n[3], n[5], stretch, p - at, h)
    return rest, z, f + f1, kept + kept1, lost + lost1


def dent(table, axis, ix, iy, way, before, now):
    """Notes what gave way in a surface."""
    if way != 0.0 and now != before:
        table[regions.spring_place(table, axis, ix, iy) + regions.SPRING - 1] = now


def entered(springs, elastic, region, table, p):
    """The springs of a region that the handle comes into; those left behind lose theirs."""
    if springs is None:
        return elastic
    return entered_both(springs, elastic, region, table, p)


def entered_both(springs, s, region, table, p):
    nx, restx = entered_axis(region, table, 0, p[0])
    ny, resty = entered_axis(region, table, 1, p[1])
    stiffest, resolved = max(nx[0] + nx[2], ny[0] + ny[2]), INF
    now = Elastic(
        (nx, ny), (restx, resty), (0.0, 0.0), p, (0.0, 0.0), s.force, s.lost + s.stored, 0.0,
        resolved,
    )  # fmt: skip
    if stiffest > 0.0:
        if springs.mobility > 0.0:
            resolved = law.RESOLVED / math.sqrt(stiffest * springs.mobility)
        now = Elastic(
            now.numbers, now.rest, now.stretch, p, now.force, now.before, now.lost, 0.0, resolved
        )
        now = moved_both(now, table, region.index[0], region.index[1], p, 0.0)
    return now


def entered_axis(region, table, i, p):
    """Numbers of the spring of an axis, and its rest [m]."""
    at = regions.spring_place(table, i, region.index[0], region.index[1])
    low, high = region.low[i], region.high[i]
    way, rest = 0.0, p
    if table[at + 4] > 0.0:  # pushed from the border that is nearer
        up = p - low <= high - p
        way, rest = (1.0, low) if up else (-1.0, high)
        dented = table[at + regions.SPRING - 1]
        if dented == dented and way * (dented - rest) > 0.0:
            rest = dented
        if abs(rest) == INF:
            rest = p
    return (table[at], table[at + 1], table[at + 2], table[at + 3], table[at + 4], way), rest
