"""Roots, extremes and signs of polynomials; bisection.

Every polynomial of the package is a `numpy.polynomial.Polynomial`, lowest power first. Roots of
continuous functions use SciPy's `brentq`; a change of a boolean property uses bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from .. import matrices
from . import exact_roots
from .exact_roots import axis_parts, exact, rational, square_root, value, within_rounding

VARIABLE = Polynomial([0.0, 1.0])  # s itself
ROUNDED = 1e-14  # a sum below this share of its terms is their rounding
NEARLY_REAL = 1e-3  # imaginary part of a double root that rounding has split, as a share of it
SCAN_DENSITY = 24.0  # points of a scan per decade of omega^2, ...
SCAN_BEYOND = 6.0  # which extends by so many decades on either side of all roots, ...
REFINED = 8  # times that a minimum is looked for on a grid 20 times as fine
NOISE = 1e-12  # relative differences of values up to this are rounding
SCAN_NEAR = np.linspace(-5.0, 5.0, 21)  # and closes in on a root, in units of its imaginary part
LEAST, MOST = 1e-300, 1e300  # between these a K is a number
SAME = 1e-12  # of their size: roots that cross at such K leave no room between them


def roots(p: Polynomial) -> np.ndarray:
    """Roots of p, with roots at zero exactly zero (`polyroots` returns rounding errors)."""
    return matrices.polynomial_roots(p.coef[::-1])


def nonzero_roots(p: Polynomial) -> np.ndarray:
    """Roots of p other than zero."""
    return matrices.polynomial_roots(np.trim_zeros(p.coef)[::-1])


def positive_roots(p: Polynomial) -> np.ndarray:
    """Positive real roots of a real polynomial; imaginary parts up to 1e-6 count as rounding."""
    x = nonzero_roots(p)
    return x[(np.abs(x.imag) <= 1e-6 * np.abs(x)) & (x.real > 0.0)].real


def hurwitz(p: Polynomial) -> bool:
    """Return True if every root of p other than zero lies left of the imaginary axis.

    The answer is exact.
    """
    p = exact(p)
    return not any(p.integers) or exact_roots.roots_right(p) == (0, 0)


def multiplicity_of_zero(p: Polynomial) -> int:
    """Number of roots of p at zero."""
    return int(np.argmax(p.coef != 0.0))


def on_axis(p: Polynomial) -> Polynomial:
    """p(j omega) as a polynomial in omega with complex coefficients."""
    powers: Any = 1j ** np.arange(len(p.coef))
    return Polynomial(p.coef * powers)


def cross_spectrum(p: Polynomial, q: Polynomial) -> Polynomial:
    """p(j omega) q(j omega)*, with * the conjugate, as a polynomial in omega."""
    return on_axis(p) * Polynomial(on_axis(q).coef.conj())


def real_part(p: Polynomial, q: Polynomial) -> Polynomial:
    """Re p(j omega) q(j omega)* as a polynomial in omega^2."""
    return Polynomial(cross_spectrum(p, q).coef.real[::2])


def squared_magnitude(p: Polynomial) -> Polynomial:
    """|p(j omega)|^2 as a polynomial in omega^2."""
    return real_part(p, p)


def crossings(A: Polynomial, B: Polynomial) -> list[tuple[float, float]]:
    """Every K > 0 at which a root of A + K B lies on the imaginary axis, and its frequency.

    The result is exact. On the imaginary axis A + K B vanishes, so Im(A B*) = 0. The positive roots
    of this polynomial in omega give every K at which a pair of roots can cross. A single root can
    cross at 0 and at infinity. Roots that stay at zero do not count. Roots of A and of B on the
    axis within rounding do not count either: the loop has them at K = 0 and at infinity.
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
    A, B = exact(A), exact(B)
    if not any(B.integers):  # what drives nothing moves no root
        return []
    (Ae, Ao), (Be, Bo) = axis_parts(A), axis_parts(B)
    omega2 = rational([0, 1])
    across, size2 = -(Ae * Be + omega2 * Ao * Bo), Be * Be + omega2 * Bo * Bo
    found = []
    for x in exact_roots.positive_roots(Ao * Be - Ae * Bo):
        if value(size2, x):  # else B(j omega) = 0: no K places a pole there
            end = -1 if within_rounding(A, x) else int(within_rounding(B, x))
            found.append((value(across, x) / value(size2, x), square_root(x), end))
    a, b, n = A.coef, B.coef, multiplicity_of_zero(A)
    if n == multiplicity_of_zero(B):
        found.append((-a[n] / b[n], 0.0, 0))
    if len(a) == len(b):
        found.append((-a[-1] / b[-1], math.inf, 0))
    within = [(float(K), *at) for K, *at in found if LEAST < K < MOST]
    return [_Crossing(*x) for x in sorted(within)]


def first_crossing(A: Polynomial, B: Polynomial) -> tuple[float, float]:
    """Smallest K > 0 at which a root of A + K B leaves the left half plane, and its frequency."""
    A, B = exact(A), exact(B)

    def stable(low: float, high: float) -> bool:
        """Whether the loop is, between two successive crossings."""
        if high == math.inf:
            K = 2.0 * low if low else 1.0
        else:
            K = math.sqrt(low) * math.sqrt(high) if low else 0.5 * high
        return hurwitz(A + rational([K]) * B)

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
    """Smallest value of R/Q over all frequencies, 0 and infinity included, and its frequency."""
    unit = _typical_size(R, Q)
    R, Q = _in_unit(R, unit), _in_unit(Q, unit)
    found = np.concatenate((nonzero_roots(R), nonzero_roots(Q)))
    value, x = _least_value(lambda x: _ratio(R, Q, x), R, Q, found)
    return value, math.sqrt(unit * x)


def peak_ratio(p: Polynomial, q: Polynomial) -> tuple[float, float]:
    """Largest |p/q| on the imaginary axis, 0 and infinity included, and its frequency.

    The values come from p and q themselves: their squares lose half of the digits at a lightly
    damped root of q.
    """
    unit = _typical_size(p, q)
    p, q = _in_unit(p, unit), _in_unit(q, unit)
    P, Q = on_axis(p), on_axis(q)
    found = -(np.concatenate((nonzero_roots(p), nonzero_roots(q))).astype(complex) ** 2)
    value, x = _least_value(
        lambda x: -np.abs(_ratio(P, Q, np.sqrt(x))),
        -squared_magnitude(p),
        squared_magnitude(q),
        found,
    )
    return -value, unit * math.sqrt(x)


def _typical_size(*polynomials: Polynomial) -> float:
    """Geometric mean of the roots' magnitudes; in this unit powers neither overflow nor vanish."""
    size = np.abs(np.concatenate([nonzero_roots(p) for p in polynomials]))
    size = size[(size > 0.0) & np.isfinite(size)]
    return float(np.exp(np.mean(np.log(size)))) if len(size) else 1.0


def _in_unit(p: Polynomial, unit: float) -> Polynomial:
    """p as a polynomial in its variable over a unit."""
    p = p.trim()
    return Polynomial(np.multiply(p.coef, unit ** np.arange(len(p.coef))))


def _ratio(p: Polynomial, q: Polynomial, x: np.ndarray) -> np.ndarray:
    """p/q at x >= 0, infinity included; infinity where both vanish."""
    n = max(p.degree(), q.degree()) + 1
    far = x > 1.0  # there in powers of 1/x

    def value(y: Polynomial) -> np.ndarray:
        back = Polynomial(np.pad(y.coef, (0, n - len(y.coef)))[::-1])
        return np.where(far, back(1.0 / np.where(far, x, 1.0)), y(np.where(far, 1.0, x)))

    with np.errstate(divide="ignore", invalid="ignore"):
        out = value(p) / value(q)
    return np.where(np.isnan(out), math.inf, out)


def _least_value(
    value: Callable[[np.ndarray], np.ndarray], R: Polynomial, Q: Polynomial, found: np.ndarray
) -> tuple[float, float]:
    """Least value of a function with the extremes of R/Q over x >= 0, and its place.

    The roots of R and Q are passed, because those of a square are less accurate.

    The extremes are the roots of the slope R'Q - RQ'. Its coefficients can cancel, of R and Q of
    equal degree the highest always do, and the roots are then those of rounding errors. So they
    only join a scan, dense around every root of R and Q, and the least value found is refined.
    """
    slope = _difference(R.deriv(), Q, R, Q.deriv())
    ends = np.array([0.0, math.inf])
    at_ends, x = value(ends), np.union1d(_scan(found), _polished(slope))
    y = value(x)
    best, place = refined_minimum(value, x, y, int(np.argmin(y)))
    i = int(np.argmin(at_ends))
    end = float(at_ends[i])
    # near an end the values differ from that of the end by their rounding
    if best < (end - NOISE * abs(end) if math.isfinite(end) else end):
        return best, place
    return end, float(ends[i])


def refined_minimum(
    f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, y: np.ndarray, i: int
) -> tuple[float, float]:
    """A minimum of f, and its place, from the values y at ascending x around the least, y[i].

    The function may be infinite; the search then ends at the border of where it is finite.
    """
    for _ in range(REFINED):
        if math.isinf(y[i]):
            break
        rises = np.flatnonzero(y > y[i] + NOISE * abs(y[i]))  # two places may differ by rounding
        low, high = rises[rises < i].max(initial=0), rises[rises > i].min(initial=len(x) - 1)
        x = np.union1d(np.linspace(x[low], x[high], 41), x[i])
        y = f(x)
        i = int(np.argmin(y))
    return float(y[i]), float(x[i])


def _difference(a: Polynomial, b: Polynomial, c: Polynomial, d: Polynomial) -> Polynomial:
    """a b - c d, without the coefficients that are rounding errors."""
    size = Polynomial(np.abs(a.coef)) * Polynomial(np.abs(b.coef))
    size += Polynomial(np.abs(c.coef)) * Polynomial(np.abs(d.coef))
    out = (a * b - c * d).coef
    n = max(len(out), len(size.coef))
    out, size = (np.pad(x, (0, n - len(x))) for x in (out, size.coef))
    return Polynomial(np.where(np.abs(out) > ROUNDED * size, out, 0.0))


def _polished(p: Polynomial) -> np.ndarray:
    """Positive real roots of a polynomial, after two steps of Newton's method."""
    x = nonzero_roots(p)
    x = x.real[(np.abs(x.imag) <= NEARLY_REAL * np.abs(x)) & (x.real > 0.0)]
    slope = p.deriv()
    with np.errstate(all="ignore"):
        for _ in range(2):
            step = x - p(x) / slope(x)
            x = np.where(np.isfinite(step) & (step > 0.0), step, x)
    return x


def _scan(found: np.ndarray) -> np.ndarray:
    """x > 0, ascending: evenly spaced in the logarithm, and dense where a root is near the axis."""
    size = np.abs(found)
    found, size = (x[(size > 0.0) & np.isfinite(size)] for x in (found, size))
    low, high = size.min(initial=1.0), size.max(initial=1.0)
    decades = math.log10(high / low) + 2.0 * SCAN_BEYOND
    ends = low * 10.0**-SCAN_BEYOND, high * 10.0**SCAN_BEYOND
    even = np.geomspace(*ends, 2 + int(SCAN_DENSITY * decades))
    near = (found.real[:, None] + np.abs(found.imag)[:, None] * SCAN_NEAR).ravel()
    near = np.concatenate((near, size))
    return np.unique(np.concatenate((even, near[(near > ends[0]) & (near < ends[1])])))


def positive_bands(p: Polynomial) -> tuple[tuple[float, float], ...]:
    """Bands of omega [rad/s] in which a polynomial in omega^2 is positive."""
    x = np.concatenate(([0.0], np.sort(positive_roots(p))))
    inside = np.concatenate((0.5 * (x[1:] + x[:-1]), [2.0 * x[-1] + 1.0]))
    edges = np.concatenate((np.sqrt(x), [math.inf]))
    return tuple((float(edges[i]), float(edges[j + 1])) for i, j in runs_of_true(p(inside) > 0.0))


def runs_of_true(mask: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each run of True."""
    padded = np.concatenate(([False], mask, [False]))
    first = np.flatnonzero(padded[1:] & ~padded[:-1])
    last = np.flatnonzero(padded[:-1] & ~padded[1:]) - 1
    return list(zip(first.tolist(), last.tolist(), strict=True))


def bisect(
    holds: Callable[[float], bool], low: float, high: float, rtol: float = 1e-12
) -> tuple[float, float]:
    """Narrow the bracket of a change by bisection."""
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
    """Bracket the first change from true to false along a grid."""
    low = below
    for x in grid:
        if not holds(x):
            return (0.0, x) if low is None else bisect(holds, low, x, rtol)
        low = x
    assert low is not None
    return low, math.inf


def first_failures(
    holds: Callable[[np.ndarray, np.ndarray], np.ndarray],
    count: int,
    grid: np.ndarray,
    rtol: float = 1e-12,
) -> tuple[np.ndarray, np.ndarray]:
    """As `first_failure`, of many properties at once: `holds` is asked for some, a value each."""
    low, high = np.zeros(count), np.full(count, math.inf)
    left = np.arange(count)
    for x in grid:
        good = holds(left, np.full(len(left), x))
        low[left[good]], high[left[~good]] = x, x
        left = left[good]
        if not len(left):
            break
    left = np.flatnonzero((low > 0.0) & (high < math.inf))
    while True:
        a, b = low[left], high[left]
        middle = 0.5 * (a + b)
        between = (b - a > rtol * b) & (middle != a) & (middle != b)
        left, middle = left[between], middle[between]
        if not len(left):
            return low, high
        good = holds(left, middle)
        low[left[good]], high[left[~good]] = middle[good], middle[~good]
