"""The two-link arm and the printed numbers, typed again on purpose."""

import numpy as np

# Eqs. 15-20, Sec. 4
G0, G1 = np.array([910.19, 765.5]), np.array([41.8, 30.3])
SG, S1, S0 = np.array([0.7919, 0.131]), np.array([41.1, 32.4]), np.array([432.0, 492.46])
L1, L2, ORIGIN = 0.24, 0.35, np.array([0.25, 0.24])
I1, I2 = L1**2 / 0.7919, L2**2 / 0.131


class Arm:
    """The two-link arm in relative joint angles, from first principles."""

    M = np.array([[I1 + I2, I2], [I2, I2]])

    @staticmethod
    def forward(q):
        a = q[0] + q[1]
        return np.array([L1 * np.cos(q[0]) + L2 * np.cos(a), L1 * np.sin(q[0]) + L2 * np.sin(a)])

    @staticmethod
    def jacobian(q):  # Eq. 14
        s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q[0] + q[1]), np.cos(q[0] + q[1])
        return np.array([[-L1 * s1 - L2 * s12, -L2 * s12], [L1 * c1 + L2 * c12, L2 * c12]])

    @staticmethod
    def jacobian_rate(q, w):
        s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q[0] + q[1]), np.cos(q[0] + q[1])
        w12 = w[0] + w[1]
        return np.array(
            [
                [-L1 * c1 * w[0] - L2 * c12 * w12, -L2 * c12 * w12],
                [-L1 * s1 * w[0] - L2 * s12 * w12, -L2 * s12 * w12],
            ]
        )

    @staticmethod
    def start(p):
        x, y = ORIGIN + p
        q2 = -np.arccos((x * x + y * y - L1 * L1 - L2 * L2) / (2 * L1 * L2))
        return np.array([np.arctan2(y, x) - np.arctan2(L2 * np.sin(q2), L1 + L2 * np.cos(q2)), q2])
