"""The arm at its handle, in absolute link angles, for peers whose motors hold torques or whose clay
yields: plain functions on floats, which a decorator may compile.

The formulas are those of docs/equations.md (sections 2 and 3, without shaping).
"""

from __future__ import annotations

from math import cos, sin

from hapticclay.model.constants import G, S

from .common import I1, I2, L1, L2, Job


def kinematics(job: Job):
    """Return a function of link angles and rates: u1, u2, p, v, J' q' and W = (xx, xy, yy).

    u_i is the derivative of the handle's place by the angle of link i; all pairs but W.
    """
    ox, oy = job.origin

    def at(a1, a2, n1, n2):
        u1x, u1y, u2x, u2y = -L1 * sin(a1), L1 * cos(a1), -L2 * sin(a2), L2 * cos(a2)
        p = u1y + u2y - ox, -u1x - u2x - oy
        v = u1x * n1 + u2x * n2, u1y * n1 + u2y * n2
        c = -u1y * n1 * n1 - u2y * n2 * n2, u1x * n1 * n1 + u2x * n2 * n2
        W = (
            u1x * u1x / I1 + u2x * u2x / I2,
            u1x * u1y / I1 + u2x * u2y / I2,
            u1y * u1y / I1 + u2y * u2y / I2,
        )
        return (u1x, u1y), (u2x, u2y), p, v, c, W

    return at


def with_mass(job: Job):
    """Return a function of W and an acceleration without force: (1 + m W)^-1 of it."""
    m = job.th[0]

    def solve(W, x, y):
        a, b, d = 1.0 + m * W[0], m * W[1], 1.0 + m * W[2]
        n = a * d - b * b
        return (d * x - b * y) / n, (a * y - b * x) / n

    return solve


def servo(job: Job):
    """Return a function of p, v, delta, y, y': what the servo wants for p'', and y''; pairs."""
    (gx, gy), (sx, sy) = G, S
    g0x, g1x, g0y, g1y = gx.gain, gx.damping, gy.gain, gy.damping
    s0x, s1x, s0y, s1y = sx.stiffness, sx.damping, sy.stiffness, sy.damping

    def wants(p, v, d, y, r):
        ax, ay = g0x * (d[0] - y[0]) - g1x * r[0], g0y * (d[1] - y[1]) - g1y * r[1]
        wx = ax + s1x * (r[0] - v[0]) + s0x * (y[0] - p[0])
        wy = ay + s1y * (r[1] - v[1]) + s0y * (y[1] - p[1])
        return (wx, wy), (ax, ay)

    return wants


def plain(function):
    """The decorator that compiles nothing."""
    return function
