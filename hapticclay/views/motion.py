"""Velocity and force of clay that resists along the motion, or along each axis."""

from __future__ import annotations

import numpy as np

from ..model.clay import Clay


def along_motion(v: np.ndarray, fe: np.ndarray, main: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed and force along the motion; at rest, 0 and all of the force.

    Both are negative where the motion, or at rest the force, is against the main axis.
    """
    speed, size = np.hypot(*v.T), np.hypot(*fe.T)
    still = speed == 0.0
    along = np.where(still, size, (fe * v).sum(axis=1) / np.where(still, 1.0, speed))
    back = np.where(np.where(still, fe[:, main], v[:, main]) < 0.0, -1.0, 1.0)
    return back * speed, back * along


def resolved(
    clay: Clay | None, v: np.ndarray, force: np.ndarray, i: int
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and force along the motion, where the clay resists along it, or along an axis."""
    if clay is not None and clay.along_motion:
        return along_motion(v, force, i)
    return v[:, i], force[:, i]
