"""Joint loops that differ in one gain: the interval of it in which they are stable."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from .. import matrices
from . import joint_crossings, joint_scan
from .joint_crossings import Crossing
from .joint_loop import JointLoop, grid

SIDE = 1e-3  # share of a crossing beyond the last one at which the loop is judged
TURNS = 2.0 * math.pi  # [rad] of the joints' own motion in a sample, up to which gains are tried
DECADES = 6  # of gains that are tried on each side of the present one, or of 1
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

    def moved(self, by: float) -> Limit:
        """The same of a gain that counts from another value."""
        low, high, free_low = (x + by for x in self[:3])
        return self._replace(low=low, high=high, free_low=free_low)

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

    def at_rest(self, of: str) -> np.ndarray:
        """Position per constant torque, or measured rate in the steady motion that it keeps up."""
        return self.loop.at_rest() if of == "position" else self.loop.drift()

    @cached_property
    def borders(self) -> dict[str, bool]:
        """Whether rest loses its stiffness, and steady motion its resistance, at this loop."""
        loop = self.loop
        return {"position": bool(loop.structural), "rate": bool(loop.structural and loop.rest.free)}

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
        size: of such a gain, for a step beyond a limit.
        held: whether the host holds that torque; else it acts between samples.
        least: the least value of the gain.
    """

    circle: Circle
    of: Literal["position", "rate"]
    left: np.ndarray
    right: np.ndarray
    present: float
    changed: Callable[..., JointLoop]
    size: float = 1.0
    held: bool = True
    least: float = 0.0

    def response(self, angles: np.ndarray) -> np.ndarray:
        """right' x per torque along left, shape (m, k, k)."""
        found = self.circle.responses(angles)[0 if self.of == "position" else 1]
        return self.right.T @ found @ self.left

    def stable(self, change: float) -> bool:
        """Whether the loop is stable at a change of the gain."""
        return self.changed(change).stable() if change else self.circle.stable

    def limit(self) -> Limit:
        """The stable interval of the gain."""
        found = self._crossings() if self.held else self._scanned()
        return _interval(_distinct(found, self.size), self)

    def _crossings(self) -> list[Crossing]:
        """Changes on the circle, and at rest."""
        found = joint_crossings.crossings(self.response, self.circle.angles)
        return sorted(found + self._at_rest())

    def _at_rest(self) -> list[Crossing]:
        """Changes at which the stiffness of a motion, or the resistance to it, vanishes."""
        at_rest = self.right.T @ self.circle.at_rest(self.of) @ self.left
        values = matrices.eigenvalues(at_rest)
        real = values[(np.abs(values.imag) <= NEAR * np.abs(values)) & (values.real != 0.0)]
        here = [Crossing(0.0, 0.0)] if self.circle.borders[self.of] else []
        return [Crossing(-1.0 / x, 0.0) for x in real.real.tolist()] + here

    def _scanned(self) -> list[Crossing]:
        """Changes at which stability changes, by following the eigenvalues."""
        unit = self.size

        def path(x: float) -> JointLoop:
            return self.changed(unit * 10.0**x - self.present)

        points = [float(x) for x in range(-DECADES, DECADES + 1)]
        points = [x for x in points if x <= 0.0 or path(x).turn < TURNS]
        found = joint_scan.changes(path, points, drives=True)
        return [x._replace(change=unit * 10.0**x.change - self.present) for x in found]


def _distinct(found: Sequence[Crossing], size: float) -> list[Crossing]:
    out: list[Crossing] = []
    for x in found:
        if abs(x.change) <= NEAR * size:
            x = x._replace(change=0.0)
        if not out or x.change - out[-1].change > NEAR * (abs(x.change) + size):
            out.append(x)
    return out


def _interval(found: Sequence[Crossing], family: Family) -> Limit:
    """The stable interval of a gain around its present value, or the nearest allowed one.

    A present value on a border is a piece of its own.
    """
    present = family.present
    here = [x for x in found if not x.change]
    ends = Crossing(-math.inf, math.nan), Crossing(math.inf, math.nan)
    edges = [ends[0], *sorted([*found, *here]), ends[1]]
    pieces = list(zip(edges[:-1], edges[1:], strict=True))

    @functools.cache
    def stable(i: int) -> bool:
        low, high = pieces[i]
        return family.stable(_inside(low, high, family.size))

    around = [i for i, (a, b) in enumerate(pieces) if a.change <= 0.0 <= b.change]
    home = around[len(around) // 2]
    for i in sorted(range(len(pieces)), key=lambda i: (abs(i - home), i > home)):
        if pieces[i][1].change <= family.least - present and i != home or not stable(i):
            continue
        low = high = i
        while low and stable(low - 1):
            low -= 1
        while high + 1 < len(pieces) and stable(high + 1):
            high += 1
        (bottom, low_theta), (top, theta) = pieces[low][0], pieces[high][1]
        bottom, top = present + bottom, present + top
        bottom, top = (x if abs(x) > NEAR * family.size else 0.0 for x in (bottom, top))
        return Limit(max(family.least, bottom), top, bottom, theta, low_theta)
    return NONE


def _inside(a: Crossing, b: Crossing, size: float) -> float:
    """A change between two crossings; 0 if it lies between them."""
    low, high = a.change, b.change
    if low < 0.0 < high:
        return 0.0
    if math.isinf(low):
        return high - SIDE * (abs(high) + size)
    if math.isinf(high):
        return low + SIDE * (abs(low) + size)
    return 0.5 * (low + high)
