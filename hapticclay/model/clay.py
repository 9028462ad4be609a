"""Virtual clay: position-dependent viscous damping, fe = b(p) v (Eqs. 3, 4)."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from ..errors import Bound, ParameterError, check_fields, numbers_of
from .constants import AXES, B_MAX


def split_damping(b0, b1, H, L, R, w, damper):
    """Splits the clay's damping in one kick between the velocities before and after it.

    A step gives half of its clay to the kick before it and half to the one after: Crank-Nicolson, second order.
    Where the half that acts on the velocity before would overshoot, b h w > 2, it is cut to what just stops the
    handle, and the kick before the step gets the rest. Both together are b h in any case, so the impulse of a step
    is exactly b times its distance. What the uneven split does to a slow motion, `slow_force` takes back.

    Args:
        b0, b1: damping before and after the sample on each axis [N.s/m].
        H: length of the kick [s]. L, R: its shares before and after the sample.
        w: largest acceleration per unit of force over all directions [1/kg].
        damper: of the operator's arm, which resists beside the clay [N.s/m].

    Returns:
        (before x, after x, before y, after y [N.s/m]; stiff; share x, y; softness x, y [m/(N.s)]):
        fe = before v- + after v+, in stiff clay less share times slow_force, which the next kick gets back.
        stiff: 1.0 where any of this is so, else 0.0. softness: 1/b where both steps are stiff, else 0.0.
    """
    most = 1.0 / (H * w)
    x0, y0 = L * b0[0], L * b0[1]
    x1, y1 = R * b1[0], R * b1[1]
    stiff, sharex, sharey, softx, softy = 0.0, 0.0, 0.0, 0.0, 0.0
    if x0 > most or y0 > most or x1 > most or y1 > most:
        stiff = 1.0
        if x1 > most:
            sharex = (x1 - most) / (b1[0] + damper)
            softx = 1.0 / b1[0] if x0 > most else 0.0
            x1 += x1 - most
        if y1 > most:
            sharey = (y1 - most) / (b1[1] + damper)
            softy = 1.0 / b1[1] if y0 > most else 0.0
            y1 += y1 - most
        x0, y0 = min(x0, most), min(y0, most)
    return x0, x1, y0, y1, stiff, sharex, sharey, softx, softy


def slow_force(gx, gy, sxx, sxy, syy, sharex, sharey, fx, fy):
    """Force of stiff clay on a handle that moves slowly through it, held up by nothing else [N].

    Args:
        gx, gy: acceleration of the handle without clay [m/s^2]. sxx, sxy, syy: acceleration per force [1/kg].
        sharex, sharey: from `split_damping`: on which axes the clay is stiff. fx, fy: force of the clay where it is not [N].
    """
    if sharex and sharey:
        det = sxx * syy - sxy * sxy
        x = (syy * gx - sxy * gy) / det
        y = (sxx * gy - sxy * gx) / det
    else:
        x = (gx - sxy * fy) / sxx
        y = (gy - sxy * fx) / syy
    return x, y


def constant_profile(b: float, start: float, end: float, along: Literal["x", "y"] = "x") -> Profile:
    """Damping b [N.s/m] for start <= coordinate < end [m], none elsewhere."""
    return Profile(edges=(start, end), values=(0.0, b, 0.0), along=along)


def slab(b: float, start: float, end: float) -> Clay:
    """A slab across the x axis that damps both axes alike (the constant cut, Sec. 4.1)."""
    profile = constant_profile(b, start, end)
    return Clay(x=profile, y=profile)


def extent(clay: Clay | None, i: int) -> list[tuple[float, float]]:
    """Where coordinate i alone says that there is clay: disjoint spans of it [m], ascending, perhaps infinite."""
    inf = float("inf")
    out: list[tuple[float, float]] = []
    for profile in (clay.x, clay.y) if clay else ():
        if profile.along == AXES[i]:
            edges = (-inf, *profile.edges, inf)
            grown = profile.growth or (0.0,) * len(profile.values)
            spans = zip(edges, edges[1:], profile.values, grown, strict=False)
            out += [(low, high) for low, high, b, g in spans if b > 0.0 or g > 0.0]
    merged: list[tuple[float, float]] = []
    for low, high in sorted(out):
        if merged and low <= merged[-1][1]:
            low, high = merged[-1][0], max(high, merged[-1][1])
            merged.pop()
        merged.append((low, high))
    return merged


# Rows of a table, two each: borders on x and y between -inf and inf [m]; damping of the x and y axis and its growth
# [N.s/m, N.s/m per s], by region of the coordinate that decides; region of the axis's own profile in which that one
# lies; time at which this was first entered [s], NaN before. Then, in one row: which coordinate decides on the x
# and on the y axis, and where the path ends [m], inf if nowhere.
EDGE_ROW, VALUE_ROW, RATE_ROW, OWN_ROW, ENTERED_ROW, AXIS_ROWS = 0, 2, 4, 6, 8, 10


def region_table(clay: Clay | None, length: float | None) -> np.ndarray:
    """Tabulates clay and the end of the path, length [m], for `enter_region`: shape (11, n)."""
    profiles = (clay.x, clay.y) if clay else ()
    end = math.inf if length is None else length
    edges = [sorted({e for f in profiles if f.along == axis for e in f.edges}) for axis in AXES]
    if length is not None:
        edges[0] = sorted({e for e in edges[0] if e < end} | {end})
    width = max(map(len, edges)) + 3
    out = [[-math.inf, *e] + [math.inf] * (width - 1 - len(e)) for e in edges]
    out += (
        [[0.0] * width for _ in range(ENTERED_ROW - VALUE_ROW)]
        + [[math.nan] * width for _ in AXES]
        + [[0.0] * width]
    )
    for i, f in enumerate(profiles):
        along = AXES.index(f.along)
        out[AXIS_ROWS][i] = float(along)
        for k, low in enumerate([-math.inf, *edges[along]]):
            j = bisect.bisect_right(f.edges, low)
            out[VALUE_ROW + i][k], out[OWN_ROW + i][k] = f.values[j], float(j)
            out[RATE_ROW + i][k] = f.growth[j] if f.growth else 0.0
    out[AXIS_ROWS][2] = end
    return np.array(out)


def enter_region(table, ix, iy, t):
    """The region with these indices along x and y, which the handle enters at time t [s].

    Returns:
        (low, high, base, rate), x and y each: its borders [m] and its clay, see `damping_at`.
    """
    basex, ratex = _region_law(table, 0, iy if table[AXIS_ROWS, 0] else ix, t)
    basey, ratey = _region_law(table, 1, iy if table[AXIS_ROWS, 1] else ix, t)
    low = (table[EDGE_ROW, ix], table[EDGE_ROW + 1, iy])
    high = (table[EDGE_ROW, ix + 1], table[EDGE_ROW + 1, iy + 1])
    return low, high, (basex, basey), (ratex, ratey)


def _region_law(table, axis, k, t):
    value, rate = table[VALUE_ROW + axis, k], table[RATE_ROW + axis, k]
    if rate:
        j = int(table[OWN_ROW + axis, k])
        if table[ENTERED_ROW + axis, j] != table[ENTERED_ROW + axis, j]:
            table[ENTERED_ROW + axis, j] = t
        value -= rate * table[ENTERED_ROW + axis, j]
    return value, rate


class Regions:
    """Which region of the clay the handle is in, and how far that region reaches.

    Attributes:
        table: the clay. index: of the region along x and y.
        low, high: borders of the present region on each coordinate [m].
        base, rate: the clay there is b = base + rate t on each axis [N.s/m, N.s/m per s].
        grows: whether any region's clay grows. stiffest: largest damping of any region, before it grows [N.s/m].
    """

    def __init__(self, clay: Clay | None, length: float | None, p: tuple[float, float]):
        self.table = region_table(clay, length)
        self.index = [
            bisect.bisect_right(row[1:].tolist(), x) for row, x in zip(self.table, p, strict=False)
        ]
        self.stiffest = float(self.table[VALUE_ROW : VALUE_ROW + 2].max())
        self.grows = bool(self.table[RATE_ROW : RATE_ROW + 2].any())
        self._settle(0.0)

    def _settle(self, t: float) -> None:
        found = enter_region(self.table, self.index[0], self.index[1], t)
        self.low, self.high, self.base, self.rate = ((float(x), float(y)) for x, y in found)

    def b(self, t: float) -> tuple[float, float]:
        """Damping of the present region at time t [s] on each axis [N.s/m]."""
        return damping_at(self.base, self.rate, t)

    def change(self, clay: Clay, t: float) -> None:
        """Puts other damping between the same borders, from time t [s] on."""
        end, entered = self.table[AXIS_ROWS, 2], self.table[ENTERED_ROW : ENTERED_ROW + 2]
        self.table = region_table(clay, float(end) if end < math.inf else None)
        self.table[ENTERED_ROW : ENTERED_ROW + 2] = entered
        self._settle(t)

    def cross(self, i: int, up: bool, t: float) -> float:
        """Steps over the border of coordinate i at time t [s], upwards or downwards; returns its place [m]."""
        border = self.high[i] if up else self.low[i]
        self.index[i] += 1 if up else -1
        self._settle(t)
        return border

    def at_end(self, i: int, up: bool) -> bool:
        """True if the border ahead on coordinate i is the end of the path."""
        return i == 0 and up and self.high[0] == self.table[AXIS_ROWS, 2]


def damping_at(
    base: tuple[float, float], rate: tuple[float, float], t: float
) -> tuple[float, float]:
    """b = base + rate t on each axis [N.s/m]; growth ends at the largest damping there is."""
    x, y = base
    if rate[0] or rate[1]:
        x, y = min(x + rate[0] * t, B_MAX), min(y + rate[1] * t, B_MAX)
    return x, y


@dataclass(frozen=True)
class Profile:
    """Damping b of one axis as a piecewise constant function of one coordinate.

    Attributes:
        edges: borders [m], ascending, shape (n,).
        values: b in each region [N.s/m], shape (n + 1,), 0 to 1e9; region i lies between edges
            i - 1 and i.
        along: coordinate that decides, "x" or "y".
        growth: rate at which b of each region grows from when the handle first enters it
            [N.s/m per s], shape (n + 1,), 0 to 1e9; empty for none (Sec. 4.2).
    """

    edges: Annotated[tuple[float, ...], Bound(unit="m")]
    values: Annotated[tuple[float, ...], Bound(0.0, B_MAX, "N.s/m")]
    along: Literal["x", "y"] = "x"
    growth: Annotated[tuple[float, ...], Bound(0.0, B_MAX, "N.s/m per s")] = ()

    def __post_init__(self):
        check_fields(self, "clay.")
        regions = [str(i) for i in range(len(self.edges) + 1)]
        numbers_of("clay.values", self.values, regions)
        numbers_of("clay.growth", self.growth, regions if self.growth else ())
        if any(b <= a for a, b in zip(self.edges, self.edges[1:], strict=False)):
            raise ParameterError("clay.edges", self.edges, "must be strictly ascending")
        if not any(self.growth):
            object.__setattr__(self, "growth", ())


@dataclass(frozen=True)
class Clay:
    """Viscous clay: fe = b(p) v on each axis (Eqs. 3, 4 with m = k = 0).

    Attributes:
        x: damping of motion along x.
        y: damping of motion along y.
    """

    x: Profile
    y: Profile

    def __post_init__(self):
        check_fields(self, "clay.")
