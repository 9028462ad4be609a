"""The operator's arm: fh = uh - Th p, Th = m s^2 + d s + k (Eq. 19)."""

from __future__ import annotations

from typing import Annotated

from ..arguments import part
from ..errors import Bound, Real
from ..formulas.constants import B_MAX
from .traits import Trait


def mobility_with(trace, mass):
    """Largest acceleration of handle and hand per force [1/kg], from the trace of the mobility."""
    return trace / (1.0 + mass * trace)


@part("operator.")
class Operator:
    """The arm of the person at the handle: Th = mass s^2 + damper s + spring (Eq. 19).

    Attributes:
        mass: mass of the arm at the handle [kg], 0 to 1e3.
        damper: its damping [N.s/m], 0 to 1e9.
        spring: its stiffness, pulling towards p = 0 [N/m], 0 to 1e9.
    """

    mass: Annotated[Real, Bound(0.0, 1e3, "kg")] = 0.25
    damper: Annotated[Real, Bound(0.0, B_MAX, "N.s/m")] = 2.0
    spring: Annotated[Real, Bound(0.0, 1e9, "N/m")] = 6.0


NO_HAND = Operator(0.0, 0.0, 0.0)  # Th = 0


TRAITS = (Trait("operator", "part", lambda s: any(s.operators)),)
