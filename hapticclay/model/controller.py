"""The two-degree-of-freedom servo that realises G and Sh together (Eqs. 15-18).

Feedback alone sets Sh; a reference model y = G delta with its acceleration fed forward sets G:

    p'' = y'' + kd (y' - v) + kp (y - p) + W f        f = fh - fe

in operational space, W = Lambda(q)^-1; inertia shaping replaces W by its value at the nominal
pose. The functions below are one kick of that law (docs/equations.md, section 4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import named
from ..errors import check_fields
from . import arm
from .compensator import Compensator
from .constants import G, S, SecondOrder


@named
@dataclass(frozen=True)
class Servo:
    """The servo of one axis: what it makes of the commanded displacement and of the hand's force.

    Attributes:
        G: closed position loop, handle over compensator output [1/s^2 in its gain] (Eqs. 15, 16).
        S: sensitivity Sh, handle over net hand force (Eqs. 17, 18). Its gain [1/kg] is imposed
            where inertia is shaped; else the handle has that of the arm.
    """

    G: SecondOrder
    S: SecondOrder

    def __post_init__(self):
        check_fields(self, "servo.")

    @property
    def numbers(self) -> tuple[float, float, float, float, float, float]:
        """Static gain, damping and stiffness of G; gain, damping and stiffness of Sh."""
        g, s = self.G, self.S
        return g.gain / g.stiffness, g.damping, g.stiffness, s.gain, s.damping, s.stiffness


SERVO = (Servo(G[0], S[0]), Servo(G[1], S[1]))  # as printed, of x and y


def servo_coefficients(
    servo: Sequence[float], H: float, L: float, R: float
) -> tuple[float, float, float, float, float]:
    """Coefficients of one axis of the servo in one kick.

    Args:
        servo: numbers of the axis, see `Servo.numbers`.
        H: length of the kick [s].
        L: share of the kick before the sample.
        R: share of the kick after the sample.

    Returns:
        (keep, take, after, before, spring): the first two of the reference model, as in
        `compensator_coefficients`; the others of the handle, as in `servo_acceleration`.
    """
    keep, take = compensator_coefficients(servo[1], H, L, R)
    damping = servo[4]
    return keep, take * servo[2], 1.0 / H + damping * R, 1.0 / H - damping * L, servo[5]


def servo_acceleration(weights, yd1, yd0, v, y, p, c):
    """Acceleration of one axis in a kick without forces and without the velocity after it [m/s^2].

    Args:
        weights: from `servo_coefficients`: of the rates after and before the kick [1/s], stiffness
            of Sh [1/s^2].
        yd1: rate of the reference model after the kick [m/s].
        yd0: rate of the reference model before the kick [m/s].
        v: handle velocity before the kick [m/s].
        y: reference position [m].
        p: handle position [m].
        c: centripetal acceleration, towards the centre [m/s^2].

    Returns:
        The acceleration [m/s^2].
    """
    after, before, spring = weights
    return after * yd1 + before * (v - yd0) + spring * (y - p) + c


def feedback_law(servo, delta, y, yd, p, v, c):
    """Servo acceleration of one axis at an instant, without forces; `feedback_vector` as a law.

    Args:
        servo: numbers of the axis, see `Servo.numbers`.
        delta: compensator output [m].
        y: reference position [m].
        yd: reference velocity [m/s].
        p: handle position [m].
        v: handle velocity [m/s].
        c: centripetal acceleration, towards the centre [m/s^2].

    Returns:
        (acceleration of the handle, acceleration of the reference) [m/s^2].
    """
    ydd = servo[2] * (servo[0] * delta - y) - servo[1] * yd
    # a kick of one second from rest, in which the velocity after it is the acceleration
    a = servo_acceleration((1.0, -servo[4], servo[5]), ydd, yd, v, y, p, c)
    return a, ydd


def solve_velocity(n, a, W, f, d):
    """Solves n u = a + W (f - d u) for the handle velocity u after a kick.

    Args:
        n: weight of u in the servo's law, (x, y) [1/s].
        a: from `servo_acceleration`, (x, y) [m/s^2].
        W: acceleration per unit of net hand force, (xx, xy, yy) [1/kg].
        f: net hand force without u, (x, y) [N].
        d: resisting force per unit of u, (x, y) [N.s/m].

    Returns:
        (ux, uy) [m/s].
    """
    nx, ny = n
    ax, ay = a
    wxx, wxy, wyy = W
    fx, fy = f
    dx, dy = d
    gx = ax + wxx * fx + wxy * fy
    gy = ay + wxy * fx + wyy * fy
    if dx or dy:
        px = nx + wxx * dx
        py = wxy * dy
        r = wxy * dx / px
        uy = (gy - r * gx) / (ny + wyy * dy - r * py)
        ux = (gx - py * uy) / px
    else:
        ux = gx / nx
        uy = gy / ny
    return ux, uy


def solve_turned(n, g, W, d):
    """Solves n u = g - W d u, d a tensor, for the handle velocity u after a kick.

    Args:
        n: weight of u in the servo's law, (x, y) [1/s].
        g: acceleration without the damping, (x, y) [m/s^2].
        W: acceleration per unit of net hand force, (xx, xy, yy) [1/kg].
        d: resisting force per unit of u, (xx, yy, xy) [N.s/m].

    Returns:
        (ux, uy) [m/s].
    """
    xx, xy = n[0] + W[0] * d[0] + W[1] * d[2], W[0] * d[2] + W[1] * d[1]
    yx, yy = W[1] * d[0] + W[2] * d[2], n[1] + W[1] * d[2] + W[2] * d[1]
    r = yx / xx
    uy = (g[1] - r * g[0]) / (yy - r * xy)
    return (g[0] - xy * uy) / xx, uy


def velocity_per_force(n, W, d):
    """Velocity after a kick that each unit of a further force takes, (n + W d)^-1 W.

    Args:
        n: weight of u in the servo's law, (x, y) [1/s].
        W: acceleration per unit of net hand force, (xx, xy, yy) [1/kg].
        d: resisting force per unit of the velocity after the kick, (xx, yy, xy) [N.s/m].

    Returns:
        (xx, xy, yx, yy) [m/(N.s)].
    """
    a, b = n[0] + W[0] * d[0] + W[1] * d[2], W[0] * d[2] + W[1] * d[1]
    c, e = W[1] * d[0] + W[2] * d[2], n[1] + W[1] * d[2] + W[2] * d[1]
    det = a * e - b * c
    return (
        (e * W[0] - b * W[1]) / det,
        (e * W[1] - b * W[2]) / det,
        (a * W[1] - c * W[0]) / det,
        (a * W[2] - c * W[1]) / det,
    )


def velocity_under_torque(H, v, u, links, tau, f, d):
    """Handle velocity after a kick under given motor torques.

    Args:
        H: length of the kick [s].
        v: handle velocity before the kick, (x, y) [m/s].
        u: from `arm.jacobian` [m].
        links: of the arm, as `Arm.links`.
        tau: motor torques, (shoulder, elbow) [N.m].
        f: hand force without the velocity after the kick, (x, y) [N].
        d: resisting force per unit of that velocity, (x, y) [N.s/m].

    Returns:
        (ux, uy) [m/s].
    """
    vx, vy = v
    t1, t2 = tau
    ax, ay = arm.handle_velocity((t1 - t2) / links[2], t2 / links[3], u)
    n = 1.0 / H
    W = arm.mobility(u, links)
    ux, uy = solve_velocity((n, n), (n * vx + ax, n * vy + ay), W, f, d)
    return ux, uy


def kick_at_limit(H, v, u, links, f, d, tau, limit):
    """The kick under torques that the limits of the motors cut.

    Args:
        H: length of the kick [s].
        v: handle velocity before the kick, (x, y) [m/s].
        u: from `arm.jacobian` [m].
        links: of the arm, as `Arm.links`.
        f: as in `solve_velocity` [N].
        d: as in `solve_velocity` [N.s/m].
        tau: torques that the servo asks for, (shoulder, elbow) [N.m].
        limit: torque limits, (shoulder, elbow) [N.m].

    Returns:
        (ux, uy, g1, g2, ffx, ffy, t1, t2): velocity after the kick [m/s], link accelerations
        [rad/s^2], net hand force [N], motor torques [N.m].
    """
    vx, vy = v
    fx, fy = f
    dx, dy = d
    t1 = min(max(tau[0], -limit[0]), limit[0])
    t2 = min(max(tau[1], -limit[1]), limit[1])
    ux, uy = velocity_under_torque(H, v, u, links, (t1, t2), f, d)
    ffx = fx - dx * ux
    ffy = fy - dy * uy
    g1, g2 = arm.joint_velocity(ux - vx, uy - vy, u, H)
    return ux, uy, g1, g2, ffx, ffy, t1, t2


def turned_kick_at_limit(H, v, u, links, f, d, tau, limit):
    """As `kick_at_limit`, against a damping tensor: worked out along its principal axes.

    Args:
        H: length of the kick [s].
        v: handle velocity before the kick, (x, y) [m/s].
        u: from `arm.jacobian` [m].
        links: of the arm, as `Arm.links`.
        f: as in `solve_velocity` [N].
        d: resisting force per unit of the velocity after the kick, (xx, yy, xy) [N.s/m].
        tau: torques that the servo asks for, (shoulder, elbow) [N.m].
        limit: torque limits, (shoulder, elbow) [N.m].

    Returns:
        As `kick_at_limit`.
    """
    angle = 0.5 * math.atan2(2.0 * d[2], d[0] - d[1])
    c, s = math.cos(angle), math.sin(angle)
    first = c * c * d[0] + 2.0 * c * s * d[2] + s * s * d[1]
    second = s * s * d[0] - 2.0 * c * s * d[2] + c * c * d[1]
    u1, u2 = along_axes(c, s, u[0], u[1]), along_axes(c, s, u[2], u[3])
    ux, uy, g1, g2, fx, fy, t1, t2 = kick_at_limit(
        H, along_axes(c, s, v[0], v[1]), (u1[0], u1[1], u2[0], u2[1]), links,
        along_axes(c, s, f[0], f[1]), (first, second), tau, limit,
    )  # fmt: skip
    ux, uy = along_axes(c, -s, ux, uy)
    fx, fy = along_axes(c, -s, fx, fy)
    return ux, uy, g1, g2, fx, fy, t1, t2


def along_axes(c, s, x, y):
    """Components of a vector along axes that are turned.

    Args:
        c: cosine of the angle by which they are turned.
        s: sine of that angle.
        x: component along x.
        y: component along y.

    Returns:
        (along the first axis, along the second).
    """
    return c * x + s * y, c * y - s * x


def compensator_coefficients(damping: float, H: float, L: float, R: float) -> tuple[float, float]:
    """Coefficients (keep, take) of one kick of v' = -damping v + drive: v+ = keep v- + take drive.

    Trapezoidal in the damping and exact in total impulse, for any length and any split.

    Args:
        damping: rate of decay [1/s].
        H: length of the kick [s].
        L: share of the kick before the sample.
        R: share of the kick after the sample.

    Returns:
        (keep, take): dimensionless, and [s].
    """
    n = 1.0 / H + damping * R
    return (1.0 / H - damping * L) / n, 1.0 / n


def feedback_vector(servo: Servo) -> np.ndarray:
    """Servo acceleration of the law above, without forces, as a row over the state of one axis.

    Args:
        servo: of the axis.

    Returns:
        Shape (6,): p'' = feedback @ (p, p', delta, delta', y, y').
    """
    g, s = servo.G, servo.S
    reference = [g.gain, 0.0, s.stiffness - g.stiffness, s.damping - g.damping]
    return np.array([-s.stiffness, -s.damping, *reference])


def controller_matrices(
    servo: Servo, compensator: Compensator, K: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Compensator and reference model in continuous time: z' = A z + B f, f the net force [N].

    Args:
        servo: of the axis.
        compensator: shape of C, of order n.
        K: gain of the compensator, or gains, shape (m,).

    Returns:
        A, shape (n + 2, n + 2), and B, shape (n + 2,) or (m, n + 2); z holds the states of
        `Compensator.state_space`, with K in its input, then y = G delta and y'. As printed, the
        states of the compensator are delta and delta'.
    """
    g, n = servo.G, compensator.order
    own, drive, out, through = compensator.state_space()
    A, unit = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    A[:n, :n], A[n, n + 1] = own, 1.0
    A[n + 1, :n], A[n + 1, n:] = g.gain * out, (-g.stiffness, -g.damping)
    unit[:n], unit[n + 1] = drive, g.gain * through
    return A, np.multiply.outer(K, unit)


def held_compensator(
    servo: Servo, compensator: Compensator, K: Any, T: float
) -> tuple[np.ndarray, np.ndarray]:
    """Compensator and reference model over a sample in which the net force is held: z+ = A z + B f.

    Exact, by a matrix exponential (Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed.).

    Args:
        servo: of the axis.
        compensator: shape of C, of order n.
        K: gain of the compensator, or gains, shape (m,).
        T: length of the sample [s].

    Returns:
        A, shape (n + 2, n + 2), and B, shape (n + 2,), or one of each a gain, shapes (m, n + 2,
        n + 2) and (m, n + 2); z as in `controller_matrices`.
    """
    A, B = controller_matrices(servo, compensator, K)
    n = B.shape[-1]
    m = np.zeros((*B.shape[:-1], n + 1, n + 1))
    m[..., :n, :n], m[..., :n, n] = A, B
    e = matrix_exponential(T * m)
    return e[..., :n, :n], e[..., :n, n]


def matrix_exponential(a: np.ndarray) -> np.ndarray:
    """Matrix exponential.

    Args:
        a: shape (n, n), or a stack of such, shape (m, n, n).

    Returns:
        As a.
    """
    from scipy.linalg import expm

    return expm(a)
