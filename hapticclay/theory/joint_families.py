"""Families of joint loops in one gain, of a joint or of all: where they are stable."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from . import joint_crossings, roots
from .joint_crossings import Crossing
from .joint_loop import JointLoop, grid

SIDE = 1e-3  # share of a crossing beyond the last one at which the loop is judged
TOP = 1e9  # factor on the present gain, or on 1, up to which a drive's gains are tried
TRIED = 60  # gains of a drive tried on each side, evenly in their logarithm
NEAR = 1e-9  # relative distance of crossings that count as one

Kind = Literal["Kp", "Kd"]


class Limit(NamedTuple):
    """The stable interval of a gain around its present value.

    Attributes:
        low: its lower end, not below 0; NaN if no value is stable.
        high: its upper end; inf for none.
        free_low: its lower end, below 0 too.
        theta: angle of the eigenvalue on the circle at the upper end [rad]; NaN for none.
    """

    low: float
    high: float
    free_low: float
    theta: float


NONE = Limit(math.nan, math.nan, math.nan, math.nan)


class Families:
    """The families of a loop's gains, which share its responses.

    Args:
        loop: the loop with its present gains.
        remake: the loop with other gains Kp and Kd, shapes (n,).
        gains: present Kp and Kd [N.m/rad, N.m.s/rad], shapes (n,).
        held: whether the host holds the gains' torque; else they act between samples.
    """

    def __init__(
        self,
        loop: JointLoop,
        remake: Callable[[np.ndarray, np.ndarray], JointLoop],
        gains: dict[Kind, np.ndarray],
        held: bool,
    ):
        self.loop, self._remake, self._gains, self._held = loop, remake, gains, held

    @cached_property
    def angles(self) -> np.ndarray:
        """Grid on the circle [rad]."""
        return grid(self.loop)

    @cached_property
    def _on_grid(self) -> dict[Kind, np.ndarray]:
        position, rate = self.loop.responses(self.angles)
        return {"Kp": position, "Kd": rate}

    @cached_property
    def _stable(self) -> bool:
        return self.loop.stable()

    def limit(self, kind: Kind, joint: int | None = None) -> Limit:
        """The stable interval of the gain of a joint; of a factor of all joints' for None."""
        weights = self._weights(kind, joint)
        present = 1.0 if joint is None else float(self._gains[kind][joint])

        def stable(change: float) -> bool:
            if abs(change) <= NEAR * present:
                return self._stable
            gains = {**self._gains, kind: self._gains[kind] + change * weights}
            return self._remake(gains["Kp"], gains["Kd"]).stable()

        find = self._crossings if self._held else self._tried
        return _interval(find(kind, weights, present, stable), present, stable)

    def _weights(self, kind: Kind, joint: int | None) -> np.ndarray:
        """Change of each joint's gain per unit of change."""
        if joint is None:
            return self._gains[kind]
        return np.eye(self.loop.n)[joint]

    def response(self, kind: Kind, weights: np.ndarray, loop: JointLoop | None = None):
        """Response of the joints that a gain weighs, as a function of the angle."""
        of, used = loop or self.loop, np.flatnonzero(weights)
        which = ("Kp", "Kd").index(kind)

        def at(angles: np.ndarray) -> np.ndarray:
            known = loop is None and angles is self.angles
            found = self._on_grid[kind] if known else of.responses(angles)[which]
            return weights[used][:, None] * found[:, used[:, None], used]

        return at

    def _crossings(
        self, kind: Kind, weights: np.ndarray, present: float, stable: Callable[[float], bool]
    ) -> list[Crossing]:
        """Crossings of a held gain: on the circle, and at rest where stiffness vanishes."""
        found = joint_crossings.crossings(self.response(kind, weights), self.angles)
        if kind == "Kp":
            used = np.flatnonzero(weights)
            at_rest = weights[used][:, None] * self.loop.at_rest()[np.ix_(used, used)]
            values = np.linalg.eigvals(at_rest)
            real = values[(np.abs(values.imag) <= NEAR * np.abs(values)) & (values.real != 0.0)]
            found += [Crossing(-1.0 / x, 0.0) for x in real.real.tolist()]
        return sorted(found)

    def _tried(
        self, kind: Kind, weights: np.ndarray, present: float, stable: Callable[[float], bool]
    ) -> list[Crossing]:
        """Ends of stable intervals of a drive's gain, by trial."""
        factors = np.geomspace(1.0 / TOP, TOP, 2 * TRIED + 1)
        changes = [-present, *((factors - 1.0) * (present or 1.0)).tolist()]
        held = [stable(u) for u in changes]
        out = []
        for a, b, left, right in zip(changes[:-1], changes[1:], held[:-1], held[1:], strict=True):
            if left is not right:
                edge = roots.bisect(lambda u, want=left: stable(u) is want, a, b, 1e-9)[0]
                out.append(Crossing(edge, math.nan))
        return out


def _interval(found: Sequence[Crossing], present: float, stable: Callable[[float], bool]) -> Limit:
    """The stable interval of a gain around its present value, or the nearest below or above it."""
    edges = [
        Crossing(-math.inf, math.nan),
        *_distinct(found, present),
        Crossing(math.inf, math.nan),
    ]
    pieces = list(zip(edges[:-1], edges[1:], strict=True))
    home = next(i for i, (a, b) in enumerate(pieces) if a.change <= 0.0 <= b.change)
    order = sorted(range(len(pieces)), key=lambda i: (abs(i - home), i > home))
    for i in order:
        if pieces[i][1].change <= -present or not stable(_inside(*pieces[i], present)):
            continue
        low = high = i
        while low and stable(_inside(*pieces[low - 1], present)):
            low -= 1
        while high + 1 < len(pieces) and stable(_inside(*pieces[high + 1], present)):
            high += 1
        (bottom, _), (_, top) = pieces[low], pieces[high]
        ends = present + bottom.change, present + top.change
        return Limit(max(0.0, ends[0]), ends[1], ends[0], top.theta)
    return NONE


def _distinct(found: Sequence[Crossing], present: float) -> list[Crossing]:
    out: list[Crossing] = []
    for x in found:
        if not out or x.change - out[-1].change > NEAR * (abs(x.change) + present):
            out.append(x)
    return out


def _inside(a: Crossing, b: Crossing, present: float) -> float:
    """A change between two crossings, near 0 if it lies between them."""
    low, high = a.change, b.change
    if low < 0.0 < high:
        return 0.0
    if math.isinf(low):
        return high - SIDE * (abs(high) + present)
    if math.isinf(high):
        return low + SIDE * (abs(low) + present)
    return 0.5 * (low + high)
