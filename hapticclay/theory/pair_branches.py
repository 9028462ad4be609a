"""Eigenvalues of what goes around a pair, followed from angle to angle as branches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .joint_crossings import NO_SIZE, branches

WIDE = 0.7  # change of the logarithm of an eigenvalue between two angles
FAINT = -1.5  # logarithm of a size that no search needs
LOW = 0.5  # the same of a top, or a hollow, that may reach 0 between two angles
ROUNDS, FINEST = 40, 1e-13  # of halving intervals of angles; their least width


def followed(
    values: Callable[[np.ndarray], np.ndarray],
    theta: np.ndarray,
    scale: float = 0.0,
    noise: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Angles, with more where an eigenvalue turns, and branches there, shape (m, k).

    Args:
        values: eigenvalues at angles (m,), shape (m, k).
        theta: angles to begin with [rad], ascending, shape (m,).
        scale: logarithm of the size that matters: smaller eigenvalues are followed loosely, and
            tops and hollows of sizes are resolved that may reach it.
        noise: rounding of that logarithm, times the square of the angle: what is less is no top.
    """
    found = values(theta)
    for _ in range(ROUNDS):
        found = branches(found)
        size = log_size(found) - scale
        gap = np.diff(theta)
        clear = np.where(np.abs(size) * theta[:, None] ** 2 >= noise, size, np.nan)
        i = np.flatnonzero((_turns(found, size) | _reaches(clear)).any(axis=1) & (gap > FINEST))
        if not len(i):
            break
        middle = theta[i] + 0.5 * gap[i]
        found = np.insert(found, i + 1, values(middle), axis=0)
        theta = np.insert(theta, i + 1, middle)
    return theta, branches(found)


def log_size(values: np.ndarray) -> np.ndarray:
    """Logarithm of the sizes of eigenvalues; finite for those that are 0."""
    return np.log(np.maximum(np.abs(values), NO_SIZE))


def _turns(values: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Intervals in which a branch turns or grows by more than WIDE."""
    turn = np.abs(np.angle(values[1:] * values[:-1].conj()))
    wide = np.maximum(turn, np.abs(np.diff(size, axis=0))) > WIDE
    return wide & (np.maximum(size[1:], size[:-1]) > FAINT)


def _reaches(size: np.ndarray) -> np.ndarray:
    """Intervals beside a top below 0, or a hollow above it, that may reach 0 between angles.

    A parabola through three angles rises beyond the middle one by less than half of what it rises
    to it from the lower side.
    """
    out = np.zeros((len(size) - 1, size.shape[1]), bool)
    for y in (size, -size):
        left, middle, right = y[:-2], y[1:-1], y[2:]
        rise = middle - np.minimum(left, right)
        top = (middle >= left) & (middle >= right) & (middle < 0.0) & (middle > -LOW)
        open_ = top & (middle + 0.5 * rise >= 0.0)
        out[:-1] |= open_
        out[1:] |= open_
    return out
