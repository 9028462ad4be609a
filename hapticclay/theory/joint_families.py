"""Joint loops that differ in one gain: the interval of it in which they are stable."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from .. import matrices
from . import joint_crossings, roots
from .joint_crossings import Crossing
from .joint_loop import JointLoop, grid

SIDE = 1e-3  # share of a crossing beyond the last one at which the loop is judged
TOP = 1e9  # factor on the present gain, or on 1, up to which gains are tried
TRIED = 60  # gains tried on each side, evenly in their logarithm
NEAR = 1e-9  # relative distance of crossings that count as one


class Limit(NamedTuple):
    """The stable interval of a gain around its present value, or the nearest one.

    Attributes:
        low: its lower end, not below 0; NaN if no value is stable.
        high: its upper end; inf for none.
        free_low: its lower end, which may lie below 0.
        theta: angle of the eigenvalue on the circle at the upper end [rad]; NaN for none.
        low_theta: likewise at the lower end, which may lie below 0.
    """

    low: float
    high: float
    free_low: float
    theta: float
    low_theta: float

    @property
    def upper(self) -> tuple[float, float]:
        """The upper end, and the angle there [rad]."""
        return self.high, self.theta

    @property
    def lower(self) -> tuple[float, float]:
        """The lower end, which may lie below 0, and the angle there [rad]."""
        return self.free_low, self.low_theta

    def frequency(self, Ts: float) -> float:
        """Frequency of that eigenvalue at a control sample [Hz]."""
        return self.theta / (2.0 * math.pi * Ts)


NONE = Limit(*[math.nan] * 5)


class Circle:
    """Responses of a loop on a grid of the unit circle, computed once for all its gains."""

    def __init__(self, loop: JointLoop):
        self.loop = loop

    @cached_property
    def angles(self) -> np.ndarray:
        """The grid [rad]."""
        return grid(self.loop)

    @cached_property
    def _found(self) -> tuple[np.ndarray, np.ndarray]:
        return self._computed(self.angles)

    def _computed(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.loop.responses(angles)

    def responses(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and rate per torque, those of the grid from memory."""
        return self._found if angles is self.angles else self._computed(angles)

    def at_rest(self) -> np.ndarray:
        """Position per constant torque."""
        return self.loop.at_rest()

    @cached_property
    def stable(self) -> bool:
        """Whether the loop is stable."""
        return self.loop.stable()


@dataclass(frozen=True, eq=False)
class Family:
    """Loops whose torque has a further part -u left right' x of a response x.

    Attributes:
        circle: the loop at u = 0.
        of: the response, position or measured rate.
        left: shape (n, k).
        right: shape (n, k).
        present: the gain at u = 0.
        changed: the loop at u; its changes of other things are keywords.
        held: whether the host holds that torque; else it acts between samples.
    """

    circle: Circle
    of: Literal["position", "rate"]
    left: np.ndarray
    right: np.ndarray
    present: float
    changed: Callable[..., JointLoop]
    held: bool = True

    def response(self, angles: np.ndarray) -> np.ndarray:
        """right' x per torque along left, shape (m, k, k)."""
        found = self.circle.responses(angles)[0 if self.of == "position" else 1]
        return self.right.T @ found @ self.left

    def stable(self, change: float) -> bool:
        """Whether the loop is stable at a change of the gain."""
        return self.changed(change).stable() if change else self.circle.stable

    def limit(self) -> Limit:
        """The stable interval of the gain."""
        found = self._crossings() if self.held else self._tried()
        return _interval(_distinct(found, self.present), self)

    def _crossings(self) -> list[Crossing]:
        """Changes on the circle, and at rest where the stiffness of a motion vanishes."""
        found = joint_crossings.crossings(self.response, self.circle.angles)
        if self.of == "position":
            at_rest = self.right.T @ self.circle.at_rest() @ self.left
            values = matrices.eigenvalues(at_rest)
            real = values[(np.abs(values.imag) <= NEAR * np.abs(values)) & (values.real != 0.0)]
            found += [Crossing(-1.0 / x, 0.0) for x in real.real.tolist()]
        return sorted(found)

    def _tried(self) -> list[Crossing]:
        """Changes at which stability changes, by trial."""
        factors = np.geomspace(1.0 / TOP, TOP, 2 * TRIED + 1)
        changes = [-self.present, *((factors - 1.0) * (self.present or 1.0)).tolist()]
        held, out = [self.stable(u) for u in changes], []
        for a, b, left, right in zip(changes[:-1], changes[1:], held[:-1], held[1:], strict=True):
            if left is not right:
                edge = roots.bisect(lambda u, as_left=left: self.stable(u) is as_left, a, b, 1e-9)
                out.append(Crossing(edge[0], math.nan))
        return out


def _distinct(found: Sequence[Crossing], present: float) -> list[Crossing]:
    out: list[Crossing] = []
    for x in found:
        if not out or x.change - out[-1].change > NEAR * (abs(x.change) + present):
            out.append(x)
    return out


def _interval(found: Sequence[Crossing], family: Family) -> Limit:
    """The stable interval of a gain around its present value, or the nearest of values above 0."""
    present = family.present
    edges = [Crossing(-math.inf, math.nan), *found, Crossing(math.inf, math.nan)]
    pieces = list(zip(edges[:-1], edges[1:], strict=True))

    def stable(i: int) -> bool:
        return family.stable(_inside(*pieces[i], present))

    home = next(i for i, (a, b) in enumerate(pieces) if a.change <= 0.0 <= b.change)
    for i in sorted(range(len(pieces)), key=lambda i: (abs(i - home), i > home)):
        if pieces[i][1].change <= -present or not stable(i):
            continue
        low = high = i
        while low and stable(low - 1):
            low -= 1
        while high + 1 < len(pieces) and stable(high + 1):
            high += 1
        (bottom, low_theta), (top, theta) = pieces[low][0], pieces[high][1]
        bottom, top = present + bottom, present + top
        return Limit(max(0.0, bottom), top, bottom, theta, low_theta)
    return NONE


def _inside(a: Crossing, b: Crossing, present: float) -> float:
    """A change between two crossings; 0 if it lies between them."""
    low, high = a.change, b.change
    if low < 0.0 < high:
        return 0.0
    if math.isinf(low):
        return high - SIDE * (abs(high) + present)
    if math.isinf(high):
        return low + SIDE * (abs(low) + present)
    return 0.5 * (low + high)
