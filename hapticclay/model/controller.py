"""The two-degree-of-freedom servo that realises G and Sh together (Eqs. 15-18).

Feedback alone sets Sh; a reference model y = G delta with its acceleration fed forward sets G:

    p'' = y'' + kd (y' - v) + kp (y - p) + W f        f = fh - fe

in operational space, W = Lambda(q)^-1; inertia shaping replaces W by its value at the nominal
pose. One kick of that law is in `kernel.servo`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import part
from .compensator import Compensator
from .constants import G, S, SecondOrder
from .traits import Trait


@part("servo.")
class Servo:
    """The servo of one axis: its response to the commanded displacement and to the hand's force.

    Attributes:
        G: closed position loop, handle over compensator output [1/s^2 in its gain] (Eqs. 15, 16).
        S: sensitivity Sh, handle over net hand force (Eqs. 17, 18). Its gain [1/kg] is imposed
            where inertia is shaped; else the handle has that of the arm.
    """

    G: SecondOrder
    S: SecondOrder

    @property
    def numbers(self) -> tuple[float, float, float, float, float, float]:
        """Static gain, damping and stiffness of G; gain, damping and stiffness of Sh."""
        g, s = self.G, self.S
        return g.gain / g.stiffness, g.damping, g.stiffness, s.gain, s.damping, s.stiffness


SERVO = (Servo(G[0], S[0]), Servo(G[1], S[1]))  # as printed, of x and y


def feedback_vector(servo: Servo) -> np.ndarray:
    """The row of p'' over (p, p', delta, delta', y, y') of an axis, without forces."""
    g, s = servo.G, servo.S
    reference = [g.gain, 0.0, s.stiffness - g.stiffness, s.damping - g.damping]
    return np.array([-s.stiffness, -s.damping, *reference])


def controller_matrices(
    servo: Servo, compensator: Compensator, K: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Compensator and reference model in continuous time: z' = A z + B f, f the net force [N].

    z holds the states of `Compensator.state_space`, with K (or gains, (m,)) in its input, y and y'.
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
    """As `controller_matrices`, over a sample T [s] under held net force: z+ = A z + B f, exact.

    Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed.
    """
    A, B = controller_matrices(servo, compensator, K)
    n = B.shape[-1]
    m = np.zeros((*B.shape[:-1], n + 1, n + 1))
    m[..., :n, :n], m[..., :n, n] = A, B
    e = matrix_exponential(T * m)
    return e[..., :n, :n], e[..., :n, n]


def matrix_exponential(a: np.ndarray) -> np.ndarray:
    """Of one matrix or a stack of them."""
    from scipy.linalg import expm

    return expm(a)


TRAITS = (Trait("inertia shaping", "part", lambda s: s.inertia_shaping),)
