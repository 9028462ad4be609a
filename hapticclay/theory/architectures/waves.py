"""Wave variables: what goes through the link is a wave, so no constant delay makes it active.

    u = (b v + F)/sqrt(2 b) to the follower,  w = (b v - F)/sqrt(2 b) to the leader

At the leader, tau = -F with F = b v - sqrt(2 b) w, and u = sqrt(2 b) v - w. At the follower, the
rate v_d = sqrt(2/b) u - F/b leads its joint law, F = Kp (x_d - q) + Kd (v_d - v), x_d the sum of
v_d Ts, and w = u - sqrt(2/b) F. With b = Kd the law matches the wave: nothing is reflected but by
Kp. Anderson and Spong, Bilateral Control of Teleoperators with Time Delay, IEEE Trans. Automatic
Control 34(5), 1989; Niemeyer and Slotine, Stable Adaptive Teleoperation, IEEE J. Oceanic
Engineering 16(1), 1991. The leader's own gains take no part; a law in the follower's drive is
refused.
"""

from __future__ import annotations

import numpy as np

from ...scene.pair import Pair
from .control import Control


def controls(pair: Pair) -> tuple[Control, Control]:
    """Controls of leader and follower."""
    b = impedance(pair)
    return _leader(pair, b), _follower(pair, b)


def impedance(pair: Pair) -> np.ndarray:
    """Wave impedance of each joint of the follower, shape (n,)."""
    given = pair.link.impedance
    return np.broadcast_to(np.array(pair.laws[1].Kd if given is None else given), pair.n)


def _leader(pair: Pair, b: np.ndarray) -> Control:
    """The leader's end, its motion and force as the follower's joints have them."""
    motion, force = pair.link.scale
    T, none = pair.mapping, np.zeros((pair.n, pair.n))
    root, felt = np.diag(np.sqrt(2.0 * b)), force * T.T
    torque = np.hstack([none, -felt @ np.diag(b) @ T * motion, none, felt @ root])
    message = np.hstack([none, root @ T * motion, none, -np.eye(pair.n)])
    return Control(torque, message, np.zeros((0, 4 * pair.n)))


def _follower(pair: Pair, b: np.ndarray) -> Control:
    """The follower's end. Its joint law pulls to zero already: F has that part in it.

    F (1 + Kd/b) = Kp (x_d - q) + Kd (sqrt(2/b) u - v).
    """
    n, law = pair.n, pair.laws[1]
    Kp, Kd = np.array(law.Kp), np.array(law.Kd)
    share, into = 1.0 / (1.0 + Kd / b), np.sqrt(2.0 / b)
    none = 0.0 * b
    F = _of_signals(-share * Kp, -share * Kd, none, share * Kd * into, share * Kp)
    of_law = _of_signals(-Kp, -Kd, none, none, none)
    unit = np.eye(n)
    u = np.hstack([np.zeros((n, 3 * n)), unit, np.zeros((n, n))])
    kept = np.hstack([np.zeros((n, 4 * n)), unit])
    rate = np.diag(into) @ u - np.diag(1.0 / b) @ F
    return Control(F - of_law, u - np.diag(into) @ F, kept + pair.Ts * rate)


def _of_signals(*gains: np.ndarray) -> np.ndarray:
    """A row of gains of q, v, F, u and x_d, joint by joint."""
    return np.hstack([np.diag(gain) for gain in gains])
