"""Is what the handle shows to the hand passive? Then it is stable with every passive hand, not only with this one.

A sampled loop that is stable with one hand may still be active; coupled stability is judged in `stability`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import number
from ..model.controller import PRINTED, Compensator
from . import linear_loop
from .margins import LINEAR, Verdict, bands, least_value, real, square


def passivity(axis: str, K: float, b: float, *, compensator: Compensator = PRINTED) -> Verdict:
    """Whether the impedance shown to the hand is passive: stable with every passive hand, in continuous time.

    Z = fh/v = b + 1/(s (G C + Sh)) is positive real if the handle left to itself is stable and Re Z(j omega) >= 0
    (Colgate, Hogan, Int. J. Control 48, 1988).

    Args:
        axis: "x" or "y". K: gain. b: clay [N.s/m]. compensator: shape of C.

    Returns:
        Verdict with the least Re Z [N.s/m]: as much damping the clay has to spare, or lacks.
    """
    e, d = linear_loop.device_admittance(axis, K, compensator)
    b = number("b", b, 0.0, unit="N.s/m")
    R, Q = np.polyadd(real(d[:-1], e), b * square(e)), square(e)
    worst, omega = least_value(R, Q)
    alone = linear_loop.stable(axis, K, b, None, compensator)
    how = "stable without a hand and Re Z >= 0 at the least of a ratio of polynomials: exact"
    what = "least Re Z [N.s/m]" + ("" if alone else "; not stable without a hand")
    return Verdict(
        alone and worst >= 0.0, worst, omega, (LINEAR, "continuous time"), how, what, bands(-R)
    )


def colgate_schenkel(
    H: Callable[[np.ndarray], np.ndarray], Ts: float, damping: float, n: int = 20_001
) -> Verdict:
    """Passivity of a sampled virtual object behind a physical damper.

    Necessary and sufficient (Colgate, Schenkel, J. Robotic Systems 14, 1997):

        damping > Ts/2 1/(1 - cos omega Ts) Re{(1 - exp(-j omega Ts)) H(exp(j omega Ts))},  0 < omega <= pi/Ts

    Args:
        H: pulse transfer function from sampled position to held force [N/m] at complex z, shape (n,) to (n,).
        Ts: sample [s]. damping: of the device itself, physical [N.s/m]. n: frequencies looked at.
    """
    Ts, damping = (
        number("Ts", Ts, 0.0, above=True, unit="s"),
        number("damping", damping, 0.0, unit="N.s/m"),
    )
    theta = np.linspace(0.0, np.pi, n)[1:]
    need = (
        0.25 * Ts / np.sin(0.5 * theta) ** 2 * (-np.expm1(-1j * theta) * H(np.exp(1j * theta))).real
    )
    i = int(np.argmax(need))
    fails = _runs(theta / Ts, need >= damping)
    how = f"Colgate and Schenkel's test at {n - 1} frequencies up to pi/Ts: sampled"
    assumptions = (
        "a mass and a physical damper, nothing else, behind the handle",
        "position sampled, force held",
    )
    return Verdict(
        bool(damping > need[i]),
        damping - float(need[i]),
        float(theta[i] / Ts),
        assumptions,
        how,
        "damping to spare [N.s/m]",
        fails,
    )


def _runs(x: np.ndarray, mine: np.ndarray) -> tuple[tuple[float, float], ...]:
    up = np.concatenate(([False], mine, [False]))
    start, stop = np.flatnonzero(up[1:] & ~up[:-1]), np.flatnonzero(up[:-1] & ~up[1:]) - 1
    return tuple((float(x[i]), float(x[j])) for i, j in zip(start, stop, strict=True))


def clay_passivity(b: float, Ts: float, damping: float = 0.0, stiffness: float = 0.0) -> Verdict:
    """Passivity of held clay, its velocity the difference of two samples, without servo and compensator.

    In closed form: damping > stiffness Ts/2 + b, the second term at the Nyquist frequency (Colgate, Schenkel 1997). The
    handle has no physical damper of its own, so held clay is never passive by itself; clay with render="implicit" is.

    Args:
        b: clay [N.s/m]. Ts: sample [s]. damping: physical, of the handle [N.s/m]. stiffness: of a wall beside it [N/m].
    """
    b, k = number("b", b, 0.0, unit="N.s/m"), number("stiffness", stiffness, 0.0, unit="N/m")
    return colgate_schenkel(lambda z: k + b * (1.0 - 1.0 / z) / Ts, Ts, damping)
