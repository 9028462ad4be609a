"""The user's own controller in a sample."""

from __future__ import annotations

from ..model.sampled_controller import BUFFER, TORQUE
from .engine_step import numbers_at, put
from .parts import INF

NO_TORQUES = (float("nan"), float("nan"))


def asked_law(own, t, q, w, f, state):
    """Torques of both joints from the law [N.m], and its state after the sample."""
    buffer = own.buffer
    put(buffer, 0, (t, q[0], q[1], w[0], w[1], f[0], f[1]))
    put(buffer, TORQUE, NO_TORQUES)  # left behind by a call that fails
    put(buffer, BUFFER, state)
    own.law(buffer)
    return numbers_at(NO_TORQUES, buffer, TORQUE), numbers_at(state, buffer, BUFFER + len(state))


def is_refused(tau):
    """Whether torques are not finite."""
    return not abs(tau[0]) + abs(tau[1]) < INF
