"""Roots right of the imaginary axis of now(s) + later(s) exp(-s delay), counted without a grid.

Along the axis one of the two terms is the larger between two frequencies at which they are equal.
There the phase of the sum is that of the larger term plus an angle below a quarter turn, so it
follows in closed form however many turns the delay makes.
"""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
from numpy.polynomial import Polynomial

from . import exact_roots
from .exact_roots import axis_parts, value


def roots_right(now: Polynomial, later: Polynomial, delay: float) -> int:
    """Number of roots right of the axis (argument principle)."""
    now, later = exact_roots.exact(now), exact_roots.exact(later)
    while not now.coef[0] and not later.coef[0]:  # roots at zero count on neither side
        now, later = (exact_roots.rational(p.coef[1:]) for p in (now, later))
    omega, ahead = exact_roots.unit_crossings(later, now)
    beside = np.angle(np.exp(1j * (ahead - math.pi - omega * delay)))  # of the second to the first
    beside = [0.0, *(0.5 * beside).tolist(), 0.0]  # of their sum to the first
    edges = [0.0, *omega.tolist(), math.inf]
    turned = 0.0
    for i, (low, high) in enumerate(itertools.pairwise(edges)):
        middle = 0.5 * (low + high) if high < math.inf else 2.0 * low + 1.0
        first = _size2(now, middle) >= _size2(later, middle)
        turned += _turn(now if first else later, low, high)
        turned += (beside[i + 1] - beside[i]) * (1.0 if first else -1.0)
        turned -= 0.0 if first else delay * (high - low)
    return round(0.5 * now.degree() - turned / math.pi)


def _size2(p: Polynomial, omega: float) -> Fraction:
    even, odd = axis_parts(p)
    x = Fraction(omega) ** 2
    return value(even, x) ** 2 + x * value(odd, x) ** 2


def _turn(p: Polynomial, low: float, high: float) -> float:
    """Change of the phase of p(j omega) between two frequencies [rad]."""
    if not len(p.coef) > 1:
        return 0.0
    z = exact_roots.approximate_roots(p)
    ends = 1.0j * low - z, (1.0j * high - z if high < math.inf else np.full(len(z), 1.0j))
    return float(np.sum(np.angle(ends[1] * ends[0].conj())))
