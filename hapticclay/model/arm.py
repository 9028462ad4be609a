"""The direct-drive arm in closed form: two links in a horizontal plane, link 2 balanced.

Joint angles: q1 of link 1 against world x, q2 of link 2 against link 1 (Eq. 14). The formulas use
the absolute angles theta1 = q1 and theta2 = q1 + q2, in which the inertia matrix is the constant
diag(I1, I2), without Coriolis terms. Derivations: docs/equations.md.

The formulas use an arm as plain numbers, `links`: l1, l2 [m], I1, I2 [kg.m^2], and the trace of
its mobility [1/kg]; see `Arm.links`.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from ..arguments import part
from ..errors import Bound, Real
from .constants import L1, L2, S
from .traits import NO, Refusal, Trait

Columns = tuple[float, float, float, float]
Links = tuple[float, float, float, float, float]


@part("arm.")
class Arm:
    """A two-link arm in a horizontal plane, link 2 balanced about the elbow; the paper's.

    Attributes:
        l1: length of link 1, shoulder to elbow [m], 1e-3 to 100.
        l2: length of link 2, elbow to handle [m], 1e-3 to 100.
        I1: inertia about the shoulder, of link 1 and of the mass of link 2 at the elbow [kg.m^2],
            1e-9 to 1e6; l1^2/0.7919 as printed (Eq. 17: Sh at high frequency is 1/Lambda).
        I2: inertia of link 2 about the elbow [kg.m^2], 1e-9 to 1e6; l2^2/0.131 as printed (Eq. 18).
    """

    l1: Annotated[Real, Bound(1e-3, 100.0, "m")] = L1
    l2: Annotated[Real, Bound(1e-3, 100.0, "m")] = L2
    I1: Annotated[Real, Bound(1e-9, 1e6, "kg.m^2")] = L1 * L1 / S[0].gain
    I2: Annotated[Real, Bound(1e-9, 1e6, "kg.m^2")] = L2 * L2 / S[1].gain

    @property
    def links(self) -> Links:
        """l1, l2 [m], I1, I2 [kg.m^2], trace of the mobility [1/kg], the same at every pose."""
        wx, wy = self.nominal_mobility
        return self.l1, self.l2, self.I1, self.I2, wx + wy

    @property
    def reach(self) -> tuple[float, float]:
        """Distances of the handle from the shoulder, folded and stretched [m]."""
        return abs(self.l2 - self.l1), self.l1 + self.l2

    @property
    def nominal_mobility(self) -> tuple[float, float]:
        """1/Lambda of x and y at the nominal pose, elbow square and link 2 along x [1/kg]."""
        return self.l1 * self.l1 / self.I1, self.l2 * self.l2 / self.I2


PAPER = Arm()


def jacobians(q1: Any, q2: Any, links: Links) -> tuple[Any, ...]:
    """As `jacobian`, (u1x, u1y, u2x, u2y) [m], for arrays of angles [rad]."""
    l1, l2, a = links[0], links[1], q1 + q2
    return -l1 * np.sin(q1), l1 * np.cos(q1), -l2 * np.sin(a), l2 * np.cos(a)


_SAMPLED = Refusal("control", "must be 'sampled' with an arm from a file")
_NO_LOOP = "must be left out with an arm from a file, which has no servo of the handle"
_IDEAL = Refusal("hardware", "must measure the force ideally with an arm from a file")
TRAITS = (
    Trait(
        "arm from a file", "part", lambda s: not isinstance(s.arm, Arm), NO,
        {
            "fast": _SAMPLED,
            "accurate": Refusal("integrator", "must be 'fast' where control is 'sampled'"),
            "inertia shaping": Refusal("inertia_shaping", _NO_LOOP),
            "groove": Refusal("clay", "must not stay cut with an arm from a file"),
            "passivity controller": Refusal("hardware.passivity", _NO_LOOP),
            "virtual coupling": Refusal("hardware.coupling", _NO_LOOP),
            "joint friction": Refusal(
                "hardware.friction", "must be 0 with an arm from a file: MjcfArm(friction)"
            ),
            "force noise": _IDEAL,
            "force filter": _IDEAL,
        },
    ),
)  # fmt: skip
