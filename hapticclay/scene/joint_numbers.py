"""Numbers of a scenario by joint, whatever its arm."""

from __future__ import annotations

import numpy as np

from ..arms.joint_law import JointPD
from .scenario import Scenario


def torque_limits(s: Scenario) -> np.ndarray:
    """Largest torque of each motor [N.m], infinite for none, shape (n,)."""
    return np.array(s.torque_limit if s.is_closed_form else s.file_arm.torque_limit)


def turning(s: Scenario) -> list[bool]:
    """Whether each joint turns; others slide."""
    return [True, True] if s.is_closed_form else s.file_arm.mechanism.turning


def references(s: Scenario) -> np.ndarray | None:
    """Joint positions to which the law pulls [rad], shape (n,); None where no law does."""
    law = s.controller
    if not isinstance(law, JointPD) or not any(law.Kp):
        return None
    if law.reference is not None:
        return np.array(law.reference)
    return None if s.is_closed_form else s.file_arm.q
