"""The matrix exponential, without the threads of BLAS."""

from __future__ import annotations

import math

import numpy as np

# of each order: numerator, from the lowest power; and the largest norm that it is exact for
PADE = {
    3: ((120.0, 60.0, 12.0, 1.0), 1.495585217958292e-2),
    5: ((30240.0, 15120.0, 3360.0, 420.0, 30.0, 1.0), 2.539398330063230e-1),
    7: (
        (17297280.0, 8648640.0, 1995840.0, 277200.0, 25200.0, 1512.0, 56.0, 1.0),
        9.504178996162932e-1,
    ),
}


def matrix_exponential(a: np.ndarray) -> np.ndarray:
    """Matrix exponential, by Pade approximants, as scipy.linalg.expm.

    Al-Mohy, Higham, A new scaling and squaring algorithm for the matrix exponential, SIAM J. Matrix
    Anal. Appl. 31(3), 2009. expm wakes the threads of BLAS for each matrix, however small, which
    takes milliseconds on busy cores. Here small norms need none; expm takes matrices of large norm,
    above order 7 or scaled, and diagonal ones.

    Args:
        a: shape (n, n), or a stack of such, shape (m, n, n).

    Returns:
        As a.
    """
    from scipy.linalg import expm

    stack = np.asarray(a, float).reshape(-1, *a.shape[-2:])
    powers = _even_powers(stack)
    out, orders = np.empty_like(stack), _orders(stack, powers)
    for order in np.unique(orders).tolist():
        at = orders == order
        some = stack[at]
        out[at] = _approximant(some, order, [x[at] for x in powers]) if order else expm(some)
    return out.reshape(a.shape)


def _even_powers(a: np.ndarray) -> list[np.ndarray]:
    """a^2, a^4 and a^6."""
    second = a @ a
    fourth = second @ second
    return [second, fourth, fourth @ second]


def _norms(a: np.ndarray) -> np.ndarray:
    return np.abs(a).sum(axis=1).max(axis=1)


def _orders(a: np.ndarray, powers: list[np.ndarray]) -> np.ndarray:
    """The order that each matrix needs; 0 for one that is left to expm."""
    _, fourth, sixth = powers
    sixth_root = _norms(sixth) ** (1.0 / 6.0)
    low = np.maximum(_norms(fourth) ** 0.25, sixth_root)
    high = np.maximum(_norms(fourth @ fourth) ** 0.125, sixth_root)
    size, orders = np.abs(a), np.zeros(len(a), int)
    diagonal = ~np.any(a * (1.0 - np.eye(a.shape[-1])), axis=(1, 2))
    whole, spun, spins = _norms(a), size, 1
    for order, (_, largest) in PADE.items():
        for _ in range(2 * order + 1 - spins):
            spun = spun @ size
        spins = 2 * order + 1
        # the first term that the approximant leaves out is below the rounding
        least = 2.0**-53 * math.comb(2 * order, order) * math.factorial(spins)
        enough = ((high if order == 7 else low) < largest) & (_norms(spun) <= least * whole)
        orders[enough & (orders == 0) & ~diagonal] = order
    return orders


def _approximant(a: np.ndarray, order: int, powers: list[np.ndarray]) -> np.ndarray:
    """The approximant (V - U)^-1 (V + U) of each matrix, U odd and V even in it."""
    from scipy.linalg.blas import dtrsm
    from scipy.linalg.lapack import dgetrf

    b, one, n = PADE[order][0], np.eye(a.shape[-1]), order // 2
    even, odd = b[2 * n] * powers[n - 1], powers[n - 1]
    for k in range(n - 1, 0, -1):
        even, odd = even + b[2 * k] * powers[k - 1], odd + b[2 * k + 1] * powers[k - 1]
    U = a @ odd + b[1] * a if order == 3 else a @ (odd + b[1] * one)
    V, out = even + b[0] * one, np.empty_like(a)
    for i, (u, v) in enumerate(zip(U, V, strict=True)):
        # dgetrs and dlaswp, which would solve and swap, wake the threads
        lu, pivots, _ = dgetrf((v - u).T)
        x = dtrsm(1.0, lu, dtrsm(1.0, lu, u, trans_a=1), trans_a=1, lower=1, diag=1)
        for row, other in reversed(list(enumerate(pivots.tolist()))):
            if other != row:
                x[[row, other]] = x[[other, row]]
        out[i] = 2.0 * x + one
    return out
