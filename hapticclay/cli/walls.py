"""A virtual wall and its device on the command line: the same options in each command."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound
from .unused import Unused

if TYPE_CHECKING:
    from ..scene.virtual_wall import VirtualWall
    from ..theory.hand_boxes import Box

Mass = Annotated[float, Bound(unit="kg")]
Damper = Annotated[float, Bound(unit="N.s/m")]
Spring = Annotated[float, Bound(unit="N/m")]
Hand = tuple[Mass, Damper, Spring]
HandEnds = tuple[Mass, Mass, Damper, Damper, Spring, Spring]
OrNone = float | Literal["none"] | None  # None where it is not given
WALL_FIELDS = {  # dotted names of options, where the two differ
    "mass": "device.mass",
    "damper": "device.damper",
    "friction": "device.friction",
    "quantum": "device.quantum",
    "filter": "velocity_filter",
}
OF_DEVICE = ("mass", "damper", "friction", "quantum", "velocity", "velocity-window", "filter")
OF_DEVICE += ("unilateral",)  # options for a bare device alone, by their words


@dataclass(frozen=True)
class DeviceOptions:
    """A bare device, its sampling, and the hand at it; what is given changes the file of a wall.

    Attributes:
        mass: Mass of the device [kg], by default 0.1.
        damper: Physical damping b of the device [N.s/m].
        friction: Coulomb friction fc of the device [N], by default 0.
        quantum: Distance per count of the encoder [m], by default 0.
        Ts: Control sample [s], by default 1 ms, and 0.36 ms on the arm.
        rate: Control rate [Hz], in the place of Ts = 1/rate.
        delay: Latency from a sample to the force computed from it [s].
        velocity: How velocity is measured, by default as the difference of positions.
        velocity_window: Samples that the difference spans, by default 1.
        filter: Cutoff of a low-pass behind the difference [Hz], or none.
        hand: Mass, damper and spring of a hand at the handle [kg, N.s/m, N/m].
        unilateral: The wall has a surface and never pulls.
    """

    mass: Annotated[float | None, Bound(unit="kg")] = None
    damper: Annotated[float | None, Bound(unit="N.s/m")] = None
    friction: Annotated[float | None, Bound(unit="N")] = None
    quantum: Annotated[float | None, Bound(unit="m")] = None
    Ts: Annotated[OrNone, Bound(unit="s")] = None
    rate: Annotated[float | None, Bound(0.0, unit="Hz", above=True)] = None
    delay: Annotated[float | None, Bound(unit="s")] = None
    velocity: Literal["difference", "exact"] | None = None
    velocity_window: int | None = None
    filter: Annotated[OrNone, Bound(unit="Hz")] = None
    hand: Hand | None = None
    unilateral: bool = False

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("rate",), "is 1/Ts: give one of the two", ("Ts",)),
    )

    @property
    def given(self) -> dict[str, Any]:
        """The options that were given."""
        return {name: x for name, x in vars(self).items() if x is not None and x is not False}

    @property
    def timing(self) -> dict[str, Any]:
        """What was given of Ts and delay."""
        found = {name: x for name, x in self.given.items() if name in ("Ts", "delay")}
        return found | ({"Ts": 1.0 / self.rate} if self.rate else {})

    def wall(self, source: Path | str | None = None, **base: Any) -> VirtualWall:
        """The wall of a file, or one of defaults, with what was given."""
        from ..scene.changes import with_fields
        from ..scene.virtual_wall import VirtualWall

        wall = VirtualWall.load(source) if source else with_fields(VirtualWall(), base)
        changes = self.given | self.timing
        operator = operator_of(changes.pop("hand", None)) or wall.operator
        changes.pop("rate", None)
        changes = {WALL_FIELDS.get(name, name): x for name, x in changes.items()}
        return replace(with_fields(wall, changes), operator=operator)


@dataclass(frozen=True)
class WallOptions(DeviceOptions):
    """A virtual wall on a bare device.

    Attributes:
        K: Virtual stiffness [N/m].
        B: Virtual damping [N.s/m].
        M: Virtual mass [kg].
    """

    K: Annotated[float | None, Bound(unit="N/m")] = None
    B: Annotated[float | None, Bound(unit="N.s/m")] = None
    M: Annotated[float | None, Bound(unit="kg")] = None


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
