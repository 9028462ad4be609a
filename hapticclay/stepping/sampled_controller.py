"""The user's own controller in a sample."""

from __future__ import annotations

from ..model.sampled_controller import DESK, TORQUE
from .parts import INF


def asked_law(own, t, q, w, f, state):
    """Torques of both joints that the law answers [N.m], and its state behind the sample."""
    desk, n = own.desk, own.size
    for i, x in enumerate((t, q[0], q[1], w[0], w[1], f[0], f[1])):
        desk[i] = x
    desk[TORQUE] = desk[TORQUE + 1] = float("nan")  # what a call that fails leaves behind
    for i in range(n):
        desk[DESK + i] = state[i]
    own.law()
    return (desk[TORQUE], desk[TORQUE + 1]), tuple(desk[DESK + n : DESK + 2 * n])


def is_refused(tau):
    """Whether torques are not finite."""
    return not abs(tau[0]) + abs(tau[1]) < INF
