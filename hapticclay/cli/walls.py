"""A virtual wall and its device on the command line: the same options in each command."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..errors import ParameterError

if TYPE_CHECKING:
    from ..scene.virtual_wall import VirtualWall
    from ..theory.hand_boxes import Box

Quantity = str | None  # a number in SI, or with a unit: "0.1", "1ms"
Hand = tuple[float, float, float]
HandEnds = tuple[float, float, float, float, float, float]
WALL_FIELDS = {  # dotted names of options, where the two differ
    "mass": "device.mass",
    "damper": "device.damper",
    "friction": "device.friction",
    "quantum": "device.quantum",
    "filter": "velocity_filter",
}


@dataclass(frozen=True)
class DeviceOptions:
    """A bare device, its sampling, and the hand at it; what is given changes the file of a wall.

    Attributes:
        mass: Mass of the device [kg], by default 0.1.
        damper: Physical damping b of the device [N.s/m].
        friction: Coulomb friction fc of the device [N], by default 0.
        quantum: Distance per count of the encoder [m], by default 0.
        Ts: Control sample [s], by default 1 ms, and 0.36 ms on the arm.
        delay: Latency from a sample to the force computed from it [s].
        velocity: How velocity is measured, by default as the difference of positions.
        velocity_window: Samples that the difference spans, by default 1.
        filter: Cutoff of a low-pass behind the difference [Hz], or none.
        hand: Mass, damper and spring of a hand at the handle [kg, N.s/m, N/m].
        unilateral: The wall has a surface and never pulls.
    """

    mass: Quantity = None
    damper: Quantity = None
    friction: Quantity = None
    quantum: Quantity = None
    Ts: Quantity = None
    delay: Quantity = None
    velocity: Literal["difference", "exact"] | None = None
    velocity_window: Quantity = None
    filter: Quantity = None
    hand: Hand | None = None
    unilateral: bool = False

    @property
    def given(self) -> tuple[str, ...]:
        """Names of the options that were given."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name) != f.default)

    def wall(self, source: Path | str | None = None, **base: Any) -> VirtualWall:
        """The wall of a file, or one of defaults, with what was given."""
        from ..scene.changes import with_fields
        from ..scene.virtual_wall import VirtualWall

        wall = VirtualWall.load(source) if source else with_fields(VirtualWall(), base)
        names = [n for n in self.given if n not in ("hand", "unilateral")]
        changes = quantities({n: getattr(self, n) for n in names})
        wall = with_fields(wall, {WALL_FIELDS.get(n, n): x for n, x in changes.items()})
        if self.hand:
            wall = replace(wall, operator=operator_of(self.hand))
        return replace(wall, unilateral=True) if self.unilateral else wall

    def refuse(self, bound: str, but: tuple[str, ...] = ()) -> None:
        """Refuses what was given."""
        for name in self.given:
            if name not in but:
                raise ParameterError(name, str(getattr(self, name)), bound)


@dataclass(frozen=True)
class WallOptions(DeviceOptions):
    """A virtual wall on a bare device.

    Attributes:
        K: Virtual stiffness [N/m].
        B: Virtual damping [N.s/m].
        M: Virtual mass [kg].
    """

    K: Quantity = None
    B: Quantity = None
    M: Quantity = None


def quantities(given: dict[str, str | None]) -> dict[str, Any]:
    """Numbers with their units read, of the options that were given."""
    from ..scene.changes import named_values

    out: dict[str, Any] = {}
    for name, text in given.items():
        if text is not None:
            out |= named_values(f"--{name}", [f"{name}={text}"])
    return out


def operator_of(hand: Hand | None) -> Any:
    """The hand of --hand, None for none."""
    from ..model.operator import Operator

    return Operator(*hand) if hand else None


def box_of(hands: HandEnds | None) -> Box | None:
    """The hands of --box, None for none."""
    from ..theory.hand_boxes import Box

    if hands is None:
        return None
    m, M, d, D, k, K = hands
    return Box((m, M), (d, D), (k, K))
