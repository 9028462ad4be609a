"""Gains at which an eigenvalue of a joint loop lies on the unit circle, exact to rounding.

Further torque -u A x of a response x = T tau puts an eigenvalue on z of the circle where -1/u is an
eigenvalue of A T(z). So candidates are where an eigenvalue of A T turns real: its imaginary part
changes sign between two angles of a grid and is refined there. At z = -1 all is real.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .. import matrices

ROUNDS = 60  # of the refinement
EXACT = 1e-14  # imaginary part over size of an eigenvalue that counts as real
REAL = 1e-7  # the same where refinement ended
NO_SIZE = 1e-300  # of an eigenvalue of a response that is 0, as where nothing is held

Response = Callable[[np.ndarray], np.ndarray]  # angles (m,) -> matrices (m, k, k)
Sign = Callable[[np.ndarray], np.ndarray]  # eigenvalues -> real numbers whose zeros are sought


class Crossing(NamedTuple):
    """A change u of a gain that puts an eigenvalue on the circle, at an angle theta [rad]."""

    change: float
    theta: float


def crossings(response: Response, angles: np.ndarray) -> list[Crossing]:
    """All changes of a gain whose A T is the response, between the least angle and pi, sorted."""
    theta, x = zeros(response, angles, np.imag)
    x_pi = matrices.eigenvalues(response(np.array([math.pi])))[0]
    theta, x = np.concatenate([theta, np.full(len(x_pi), math.pi)]), np.concatenate([x, x_pi])
    good = (np.abs(x.imag) <= REAL * np.abs(x)) & (x.real != 0.0)
    found = zip((-1.0 / x.real[good]).tolist(), theta[good].tolist(), strict=True)
    return sorted(Crossing(*each) for each in found)


def zeros(response: Response, angles: np.ndarray, sign: Sign) -> tuple[np.ndarray, np.ndarray]:
    """Angles at which a number of an eigenvalue of a response changes sign, and the eigenvalue."""
    values = branches(matrices.eigenvalues(response(angles)))
    below = sign(values) < 0.0  # a zero on the grid counts once
    i, branch = np.nonzero(below[:-1] != below[1:])
    ends = angles[i], angles[i + 1]
    return refined(response, sign, ends, (values[i, branch], values[i + 1, branch]))


def log_size(values: np.ndarray) -> np.ndarray:
    """Logarithm of the sizes of eigenvalues, 0 on the unit circle; finite for those that are 0."""
    return np.log(np.maximum(np.abs(values), NO_SIZE))


def branches(values: np.ndarray) -> np.ndarray:
    """Eigenvalues in an order in which each follows from the one before, shape (m, k).

    Those of two angles are paired so that the sum of their distances is least, as it is where the
    nearest to each is another one.
    """
    m, k = values.shape
    if k == 1:
        return values
    gaps = np.abs(values[:-1, :, None] - values[1:, None, :])
    following = gaps.argmin(axis=2)
    clash = (np.sort(following, axis=1) != np.arange(k)).any(axis=1)
    if clash.any():
        from scipy.optimize import linear_sum_assignment

        for i in np.flatnonzero(clash):
            following[i] = linear_sum_assignment(gaps[i])[1]
    order = np.empty((m, k), int)
    order[0] = np.arange(k)
    for i in range(m - 1):
        order[i + 1] = following[i, order[i]]
    return np.take_along_axis(values, order, axis=1)


def refined(
    response: Response,
    sign: Sign,
    ends: tuple[np.ndarray, np.ndarray],
    values: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Zeros between ends, and the eigenvalue there: the Illinois method."""
    (low, high), (a, b) = (x.copy() for x in ends), (x.copy() for x in values)
    weight_a, weight_b = np.ones(len(low)), np.ones(len(low))
    theta, x = low.copy(), a.copy()
    open_, moved = np.arange(len(low)), np.zeros(len(low), int)
    for _ in range(ROUNDS):
        if not len(open_):
            break
        fa, fb = weight_a[open_] * sign(a[open_]), weight_b[open_] * sign(b[open_])
        between = (low[open_] * fb - high[open_] * fa) / (fb - fa)
        theta[open_] = np.clip(between, low[open_], high[open_])
        x[open_] = _nearest(matrices.eigenvalues(response(theta[open_])), a[open_], b[open_])
        found = sign(x[open_])
        same = np.sign(found) == np.sign(sign(a[open_]))
        left, right = open_[same], open_[~same]
        low[left], a[left], weight_a[left] = theta[left], x[left], 1.0
        high[right], b[right], weight_b[right] = theta[right], x[right], 1.0
        weight_b[left] *= np.where(moved[left] > 0, 0.5, 1.0)  # an end that stays twice counts half
        weight_a[right] *= np.where(moved[right] < 0, 0.5, 1.0)
        moved[left], moved[right] = 1, -1
        done = np.abs(found) <= EXACT * np.abs(x[open_])
        open_ = open_[~done & (high[open_] - low[open_] > 1e-15 * high[open_])]
    return theta, x


def _nearest(values: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of the eigenvalues at each angle, that nearest to the branch's two known ones."""
    gap = np.abs(values - a[:, None]) + np.abs(values - b[:, None])
    return values[np.arange(len(values)), gap.argmin(axis=1)]
