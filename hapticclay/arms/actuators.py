"""What the actuators of a file say of its joints: the largest torques of their motors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np


def gear(model: Any, i: int) -> float:
    """Ratio of an actuator to the joint or tendon that it drives."""
    return float(model.actuator_gear[model.actuator_outadr[i], 0])


def torque_limits(model: Any, joints: Sequence[int]) -> np.ndarray:
    """Largest torque of each joint to both sides [N.m or N], infinite for none, shape (n,).

    The smaller side of the joint's own range (actfrcrange) and of those of its actuators.
    """
    sides = np.array([_sides(model, joint) for joint in joints])
    return sides.min(axis=1)


def limit_notes(model: Any, joints: Sequence[int], names: Sequence[str]) -> Iterator[str]:
    """Sentences about limits that differ between the sides, or are to one side only."""
    for joint, name in zip(joints, names, strict=True):
        low, high = _sides(model, joint)
        if low != high:
            yield f"torque limit of {name}: the smaller side of {-low:g} to {high:g}"
        for i in _at(model, joint):
            one = _actuator_sides(model, i)
            if min(one) <= 0.0:
                range_ = f"{0.0 - one[0]:g} to {one[1]:g}"
                yield f"an actuator of {name} pushes to one side ({range_}): no limit of its motor"


def _sides(model: Any, joint: int) -> tuple[float, float]:
    """Largest torque of a joint to the negative and the positive side."""
    low = high = math.inf
    if model.jnt_actfrclimited[joint]:
        low, high = -float(model.jnt_actfrcrange[joint, 0]), float(model.jnt_actfrcrange[joint, 1])
    own = [_actuator_sides(model, i) for i in _at(model, joint)]
    if own and all(min(sides) > 0.0 for sides in own):  # what actuators give together
        low, high = min(low, sum(x for x, _ in own)), min(high, sum(x for _, x in own))
    return max(0.0, low), max(0.0, high)


def _at(model: Any, joint: int) -> list[int]:
    """Actuators that drive a joint, but for those of groups that are off."""
    from ..physics import mujoco

    kinds = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    return [
        i
        for i in range(model.nactuator)
        if model.actuator_trntype[i] in kinds
        and model.actuator_trnid[i, 0] == joint
        and gear(model, i)
        and not model.opt.disableactuator >> int(model.actuator_group[i]) & 1
    ]


def _actuator_sides(model: Any, i: int) -> tuple[float, float]:
    """Largest torque of an actuator on its joint, to the negative and the positive side."""
    low = high = math.inf
    if model.actuator_forcelimited[i]:
        low, high = -model.actuator_forcerange[i, 0], model.actuator_forcerange[i, 1]
    if _is_motor(model, i):
        range_ = model.actuator_ctrlrange[model.actuator_ctrladr[i]]
        by_control = sorted(model.actuator_gainprm[i, 0] * range_)
        low, high = min(low, -by_control[0]), min(high, by_control[1])
    ratio = gear(model, i)
    sides = float(low) * abs(ratio), float(high) * abs(ratio)
    return sides if ratio > 0.0 else (sides[1], sides[0])


def _is_motor(model: Any, i: int) -> bool:
    """Whether its force is a limited control times a gain."""
    from ..physics import mujoco

    clamped = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    return bool(
        clamped
        and model.actuator_ctrllimited[model.actuator_ctrladr[i]]
        and model.actuator_gaintype[i] == int(mujoco.mjtGain.mjGAIN_FIXED)
        and model.actuator_biastype[i] == int(mujoco.mjtBias.mjBIAS_NONE)
        and model.actuator_dyntype[i] == int(mujoco.mjtDyn.mjDYN_NONE)
    )
