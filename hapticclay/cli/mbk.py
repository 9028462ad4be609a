"""`hapticclay mbk`: the virtual masses, dampers and springs that a device or the arm renders."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ..errors import Bound, ParameterError
from ..files import writable
from ..model.constants import TS
from . import console, walls
from .options import Loose

if TYPE_CHECKING:
    from ..studies.mbk import ArmMBK, DeviceMBK

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

    def __call__(self) -> int:
        writable(self.out)
        columns = (2 if self.quick else 5) if self.columns is None else self.columns
        if self.arm:
            return self._arm(columns)
        if self.box:
            raise ParameterError("box", self.box, "is for the arm: give --arm too")
        return self._device(columns)

    def _device(self, columns: int) -> int:
        from ..studies.mbk import device_mbk
        from ..views import impedance_plots
        from ..views.figure import Figure

        wall = self.wall.wall(self.source, **RENDERED_WALL)
        found = device_mbk(wall, columns=columns, points=21 if self.quick else 61, progress=_bar)
        tables = found.tables()
        span = {"range": tables.pop("range")}
        figures = {
            "mbk": Figure(lambda: impedance_plots.mbk_plot(found), tables),
            "range": Figure(lambda: impedance_plots.dynamic_range_plot(found), span),
        }
        self._save(found.summary(), figures, device_table(found))
        return 0

    def _arm(self, columns: int) -> int:
        from ..model.operator import Operator
        from ..scene.changes import with_fields
        from ..studies.boundary import PushedLoop
        from ..studies.mbk import HANDS, arm_mbk
        from ..views import impedance_plots
        from ..views.figure import Figure

        bound = "is for a bare device: leave it out with --arm"
        self.wall.refuse(bound, but=("Ts", "rate", "delay", "hand"))
        if self.source:
            raise ParameterError("source", str(self.source), bound)
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
        figures = {"mass": Figure(lambda: impedance_plots.least_mass_plot(found), found.tables)}
        self._save(found.summary(), figures, arm_table(found))
        return 0

    def _save(self, summary: dict[str, Any], figures: dict[str, Any], table: str) -> None:
        try:
            console.save_json(summary, self.out / "mbk.json")
            console.save_figures(figures, self.out, self.figures)
        finally:  # a full disk must not hide the result
            print(table)
        print(f"written to {self.out}")


def _bar(items: Any) -> Any:
    return console.progress_bar(items, desc="mbk")


def device_table(found: DeviceMBK) -> str:
    """Borders by runs beside the exact ones, and the dynamic range, for a terminal."""
    number = console.significant
    rows = []
    for plane, some in found.found.items():
        for x in some:
            off = f"{100.0 * (x.y / x.exact - 1.0):+.2g} %"
            rows.append([plane, number(x.x), x.end, number(x.y), number(x.exact), off])
    head = ["plane", "at", "border", "by runs", "exact", "off"]
    r = found.range
    low, high = (float(r.omega[i]) / (2.0 * math.pi) for i in (0, -1))
    wall = f"K = {r.stiffest.K:.4g} N/m with B = {r.stiffest.B:.4g} N.s/m"
    lines = [
        console.text_table(rows, head, "lrlrrr"),
        "mass-damper: kg, N.s/m; mass-stiffness: kg, N/m; damper-stiffness: N.s/m, N/m",
        f"dynamic range from the free device to {wall}: {r.decibels[0]:.3g} dB at {low:.3g} Hz, "
        f"{r.decibels[-1]:.3g} dB at {high:.3g} Hz, mean {r.mean:.3g} dB",
    ]
    device = r.stiffest.device
    if device.friction or device.quantum or r.stiffest.unilateral:
        lines.append("all of the linear loop: friction, encoder and surface are ignored")
    return "\n".join(lines)


def arm_table(found: ArmMBK) -> str:
    """The least masses of the arm, for a terminal."""
    number = console.significant
    runs = {x.exact: x.y for x in found.found}
    rows = []
    for (m, b), (worst, worst_b) in zip(found.nominal.T, found.worst.T, strict=True):
        run = runs.get(float(m))
        rows.append(
            [
                number(float(b)),
                number(float(m)),
                "" if run is None else number(run),
                number(float(worst_b)),
                number(float(worst)),
            ]
        )
    head = ["B [N.s/m]", "least M [kg]", "by runs", "B, hand box", "least M, hand box"]
    return console.text_table(rows, head, "rrrrr")
