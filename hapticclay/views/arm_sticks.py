"""Arms of pairs as stick figures: from files, of two links, and slides."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..arms.mechanism import Sticks
from ..arms.mjcf_arm import MjcfArm
from ..model.arm import Arm
from ..scene.pair import axes_of
from .palette import BLUE, VERMILION

COLORS = (BLUE, VERMILION)  # of leader and follower


def sticks_of(arm: Any, q: np.ndarray, span: float = 1.0, shift: Any = 0.0) -> Sticks:
    """An arm of a pair at joint positions.

    Args:
        arm: from a file, the two-link arm, or a device of one axis, whose rail is drawn.
        q: joint positions [rad or m], shape (n,).
        span: length of a rail to either side [m].
        shift: where it stands [m], shape (3,).

    Raises:
        ParameterError: its chains cannot be closed there.
    """
    found = _sticks(arm, q, span)
    return Sticks(found.segments + shift, found.joints + shift, found.handle + shift)


def _sticks(arm: Any, q: np.ndarray, span: float) -> Sticks:
    if isinstance(arm, MjcfArm):
        return arm.mechanism.sticks(q)
    if isinstance(arm, Arm):
        return _two_links(arm, q)
    rail = np.array([[[-span, 0.0, 0.0], [span, 0.0, 0.0]]])
    return Sticks(rail, rail[0], np.array([float(q[0]), 0.0, 0.0]))


def _two_links(arm: Arm, q: np.ndarray) -> Sticks:
    first, second = float(q[0]), float(q[0] + q[1])
    foot = np.zeros(3)
    elbow = arm.l1 * np.array([math.cos(first), math.sin(first), 0.0])
    handle = elbow + arm.l2 * np.array([math.cos(second), math.sin(second), 0.0])
    return Sticks(np.array([[foot, elbow], [elbow, handle]]), np.array([foot, elbow]), handle)


def force_axes(arm: Any) -> list[int]:
    """Axes of the world of the forces in a record, 0 for x."""
    return ["xyz".index(x) for x in axes_of(arm)]


def in_space(arm: Any, force: np.ndarray) -> np.ndarray:
    """Forces of a record along x, y, z [N], shape (..., 3)."""
    out = np.zeros((*force.shape[:-1], 3))
    axes = force_axes(arm)
    out[..., axes] = force[..., : len(axes)]
    return out
