"""The linear blocks of the loop (Fig. 2) as polynomials, and their exact closed loop.

Polynomials in s are NumPy coefficient arrays, highest power first.
"""

from __future__ import annotations

import math

import numpy as np

from .errors import choice, number
from .params import AXES, C_POLE, NO_HAND, G, Operator, S


def kick(damping: float, H: float, L: float, R: float) -> tuple[float, float]:
    """Coefficients (keep, take) of one kick of v' = -damping v + drive: v+ = keep v- + take drive.

    Trapezoidal in the damping, exact in total impulse: any length, any split.

    Args:
        damping: [1/s]. H: length of the kick [s]. L, R: its shares before and after the sample.
    """
    n = 1.0 / H + damping * R
    return (1.0 / H - damping * L) / n, 1.0 / n


def held(axis: str, K: float, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Compensator and reference model over a sample T [s] in which the force f is held: z+ = A z + B f, exactly.

    z = (delta, delta', y, y'), y = G delta (matrix exponential; Astrom, Wittenmark, Computer-Controlled Systems).

    Returns:
        A, shape (4, 4), and B, shape (4,).
    """
    from scipy.linalg import expm

    g = G[AXES.index(choice("axis", axis, AXES))]
    m = np.zeros((5, 5))
    m[0, 1] = m[2, 3] = 1.0
    m[1, 1], m[1, 4] = -C_POLE, K
    m[3] = [g.stiffness, 0.0, -g.stiffness, -g.damping, 0.0]
    e = expm(T * m)
    return e[:4, :4], e[:4, 4]


def steady_speed(K: float, f: float, b: float) -> float:
    """Speed under a constant hand force f [N] in clay b [N.s/m]: K f/(10 + K b) [m/s].

    The compensator's damper and the clay carry the force together: f = (10/K + b) v (Eqs. 20, 21).
    """
    return K * f / (C_POLE + K * b)


def characteristic(axis: str, K: float, b: float, operator: Operator | None = None) -> np.ndarray:
    """Closed-loop polynomial of 1 + (G C + Sh)(Te + Th), the denominator of Eq. 8.

    Args:
        axis: "x" or "y". K: compensator gain. b: clay [N.s/m]. operator: Th; None for Th = 0.

    Returns:
        Coefficients, shape (7,), highest power first.

    Raises:
        ParameterError: unknown axis, or K or b not finite and >= 0.
    """
    free, driven = _split(axis, b, operator)
    return np.polyadd(free, number("K", K, 0.0) * driven)


def _split(axis: str, b: float, operator: Operator | None) -> tuple[np.ndarray, np.ndarray]:
    """The closed-loop polynomial is free + K driven."""
    i = AXES.index(choice("axis", axis, AXES))
    b = number("b", b, 0.0, unit="N.s/m")
    th = operator or NO_HAND
    c = np.array([1.0, C_POLE, 0.0])
    g = np.array([1.0, G[i].damping, G[i].stiffness])
    s = np.array([1.0, S[i].damping, S[i].stiffness])
    t = np.array([th.mass, th.damper + b, th.spring])
    cg = np.convolve(c, g)
    return np.polyadd(np.convolve(cg, s), S[i].gain * np.convolve(cg, t)), G[i].gain * np.convolve(s, t)


def closed_loop_poles(axis: str, K: float, b: float, operator: Operator | None = None) -> np.ndarray:
    """Poles of the loop at the nominal pose [rad/s], shape (6,); arguments as `characteristic`.

    Without a spring in Th one of them is the integrator that moves the handle (s = 0).
    """
    return np.roots(characteristic(axis, K, b, operator))


def stable(axis: str, K: float, b: float, operator: Operator | None = None) -> bool:
    """True if no closed-loop pole lies right of the imaginary axis; arguments as `characteristic`."""
    poly = characteristic(axis, K, b, operator)
    while poly[-1] == 0.0:
        poly = poly[:-1]
    return bool(np.all(np.roots(poly).real < 0.0))


def gain_limit(axis: str, b: float, operator: Operator | None = None) -> float:
    """Largest K up to which the loop is stable at the nominal pose; inf if there is none.

    Exact: on the imaginary axis the closed-loop polynomial A + K B vanishes, so Im(A B*) = 0, a
    polynomial in omega, whose positive roots give the K at which a pair of poles can cross.

    Args:
        axis: "x" or "y". b: clay [N.s/m]. operator: Th; None for Th = 0.
    """
    A, B = (p * 1j ** np.arange(len(p) - 1, -1, -1) for p in _split(axis, b, operator))
    AB = np.convolve(A, B.conj())
    roots = np.roots(np.trim_zeros(AB.imag, "f")) if np.any(AB.imag) else np.array([])
    omega = roots[(np.abs(roots.imag) <= 1e-6 * np.abs(roots)) & (roots.real > 0.0)].real
    with np.errstate(divide="ignore", invalid="ignore"):  # a zero of B on the axis: no K puts a pole there
        K = np.sort(-np.polyval(AB, omega).real / np.abs(np.polyval(B, omega)) ** 2)
    for k in K[(K > 0.0) & np.isfinite(K)]:
        if not stable(axis, (1.0 + 1e-6) * k, b, operator):
            return float(k)
    return math.inf
