"""Rate at which the oscillation of a free motion grows, from its map or read from its samples.

`growth_of_map` takes the eigenvalues of the map of a period: exact for a linear loop, without
samples.

The modes of a free linear motion are those of a linear prediction of low rank (ESPRIT: Roy,
Kailath, IEEE Trans. ASSP 37, 1989). `growth_rate` reads them from a record. `short_growth` reads
those of many short motions at once, of a few dozen samples each: about 0.2 ms a motion. It fits
twice, with two ranks. Motions remain undecided if the two ranks disagree, if growth or decay is too
small, or if they are not linear.
"""

from __future__ import annotations

import math

import numpy as np

from .. import matrices
from ..errors import choice
from ..model.constants import AXES
from ..scene.scenario import Scenario
from ..simulation.period_map import PeriodMap, PeriodMaps
from ..simulation.record import Record

FITTED_SHARE = 0.7  # share of a run, at its end, from which growth is read
GROWTH_SAMPLE = 4e-3  # [s] between the samples from which growth is read
SINGULAR_SHARE = 1e-7  # singular values below this share of the largest are rounding
MODE_SHARE = 1e-4  # so are modes below this share of the strongest
SLOWEST_MODE = 1.0  # [rad/s, 1/s] slower modes are due to the hand's spring, not an oscillation
FADED = 1e-6  # smaller shares of the first speed are dominated by rounding
MOTION_SAMPLES = 55  # of a motion
RANKS = (1e-5, 1e-7)  # singular values below these shares of the largest are left out
LEAST_RATE = 0.3  # [1/s] slower growth or decay is left undecided
NEUTRAL = 1e-6  # relative decay in a period below which a mode may be a position that just stays
SEEN = 1e-6  # smaller shares of the motion along an axis are those of rounding in a map
AGREEMENT = 0.1  # the two rates may differ by this share of the smaller one
LINEAR_SHARE = 1e-4  # of the largest sample: residual allowed for a linear motion


def growth_rate(
    record: Record, axis: str, sample: float = GROWTH_SAMPLE, slowest: float = SLOWEST_MODE
) -> float:
    """Growth rate of a free motion's least damped mode [1/s]; inf for a run that ended too early.

    `sample` is about the time between samples [s]; modes below `slowest` do not count.
    """
    i, dt = AXES.index(choice("axis", axis, AXES)), record.scenario.dt
    if len(record.t) > 2:  # a record may keep one step in many
        dt *= max(1, round((record.t[1] - record.t[0]) / dt))
    v = record.v[:-1, i]  # the last step may be short
    v = v[int((1.0 - FITTED_SHARE) * len(v)) :]
    # Odd, and two of them: half the sampling frequency must fold onto zero in neither.
    skip = 2 * round(0.5 * sample / dt) + 1
    found = [_least_damped(v[::n], n * dt, slowest) for n in (skip, skip + 2) if len(v) >= 32 * n]
    if not found:
        return math.inf if record.outcome.code != "time limit" else -math.inf
    return max(found)


def growth_of_run(record: Record, sample: float, slowest: float, axis: str = "x") -> float:
    """Growth rate of a run; a mean rate if the run decayed into rounding or grew very large."""
    speed = np.abs(record.v[:, AXES.index(axis)])
    n = len(speed)
    share = math.ceil(0.1 * n)
    change = (speed[-share:].max() + 1e-300) / (speed[:share].max() + 1e-300)
    if n > 2 * share and not FADED < change < 1.0 / FADED:
        return math.log(change) / record.t[-1]
    return growth_rate(record, axis, sample, slowest)


def _least_damped(v: np.ndarray, dt: float, slowest: float) -> float:
    rows = min(len(v) // 2, 700)  # of a long run: all its modes, at a fraction of the cost
    hankel = np.lib.stride_tricks.sliding_window_view(v, rows).T
    u, s, _ = matrices.svd(hankel, full_matrices=False)
    r = max(1, min(int(np.sum(s > SINGULAR_SHARE * s[0])), rows // 3))
    z = matrices.eigenvalues(matrices.least_squares(u[:-1, :r], u[1:, :r]))
    z = z[np.abs(z) > 1e-6]
    weight = np.abs(matrices.least_squares(_motions(z, len(v)), v.astype(complex)))
    rate, strong, swings = _mode_rates(z, weight, dt, slowest)
    return float(rate[swings].max()) if swings.any() else -math.inf


def _motions(z: np.ndarray, samples: int) -> np.ndarray:
    """Samples of modes, along a new axis before that of the modes, each with 1 as its largest."""
    # else one that grows fast would hide the others from a least-squares fit
    k = np.arange(samples)[:, None] - np.where(np.abs(z) > 1.0, samples - 1, 0)[..., None, :]
    return np.exp(k * np.log(z.astype(complex))[..., None, :])


def _mode_rates(
    z: np.ndarray, weight: np.ndarray, dt: float, slowest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Growth rates of modes [1/s]; which exceed rounding; which of these oscillate or diverge."""
    rate, omega = np.log(np.abs(z)) / dt, np.abs(np.angle(z)) / dt
    strong = weight > MODE_SHARE * weight.max(axis=-1, keepdims=True, initial=0.0)
    return rate, strong, strong & ((omega > slowest) | (rate > slowest))


def short_growth(v: np.ndarray, dt: float) -> np.ndarray:
    """Growth rates [1/s] of free motions (motions, samples); NaN where they are undecided."""
    out = np.full(len(v), np.nan)
    size = np.abs(v).max(axis=1, initial=0.0)
    good = np.flatnonzero(np.isfinite(size) & (size > 0.0))
    if not len(good):
        return out
    v = v[good] / size[good, None]
    rows = v.shape[1] // 2
    hankel = np.lib.stride_tricks.sliding_window_view(v, rows, axis=1).transpose(0, 2, 1)
    u, s, _ = matrices.svd(hankel, full_matrices=False)
    (a, residual_a), (b, residual_b) = (
        _least_damped_of_many(v, dt, u, s, share) for share in RANKS
    )
    with np.errstate(invalid="ignore"):
        least = np.minimum(np.abs(a), np.abs(b))
        agree = (np.sign(a) == np.sign(b)) & (np.abs(a - b) < AGREEMENT * least)
        decided = agree & (least > LEAST_RATE) & (np.minimum(residual_a, residual_b) < LINEAR_SHARE)
    out[good[decided]] = b[decided]
    return out


def _least_damped_of_many(
    v: np.ndarray, dt: float, u: np.ndarray, s: np.ndarray, share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Growth rate of each motion [1/s], NaN for none, and the largest residual of its samples."""
    n, rows = v.shape[1], u.shape[1]
    ranks = np.clip((s > share * s[:, :1]).sum(axis=1), 1, rows // 2)
    rate, residual = np.full(len(v), np.nan), np.full(len(v), np.inf)
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
        z = matrices.eigenvalues(F).astype(complex)
        z[np.abs(z) < 1e-6] = 1e-6  # decayed within a sample
        powers = _motions(z, n)
        q, R = np.linalg.qr(powers)
        ok = np.isfinite(R).all(axis=(1, 2)) & (
            np.abs(np.diagonal(R, axis1=1, axis2=2)).min(axis=1) > 1e-14
        )
        j, z, powers, q, R = (x[ok] for x in (j, z, powers, q, R))
        if not len(j):
            continue
        weight = np.linalg.solve(R, q.conj().transpose(0, 2, 1) @ v[j].astype(complex)[..., None])
        residual[j] = np.abs((powers @ weight)[..., 0] - v[j]).max(axis=1)
        growth, strong, swings = _mode_rates(z, np.abs(weight[..., 0]), dt, SLOWEST_MODE)
        # A slowly growing mode aliased onto zero frequency may oscillate: undecided.
        doubtful = (strong & ~swings & (growth > LEAST_RATE)).any(axis=1)
        found = np.where(swings, growth, -np.inf).max(axis=1)
        rate[j] = np.where(doubtful | ~np.isfinite(found), np.nan, found)
    return rate, residual


def growth_of_map(m: PeriodMap, slowest: float = SLOWEST_MODE) -> float:
    """Growth rate after a push [1/s], from the map of a period; NaN for defective modes."""
    rate, swings = _rates(matrices.eigenvalues(m.matrix), m.period, slowest)
    if not (swings & (rate > -NEUTRAL / m.period)).any():
        return float(rate.max(where=swings, initial=-math.inf))
    z, modes = matrices.eigenvectors(m.matrix)
    try:
        share = np.abs((m.seen @ modes) * np.linalg.solve(modes, m.pushed))
    except np.linalg.LinAlgError:
        return math.nan
    rate, swings = _rates(z, m.period, slowest)
    return float(rate.max(where=swings & (share > SEEN * share.max()), initial=-math.inf))


def mapped_growth(s: Scenario, axis: str, maps: PeriodMaps, slowest: float = SLOWEST_MODE) -> float:
    """As `growth_of_map`, for a scene; NaN without a map."""
    m = maps.of(s, AXES.index(axis))
    return math.nan if m is None else growth_of_map(m, slowest)


def _rates(z: np.ndarray, period: float, slowest: float) -> tuple[np.ndarray, np.ndarray]:
    """Growth rates of the modes of a map [1/s], and which of them oscillate or diverge."""
    rate = np.log(np.maximum(np.abs(z), 1e-300)) / period
    return rate, (np.abs(np.angle(z)) / period > slowest) | (rate > slowest)
