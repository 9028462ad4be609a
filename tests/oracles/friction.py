"""Bodies under friction: Moreau's time stepping, a smooth solution where nothing stops, and sliders
in closed form. Nothing here is taken from the package.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq


def moreau(B, v, end, law, steps, along=False):
    """Velocity at the end of v' = (end - v) - B f, f in the law's set, by implicit Euler steps.

    Args:
        B: (xx, xy, yx, yy).
        v: velocity at the begin, shape (2,).
        end: that at the end without f, shape (2,).
        law: Fy, K, n of x and of y.
        steps: how many.
        along: whether f is along the velocity; B then is a number times the identity.
    """
    B, v, d = np.reshape(B, (2, 2)), np.array(v, float), np.subtract(end, v)
    f = np.zeros(2)
    for _ in range(steps):
        if along:
            w, g = v + d / steps, B[0, 0] / steps
            size = math.hypot(*w)
            v = w * max(size - g * law[0], 0.0) / size if size else w
            continue
        for _ in range(200):
            before = f.copy()
            for i in (0, 1):
                w = v[i] + (d[i] - B[i, 1 - i] * f[1 - i]) / steps
                g, Fy = B[i, i] / steps, law[3 * i]
                f[i] = w / g if abs(w) <= g * Fy else math.copysign(Fy, w)
            if np.abs(f - before).max() < 1e-13:
                break
        v = v + (d - B @ f) / steps
    return v


def sliding(B, v, end, law, along=False):
    """As `moreau`, where nothing stops: by DOP853 to 1e-13, with the power law."""
    B, d = np.reshape(B, (2, 2)), np.subtract(end, v)

    def rate(_, u):
        if along:
            m = math.hypot(*u)
            f = (law[0] + law[1] * m ** law[2]) * u / m
        else:
            f = np.array(
                [np.sign(u[i]) * (law[3 * i] + law[3 * i + 1] * abs(u[i]) ** law[3 * i + 2])
                 for i in (0, 1)]
            )  # fmt: skip
        return d - B @ f

    return solve_ivp(rate, (0.0, 1.0), v, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


def stop(m, v0, Fy, K, n, b):
    """Time [s] and way [m] in which m v' = -(Fy + K v^n) - b v comes to rest from v0.

    In closed form where there is one; else by quadrature of the same.
    """
    if K == 0.0 and b == 0.0:
        return m * v0 / Fy, m * v0**2 / (2.0 * Fy)
    if K == 0.0:
        ln = math.log(1.0 + b * v0 / Fy)
        return m / b * ln, m * v0 / b - m * Fy / b**2 * ln
    if Fy == 0.0 and b == 0.0:
        return m * v0 ** (1.0 - n) / (K * (1.0 - n)), m * v0 ** (2.0 - n) / (K * (2.0 - n))
    # v = u^p makes the integrands smooth at rest
    p = 4.0

    def over(u, k):
        v = u**p
        return m * v**k / (Fy + K * v**n + b * v) * p * u ** (p - 1.0)

    top = v0 ** (1.0 / p)
    t, x = (quad(over, 0.0, top, args=(k,), epsabs=1e-15, epsrel=1e-13)[0] for k in (0, 1))
    return t, x


def spring_turns(m, k, Fy, x0):
    """Turning points of m x'' = -k x - Fy sign x' from rest at x0, the last where it sticks [m]."""
    out = [x0]
    while abs(out[-1]) * k > Fy:
        x = out[-1]
        out.append(-x + math.copysign(2.0 * Fy / k, x))
    return out


def bingham_passage(m, v0, Fy, b, length):
    """Time [s] in which a slider crosses Bingham clay of a length that does not stop it, and its
    speed behind it [m/s]."""

    def place(t):
        e = math.exp(-b * t / m)
        return (v0 + Fy / b) * m / b * (1.0 - e) - Fy / b * t - length

    t = brentq(place, 0.0, stop(m, v0, Fy, 0.0, 1.0, b)[0], xtol=1e-15, rtol=1e-15)
    return t, (v0 + Fy / b) * math.exp(-b * t / m) - Fy / b
