"""Minari data sets: episodes of a baseline with noise on its actions."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from .. import __version__
from ..errors import choice, integer, needing, number
from .baselines import BASELINES, at_random, mean_of, returns
from .registry import NAMESPACE

BASELINE = {  # baseline whose actions are recorded
    "CutLine-v0": "PD along the line",
    "PareEdge-v0": "PD along the line",
    "AdaptiveGain-v0": "robust gain",
    "ProbeClay-v0": "least squares",
}
SCORED = 20  # episodes behind the scores stored with a data set


def record(
    id: str, name: str, episodes: int, noise: float = 0.1, seed: int = 0, engine: str = "auto"
) -> Any:
    """Records episodes of the environment's baseline as a Minari data set.

    Args:
        id: id of the environment, as "CutLine-v0".
        name: name of the data set, as "hapticclay/cut-line/pd-v0".
        episodes: number of episodes, 1 to 100000; episode i has the seed `seed` + i.
        noise: standard deviation added to each action, 0 to 1.
        seed: seed of the first episode.
        engine: as in `Simulation`.

    Returns:
        The data set, a minari.MinariDataset.

    Raises:
        ParameterError: an argument is refused, or Minari is not installed.
    """
    with needing("a data set", "minari", "minari"):
        import minari  # pyright: ignore[reportMissingImports]

    maker = BASELINES[id][BASELINE[choice("id", id, tuple(BASELINE))]]
    episodes = integer("episodes", episodes, 1, 100_000)
    noise = number("noise", noise, 0.0, 1.0)
    env = minari.DataCollector(gymnasium.make(f"{NAMESPACE}/{id}", engine=engine))
    task, rng = env.unwrapped.task, np.random.default_rng(seed)  # type: ignore[attr-defined]
    for i in range(episodes):
        observation, info = env.reset(seed=seed + i)
        policy, over = maker(task, [info], 0), False
        while not over:
            action = policy(observation[None])[0]
            action = np.clip(action + noise * rng.standard_normal(action.shape), -1.0, 1.0)
            observation, _, ended, cut_off, _ = env.step(action.astype(np.float32))
            over = ended or cut_off
    scores = [
        mean_of(returns(id, made, range(SCORED), engine=engine).total)[0]
        for made in (at_random, maker)
    ]
    with needing("a data set", "minari[create]", "minari"):
        made = env.create_dataset(
            dataset_id=name,
            algorithm_name=f"{BASELINE[id]}, noise {noise:g}",
            author="The hapticclay authors",
            author_email="none given",
            eval_env=f"{NAMESPACE}/{id}",
            code_permalink=f"hapticclay {__version__}: hapticclay/gym/dataset.py",
            description=f"{BASELINE[id]} in {NAMESPACE}/{id} of hapticclay {__version__}",
            ref_min_score=min(scores),
            ref_max_score=max(scores),
        )
    env.close()
    return made
