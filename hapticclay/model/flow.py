"""Clay that yields: a damper plus the law of Herschel and Bulkley."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from ..arguments import part
from ..errors import Bound, Real
from ..formulas.constants import B_MAX
from .traits import LEAST, LEFT_OUT, Column, Hold, Law, Quantity, multiplied

FY_MAX = 1e6  # [N]
CONSISTENCY_MAX = 1e6  # [N/(m/s)^n]
N_MIN, N_MAX = 0.05, 4.0

YieldForce = Bound(0.0, FY_MAX, "N")
Consistency = Bound(0.0, CONSISTENCY_MAX, "N/(m/s)^n")
FlowIndex = Bound(N_MIN, N_MAX)


@part("flow.")
class Flow:
    """Resistance of clay to a tool that moves at v: f = (Fy + K |v|^n) v/|v| + b v.

    Clay holds a tool at rest against any force up to Fy. With Fy = K = 0 it is the paper's clay.

    Attributes:
        Fy: yield force [N], 0 to 1e6.
        K: consistency [N/(m/s)^n], 0 to 1e6.
        n: flow index, 0.05 to 4; below 1 the clay thins as it is sheared.
        b: damping [N.s/m], 0 to 1e9.
    """

    Fy: Annotated[Real, YieldForce] = 0.0
    K: Annotated[Real, Consistency] = 0.0
    n: Annotated[float, FlowIndex] = 1.0
    b: Annotated[Real, Bound(0.0, B_MAX, "N.s/m")] = 0.0

    @property
    def kind(self) -> str:
        """Usual name: viscous, Coulomb, Bingham, power law or Herschel-Bulkley.

        With n = 1, K is damping.
        """
        if not self.K or self.n == 1.0:
            return ("Bingham" if self.b or self.K else "Coulomb") if self.Fy else "viscous"
        return "Herschel-Bulkley" if self.Fy or self.b else "power law"

    @property
    def words(self) -> list[Quantity]:
        """Its resistance, in words."""
        b = Quantity.of_scene("b = {}", [self.b], "N.s/m")
        return [*_flow_quantities([self.Fy], [self.K], [self.n]), *b]

    def force(self, v: Any) -> np.ndarray:
        """Resisting force [N], of the sign of v; 0 at rest, where any up to Fy may act.

        Args:
            v: velocity [m/s], of either sign, any shape.
        """
        v = np.asarray(v, dtype=float)
        return np.sign(v) * (self.Fy + self.K * np.abs(v) ** self.n) + self.b * v


COLUMNS = (Column("Fy", "N"), Column("K", "N/(m/s)^n"), Column("n"))


def _words(clay: Any) -> list[Quantity]:
    """Yield force, consistency and flow index over a scene."""
    cells = zip(*(law.flows for law in clay.laws), strict=True)
    return _flow_quantities(*(np.concatenate([x.ravel() for x in both]).tolist() for both in cells))


def _flow_quantities(Fy: list[float], K: list[float], n: list[float]) -> list[Quantity]:
    """Yield force, consistency, and flow index where there is a consistency."""
    index = [x for x, consistency in zip(n, K, strict=True) if consistency]
    return [
        *Quantity.of_scene("Fy = {}", Fy, "N"),
        *Quantity.of_scene("K = {}", K, "N/(m/s)^n"),
        *Quantity.of_scene("n = {}", index),
    ]


def _here(clay: Any, place: tuple[float, float]) -> list[Quantity]:
    """Yield force, consistency and flow index of both axes at a place."""
    Fy, K, n = zip(*(law.flows_at(*place) for law in clay.laws), strict=True)
    index = Quantity.of_axes("n = {}", n) if any(K) else ()
    return [
        *Quantity.of_axes("Fy = {}", Fy, "N"),
        *Quantity.of_axes("K = {}", K, "N/(m/s)^n"),
        *index,
    ]


def _cell_force(law: Any, speed: float, _: float) -> np.ndarray:
    Fy, K, n = law.flows
    return Fy + K * speed**n


def _holds(clay: Any, i: int) -> Hold:
    return Hold(float(clay.laws[i].flows[0].max()), "Fy", clay.isotropic)


def _scaled(clay: Any, factor: float) -> Any:
    """The clay with its yield force and consistency multiplied; it still yields."""

    def of(law: Any) -> Any:
        if not law.yields:
            return law
        Fy = multiplied(law.Fy, factor, FY_MAX, LEAST)
        return replace(law, Fy=Fy, K=multiplied(law.K, factor, CONSISTENCY_MAX, LEAST))

    return replace(clay, x=of(clay.x), y=of(clay.y))


TRAITS = tuple(
    Law(
        name, "clay",
        lambda c, along=along: any(x.yields for x in c.laws) and c.isotropic == along, LEFT_OUT,
        viscous=False, seen_in_b=False, columns=COLUMNS, words=_words, here=_here,
        at=lambda law, place: law.flows_at(*place), force=_cell_force, holds=_holds,
        along_motion=along, scaled=_scaled,
    )
    for name, along in (("yield by axis", False), ("yield along the motion", True))
)  # fmt: skip
