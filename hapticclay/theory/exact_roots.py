"""Roots of polynomials in exact arithmetic: their sides of the imaginary axis, and real roots.

Floats are rational numbers. With coefficients of type `Fraction`, sums, products and the count of
roots on each side of the axis have no rounding: a pole or zero on the axis, or 1e-12 beside it,
counts as what it is. Only the coefficients that were given are rounded. A root that a change of
their last digits moves onto the axis lies on it `within_rounding`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from .. import matrices

ROUNDING = 2.0**-46  # 64 last digits: products of order 8 of rounded factors
BITS = 160  # of a real root
NEAR = 1e-4  # of their size: closer real roots are separated by their common parabola


class Rational(Polynomial):
    """A polynomial of rational coefficients, kept as integers over one denominator.

    Attributes:
        integers: lowest power first.
        common: the denominator, above 0.
    """

    integers: list[int]
    common: int
    symbol = "x"  # type: ignore[assignment]  # `of` does not call the parent's constructor

    @classmethod
    def of(cls, integers: Sequence[int], common: int = 1) -> Rational:
        """The polynomial of these integers over a denominator."""
        n = len(integers)
        while n > 1 and not integers[n - 1]:
            n -= 1
        made = cls.__new__(cls)
        made.integers, made.common = list(integers[:n]) or [0], common
        return made

    @property
    def coef(self) -> np.ndarray:
        """Coefficients of type `Fraction`, lowest power first."""
        return np.array([Fraction(x, self.common) for x in self.integers], dtype=object)

    @coef.setter
    def coef(self, values: Iterable[Any]) -> None:  # pyright: ignore
        ratios = [Fraction(x).as_integer_ratio() for x in values]
        self.common = math.lcm(*(below for _, below in ratios))
        self.integers = [above * (self.common // below) for above, below in ratios]

    def __neg__(self) -> Rational:
        return self.of([-x for x in self.integers], self.common)

    def __add__(self, other: Any) -> Polynomial:
        if not isinstance(other, Rational):
            return Polynomial(self.coef) + other
        common = math.lcm(self.common, other.common)
        mine, theirs = common // self.common, common // other.common
        both = itertools.zip_longest(self.integers, other.integers, fillvalue=0)
        return self.of([mine * a + theirs * b for a, b in both], common)

    def __sub__(self, other: Any) -> Polynomial:
        return self + -other

    def __mul__(self, other: Any) -> Polynomial:
        if not isinstance(other, Rational):
            return Polynomial(self.coef) * other
        out = [0] * (len(self.integers) + len(other.integers) - 1)
        for i, a in enumerate(self.integers):
            for j, b in enumerate(other.integers):
                out[i + j] += a * b
        return self.of(out, self.common * other.common)


def exact(p: Polynomial) -> Rational:
    """The polynomial with rational coefficients."""
    return p if isinstance(p, Rational) else rational(p.coef.tolist())


def rational(c: Iterable[Any]) -> Rational:
    """The polynomial of these coefficients as rational numbers."""
    ratios = [x.as_integer_ratio() for x in c]
    common = math.lcm(*(below for _, below in ratios))
    return Rational.of([above * (common // below) for above, below in ratios], common)


def value(p: Polynomial, x: Fraction) -> Fraction:
    """p(x) in exact arithmetic, which `Polynomial` leaves where it maps its domain."""
    p = exact(p)
    above, below = x.as_integer_ratio()
    out, power = 0, 1  # of integers: one division at the end
    for c in reversed(p.integers):
        out = out * above + c * power
        power *= below
    return Fraction(out * below, p.common * power)


def derivative(p: Polynomial) -> Rational:
    """p' in exact arithmetic."""
    p = exact(p)
    return Rational.of(_derivative(p.integers), p.common)


def approximate(p: Polynomial) -> Polynomial:
    """The polynomial with coefficients of type float."""
    return Polynomial(p.coef.astype(float))


# ---- sides of the axis ---------------------------------------------------------------------------


def roots_right(p: Polynomial) -> tuple[int, int]:
    """Number of roots right of the imaginary axis, and number on it, without those at zero.

    Along the axis the phase of p turns by a half for each root on its left and by minus a half for
    each on its right. Sturm's chain counts the turns (Gantmacher, The Theory of Matrices, 1959, ch.
    15).
    """
    c = _integers(p)
    c = c[next(i for i, x in enumerate(c) if x) :]
    n = len(c) - 1
    parts = [[0] * (n + 1), [0] * (n + 1)]  # p(j omega) = parts[0] + j parts[1]
    for i, x in enumerate(c):
        parts[i % 2][i] = x if i % 4 < 2 else -x
    chain = _sturm_chain(parts[n % 2], parts[1 - n % 2])
    left_excess = _real_index(chain) if n % 2 else -_real_index(chain)
    on, common = 0, chain[-1]
    while len(common) > 1:  # roots in pairs s, -s: the real ones of the chain lie on the axis
        shared = _sturm_chain(common, _derivative(common))
        on += _real_index(shared)
        common = shared[-1]
    return (n - on - left_excess) // 2, on


def _integers(p: Polynomial) -> list[int]:
    """Coefficients, lowest power first, over a common denominator and without common factors."""
    return _primitive(exact(p).integers)


def _primitive(c: Sequence[int]) -> list[int]:
    """Coefficients without common factors and without zeros of the highest powers."""
    n = len(c)
    while n and not c[n - 1]:
        n -= 1
    divisor = math.gcd(*c[:n]) or 1
    return [x // divisor for x in c[:n]]


def _derivative(c: Sequence[int]) -> list[int]:
    return [i * x for i, x in enumerate(c)][1:]


def _sturm_chain(f: Sequence[int], g: Sequence[int]) -> list[list[int]]:
    """f, g and the remainders with their signs changed; the last is their common divisor."""
    chain, following = [_primitive(f)], _primitive(g)
    while following:
        chain.append(following)
        rest, by = chain[-2], chain[-1]
        while len(rest) >= len(by):
            shift, factor = len(rest) - len(by), rest[-1] if by[-1] > 0 else -rest[-1]
            scaled = [abs(by[-1]) * x for x in rest]
            for i, x in enumerate(by):
                scaled[i + shift] -= factor * x
            rest = _primitive(scaled[:-1])
        following = [-x for x in rest]
    return chain


def _real_index(chain: Sequence[Sequence[int]]) -> int:
    """Changes of sign of the chain at minus infinity less those at infinity."""
    above = [c[-1] > 0 for c in chain]
    below = [(c[-1] > 0) == (len(c) % 2 == 1) for c in chain]
    return sum(x != y for x, y in itertools.pairwise(below)) - sum(
        x != y for x, y in itertools.pairwise(above)
    )


# ---- values on the axis --------------------------------------------------------------------------


def axis_parts(p: Polynomial) -> tuple[Rational, Rational]:
    """p(j omega) = even + j omega odd, both polynomials in omega^2."""
    p = exact(p)
    c = p.integers
    even, odd = ([x if i % 2 == 0 else -x for i, x in enumerate(c[j::2])] for j in (0, 1))
    return Rational.of(even, p.common), Rational.of(odd, p.common)


def within_rounding(p: Polynomial, x: Fraction) -> bool:
    """Whether a change of its coefficients in their last digits makes p zero at omega^2 = x."""
    even, odd = axis_parts(p)
    sizes = (Rational.of([abs(x) for x in part.integers], part.common) for part in (even, odd))
    least, most = (value(e, x) ** 2 + x * value(o, x) ** 2 for e, o in ((even, odd), sizes))
    return least <= Fraction(ROUNDING) ** 2 * most


def axis_roots(p: Polynomial) -> list[tuple[Fraction, int]]:
    """Pairs of roots of p on the imaginary axis within rounding: omega^2, and their side of it."""
    even, odd = axis_parts(p)
    slope_even, slope_odd = axis_parts(derivative(exact(p)))
    found: list[tuple[Fraction, int]] = []
    for x in sorted([*positive_roots(even), *positive_roots(odd)]):
        if within_rounding(p, x) and not (found and x - found[-1][0] <= Fraction(NEAR) * x):
            beside = value(even, x) * value(slope_even, x)  # Re p p'*
            beside += x * value(odd, x) * value(slope_odd, x)
            found.append((x, (beside < 0) - (beside > 0)))
    return found


def count_right(p: Polynomial) -> int:
    """Number of roots right of the imaginary axis, without those on it within rounding."""
    return roots_right(p)[0] - 2 * sum(side > 0 for _, side in axis_roots(p))


def unit_crossings(n: Polynomial, d: Polynomial) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies at which |n/d| = 1 [rad/s], and the phase of n/d ahead of -1, 0 to 2 pi."""
    (ne, no), (de, do) = axis_parts(n), axis_parts(d)
    omega2 = rational([0, 1])
    found = positive_roots(ne * ne + omega2 * no * no - de * de - omega2 * do * do)
    along, ahead = ne * de + omega2 * no * do, no * de - ne * do
    omega = np.array([square_root(x) for x in found])
    lag = [
        math.atan2(w * float(value(ahead, x) / size), float(value(along, x) / size)) + math.pi
        for x, w in zip(found, omega.tolist(), strict=True)
        for size in [max(abs(value(along, x)), abs(value(ahead, x))) or 1]
    ]
    return omega, np.array(lag)


# ---- real roots ----------------------------------------------------------------------------------


def positive_roots(p: Polynomial) -> list[Fraction]:
    """Positive real roots of p to `BITS` bits, ascending, each once."""
    f, found = Rational.of(_trimmed(p)), set()
    for group in _groups(_rough_roots(f)):
        found.update(_separated(f, group))
    return sorted(found)


def _rough_roots(p: Rational) -> list[Fraction]:
    """Real positive roots in floats; imaginary parts up to 1e-6 count as rounding."""
    y, scale = _scaled_roots(p)
    y = y[(np.abs(y.imag) <= 1e-6 * np.abs(y)) & (y.real > 0.0)].real
    return sorted(Fraction(x) * scale for x in y.tolist())


def _scaled_roots(p: Polynomial) -> tuple[np.ndarray, Fraction]:
    """Roots other than zero in floats, in the unit that balances the first and last coefficient."""
    c = _trimmed(p)
    if len(c) < 2:
        return np.empty(0), Fraction(1)
    last = len(c) - 1
    bits = round((c[0].bit_length() - c[-1].bit_length()) / last)
    shifts = (bits * i if bits > 0 else -bits * (last - i) for i in range(last + 1))
    scaled = [x << shift for x, shift in zip(c, shifts, strict=True)]
    most = max(map(abs, scaled))
    return matrices.polynomial_roots([x / most for x in scaled[::-1]]), Fraction(2) ** bits


def _trimmed(p: Polynomial) -> list[int]:
    """Coefficients over a common denominator, without the zeros at both ends."""
    c = exact(p).integers
    kept = [i for i, x in enumerate(c) if x]
    return c[kept[0] : kept[-1] + 1] if kept else []


def approximate_roots(p: Polynomial) -> np.ndarray:
    """Roots other than zero in floats, of coefficients of any size."""
    z, scale = _scaled_roots(p)
    return z * float(scale)


def root_sizes(p: Polynomial) -> tuple[float, float]:
    """Sizes of the smallest and the largest root other than zero, within a factor of their number.

    Fujiwara's bounds, which no rounding of roots loses.
    """
    c = _trimmed(p)
    ratios = (Fraction(abs(x), exact(p).common).as_integer_ratio() for x in c)
    logs = [math.log(x) - math.log(below) if x else -math.inf for x, below in ratios]
    last = len(c) - 1
    small = min((logs[0] - x) / i for i, x in enumerate(logs) if i)
    large = max((x - logs[-1]) / (last - i) for i, x in enumerate(logs[:-1]))
    return math.exp(small), math.exp(large)


def _groups(x: Sequence[Fraction]) -> list[list[Fraction]]:
    """Ascending numbers in groups of neighbours."""
    out: list[list[Fraction]] = []
    for value in x:
        if out and value - out[-1][-1] <= Fraction(NEAR) * value:
            out[-1].append(value)
        else:
            out.append([value])
    return out


def _separated(f: Rational, group: Sequence[Fraction]) -> list[Fraction]:
    """The roots of f from approximate ones, which lie close together."""
    if len(group) == 2:
        middle = _shortened((group[0] + group[1]) / 2)
        g = derivative(f)
        at, slope, bend = (value(p, middle) for p in (f, g, derivative(g)))
        if not bend:
            return [middle]
        square = (slope / bend) ** 2 - 2 * at / bend  # of the distance from the parabola's axis
        if square < 0:  # a pair of complex roots, or a double root but for rounding
            return [middle] if -square <= (Fraction(1e-9) * middle) ** 2 else []
        apart = _square_root(square)
        group = [_shortened(middle - slope / bend + side * apart) for side in (-1, 1)]
    return [_polished(f, x) for x in group] if len(group) < 3 else list(group)


def _polished(f: Rational, x: Fraction) -> Fraction:
    """The root of f near x, by Newton's method; x where that leaves its neighbourhood."""
    slope, start = derivative(f), x
    for _ in range(8):
        down = value(slope, x)
        if not down:
            return x
        step = value(f, x) / down
        if abs(x - step - start) > Fraction(NEAR) * start:
            return start
        x = _shortened(x - step)
        if abs(step) * 2 ** (BITS // 2 + 8) <= x:  # the next step is below the last bit
            return x
    return x


def _shortened(x: Fraction) -> Fraction:
    """The number with `BITS` bits."""
    size = x.numerator.bit_length() - x.denominator.bit_length()
    unit = Fraction(2) ** (size - BITS)
    return round(x / unit) * unit


def _square_root(x: Fraction) -> Fraction:
    size = (x.denominator.bit_length() - x.numerator.bit_length()) // 2
    digits = max(BITS + size, 0)
    return Fraction(math.isqrt((x.numerator << 2 * digits) // x.denominator), 2**digits)


def square_root(x: Fraction) -> float:
    """The square root of a rational number, to the last digit of a float."""
    return float(_square_root(x))
