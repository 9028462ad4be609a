"""Two links of any lengths and inertias, from first principles, in relative joint angles."""

import numpy as np


class Links:
    """The arm of these numbers [m, kg.m^2]; link 2 is balanced about the elbow."""

    def __init__(self, l1, l2, I1, I2):
        self.l1, self.l2 = l1, l2
        self.M = np.array([[I1 + I2, I2], [I2, I2]])

    def forward(self, q):
        """Handle position [m]."""
        reach = self.l1 * np.exp(1j * q[0]) + self.l2 * np.exp(1j * (q[0] + q[1]))
        return np.array([reach.real, reach.imag])

    def jacobian(self, q):
        """Its derivative by the joint angles [m]: a turn about a joint is a quarter turn of the arm
        beyond it."""
        beyond = 1j * self.l2 * np.exp(1j * (q[0] + q[1]))
        whole = 1j * self.l1 * np.exp(1j * q[0]) + beyond
        return np.array([[whole.real, beyond.real], [whole.imag, beyond.imag]])

    def mobility(self, q):
        """J M^-1 J' [1/kg]."""
        J = self.jacobian(q)
        return J @ np.linalg.solve(self.M, J.T)
