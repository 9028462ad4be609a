"""Four channels: positions and measured forces both ways.

    tau_l = Kp (T' q_f/mu - q_l) + Kd (...) - phi T' F_f
    tau_f = Kp (mu T q_l - q_f) + Kd (...) - T F_l/phi

F is the measured torque of an arm on what it carries, at the leader the hand: -F_l is what the hand
pushes with. Lawrence, Stability and Transparency in Bilateral Teleoperation, IEEE Trans. Robotics
and Automation 9(5), 1993, with C2 = C3 = 1 and C1 = Cs, C4 = -Cm, without accelerations; local
force feedback C5, C6 as given.
"""

from __future__ import annotations

import numpy as np

from ...scene.pair import Pair
from .control import Control, without_states
from .position_force import local_forces, reflected
from .position_position import references


def controls(pair: Pair) -> tuple[Control, Control]:
    """Controls of leader and follower."""
    to_follower, to_leader = references(pair)
    one = np.eye(pair.n)
    pushed = np.zeros((pair.n, 3 * pair.n))
    pushed[:, 2 * pair.n :] = -pair.mapping / pair.link.scale[1]
    own = local_forces(pair)
    leader = without_states(one, to_follower + pushed, own[0])
    return leader, without_states(one, to_leader + reflected(pair), own[1])
