"""Roots of polynomials in exact arithmetic: their sides of the imaginary axis, and real roots.

Floats are rational numbers. With coefficients of type `Fraction`, sums, products and the count of
roots on each side of the axis have no rounding: a pole or zero on the axis, or 1e-12 beside it,
counts as what it is. Only the coefficients that were given are rounded. A root that a change of
their last digits moves onto the axis lies on it `within_rounding`.

A `Polynomial` of rational numbers is slow. Searches take out the common denominator and go on with
`Integers`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

ROUNDING = 2.0**-46  # 64 last digits: products of order 8 of rounded factors
BITS = 160  # of a real root
NEAR = 1e-4  # of their size: closer real roots are separated by their common parabola

Integers = list[int]  # coefficients of a polynomial, lowest power first


def exact(p: Polynomial) -> Polynomial:
    """The polynomial with rational coefficients."""
    return rational(p.coef.tolist())


def rational(c: Iterable[Any]) -> Polynomial:
    """The polynomial of these coefficients as rational numbers."""
    return Polynomial(np.array([Fraction(x) for x in c] or [Fraction(0)], dtype=object))


def value(p: Polynomial, x: Fraction) -> Fraction:
    """p(x) in exact arithmetic, which `Polynomial` leaves where it maps its domain."""
    c, common = over_denominator(p)
    return at(c, x) / common


def approximate(p: Polynomial) -> Polynomial:
    """The polynomial with coefficients of type float."""
    return Polynomial(p.coef.astype(float))


# ---- polynomials with integer coefficients -------------------------------------------------------


def over_denominator(p: Polynomial) -> tuple[Integers, int]:
    """Coefficients over their common denominator, without zeros of the highest powers."""
    c = [Fraction(x).as_integer_ratio() for x in p.coef.tolist()]
    while c and not c[-1][0]:
        c.pop()
    common = math.lcm(*(x[1] for x in c))
    return [x[0] * (common // x[1]) for x in c], common


def at(c: Sequence[int], x: Fraction) -> Fraction:
    """Value at x."""
    out, power = 0, 1  # one division at the end
    for i in reversed(c):
        out = out * x.numerator + i * power
        power *= x.denominator
    return Fraction(out * x.denominator, power)


def product(a: Sequence[int], b: Sequence[int]) -> Integers:
    """a b."""
    out = [0] * (len(a) + len(b) - 1) if a and b else []
    for i, x in enumerate(a):
        for j, y in enumerate(b, i):
            out[j] += x * y
    return out


def combined(m: int, a: Sequence[int], n: int, b: Sequence[int]) -> Integers:
    """m a + n b."""
    return [m * x + n * y for x, y in itertools.zip_longest(a, b, fillvalue=0)]


def lowest(c: Sequence[int]) -> int:
    """The lowest power whose coefficient is not zero; 0 if there is none."""
    return next((i for i, x in enumerate(c) if x), 0)


def derivative(c: Sequence[int]) -> Integers:
    """The derivative."""
    return [i * x for i, x in enumerate(c)][1:]


def alternating(c: Sequence[int]) -> tuple[Integers, Integers]:
    """The value at j omega is even + j omega odd, both polynomials in omega^2."""
    even, odd = ([x if i % 2 == 0 else -x for i, x in enumerate(c[j::2])] for j in (0, 1))
    return even, odd


# ---- sides of the axis ---------------------------------------------------------------------------


def roots_right(p: Polynomial) -> tuple[int, int]:
    """Number of roots right of the imaginary axis, and number on it, without those at zero.

    Along the axis the phase of p turns by a half for each root on its left and by minus a half for
    each on its right. Sturm's chain counts the turns (Gantmacher, The Theory of Matrices, 1959, ch.
    15).
    """
    return sides(over_denominator(p)[0])


def sides(c: Sequence[int]) -> tuple[int, int]:
    """As `roots_right`, of a polynomial with these coefficients."""
    c = _without_zeros(c)
    n = len(c) - 1
    parts = [[0] * (n + 1), [0] * (n + 1)]  # p(j omega) = parts[0] + j parts[1]
    for i, x in enumerate(c):
        parts[i % 2][i] = x if i % 4 < 2 else -x
    chain = _sturm_chain(parts[n % 2], parts[1 - n % 2])
    left_excess = _real_index(chain) if n % 2 else -_real_index(chain)
    on, common = 0, chain[-1]
    while len(common) > 1:  # roots in pairs s, -s: the real ones of the chain lie on the axis
        shared = _sturm_chain(common, derivative(common))
        on += _real_index(shared)
        common = shared[-1]
    return (n - on - left_excess) // 2, on


def _primitive(c: Sequence[int]) -> Integers:
    """Coefficients without common factors and without zeros of the highest powers."""
    n = len(c)
    while n and not c[n - 1]:
        n -= 1
    divisor = math.gcd(*c[:n]) or 1
    return [x // divisor for x in c[:n]]


def _sturm_chain(f: Sequence[int], g: Sequence[int]) -> list[Integers]:
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


def axis_parts(p: Polynomial) -> tuple[Polynomial, Polynomial]:
    """p(j omega) = even + j omega odd, both polynomials in omega^2."""
    c = exact(p).coef
    even, odd = ([x if i % 2 == 0 else -x for i, x in enumerate(c[j::2])] for j in (0, 1))
    return rational(even), rational(odd)


def within_rounding(c: Sequence[int], x: Fraction) -> bool:
    """Whether a change of coefficients in their last digits makes c zero at omega^2 = x."""
    even, odd = alternating(c)
    sizes = ([abs(i) for i in part] for part in (even, odd))
    least, most = (at(e, x) ** 2 + x * at(o, x) ** 2 for e, o in ((even, odd), sizes))
    return least <= Fraction(ROUNDING) ** 2 * most


def axis_roots(p: Polynomial) -> list[tuple[Fraction, int]]:
    """Pairs of roots of p on the imaginary axis within rounding: omega^2, and their side of it."""
    c, _ = over_denominator(p)
    (even, odd), (slope_even, slope_odd) = alternating(c), alternating(derivative(c))
    found: list[tuple[Fraction, int]] = []
    for x in sorted([*positive_zeros(even), *positive_zeros(odd)]):
        if within_rounding(c, x) and not (found and x - found[-1][0] <= Fraction(NEAR) * x):
            beside = at(even, x) * at(slope_even, x)  # Re p p'*
            beside += x * at(odd, x) * at(slope_odd, x)
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
    return positive_zeros(over_denominator(p)[0])


def positive_zeros(c: Sequence[int]) -> list[Fraction]:
    """As `positive_roots`, of a polynomial with these coefficients."""
    f, found = _without_zeros(c), set()
    for group in _groups(_rough_roots(f)):
        found.update(_separated(f, group))
    return sorted(found)


def _without_zeros(c: Sequence[int]) -> Integers:
    """Coefficients without common factors and without the zeros at both ends."""
    c = _primitive(c)
    return c[lowest(c) :]


def _rough_roots(c: Sequence[int]) -> list[Fraction]:
    """Real positive roots in floats; imaginary parts up to 1e-6 count as rounding."""
    y, scale = _scaled_roots(c)
    y = y[(np.abs(y.imag) <= 1e-6 * np.abs(y)) & (y.real > 0.0)].real
    return sorted(Fraction(x) * scale for x in y.tolist())


def _scaled_roots(c: Sequence[int]) -> tuple[np.ndarray, Fraction]:
    """Roots in floats, in the unit that balances the first and last coefficient, neither zero."""
    last = len(c) - 1
    if last < 1:
        return np.empty(0), Fraction(1)
    power = round((c[0].bit_length() - c[-1].bit_length()) / last)
    scaled = [x << power * (i if power > 0 else i - last) for i, x in enumerate(c)]
    most = max(map(abs, scaled))
    return np.roots([x / most for x in scaled[::-1]]), Fraction(2) ** power


def approximate_roots(p: Polynomial) -> np.ndarray:
    """Roots other than zero in floats, of coefficients of any size."""
    z, scale = _scaled_roots(_without_zeros(over_denominator(p)[0]))
    return z * float(scale)


def root_sizes(p: Polynomial) -> tuple[float, float]:
    """Sizes of the smallest and the largest root other than zero, within a factor of their number.

    Fujiwara's bounds, which no rounding of roots loses.
    """
    c = _without_zeros(over_denominator(p)[0])
    logs = [math.log(abs(x)) if x else -math.inf for x in c]
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


def _separated(f: Integers, group: Sequence[Fraction]) -> list[Fraction]:
    """The roots of f from approximate ones, which lie close together."""
    if len(group) == 2:
        middle = _shortened((group[0] + group[1]) / 2)
        g = derivative(f)
        here, slope, bend = (at(p, middle) for p in (f, g, derivative(g)))
        if not bend:
            return [middle]
        square = (slope / bend) ** 2 - 2 * here / bend  # of the distance from the parabola's axis
        if square < 0:  # a pair of complex roots, or a double root but for rounding
            return [middle] if -square <= (Fraction(1e-9) * middle) ** 2 else []
        apart = _square_root(square)
        group = [_shortened(middle - slope / bend + side * apart) for side in (-1, 1)]
    return [_polished(f, x) for x in group] if len(group) < 3 else list(group)


def _polished(f: Integers, x: Fraction) -> Fraction:
    """The root of f near x, by Newton's method; x where that leaves its neighbourhood."""
    slope, start = derivative(f), x
    for _ in range(8):
        down = at(slope, x)
        if not down:
            return x
        step = at(f, x) / down
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
