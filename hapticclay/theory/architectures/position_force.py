"""Position-force: the follower follows, the leader feels what the follower's handle pushes with.

    tau_l = -phi T' F_f,  tau_f = Kp (mu T q_l - q_f) + Kd (mu T w_l - w_f)

With local force gains g, each arm gets -g F of its own besides. F_f is the measured torque of the
follower on what it touches, phi scales force. The leader has no
law of its own: its gains take no part. After Lawrence, Stability and Transparency in Bilateral
Teleoperation, IEEE Trans. Robotics and Automation 9(5), 1993: the two-channel case C1, C2.
"""

from __future__ import annotations

import numpy as np

from ...scene.pair import Pair
from .control import Control, without_states
from .position_position import references


def controls(pair: Pair) -> tuple[Control, Control]:
    """Controls of leader and follower."""
    one, (leader, follower) = np.eye(pair.n), local_forces(pair)
    there = without_states(one, references(pair)[0], leader)
    return there, without_states(one, reflected(pair), follower)


def local_forces(pair: Pair) -> tuple[np.ndarray, np.ndarray]:
    """Torque of each arm per its own (q, v, F): C6 and C5 of Lawrence."""
    none, one = np.zeros((pair.n, 2 * pair.n)), np.eye(pair.n)
    leader, follower = pair.link.local_force
    return np.hstack([none, -leader * one]), np.hstack([none, -follower * one])


def reflected(pair: Pair) -> np.ndarray:
    """Torque on the leader per (q, v, F) of the follower: the force that it pushes with."""
    none = np.zeros((pair.n, 2 * pair.n))
    return np.hstack([none, -pair.link.scale[1] * pair.mapping.T])
