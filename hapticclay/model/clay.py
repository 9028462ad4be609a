"""Virtual clay: position-dependent viscous damping, fe = b(p) v (Eqs. 3, 4)."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from ..errors import Bound, ParameterError, check_fields, numbers_of
from .constants import AXES, B_MAX


def split_damping(b0, b1, H, L, R, W, damper):
    """Splits the clay's damping in one kick between the velocities before and after it.

    A step gives half of its clay to the kick before it and half to the kick after it:
    Crank-Nicolson, second order. Where the half that acts on the velocity before the kick would
    overshoot, b h W > 2, it is reduced to the value that just stops the handle, and the kick before
    the step takes the rest. The two parts sum to b h, so the impulse of a step is exactly b times
    its distance. `slow_force` corrects the effect of the uneven split on slow motion.

    Args:
        b0: damping before the sample, (x, y) [N.s/m].
        b1: damping after the sample, (x, y) [N.s/m].
        H: length of the kick [s].
        L: share of the kick before the sample.
        R: share of the kick after the sample.
        W: largest acceleration per unit of force over all directions [1/kg].
        damper: of the operator's arm, which acts beside the clay [N.s/m].

    Returns:
        (x0, x1, y0, y1, stiff, sharex, sharey, softx, softy): fe = x0 v- + x1 v+ on x, y0 and y1 on
        y [N.s/m]; in stiff clay, fe is less by share times `slow_force`, which the next kick
        returns.
        stiff: 1.0 if any part is reduced, else 0.0. soft: 1/b [m/(N.s)] where both steps are stiff.
    """
    most = 1.0 / (H * W)
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


def slow_force(gx, gy, sxx, sxy, syy, sharex, sharey, fx, fy):  # noqa: PLR0913  # plain numbers, for speed
    """Force of stiff clay on a handle in slow motion that nothing else supports.

    Args:
        gx: acceleration of the handle without clay, x [m/s^2].
        gy: acceleration of the handle without clay, y [m/s^2].
        sxx: acceleration per unit of force, x from x [1/kg].
        sxy: acceleration per unit of force, x from y [1/kg].
        syy: acceleration per unit of force, y from y [1/kg].
        sharex: from `split_damping`; nonzero where the clay is stiff along x.
        sharey: from `split_damping`; nonzero where the clay is stiff along y.
        fx: clay force along x where the clay is not stiff [N].
        fy: clay force along y where the clay is not stiff [N].

    Returns:
        (x, y) [N].
    """
    if sharex and sharey:
        det = sxx * syy - sxy * sxy
        x = (syy * gx - sxy * gy) / det
        y = (sxx * gy - sxy * gx) / det
    else:
        x = (gx - sxy * fy) / sxx
        y = (gy - sxy * fx) / syy
    return x, y


def viscous_force(bx, by, vx, vy):
    """Resisting force of the clay, fe = b v (Eqs. 3, 4). Numbers, or arrays of one shape.

    Args:
        bx: damping, x [N.s/m].
        by: damping, y [N.s/m].
        vx: velocity, x [m/s].
        vy: velocity, y [m/s].

    Returns:
        (fex, fey) [N].
    """
    return bx * vx, by * vy


def constant_profile(b: float, start: float, end: float, along: Literal["x", "y"] = "x") -> Profile:
    """Constant damping in one interval of a coordinate, none elsewhere.

    Args:
        b: damping [N.s/m].
        start: lower border [m].
        end: upper border [m].
        along: coordinate that decides, "x" or "y".

    Returns:
        The profile.
    """
    return Profile(edges=(start, end), values=(0.0, b, 0.0), along=along)


def slab(b: float, start: float, end: float) -> Clay:
    """A slab across the x axis that damps both axes alike (the constant cut, Sec. 4.1).

    Args:
        b: damping [N.s/m].
        start: lower border on x [m].
        end: upper border on x [m].

    Returns:
        The clay.
    """
    profile = constant_profile(b, start, end)
    return Clay(x=profile, y=profile)


def extent(clay: Clay | None, i: int) -> list[tuple[float, float]]:
    """Intervals of coordinate i that contain clay on the evidence of that coordinate alone.

    Args:
        clay: the clay; None for none.
        i: coordinate, 0 for x, 1 for y.

    Returns:
        Disjoint intervals (low, high) [m], ascending, possibly infinite.
    """
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


# Rows of a region table, two each (x, y): borders between -inf and inf [m]; damping [N.s/m] and its
# growth [N.s/m per s], by region of the coordinate that decides; region of the axis's own profile;
# time of its first entry [s], NaN before. The last row: the coordinate that decides on the x axis,
# that on the y axis, and the end of the path [m], inf for none.
EDGE_ROW, VALUE_ROW, RATE_ROW, OWN_ROW, ENTERED_ROW, AXIS_ROWS = 0, 2, 4, 6, 8, 10


def region_table(clay: Clay | None, length: float | None) -> np.ndarray:
    """Tabulates clay and the end of the path for `enter_region`.

    Args:
        clay: the clay; None for none.
        length: the run ends when p_x reaches this [m]; None for no end.

    Returns:
        Array of shape (11, n); its rows are named above.
    """
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
    """The region that the handle enters.

    Args:
        table: from `region_table`; notes the time of first entry where the clay grows.
        ix: index of the region along x.
        iy: index of the region along y.
        t: time of entry [s].

    Returns:
        (low, high, base, rate), a pair (x, y) each: borders [m] and clay, as in `damping_at`.
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


def damping_at(
    base: tuple[float, float], rate: tuple[float, float], t: float
) -> tuple[float, float]:
    """Damping at a time, b = base + rate t, at most B_MAX.

    Args:
        base: damping at t = 0, (x, y) [N.s/m].
        rate: growth, (x, y) [N.s/m per s].
        t: time [s].

    Returns:
        (x, y) [N.s/m].
    """
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
