"""The two-degree-of-freedom servo that realises G and Sh together (Eqs. 15-18).

Feedback alone sets Sh; a reference model y = G delta with its acceleration fed forward sets G:

    p'' = y'' + kd (y' - v) + kp (y - p) + W f        f = fh - fe

in operational space, W = Lambda(q)^-1; inertia shaping replaces W by its value at the nominal
pose. The functions below are one kick of that law (docs/equations.md, section 4).
"""

from __future__ import annotations

from . import lti
from .params import SecondOrder


def kick(g: SecondOrder, s: SecondOrder, H: float, L: float, R: float) -> tuple[float, float, float, float, float]:
    """Coefficients of one axis in one kick: (keep, take) of the reference model, (after, before,
    spring) of the handle.

    Args:
        g, s: closed position loop G (Eqs. 15, 16) and sensitivity Sh (Eqs. 17, 18).
        H: length of the kick [s]. L, R: its shares before and after the sample.
    """
    keep, take = lti.kick(g.damping, H, L, R)
    return keep, take * g.stiffness, 1.0 / H + s.damping * R, 1.0 / H - s.damping * L, s.stiffness


def acceleration(
    after: float, before: float, spring: float, yd1: float, yd0: float, v: float, y: float, p: float, c: float
) -> float:
    """Acceleration of one axis in a kick before any force and without its outcome [m/s^2].

    Args:
        after, before, spring: from `kick`.
        yd1, yd0: rate of the reference model after and before [m/s]. v: handle velocity before [m/s].
        y, p: reference and handle position [m]. c: its centripetal acceleration, towards the
            centre [m/s^2].
    """
    return after * yd1 + before * (v - yd0) + spring * (y - p) + c


def outcome(
    nx: float, ny: float, ax: float, ay: float, sxx: float, sxy: float, syy: float,
    fx: float, fy: float, dx: float, dy: float,
) -> tuple[float, float]:  # fmt: skip
    """Solves n u = a + S (f - d u) for the handle velocity u after the kick.

    Args:
        nx, ny: the servo's own weight of u [1/s]. ax, ay: from `acceleration` [m/s^2].
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
