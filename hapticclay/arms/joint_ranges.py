"""Ranges of an arm's joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

AT_END = (
    1e-6  # [rad or m] rounding of a pose or range in a file: as far beyond, a joint is at its end
)


def widened(ranges: np.ndarray) -> np.ndarray:
    """Ranges within which a joint is, rounding included, shape (n, 2)."""
    return ranges + np.array([-AT_END, AT_END])


def outside(q: np.ndarray, ranges: np.ndarray) -> list[int]:
    """Joints that are beyond their ranges."""
    low, high = widened(ranges).T
    return np.flatnonzero((q < low) | (q > high)).tolist()


def outside_words(q: np.ndarray, ranges: np.ndarray, names: Sequence[str]) -> str:
    """These joints in words; "" for none."""
    return ", ".join(
        f"{names[i]} ({q[i] + 0.0:.4g}) is outside its range, {ranges[i, 0]:.4g} to "
        f"{ranges[i, 1]:.4g}"
        for i in outside(q, ranges)
    )


def without_ranges(arm: Any) -> Any:
    """An arm from a file whose joints may move anywhere, as linear theory has them."""
    out, free = object.__new__(type(arm)), np.array([-np.inf, np.inf])
    loaded = arm._loaded._replace(ranges=np.tile(free, (len(arm.names), 1)))
    vars(out).update(vars(arm), _loaded=loaded)
    return out
