"""`hapticclay passivity`: passivity of a virtual wall, of the arm and of rendered clay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import writable
from ..model.constants import AXES, TS
from . import console, walls
from .options import Loose

if TYPE_CHECKING:
    from ..scene.scenario import Scenario

PASSIVE_WALL = {"K": 500.0, "delay": 5e-4, "device.damper": 1.0}
QUICK_RUNS = (1.0,)  # sample times, in parts of Ts, at which limits are found by runs
FULL_RUNS = (0.25, 1.0, 4.0)


@dataclass(frozen=True)
class PassivityCommand:
    """Show where a virtual wall, the arm and its rendered clay are passive, by theory and by runs.

    Four figures: index (wall over frequency), arm (Re Z of both axes), energy (rendered clay over
    time, without and with the controller of Hannaford and Ryu), region (K over Ts and delay).

    Attributes:
        source: File of a wall, .toml or .json; options override it.
        cut: Scenario file of the arm and its clay, held under sampled control. By default the
            constant cut; for the energy over time, a cut in clay of 8000 N.s/m.
        delays: Delays of the region, in units of Ts.
        out: Folder for passivity.json and the figures.
        quick: Find limits by runs at one Ts only.
        wall: The wall: by default K = 500 N/m on a device of 0.1 kg and 1 N.s/m, sampled every
            1 ms, with a delay of 0.5 ms.
        figures: Formats and style of the figures.
    """

    source: Loose[Path | None] = None
    cut: Path | None = None
    delays: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0)
    out: Path = Path("out/passivity")
    quick: bool = False
    wall: walls.WallOptions = walls.WallOptions()
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..studies import passivity_runs as study
        from ..studies.boundary import PushedLoop

        writable(self.out)
        wall = self.wall.wall(self.source, **PASSIVE_WALL)
        arm, cut = self._scenarios()

        def bar(items: Any) -> Any:
            return console.progress_bar(items, desc="passivity")

        runs = [x * wall.Ts for x in (QUICK_RUNS if self.quick else FULL_RUNS)]
        found = study.Passivity(
            study.wall_index(wall, bar),
            {axis: study.arm_index(PushedLoop.of(arm, axis)) for axis in AXES},
            study.energy_over_time(cut),
            study.passive_region(wall, self.delays, runs, bar),
        )
        console.deliver(found, self.out, self.figures)
        return 0

    def _scenarios(self) -> tuple[Scenario, Scenario]:
        """The scenario of the arm over frequency, and that of the rendered clay over time."""
        from ..scene.experiments import constant_cut
        from ..scene.scenario import Scenario

        if self.cut:
            cut = Scenario.load(self.cut)
            return cut, cut
        stiff: Any = dict(b=8000.0, start=(0.06, 0.0), gain=(1.0, 0.1), t_max=33 * TS)
        return constant_cut(), replace(
            constant_cut(control="sampled", **stiff), stop_when_unstable=False
        )
