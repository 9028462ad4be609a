"""`hapticclay zwidth`: the virtual walls that a device renders stably, by runs and by theory."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound, ParameterError
from ..files import writable
from ..model.constants import GAIN, TS
from . import console, walls
from .options import Loose
from .unused import Unused

if TYPE_CHECKING:
    from ..studies.wall import Subject


@dataclass(frozen=True)
class ZWidthCommand:
    """Find the virtual walls (K, B) that a device renders stably, by runs and by theory.

    Quantities are in SI units unless they name another, as in --Ts 1ms. With friction, an encoder
    or a surface the loop is not linear: a wall is then stable if it comes to rest after a push.

    Attributes:
        source: File of a wall, .toml or .json, which the options change; none for the defaults.
        B: Virtual dampings to try [N.s/m]; by default 0 and others up to the largest stable one.
        vary: A family: Ts, delay, quantum, damper, friction, mass, filter or window, then its
            values, as in --vary damper 0.2 0.5 1; on the arm Ts, delay or gain.
        box: Hands for a second set of runs: least and largest mass [kg, kg], damper [N.s/m, N.s/m],
            spring [N/m, N/m], as in --box 0 1 0 5 0 300.
        force: Force of the push that tries a loop which is not linear [N].
        speed: Speed of that push [m/s].
        still: Largest motion back and forth that counts as rest [m]; by default 1 um, or a count of
            the encoder where that is larger.
        arm: Axis of the arm with servo and compensator, in the place of a bare device: the plane is
            that of the clay's k and b.
        gain: Gain of the compensator [1/kg], with --arm; by default 1 on x and 0.5 on y.
        out: Folder for zwidth.json and the figure.
        quick: Try fewer dampings.
        device: The device, its sampling and the hand.
        figures: Format and style of the figure.
    """

    source: Loose[Path | None] = None
    B: Annotated[tuple[float, ...], Bound(unit="N.s/m")] = ()
    vary: tuple[str, ...] = ()
    box: walls.HandEnds | None = None
    force: Annotated[float | None, Bound(unit="N")] = None
    speed: Annotated[float | None, Bound(unit="m/s")] = None
    still: Annotated[float | None, Bound(unit="m")] = None
    arm: Literal["x", "y"] | None = None
    gain: Annotated[float | None, Bound(unit="1/kg")] = None
    out: Path = Path("out/zwidth")
    quick: bool = False
    device: walls.DeviceOptions = walls.DeviceOptions()
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("quick",), "tries fewer dampings: leave it out where --B gives them", ("B",)),
        Unused(("gain",), "is for the arm: give --arm x or y", (), ("arm",)),
        Unused(
            ("source", *walls.OF_DEVICE),
            "is for a bare device: leave it out beside --arm",
            ("arm",),
        ),
    )

    def __call__(self) -> int:
        from ..scene.changes import with_fields
        from ..studies.wall_runs import Press
        from ..studies.zwidth import zwidth

        writable(self.out)
        push = {"force": self.force, "speed": self.speed, "still": self.still}
        tried = {name: x for name, x in push.items() if x is not None}
        press = with_fields(Press(), tried)
        wall, box = self._wall(), walls.box_of(self.box)
        with console.fraction_bar("runs") as show:
            found = zwidth(
                wall,
                self.vary[0] if self.vary else "",
                self._values(wall),
                B=self.B or None,
                box=box,
                press=press,
                quick=self.quick,
                progress=show,
            )
        console.deliver(found, self.out, self.figures, wall=wall, vary=self.vary, box=self.box)
        if tried and all(r.linear for r in found.regions):
            ignored = (
                f"{', '.join(f'--{name}' for name in tried)} did not count: no push tries a loop"
            )
            print(f"hapticclay: {ignored} that is linear, its growth rate does", file=sys.stderr)
        return 0

    def _wall(self) -> Subject:
        from ..scene.changes import with_fields
        from ..studies.boundary import PushedLoop

        if not self.arm:
            return self.device.wall(self.source)
        gain = GAIN["xy".index(self.arm)] if self.gain is None else self.gain
        loop = PushedLoop(self.arm, K=gain, Ts=TS, operator=walls.operator_of(self.device.hand))
        return with_fields(loop, self.device.timing)

    def _values(self, wall: Subject) -> list[Any]:
        """The values behind --vary."""
        from ..scene.changes import named_values

        if not self.vary:
            return []
        if len(self.vary) == 1:
            bound = "must be a name and its values, as in --vary damper 0.2 0.5"
            raise ParameterError("vary", self.vary[0], bound)
        return [named_values("--vary", [f"x={word}"])["x"] for word in self.vary[1:]]
