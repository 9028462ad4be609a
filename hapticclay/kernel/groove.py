"""Clay that stays cut: what a step removes, and what the tool meets on its way."""

import math

from ..formulas import groove as law
from ..formulas import numbers


def cut(m, ax, ay, x, y):
    """Removes the clay between the place of the last cut, NaN for none, and here."""
    grid, disc = m.grid, 1
    if x == ax and y == ay:
        return
    if ax == ax:
        dx, dy = x - ax, y - ay
        disc, n = 0, 1 + numbers.whole(math.sqrt(dx * dx + dy * dy) / (law.STRIDE * grid[7]))
        for j in range(1, n):
            law.cut(grid, m.ground, m.relief, ax + j * dx / n, ay + j * dy / n, 0, m.rim, m.removed)
    law.cut(grid, m.ground, m.relief, x, y, disc, m.rim, m.removed)


def move(m, s, px, py, vx, vy):
    """Clay and tool after a step."""
    cut(m, s.x.cut, s.y.cut, px, py)
    b = 0.0
    if m.drags:
        _, area = law.resistance(m.rim, vx, vy)
        b = m.drag * area
    for i in range(2):
        z = s.axis[i]
        if m.drags:
            z.b = z.old = z.bare + b
        z.cut = py if i else px
    s.drag = b


def enter(m, s):
    """Clay and tool when the handle enters a region."""
    for i in range(2):
        z = s.axis[i]
        z.bare = z.b
        z.b += s.drag


def laws_along(m, x, y):
    """Fy, K, n of x and y in a direction of any length."""
    Fy, _ = law.resistance(m.rim, x, y)
    return Fy, 0.0, 1.0, Fy, 0.0, 1.0


def touch(m, px, py):
    """Finds what touches the tool at rest, in clay whose numbers have changed."""
    cut(m, math.nan, math.nan, px, py)
