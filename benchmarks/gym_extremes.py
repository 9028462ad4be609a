"""Episodes of random actions with extreme draws: no exception, no NaN, no growth of memory.

    python -m benchmarks.gym_extremes [--out DIR] [--episodes N] [--longest N]

Each number of an episode is drawn over all that its option allows, its ends among them; actions
jump between -1, 0 and 1. Writes gym_extremes.json.
"""

from __future__ import annotations

import sys
import warnings
from typing import Any

import gymnasium
import numpy as np

import hapticclay as hc
from hapticclay.gym import registry

from . import common
from .gym_speed import memory

EPISODES, COPIES = 2500, 64  # of each of the four environments
LONGEST = 60  # control periods of an episode


def extreme(task: Any, rng: np.random.Generator) -> dict[str, float]:
    """Return options of an episode: each at an end of what is allowed, or between them."""
    found = {}
    for name, r in task.ranges.items():
        low, high = max(r.least, 1e-12), r.most
        between = low * (high / low) ** rng.random() if r.log else rng.uniform(r.least, r.most)
        found[name] = float(rng.choice((r.least, r.most, min(max(between, r.least), r.most))))
    return found


def tried(id: str, engine: str, episodes: int, longest: int = LONGEST) -> dict[str, Any]:
    """Return what was seen in an environment's episodes."""
    n = min(COPIES, episodes)
    env: Any = gymnasium.make_vec(
        id, num_envs=n, engine=engine, autoreset_mode="DISABLED", max_episode_steps=longest
    )
    rng, inner = np.random.default_rng(0), env.unwrapped
    done, refused, bad, steps, lost = 0, 0, 0, 0, 0
    env.reset(seed=0)
    over, first = np.ones(n, bool), 0.0
    while done < episodes:
        for i in np.flatnonzero(over).tolist():
            mask = np.arange(n) == i
            while True:
                try:
                    env.reset(options={"reset_mask": mask, **extreme(inner.task, rng)})
                    break
                except hc.ParameterError:  # a scene that cannot be, as clay too stiff for a step
                    refused += 1
        actions = rng.choice((-1.0, 0.0, 1.0), env.action_space.shape).astype(np.float32)
        x, reward, ended, cut_off, info = env.step(actions)
        bad += int(not (np.isfinite(x).all() and np.isfinite(reward).all()))
        bad += int(not env.observation_space.contains(x))
        over, steps = ended | cut_off, steps + n
        lost += int((info["lost"] & over).sum())
        done += int(over.sum())
        if not first and done > episodes // 4:
            first = memory()
    grown = memory() - first
    env.close()
    return {
        "id": id, "episodes": done, "steps": steps, "refused": refused, "bad": bad, "lost": lost,
        "grown_MB": grown,
    }  # fmt: skip


def main(argv: list[str] | None = None) -> dict[str, Any]:
    """Try, print and write."""
    parser = common.parser(__doc__)
    parser.add_argument("--episodes", type=int, default=EPISODES)
    parser.add_argument("--longest", type=int, default=LONGEST)
    parser.add_argument("--engine", default="native")
    parser.add_argument("--ids", nargs="*", default=list(registry.IDS))
    a = parser.parse_args(argv)
    rows = []
    for id in a.ids:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", hc.Warning)  # of scenes beyond what a person is
            rows.append(tried(id, a.engine, a.episodes, a.longest))
        print(", ".join(f"{name} {value}" for name, value in rows[-1].items()), flush=True)
    return common.write(a.out, "gym_extremes", {"environments": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
