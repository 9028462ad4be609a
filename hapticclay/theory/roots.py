"""Roots, extremes and signs of polynomials; bisection.

Every polynomial of the package is a `numpy.polynomial.Polynomial`, lowest power first. Roots of
continuous functions use SciPy's `brentq`; a change of a boolean property uses bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from . import exact_roots
from .exact_roots import axis_parts, exact, square_root, value, within_rounding

VARIABLE = Polynomial([0.0, 1.0])  # s itself
LEAST, MOST = 1e-300, 1e300  # between these a K is a number
SAME = 1e-12  # of their size: roots that cross at such K leave no room between them


def roots(p: Polynomial) -> np.ndarray:
    """Roots of p, with roots at zero exactly zero (`polyroots` returns rounding errors).

    Args:
        p: polynomial.
    """
    return np.roots(p.coef[::-1])


def nonzero_roots(p: Polynomial) -> np.ndarray:
    """Roots of p other than zero.

    Args:
        p: polynomial.
    """
    return np.roots(np.trim_zeros(p.coef)[::-1])


def positive_roots(p: Polynomial) -> np.ndarray:
    """Positive real roots of a real polynomial; imaginary parts up to 1e-6 count as rounding.

    Args:
        p: polynomial with real coefficients.
    """
    x = nonzero_roots(p)
    return x[(np.abs(x.imag) <= 1e-6 * np.abs(x)) & (x.real > 0.0)].real


def hurwitz(p: Polynomial) -> bool:
    """Return True if every root of p other than zero lies left of the imaginary axis.

    The answer is exact.

    Args:
        p: polynomial, of floats or rational.
    """
    return not np.any(p.coef) or exact_roots.roots_right(p) == (0, 0)


def multiplicity_of_zero(p: Polynomial) -> int:
    """Number of roots of p at zero.

    Args:
        p: polynomial.
    """
    return int(np.argmax(p.coef != 0.0))


def on_axis(p: Polynomial) -> Polynomial:
    """p(j omega) as a polynomial in omega with complex coefficients.

    Args:
        p: polynomial with real coefficients.
    """
    powers: Any = 1j ** np.arange(len(p.coef))
    return Polynomial(p.coef * powers)


def cross_spectrum(p: Polynomial, q: Polynomial) -> Polynomial:
    """p(j omega) q(j omega)*, with * the conjugate, as a polynomial in omega.

    Args:
        p: polynomial with real coefficients.
        q: polynomial with real coefficients.
    """
    return on_axis(p) * Polynomial(on_axis(q).coef.conj())


def real_part(p: Polynomial, q: Polynomial) -> Polynomial:
    """Re p(j omega) q(j omega)* as a polynomial in omega^2.

    Args:
        p: polynomial with real coefficients.
        q: polynomial with real coefficients.
    """
    return Polynomial(cross_spectrum(p, q).coef.real[::2])


def squared_magnitude(p: Polynomial) -> Polynomial:
    """|p(j omega)|^2 as a polynomial in omega^2.

    Args:
        p: polynomial with real coefficients.
    """
    return real_part(p, p)


def crossings(A: Polynomial, B: Polynomial) -> list[tuple[float, float]]:
    """Every K > 0 at which a root of A + K B lies on the imaginary axis, and its frequency.

    The result is exact. On the imaginary axis A + K B vanishes, so Im(A B*) = 0. The positive roots
    of this polynomial in omega give every K at which a pair of roots can cross. A single root can
    cross at 0 and at infinity. Roots that stay at zero do not count. Roots of A and of B on the
    axis within rounding do not count either: the loop has them at K = 0 and at infinity.

    Args:
        A: polynomial, of floats or rational.
        B: polynomial, of no higher degree.

    Returns:
        (K, omega [rad/s]), K ascending.
    """
    return [(x.K, x.omega) for x in _every_crossing(A, B) if not x.end]


@dataclass(frozen=True)
class _Crossing:
    """A root of A + K B on the axis; end is -1 for one of A, 1 for one of B, within rounding."""

    K: float
    omega: float
    end: int = 0


def _every_crossing(A: Polynomial, B: Polynomial) -> list[_Crossing]:
    """The crossings with K > 0 at a root of A, between, and at a root of B, K ascending."""
    A, B = exact(A).trim(), exact(B).trim()
    (Ae, Ao), (Be, Bo) = axis_parts(A), axis_parts(B)
    across = -(Ae * Be + Polynomial([Fraction(0), Fraction(1)]) * Ao * Bo)
    size2 = Be * Be + Polynomial([Fraction(0), Fraction(1)]) * Bo * Bo
    found = []
    for x in exact_roots.positive_roots(Ao * Be - Ae * Bo):
        if value(size2, x):  # else B(j omega) = 0: no K places a pole there
            end = -1 if within_rounding(A, x) else int(within_rounding(B, x))
            found.append((value(across, x) / value(size2, x), square_root(x), end))
    n = multiplicity_of_zero(A)
    if n == multiplicity_of_zero(B):
        found.append((-A.coef[n] / B.coef[n], 0.0, 0))
    if A.degree() == B.degree():
        found.append((-A.coef[-1] / B.coef[-1], math.inf, 0))
    within = [(float(K), *at) for K, *at in found if LEAST < K < MOST]
    return [_Crossing(*x) for x in sorted(within)]


def first_crossing(A: Polynomial, B: Polynomial) -> tuple[float, float]:
    """Smallest K > 0 at which a root of A + K B leaves the left half plane, and its frequency.

    Args:
        A: polynomial, of floats or rational.
        B: polynomial, of no higher degree.

    Returns:
        (K, omega [rad/s]); (inf, nan) if no root crosses, (0, nan) if one lies right of the axis at
        small K.
    """
    A, B = exact(A), exact(B)

    def stable(low: float, high: float) -> bool:
        """Whether the loop is, between two successive crossings."""
        if high == math.inf:
            K = 2.0 * low if low else 1.0
        else:
            K = math.sqrt(low) * math.sqrt(high) if low else 0.5 * high
        return hurwitz(A + Fraction(K) * B)

    found = _every_crossing(A, B)
    low = max((x.K for x in found if x.end < 0), default=0.0)
    found = [x for x in found if x.end >= 0 and x.K > low]
    gains = [*(x.K for x in found), math.inf]
    if not stable(low, gains[0]):
        return 0.0, math.nan
    for x, after in zip(found, gains[1:], strict=True):
        if x.end:
            break
        if after > (1.0 + SAME) * x.K and not stable(x.K, after):
            return x.K, x.omega
    return math.inf, math.nan


def least_ratio(R: Polynomial, Q: Polynomial) -> tuple[float, float]:
    """Smallest value of R/Q over all frequencies, 0 and infinity included, and its frequency.

    Args:
        R: polynomial in omega^2.
        Q: polynomial in omega^2, Q >= 0.

    Returns:
        (value, omega [rad/s]).
    """
    R, Q = R.trim(), Q.trim()
    x = np.concatenate(([0.0], positive_roots(R.deriv() * Q - R * Q.deriv())))
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.nan_to_num(R(x) / Q(x), nan=math.inf, posinf=math.inf, neginf=-math.inf)
    excess = R.degree() - Q.degree()
    end = R.coef[-1] / Q.coef[-1] if excess == 0 else math.copysign(math.inf, R.coef[-1])
    end = 0.0 if excess < 0 else end
    i = int(np.argmin(value))
    return (float(value[i]), math.sqrt(x[i])) if value[i] <= end else (float(end), math.inf)


def positive_bands(p: Polynomial) -> tuple[tuple[float, float], ...]:
    """Bands of omega [rad/s] in which a polynomial in omega^2 is positive.

    Args:
        p: polynomial with real coefficients.
    """
    x = np.concatenate(([0.0], np.sort(positive_roots(p))))
    inside = np.concatenate((0.5 * (x[1:] + x[:-1]), [2.0 * x[-1] + 1.0]))
    edges = np.concatenate((np.sqrt(x), [math.inf]))
    return tuple((float(edges[i]), float(edges[j + 1])) for i, j in runs_of_true(p(inside) > 0.0))


def runs_of_true(mask: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each run of True.

    Args:
        mask: shape (n,).
    """
    padded = np.concatenate(([False], mask, [False]))
    first = np.flatnonzero(padded[1:] & ~padded[:-1])
    last = np.flatnonzero(padded[:-1] & ~padded[1:]) - 1
    return list(zip(first.tolist(), last.tolist(), strict=True))


def bisect(
    holds: Callable[[float], bool], low: float, high: float, rtol: float = 1e-12
) -> tuple[float, float]:
    """Narrow the bracket of a change by bisection.

    Args:
        holds: the property; true at low, false at high.
        low: lower end of the bracket.
        high: upper end of the bracket.
        rtol: width of the result, relative to its upper end.

    Returns:
        (low, high), the property true at low and false at high.
    """
    while high - low > rtol * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def first_failure(
    holds: Callable[[float], bool],
    grid: Iterable[float],
    below: float | None = None,
    rtol: float = 1e-12,
) -> tuple[float, float]:
    """Bracket the first change from true to false along a grid.

    Args:
        holds: the property. A failure narrower than the grid may be missed.
        grid: ascending positive values to test.
        below: value below the grid at which the property is known to hold; None if there is none.
        rtol: width of the result, relative to its upper end.

    Returns:
        (low, high), the property true at low and false at high: (0, first of grid) if it fails
        there and below is None, (last of grid, inf) if it never fails.
    """
    low = below
    for x in grid:
        if not holds(x):
            return (0.0, x) if low is None else bisect(holds, low, x, rtol)
        low = x
    assert low is not None
    return low, math.inf
