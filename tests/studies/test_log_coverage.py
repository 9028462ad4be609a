"""Intervals hold for logs whose rows are not even: a quick part of benchmarks/log_coverage.py."""

import numpy as np
import pytest

from benchmarks import log_coverage as coverage


@pytest.mark.parametrize("log", ["jitter of 30 %", "even, stamped up to steps later"])
def test_intervals_hold_the_truth(log):
    """24 trials of three coefficients; with a share of 0.95, fewer than 19 of 24 held is a chance
    of 1e-3, and the mean error is within 4 of its deviations."""
    rows = [coverage.one(seed, log)["coefficients"] for seed in range(1000, 1024)]
    for name in coverage.NAMES:
        covered, half, error = (np.array(x) for x in zip(*(r[name] for r in rows), strict=True))
        assert covered.sum() >= 19, name
        assert abs(np.mean(error / half)) < 4.0 * 0.5 / np.sqrt(len(rows)), name
