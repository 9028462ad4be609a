"""Clay that springs back: its force in a kick, and its state after a step."""

from __future__ import annotations

import math

from ..model import regions
from ..model import spring as law
from .parts import INF
from .state import Elastic, Load

NEAR = 1e-6  # of a step


def pull(springs, elastic, step):
    """Mean force in a kick, (x, y) [N]; none where the motors render it."""
    if springs is None:
        return 0.0, 0.0
    return physical(springs.rendered, elastic, step.L)


def physical(rendered, elastic, L):
    if rendered is not None:
        return 0.0, 0.0
    return force(elastic, L)


def force(elastic, L):
    """Force at a sample, share L before it, (x, y) [N]."""
    a, b = elastic.before, elastic.force
    return L * a[0] + (1.0 - L) * b[0], L * a[1] + (1.0 - L) * b[1]


def with_pull(load, f):
    """The load with a force of springs."""
    return Load((load.f[0] - f[0], load.f[1] - f[1]), load.d)


def longest(springs, elastic, after):
    """The step in equal parts that resolve the springs [s]."""
    if springs is None or after <= elastic.resolved:
        return after
    return after / math.ceil(after / elastic.resolved - NEAR)


def is_calm(springs, elastic):
    """Whether springs require no short steps."""
    if springs is None:
        return True
    return elastic.resolved == INF


def moved(springs, elastic, region, table, p, h):
    """The springs after the handle has moved to p."""
    if springs is None:
        return elastic
    (nx, ny), s = elastic.numbers, elastic
    x0, z0, f0, kept0, lost0 = moved_axis(nx, s.rest[0], s.stretch[0], s.at[0], p[0], h)
    x1, z1, f1, kept1, lost1 = moved_axis(ny, s.rest[1], s.stretch[1], s.at[1], p[1], h)
    dent(table, 0, region.index, nx[5], s.rest[0], x0)
    dent(table, 1, region.index, ny[5], s.rest[1], x1)
    now = f0, f1
    before = now if h > 0.0 else s.before
    return Elastic(
        s.numbers, (x0, x1), (z0, z1), p, now, before, s.lost + (lost0 + lost1), kept0 + kept1,
        s.resolved,
    )  # fmt: skip


def moved_axis(n, rest, stretch, at, p, h):
    """Rest, elongation, force, energy stored and lost of one axis."""
    rest, f, kept, lost = law.spring_step(n[0], n[1], n[5], rest, p)
    z, f1, kept1, lost1 = law.relaxing_step(n[2], n[3], n[5], stretch, p - at, h)
    return rest, z, f + f1, kept + kept1, lost + lost1


def dent(table, i, index, way, before, now):
    """Notes the dent of a surface."""
    if way != 0.0 and now != before:
        table[dent_place(table, i, index)] = now


def dent_place(table, i, index):
    return regions.spring_place(table, i, index[0], index[1]) + regions.SPRING - 1


def entered(springs, s, region, table, p, crossed):
    """The springs of a region that the handle enters; those left behind lose their energy.

    Args:
        springs: the part.
        s: its state.
        region: the region.
        table: of the clay.
        p: place of the handle [m].
        crossed: coordinate of the border crossed, -1 for none.
    """
    if springs is None:
        return s
    nx, restx = entered_axis(region, table, 0, p[0], crossed)
    ny, resty = entered_axis(region, table, 1, p[1], crossed)
    none, resolved = (0.0, 0.0), INF
    soft = max(nx[0] + nx[2], ny[0] + ny[2]) == 0.0
    if not soft and springs.rendered is None:
        resolved = springs.longest
    now = Elastic(
        (nx, ny), (restx, resty), none, p, none, s.force, s.lost + s.stored, 0.0, resolved
    )
    return now if soft else moved(springs, now, region, table, p, 0.0)


def entered_axis(region, table, i, p, crossed):
    """Numbers of the spring of an axis, and its rest [m]."""
    at = regions.spring_place(table, i, region.index[0], region.index[1])
    low, high = region.low[i], region.high[i]
    way, rest = 0.0, p
    if table[at + 4] > 0.0:  # pushed from the border that is nearer
        up = p - low <= high - p
        way, border = (1.0, low) if up else (-1.0, high)
        if i == crossed:  # else the tool is in it already, at rest
            rest = border
        dented = table[at + regions.SPRING - 1]
        if dented == dented and way * (dented - rest) > 0.0:
            rest = dented
        if crossed < 0 and way * (rest - border) > 0.0:
            table[at + regions.SPRING - 1] = rest
    return (table[at], table[at + 1], table[at + 2], table[at + 3], table[at + 4], way), rest
