"""The linear blocks of the loop (Fig. 2) as polynomials, and their exact closed loop.

Polynomials in s are NumPy coefficient arrays, highest power first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import choice, number
from ..model.constants import AXES, C_POLE, G, S
from ..model.controller import PRINTED, Compensator
from ..model.operator import NO_HAND, Operator


def steady_speed(K: float, f: float, b: Any) -> Any:
    """Speed under a constant hand force f [N] in clay b [N.s/m], a float or an array: K f/(10 + K b) [m/s].

    The compensator's damper and the clay carry the force together: f = (10/K + b) v (Eqs. 20, 21).
    """
    return K * f / (C_POLE + K * b)


def characteristic(
    axis: str,
    K: float,
    b: float,
    operator: Operator | None = None,
    compensator: Compensator = PRINTED,
) -> np.ndarray:
    """Closed-loop polynomial of 1 + (G C + Sh)(Te + Th), the denominator of Eq. 8.

    Args:
        axis: "x" or "y". K: compensator gain. b: clay [N.s/m]. operator: Th; None for Th = 0.
        compensator: shape of C.

    Returns:
        Coefficients, shape (7,), highest power first.

    Raises:
        ParameterError: unknown axis, or K or b not finite and >= 0.
    """
    blank, passive, driven = loop_polynomials(axis, b, operator, compensator)
    return np.polyadd(np.polyadd(blank, passive), number("K", K, 0.0) * driven)


def loop_polynomials(
    axis: str, b: float, operator: Operator | None = None, compensator: Compensator = PRINTED
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The closed-loop polynomial falls into blank + passive + K driven.

    blank is the common denominator of G, C and Sh, so L = (G C + Sh)(Te + Th) is (passive + K driven)/blank.

    Args:
        axis: "x" or "y". b: clay [N.s/m]. operator: Th; None for Th = 0. compensator: shape of C.

    Raises:
        ParameterError: unknown axis, or b not finite and >= 0.
    """
    i = AXES.index(choice("axis", axis, AXES))
    n, c = compensator.fraction
    s = np.array([1.0, S[i].damping, S[i].stiffness])
    t = environment_polynomial(b, operator)
    cg = np.convolve(c, [1.0, G[i].damping, G[i].stiffness])
    return (
        np.convolve(cg, s),
        S[i].gain * np.convolve(cg, t),
        G[i].gain * np.convolve(np.convolve(n, s), t),
    )


def device_admittance(
    axis: str, K: float, compensator: Compensator = PRINTED
) -> tuple[np.ndarray, np.ndarray]:
    """What the handle shows to any impedance: G C + Sh as (numerator, denominator); arguments as `characteristic`."""
    blank, passive, driven = loop_polynomials(
        axis, 0.0, Operator(0.0, 0.0, 1.0), compensator
    )  # against a unit spring
    return np.polyadd(passive, number("K", K, 0.0) * driven), blank


def environment_polynomial(b: float, operator: Operator | None = None) -> np.ndarray:
    """Te + Th as coefficients, shape (3,): clay b [N.s/m] and the operator's arm (Eqs. 4, 19)."""
    b, th = number("b", b, 0.0, unit="N.s/m"), operator or NO_HAND
    return np.array([th.mass, th.damper + b, th.spring])


def state_space(
    axis: str, K: float, b: float, operator: Operator | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The loop at the nominal pose as z' = A z + B uh, z = (p, p', delta, delta', y, y'), y = G delta.

    The servo's law is that of docs/equations.md, section 3; arguments as `characteristic`.

    Returns:
        A, shape (6, 6), and B, shape (6,).
    """
    i = AXES.index(choice("axis", axis, AXES))
    th, g, s = operator or NO_HAND, G[i], S[i]
    own = 1.0 + s.gain * th.mass  # p'' appears in the hand's force too
    rest = np.array(
        [-th.spring, -th.damper - b, 0.0, 0.0, 0.0, 0.0]
    )  # force without the hand's mass
    servo = np.array(
        [-s.stiffness, -s.damping, g.gain, 0.0, s.stiffness - g.stiffness, s.damping - g.damping]
    )
    A, B = np.zeros((6, 6)), np.zeros(6)
    A[0, 1] = A[2, 3] = A[4, 5] = 1.0
    A[1], B[1] = (servo + s.gain * rest) / own, s.gain / own
    A[3], B[3] = K * (rest - th.mass * A[1]), K * (1.0 - th.mass * B[1])
    A[3, 3] -= C_POLE
    A[5, 2], A[5, 4], A[5, 5] = g.gain, -g.stiffness, -g.damping
    return A, B


def crossing_times(
    axis: str, K: float, uh: float, edges: Sequence[float], b: Sequence[float], t_max: float = 100.0
) -> list[float]:
    """When a handle that starts at rest under a constant force passes each border, without a hand: exact.

    Between borders the loop is linear: matrix exponentials, the times by bisection to rounding (Brent 1973).

    Args:
        axis: "x" or "y". K: gain. uh: force [N]. edges: borders, ascending [m]. b: clay before each [N.s/m].
        t_max: where to stop looking [s].
    """
    from scipy.linalg import expm
    from scipy.optimize import brentq

    z, t, out = np.zeros(7), 0.0, []
    z[6] = uh
    for edge, here in zip(edges, b, strict=True):
        A = np.zeros((7, 7))
        A[:6, :6], A[:6, 6] = state_space(axis, K, here)
        step = 1e-3
        E = expm(A * step)
        while (ahead := E @ z)[0] < edge and t < t_max:
            z, t = ahead, t + step
        if t >= t_max:
            break
        h: Any = brentq(
            lambda h, A=A, z=z, edge=edge: float((expm(A * h) @ z)[0]) - edge, 0.0, step, xtol=1e-15
        )
        z, t = expm(A * h) @ z, t + h
        out.append(t)
    return out


def closed_loop_poles(
    axis: str, K: float, b: float, operator: Operator | None = None
) -> np.ndarray:
    """Poles of the loop at the nominal pose [rad/s], shape (6,); arguments as `characteristic`.

    Without a spring in Th one of them is the integrator that moves the handle (s = 0).
    """
    return np.roots(characteristic(axis, K, b, operator))


def stable(
    axis: str,
    K: float,
    b: float,
    operator: Operator | None = None,
    compensator: Compensator = PRINTED,
) -> bool:
    """True if no closed-loop pole lies right of the imaginary axis; arguments as `characteristic`."""
    return hurwitz(characteristic(axis, K, b, operator, compensator))


def hurwitz(poly: np.ndarray) -> bool:
    """True if every root of poly but those at s = 0 lies left of the imaginary axis."""
    return bool(np.all(np.roots(np.trim_zeros(poly)).real < 0.0))


def continuous_gain_limit(
    axis: str, b: float, operator: Operator | None = None, compensator: Compensator = PRINTED
) -> float:
    """Largest K up to which the loop is stable at the nominal pose; inf if there is none.

    Args:
        axis: "x" or "y". b: clay [N.s/m]. operator: Th; None for Th = 0. compensator: shape of C.
    """
    blank, passive, driven = loop_polynomials(axis, b, operator, compensator)
    return first_crossing(np.polyadd(blank, passive), driven)[0]


def first_crossing(A: np.ndarray, B: np.ndarray) -> tuple[float, float]:
    """Smallest K > 0 at which a root of A + K B leaves the left half plane, and where [rad/s]; (inf, nan) if none.

    Exact: on the imaginary axis A + K B vanishes, so Im(A B*) = 0, a polynomial in omega, whose positive
    roots give the K at which a pair of roots can cross.

    Args:
        A, B: polynomials; A has no root right of the imaginary axis.
    """
    A_, B_ = on_axis(A), on_axis(B)
    AB = np.convolve(A_, B_.conj())
    omega = positive_roots(AB.imag)
    with np.errstate(
        divide="ignore", invalid="ignore"
    ):  # a zero of B on the axis: no K puts a pole there
        K = -np.polyval(AB, omega).real / np.abs(np.polyval(B_, omega)) ** 2
    for i in np.argsort(K):
        if 0.0 < K[i] < math.inf and not hurwitz(np.polyadd(A, (1.0 + 1e-6) * K[i] * B)):
            return float(K[i]), float(omega[i])
    return math.inf, math.nan


def on_axis(poly: np.ndarray) -> np.ndarray:
    """poly(j omega) as a polynomial in omega with complex coefficients."""
    return poly * 1j ** np.arange(len(poly) - 1, -1, -1)


def positive_roots(poly: np.ndarray) -> np.ndarray:
    """Positive real roots of a real polynomial, to rounding."""
    roots = np.roots(np.trim_zeros(poly, "f")) if np.any(poly) else np.array([])
    return roots[(np.abs(roots.imag) <= 1e-6 * np.abs(roots)) & (roots.real > 0.0)].real
