"""Brackets of a change, against thresholds known in closed form; exact sums and products."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.theory.exact_roots import Rational, exact, rational, value
from hapticclay.theory.roots import bisect, first_failure, first_failures


@given(st.floats(1e-3, 1e3), st.floats(1e-12, 1e-1))
def test_bisect_brackets_the_threshold_as_closely_as_asked(edge, rtol):
    low, high = bisect(lambda x: x < edge, 1e-4, 1e4, rtol)
    assert low < edge <= high and high - low <= rtol * high


def test_bisect_ends_at_neighbouring_floats():
    low, high = bisect(lambda x: x < math.pi, 3.0, 4.0, rtol=0.0)
    assert high == math.nextafter(low, math.inf) and high == math.pi


def test_first_failure_is_the_first_on_the_grid():
    grid = (1.0, 2.0, 3.0, 4.0, 5.0)

    def holds(x):
        return not 1.5 <= x < 2.5 and x < 4.5

    assert first_failure(holds, grid) == pytest.approx((1.5, 1.5), rel=1e-12)
    assert first_failure(lambda x: True, grid) == (5.0, math.inf)
    assert first_failure(lambda x: False, grid) == (0.0, 1.0)
    assert first_failure(lambda x: x < 0.3, grid, below=0.0) == pytest.approx((0.3, 0.3), rel=1e-12)


def test_many_failures_are_those_of_each_alone():
    """Thresholds on a grid point, below the first one, and beyond the last one."""
    edges, grid = np.array([0.5, 1.0, 1.7, 3.0, 4.999, 9.0]), np.arange(1.0, 6.0)
    low, high = first_failures(lambda i, x: x < edges[i], len(edges), grid, 1e-12)
    for edge, *found in zip(edges.tolist(), low.tolist(), high.tolist(), strict=True):
        assert tuple(found) == first_failure(lambda x, edge=edge: x < edge, grid.tolist())


NUMBERS = st.lists(st.floats(-1e6, 1e6) | st.fractions(max_denominator=99), max_size=5)


@given(NUMBERS, NUMBERS, st.fractions(max_denominator=99))
def test_sums_and_products_are_exact(a, b, x):
    """At a point, by Horner's rule in fractions; zeros of the highest powers fall away."""
    p, q = rational(a), rational(b)
    at_p, at_q = (sum(Fraction(c) * x**i for i, c in enumerate(each)) for each in (a, b))
    assert [value(r, x) for r in (p + q, p - q, p * q, -p)] == [
        at_p + at_q, at_p - at_q, at_p * at_q, -at_p
    ]  # fmt: skip
    assert (p * q).degree() == (p.degree() + q.degree() if any(a) and any(b) else 0)
    again = exact(Rational(p.coef))
    assert again.coef.tolist() == p.coef.tolist()


@given(NUMBERS, st.lists(st.floats(-9.0, 9.0), min_size=1, max_size=4))
def test_a_sum_with_floats_is_one_of_floats(a, b):
    p, q = rational(a), np.polynomial.Polynomial(b)
    for found in (p + q, q + p):
        assert found(0.5) == pytest.approx(float(p(0.5)) + q(0.5), rel=1e-12, abs=1e-6)
