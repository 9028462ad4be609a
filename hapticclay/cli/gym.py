"""`hapticclay gym`: baselines of the learning environments, and data sets of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from ..display import text_table
from ..errors import Bound
from .console import progress_bar
from .options import Loose
from .unused import Unused

SEEDS, EPISODES, NOISE = 100, 100, 0.1  # where none is given


@dataclass(frozen=True)
class GymCommand:
    """Run the baselines of a learning environment, or record a Minari data set with one.

    `gym baselines` prints the mean return of each policy that does not learn. `gym dataset` records
    episodes of the best policy among them that uses only what an agent observes, with noise on its
    actions. After an interruption the same command continues with the episodes that are missing.

    Attributes:
        action: baselines or dataset.
        env: CutLine-v0, PareEdge-v0, AdaptiveGain-v0 or ProbeClay-v0.
        seeds: Episodes of each baseline, 2 to 100000; 100 by default.
        episodes: Episodes of a data set, 1 to 100000; 100 by default.
        noise: Standard deviation added to the actions of a data set, 0 to 1; 0.1 by default.
        name: Name of the data set; by default hapticclay/ENV/baseline-v0.
        engine: auto, python or native.
    """

    action: Loose[Literal["baselines", "dataset"]]
    env: Loose[Literal["CutLine-v0", "PareEdge-v0", "AdaptiveGain-v0", "ProbeClay-v0"]] = (
        "CutLine-v0"
    )
    seeds: Annotated[int | None, Bound(2, 100_000)] = None
    episodes: int | None = None
    noise: float | None = None
    name: str | None = None
    engine: Literal["auto", "python", "native"] = "auto"

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("seeds",), "is for baselines: say gym baselines", ("action=dataset",)),
        Unused(
            ("episodes", "noise", "name"),
            "is for a data set: say gym dataset",
            ("action=baselines",),
        ),
    )

    def __call__(self) -> int:
        return self._dataset() if self.action == "dataset" else self._baselines()

    def _baselines(self) -> int:
        from ..gym import baselines, scores

        seeds = SEEDS if self.seeds is None else self.seeds
        found = {
            name: baselines.returns(self.env, maker, range(seeds), engine=self.engine)
            for name, maker in baselines.BASELINES[self.env].items()
        }
        means = {name: baselines.mean_of(x.total) for name, x in found.items()}
        table: dict[str, list] = {
            "policy": list(found),
            "return": [mean for mean, _ in means.values()],
            "95 % interval +-": [half for _, half in means.values()],
            "periods": [x.length.mean() for x in found.values()],
        }
        if score := scores.scores_of(self.env, {name: mean for name, (mean, _) in means.items()}):
            table["score"] = [score[name] for name in found]
        print(text_table(table, dict.fromkeys(table, ".2f") | {"periods": ".0f"}))
        return 0

    def _dataset(self) -> int:
        from ..gym import dataset

        episodes = EPISODES if self.episodes is None else self.episodes
        noise = NOISE if self.noise is None else self.noise
        stem = self.env.partition("-")[0].lower()
        name = f"hapticclay/{stem}/baseline-v0" if self.name is None else self.name
        kept = [0]
        with progress_bar(total=episodes, desc="episodes") as bar:

            def show(count: int) -> None:
                kept[0] = count
                bar.update(count - bar.n)

            try:
                made = dataset.record(
                    self.env, name, episodes, noise, engine=self.engine, progress=show
                )
            except KeyboardInterrupt:
                if kept[0]:
                    share = f"{kept[0]} of {episodes} episodes are kept"
                    print(f"{share}; the same command continues the recording")
                raise
        print(f"{name}: {made.total_episodes} episodes, {made.total_steps} steps")
        return 0
