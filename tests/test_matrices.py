"""Decompositions whose first driver fails: the same numbers by the one behind it."""

import numpy as np
import pytest

from hapticclay import matrices

EPS = 1e-12  # of matrices of size 1 and order 6: k eps, as drivers are backward stable
RANDOM = np.random.default_rng(5)
STACK = RANDOM.normal(size=(3, 6, 6))
TALL = RANDOM.normal(size=(9, 4))


def failing(*args):
    """A driver that does not converge."""
    raise np.linalg.LinAlgError("did not converge")


def behind(drivers):
    """Drivers of which the first fails."""
    return (failing, *drivers[1:])


@pytest.mark.parametrize("a", [STACK, STACK + 1j * STACK[::-1], TALL, TALL.T])
@pytest.mark.parametrize("full", [True, False])
def test_singular_values_and_vectors(a, full):
    u, size, v = matrices.svd(a, full, behind(matrices.SVD))
    k = size.shape[-1]
    np.testing.assert_allclose((u[..., :k] * size[..., None, :]) @ v[..., :k, :], a, atol=EPS)
    want = np.linalg.svd(a, compute_uv=False)
    np.testing.assert_allclose(size, want, atol=EPS)
    np.testing.assert_allclose(matrices.singular_values(a, behind(matrices.VALUES)), want, atol=EPS)
    assert u.shape == np.linalg.svd(a, full_matrices=full)[0].shape


@pytest.mark.parametrize("a", [STACK, STACK[0], STACK + 1j * STACK[::-1], 0.0 * STACK])
def test_eigenvalues_and_eigenvectors(a):
    found = matrices.eigenvalues(a, behind(matrices.EIGENVALUES))
    key = lambda z: np.sort_complex(np.round(z, 9))  # noqa: E731
    np.testing.assert_allclose(key(found), key(np.linalg.eigvals(a)), atol=1e-9)
    values, vectors = matrices.eigenvectors(a, behind(matrices.EIGENVECTORS))
    np.testing.assert_allclose(a @ vectors, vectors * values[..., None, :], atol=EPS)


def test_least_squares_and_inverses():
    b = RANDOM.normal(size=(9, 2))
    found = matrices.least_squares(TALL, b, drivers=behind(matrices.FITS))
    np.testing.assert_allclose(found, np.linalg.lstsq(TALL, b, rcond=None)[0], atol=EPS)
    low = TALL @ np.diag([1.0, 1.0, 1.0, 0.0])  # of rank 3
    fit = matrices.least_squares(low, b, 1e-9, behind(matrices.FITS))
    np.testing.assert_allclose(fit, np.linalg.lstsq(low, b, rcond=1e-9)[0], atol=EPS)
    for drivers in (matrices.SVD, behind(matrices.SVD)):
        inverse = matrices.pseudo_inverse(low, 1e-9, drivers)
        np.testing.assert_allclose(inverse, np.linalg.pinv(low, 1e-9), atol=EPS)


@pytest.mark.parametrize(
    "c", [[2.0, 0.0, -3.0, 1.0], [0.0, 1.0, -3.0, 2.0, 0.0, 0.0], [4.0], [0.0]]
)
def test_roots(c):
    found = matrices.polynomial_roots(c, behind(matrices.ROOTS))
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(np.roots(c)), atol=EPS)


def test_all_that_fail_say_so():
    with pytest.raises(np.linalg.LinAlgError):
        matrices.svd(STACK, drivers=(failing, failing))
