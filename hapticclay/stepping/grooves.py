"""Clay that stays cut: what a step removes, and what the tool meets on its way."""

from __future__ import annotations

import math

from ..model import groove as law
from .state import Cut


def cut(groove, at, p):
    """Removes the clay between the place of the last cut and here."""
    (ax, ay), (x, y), grid = at, p, groove.numbers
    if x == ax and y == ay:
        return
    whole = 1
    if ax == ax:
        dx, dy = x - ax, y - ay
        whole, n = 0, 1 + int(math.sqrt(dx * dx + dy * dy) / (law.STRIDE * grid[7]))
        for k in range(1, n):
            law.cut(
                grid, groove.ground, groove.relief, ax + k * dx / n, ay + k * dy / n, 0, groove.rim,
                groove.removed,
            )  # fmt: skip
    law.cut(grid, groove.ground, groove.relief, x, y, whole, groove.rim, groove.removed)


def met_anew(groove, p):
    """Finds what touches the tool at rest, in clay whose numbers have changed."""
    if groove is not None:
        cut(groove, (math.nan, math.nan), p)


def moved(groove, tool, clay, p, v):
    """Clay and tool after a step, the handle at p with velocity v."""
    if groove is None:
        return clay.b, clay.old, tool
    cut(groove, tool.at, p)
    return dragged(groove.drag, groove, tool, clay, p, v)


def dragged(drag, groove, tool, clay, p, v):
    bare = tool.bare
    if drag is None:
        return clay.b, clay.old, Cut(p, bare, bare, 0.0)
    _, area = law.resistance(groove.rim, v[0], v[1])
    b = drag * area
    now = bare[0] + b, bare[1] + b
    return now, now, Cut(p, bare, bare, b)


def entered(groove, tool, b):
    """Clay and tool when the handle enters a region with clay b."""
    if groove is None:
        return b, tool
    return (b[0] + tool.drag, b[1] + tool.drag), Cut(tool.at, b, tool.bare_before, tool.drag)


def law_along(groove, x, y):
    """Fy, K, n of x and y in a direction of any length."""
    Fy, _ = law.resistance(groove.rim, x, y)
    return Fy, 0.0, 1.0, Fy, 0.0, 1.0


def law_in_kick(groove, stuck, B, v, u):
    """The same in a kick: along the motion, or along the push at rest."""
    x, y = v
    if (stuck[0] > 0.0 and stuck[1] > 0.0) or (x == 0.0 and y == 0.0):
        xx, xy, yx, yy = B
        x, y = yy * u[0] - xy * u[1], xx * u[1] - yx * u[0]
    return law_along(groove, x, y)
