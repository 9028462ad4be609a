"""Passivity of the device at the hand: stability with every passive hand.

A sampled loop that is stable with one hand may still be active; `margins` judges coupled stability.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

import numpy as np
from numpy.polynomial import Polynomial

from ..arguments import checked
from ..errors import Bound, Real
from ..scene.virtual_wall import Device, VirtualWall
from . import linear_loop, roots
from .loops import Loop, of_loop
from .stability_margins import LINEAR, Verdict
from .wall_limits import passivity_index

FREQUENCIES = 20_001  # of a sampled test


@of_loop("K", "b")
def passivity(loop: Loop) -> Verdict:
    """Whether the impedance shown to the hand is passive, in continuous time.

    Z = fh/v = b + k/s + 1/(s (G C + Sh)) is positive real if the handle without a hand is stable,
    Re Z(j omega) >= 0, and Z is a spring at rest and a mass at high frequency, not their negatives
    (Colgate, Hogan, Int. J. Control 48, 1988).

    Args:
        loop: the loop with its K, its hand ignored; or axis, K, b, and other parts by name.

    Returns:
        Verdict with the least Re Z [N.s/m]: the excess damping of the clay, negative if it lacks
        damping.
    """
    z, e = (p.trim() for p in linear_loop.device_impedance(loop))
    R, Q = roots.real_part(z, e), roots.squared_magnitude(e)
    spring = roots.multiplicity_of_zero(e)
    R, Q = Polynomial(R.coef[spring:]), Polynomial(Q.coef[spring:])
    R = R + loop.b * Q
    worst, omega = roots.least_ratio(R, Q)
    alone = linear_loop.stable(replace(loop, operator=None))
    how = "stable without a hand and Re Z >= 0 at the least of a ratio of polynomials: exact"
    measures = "least Re Z [N.s/m]" + ("" if alone else "; not stable without a hand")
    fails = roots.positive_bands(-R)
    stiffness = z.coef[0] / e.coef[spring] if spring else 0.0
    stiffness += loop.k if spring < 2 else 0.0
    negative = z.coef[-1] * e.coef[-1] < 0.0 or stiffness < 0.0
    measures += "; a negative mass or spring" if negative else ""
    good = alone and worst >= 0.0 and not negative
    return Verdict(good, worst, omega, (LINEAR, "continuous time"), how, measures, fails)


@checked
def colgate_schenkel(
    H: Callable[[np.ndarray], np.ndarray],
    Ts: Annotated[Real, Bound(0.0, unit="s", above=True)],
    damping: Annotated[Real, Bound(0.0, unit="N.s/m")],
    n: int = FREQUENCIES,
) -> Verdict:
    """Passivity of a sampled virtual object behind a physical damper.

    Necessary and sufficient (Colgate, Schenkel, J. Robotic Systems 14, 1997):

        damping > Ts/2 1/(1 - cos omega Ts) Re{(1 - exp(-j omega Ts)) H(exp(j omega Ts))}

    for 0 < omega <= pi/Ts.
    """
    theta = np.linspace(0.0, np.pi, n)[1:]
    response = -np.expm1(-1j * theta) * H(np.exp(1j * theta))
    need = 0.25 * Ts / np.sin(0.5 * theta) ** 2 * response.real
    return _sampled_verdict(need, damping, theta / Ts)


def _sampled_verdict(need: np.ndarray, damping: float, omega: np.ndarray) -> Verdict:
    """The verdict on a physical damper, from the one needed at each frequency."""
    i = int(np.argmax(need))
    return Verdict(
        bool(damping > need[i]),
        damping - float(need[i]),
        float(omega[i]),
        (
            "a mass and a physical damper, nothing else, behind the handle",
            "position sampled, force held",
        ),
        f"Colgate and Schenkel's test at {len(omega)} frequencies up to pi/Ts: sampled",
        "damping to spare [N.s/m]",
        tuple((float(omega[i]), float(omega[j])) for i, j in roots.runs_of_true(need >= damping)),
    )


@checked
def clay_passivity(
    b: Annotated[Real, Bound(0.0, unit="N.s/m")],
    Ts: Annotated[Real, Bound(0.0, unit="s", above=True)],
    damping: Annotated[Real, Bound(0.0, unit="N.s/m")] = 0.0,
    stiffness: Annotated[Real, Bound(0.0, unit="N/m")] = 0.0,
    delay: Annotated[Real, Bound(0.0, unit="s")] = 0.0,
) -> Verdict:
    """Passivity of held clay alone, its velocity a backward difference.

    Servo and compensator are not modelled. Without delay the condition is damping > stiffness Ts/2
    + b, the second term at the Nyquist frequency (Colgate, Schenkel 1997); with one it is that of
    `passivity_index`. The handle has no physical damper, so held clay alone is never passive; clay
    with render="physical" is.

    Args:
        b: clay [N.s/m].
        Ts: control sample [s].
        damping: physical damping of the handle [N.s/m].
        stiffness: stiffness of a wall beside the clay [N/m].
        delay: from a sample to the force computed from it [s], 0 to 100 Ts.
    """
    if not delay:
        return colgate_schenkel(lambda z: stiffness + b * (1.0 - 1.0 / z) / Ts, Ts, damping)
    wall = VirtualWall(K=stiffness, B=b, device=Device(damper=damping), Ts=Ts, delay=delay)
    omega = np.linspace(0.0, np.pi, FREQUENCIES)[1:] / Ts
    return _sampled_verdict(damping - passivity_index(wall, omega), damping, omega)
