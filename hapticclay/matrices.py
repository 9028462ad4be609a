"""Decompositions of small matrices by LAPACK, by another driver where the first does not converge.

Each function takes its drivers in the order in which they are tried. All work on stacks of
matrices, shape (..., m, n), as those of NumPy do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .threads import one_thread

ASIDE = 0.6 + 0.8j  # a shift by this, times the size of a matrix, takes its eigenvalues elsewhere

# ---- drivers -------------------------------------------------------------------------------------


def _svd_by_iteration(a: np.ndarray, full_matrices: bool) -> tuple[np.ndarray, ...]:
    """By QR iteration (gesvd), where NumPy divides and conquers (gesdd)."""
    from scipy.linalg import svd

    found = [svd(x, full_matrices, lapack_driver="gesvd") for x in _stack(a)]
    parts = (np.array(x) for x in zip(*found, strict=True))
    return tuple(x.reshape(a.shape[:-2] + x.shape[1:]) for x in parts)


def _values_by_division(a: np.ndarray) -> np.ndarray:
    return np.linalg.svd(a, compute_uv=False)


def _values_by_iteration(a: np.ndarray) -> np.ndarray:
    return _svd_by_iteration(a, False)[1]


def _aside(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A matrix shifted into the complex plane, where other rotations lead to its eigenvalues."""
    shift = ASIDE * np.abs(a).max(axis=(-2, -1))[..., None]
    return a + shift[..., None] * np.eye(a.shape[-1]), shift


def _eigenvalues_aside(a: np.ndarray) -> np.ndarray:
    moved, shift = _aside(a)
    return np.linalg.eigvals(moved) - shift


def _eigenvectors_aside(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    moved, shift = _aside(a)
    values, vectors = np.linalg.eig(moved)
    return values - shift, vectors


def _fit_by_division(a: np.ndarray, b: np.ndarray, rcond: float | None) -> np.ndarray:
    return np.linalg.lstsq(a, b, rcond=rcond)[0]


def _fit_by_iteration(a: np.ndarray, b: np.ndarray, rcond: float | None) -> np.ndarray:
    from scipy.linalg import lstsq

    least = np.finfo(float).eps * max(a.shape) if rcond is None else rcond
    return np.asarray(lstsq(a, b, cond=least, lapack_driver="gelss")[0])  # type: ignore[index]


def _roots_of_companion(coefficients: Sequence[float] | np.ndarray) -> np.ndarray:
    from scipy.linalg import companion

    c = np.trim_zeros(np.asarray(coefficients), "f")
    kept = np.trim_zeros(c, "b")
    found = eigenvalues(companion(kept)) if len(kept) > 1 else np.empty(0)
    return np.concatenate([found, np.zeros(len(c) - len(kept))])


def _stack(a: np.ndarray) -> np.ndarray:
    return a.reshape(-1, *a.shape[-2:])


Drivers = Sequence[Callable[..., Any]]
SVD: Drivers = (np.linalg.svd, _svd_by_iteration)
VALUES: Drivers = (_values_by_division, _values_by_iteration)
EIGENVALUES: Drivers = (np.linalg.eigvals, _eigenvalues_aside)
EIGENVECTORS: Drivers = (np.linalg.eig, _eigenvectors_aside)
FITS: Drivers = (_fit_by_division, _fit_by_iteration)
ROOTS: Drivers = (np.roots, _roots_of_companion)


# ---- decompositions ------------------------------------------------------------------------------


def svd(
    a: np.ndarray, full_matrices: bool = True, drivers: Drivers = SVD
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """U, singular values in descending order, and V' of a matrix."""
    return _first(drivers, a, full_matrices)


def singular_values(a: np.ndarray, drivers: Drivers = VALUES) -> np.ndarray:
    """Singular values in descending order, shape (..., k)."""
    return _first(drivers, a)


def eigenvalues(a: np.ndarray, drivers: Drivers = EIGENVALUES) -> np.ndarray:
    """Eigenvalues in no order, shape (..., n)."""
    return _first(drivers, a)


def eigenvectors(a: np.ndarray, drivers: Drivers = EIGENVECTORS) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues, and eigenvectors as columns."""
    return _first(drivers, a)


def least_squares(
    a: np.ndarray, b: np.ndarray, rcond: float | None = None, drivers: Drivers = FITS
) -> np.ndarray:
    """The least x with the least |a x - b|, of one matrix."""
    return _first(drivers, a, b, rcond)


def pseudo_inverse(a: np.ndarray, rcond: float, drivers: Drivers = SVD) -> np.ndarray:
    """The Moore-Penrose inverse without singular values up to a share of the largest."""
    u, size, v = svd(a, False, drivers)
    least = rcond * size[..., :1]
    inverse = np.where(size > least, 1.0 / np.where(size > least, size, 1.0), 0.0)
    return np.swapaxes(v.conj(), -1, -2) @ (inverse[..., None] * np.swapaxes(u.conj(), -1, -2))


def polynomial_roots(
    coefficients: Sequence[float] | np.ndarray, drivers: Drivers = ROOTS
) -> np.ndarray:
    """Roots of a polynomial, highest power first, as `numpy.roots`."""
    return _first(drivers, coefficients)


def _first(drivers: Drivers, *args: Any) -> Any:
    """What the first driver that converges returns."""
    for driver in drivers[:-1]:
        try:
            return driver(*args)
        except np.linalg.LinAlgError:
            continue
    return drivers[-1](*args)


def exponential(a: np.ndarray) -> np.ndarray:
    """The exponential of a matrix: the first one brings SciPy's BLAS, on one thread, too."""
    from scipy.linalg import expm

    with one_thread:
        return expm(a)
