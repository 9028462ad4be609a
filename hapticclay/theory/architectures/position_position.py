"""Position-position: each joint law pulls its arm towards the other one.

    tau_l = Kp (T' q_f/mu - q_l) + Kd (T' w_f/mu - w_l),  tau_f = Kp (mu T q_l - q_f) + ...

mu scales motion, T maps joints. Of the oldest servo manipulators (Goertz and Thompson,
Electronically Controlled Manipulator, Nucleonics 12, 1954). The force that the leader feels follows
from its gains: a scale of force is refused.
"""

from __future__ import annotations

import numpy as np

from ...arms.joint_law import JointPD
from ...scene.pair import Pair
from .control import Control, without_states


def controls(pair: Pair) -> tuple[Control, Control]:
    """Controls of leader and follower: each sends what pulls the other one."""
    to_follower, to_leader = references(pair)
    one = np.eye(pair.n)
    return without_states(one, to_follower), without_states(one, to_leader)


def references(pair: Pair) -> tuple[np.ndarray, np.ndarray]:
    """Pull on the follower per (q, v, F) of the leader, and on the leader per the follower's."""
    leader, follower = pair.laws
    motion, T = pair.link.scale[0], pair.mapping
    return (
        pull(follower, motion * T, pair.link.rates),
        pull(leader, T.T / motion, pair.link.rates),
    )


def pull(law: JointPD, reference: np.ndarray, rates: bool) -> np.ndarray:
    """Torque of a joint law per (q, v, F) of the arm that its reference comes from."""
    Kp, Kd = np.diag(law.Kp) @ reference, np.diag(law.Kd) @ reference
    return np.hstack([Kp, Kd * float(rates), np.zeros_like(Kp)])
