"""The arm in joint space within the paper's loop: its right-hand side for SciPy."""

import numpy as np

from .arm import G0, G1, ORIGIN, S0, S1, SG, Arm


def arm_loop(K, uh, th=None, inertia_shaping=False):
    """Rates of z = (q, w, delta, delta', y, y'), x and y of each, as a function of z and the clay.

    The clay is a function of p and v that gives fe.
    """
    K, uh, (m, d, k) = np.array(K), np.array(uh), th or (0.0, 0.0, 0.0)

    def rates(z, clay):
        q, w, delta, rate, y, yr = z.reshape(6, 2)
        J, Jd = Arm.jacobian(q), Arm.jacobian_rate(q, w)
        p, v, c = Arm.forward(q) - ORIGIN, J @ w, Jd @ w
        W = J @ np.linalg.solve(Arm.M, J.T)
        y2 = G0 * (delta - y) - G1 * yr
        want = y2 + S1 * (yr - v) + S0 * (y - p)
        S = np.diag(SG) if inertia_shaping else W
        # p'' = want + S f,  f = uh - m p'' - d v - k p - fe
        rest = uh - d * v - k * p - clay(p, v)
        acc = np.linalg.solve(np.eye(2) + m * S, want + S @ rest)
        f = rest - m * acc
        tau = J.T @ np.linalg.solve(W, want - c + (S - W) @ f)
        wd = np.linalg.solve(Arm.M, tau + J.T @ f)
        return np.concatenate((w, wd, rate, K * f - 10 * rate, yr, y2))

    return rates
