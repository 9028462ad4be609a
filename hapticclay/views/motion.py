"""What figures and films show of a motion: along it, or of the joint that moves most."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model.clay import Clay
from ..simulation.pair_record import PairRecord

SMALL = 0.05  # [rad or m] motion below this is shown in thousandths


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


def most_moved(r: PairRecord) -> tuple[int, list[np.ndarray]]:
    """The joint of a pair that moves most, and its motion at both ends."""
    moved = [q - q[0] for q in (r.leader, r.follower)]
    j = int(np.maximum(*map(np.abs, moved)).max(axis=0).argmax())
    return j, [x[:, j] for x in moved]


def pair_unit(unit: str, turned: Any) -> tuple[str, float]:
    """Unit in which a joint's motion is drawn, and its size."""
    small = max(float(np.abs(x).max(initial=0.0)) for x in turned) < SMALL
    return (f"m{unit}", 1e3) if small else (unit, 1.0)
