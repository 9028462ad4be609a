"""Energy of an arm from a file: of motion, weight and springs, and of the hand at its handle."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene.scenario import Scenario


def stored(scenario: Scenario, m: Any, s: Any) -> tuple[float, float]:
    """Energy of the arm, and of mass and spring of the operator's arm, after the last kick [J].

    That of the arm at rest at its start is 0.
    """
    arm = scenario.file_arm
    n = m.joints
    w = np.array(s.w[:n])
    q = np.array(s.q[:n]) - s.before * w  # where the kick was
    start = np.array(m.start[:n])
    arms = arm.mechanism.energy(q, w) - arm.mechanism.energy(start, 0.0 * w)
    axes = ["xyz".index(c) for c in arm.axes]
    p = arm.handle(q)[axes] - np.array(m.at[: m.axes])
    v = arm.jacobian(q)[axes] @ w
    masses, springs = (
        np.array([getattr(a, x) for a in m.axis[: m.axes]]) for x in ("mass", "spring")
    )
    weight = np.array(m.weight[: m.axes])
    return arms, float(0.5 * (masses @ v**2 + springs @ p**2) - weight @ p)
