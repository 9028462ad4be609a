"""Laws of a kick written out one by one, as docs/equations.md, section 4, has them."""

import math

import numpy as np

from hapticclay.formulas import arm


def trapezoid(rate, H, L, R):
    """(keep, take) of v' = -rate v + drive over a kick: v+ = keep v- + take drive."""
    return (1.0 / H - rate * L) / (1.0 / H + rate * R), 1.0 / (1.0 / H + rate * R)


def servo_weights(servo, H, L, R):
    """Of one axis in a kick: keep and take of the reference model; weights after and before it,
    and stiffness of the handle."""
    keep, take = trapezoid(servo.G.damping, H, L, R)
    after, before = 1.0 / H + servo.S.damping * R, 1.0 / H - servo.S.damping * L
    return keep, take * servo.G.stiffness, after, before, servo.S.stiffness


def servo_acceleration(after, before, spring, rates, v, y, p, c):
    """Acceleration of one axis without forces and without the velocity after the kick [m/s^2].

    rates: of the reference model before and after it [m/s].
    """
    return after * rates[1] + before * (v - rates[0]) + spring * (y - p) + c


def kick_under(tau, H, v, u, links, f, d):
    """Velocity after a kick under given torques, (x, y) [m/s]."""
    free = arm.handle_velocity((tau[0] - tau[1]) / links[2], tau[1] / links[3], u)
    W = np.array(arm.mobility(u, links))[[[0, 1], [1, 2]]]
    return np.linalg.solve(np.eye(2) / H + W @ np.diag(d), np.array(v) / H + free + W @ f)


def servo_kick(H, v, u, links, law, loads, limit=(math.inf, math.inf)):
    """The kick that the servo asks for, within the torque limits.

    law: weight n of the velocity after it, acceleration a, mobility W: n u = a + W (f - d u).
    loads: hand force without the velocity after the kick, and its part per unit of that.

    Returns (ux, uy, g1, g2, ffx, ffy, t1, t2): velocity after it, link accelerations, net force,
    motor torques.
    """
    (f, d), (n, a, W), I1, I2 = np.array(loads), law, links[2], links[3]
    Wn = np.array(W)[[[0, 1], [1, 2]]]
    w = np.linalg.solve(np.diag(n) + Wn @ np.diag(d), a + Wn @ f)

    def behind(w):
        g1, g2 = arm.joint_velocity(*(w - v), u, H)
        p1, p2 = arm.joint_torques(*(f - d * w), u)
        return g1, g2, I1 * g1 + I2 * g2 - p1, I2 * g2 - p2

    g1, g2, *tau = behind(w)
    if any(abs(t) > most for t, most in zip(tau, limit, strict=True)):
        tau = np.clip(tau, np.negative(limit), limit)
        w = kick_under(tau, H, v, u, links, f, d)
        g1, g2, *_ = behind(w)
    return (*w, g1, g2, *(f - d * w), *tau)
