"""Clay that stays cut: what a step removes, and what the tool meets on its way."""

from __future__ import annotations

import math

from ..model import groove as law
from .state import Before, Cut, Region


def cut(groove, at, p):
    """Takes away the clay between the place of the last cut and here."""
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


def moved(groove, tool, region, old, p, v):
    """Tool and clay after a step: region, clay before, tool."""
    if groove is None:
        return region, old, tool
    cut(groove, tool.at, p)
    return dragged(groove.drag, groove, tool, region, old, p, v)


def dragged(drag, groove, tool, region, old, p, v):
    if drag is None:
        return region, old, Cut(p, tool.bare, tool.bare_before, 0.0)
    _, area = law.resistance(groove.rim, v[0], v[1])
    b, bare, past = drag * area, tool.bare, tool.bare_before
    now = Region(
        region.index, region.low, region.high, (bare[0] + b, bare[1] + b), region.rate, region.flow
    )
    before = Before((past[0] + b, past[1] + b), old.rate, old.flow)
    return now, before, Cut(p, bare, past, b)


def entered(groove, tool, region):
    """Region and tool where the handle comes into a region."""
    if groove is None:
        return region, tool
    base, b = region.base, tool.drag
    now = Region(
        region.index, region.low, region.high, (base[0] + b, base[1] + b), region.rate, region.flow
    )
    return now, Cut(tool.at, base, tool.bare_before, b)


def passed(groove, tool):
    """The tool after a step: the clay before the sample is that of now."""
    if groove is None:
        return tool
    return Cut(tool.at, tool.bare, tool.bare, tool.drag)


def law_along(groove, x, y):
    """Fy, K, n of x and y in a direction of any length."""
    Fy, _ = law.resistance(groove.rim, x, y)
    return Fy, 0.0, 1.0, Fy, 0.0, 1.0


def law_in_kick(groove, stuck, B, v, u):
    """The same in a kick: in the direction of the motion, of the push at rest."""
    x, y = v
    if (stuck[0] > 0.0 and stuck[1] > 0.0) or (x == 0.0 and y == 0.0):
        xx, xy, yx, yy = B
        x, y = yy * u[0] - xy * u[1], xx * u[1] - yx * u[0]
    return law_along(groove, x, y)
