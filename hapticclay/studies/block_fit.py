"""Least squares whose residuals are correlated: intervals from blocks of the record.

The covariance is the sandwich of the sums of the scores over blocks (K.-Y. Liang, S. L. Zeger,
Biometrika 73, 1986, 13-22), which holds whatever correlation there is within a block.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .. import matrices
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
        covariance: of these, (k, k); nan where the data do not fix them.
        slopes: derivatives of the residuals by the numbers, (n, k).
        rest: residuals, (n,).
        level: confidence level of intervals.
    """

    values: np.ndarray
    covariance: np.ndarray
    slopes: np.ndarray
    rest: np.ndarray
    level: float

    @property
    def rms(self) -> float:
        """Deviation of the residuals."""
        return math.sqrt(float(np.mean(self.rest**2)))

    @property
    def half(self) -> np.ndarray:
        """Half widths of the intervals, (k,)."""
        quantile = student_quantile(self.level, BLOCKS - len(self.values))
        return quantile * np.sqrt(np.diag(self.covariance))

    def given(self, slopes: np.ndarray, covariance: np.ndarray) -> BlockFit:
        """The fit where other numbers, taken as given, are not exact.

        Args:
            slopes: derivatives of the residuals by those numbers, (n, m).
            covariance: of those numbers, (m, m).
        """
        moved = matrices.least_squares(self.slopes, -slopes)
        return replace(self, covariance=self.covariance + moved @ covariance @ moved.T)


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

    @functools.lru_cache(maxsize=1)  # slopes begin with the last residuals
    def kept(x: bytes) -> np.ndarray:
        return residuals(np.frombuffer(x) * size)

    def of(x: np.ndarray) -> np.ndarray:
        return kept(x.tobytes()).copy()

    def slopes_at(x: np.ndarray) -> Any:
        return _slopes(of, x, step, high / size)

    found = least_squares(
        of,
        np.clip(start / size, low / size, high / size),
        slopes_at,  # type: ignore[arg-type]
        bounds=(low / size, high / size),
        xtol=1e-3 * step,
        ftol=1e-5 * step,
        x_scale="jac",
        max_nfev=rounds,
    )
    slopes = found.jac / size
    return BlockFit(found.x * size, _covariance(slopes, found.fun), slopes, found.fun, level)


def _slopes(
    residuals: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: float, high: np.ndarray
) -> np.ndarray:
    """Derivatives by differences of a step, or of that share of a number above 1.

    A share of each number, as SciPy takes it, is rounding where a number is at a bound of 0.
    """
    here, columns = residuals(x), []
    for i, way in enumerate(step * np.maximum(np.abs(x), 1.0)):
        moved = x.copy()
        moved[i] += way if x[i] + way <= high[i] else -way
        columns.append((residuals(moved) - here) / (moved[i] - x[i]))
    return np.column_stack(columns)


def _covariance(J: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Covariance of the numbers by the columns of J; nan where these depend on each other."""
    n, k = J.shape
    sizes = np.linalg.norm(J, axis=0)
    if not np.all(sizes > 0.0) or np.linalg.cond(J / sizes) > WORST:
        return np.full((k, k), math.nan)
    A = J / sizes
    inverse = np.linalg.inv(A.T @ A)
    parts = np.array_split(np.arange(n), BLOCKS)
    scores = np.array([A[i].T @ rest[i] for i in parts])
    cov = inverse @ (scores.T @ scores) @ inverse * BLOCKS / (BLOCKS - k)
    return cov / np.outer(sizes, sizes)
