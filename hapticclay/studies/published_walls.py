"""Published limits of virtual walls on bare devices, as lines in the plane of B and K."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arguments import named
from ..display import brief
from ..scene.virtual_wall import VirtualWall
from ..theory import wall_limits

LIMIT_POINTS = 61  # of a line of theory


@named
@dataclass(frozen=True)
class Limit:
    """A published or exact line in the plane of B and K.

    Attributes:
        name: authors and year, or "exact".
        kind: "exact" (of the linear loop), "sufficient" (for every passive hand), or "rule" (an
            approximation, or a limit of another property).
        B: [N.s/m].
        K: [N/m], of the length of B; 0 where there is none.
        note: range of validity.
    """

    def __repr__(self) -> str:
        return brief(self)

    name: str
    kind: str
    B: tuple[float, ...]
    K: tuple[float, ...]
    note: str = ""

    def at(self, B: float) -> float:
        """K of the line at B, between its points [N/m]; NaN beyond its ends.

        Args:
            B: virtual damping [N.s/m].
        """
        return float(np.interp(B, self.B, self.K, math.nan, math.nan))


def published_limits(wall: VirtualWall, B: Sequence[float]) -> list[Limit]:
    """Published lines of a bare device over B."""
    quantum, out = bool(wall.device.quantum), []

    def add(
        name: str, kind: str, law: Callable[[VirtualWall], float], note: str, B: Sequence[float] = B
    ) -> None:
        K = tuple(law(replace(wall, K=0.0, B=x)) for x in B)
        out.append(Limit(name, kind, tuple(B), K, note))

    add(
        "Colgate, Schenkel 1997",
        "rule" if quantum else "sufficient",
        wall_limits.colgate_schenkel_limit,
        "passive: stable in every passive hand" + ", but for the quantum" * quantum,
        np.unique([*B, *np.linspace(0.0, min(wall.device.damper, B[-1]), LIMIT_POINTS)]).tolist(),
    )
    if wall.velocity == "difference" and wall.velocity_window == 1 and wall.velocity_filter is None:
        note = "linear rule, for (b + B) Ts and K Ts^2 far below the mass"
        add("Hulin et al. 2006", "rule", wall_limits.hulin_limit, note)
    if wall.delay == 0.0 and wall.M == 0.0:
        K = wall_limits.abbott_okamura_limit(replace(wall, B=0.0))
        note = "passive, for B = 0: friction outweighs the encoder"
        if K < math.inf:
            out.append(Limit("Abbott, Okamura 2005", "sufficient", (0.0,), (K,), note))
    return out
