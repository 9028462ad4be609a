"""`hapticclay gym`: baselines of the learning environments, and data sets of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import tyro

from ..errors import ParameterError, integer, number
from .console import text_table
from .unused import Unused


@dataclass(frozen=True)
class GymCommand:
    """Run the baselines of a learning environment, or record a Minari data set with one.

    `gym baselines` prints the mean return of each policy that does not learn. `gym dataset` records
    episodes of the best policy among them that uses only what an agent observes, with noise on its
    actions.

    Attributes:
        action: baselines or dataset.
        env: CutLine-v0, PareEdge-v0, AdaptiveGain-v0 or ProbeClay-v0.
        seeds: Episodes of each baseline, 2 to 100000.
        episodes: Episodes of a data set, 1 to 100000.
        noise: Standard deviation added to the actions of a data set, 0 to 1.
        name: Name of the data set; by default hapticclay/ENV/baseline-v0.
        engine: auto, python or native.
    """

    action: Annotated[Literal["baselines", "dataset"], tyro.conf.Positional]
    env: Annotated[
        Literal["CutLine-v0", "PareEdge-v0", "AdaptiveGain-v0", "ProbeClay-v0"],
        tyro.conf.Positional,
    ] = "CutLine-v0"
    seeds: int = 100
    episodes: int = 100
    noise: float = 0.1
    name: str | None = None
    engine: Literal["auto", "python", "native"] = "auto"

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("seeds",), "is for baselines: say gym baselines", ("action=dataset",)),
        Unused(("episodes", "noise"), "is for a data set: say gym dataset", ("action=baselines",)),
    )

    def __call__(self) -> int:
        integer("seeds", self.seeds, 2, 100_000)
        integer("episodes", self.episodes, 1, 100_000)
        number("noise", self.noise, 0.0, 1.0)
        return self._dataset() if self.action == "dataset" else self._baselines()

    def _baselines(self) -> int:
        from ..gym import baselines

        if self.name is not None:
            raise ParameterError("name", self.name, "is for a data set: say gym dataset")
        rows = []
        for name, maker in baselines.BASELINES[self.env].items():
            found = baselines.returns(self.env, maker, range(self.seeds), engine=self.engine)
            mean, half = baselines.mean_of(found.total)
            rows.append([name, f"{mean:.2f}", f"{half:.2f}", f"{found.length.mean():.0f}"])
        columns = ("policy", "return", "95 % interval +-", "periods")
        print(text_table(rows, columns, "lrrr"))
        return 0

    def _dataset(self) -> int:
        from ..gym import dataset

        stem = self.env.partition("-")[0].lower()
        name = self.name or f"hapticclay/{stem}/baseline-v0"
        made = dataset.record(self.env, name, self.episodes, self.noise, engine=self.engine)
        print(f"{name}: {made.total_episodes} episodes, {made.total_steps} steps")
        return 0
