"""The two-link arm in closed form: Jacobian, mobility and rates, as formulas of floats."""

import math

from . import numbers


def jacobian(q1, q2, links):
    """Columns of the Jacobian in absolute angles, u_i = dp/dtheta_i (Eq. 14) [m].

    q1: angle of link 1, q2: of link 2 against link 1 [rad]; `links` as `Arm.links`. The handle lies
    at (u1y + u2y, -u1x - u2x) in the world.
    """
    l1, l2, a = links[0], links[1], q1 + q2
    return -l1 * math.sin(q1), l1 * math.cos(q1), -l2 * math.sin(a), l2 * math.cos(a)


def mobility(u, links):
    """Inverse operational-space inertia W = Lambda^-1 = J M^-1 J' (Khatib 1987) [1/kg].

    u: from `jacobian` or `jacobians`. (Wxx, Wxy, Wyy).
    """
    u1x, u1y, u2x, u2y = u[0], u[1], u[2], u[3]
    a = u1x / links[2]
    b = u2x / links[3]
    wxx = u1x * a + u2x * b
    return wxx, u1y * a + u2y * b, links[4] - wxx


def handle_velocity(r1, r2, u):
    """Handle velocity from the absolute link rates r1, r2 [rad/s]: (vx, vy) [m/s]."""
    u1x, u1y, u2x, u2y = u[0], u[1], u[2], u[3]
    return u1x * r1 + u2x * r2, u1y * r1 + u2y * r2


def centripetal(r1, r2, u):
    """Centripetal acceleration of the handle, c = -J' q', towards the joints: (cx, cy) [m/s^2]."""
    u1x, u1y, u2x, u2y = u[0], u[1], u[2], u[3]
    s1 = r1 * r1
    s2 = r2 * r2
    return u1y * s1 + u2y * s2, -u1x * s1 - u2x * s2


def centripetal_about_sample(L, cx, cy, vx, vy, u):
    """Mean of `centripetal` over a kick in which the handle velocity jumps at the sample.

    L: share of the kick before it; c: before it [m/s^2]; v: velocity after it [m/s].
    """
    r1, r2 = joint_velocity(vx, vy, u, 1.0)
    x, y = centripetal(r1, r2, u)
    return L * cx + (1.0 - L) * x, L * cy + (1.0 - L) * y


def joint_torques(fx, fy, u):
    """Joint torques J' f of a force at the handle: (tau1, tau2) [N.m]."""
    u1x, u1y, u2x, u2y = u[0], u[1], u[2], u[3]
    t2 = u2x * fx + u2y * fy
    return u1x * fx + u1y * fy + t2, t2


def joint_velocity(vx, vy, u, n):
    """Absolute link rates of a handle velocity, divided by n: 1, or a time for accelerations.

    They are not finite where the arm is stretched or folded.
    """
    u1x, u1y, u2x, u2y = u[0], u[1], u[2], u[3]
    det = n * (u1x * u2y - u2x * u1y)
    first = numbers.ratio(vx * u2y - vy * u2x, det)
    return first, numbers.ratio(vy * u1x - vx * u1y, det)


def inverse_kinematics(x, y, links):
    """Joint angles of the handle at a world position within reach, elbow to the left (q2 < 0).

    (q1, q2) [rad]; q1 in (-pi, pi].
    """
    l1, l2 = links[0], links[1]
    c = (x * x + y * y - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)
    q2 = -math.acos(min(1.0, max(-1.0, c)))
    q1 = math.atan2(y, x) - math.atan2(l2 * math.sin(q2), l1 + l2 * math.cos(q2))
    # IEEE remainder by one turn, which compiled code lacks; exact by Sterbenz' lemma
    if q1 > math.pi:
        q1 -= 2.0 * math.pi
    elif q1 < -math.pi:
        q1 += 2.0 * math.pi
    return q1, q2
