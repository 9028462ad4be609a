"""The matrix exponential beside scipy's, and of a stack as of each."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm

from hapticclay.model import exponential
from hapticclay.model.exponential import matrix_exponential

matrices = st.integers(1, 7).flatmap(
    lambda n: arrays(float, (n, n), elements=st.floats(-1.0, 1.0, allow_subnormal=False))
)


@given(matrices, st.floats(-6.0, 2.0))
def test_exponential_is_scipys(a, size):
    a = 10.0**size * a
    E = expm(a)
    # both are exact to the rounding, which squaring doubles for each doubling of the norm
    digits = 1e-14 * max(1.0, np.abs(a).sum())
    np.testing.assert_allclose(matrix_exponential(a), E, rtol=0.0, atol=digits * np.abs(E).max())


def test_rotation_and_chain_have_their_closed_form():
    for t in (1e-4, 0.01, 0.2, 0.7, 3.0):  # of the orders 3, 5, 7, 7 and above
        turn = matrix_exponential(np.array([[0.0, -t], [t, 0.0]]))
        c, s = np.cos(t), np.sin(t)
        np.testing.assert_allclose(turn, [[c, -s], [s, c]], rtol=0.0, atol=4e-15)
        chain = matrix_exponential(np.array([[0.0, t, 0.0], [0.0, 0.0, t], [0.0, 0.0, 0.0]]))
        np.testing.assert_allclose(chain[0], [1.0, t, 0.5 * t * t], rtol=4e-15)


def test_exponentials_of_a_stack_are_those_of_each_bit_for_bit():
    a = (
        np.random.default_rng(1).normal(size=(300, 5, 5))
        * np.geomspace(1e-5, 3.0, 300)[:, None, None]
    )
    a[::50] = np.eye(5)
    orders = exponential._orders(a, exponential._even_powers(a))
    assert set(orders.tolist()) == {0, 3, 5, 7}
    np.testing.assert_array_equal(matrix_exponential(a), [matrix_exponential(x) for x in a])


@pytest.mark.parametrize("a", [np.zeros((3, 3)), np.diag([1.0, -2.0]), np.array([[0.5]])])
def test_diagonal_matrices_are_exact(a):
    np.testing.assert_array_equal(matrix_exponential(a), np.diag(np.exp(np.diag(a))))
