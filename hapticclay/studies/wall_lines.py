"""Theory of a wall in the plane of damping and stiffness: exact limits, published lines."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..arguments import named
from ..display import brief
from ..model.constants import TS
from ..model.operator import Operator
from ..scene.virtual_wall import VirtualWall
from ..theory import wall_limits
from ..theory.hand_boxes import Box, lattice
from ..theory.roots import bisect

if TYPE_CHECKING:
    from .wall import Wall

LIMIT_POINTS = 61  # of a line of theory
SOFTEST = 0.03  # first K of the search over that of the linear loop at B = 0, and
SOFT_BOUNDS = (1e-4, 1e-3)  # its bounds over the largest K of the linear loop


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


def theoretical_damping(wall: Wall) -> float:
    """Largest B of the linear loop that is stable at K = 0 [N.s/m]; 0 for none."""
    unit = wall.mass / (wall.Ts or TS)

    def stable(B: float) -> bool:
        return wall.at(0.0, B).stable()

    grid = np.geomspace(1e-5 * unit, 1e3 * unit, 120).tolist()
    low = next((i for i, B in enumerate(grid) if stable(B)), None)
    if low is None:
        return 0.0
    high = next((B for B in grid[low + 1 :] if not stable(B)), None)
    return grid[-1] if high is None else bisect(stable, grid[low], high, 1e-9)[0]


def worst_hand(wall: Wall, box: Box) -> Operator:
    """The hand with the least stable K among those at ends and middles of a box."""
    return min(lattice(box), key=lambda hand: exact_limit(wall.changed(operator=hand)))


@functools.lru_cache(maxsize=2048)  # used as a line, as a guess, and for comparison with the runs
def exact_limit(wall: Wall) -> float:
    """Largest stable K of the linear loop [N/m]."""
    return wall.limit()


def softest(wall: Wall, top: float) -> float:
    """Least K at which a wall is tested [N/m]."""
    first, scale = (exact_limit(wall.at(0.0, share * top)) for share in (0.0, 0.5))
    scale = max(first, scale) or wall.hand.spring + wall.mass / (wall.Ts or TS) ** 2
    return min(max(SOFTEST * first, SOFT_BOUNDS[0] * scale), SOFT_BOUNDS[1] * scale)


def theory_limits(wall: Wall, top: float, grid: Sequence[float]) -> list[Limit]:
    """Lines of theory, from the least B up to top."""
    B = list(grid)
    if not wall.costly:
        first = next((x for x in grid if x > 0.0), 1.0)
        B += np.linspace(min(grid[0], 0.0), first, 5)[:-1].tolist()
        if top > first:
            B += [*np.geomspace(first, top, LIMIT_POINTS), *np.linspace(0.5 * top, top, 17)]
    B, note = np.unique(B).tolist(), wall.exact_note
    if wall.left_out:
        note = f"of the linear loop: {' and '.join(wall.left_out)} left out"
    K = tuple(exact_limit(wall.at(0.0, x)) for x in B)
    exact = Limit("exact, linear loop", "exact", tuple(B), K, note)
    return [x for x in (exact, *wall.published(B)) if any(y > 0.0 for y in x.K)]


def published_limits(wall: VirtualWall, B: Sequence[float]) -> list[Limit]:
    """Published lines of a bare device over B."""
    quantum, out = bool(wall.device.quantum), []

    def add(
        name: str, kind: str, law: Callable[[VirtualWall], float], note: str, B: Sequence[float] = B
    ) -> None:
        K = tuple(law(replace(wall, K=0.0, B=x)) for x in B)
        out.append(Limit(name, kind, tuple(B), K, note))

    add(
        "Colgate, Schenkel 1997",
        "rule" if quantum else "sufficient",
        wall_limits.colgate_schenkel_limit,
        "passive: stable in every passive hand" + ", but for the quantum" * quantum,
        np.unique([*B, *np.linspace(0.0, min(wall.device.damper, B[-1]), LIMIT_POINTS)]).tolist(),
    )
    if wall.velocity == "difference" and wall.velocity_window == 1 and wall.velocity_filter is None:
        note = "linear rule, for (b + B) Ts and K Ts^2 far below the mass"
        add("Hulin et al. 2006", "rule", wall_limits.hulin_limit, note)
    if wall.delay == 0.0 and wall.M == 0.0:
        K = wall_limits.abbott_okamura_limit(replace(wall, B=0.0))
        note = "passive, for B = 0: friction outweighs the encoder"
        if K < math.inf:
            out.append(Limit("Abbott, Okamura 2005", "sufficient", (0.0,), (K,), note))
    return out
