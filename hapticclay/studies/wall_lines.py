"""Theory of a wall in the plane of damping and stiffness: exact limits, published lines."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arguments import named
from ..display import brief
from ..model.constants import TS
from ..model.operator import Operator
from ..scene.virtual_wall import VirtualWall
from ..theory import gain_crossings, gain_limits, wall_limits
from ..theory.hand_boxes import Box
from ..theory.roots import bisect
from . import boundary

LIMIT_POINTS = 61  # of a line of theory
SOFTEST = 0.03  # first K of the search over that of the linear loop at B = 0, and
SOFT_BOUNDS = (1e-4, 1e-3)  # its bounds over the largest K of the linear loop

# on a bare device, or clay of k and b on this arm
Wall = VirtualWall | boundary.PushedLoop


@named
@dataclass(frozen=True)
class Limit:
    """A published or exact line in the plane of B and K.

    Attributes:
        name: authors and year, or "exact".
        kind: "exact" (of the linear loop), "sufficient" (for every passive hand), or "rule" (an
            approximation, or a limit of another property).
        B: [N.s/m].
        K: [N/m], of the length of B; 0 where there is none.
        note: range of validity.
    """

    def __repr__(self) -> str:
        return brief(self)

    name: str
    kind: str
    B: tuple[float, ...]
    K: tuple[float, ...]
    note: str = ""

    def at(self, B: float) -> float:
        """K of the line at B, between its points [N/m]; NaN beyond its ends.

        Args:
            B: virtual damping [N.s/m].
        """
        return float(np.interp(B, self.B, self.K, math.nan, math.nan))


def wall_at(wall: Wall, K: float, B: float) -> Wall:
    """The wall with the given K and B."""
    if isinstance(wall, VirtualWall):
        return replace(wall, K=K, B=B)
    return replace(wall, k=K, b=B)


def is_linear(wall: Wall) -> bool:
    """Whether the loop of a wall is linear: no friction, no encoder, no surface."""
    if isinstance(wall, boundary.PushedLoop):
        return True
    return not (wall.unilateral or wall.device.friction or wall.device.quantum)


def theoretical_damping(wall: Wall) -> float:
    """Largest B of the linear loop that is stable at K = 0 [N.s/m]; 0 for none."""
    unit = moving_mass(wall) / sample_time(wall)

    def stable(B: float) -> bool:
        tried = wall_at(wall, 0.0, B)
        if isinstance(tried, VirtualWall):
            return wall_limits.stable_wall(tried)
        return gain_crossings.is_stable(tried.linear)

    grid = np.geomspace(1e-5 * unit, 1e3 * unit, 120).tolist()
    low = next((i for i, B in enumerate(grid) if stable(B)), None)
    if low is None:
        return 0.0
    high = next((B for B in grid[low + 1 :] if not stable(B)), None)
    return grid[-1] if high is None else bisect(stable, grid[low], high, 1e-9)[0]


def worst_hand(wall: Wall, box: Box) -> Operator:
    """The hand with the least stable K among those at ends and middles of a box."""
    sides = [
        sorted({low, 0.5 * (low + high), high}) for low, high in (box.mass, box.damper, box.spring)
    ]
    hands = [Operator(m, d, k) for m in sides[0] for d in sides[1] for k in sides[2]]
    return min(hands, key=lambda hand: exact_limit(replace(wall, operator=hand)))


@functools.lru_cache(maxsize=2048)  # used as a line, as a guess, and for comparison with the runs
def exact_limit(wall: Wall) -> float:
    """Largest stable K of the linear loop [N/m]."""
    if isinstance(wall, VirtualWall):
        return wall_limits.stiffness_band(wall)[1]
    return gain_limits.stiffness_limit(wall.linear)


def softest(wall: Wall, top: float) -> float:
    """Least K at which a wall is tested [N/m]."""
    first, scale = (exact_limit(wall_at(wall, 0.0, share * top)) for share in (0.0, 0.5))
    scale = max(first, scale) or wall.hand.spring + moving_mass(wall) / sample_time(wall) ** 2
    return min(max(SOFTEST * first, SOFT_BOUNDS[0] * scale), SOFT_BOUNDS[1] * scale)


def moving_mass(wall: Wall) -> float:
    """Mass of device and hand [kg]."""
    if isinstance(wall, VirtualWall):
        return wall.device.mass + wall.hand.mass
    return 1.0 / wall.servo.S.gain + wall.hand.mass


def sample_time(wall: Wall) -> float:
    """Sampling period [s]; that of the paper if the wall has none."""
    return wall.Ts or TS


def theory_limits(wall: Wall, top: float, grid: Sequence[float]) -> list[Limit]:
    """Lines of theory, from the least B up to top."""
    first = next((B for B in grid if B > 0.0), 1.0)
    fine = [*np.linspace(min(grid[0], 0.0), first, 5)[:-1]]
    if top > first:
        fine += [*np.geomspace(first, top, LIMIT_POINTS), *np.linspace(0.5 * top, top, 17)]
    if isinstance(wall, boundary.PushedLoop):  # their limit requires a scan
        fine = []
    B = np.unique([*fine, *grid]).tolist()
    parts: list[Limit] = []

    def line(
        name: str, kind: str, law: Callable[[Any], float], note: str, places: Sequence[float] = B
    ) -> None:
        K = [law(wall_at(wall, 0.0, x)) for x in places]
        if any(x > 0.0 for x in K):
            parts.append(Limit(name, kind, tuple(places), tuple(K), note))

    if isinstance(wall, boundary.PushedLoop):
        line("exact, linear loop", "exact", exact_limit, "sampled loop at the nominal pose")
        return parts
    left_out = [n for n in ("friction", "quantum") if getattr(wall.device, n)]
    left_out += ["surface"] if wall.unilateral else []
    note = f"of the linear loop: {' and '.join(left_out)} left out" if left_out else "eigenvalues"
    line("exact, linear loop", "exact", exact_limit, note)
    line(
        "Colgate, Schenkel 1997",
        "rule" if wall.device.quantum else "sufficient",
        wall_limits.colgate_schenkel_limit,
        "passive: stable in every passive hand"
        + (", but for the quantum" * bool(wall.device.quantum)),
        np.unique([*B, *np.linspace(0.0, min(wall.device.damper, B[-1]), LIMIT_POINTS)]).tolist(),
    )
    if wall.velocity == "difference" and wall.velocity_window == 1 and wall.velocity_filter is None:
        note = "linear rule, for (b + B) Ts and K Ts^2 far below the mass"
        line("Hulin et al. 2006", "rule", wall_limits.hulin_limit, note)
    if wall.delay == 0.0 and wall.M == 0.0:
        K = wall_limits.abbott_okamura_limit(wall)
        if 0.0 < K < math.inf:
            note = "passive, for B = 0: friction outweighs the encoder"
            parts.append(Limit("Abbott, Okamura 2005", "sufficient", (0.0,), (K,), note))
    return parts
