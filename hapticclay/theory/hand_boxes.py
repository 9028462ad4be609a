"""The worst hand of a box, with the least stability margin, and a rigid hand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Annotated

import numpy as np
from numpy.polynomial import Polynomial

from ..arguments import named, part
from ..errors import Bound, ParameterError, Real, number
from ..model.operator import Operator
from . import exact_roots, gain_crossings, linear_loop, roots
from .exact_roots import axis_parts, rational, value
from .loops import Loop, of_loop
from .roots import first_failure
from .stability_margins import LINEAR, Verdict

# ---- the worst case over hands -------------------------------------------------------------------


ENDS = ("low", "high")


@part("box.")
class Box:
    """Ranges of Th, with or without a rigid arm.

    Attributes:
        mass: (low, high) [kg].
        damper: (low, high) [N.s/m].
        spring: (low, high) [N/m].
        rigid: True adds a rigid arm, Th = infinity.
    """

    mass: Annotated[tuple[Real, Real], Bound(0.0, unit="kg", names=ENDS)] = (0.25, 0.25)
    damper: Annotated[tuple[Real, Real], Bound(0.0, unit="N.s/m", names=ENDS)] = (2.0, 2.0)
    spring: Annotated[tuple[Real, Real], Bound(0.0, unit="N/m", names=ENDS)] = (6.0, 6.0)
    rigid: bool = False

    def __post_init__(self):
        for field in ("mass", "damper", "spring"):
            low, high = getattr(self, field)
            if high < low:
                raise ParameterError(f"box.{field}", (low, high), "must have low <= high")
            Operator(**{field: high})

    def corners(self) -> list[Operator]:
        """Return the up to eight distinct corners."""
        corners = sorted(set(itertools.product(self.mass, self.damper, self.spring)))
        return [Operator(*x) for x in corners]

    def sample(self, n: int, seed: int = 0) -> list[Operator]:
        """Draw members uniformly.

        Args:
            n: number of members.
            seed: seed of the generator.
        """
        x = np.random.default_rng(seed).uniform(size=(n, 3))
        low, high = np.array([self.mass, self.damper, self.spring]).T
        return [Operator(*row) for row in (low + x * (high - low)).tolist()]


def lattice(box: Box) -> list[Operator]:
    """The hands at ends and middles of a box, up to 27."""
    sides = box.mass, box.damper, box.spring
    places = (sorted({low, 0.5 * (low + high), high}) for low, high in sides)
    return [Operator(*hand) for hand in itertools.product(*places)]


@named
@dataclass(frozen=True)
class WorstCase:
    """The worst hand of a box.

    Attributes:
        verdict: whether every hand of the box is stable, its margin the worst gain limit over K.
        limit: largest K up to which every hand is stable.
        hand: the hand that becomes unstable at this K; None for the rigid arm.
    """

    verdict: Verdict
    limit: float
    hand: Operator | None


def critical_hand(loop: Loop, box: Box) -> tuple[Operator, float] | None:
    """A hand of the box that puts a pole on the imaginary axis.

    The result is exact (zero exclusion; Barmish, New Tools for Robustness of Linear Systems, 1994).
    The closed-loop polynomial is A + E Th, so the pole s = j omega needs one value Th = -A/E. The
    values of the box at omega are a rectangle, spring - mass omega^2 by omega damper: -A/E lies in
    it where four polynomials in omega^2 have the right sign.
    """
    denominator, passive, driven = linear_loop.loop_polynomials(
        replace(loop, operator=None), rational
    )
    K = rational([loop.gain])
    A = denominator + passive + K * driven
    unit = replace(loop, b=0.0, k=0.0, operator=Operator(0.0, 0.0, 1.0))
    _, passive, driven = linear_loop.loop_polynomials(unit, rational)
    E = passive + K * driven
    for edge in _critical_ends(A, E, box):
        return edge
    (Ae, Ao), (Ee, Eo), omega2 = axis_parts(A), axis_parts(E), rational([0, 1])
    R, X = -(Ae * Ee + omega2 * Ao * Eo), Ae * Eo - Ao * Ee
    Q = Ee * Ee + omega2 * Eo * Eo  # -A/E = R/Q + j omega X/Q
    (m0, m1), (d0, d1), (k0, k1) = box.mass, box.damper, box.spring
    dampers = X - rational([d0]) * Q, rational([d1]) * Q - X
    reals = R - rational([k0, -m1]) * Q, rational([k1, -m0]) * Q - R
    edges = []
    for on, others in ((dampers, reals), (reals, dampers)):  # exactly zero at its own roots
        for x in sorted({x for t in on for x in exact_roots.positive_roots(t)}):
            edges.append(x)
            if all(value(t, x) >= 0 for t in others):
                return _member(box, R, X, Q, x)
    edges.sort()
    for x in (0.5 * (low + high) for low, high in itertools.pairwise(map(float, edges))):
        if all(value(t, Fraction(x)) >= 0 for t in (*dampers, *reals)):
            return _member(box, R, X, Q, Fraction(x))
    return None


def _critical_ends(A: Polynomial, E: Polynomial, box: Box) -> Iterator[tuple[Operator, float]]:
    """Hands that put a pole at 0, by their spring, or at infinity, by their mass."""
    lows = {f: getattr(box, f)[0] for f in ("mass", "damper", "spring")}
    for field, end, at, power in (("spring", 0, 0.0, 0), ("mass", -1, math.inf, 2)):
        low, high = getattr(box, field)
        if A.coef[end] and E.coef[end] and (not power or A.degree() == E.degree() + power):
            needed = -A.coef[end] / E.coef[end]
            if low <= needed <= high:
                yield Operator(**lows | {field: float(needed)}), at


def _member(
    box: Box, R: Polynomial, X: Polynomial, Q: Polynomial, x: Fraction
) -> tuple[Operator, float]:
    """The hand of the box whose value at omega^2 = x is R/Q + j omega X/Q."""
    real, damper = float(value(R, x) / value(Q, x)), float(value(X, x) / value(Q, x))
    x2 = float(x)
    lowest = max(box.mass[0], (box.spring[0] - real) / x2)
    highest = min(box.mass[1], (box.spring[1] - real) / x2)
    mass = min(max(0.5 * (lowest + highest), box.mass[0]), box.mass[1])
    spring = min(max(real + mass * x2, box.spring[0]), box.spring[1])
    return Operator(mass, min(max(damper, box.damper[0]), box.damper[1]), spring), math.sqrt(x2)


def rigid_limit(loop: Loop) -> tuple[float, float]:
    """Largest stable K with a rigid arm, Th to infinity.

    The closed-loop poles tend to the zeros of G C + Sh, so its numerator sets the limit for any
    clay. The paper remarks below Eq. 13 that no compensator is stable with a rigid arm. This is a
    property of its sufficient condition, not of the loop.
    """
    unit = replace(loop, b=0.0, k=0.0, operator=Operator(0.0, 0.0, 1.0))
    return roots.first_crossing(*linear_loop.loop_polynomials(unit, rational)[1:])


@of_loop("K", "b", "box", timing=True)
def worst_case(
    loop: Loop, box: Box, *, samples: Annotated[int, Bound(0, 10_000)] = 56
) -> WorstCase:
    """The lowest gain limit over a box of hands.

    In continuous time without delay the result is exact: the least K at which `critical_hand` finds
    a hand. With sampling or delay it is the minimum over the corners and random members, and the
    verdict's method says so.

    Args:
        loop: the loop with its K > 0, its hand ignored; or axis, K, b, box, and other parts by
            name.
        box: the hands.
        samples: random members tested with sampling or delay, 0 to 10000.
    """
    K = number("K", loop.gain, 0.0, above=True)
    timed = loop.Ts is not None or loop.delay > 0.0
    if timed:
        members = box.corners() + box.sample(samples)
        found = [(*gain_crossings.critical_gain(replace(loop, operator=th)), th) for th in members]
        limit, omega, hand = min(found, key=lambda x: x[0])
        how = f"sampled: the corners and {samples} random members, no proof for those between"
    else:
        limit, omega, hand = _exact_worst_case(loop, box)
        how = "zero exclusion, its value set a rectangle at every frequency: exact"
    if box.rigid:
        rigid, rigid_omega = rigid_limit(loop)
        if rigid < limit:
            limit, omega, hand = rigid, rigid_omega, None
        how += "; the rigid arm by the zeros of G C + Sh"
        how += ", in continuous time" if timed else ", exact"
    assumptions = (LINEAR, f"hand in {box}")
    verdict = Verdict(K < limit, limit / K, omega, assumptions, how, "worst gain limit over K")
    return WorstCase(verdict, limit, hand)


def _exact_worst_case(loop: Loop, box: Box) -> tuple[float, float, Operator | None]:
    corners = box.corners()

    def stable(K: float) -> bool:
        tried = replace(loop, operator=corners[0], K=K)
        return linear_loop.stable(tried) and not critical_hand(tried, box)

    found = [(*gain_crossings.critical_gain(replace(loop, operator=th)), th) for th in corners]
    limit, omega, worst = min(found, key=lambda x: x[0])
    if len(corners) == 1:
        return limit, omega, worst
    top = min(limit, 1e6)
    if limit == 0.0:
        return limit, math.nan, worst
    # A window narrower than 20 % in K may be missed, but no limit of a corner.
    decades = 4 if limit < math.inf else 9  # one stable K says nothing of smaller ones
    grid = np.geomspace(10.0**-decades * top, top, 12 * decades + 1)[:-1].tolist()
    grid.append((1.0 + 1e-6) * top)
    high = first_failure(stable, grid, below=0.0)[1]
    if high < (1.0 - 1e-7) * limit:  # the resolution of `critical_hand`
        critical = critical_hand(replace(loop, K=high), box)
        return high, critical[1] if critical else math.nan, critical[0] if critical else worst
    return limit, omega, worst
