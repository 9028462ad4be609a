"""Whether an oscillation grows, told from a few samples of many short motions at once.

The modes of a free linear motion are found from a few dozen samples by linear prediction of low
rank (ESPRIT: Roy, Kailath, IEEE Trans. ASSP 37, 1989), as in `boundary.growth_rate`, for all
motions in one stroke: about 0.2 ms a motion. The fit is made twice, of two ranks. Motions for which
the two disagree, that grow or decay by too little, or that are not linear, stay undecided.
"""

from __future__ import annotations

import numpy as np

from .boundary import MODE_SHARE, SLOWEST_MODE

MOTION_SAMPLES = 55  # of a motion
RANKS = (1e-5, 1e-7)  # singular values below these shares of the largest are left out
LEAST_RATE = 0.3  # [1/s] slower growth or decay is left undecided
AGREEMENT = 0.1  # the two rates may differ by this share of the smaller one
LINEAR_SHARE = 1e-4  # of the largest sample: what a linear motion may miss of the samples


def short_growth(v: np.ndarray, dt: float) -> np.ndarray:
    """Growth rates of the oscillations of many free motions: those of their least damped modes.

    Modes slower than `boundary.SLOWEST_MODE` do not count.

    Args:
        v: velocities, evenly sampled, in any unit, shape (motions, samples).
        dt: between two samples [s].

    Returns:
        [1/s], shape (motions,); negative where the oscillation decays, NaN where these samples do
        not tell.
    """
    out = np.full(len(v), np.nan)
    size = np.abs(v).max(axis=1, initial=0.0)
    good = np.flatnonzero(np.isfinite(size) & (size > 0.0))
    if not len(good):
        return out
    v = v[good] / size[good, None]
    rows = v.shape[1] // 2
    hankel = np.lib.stride_tricks.sliding_window_view(v, rows, axis=1).transpose(0, 2, 1)
    u, s, _ = np.linalg.svd(hankel, full_matrices=False)
    (a, miss), (b, less) = (_least_damped_of(v, dt, u, s, share) for share in RANKS)
    with np.errstate(invalid="ignore"):
        least = np.minimum(np.abs(a), np.abs(b))
        agree = (np.sign(a) == np.sign(b)) & (np.abs(a - b) < AGREEMENT * least)
        told = agree & (least > LEAST_RATE) & (np.minimum(miss, less) < LINEAR_SHARE)
    out[good[told]] = b[told]
    return out


def _least_damped_of(
    v: np.ndarray, dt: float, u: np.ndarray, s: np.ndarray, share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Growth rate of each motion [1/s], NaN for none, and the largest sample that it misses."""
    n, rows = v.shape[1], u.shape[1]
    ranks = np.clip((s > share * s[:, :1]).sum(axis=1), 1, rows // 2)
    rate, miss = np.full(len(v), np.nan), np.full(len(v), np.inf)
    for r in np.unique(ranks):
        j = np.flatnonzero(ranks == r)
        U = u[j, :, :r]
        last = U[:, -1]
        F = U[:, :-1].transpose(0, 2, 1) @ U[:, 1:]
        # The columns of U are orthonormal, so the normal matrix without its last row is I - w w'.
        rest = 1.0 - np.einsum("ij,ij->i", last, last)
        with np.errstate(all="ignore"):
            F += last[:, :, None] * (np.einsum("ij,ijk->ik", last, F) / rest[:, None])[:, None]
        sound = np.isfinite(F).all(axis=(1, 2)) & (rest > 1e-12)
        j, F = j[sound], F[sound]
        z = np.linalg.eigvals(F).astype(complex)
        z[np.abs(z) < 1e-6] = 1e-6  # gone within a sample
        growth, omega = np.log(np.abs(z)) / dt, np.abs(np.angle(z)) / dt
        powers = np.exp(np.log(z)[:, None, :] * np.arange(n)[None, :, None])
        q, R = np.linalg.qr(powers)
        ok = np.isfinite(R).all(axis=(1, 2)) & (
            np.abs(np.diagonal(R, axis1=1, axis2=2)).min(axis=1) > 1e-14
        )
        j, z, growth, omega, powers, q, R = (x[ok] for x in (j, z, growth, omega, powers, q, R))
        if not len(j):
            continue
        weight = np.linalg.solve(R, q.conj().transpose(0, 2, 1) @ v[j].astype(complex)[..., None])
        miss[j] = np.abs((powers @ weight)[..., 0] - v[j]).max(axis=1)
        weight = np.abs(weight[..., 0]) * np.maximum(np.abs(z) ** (n - 1), 1.0)
        strong = weight > MODE_SHARE * weight.max(axis=1, keepdims=True)
        swings = strong & ((omega > SLOWEST_MODE) | (growth > SLOWEST_MODE))
        # One that folds onto zero frequency, and grows slowly, may be a swing: undecided.
        doubtful = (strong & ~swings & (growth > LEAST_RATE)).any(axis=1)
        found = np.where(swings, growth, -np.inf).max(axis=1)
        rate[j] = np.where(doubtful | ~np.isfinite(found), np.nan, found)
    return rate, miss
