"""The operator's arm: fh = uh - Th p, Th = m s^2 + d s + k (Eq. 19)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from ..arguments import named
from ..errors import Bound, check_fields
from .constants import B_MAX


def operator_coefficients(hand, H, L, R, h):
    """Response of Th in one kick, without the delay of a step (docs/equations.md, section 4).

    The spring acts on the mean position (p(k-1) + 2 p(k) + p(k+1))/4, which adds k h^2/4 to the
    mass and keeps any spring stable at any step h (Newmark, beta = 1/4).

    Args:
        hand: mass [kg], damper [N.s/m] and spring [N/m] of Th; zeros for Th = 0.
        H: length of the kick [s].
        L: share of the kick before the sample.
        R: share of the kick after the sample.
        h: length of the steps [s]; H, except where the kick is one half of a step at start or end.

    Returns:
        (spring [N/m], mass [kg], before, after [N.s/m]): the force on the handle is -(spring p -
        mass c + before v- + after v+), c the centripetal acceleration.
    """
    damper, spring = hand[1], hand[2]
    mass = hand[0] + 0.25 * spring * h * h
    return spring, mass, damper * L - mass / H, damper * R + mass / H


def operator_force(
    spring: float, mass: float, before: float, p: float, c: float, v: float
) -> float:
    """Resisting force of the operator's arm in a kick, without the velocity after it.

    Args:
        spring: from `operator_coefficients` [N/m].
        mass: from `operator_coefficients` [kg].
        before: from `operator_coefficients` [N.s/m].
        p: handle position [m].
        c: centripetal acceleration, towards the centre [m/s^2].
        v: handle velocity before the kick [m/s].

    Returns:
        The force [N].
    """
    return spring * p - mass * c + before * v


def mobility_with(trace, mass):
    """Largest acceleration of handle and hand per unit of force. Numbers, or arrays.

    Args:
        trace: of the mobility of the arm [1/kg], see `arm.Arm.links`.
        mass: of the hand, the lesser of both axes [kg].

    Returns:
        [1/kg].
    """
    return trace / (1.0 + mass * trace)


@named
@dataclass(frozen=True)
class Operator:
    """The arm of the person at the handle: Th = mass s^2 + damper s + spring (Eq. 19).

    Attributes:
        mass: mass of the arm at the handle [kg], 0 to 1e3.
        damper: its damping [N.s/m], 0 to 1e9.
        spring: its stiffness, pulling towards p = 0 [N/m], 0 to 1e9.
    """

    mass: Annotated[float, Bound(0.0, 1e3, "kg")] = 0.25
    damper: Annotated[float, Bound(0.0, B_MAX, "N.s/m")] = 2.0
    spring: Annotated[float, Bound(0.0, 1e9, "N/m")] = 6.0

    def __post_init__(self):
        check_fields(self, "operator.")


NO_HAND = Operator(0.0, 0.0, 0.0)  # Th = 0
