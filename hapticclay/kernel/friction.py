"""Coulomb friction in the joints, in a kick under given torques."""

import math

from ..formulas import hardware as law
from . import kick, servo

ROUNDS = 80  # to find the torque of a joint that friction holds in clay that yields
CLOSE = 1e-15  # agreement of it, over its limit, and of the rate over that without it
NUDGE = 1e-9  # of the limit, beyond the torque that brings a joint to rest


def find(m, s, k, t1, t2):
    """Friction torques in a kick under torques of the motors [N.m]."""
    if m.acts and m.special and m.flow:
        k.slip[0] = torque_of(m, s, k, 0, t1, t2)
        k.slip[1] = torque_of(m, s, k, 1, t1 + k.slip[0], t2)
    else:
        k.slip[0], k.slip[1] = linear(m, s, k, t1, t2)


def drive(m, s, k, t1, t2):
    """The kick under torques on the joints."""
    servo.torque_law(m, k, t1, t2)
    kick.move(m, s, k)


def linear(m, s, k, t1, t2):
    """Where the rates are linear in the torques: by those of one N.m more on either joint."""
    drive(m, s, k, t1, t2)
    n1, n2 = k.w[0], k.w[1]
    drive(m, s, k, t1 + 1.0, t2)
    x1, x2 = k.w[0], k.w[1]
    drive(m, s, k, t1, t2 + 1.0)
    y1, y2 = k.w[0], k.w[1]
    mixed = 0.5 * (x2 - n2 + y1 - n1)  # equal except for rounding
    return law.coulomb_friction((n1, n2), x1 - n1, mixed, y2 - n2, m.slip)


def rate(m, s, k, i, f, t1, t2):
    """Rate of a joint after a kick with friction f in it [rad/s].

    For the shoulder, the elbow has its own friction in that kick.
    """
    if i == 0:
        t1 = t1 + f
        t2 = t2 + torque_of(m, s, k, 1, t1, t2)
    else:
        t2 = t2 + f
    drive(m, s, k, t1, t2)
    return k.w[1] if i else k.w[0]


def torque_of(m, s, k, i, t1, t2):
    """Friction of a joint in a kick that is not linear in the torques [N.m]."""
    limit = m.slip[i]
    at = rate(m, s, k, i, 0.0, t1, t2)
    if at == 0.0 or limit == 0.0:
        return 0.0
    most = -math.copysign(limit, at)
    end = rate(m, s, k, i, most, t1, t2)
    if end == 0.0 or (end > 0.0) == (at > 0.0):
        return most
    # false position, Illinois; clay helps to hold the joint over a range of torques, within which
    # its rate is 0.0
    a, fa, b, fb, f = 0.0, at, most, end, most
    for _ in range(ROUNDS):
        f = b - fb * (b - a) / (fb - fa)
        new = rate(m, s, k, i, f, t1, t2)
        if new == 0.0:
            return f
        if (new > 0.0) != (fb > 0.0):
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = f, new
        if abs(new) <= CLOSE * abs(at) or abs(b - a) <= CLOSE * limit:
            break
    if rate(m, s, k, i, f + NUDGE * most, t1, t2) == 0.0:  # such a range begins here
        return f + NUDGE * most
    return f
