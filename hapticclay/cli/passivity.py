"""`hapticclay passivity`: passivity of a virtual wall, of the arm and of rendered clay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import versions, writable
from ..model.constants import AXES, TS
from . import console, walls
from .options import Loose

if TYPE_CHECKING:
    from ..scene.scenario import Scenario
    from ..studies.passivity_runs import EnergyOverTime, IndexOverFrequency, PassiveRegion
    from ..views.figure import Figure

PASSIVITY_SCHEMA = "hapticclay-passivity-1"
PASSIVE_WALL = {"K": 500.0, "delay": 5e-4, "device.damper": 1.0}
QUICK_RUNS = (1.0,)  # of Ts, at which limits are found by runs
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

        loops = {axis: PushedLoop.of(arm, axis) for axis in AXES}
        found = study.wall_index(wall, bar)
        arms = {axis: study.arm_index(loop) for axis, loop in loops.items()}
        energy = study.energy_over_time(cut)
        runs = [x * wall.Ts for x in (QUICK_RUNS if self.quick else FULL_RUNS)]
        region = study.passive_region(wall, self.delays, runs, bar)
        try:
            self._save(found, arms, energy, region)
        finally:  # a full disk must not hide the results
            print(passivity_table(found, arms, energy, region))
        print(f"written to {self.out}")
        return 0

    def _scenarios(self) -> tuple[Scenario, Scenario]:
        """Of the arm over frequency, and of the rendered clay over time."""
        from ..scene.experiments import constant_cut
        from ..scene.scenario import Scenario

        if self.cut:
            cut = Scenario.load(self.cut)
            return cut, cut
        stiff: Any = dict(b=8000.0, start=(0.06, 0.0), gain=(1.0, 0.1), t_max=33 * TS)
        return constant_cut(), replace(
            constant_cut(control="sampled", **stiff), stop_when_unstable=False
        )

    def _save(
        self,
        found: IndexOverFrequency,
        arms: dict[str, IndexOverFrequency],
        energy: EnergyOverTime,
        region: PassiveRegion,
    ) -> None:
        from ..views import passivity_plots as plots
        from ..views.figure import Figure

        figures: dict[str, Figure] = {
            "index": Figure(lambda: plots.index_plot(found), found.tables),
            "energy": Figure(lambda: plots.port_energy_plot(energy), energy.tables),
            "region": Figure(lambda: plots.region_plot(region), region.tables),
        }
        for axis, arm in arms.items():
            figures[f"arm_{axis}"] = Figure(lambda arm=arm: plots.index_plot(arm), arm.tables)
        data = {
            "schema": PASSIVITY_SCHEMA,
            **{
                name: {
                    table: {column: list(values) for column, values in columns.items()}
                    for table, columns in figure.tables().items()
                }
                for name, figure in figures.items()
                if name != "energy"
            },
            "versions": versions(),
        }
        console.save_json(data, self.out / "passivity.json")
        console.save_figures(figures, self.out, self.figures)


def passivity_table(
    found: IndexOverFrequency,
    arms: dict[str, IndexOverFrequency],
    energy: EnergyOverTime,
    region: PassiveRegion,
) -> str:
    """What the four figures say, for a terminal."""
    rows = [[x.name, f"{x.margin:.4g}", "yes" if x.margin >= 0.0 else "no"]
            for x in (found, *arms.values())]  # fmt: skip
    lines = [console.text_table(rows, ["", "to spare [N.s/m]", "passive"], "lrl"), ""]
    rows = []
    for delay, K in zip(region.delays, region.found, strict=True):
        for T, by_run in zip(region.run_Ts, K, strict=True):
            theory = limit_at(region, float(T), delay)
            rows.append([f"{delay:g}", f"{1e3 * T:g}", f"{theory:.5g}", f"{by_run:.5g}"])
    head = ["delay [Ts]", "Ts [ms]", "largest passive K [N/m]", "by runs [N/m]"]
    lines += [console.text_table(rows, head, "rrrr"), ""]
    for name, e in zip(("without", "with"), energy.observed, strict=True):
        told = f"rendered clay {name} controller: least energy taken {float(e.min()):.3g} J"
        lines.append(f"{told}, at the end {float(e[-1]):.3g} J")
    return "\n".join(lines)


def limit_at(region: PassiveRegion, Ts: float, delay: float) -> float:
    """The largest passive K by theory at one Ts and delay [N/m]."""
    from ..theory.wall_limits import colgate_schenkel_limit

    return colgate_schenkel_limit(replace(region.wall, Ts=Ts, delay=delay * Ts))
