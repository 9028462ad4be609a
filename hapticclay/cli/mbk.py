"""`hapticclay mbk`: the virtual masses, dampers and springs that a device or the arm renders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from ..errors import Bound
from ..files import writable
from ..model.constants import TS
from . import console, walls
from .options import Loose
from .unused import Unused

RENDERED_WALL = {"K": 1000.0, "B": 2.0, "device.damper": 0.5}


@dataclass(frozen=True)
class MBKCommand:
    """Find the stable virtual masses, dampers and springs, by theory and by runs.

    For a bare device: borders in three planes, and the dynamic range. With --arm: the least mass
    that the arm renders as an admittance.

    Attributes:
        source: File of a wall, .toml or .json; options override it.
        arm: Axis of the arm, instead of a bare device. --Ts none is continuous time; the default
            hand is Th (Eq. 19).
        box: Hands at the arm: least and largest mass [kg, kg], damper [N.s/m, N.s/m], spring
            [N/m, N/m]; by default 0.1 1 1 10 0 300.
        columns: Number of columns of a plane, or of dampers of the arm, at which runs search for
            the border, 1 to 100; by default 5, or 2 with --quick.
        quick: Draw lines with fewer points.
        out: Folder for mbk.json and the figures.
        wall: The device and its sampling, and the K, B and M that are constant in a plane: by
            default 1000 N/m, 2 N.s/m and 0, on a device with a damper of 0.5 N.s/m.
        figures: Format and style of the figures.
    """

    source: Loose[Path | None] = None
    arm: Literal["x", "y"] | None = None
    box: walls.HandEnds | None = None
    columns: Annotated[int | None, Bound(1, 100)] = None
    quick: bool = False
    out: Path = Path("out/mbk")
    wall: walls.WallOptions = walls.WallOptions()
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("box",), "is for the arm: give --arm too", (), ("arm",)),
        Unused(
            ("source", "K", "B", "M", *walls.OF_DEVICE),
            "is for a bare device: leave it out with --arm",
            ("arm",),
        ),
    )

    def __call__(self) -> int:
        writable(self.out)
        columns = (2 if self.quick else 5) if self.columns is None else self.columns
        if self.arm:
            return self._arm(columns)
        return self._device(columns)

    def _device(self, columns: int) -> int:
        from ..studies.mbk import device_mbk

        wall = self.wall.wall(self.source, **RENDERED_WALL)
        points = 21 if self.quick else 61
        found = device_mbk(wall, columns=columns, points=points, progress=_bar)
        console.deliver(found, self.out, self.figures)
        return 0

    def _arm(self, columns: int) -> int:
        from ..model.operator import Operator
        from ..scene.changes import with_fields
        from ..studies.boundary import PushedLoop
        from ..studies.mbk import HANDS, arm_mbk

        assert self.arm is not None
        box = walls.box_of(self.box) or HANDS
        operator = walls.operator_of(self.wall.hand) or Operator()
        loop = PushedLoop(self.arm, b=0.0, operator=operator, Ts=TS)
        loop = with_fields(loop, self.wall.timing)
        points = 7 if self.quick else 17
        found = arm_mbk(
            loop, box, columns=columns, points=points, samples=0 if self.quick else 24,
            progress=_bar,
        )  # fmt: skip
        console.deliver(found, self.out, self.figures)
        return 0


def _bar(items: Any) -> Any:
    return console.progress_bar(items, desc="mbk")
