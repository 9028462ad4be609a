"""Theory of a wall in the plane of damping and stiffness: exact limits, published lines."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from ..model.constants import TS
from ..model.operator import Operator
from ..theory.hand_boxes import Box, lattice
from ..theory.roots import bisect
from .published_walls import LIMIT_POINTS, Limit
from .wall import Wall

SOFTEST = 0.03  # first K of the search over that of the linear loop at B = 0, and
SOFT_BOUNDS = (1e-4, 1e-3)  # its bounds over the largest K of the linear loop
TOP_POINTS = 17  # of a line, where it falls


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
            B += [*np.geomspace(first, top, LIMIT_POINTS), *np.linspace(0.5 * top, top, TOP_POINTS)]
    B, note = np.unique(B).tolist(), wall.exact_note
    if wall.left_out:
        note = f"of the linear loop: {' and '.join(wall.left_out)} left out"
    K = tuple(exact_limit(wall.at(0.0, x)) for x in B)
    exact = Limit("exact, linear loop", "exact", tuple(B), K, note)
    return [x for x in (exact, *wall.published(B)) if any(y > 0.0 for y in x.K)]
