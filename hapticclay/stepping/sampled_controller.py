"""The user's own controller in a sample."""

from __future__ import annotations

from ..model.sampled_controller import DESK, TORQUE
from .engine_step import numbers_at, put
from .parts import INF

NO_TORQUES = (float("nan"), float("nan"))


def asked_law(own, t, q, w, f, state):
    """Torques of both joints that the law answers [N.m], and its state behind the sample."""
    desk = own.desk
    put(desk, 0, (t, q[0], q[1], w[0], w[1], f[0], f[1]))
    put(desk, TORQUE, NO_TORQUES)  # what a call that fails leaves behind
    put(desk, DESK, state)
    own.law(desk)
    return numbers_at(NO_TORQUES, desk, TORQUE), numbers_at(state, desk, DESK + len(state))


def is_refused(tau):
    """Whether torques are not finite."""
    return not abs(tau[0]) + abs(tau[1]) < INF
