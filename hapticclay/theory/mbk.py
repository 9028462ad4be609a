"""The masses, dampers and springs that a device renders stably, and its dynamic range.

The module treats a virtual mass M, damper B and spring K on a bare device (`VirtualWall`), and the
admittance 1/(M s^2 + B s + K) as compensator of the arm. M-width, the range of virtual masses that
are stable, follows Colonnese, Okamura, M-Width: Stability and accuracy of haptic rendering of
virtual mass, Robotics: Science and Systems 2012; dynamic range, or Z-width, Colgate, Brown, Factors
affecting the Z-width of a haptic display, ICRA 1994.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from .. import matrices
from ..arguments import checked, named
from ..display import brief
from ..errors import Bound, ParameterError, Real
from ..model.compensator import Compensator
from ..scene.virtual_wall import VirtualWall
from . import gain_limits, hand_boxes
from .hand_boxes import Box
from .impedance import frequencies, wall_response
from .loops import Loop
from .roots import bisect
from .wall_limits import wall_differences

Plane = Literal["mass-damper", "mass-stiffness", "damper-stiffness"]
WallPart = Literal["K", "B", "M"]
PLANES: dict[Plane, tuple[WallPart, WallPart]] = {  # fields of VirtualWall: horizontal, vertical
    "mass-damper": ("M", "B"),
    "mass-stiffness": ("M", "K"),
    "damper-stiffness": ("B", "K"),
}
BAND_POINTS = 96  # grid points of a search along one part, before its ends are refined
DIVISIONS, REFINEMENTS = 24, 7  # of the grid step that holds an end: refined to 2e-10 of it
# End of the search, in units of the moving mass and Ts.
WIDEST = 16.0
SLIGHT = 1e-8  # share of that end: the least spring in the search


@named
@dataclass(frozen=True, eq=False)
class Region:
    """Stable range of a virtual wall over a plane of two of its parts: between low and high.

    Attributes:
        plane: one of PLANES.
        wall: the wall; its values of the two parts of the plane are ignored.
        x: the part on the horizontal axis, in SI units, shape (n,).
        low: least stable value of the part on the vertical axis, shape (n,).
        high: largest stable value, shape (n,).
    """

    def __repr__(self) -> str:
        return brief(self)

    plane: str
    wall: VirtualWall
    x: np.ndarray
    low: np.ndarray
    high: np.ndarray


@checked
def stable_band(wall: VirtualWall, part: WallPart) -> tuple[float, float]:
    """Range of one part in which the linear wall is stable, with its own values of the other two.

    Eigenvalues of the sampled loop are computed on a grid of values; the ends are then refined to
    2e-10 of a grid step. A band narrower than a step, 19 % for B and M and 21 % for K, may be
    missed. Of several bands the lowest is returned.

    Args:
        wall: all but the part, which is ignored; friction, quantum and surface are ignored too.
        part: "K" [N/m], "B" [N.s/m] or "M" [kg]; the band of M is the M-width.

    Returns:
        (low, high) in the unit of the part; low of B and M is mostly negative. high is inf where
        even 16 mass/Ts^2, 16 mass/Ts or 16 mass is stable; both are NaN if no value is stable.
    """
    grid, stable = _stability(wall, part)

    def edge(inside: float, outside: float) -> float:
        for _ in range(REFINEMENTS):
            x = np.linspace(inside, outside, DIVISIONS + 1)
            i = int(np.argmin(np.append(stable(x[1:-1]), False)))  # the first that is unstable
            inside, outside = float(x[i]), float(x[i + 1])
        return inside

    good = stable(grid)
    if not np.any(good):
        return math.nan, math.nan
    first = int(np.argmax(good))
    last = first + int(np.argmin(np.append(good[first:], False))) - 1
    low = 0.0 if part == "K" else float(grid[0])
    if first:
        low = edge(grid[first], grid[first - 1])
    return low, math.inf if last == len(grid) - 1 else edge(grid[last], grid[last + 1])


def _stability(
    wall: VirtualWall, part: str
) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """Grid of a part, ascending; and a function that tests values for stability, (n,) to (n,)."""
    d, hand = wall.device, wall.hand
    mass, own = d.mass + hand.mass, d.damper + hand.damper
    unit = mass / wall.Ts ** {"K": 2, "B": 1, "M": 0}[part]
    slight = SLIGHT if part == "K" else 1e-6
    grid = np.geomspace(slight * WIDEST * unit, WIDEST * unit, BAND_POINTS)
    if part != "K":
        least = -1.2 * (mass if part == "M" else own)
        grid = np.unique([*np.linspace(least, 0.0, BAND_POINTS // 3), *grid])
    # The sampled loop is linear in each part; at 0 it has fewer states.
    once, twice = (wall_differences(replace(wall, **{part: x * unit})) for x in (1.0, 2.0))
    fixed, turned = 2.0 * once - twice, twice - once
    if part != "K" and not wall.K and not hand.spring:  # nothing depends on the place
        fixed, turned = fixed[1:, 1:], turned[1:, 1:]

    def stable(x: np.ndarray) -> np.ndarray:
        z1 = matrices.eigenvalues(fixed + (x / unit)[:, None, None] * turned)
        return np.all(2.0 * z1.real + np.abs(z1) ** 2 < 0.0, axis=1)

    return grid, stable


@checked
def renderable(
    wall: VirtualWall, plane: Plane = "mass-damper", n: Annotated[int, Bound(3, 1001)] = 41
) -> Region:
    """Stable region of a virtual wall over a plane, exact at each of n columns.

    Args:
        wall: the wall; its third part, K, B or M, is kept.
        plane: "mass-damper", "mass-stiffness" or "damper-stiffness".
        n: number of columns, 3 to 1001, over all masses or dampers that are stable with any damper
            or spring of the plane.

    Raises:
        ParameterError: unknown plane, n out of its bounds, or nothing stable.
    """
    across, up = PLANES[plane]
    d, hand = wall.device, wall.hand
    mass, own = d.mass + hand.mass, d.damper + hand.damper
    low, high = (-1.2 * mass, WIDEST * mass) if across == "M" else (-own, WIDEST * mass / wall.Ts)
    below = np.linspace(low, 0.0, BAND_POINTS // 6)
    tried = np.unique([*below, *np.geomspace(1e-4 * high, high, BAND_POINTS // 2)])

    def stable(x: float) -> bool:
        grid, good = _stability(replace(wall, **{across: x}), up)
        return bool(np.any(good(grid)))

    inside = [i for i, x in enumerate(tried.tolist()) if stable(x)]
    if not inside:
        raise ParameterError("wall", wall, f"must be stable somewhere in the plane {plane}")
    ends = []
    for i, step in ((inside[0], -1), (inside[-1], 1)):
        end = float(tried[i])
        if 0 <= i + step < len(tried):
            span = float(tried[i + step]) - end
            end += span * bisect(lambda x, a=end, s=span: stable(a + s * x), 0.0, 1.0, 0.01)[0]
        ends.append(end)
    # dense towards the ends, where the borders meet
    x = ends[0] + (ends[1] - ends[0]) * 0.5 * (1.0 - np.cos(np.linspace(0.0, math.pi, n)))
    bands = np.array([stable_band(replace(wall, **{across: v}), up) for v in x.tolist()])
    return Region(plane, wall, x, bands[:, 0], bands[:, 1])


# ---- the arm: an admittance --------------------------------------------------------------------


@checked
def least_mass(
    loop: Loop,
    decay: Annotated[Real, Bound(0.0, 1e6, "1/s")],
    box: Box | None = None,
    samples: int = 24,
) -> tuple[float, float]:
    """Least virtual mass that the arm renders stably, with a damper B = decay M.

    Every larger mass with the same B/M is stable too, because 1/M is the gain of the compensator.

    Args:
        loop: all but compensator and gain.
        decay: B/M of the admittance [1/s], >= 0.
        box: hands that must all be stable; None for the loop's own hand.
        samples: random members of the box tested in a sampled or delayed loop, see `worst_case`.

    Returns:
        M [kg] and B [N.s/m]; 0 where any mass is stable, inf where none is.
    """
    loop = replace(loop, compensator=Compensator((1.0,), (1.0, decay, 0.0)), K=1.0)
    if box is None:
        limit = gain_limits.gain_limit(loop)
    else:
        limit = hand_boxes.worst_case(loop, box, samples=samples).limit
    M = math.inf if limit == 0.0 else 1.0 / limit
    return M, decay * M if decay else 0.0


# ---- dynamic range -----------------------------------------------------------------------------


@named
@dataclass(frozen=True, eq=False)
class DynamicRange:
    """Impedance range of a device, from free motion to its stiffest stable wall.

    Attributes:
        omega: [rad/s], shape (n,).
        free: |Z| of the device with its motor off [N.s/m], shape (n,).
        least: |Z| of the lightest stable rendering, M at the low end of its band at B = K = 0,
            within `share` [N.s/m], shape (n,).
        most: |Z| of `stiffest` [N.s/m], shape (n,).
        stiffest: the wall of the largest stable K over B, its K times `share`.
        share: share of the limit that is rendered, because at the limit itself motion does not
            decay.
    """

    def __repr__(self) -> str:
        return brief(self)

    omega: np.ndarray
    free: np.ndarray
    least: np.ndarray
    most: np.ndarray
    stiffest: VirtualWall
    share: float

    @property
    def decibels(self) -> np.ndarray:
        """Range over frequency, 20 log10(most/free) [dB], shape (n,)."""
        return 20.0 * np.log10(self.most / self.free)

    @property
    def mean(self) -> float:
        """Mean of `decibels` over the logarithm of frequency [dB]."""
        x = np.log(self.omega)
        if len(x) < 2:
            return float(self.decibels[0])
        y = self.decibels
        return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)) / (x[-1] - x[0]))


@checked
def dynamic_range(
    wall: VirtualWall,
    omega: Sequence[float] | np.ndarray,
    share: Annotated[float, Bound(0.1, 0.999)] = 0.9,
) -> DynamicRange:
    """Range of impedance of a device over frequency, from free motion to the stiffest stable wall.

    Args:
        wall: device, hand, sampling and filter; its K, B and M are ignored.
        omega: [rad/s], > 0, ascending, shape (n,).
        share: share of the limits to render, 0.1 to 0.999.

    Raises:
        ParameterError: a value is out of its bounds, or no wall is stable.
    """
    omega = frequencies(omega)
    off = replace(wall, K=0.0, B=0.0, M=0.0, unilateral=False)
    low, high = stable_band(off, "B")
    if not high > low:
        raise ParameterError("wall", wall, "must be stable with some virtual damper")

    from scipy.optimize import minimize_scalar

    def limit(B: float) -> float:
        return stable_band(replace(off, B=B), "K")[1]

    top = min(high, WIDEST * (off.device.mass + off.hand.mass) / off.Ts)
    grid = np.linspace(max(low, 0.0), top, 33)[:-1]
    i = int(np.argmax([limit(B) for B in grid.tolist()]))
    around = float(grid[max(i - 1, 0)]), float(grid[i] + (grid[1] - grid[0]))
    best = minimize_scalar(lambda B: -limit(B), bounds=around, method="bounded")
    B = max((float(grid[i]), float(best.x)), key=limit)  # type: ignore[union-attr]
    K = share * limit(B)
    if not 0.0 < K < math.inf:
        raise ParameterError("wall", wall, "must have a largest stable stiffness")
    stiffest = replace(off, B=B, K=K)
    lightest = share * stable_band(off, "M")[0]
    light = replace(off, M=lightest) if lightest < 0.0 else off
    free, least, most = (np.abs(wall_response(x, omega).Z) for x in (off, light, stiffest))
    return DynamicRange(omega, free, least, most, stiffest, share)
