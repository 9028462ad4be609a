"""Coulomb friction in the joints, in a kick under given torques."""

from __future__ import annotations

import math

from ..model import hardware
from . import servo
from .kick import driven, rates_after

ROUNDS = 80  # to find the torque of a joint that friction holds in clay that yields
CLOSE = 1e-15  # agreement of it, over its limit, and of the rate over that without it
NUDGE = 1e-9  # of the limit, beyond the torque that brings a joint to rest


def on_joints(slip, tau):
    """All torques on the joints [N.m]."""
    if slip is None:
        return tau
    return tau[0] + slip[0], tau[1] + slip[1]


def torques(limit, special, parts, clay, a, w, tau):
    """Friction torques in a kick [N.m], None without friction.

    Args:
        limit: of the torques [N.m].
        special: laws of the clay that acts.
        parts: the scene.
        clay: its state.
        a: what acts on the handle.
        w: joint rates before the kick [rad/s].
        tau: torques of the motors [N.m].
    """
    if limit is None:
        return limit
    return torques_in_clay(special, limit, parts, clay, a, w, tau)


def torques_in_clay(special, limit, parts, clay, a, w, tau):
    if special is None:
        return linear(limit, special, parts, clay, a, w, tau)
    return torques_in_flow(special.flow, limit, special, parts, clay, a, w, tau)


def torques_in_flow(flow, limit, special, parts, clay, a, w, tau):
    if flow is None:
        return linear(limit, special, parts, clay, a, w, tau)
    x = torque_of(shoulder_rate, limit[0], limit, special, parts, clay, a, w, tau)
    return x, torque_of(elbow_rate, limit[1], special, parts, clay, a, w, (tau[0] + x, tau[1]))


def rates(special, parts, clay, a, w, tau):
    """Joint rates after a kick under torques on the joints [rad/s]."""
    m, g = driven(special, parts, clay, a, servo.torque_law(parts.arm.links, a.step, a.at, tau))
    return rates_after(special, m, a.step.H, w, g)


def linear(limit, special, parts, clay, a, w, tau):
    """Where the rates are linear in the torques: by those of one N.m more on either joint."""
    n1, n2 = rates(special, parts, clay, a, w, tau)
    x1, x2 = rates(special, parts, clay, a, w, (tau[0] + 1.0, tau[1]))
    y1, y2 = rates(special, parts, clay, a, w, (tau[0], tau[1] + 1.0))
    mixed = 0.5 * (x2 - n2 + y1 - n1)  # equal except for rounding
    return hardware.coulomb_friction((n1, n2), x1 - n1, mixed, y2 - n2, limit)


def elbow_rate(f, special, parts, clay, a, w, tau):
    """Rate of joint 2 after a kick with friction f in it [rad/s]."""
    return rates(special, parts, clay, a, w, (tau[0], tau[1] + f))[1]


def shoulder_rate(f, limit, special, parts, clay, a, w, tau):
    """Rate of joint 1 after a kick with friction f in it, and its own in joint 2 [rad/s]."""
    tau = tau[0] + f, tau[1]
    f = torque_of(elbow_rate, limit[1], special, parts, clay, a, w, tau)
    return rates(special, parts, clay, a, w, (tau[0], tau[1] + f))[0]


def torque_of(rate, limit, *args):
    """Friction of one joint in a kick that is not linear in the torques [N.m].

    The rate after a kick grows with the torque. The joint rests under a torque within the limit, or
    slides against the limit.

    Args:
        rate: of the joint after the kick [rad/s], by the torque of its friction [N.m] and args.
        limit: of the torque [N.m].
        args: further arguments of rate.
    """
    at = rate(0.0, *args)
    if at == 0.0 or limit == 0.0:
        return 0.0
    most = -math.copysign(limit, at)
    end = rate(most, *args)
    if end == 0.0 or (end > 0.0) == (at > 0.0):
        return most
    # false position, Illinois; clay helps to hold the joint over a range of torques, within which
    # its rate is 0.0
    a, fa, b, fb, f = 0.0, at, most, end, most
    for _ in range(ROUNDS):
        f = b - fb * (b - a) / (fb - fa)
        new = rate(f, *args)
        if new == 0.0:
            return f
        if (new > 0.0) != (fb > 0.0):
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = f, new
        if abs(new) <= CLOSE * abs(at) or abs(b - a) <= CLOSE * limit:
            break
    if rate(f + NUDGE * most, *args) == 0.0:  # such a range begins here
        return f + NUDGE * most
    return f
