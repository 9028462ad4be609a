"""`hapticclay robustness`: limits and the probability of instability over a population of hands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ..display import table_of, text_table
from ..errors import Bound, ParameterError
from ..files import writable
from . import console

if TYPE_CHECKING:
    from ..studies.boundary import PushedLoop
    from ..studies.population import Hands
    from ..studies.robustness import Cost
    from ..studies.trials import Trials

GRIDS = {"x": "K=1:8:15 b=10:1000:11log", "y": "K=0.2:2:15 b=10:1000:11log"}
BAND_CLAYS = (1.0, 3000.0, 25)  # [N.s/m] from, to, and number of clays of the band
HANDS_HEAD = ("hands", "mass [kg]", "damper [N.s/m]", "spring [N/m]", "subjects", "spread")


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
    b: Annotated[float | None, Bound(unit="N.s/m")] = None
    gain: Annotated[float | None, Bound(unit="1/kg")] = None
    Ts: Annotated[float | None, Bound(unit="s")] = None
    delay: Annotated[float, Bound(unit="s")] = 0.0
    inertia_shaping: bool = True
    hands: str = "published range"
    variation: float | None = None
    vary: str = ""
    grid: str | None = None
    runs: int = 50
    seed: int = 0
    chunk: int = 1000
    out: Path = Path("out/robustness")
    workers: Annotated[int | None, Bound(1, 1024)] = None
    band: int = 200
    list: bool = False
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..simulation.batch import cores
        from ..studies.population import POPULATIONS, Draw, gain_band, hands_of
        from ..studies.robustness import Robustness, monte_carlo

        if self.list:
            print(hands_table(POPULATIONS))
            for name, hands in POPULATIONS.items():
                print(f"{name}: {hands.source}")
            return 0
        writable(self.out)
        trials = self._trials()
        draw = Draw(self.band, self.seed) if self.band else None
        workers = cores() if self.workers is None else self.workers
        hands = trials.hands or hands_of(self.hands)
        assert not isinstance(hands, str)
        print(hands_table({self.hands: hands}))
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
        console.deliver(Robustness(result, band), self.out, self.figures)
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


def hands_table(populations: Mapping[str, Hands]) -> str:
    """Populations of hands, for a terminal."""
    rows = [hands.row(name) for name, hands in populations.items()]
    return text_table(table_of(HANDS_HEAD, rows))


def _announce(cost: Cost, workers: int, out: Path, bar: Any) -> None:
    """Shows the runs that are stored already, and prints what the others will take."""
    bar.update(bar.total - cost.runs - bar.n)
    console.announce(f"{cost.runs} runs", cost.seconds, workers, cost.size, out / "data")
