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

from ..errors import Bound, check_fields, choice
from . import arm
from .constants import AXES, C_POLE, G, SecondOrder


def servo_coefficients(
    g: SecondOrder, s: SecondOrder, H: float, L: float, R: float
) -> tuple[float, float, float, float, float]:
    """Coefficients of one axis in one kick: (keep, take) of the reference model, (after, before,
    spring) of the handle.

    Args:
        g, s: closed position loop G (Eqs. 15, 16) and sensitivity Sh (Eqs. 17, 18).
        H: length of the kick [s]. L, R: its shares before and after the sample.
    """
    keep, take = compensator_coefficients(g.damping, H, L, R)
    return keep, take * g.stiffness, 1.0 / H + s.damping * R, 1.0 / H - s.damping * L, s.stiffness


def servo_acceleration(
    after: float,
    before: float,
    spring: float,
    yd1: float,
    yd0: float,
    v: float,
    y: float,
    p: float,
    c: float,
) -> float:
    """Acceleration of one axis in a kick before any force and without its outcome [m/s^2].

    Args:
        after, before, spring: from `kick`.
        yd1, yd0: rate of the reference model after and before [m/s]. v: handle velocity before [m/s].
        y, p: reference and handle position [m]. c: its centripetal acceleration, towards the
            centre [m/s^2].
    """
    return after * yd1 + before * (v - yd0) + spring * (y - p) + c


def solve_velocity(
    nx: float, ny: float, ax: float, ay: float, sxx: float, sxy: float, syy: float,
    fx: float, fy: float, dx: float, dy: float,
) -> tuple[float, float]:  # fmt: skip
    """Solves n u = a + S (f - d u) for the handle velocity u after the kick.

    Args:
        nx, ny: the servo's own weight of u [1/s]. ax, ay: from `servo_acceleration` [m/s^2].
        sxx, sxy, syy: acceleration per unit of net hand force [1/kg].
        fx, fy: net hand force without u [N]. dx, dy: force per unit of u, resisting [N.s/m].

    Returns:
        (ux, uy) [m/s].
    """
    gx = ax + sxx * fx + sxy * fy
    gy = ay + sxy * fx + syy * fy
    if dx or dy:
        a = nx + sxx * dx
        b = sxy * dy
        r = sxy * dx / a
        uy = (gy - r * gx) / (ny + syy * dy - r * b)
        ux = (gx - b * uy) / a
    else:
        ux = gx / nx
        uy = gy / ny
    return ux, uy


def velocity_under_torque(
    H: float, vx: float, vy: float, u1x: float, u1y: float, u2x: float, u2y: float,
    t1: float, t2: float, fx: float, fy: float, dx: float, dy: float,
) -> tuple[float, float]:  # fmt: skip
    """Handle velocity after a kick of length H under given motor torques t1, t2 [N.m]; the rest as in `solve_velocity`."""
    a1 = (t1 - t2) / arm.I1
    a2 = t2 / arm.I2
    ax, ay = arm.handle_velocity(a1, a2, u1x, u1y, u2x, u2y)
    sxx, sxy, syy = arm.mobility(u1x, u1y, u2x, u2y)
    n = 1.0 / H
    ux, uy = solve_velocity(n, n, n * vx + ax, n * vy + ay, sxx, sxy, syy, fx, fy, dx, dy)
    return ux, uy


def saturated_step(
    H: float, vx: float, vy: float, u1x: float, u1y: float, u2x: float, u2y: float,
    nx: float, ny: float, ax: float, ay: float, sxx: float, sxy: float, syy: float,
    fx: float, fy: float, dx: float, dy: float, limit1: float, limit2: float, square1: float, square2: float,
) -> tuple[float, float, float, float, float, float, float, float]:  # fmt: skip
    """The kick that the servo wants, as far as the motors can give it.

    Args:
        H: length of the kick [s]. vx, vy: handle velocity before [m/s]. u1, u2: arm.jacobian [m].
        nx .. dy: as in `solve_velocity`.
        limit1, limit2, square1, square2: torque limits [N.m] and their squares.

    Returns:
        (ux, uy, g1, g2, ffx, ffy, t1, t2): velocity after [m/s], link accelerations [rad/s^2], net
        hand force [N], motor torques [N.m].
    """
    ux, uy = solve_velocity(nx, ny, ax, ay, sxx, sxy, syy, fx, fy, dx, dy)
    ffx = fx - dx * ux
    ffy = fy - dy * uy
    g1, g2 = arm.joint_velocity(ux - vx, uy - vy, u1x, u1y, u2x, u2y, H)
    t2 = arm.I2 * g2 - u2x * ffx - u2y * ffy
    t1 = arm.I1 * g1 - u1x * ffx - u1y * ffy + t2
    if t1 * t1 > square1 or t2 * t2 > square2:
        t1 = min(max(t1, -limit1), limit1)
        t2 = min(max(t2, -limit2), limit2)
        ux, uy = velocity_under_torque(H, vx, vy, u1x, u1y, u2x, u2y, t1, t2, fx, fy, dx, dy)
        ffx = fx - dx * ux
        ffy = fy - dy * uy
        g1, g2 = arm.joint_velocity(ux - vx, uy - vy, u1x, u1y, u2x, u2y, H)
    return ux, uy, g1, g2, ffx, ffy, t1, t2


def compensator_coefficients(damping: float, H: float, L: float, R: float) -> tuple[float, float]:
    """Coefficients (keep, take) of one kick of v' = -damping v + drive: v+ = keep v- + take drive.

    Trapezoidal in the damping, exact in total impulse: any length, any split.

    Args:
        damping: [1/s]. H: length of the kick [s]. L, R: its shares before and after the sample.
    """
    n = 1.0 / H + damping * R
    return (1.0 / H - damping * L) / n, 1.0 / n


def held_compensator(axis: str, K: float, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Compensator and reference model over a sample T [s] in which the force f is held: z+ = A z + B f, exactly.

    z = (delta, delta', y, y'), y = G delta (matrix exponential; Astrom, Wittenmark, Computer-Controlled Systems).

    Returns:
        A, shape (4, 4), and B, shape (4,).
    """
    g = G[AXES.index(choice("axis", axis, AXES))]
    m = np.zeros((5, 5))
    m[0, 1] = m[2, 3] = 1.0
    m[1, 1], m[1, 4] = -C_POLE, K
    m[3] = [g.stiffness, 0.0, -g.stiffness, -g.damping, 0.0]
    e = matrix_exponential(T * m)
    return e[:4, :4], e[:4, 4]


def matrix_exponential(a: np.ndarray) -> np.ndarray:
    """Matrix exponential of a, shape (n, n)."""
    from scipy.linalg import expm

    return expm(a)


@dataclass(frozen=True)
class Compensator:
    """Shape of the compensator but its gain: C = K (s + zero)/(s (s + pole)); zero None: K/(s (s + pole)).

    Attributes:
        pole: its pole [rad/s], > 0; as printed 10 (Eqs. 20, 22, 27).
        zero: its zero [rad/s], > 0, a lead if below the pole; None for none.
    """

    pole: Annotated[float, Bound(0.0, unit="rad/s", above=True)] = C_POLE
    zero: Annotated[float | None, Bound(0.0, unit="rad/s", above=True)] = None

    def __post_init__(self):
        check_fields(self, "compensator.")

    @property
    def fraction(self) -> tuple[np.ndarray, np.ndarray]:
        """Numerator and denominator of C/K."""
        return np.array([1.0] if self.zero is None else [1.0, self.zero]), np.array(
            [1.0, self.pole, 0.0]
        )


PRINTED = Compensator()
