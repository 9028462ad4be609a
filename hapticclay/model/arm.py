"""The direct-drive arm in closed form: two links in a horizontal plane, link 2 balanced at the elbow.

Angles: q1 of link 1 against world x, q2 of link 2 against link 1 (Eq. 14). The formulas use the
absolute angles theta1 = q1, theta2 = q1 + q2, in which the inertia matrix is diag(I1, I2),
constant, without Coriolis terms. Derivations: docs/equations.md.
"""

from __future__ import annotations

import math
from math import cos, sin

from .constants import L1, L2, S

I1 = (
    L1 * L1 / S[0].gain
)  # [kg.m^2]; Sh at high frequency is 1/Lambda, so Lambda_x = 1/0.7919 kg (Eq. 17)
I2 = L2 * L2 / S[1].gain  # [kg.m^2]; Lambda_y = 1/0.131 kg (Eq. 18)


TRACE_W = L1 * L1 / I1 + L2 * L2 / I2  # trace of Lambda^-1 [1/kg], the same at every pose


def jacobian(s1: float, c1: float, s12: float, c12: float) -> tuple[float, float, float, float]:
    """Columns of the Jacobian in absolute angles, u_i = dp/dtheta_i (Eq. 14).

    Args:
        s1, c1: sine and cosine of q1. s12, c12: of q1 + q2. Floats, or arrays of one shape.

    Returns:
        (u1x, u1y, u2x, u2y) [m]. The handle lies at (u1y + u2y, -u1x - u2x) in the world.
    """
    return -L1 * s1, L1 * c1, -L2 * s12, L2 * c12


def handle_position(q1: float, q2: float) -> tuple[float, float]:
    """World position of the handle [m] at joint angles q1, q2 [rad]."""
    u1x, u1y, u2x, u2y = jacobian(sin(q1), cos(q1), sin(q1 + q2), cos(q1 + q2))
    return u1y + u2y, -u1x - u2x


def mobility(u1x: float, u1y: float, u2x: float, u2y: float) -> tuple[float, float, float]:
    """Inverse operational-space inertia W = Lambda^-1 = J M^-1 J' (Khatib 1987).

    Args:
        u1x, u1y, u2x, u2y: result of `jacobian` [m].

    Returns:
        (Wxx, Wxy, Wyy) [1/kg].
    """
    a = u1x / I1
    b = u2x / I2
    wxx = u1x * a + u2x * b
    return wxx, u1y * a + u2y * b, TRACE_W - wxx


def handle_velocity(
    r1: float, r2: float, u1x: float, u1y: float, u2x: float, u2y: float
) -> tuple[float, float]:
    """Handle velocity [m/s] of the absolute link rates r1, r2 [rad/s]; columns as above."""
    return u1x * r1 + u2x * r2, u1y * r1 + u2y * r2


def centripetal(
    r1: float, r2: float, u1x: float, u1y: float, u2x: float, u2y: float
) -> tuple[float, float]:
    """c = -J' q', acceleration of the handle towards the joints at link rates r1, r2 [m/s^2]."""
    s1 = r1 * r1
    s2 = r2 * r2
    return u1y * s1 + u2y * s2, -u1x * s1 - u2x * s2


def centripetal_about_sample(
    L: float,
    cx: float,
    cy: float,
    vx: float,
    vy: float,
    u1x: float,
    u1y: float,
    u2x: float,
    u2y: float,
) -> tuple[float, float]:
    """Mean of `centripetal` over a kick at whose sample the handle velocity leaps [m/s^2].

    Args:
        L: share of the kick before the sample. cx, cy: centripetal acceleration there [m/s^2].
        vx, vy: handle velocity after it [m/s]. u1x, u1y, u2x, u2y: result of `jacobian` [m].
    """
    r1, r2 = joint_velocity(vx, vy, u1x, u1y, u2x, u2y, 1.0)
    x, y = centripetal(r1, r2, u1x, u1y, u2x, u2y)
    return L * cx + (1.0 - L) * x, L * cy + (1.0 - L) * y


def joint_torques(
    fx: float, fy: float, u1x: float, u1y: float, u2x: float, u2y: float
) -> tuple[float, float]:
    """Joint torques J' f [N.m] of a force at the handle [N]."""
    t2 = u2x * fx + u2y * fy
    return u1x * fx + u1y * fy + t2, t2


def handle_acceleration(
    a1: float, a2: float, fx: float, fy: float, u1x: float, u1y: float, u2x: float, u2y: float
) -> tuple[float, float]:
    """Acceleration of a handle that all but rests [m/s^2]: of links a1, a2 [rad/s^2], and of a force on it [N]."""
    ax, ay = handle_velocity(a1, a2, u1x, u1y, u2x, u2y)
    wxx, wxy, wyy = mobility(u1x, u1y, u2x, u2y)
    return ax + wxx * fx + wxy * fy, ay + wxy * fx + wyy * fy


def joint_velocity(
    vx: float, vy: float, u1x: float, u1y: float, u2x: float, u2y: float, n: float
) -> tuple[float, float]:
    """Absolute link rates that move the handle with (vx, vy), divided by n.

    Args:
        vx, vy: handle velocity, or any vector of it. u1x, u1y, u2x, u2y: result of `jacobian` [m].
        n: divisor; zero at the stretched or folded arm raises ZeroDivisionError.
    """
    det = n * (u1x * u2y - u2x * u1y)
    return (vx * u2y - vy * u2x) / det, (vy * u1x - vx * u1y) / det


def inverse_kinematics(x: float, y: float) -> tuple[float, float]:
    """Joint angles that put the handle at world (x, y), elbow on the left of the line to it (q2 < 0).

    Args:
        x, y: world position [m], within the reach.

    Returns:
        (q1, q2) [rad]; q1 in (-pi, pi].
    """
    c = (x * x + y * y - L1 * L1 - L2 * L2) / (2.0 * L1 * L2)
    q2 = -math.acos(min(1.0, max(-1.0, c)))
    q1 = math.atan2(y, x) - math.atan2(L2 * math.sin(q2), L1 + L2 * math.cos(q2))
    return math.remainder(q1, 2.0 * math.pi), q2
