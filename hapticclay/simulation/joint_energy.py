"""Energy of an arm from a file: of its motion, weight and springs, and of the hand at its handle."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..physics import mujoco
from ..scene.scenario import Scenario


def stored(scenario: Scenario, m: Any, s: Any) -> tuple[float, float]:
    """Energy of the arm, and of mass and spring of the operator's arm, after the last kick [J]."""
    arm: Any = scenario.arm
    n, model = m.joints, arm.mechanism.runnable()
    w = np.array(s.w[:n])
    q = np.array(s.q[:n]) - s.before * w  # where the kick was
    data = mujoco.MjData(model)
    data.qpos[:] = arm.mechanism.pose
    data.qpos[arm.mechanism.dofs], data.qvel[arm.mechanism.dofs] = q, w
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    spring, pull = np.array(m.spring[:n]), np.array(m.pull[:n])
    arms = float(data.energy.sum() + 0.5 * spring @ q**2 - pull @ q)
    axes = list(m.row[: m.axes])
    p = arm.handle(q)[axes] - np.array(m.at[: m.axes])
    v = arm.jacobian(q)[axes] @ w
    masses = np.array([a.mass for a in m.axis[: m.axes]])
    springs = np.array([a.spring for a in m.axis[: m.axes]])
    weight = np.array(m.weight[: m.axes])
    return arms, float(0.5 * (masses @ v**2 + springs @ p**2) - weight @ p)
