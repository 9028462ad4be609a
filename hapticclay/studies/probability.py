"""A probability from independent trials, with its confidence interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import named
from ..errors import number

LEVEL = 0.95  # of a confidence interval


# ---- what comes out ------------------------------------------------------------------------------


def clopper_pearson(events: Any, runs: Any, level: float = LEVEL) -> tuple[np.ndarray, np.ndarray]:
    """Exact confidence interval of a probability: coverage is at least the nominal level.

    Clopper, Pearson, Biometrika 26, 1934.
    """
    from scipy.special import betaincinv

    level = number("level", level, 0.0, 1.0)
    k, n = np.asarray(events, dtype=float), np.asarray(runs, dtype=float)
    out = 0.5 * (1.0 - level)
    with np.errstate(invalid="ignore"):
        low = np.where(k > 0.0, betaincinv(np.maximum(k, 1e-9), n - k + 1.0, out), 0.0)
        high = np.where(k < n, betaincinv(k + 1.0, np.maximum(n - k, 1e-9), 1.0 - out), 1.0)
    return low, high


@named
@dataclass(frozen=True)
class Probability:
    """A probability estimated by counting.

    Attributes:
        probability: share of the runs; NaN without runs.
        low: lower end of its confidence interval.
        high: upper end.
        runs: number of runs.
        events: number of runs that were counted.
        level: of confidence.
    """

    probability: float
    low: float
    high: float
    runs: int
    events: int
    level: float = LEVEL

    def __str__(self) -> str:
        share = f"{100.0 * self.probability:.3g} % ({100.0 * self.low:.3g} to"
        return f"{share} {100.0 * self.high:.3g} %, {100.0 * self.level:g} % interval)"
