"""An arm from a file, and the law of its joints, turned into numbers of a Model."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arms.joint_law import JointPD, compensated
from ..model.operator import NO_HAND
from ..scene.scenario import Scenario
from . import joint_law, records

RATES = {"exact": joint_law.EXACT, "difference": joint_law.DIFFERENCE, "filter": joint_law.FILTER}


def put_arm(m: Any, arrays: dict[str, np.ndarray], s: Scenario) -> None:
    """An arm from a file: joints, axes of its handle, dampers, springs and friction."""
    arm: Any = s.file_arm
    n, axes = len(arm.names), ["xyz".index(c) for c in arm.axes]
    m.general, m.joints, m.axes = 1, n, len(axes)
    m.computed = int(arm.mechanism.is_computed)
    arrays["dof"] = np.array(arm.mechanism.dofs, dtype=np.int64)
    m.row[: len(axes)] = axes
    m.at[: len(axes)] = arm.handle()[axes].tolist()
    m.start[:n] = arm.q.tolist()
    m.limit[:n] = arm.torque_limit
    m.places = int(s.clay is not None or s.length is not None)
    m.damper[:n] = arm.damping
    stiffness, rest = arm.mechanism.springs
    m.spring[:n], m.pull[:n] = stiffness.tolist(), (stiffness * rest).tolist()
    m.friction, m.slip[:n] = int(any(arm.friction)), arm.friction
    put_weight(m, s, axes)


def put_weight(m: Any, s: Scenario, axes: list[int]) -> None:
    """Weight of the hand, and whether the law holds it and the arm."""
    mechanism = s.file_arm.mechanism
    weighs, gravity = mechanism.weighs, np.array(mechanism.model.opt.gravity)[axes]
    hands = [s.operators[min(i, 1)] or NO_HAND for i in range(len(axes))]
    m.weight[: len(axes)] = [
        x.mass * g if weighs else 0.0 for x, g in zip(hands, gravity, strict=True)
    ]
    law = s.controller if isinstance(s.controller, JointPD) else None
    m.feeds_gravity = int(compensated(s.arm, law) and weighs)


def put_law(m: Any, law: JointPD) -> None:
    """The law of the joints; what the drives do acts all the time."""
    n = m.joints
    m.joint_law, m.rate = 1, RATES[law.velocity]
    m.rate_cutoff = float(law.cutoff or 0.0)
    m.rate_bits, m.rate_range = int(law.velocity_bits or 0), float(law.velocity_range or 0.0)
    reference = m.start[:n] if law.reference is None else list(map(float, law.reference))
    if law.runs == "drive":
        m.drive_spring[:n], m.drive_damper[:n] = law.Kp, law.Kd
        m.drive_pull[:n] = [k * q for k, q in zip(law.Kp, reference, strict=True)]
        for i in range(n):
            m.spring[i] += m.drive_spring[i]
            m.damper[i] += m.drive_damper[i]
            m.pull[i] += m.drive_pull[i]
    else:
        m.gains[:n], m.rate_gains[:n], m.reference[:n] = law.Kp, law.Kd, reference
    if law.friction is not None:
        m.fed_friction[: 3 * n] = [float(x) for row in law.friction for x in row]


def scratch(n: int, freedoms: int) -> dict[str, np.ndarray]:
    """Arrays of the record Engine in which kicks of such an arm are computed."""
    assert n <= records.JOINTS
    sizes = {
        "M": freedoms * freedoms, "J": 3 * freedoms, "Jdot": 3 * freedoms,
        "scratch_forces": freedoms, "scratch_J": 3 * n, "scratch_bias": n, "joint_M": n * n,
        "joint_J": 3 * n, "joint_bias": n, "joint_D": n * n, "joint_F": n, "joint_c": 3,
        "pose": 2 * n + 1, "lower": n * n, "Y": 3 * n, "free": n, "moment": n,
        "matrix": 2 * n * n + 2 * n,
    }  # fmt: skip
    return {name: np.zeros(size) for name, size in sizes.items()}
