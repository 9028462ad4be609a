"""The direct-drive arm in closed form: two links in a horizontal plane, link 2 balanced.

Joint angles: q1 of link 1 against world x, q2 of link 2 against link 1 (Eq. 14). The formulas use
the absolute angles theta1 = q1 and theta2 = q1 + q2, in which the inertia matrix is the constant
diag(I1, I2), without Coriolis terms. Derivations: docs/equations.md.

The formulas use an arm as plain numbers, `links`: l1, l2 [m], I1, I2 [kg.m^2], and the trace of
its mobility [1/kg]; see `Arm.links`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from math import cos, sin
from typing import Annotated, Any

import numpy as np

from ..arguments import named
from ..errors import Bound, check_fields
from .constants import L1, L2, S

Columns = tuple[float, float, float, float]
Links = tuple[float, float, float, float, float]


@named
@dataclass(frozen=True)
class Arm:
    """A two-link arm in a horizontal plane, link 2 balanced about the elbow; the paper's.

    Attributes:
        l1: length of link 1, shoulder to elbow [m], 1e-3 to 100.
        l2: length of link 2, elbow to handle [m], 1e-3 to 100.
        I1: inertia about the shoulder, of link 1 and of the mass of link 2 at the elbow [kg.m^2],
            1e-9 to 1e6; l1^2/0.7919 as printed (Eq. 17: Sh at high frequency is 1/Lambda).
        I2: inertia of link 2 about the elbow [kg.m^2], 1e-9 to 1e6; l2^2/0.131 as printed (Eq. 18).
    """

    l1: Annotated[float, Bound(1e-3, 100.0, "m")] = L1
    l2: Annotated[float, Bound(1e-3, 100.0, "m")] = L2
    I1: Annotated[float, Bound(1e-9, 1e6, "kg.m^2")] = L1 * L1 / S[0].gain
    I2: Annotated[float, Bound(1e-9, 1e6, "kg.m^2")] = L2 * L2 / S[1].gain

    def __post_init__(self):
        check_fields(self, "arm.")

    @property
    def links(self) -> Links:
        """l1, l2 [m], I1, I2 [kg.m^2], trace of the mobility [1/kg], the same at every pose."""
        wx, wy = self.nominal_mobility
        return self.l1, self.l2, self.I1, self.I2, wx + wy

    @property
    def reach(self) -> tuple[float, float]:
        """Distances of the handle from the shoulder, folded and stretched [m]."""
        return abs(self.l2 - self.l1), self.l1 + self.l2

    @property
    def nominal_mobility(self) -> tuple[float, float]:
        """1/Lambda of x and y at the nominal pose, elbow square and link 2 along x [1/kg]."""
        return self.l1 * self.l1 / self.I1, self.l2 * self.l2 / self.I2


PAPER = Arm()


def jacobian(q1: float, q2: float, links: Links) -> Columns:
    """Columns of the Jacobian in absolute angles, u_i = dp/dtheta_i (Eq. 14).

    Args:
        q1: angle of link 1 [rad].
        q2: angle of link 2 against link 1 [rad].
        links: of the arm, as `Arm.links`.

    Returns:
        (u1x, u1y, u2x, u2y) [m]. The handle lies at (u1y + u2y, -u1x - u2x) in the world.
    """
    l1, l2, a = links[0], links[1], q1 + q2
    return -l1 * sin(q1), l1 * cos(q1), -l2 * sin(a), l2 * cos(a)


def jacobians(q1: Any, q2: Any, links: Links) -> tuple[Any, ...]:
    """As `jacobian`, for arrays.

    Args:
        q1: angles of link 1 [rad], of any shape.
        q2: angles of link 2 against link 1 [rad], of the same shape.
        links: of the arm, as `Arm.links`.

    Returns:
        (u1x, u1y, u2x, u2y) [m], of the same shape.
    """
    l1, l2, a = links[0], links[1], q1 + q2
    return -l1 * np.sin(q1), l1 * np.cos(q1), -l2 * np.sin(a), l2 * np.cos(a)


def mobility(u, links):
    """Inverse operational-space inertia W = Lambda^-1 = J M^-1 J' (Khatib 1987).

    Args:
        u: from `jacobian` or `jacobians` [m].
        links: of the arm, as `Arm.links`.

    Returns:
        (Wxx, Wxy, Wyy) [1/kg].
    """
    u1x, u1y, u2x, u2y = u
    a = u1x / links[2]
    b = u2x / links[3]
    wxx = u1x * a + u2x * b
    return wxx, u1y * a + u2y * b, links[4] - wxx


def handle_velocity(r1, r2, u):
    """Handle velocity from the absolute link rates.

    Args:
        r1: rate of link 1 [rad/s].
        r2: rate of link 2 [rad/s].
        u: from `jacobian` or `jacobians` [m].

    Returns:
        (vx, vy) [m/s].
    """
    u1x, u1y, u2x, u2y = u
    return u1x * r1 + u2x * r2, u1y * r1 + u2y * r2


def centripetal(r1, r2, u):
    """Centripetal acceleration of the handle, c = -J' q', towards the joints.

    Args:
        r1: rate of link 1 [rad/s].
        r2: rate of link 2 [rad/s].
        u: from `jacobian` [m].

    Returns:
        (cx, cy) [m/s^2].
    """
    u1x, u1y, u2x, u2y = u
    s1 = r1 * r1
    s2 = r2 * r2
    return u1y * s1 + u2y * s2, -u1x * s1 - u2x * s2


def centripetal_about_sample(L, cx, cy, vx, vy, u):
    """Mean of `centripetal` over a kick in which the handle velocity jumps at the sample.

    Args:
        L: share of the kick before the sample.
        cx: centripetal acceleration before the sample, x [m/s^2].
        cy: centripetal acceleration before the sample, y [m/s^2].
        vx: handle velocity after the sample, x [m/s].
        vy: handle velocity after the sample, y [m/s].
        u: from `jacobian` [m].

    Returns:
        (cx, cy) [m/s^2].
    """
    r1, r2 = joint_velocity(vx, vy, u, 1.0)
    x, y = centripetal(r1, r2, u)
    return L * cx + (1.0 - L) * x, L * cy + (1.0 - L) * y


def joint_torques(fx, fy, u):
    """Joint torques J' f of a force at the handle.

    Args:
        fx: force, x [N].
        fy: force, y [N].
        u: from `jacobian` [m].

    Returns:
        (tau1, tau2) [N.m].
    """
    u1x, u1y, u2x, u2y = u
    t2 = u2x * fx + u2y * fy
    return u1x * fx + u1y * fy + t2, t2


def joint_velocity(vx, vy, u, n):
    """Absolute link rates of a handle velocity, divided by n.

    Args:
        vx: handle velocity, or another handle vector, x.
        vy: the same, y.
        u: from `jacobian` or `jacobians` [m].
        n: divisor; 1 for rates, a time for accelerations.

    Returns:
        (r1, r2) [rad/s for m/s and n = 1].

    Raises:
        ZeroDivisionError: the arm is stretched or folded.
    """
    u1x, u1y, u2x, u2y = u
    det = n * (u1x * u2y - u2x * u1y)
    return (vx * u2y - vy * u2x) / det, (vy * u1x - vx * u1y) / det


def inverse_kinematics(x: float, y: float, links: Links) -> tuple[float, float]:
    """Joint angles that put the handle at a world position, elbow to the left (q2 < 0).

    Args:
        x: world position [m], within the reach.
        y: world position [m].
        links: of the arm, as `Arm.links`.

    Returns:
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
