"""Materials by name, and the flow of a tool in them; docs/materials.md lists all sources."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real, choice
from ..formulas.constants import B_MAX
from .constants import B_CONSTANT
from .flow import Flow, FlowIndex
from .tool import SMALL_TOOL, Tool

KPA = 1e3  # [Pa]
BEARING_LOW, BEARING_HIGH = 2.0 + math.pi, 9.0  # strip at the surface (Prandtl); deep square

TERZAGHI = "Terzaghi, Peck & Mesri 1996: half of the unconfined compressive strength"
# Unconfined compressive strength q [kPa]; "hard", above 400, is omitted: it has no upper limit
CONSISTENCY = {
    "very soft clay": (0.0, 25.0),
    "soft clay": (25.0, 50.0),
    "medium clay": (50.0, 100.0),
    "stiff clay": (100.0, 200.0),
    "very stiff clay": (200.0, 400.0),
}

# 85 % clay, 5 % water, 10 % ethanol by weight, in a rotating viscometer
PASTE = "ASME IMECE2020-84508 (V003T03A034): 85 % clay, 5 % water, 10 % ethanol"
PASTE_RPM = (1.0, 5.0, 50.0)
PASTE_VISCOSITY = (828.0, 202.4, 40.4)  # apparent [Pa.s]


def bearing_factor(tool: Tool) -> float:
    """Mean pressure on the tool's face over shear strength: Nc = 5 (1 + 0.2 B/L) (1 + 0.2 D/B).

    The face is a rectangular foundation turned on its side (Skempton 1951): B its shorter side, L
    the longer, D the depth of its lower edge below the surface, at most 2.5 B.
    """
    _check_tool(tool)
    short, long = sorted((tool.width, tool.depth))
    return 5.0 * (1.0 + 0.2 * short / long) * (1.0 + 0.2 * min(tool.depth / short, 2.5))


def _check_tool(tool: Tool) -> None:
    if not isinstance(tool, Tool):
        raise ParameterError("tool", tool, "must be a Tool")


def power_law(rpm: Sequence[float], viscosity: Sequence[float]) -> tuple[float, float]:
    """K [Pa.s^n] and n of shear stress K rate^n, from rpm and apparent viscosities [Pa.s].

    A long cylinder at w rad/s in a wide vessel has the stress viscosity x 2 w at its wall and the
    shear rate 2 w/n (Krieger & Maron 1952). n is the slope of log stress over log w.
    """
    x = [math.log(2.0 * _speed(r)) for r in rpm]
    y = [math.log(v) + a for v, a in zip(viscosity, x, strict=True)]
    mx, my = math.fsum(x) / len(x), math.fsum(y) / len(y)
    n = math.fsum((a - mx) * (b - my) for a, b in zip(x, y, strict=True))
    n /= math.fsum((a - mx) ** 2 for a in x)
    return math.exp(my - n * mx) * n**n, n


def _speed(rpm: float) -> float:
    return rpm * math.tau / 60.0  # [rad/s]


@part("material.", kw_only=True)
class Material:
    """Resistance of a clay: the shear stress strength + K rate^n, or plain damping.

    Attributes:
        source: where the numbers come from.
        strength: undrained shear strength, lowest and highest [Pa], 0 to 1e7.
        K: consistency of the shear stress [Pa.s^n], 0 to 1e7.
        n: flow index, 0.05 to 4.
        rates: lowest and highest shear rate of the measurement behind K and n [1/s]; None for none.
        b: damping of any tool [N.s/m], 0 to 1e9.
    """

    source: str
    strength: Annotated[tuple[Real, Real], Bound(0.0, 1e7, "Pa", names=("low", "high"))] = (0, 0)
    K: Annotated[Real, Bound(0.0, 1e7, "Pa.s^n")] = 0.0
    n: Annotated[float, FlowIndex] = 1.0
    rates: Annotated[tuple[Real, Real] | None, Bound(0.0, unit="1/s", names=("low", "high"))] = None
    b: Annotated[Real, Bound(0.0, B_MAX, "N.s/m")] = 0.0

    def __post_init__(self):
        for name, span in (("strength", self.strength), ("rates", self.rates)):
            if span and span[0] > span[1]:
                bound = "must be the lowest and the highest, in this order"
                raise ParameterError(f"material.{name}", span, bound)

    def flow(self, tool: Tool = SMALL_TOOL) -> Flow:
        """Flow of a tool in the material: Nc x its face x the shear stress at the rate v/B.

        The strength is the middle of its range; Nc and B are those of `bearing_factor`.

        Args:
            tool: the tool; 10 mm wide and 5 mm deep by default.
        """
        return self._flow(tool, sum(self.strength) / 2.0, bearing_factor(tool))

    def range(self, tool: Tool = SMALL_TOOL) -> tuple[Flow, Flow]:
        """The weakest and the strongest flow: lowest strength and Nc = 2 + pi, highest and Nc = 9.

        Args:
            tool: as for `flow`.
        """
        _check_tool(tool)
        low, high = self.strength
        return self._flow(tool, low, BEARING_LOW), self._flow(tool, high, BEARING_HIGH)

    def speeds(self, tool: Tool = SMALL_TOOL) -> tuple[float, float] | None:
        """Lowest and highest speed of a tool at the measured shear rates [m/s]; None without any.

        Args:
            tool: as for `flow`.
        """
        if self.rates is None:
            return None
        _check_tool(tool)
        short = min(tool.width, tool.depth)
        return self.rates[0] * short, self.rates[1] * short

    def _flow(self, tool: Tool, strength: float, factor: float) -> Flow:
        pushed = factor * tool.width * tool.depth  # [m^2]
        K = pushed * self.K / min(tool.width, tool.depth) ** self.n
        return Flow(pushed * strength, K, self.n, self.b)


def _clay(weakest: float, strongest: float) -> Material:
    return Material(source=TERZAGHI, strength=(weakest / 2.0 * KPA, strongest / 2.0 * KPA))


def _paste() -> Material:
    K, n = power_law(PASTE_RPM, PASTE_VISCOSITY)
    low, high = (2.0 * _speed(rpm) / n for rpm in (PASTE_RPM[0], PASTE_RPM[-1]))
    return Material(source=PASTE, K=K, n=n, rates=(low, high))


MATERIALS = {
    **{name: _clay(*limits) for name, limits in CONSISTENCY.items()},
    "printable paste": _paste(),
    "paper clay": Material(source="Her, Hsu, Lan & Karkoub 2002, Eq. 21", b=B_CONSTANT),
}


@checked
def material(name: str, tool: Tool = SMALL_TOOL) -> Flow:
    """Flow of a tool in a material: its yield force, consistency, flow index and damping.

    MATERIALS[name] holds the underlying numbers, their sources and their range.

    Args:
        name: "very soft clay", "soft clay", "medium clay", "stiff clay", "very stiff clay",
            "printable paste" or "paper clay".
        tool: the tool; 10 mm wide and 5 mm deep by default.

    Raises:
        ParameterError: there is no such material, or the tool is not a Tool.
    """
    return MATERIALS[choice("material", name, tuple(MATERIALS))].flow(tool)
