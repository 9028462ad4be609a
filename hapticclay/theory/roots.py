"""Roots, extremes and signs of polynomials; bisection.

Every polynomial of the package is a `numpy.polynomial.Polynomial`, lowest power first. Roots of
continuous functions use SciPy's `brentq`; a change of a boolean property uses bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

VARIABLE = Polynomial([0.0, 1.0])  # s itself


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

    Args:
        p: polynomial.
    """
    return bool(np.all(nonzero_roots(p).real < 0.0))


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
    cross at 0 and at infinity. Roots that stay at zero do not count.

    Args:
        A: polynomial.
        B: polynomial, of no higher degree.

    Returns:
        (K, omega [rad/s]), K ascending.
    """
    AB = cross_spectrum(A, B)
    omega = positive_roots(Polynomial(AB.coef.imag))
    with np.errstate(divide="ignore", invalid="ignore"):  # B(j omega) = 0: no K places a pole there
        K = -AB(omega).real / np.abs(on_axis(B)(omega)) ** 2
        n = multiplicity_of_zero(A)
        ends = [-A.coef[n] / B.coef[n] if n == multiplicity_of_zero(B) else math.nan]
        ends += [-A.coef[-1] / B.coef[-1] if A.degree() == B.degree() else math.nan]
    K, omega = np.concatenate((K, ends)), np.concatenate((omega, [0.0, math.inf]))
    return [(float(K[i]), float(omega[i])) for i in np.argsort(K) if 0.0 < K[i] < math.inf]


def first_crossing(A: Polynomial, B: Polynomial) -> tuple[float, float]:
    """Smallest K > 0 at which a root of A + K B leaves the left half plane, and its frequency.

    Args:
        A: polynomial.
        B: polynomial, of no higher degree.

    Returns:
        (K, omega [rad/s]); (inf, nan) if no root crosses, (0, nan) if one lies right of the axis at
        small K.
    """
    found = crossings(A, B)
    if not hurwitz(A + (0.5 * found[0][0] if found else 1.0) * B):
        return 0.0, math.nan
    for K, omega in found:
        if not hurwitz(A + (1.0 + 1e-6) * K * B):
            return K, omega
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
