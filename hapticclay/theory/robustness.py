"""Stability with every hand in a box: mass, damper and spring of Th each in a range, and the rigid arm."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError, flag, integer, number, numbers_of
from ..model.scenario import Operator
from . import gain_limit, linear_loop
from .linear_loop import PRINTED, Compensator
from .margins import LINEAR, Verdict, real, square

FIELDS = ("mass", "damper", "spring")


@dataclass(frozen=True)
class Box:
    """Ranges (low, high) of the hand's mass [kg], damper [N.s/m], spring [N/m]; rigid puts Th = infinity among them."""

    mass: tuple[float, float] = (0.25, 0.25)
    damper: tuple[float, float] = (2.0, 2.0)
    spring: tuple[float, float] = (6.0, 6.0)
    rigid: bool = False

    def __post_init__(self):
        for field in FIELDS:
            low, high = numbers_of(f"box.{field}", getattr(self, field), ("low", "high"), 0.0)
            if high < low:
                raise ParameterError(f"box.{field}", (low, high), "must have low <= high")
            object.__setattr__(self, field, (low, high))
            Operator(**{field: high})
        flag("box.rigid", self.rigid)

    def corners(self) -> list[Operator]:
        """The eight corners, each once."""
        return [Operator(*x) for x in sorted(set(itertools.product(self.mass, self.damper, self.spring)))]

    def sample(self, n: int, seed: int = 0) -> list[Operator]:
        """n members, uniform within the box."""
        x = np.random.default_rng(seed).uniform(size=(n, 3))
        ranges = np.array([self.mass, self.damper, self.spring])
        return [Operator(*row) for row in (ranges[:, 0] + x * (ranges[:, 1] - ranges[:, 0])).tolist()]


@dataclass(frozen=True)
class WorstCase:
    """What a box of hands does to the loop.

    Attributes:
        verdict: whether every hand of the box is stable, its margin the worst gain limit over K.
        limit: largest K up to which every hand is stable.
        hand: one that stops being stable there; None if it is the rigid arm.
    """

    verdict: Verdict
    limit: float
    hand: Operator | None


def critical_hand(
    axis: str, K: float, b: float, box: Box, compensator: Compensator = PRINTED
) -> tuple[Operator, float] | None:
    """A hand of the box that puts a pole on the imaginary axis, and where [rad/s]; None if there is none.

    Exact (zero exclusion; Barmish, New Tools for Robustness of Linear Systems, 1994). The closed-loop polynomial is
    A + E Th, so the pole s = j omega asks for one value Th = -A/E. The values of the box at omega are a rectangle,
    spring - mass omega^2 by omega damper: -A/E lies in it where four polynomials in omega^2 have the right sign.
    """
    blank, passive, driven = linear_loop.terms(axis, b, None, compensator)
    A = np.polyadd(np.polyadd(blank, passive), K * driven)
    E = linear_loop.device(axis, K, compensator)[0]
    R, Q = real(-A, E), square(E)  # -A/E = R/Q + j omega X/Q
    X = np.convolve(linear_loop.on_axis(-A), linear_loop.on_axis(E).conj()).imag[::-1][1::2][::-1]
    (m0, m1), (d0, d1), (k0, k1) = box.mass, box.damper, box.spring
    tests = [
        np.polysub(X, d0 * Q),
        np.polysub(d1 * Q, X),
        np.polysub(R, np.convolve([-m1, k0], Q)),
        np.polysub(np.convolve([-m0, k1], Q), R),
    ]
    edges = np.unique(np.concatenate([linear_loop.positive_roots(t) for t in tests]))
    for x in np.concatenate((edges, 0.5 * (edges[1:] + edges[:-1]))).tolist():
        # where an edge of the box is met, to 1e-9 of the terms that cancel there
        if all(np.polyval(t, x) >= -1e-9 * np.polyval(np.abs(t), x) for t in tests):
            q = np.polyval(Q, x)
            return _member(box, float(np.polyval(R, x) / q), float(np.polyval(X, x) / q), x)
    return None


def _member(box: Box, real: float, damper: float, x: float) -> tuple[Operator, float]:
    """The hand of the box whose value at omega^2 = x is real + j omega damper."""
    low, high = max(box.mass[0], (box.spring[0] - real) / x), min(box.mass[1], (box.spring[1] - real) / x)
    mass = min(max(0.5 * (low + high), box.mass[0]), box.mass[1])
    spring = min(max(real + mass * x, box.spring[0]), box.spring[1])
    return Operator(mass, min(max(damper, box.damper[0]), box.damper[1]), spring), math.sqrt(x)


def rigid_limit(axis: str, compensator: Compensator = PRINTED) -> tuple[float, float]:
    """Largest K that is stable with an arm that cannot move, Th to infinity, and where [rad/s].

    The closed-loop poles tend to the zeros of G C + Sh, so the limit is that of its numerator, whatever the clay. The
    paper says below Eq. 13 that no compensator serves a rigid arm; that is what its sufficient condition says, not
    what the loop does.
    """
    driven = linear_loop.device(axis, 1.0, compensator)[0]
    passive = linear_loop.device(axis, 0.0, compensator)[0]
    return linear_loop.first_crossing(passive, np.polysub(driven, passive))


def worst_case(
    axis: str,
    K: float,
    b: float,
    box: Box,
    *,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
    compensator: Compensator = PRINTED,
    samples: int = 56,
) -> WorstCase:
    """The lowest gain limit over a box of hands.

    In continuous time without delay it is exact: K rises from zero until `critical_hand` finds one. With
    sampling or delay it is the least over the corners and random members, and the verdict's method says so.

    Args:
        axis: "x" or "y". K: gain. b: clay [N.s/m]. box: the hands.
        Ts, delay, render: as in `gain_limit`. compensator: shape of C, in continuous time.
        samples: random members tried with sampling or delay, 0 to 10000.
    """
    K = number("K", K, 0.0, above=True)
    if not isinstance(box, Box):
        raise ParameterError("box", box, "must be a Box")
    if Ts is None and not delay:
        limit, omega, hand = _exact(axis, b, box, compensator)
        how = "zero exclusion, its value set a rectangle at every frequency: exact"
    else:
        if compensator != PRINTED:
            raise ParameterError("compensator", compensator, "must be the printed one with sampling or delay")
        members = box.corners() + box.sample(integer("samples", samples, 0, 10_000))
        found = [(*gain_limit.critical(axis, b, th, Ts, delay, render), th) for th in members]
        limit, omega, hand = min(found, key=lambda x: x[0])
        how = f"sampled: the corners and {samples} random members, no proof for those between"
    if box.rigid:
        stiff, at = rigid_limit(axis, compensator)
        if stiff < limit:
            limit, omega, hand = stiff, at, None
        how += "; the rigid arm by the zeros of G C + Sh" + (", in continuous time" if Ts or delay else ", exact")
    verdict = Verdict(K < limit, limit / K, omega, (LINEAR, f"hand in {box}"), how, "worst gain limit over K")
    return WorstCase(verdict, limit, hand)


def _exact(axis: str, b: float, box: Box, compensator: Compensator) -> tuple[float, float, Operator | None]:
    def unstable(K: float) -> bool:
        return not linear_loop.stable(axis, K, b, corners[0], compensator) or bool(
            critical_hand(axis, K, b, box, compensator)
        )

    corners = box.corners()
    limit, worst = min(((linear_loop.gain_limit(axis, b, th, compensator), th) for th in corners), key=lambda x: x[0])
    top = min(limit, 1e6)
    low, high = 0.0, (1.0 + 1e-6) * top
    if limit == math.inf and not unstable(top):
        return limit, math.nan, worst
    for K in np.geomspace(1e-4 * top, top, 49)[:-1].tolist():  # a window narrower than 20 % in K may be jumped ...
        if unstable(K):
            high = K
            break
        low = K
    while high - low > 1e-12 * high:
        K = 0.5 * (low + high)
        low, high = (low, K) if unstable(K) else (K, high)
        if K in (low, high) and high - low <= 4.0 * math.ulp(high):
            break
    if high < (1.0 - 1e-7) * limit:  # ... but no limit of a corner; `critical_hand` is that sharp
        found = critical_hand(axis, high, b, box, compensator)
        return high, found[1] if found else math.nan, found[0] if found else worst
    blank, passive, driven = linear_loop.terms(axis, b, worst, compensator)
    return limit, linear_loop.first_crossing(np.polyadd(blank, passive), driven)[1], worst
