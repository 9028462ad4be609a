"""Where stability changes along a path of joint loops: eigenvalues are followed from loop to loop.

Two loops are near enough if no eigenvalue moves by more than half its distance from the unit
circle. Otherwise one between them must show that each eigenvalue moves by less than its distance to
the others, and that its size bends too little to reach the circle in between.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from . import roots
from .joint_crossings import NO_SIZE, Crossing
from .joint_loop import JointLoop

HALVINGS = 12  # of the distance of two points, at most
MOST_LOOPS = 4000  # that are followed, at most
SHARE_OF_MARGIN, SHARE_OF_GAP = 0.5, 0.3  # by which an eigenvalue may move
BENT = 0.25  # of its distance or of its change: a size bends by less, so it has no peak outside
SMALL = 0.2  # size of eigenvalues that are too small to matter
EXACT = 1e-12  # relative width within which a change is found
ON_AXIS = 1e-9  # [rad] angle of an eigenvalue 1

Path = Callable[[float], JointLoop]


class _Stop(NamedTuple):
    """A loop on the path.

    Attributes:
        x: its place.
        loop: the loop.
    """

    x: float
    loop: JointLoop

    @property
    def z(self) -> np.ndarray:
        """Eigenvalues of its map that are not small."""
        z = self.loop.eigenvalues
        return z[np.abs(z) > SMALL]

    def alike(self, other: _Stop) -> bool:
        """Whether both hold too little for a change between them."""
        return self.loop.weak() and other.loop.weak()


def changes(path: Path, points: Iterable[float], drives: bool = False) -> Iterator[Crossing]:
    """Places between ascending points where stability ends or begins, in order.

    Args:
        path: the loop at a place.
        points: places.
        drives: whether gains act in drives, beside which what the host holds may be weak.
    """
    loops = 0

    def stop(x: float) -> _Stop:
        nonlocal loops
        loops += 1
        return _Stop(x, path(x))

    def between(a: _Stop, b: _Stop, halvings: int) -> Iterator[tuple[float, float]]:
        weak = drives and halvings == HALVINGS and a.alike(b)
        if not halvings or loops > MOST_LOOPS or weak or _still(a.z, b.z):
            if a.loop.stable() is not b.loop.stable():
                yield a.x, b.x
            return
        middle = stop(0.5 * (a.x + b.x))
        if _smooth(a.z, middle.z, b.z):
            halvings = 1
        yield from between(a, middle, halvings - 1)
        yield from between(middle, b, halvings - 1)

    for a, b in itertools.pairwise(map(stop, points)):
        for ends in between(a, b, HALVINGS):
            yield _refined(path, *ends)


def _refined(path: Path, low: float, high: float) -> Crossing:
    """The change between two places, and the angle of the eigenvalue there."""
    from scipy.optimize import brentq

    def growth(x: float) -> float:
        return path(x).growth

    ends = growth(low), growth(high)
    if math.isfinite(ends[0] + ends[1]) and ends[0] * ends[1] < 0.0:
        width = EXACT * max(abs(low), abs(high))
        x = float(brentq(growth, low, high, xtol=width))  # type: ignore[arg-type]
    else:  # a direction that falls, or motion on the circle
        good = path(low).stable()
        x = roots.bisect(lambda x: path(x).stable() is good, low, high, EXACT)[1]
    theta = abs(float(np.angle(path(x).eigenvalues[0])))
    return Crossing(x, theta if theta > ON_AXIS else 0.0)


def _aligned(z: np.ndarray, *others: np.ndarray) -> list[np.ndarray]:
    """Eigenvalues of loops in the order in which they follow those of one; what comes or goes is 0.

    Those of two loops are paired so that the sum of their distances is least.
    """
    from scipy.optimize import linear_sum_assignment

    size = max(len(x) for x in (z, *others))
    first, *rest = (np.concatenate([x, np.zeros(size - len(x))]) for x in (z, *others))
    return [first, *(x[linear_sum_assignment(np.abs(first[:, None] - x))[1]] for x in rest)]


def _margin(*values: np.ndarray) -> np.ndarray:
    """Least distance of eigenvalues from the circle over some loops."""
    return np.min([np.abs(1.0 - np.abs(z)) for z in values], axis=0)


def _still(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether no eigenvalue can have crossed the circle between two loops and come back."""
    a, b = _aligned(a, b)
    return bool(np.all(np.abs(a - b) <= SHARE_OF_MARGIN * _margin(a, b)))


def _smooth(a: np.ndarray, z: np.ndarray, b: np.ndarray) -> bool:
    """The same, with a loop between them."""
    z, a, b = _aligned(z, a, b)
    size = [np.log(np.maximum(np.abs(x), NO_SIZE)) for x in (a, z, b)]
    margin, moved = _margin(a, z, b), np.maximum(np.abs(a - z), np.abs(b - z))
    bent = np.abs(size[1] - 0.5 * (size[0] + size[2]))
    straight = bent <= BENT * np.maximum(margin, np.abs(size[0] - size[2]))
    apart = np.abs(z[:, None] - z) + np.diag(np.full(len(z), math.inf))
    alone = moved <= SHARE_OF_GAP * apart.min(axis=1, initial=math.inf)
    return bool(np.all((moved <= SHARE_OF_MARGIN * margin) | (straight & alone)))
