"""Clay that springs back: Te = b s + k (Eqs. 3, 4), a spring that yields, one that relaxes."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np

from ..arguments import part
from ..errors import Bound, ParameterError, Real
from .traits import LEFT_OUT, Law, Quantity, Refusal

STIFFNESS_MAX = 1e9  # [N/m]
RESOLVED = 0.2  # [rad] limit of step times highest frequency of the springs in the loop


@part("spring.")
class Spring:
    """How clay springs back along one axis, in addition to its damping.

    Its rest is where the handle comes into the region: the border that it crosses, or the place at
    which it starts or comes in across a border of the other coordinate. The second spring is
    Zener's: it takes the load of a fast motion and gives it up with time.

    Attributes:
        k: stiffness [N/m], 0 to 1e9.
        limit: force beyond which it gives way for good [N], > 0, at most 1e6; None for never.
        k1: stiffness of a second, parallel spring, which relaxes [N/m], 0 to 1e9.
        tau: relaxation time of the second spring [s], > 0, at most 1e5; 1 without k1.
        unilateral: whether the clay is a wall behind the border, which pushes and never pulls; what
            gave way, and where the tool was at the start, is a dent that stays. Else the tool
            sticks in it and is pulled back as well.
    """

    k: Annotated[Real, Bound(0.0, STIFFNESS_MAX, "N/m")] = 0.0
    limit: Annotated[Real | None, Bound(0.0, 1e6, "N", above=True)] = None
    k1: Annotated[Real, Bound(0.0, STIFFNESS_MAX, "N/m")] = 0.0
    tau: Annotated[Real, Bound(0.0, 1e5, "s", above=True)] = 1.0
    unilateral: bool = False

    def __post_init__(self):
        if self.limit is not None and not self.k:
            raise ParameterError("spring.limit", self.limit, "must be None without stiffness k")
        if self.tau != type(self).tau and not self.k1:
            raise ParameterError("spring.tau", self.tau, f"must be {type(self).tau} without k1")
        if self.unilateral and not (self.k or self.k1):
            raise ParameterError("spring.unilateral", True, "must be False without k and k1")

    @property
    def numbers(self) -> tuple[float, float, float, float, float]:
        """k [N/m], limit [N] (inf for none), k1 [N/m], tau [s], 1.0 for a surface."""
        limit = math.inf if self.limit is None else self.limit
        return self.k, limit, self.k1, self.tau, float(self.unilateral)


_UNGUARDED = Refusal(
    "hardware", "must be without passivity controller and coupling in clay that springs back"
)


def _words(clay: Any) -> list[Quantity]:
    """Stiffness, limit and relaxing stiffness over a scene."""
    rows = np.concatenate([law.elastic.reshape(-1, 5) for law in clay.laws])
    return [
        x
        for form, unit, j in _QUANTITIES
        for x in Quantity.of_scene(form, _finite(rows[:, j]), unit)
    ]


def _here(clay: Any, place: tuple[float, float]) -> list[Quantity]:
    """Stiffness, limit and relaxing stiffness of both axes at a place."""
    x, y = (law.elastic[law.index(*place)] for law in clay.laws)
    return [
        q
        for form, unit, j in _QUANTITIES
        for q in Quantity.of_axes(form, _finite((x[j], y[j])), unit)
    ]


_QUANTITIES = (  # words, unit, and place in `Spring.numbers`
    ("spring k = {}", "N/m", 0),
    ("yielding at {}", "N", 1),
    ("relaxing k1 = {}", "N/m", 2),
)


def _finite(values: Any) -> list[float]:
    """The values, with 0 for an infinite limit."""
    return np.where(np.isfinite(values), values, 0.0).tolist()


def _cell_force(law: Any, _: float, dent: float) -> Any:
    k, limit, k1 = np.moveaxis(law.elastic, -1, 0)[:3]
    return np.minimum(k * dent, limit) + k1 * dent


TRAITS = (
    Law(
        "springs", "clay", lambda c: bool(c.springs), LEFT_OUT,
        {
            "passivity controller": _UNGUARDED,
            "virtual coupling": _UNGUARDED,
            "accurate": Refusal("integrator", "must be 'fast' in clay that springs back"),
            "rotated axes": Refusal("clay.angle", "must be 0 for springs"),
        },
        viscous=False, of_velocity=False, words=_words, here=_here, force=_cell_force,
    ),
)  # fmt: skip
