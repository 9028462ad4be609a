"""The two-degree-of-freedom servo that realises G and Sh together (Eqs. 15-18).

Feedback alone sets Sh; a reference model y = G delta with its acceleration fed forward sets G:

    p'' = y'' + kd (y' - v) + kp (y - p) + W f        f = fh - fe

in operational space, W = Lambda(q)^-1; inertia shaping replaces W by its value at the nominal
pose. The functions below are one kick of that law (docs/equations.md, section 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.polynomial import Polynomial

from ..errors import Bound, check_fields, choice
from . import arm
from .constants import AXES, C_POLE, G, S, SecondOrder


def servo_coefficients(
    g: SecondOrder, s: SecondOrder, H: float, L: float, R: float
) -> tuple[float, float, float, float, float]:
    """Coefficients of one axis of the servo in one kick.

    Args:
        g: closed position loop G (Eqs. 15, 16).
        s: sensitivity Sh (Eqs. 17, 18).
        H: length of the kick [s].
        L: share of the kick before the sample.
        R: share of the kick after the sample.

    Returns:
        (keep, take, after, before, spring): the first two of the reference model, as in
        `compensator_coefficients`; the others of the handle, as in `servo_acceleration`.
    """
    keep, take = compensator_coefficients(g.damping, H, L, R)
    return keep, take * g.stiffness, 1.0 / H + s.damping * R, 1.0 / H - s.damping * L, s.stiffness


def servo_acceleration(after, before, spring, yd1, yd0, v, y, p, c):  # noqa: PLR0913  # of one axis
    """Acceleration of one axis in a kick without forces and without the velocity after it [m/s^2].

    Args:
        after: weight of the rate after the kick [1/s], from `servo_coefficients`.
        before: weight of the rate before the kick [1/s], from `servo_coefficients`.
        spring: stiffness of Sh [1/s^2], from `servo_coefficients`.
        yd1: rate of the reference model after the kick [m/s].
        yd0: rate of the reference model before the kick [m/s].
        v: handle velocity before the kick [m/s].
        y: reference position [m].
        p: handle position [m].
        c: centripetal acceleration, towards the centre [m/s^2].

    Returns:
        The acceleration [m/s^2].
    """
    return after * yd1 + before * (v - yd0) + spring * (y - p) + c


def feedback_law(g, s, delta, y, yd, p, v, c):
    """Servo acceleration of one axis at an instant, without forces; `feedback_vector` as a law.

    Args:
        g: closed position loop G (Eqs. 15, 16).
        s: sensitivity Sh (Eqs. 17, 18).
        delta: compensator output [m].
        y: reference position [m].
        yd: reference velocity [m/s].
        p: handle position [m].
        v: handle velocity [m/s].
        c: centripetal acceleration, towards the centre [m/s^2].

    Returns:
        (acceleration of the handle, acceleration of the reference) [m/s^2].
    """
    ydd = g.stiffness * (delta - y) - g.damping * yd
    # a kick of one second from rest, in which the velocity after it is the acceleration
    a = servo_acceleration(1.0, -s.damping, s.stiffness, ydd, yd, v, y, p, c)
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


def velocity_under_torque(H, v, u, tau, f, d):
    """Handle velocity after a kick under given motor torques.

    Args:
        H: length of the kick [s].
        v: handle velocity before the kick, (x, y) [m/s].
        u: from `arm.jacobian` [m].
        tau: motor torques, (shoulder, elbow) [N.m].
        f: hand force without the velocity after the kick, (x, y) [N].
        d: resisting force per unit of that velocity, (x, y) [N.s/m].

    Returns:
        (ux, uy) [m/s].
    """
    vx, vy = v
    t1, t2 = tau
    ax, ay = arm.handle_velocity((t1 - t2) / arm.I1, t2 / arm.I2, u)
    n = 1.0 / H
    W = arm.mobility(u)
    ux, uy = solve_velocity((n, n), (n * vx + ax, n * vy + ay), W, f, d)
    return ux, uy


def kick_at_limit(H, v, u, f, d, tau, limit):
    """The kick under torques that the limits of the motors cut.

    Args:
        H: length of the kick [s].
        v: handle velocity before the kick, (x, y) [m/s].
        u: from `arm.jacobian` [m].
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
    ux, uy = velocity_under_torque(H, v, u, (t1, t2), f, d)
    ffx = fx - dx * ux
    ffy = fy - dy * uy
    g1, g2 = arm.joint_velocity(ux - vx, uy - vy, u, H)
    return ux, uy, g1, g2, ffx, ffy, t1, t2


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


def feedback_vector(axis: str) -> np.ndarray:
    """Servo acceleration of the law above, without forces, as a row over the state of one axis.

    Args:
        axis: "x" or "y".

    Returns:
        Shape (6,): p'' = feedback @ (p, p', delta, delta', y, y').
    """
    i = AXES.index(choice("axis", axis, AXES))
    g, s = G[i], S[i]
    reference = [g.gain, 0.0, s.stiffness - g.stiffness, s.damping - g.damping]
    return np.array([-s.stiffness, -s.damping, *reference])


def controller_matrices(axis: str, K: float) -> tuple[np.ndarray, np.ndarray]:
    """Compensator and reference model in continuous time: z' = A z + B f, f the net force [N].

    Args:
        axis: "x" or "y".
        K: gain of the compensator.

    Returns:
        A, shape (4, 4), and B, shape (4,), with z = (delta, delta', y, y') and y = G delta.
    """
    g = G[AXES.index(choice("axis", axis, AXES))]
    A, B = np.zeros((4, 4)), np.zeros(4)
    A[0, 1] = A[2, 3] = 1.0
    A[1, 1], B[1] = -PRINTED.pole, K
    A[3] = g.gain, 0.0, -g.stiffness, -g.damping
    return A, B


def held_compensator(axis: str, K: float, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Compensator and reference model over a sample in which the net force is held: z+ = A z + B f.

    Exact, by a matrix exponential (Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed.).

    Args:
        axis: "x" or "y".
        K: gain of the compensator.
        T: length of the sample [s].

    Returns:
        A, shape (4, 4), and B, shape (4,); z as in `controller_matrices`.
    """
    m = np.zeros((5, 5))
    m[:4, :4], m[:4, 4] = controller_matrices(axis, K)
    e = matrix_exponential(T * m)
    return e[:4, :4], e[:4, 4]


def matrix_exponential(a: np.ndarray) -> np.ndarray:
    """Matrix exponential.

    Args:
        a: shape (n, n).

    Returns:
        Shape (n, n).
    """
    from scipy.linalg import expm

    return expm(a)


@dataclass(frozen=True)
class Compensator:
    """Shape of the compensator: C = K (s + zero)/(s (s + pole)), or K/(s (s + pole)) with no zero.

    Attributes:
        pole: its pole [rad/s], > 0; as printed 10 (Eqs. 20, 22, 27).
        zero: its zero [rad/s], > 0, a lead if below the pole; None for none.
    """

    pole: Annotated[float, Bound(0.0, unit="rad/s", above=True)] = C_POLE
    zero: Annotated[float | None, Bound(0.0, unit="rad/s", above=True)] = None

    def __post_init__(self):
        check_fields(self, "compensator.")

    @property
    def fraction(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of C/K in s."""
        numerator = Polynomial([1.0] if self.zero is None else [self.zero, 1.0])
        return numerator, Polynomial([0.0, self.pole, 1.0])


PRINTED = Compensator()
