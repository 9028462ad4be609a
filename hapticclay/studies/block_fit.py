"""Least squares whose residuals are correlated: intervals from blocks of the record.

The covariance is the sandwich of the sums of the scores over blocks (K.-Y. Liang, S. L. Zeger,
Biometrika 73, 1986, 13-22), which holds whatever correlation there is within a block.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .flow_models import student_quantile

BLOCKS = 20  # of a record
WORST = 1e7  # condition of scaled columns beyond which no interval is told


class Unknown(NamedTuple):
    """A number to be fitted: where to begin, its bounds, and its size."""

    start: float
    low: float
    high: float
    size: float


@dataclass(frozen=True, eq=False)
class BlockFit:
    """A fit of least squares.

    Attributes:
        values: fitted numbers, (k,).
        half: half widths of their intervals, (k,); nan for a number that the data do not fix.
        rest: residuals, (n,).
    """

    values: np.ndarray
    half: np.ndarray
    rest: np.ndarray

    @property
    def rms(self) -> float:
        """Deviation of the residuals."""
        return math.sqrt(float(np.mean(self.rest**2)))


def block_fit(
    residuals: Callable[[np.ndarray], np.ndarray],
    unknowns: Sequence[Unknown],
    level: float,
    step: float = 1e-6,
    rounds: int = 60,
) -> BlockFit:
    """Fits numbers within their bounds; step is that of differences, as a share of a size."""
    from scipy.optimize import least_squares

    start, low, high, size = (np.array(x) for x in zip(*unknowns, strict=True))
    found = least_squares(
        lambda x: residuals(x * size),
        np.clip(start / size, low / size, high / size),
        bounds=(low / size, high / size),
        diff_step=step,
        xtol=1e-3 * step,
        ftol=1e-5 * step,
        x_scale="jac",
        max_nfev=rounds,
    )
    half = _half_widths(found.jac, found.fun, level)
    return BlockFit(found.x * size, half * size, found.fun)


def _half_widths(J: np.ndarray, rest: np.ndarray, level: float) -> np.ndarray:
    """Half widths of intervals, in the units of the columns of J; nan where these depend."""
    n, k = J.shape
    sizes = np.linalg.norm(J, axis=0)
    if not np.all(sizes > 0.0) or np.linalg.cond(J / sizes) > WORST:
        return np.full(k, math.nan)
    A = J / sizes
    inverse = np.linalg.inv(A.T @ A)
    parts = np.array_split(np.arange(n), BLOCKS)
    scores = np.array([A[i].T @ rest[i] for i in parts])
    cov = inverse @ (scores.T @ scores) @ inverse * BLOCKS / (BLOCKS - k)
    return student_quantile(level, BLOCKS - k) * np.sqrt(np.diag(cov)) / sizes
