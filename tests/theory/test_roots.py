"""Brackets of a change, against thresholds known in closed form."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.theory.roots import bisect, first_failure


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
