"""The paper's sampled controller as a law of the user's own, typed out from Eqs. 14 to 20.

One formula a line, in the order of docs/equations.md, so that its numbers are those of the
built-in controller to the last bit.
"""

from math import cos, sin

import numpy as np
from scipy.linalg import expm

L1, L2, OX, OY = 0.24, 0.35, 0.25, 0.24
G = ((910.19, 41.8), (765.5, 30.3))  # stiffness and damping
S = ((0.7919, 41.1, 432.0), (0.131, 32.4, 492.46))
I1, I2 = L1 * L1 / (79.19 * 1e-2), L2 * L2 / (13.1 * 1e-2)
W = L1 * L1 / I1 + L2 * L2 / I2


def memory(K, Ts):
    """Rows (A, B) of both axes: (delta, delta', y, y') a sample later, under a held force."""
    out = []
    for k, (stiffness, damping) in zip(K, G, strict=True):
        m = np.zeros((5, 5))
        m[0, 1] = m[2, 3] = 1.0
        m[1, 1], m[1, 4] = -10.0, k
        m[3, 0], m[3, 2], m[3, 3] = stiffness, -stiffness, -damping
        out += expm(Ts * m)[:4].ravel().tolist()
    return out


def paper(t, q, qd, fh, state, params):
    """One sample; params: begin and end of the clay [m], b [N.s/m], then `memory`."""
    return in_clay(q, qd, fh, state, params, 0.0, 0.0, 1.0, 3)


def paper_that_yields(t, q, qd, fh, state, params):
    """As `paper`, of clay that yields on each axis; params: begin, end, b, Fy, K, n, `memory`."""
    return in_clay(q, qd, fh, state, params, params[3], params[4], params[5], 6)


def resists(v, b, Fy, K, n):
    return b * v + (Fy + K * abs(v) ** n) * ((v > 0.0) - (v < 0.0))


def in_clay(q, qd, fh, state, params, Fy, K, n, at):  # noqa: PLR0913  # a case, spelt out
    a = q[0] + q[1]
    u1x, u1y, u2x, u2y = -L1 * sin(q[0]), L1 * cos(q[0]), -L2 * sin(a), L2 * cos(a)
    px, py = u1y + u2y - OX, -OY - u1x - u2x
    r1, r2 = qd[0], qd[0] + qd[1]
    vx, vy = u1x * r1 + u2x * r2, u1y * r1 + u2y * r2
    cx, cy = u1y * (r1 * r1) + u2y * (r2 * r2), -u1x * (r1 * r1) - u2x * (r2 * r2)
    b = params[2] if params[0] <= px < params[1] else 0.0
    fex, fey = b * vx, b * vy
    if b:
        fex, fey = resists(vx, b, Fy, K, n), resists(vy, b, Fy, K, n)
    fx, fy = fh[0] - fex, fh[1] - fey
    ax = servo(state[0], state[2], state[3], px, vx, cx, G[0][0], G[0][1], S[0][1], S[0][2])
    ay = servo(state[4], state[6], state[7], py, vy, cy, G[1][0], G[1][1], S[1][1], S[1][2])
    wxx = u1x * (u1x / I1) + u2x * (u2x / I2)
    wxy = u1y * (u1x / I1) + u2y * (u2x / I2)
    ux, uy = ax + wxx * fx + wxy * fy, ay + wxy * fx + (W - wxx) * fy
    det = u1x * u2y - u2x * u1y
    t2 = I2 * ((uy * u1x - ux * u1y) / det) - u2x * fx - u2y * fy
    t1 = I1 * ((ux * u2y - uy * u2x) / det) - u1x * fx - u1y * fy + t2
    p2 = u2x * fex + u2y * fey
    p1 = u1x * fex + u1y * fey + p2
    x = after(state[0], state[1], state[2], state[3], fx, params, at)
    y = after(state[4], state[5], state[6], state[7], fy, params, at + 20)
    return (t1 - p1, t2 - p2), x + y


def servo(delta, y, yd, p, v, c, g0, g1, s1, s0):  # noqa: PLR0913  # one axis, spelt out
    ydd = g0 * (delta - y) - g1 * yd
    return ydd - s1 * (v - yd) + s0 * (y - p) + c


def after(a, b, c, d, f, m, n):
    return (
        m[n] * a + m[n + 1] * b + m[n + 2] * c + m[n + 3] * d + m[n + 4] * f,
        m[n + 5] * a + m[n + 6] * b + m[n + 7] * c + m[n + 8] * d + m[n + 9] * f,
        m[n + 10] * a + m[n + 11] * b + m[n + 12] * c + m[n + 13] * d + m[n + 14] * f,
        m[n + 15] * a + m[n + 16] * b + m[n + 17] * c + m[n + 18] * d + m[n + 19] * f,
    )
