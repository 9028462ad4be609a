"""`hapticclay zwidth`: the virtual walls that a device renders stably, by runs and by theory."""

from __future__ import annotations

import math
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from ..errors import ParameterError
from ..files import versions, writable
from ..model.constants import GAIN, TS
from . import console, walls
from .unused import Unused

if TYPE_CHECKING:
    from ..studies.wall import Subject
    from ..studies.zwidth import ZRegion, ZWidth

ZWIDTH_SCHEMA = "hapticclay-zwidth-1"


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
        force: Of the push that tries a loop which is not linear [N].
        speed: Of that push [m/s].
        still: Largest motion back and forth that counts as rest [m].
        arm: Axis of the arm with servo and compensator, in the place of a bare device: the plane is
            that of the clay's k and b.
        gain: Of the compensator [1/kg], with --arm; by default 1 on x and 0.5 on y.
        out: Folder for zwidth.json and the figure.
        quick: Try fewer dampings.
        device: The device, its sampling and the hand.
        figures: Format and style of the figure.
    """

    source: Annotated[Path | None, tyro.conf.Positional] = None
    B: tuple[float, ...] = ()
    vary: tuple[str, ...] = ()
    box: walls.HandEnds | None = None
    force: walls.Quantity = None
    speed: walls.Quantity = None
    still: walls.Quantity = None
    arm: Literal["x", "y"] | None = None
    gain: float | None = None
    out: Path = Path("out/zwidth")
    quick: bool = False
    device: walls.DeviceOptions = walls.DeviceOptions()
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("quick",), "tries fewer dampings: leave it out where --B gives them", ("B",)),
    )

    def __call__(self) -> int:
        from ..scene.changes import with_fields
        from ..studies.wall_runs import Press
        from ..studies.zwidth import zwidth
        from ..views.figure import Figure
        from ..views.wall_plots import zwidth_plot

        writable(self.out)
        tried = walls.quantities({n: getattr(self, n) for n in ("force", "speed", "still")})
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
        data = {"schema": ZWIDTH_SCHEMA, "wall": asdict(wall), "vary": self.vary, "box": self.box,
                "press": asdict(press), "tables": found.tables(), "gap": found.gap(),
                "violations": found.violations(), "versions": versions()}  # fmt: skip
        try:
            console.save_json(data, self.out / "zwidth.json")
            figure = Figure(lambda: zwidth_plot(found), found.tables)
            console.save_figures({"zwidth": figure}, self.out, self.figures)
        finally:  # a full disk must not hide the result
            print(zwidth_table(found))
        if tried and all(r.linear for r in found.regions):
            told = f"{', '.join(f'--{name}' for name in tried)} did not count: no push tries a loop"
            print(f"hapticclay: {told} that is linear, its growth rate does", file=sys.stderr)
        print(f"written to {self.out}")
        return 0

    def _wall(self) -> Subject:
        if self.arm:
            return self._arm(self.arm)
        if self.gain is not None:
            raise ParameterError("gain", self.gain, "is for the arm: give --arm x or y")
        return self.device.wall(self.source)

    def _arm(self, axis: Literal["x", "y"]) -> Subject:
        from ..scene.changes import with_fields
        from ..studies.boundary import PushedLoop

        bound = "is for a bare device: leave it out beside --arm"
        self.device.refuse(bound, but=("Ts", "delay", "hand"))
        if self.source:
            raise ParameterError("source", str(self.source), bound)
        gain = GAIN["xy".index(axis)] if self.gain is None else self.gain
        loop = PushedLoop(axis, K=gain, Ts=TS, operator=walls.operator_of(self.device.hand))
        timing = {n: getattr(self.device, n) for n in ("Ts", "delay")}
        return with_fields(loop, walls.quantities(timing))

    def _values(self, wall: Subject) -> list[Any]:
        """The values behind --vary."""
        from ..scene.changes import named_values

        if not self.vary:
            return []
        if len(self.vary) == 1:
            bound = "must be a name and its values, as in --vary damper 0.2 0.5"
            raise ParameterError("vary", self.vary[0], bound)
        return [named_values("--vary", [f"x={word}"])["x"] for word in self.vary[1:]]


def zwidth_table(found: ZWidth) -> str:
    """The regions and what was found beside theory, for a terminal."""
    number = console.significant
    rows = []
    for r in found.regions:
        gap = "-" if math.isnan(r.gap()) else f"{100.0 * r.gap():.2g} %"
        sizes = [r.K[0], r.largest_K, r.largest_B, r.area]
        rows.append([r.name or "-", *map(number, sizes), r.verdict, gap])
    head = ["region", "K at least B", "largest K", "largest B", "area", "verdict", "from exact"]
    lines = [console.text_table(rows, head, "lrrrrll")]
    lines.append("K [N/m], B [N.s/m], area [N^2.s/m^2]")
    lines += [_top_told(r) for r in found.regions if len(r.B) > 1]
    if not math.isnan(found.gap()):
        lines.append(f"runs against the exact linear loop: within {100.0 * found.gap():.2g} %")
    if rough := [r for r in found.regions if not r.linear]:
        lines.append(
            f"rest: back and forth by {1e6 * found.press.still:g} um at most, after a push of "
            f"{found.press.force:g} N at {1e3 * found.press.speed:g} mm/s"
            f" ({len(rough)} of {len(found.regions)} regions)"
        )
    below = found.violations()
    lines += below or ["no run was unstable below a line that is sufficient"]
    return "\n".join(lines)


def _top_told(r: ZRegion) -> str:
    """Where the largest K lies: between the tested dampings it is not known."""
    name, (low, high) = f"{r.name}: " if r.name else "", r.top_between
    return f"{name}between B = {low:.4g} and {high:.4g}, of {len(r.B)} tried, K may be larger"
