"""`hapticclay robustness`: limits and the probability of instability over a population of hands."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..errors import ParameterError, integer
from ..files import versions, writable
from . import console

if TYPE_CHECKING:
    from ..studies.boundary import PushedLoop
    from ..studies.population import Band
    from ..studies.robustness import Cost, Instability
    from ..studies.trials import Trials

ROBUSTNESS_SCHEMA = "hapticclay-robustness-1"
GRIDS = {"x": "K=1:8:15 b=10:1000:11log", "y": "K=0.2:2:15 b=10:1000:11log"}
BAND_CLAYS = (1.0, 3000.0, 25)  # [N.s/m] from, to, and number of clays of the band
HANDS_HEAD = ["hands", "mass [kg]", "damper [N.s/m]", "spring [N/m]", "subjects", "spread"]


@dataclass(frozen=True)
class RobustnessCommand:
    """Analyse a loop over a population of hands and other random parameters.

    Draws the gain limit as a band over the hands, and the probability of instability over a plane,
    from runs that are judged one by one. The same command resumes an interrupted study.

    Attributes:
        axis: Axis of the loop.
        b: Damping of the clay [N.s/m], by default 90; refused where something varies it.
        gain: K of the compensator [1/kg], by default 1 on x and 0.5 on y; refused likewise.
        Ts: Control sample [s]; None for continuous time.
        delay: Latency from a measurement to the torque computed from it [s], with --Ts.
        inertia_shaping: Let the servo shape the inertia, so that Sh is the same at every pose.
        hands: Name of a population; hapticclay robustness --list prints them.
        variation: Draw log-normal hands around the median hand of the population, with this ratio
            of standard deviation to mean. The spread is then an assumption.
        vary: What else varies, as in "delay=uniform:0:1ms pose.x=normal:0:2cm"; the laws are
            normal and log-normal (mean, standard deviation), uniform and log-uniform (low, high).
        grid: One or two parameters with their values, as in "K=1:8:15 b=10:1000:11log"; "" for
            none.
        runs: Runs per cell of the grid; without a grid, runs of the study.
        seed: Seed of the random numbers.
        chunk: Runs that are stored together, which is the most that a killed process loses.
        out: Folder for the runs, robustness.json and the figures.
        workers: Processes on this machine; by default one per core.
        band: Number of hands for the band of gain limits over clay; 0 draws none.
        list: Print the populations and exit.
        figures: Formats and style of the figures.
    """

    axis: Literal["x", "y"] = "x"
    b: float | None = None
    gain: float | None = None
    Ts: float | None = None
    delay: float = 0.0
    inertia_shaping: bool = True
    hands: str = "published range"
    variation: float | None = None
    vary: str = ""
    grid: str | None = None
    runs: int = 50
    seed: int = 0
    chunk: int = 1000
    out: Path = Path("out/robustness")
    workers: int | None = None
    band: int = 200
    list: bool = False
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..simulation.batch import cores
        from ..studies.population import POPULATIONS, Draw, gain_band, hands_of
        from ..studies.robustness import monte_carlo

        if self.list:
            rows = [hands.row(name) for name, hands in POPULATIONS.items()]
            print(console.text_table([r[:-1] for r in rows], HANDS_HEAD, "lrrrrl"))
            for row in rows:
                print(f"{row[0]}: {row[-1]}")
            return 0
        writable(self.out)
        trials = self._trials()
        draw = Draw(self.band, self.seed) if self.band else None
        workers = integer("workers", cores() if self.workers is None else self.workers, 1, 1024)
        hands = trials.hands or hands_of(self.hands)
        assert not isinstance(hands, str)
        print(console.text_table([hands.row(self.hands)[:-1]], HANDS_HEAD, "lrrrrl"))
        try:
            with console.progress_bar(total=len(trials), unit="run", desc="runs") as bar:
                result = monte_carlo(
                    trials,
                    out=self.out,
                    workers=workers,
                    announce=lambda cost: _announce(cost, workers, self.out, bar),
                    progress=bar.update,
                )
        except KeyboardInterrupt:
            kept = self.out / "data"
            print(f"the runs made so far are in {kept}; the same command goes on")
            raise
        band = None
        if draw:
            import numpy as np

            clays = np.geomspace(*BAND_CLAYS).tolist()
            band = gain_band(
                trials.base.linear,  # type: ignore[union-attr]
                hands,
                clays,
                draw,
                lambda b: console.progress_bar(b, desc="band"),
            )
        self._show(result, band)
        return 0

    def _trials(self) -> Trials:
        from ..fields import field_unit
        from ..model.constants import AXES, B_CONSTANT, GAIN
        from ..scene.scenario import Scenario
        from ..studies.boundary import PushedLoop
        from ..studies.distribution import parse_laws
        from ..studies.population import Hands, hands_of
        from ..studies.sampling import grid_in_units
        from ..studies.trials import Trials

        def unit_of(name: str) -> str:
            return field_unit(name, PushedLoop, Scenario)

        base: PushedLoop = PushedLoop(
            self.axis,
            b=B_CONSTANT if self.b is None else self.b,
            K=GAIN[AXES.index(self.axis)] if self.gain is None else self.gain,
            operator=None,
            Ts=self.Ts,
            delay=self.delay,
            inertia_shaping=self.inertia_shaping,
        )
        hands = hands_of(self.hands)
        if self.variation is not None:
            source = f"{hands.source}: the mean alone" if hands.source else ""
            hands = Hands.around(hands.median, self.variation, source=source)
        grid = GRIDS[self.axis] if self.grid is None else self.grid
        laws, cells = parse_laws(self.vary, unit_of), grid_in_units(grid, unit_of) if grid else {}
        options = {"b": self.b, "gain": self.gain, "Ts": self.Ts, "delay": self.delay or None}
        for name, value in options.items():
            if value is not None and {**laws, **cells}.get({"gain": "K"}.get(name, name)):
                how = "--vary" if self.vary and name in laws else "--grid"
                raise ParameterError(name, value, f"is varied by {how}: leave it out of one")
        return Trials(
            base,
            laws,
            hands,
            cells,
            self.runs,
            seed=self.seed,
            chunk=self.chunk,
        )

    def _show(self, result: Instability, band: Band | None) -> None:
        from ..views import robustness_plots
        from ..views.figure import Figure

        total = result.total
        print(f"unstable: {total.events} of {total.runs} runs, {total}")
        if result.trials.grid:
            print("over a grid this is the mean of its cells")
        print(f"{100.0 * result.longer.mean():.1f} % of the runs needed a longer run")
        if result.refused:
            print(f"{result.refused} draws cannot be run (out of reach or bounds): not counted")
        drawn = {
            "instability": Figure(lambda: robustness_plots.instability_plot(result), result.tables)
        }
        if band is not None:
            drawn["gain_band"] = Figure(lambda: robustness_plots.band_plot(band), band.tables)
        console.save_figures(drawn, self.out, self.figures)
        found: dict[str, Any] = {
            "schema": ROBUSTNESS_SCHEMA,
            "trials": result.trials.described(),
            "total": asdict(total),
            "repeated": int(result.longer.sum()),
            "refused": result.refused,
            "tables": result.tables(),
            "band": band.tables()["band"] if band is not None else None,
            "versions": versions(),
        }
        console.save_json(found, self.out / "robustness.json")
        print(f"written to {self.out}")


def _announce(cost: Cost, workers: int, out: Path, bar: Any) -> None:
    """Prints the time and room on disk that the runs left will take."""
    from tqdm import tqdm

    bar.update(bar.total - cost.runs - bar.n)
    free = f"{tqdm.format_sizeof(cost.free, 'B')} free"
    print(
        f"hapticclay: {cost.runs} runs: about {tqdm.format_interval(cost.seconds)} on {workers} "
        f"process{'es' if workers > 1 else ''}, {tqdm.format_sizeof(cost.size, 'B')} in "
        f"{out / 'data'} ({free})",
        file=sys.stderr,
    )
