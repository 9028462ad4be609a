"""Adapter from vector environments to Stable-Baselines3."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np

from ..errors import ParameterError, choice, integer, needing
from .registry import ENTRIES, NAMESPACE
from .vector import MOST_COPIES, TaskVectorEnv

with needing("hapticclay.gym.stable_baselines", "stable_baselines3", "sb3"):
    from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]


class StableBaselinesVecEnv(VecEnv):
    """Many copies of a task for algorithms of Stable-Baselines3.

    When an episode ends, the next one starts in the same step. The infos then contain the last
    observation as `terminal_observation` and truncation as `TimeLimit.truncated`.

    `seed(s)` gives copy i the seed s + i, and `set_options` takes options of a reset for all
    copies or one dictionary for each; both count for the next `reset`.

    Args:
        env: the vector environment, or its name, as "CutLine-v0".
        num_envs: number of copies, if env is a name; None for 1.
        **options: options of the environment, if env is a name.

    Raises:
        ParameterError: env is wrapped or of another class, does not restart episodes in the same
            step, or comes with options of one that is to be made.
    """

    def __init__(self, env: TaskVectorEnv | str, num_envs: int | None = None, **options: Any):
        if isinstance(env, str):
            env = _made(env, 1 if num_envs is None else num_envs, options)
        elif isinstance(env, gymnasium.vector.VectorWrapper):
            bound = "must be the vector environment itself, env.unwrapped"
            remedy = "wrap the adapter instead, with wrappers of Stable-Baselines3"
            raise ParameterError("env", env, f"{bound}; {remedy}")
        elif not isinstance(env, TaskVectorEnv):
            bound = f"must be a TaskVectorEnv, or a name, one of {', '.join(ENTRIES)}"
            raise ParameterError("env", env, bound)
        elif num_envs is not None or options:
            given = {"num_envs": num_envs, **options} if num_envs is not None else options
            raise ParameterError("options", given, "must not be given with an environment")
        if env.autoreset_mode is not gymnasium.vector.AutoresetMode.SAME_STEP:
            bound = "must be 'SAME_STEP' for Stable-Baselines3"
            raise ParameterError("autoreset_mode", env.autoreset_mode.name, bound)
        self.env, self.render_mode = env, env.render_mode
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._actions = np.zeros(env.action_space.shape or (), np.float32)

    def reset(self) -> np.ndarray:
        """Starts episodes with the seeds and options that were set."""
        seeds = self._seeds if any(x is not None for x in self._seeds) else None
        observations, infos = self.env.reset(seed=seeds, options=self._options)
        self.reset_infos = [_of_copy(infos, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Keeps the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Advances by one control period."""
        observations, rewards, ended, cut_off, infos = self.env.step(self._actions)
        over = ended | cut_off
        copies = []
        for i in range(self.num_envs):
            if over[i]:
                info = _of_copy(infos["final_info"], i)
                info["terminal_observation"] = infos["final_obs"][i]
                self.reset_infos[i] = _of_copy(infos, i)
            else:
                info = _of_copy(infos, i)
            info["TimeLimit.truncated"] = bool(cut_off[i] and not ended[i])
            copies.append(info)
        return observations, rewards.astype(np.float32), over, copies

    def close(self) -> None:
        """Ends the runs."""
        self.env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of each copy, in mode "rgb_array"."""
        return self.env.render() or [None] * self.num_envs

    def _indices(self, indices: None | int | Iterable[int]) -> list[int]:
        return list(self._get_indices(indices))

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute, common to all copies."""
        return [getattr(self.env, attr_name) for _ in self._indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Sets an attribute, common to all copies."""
        if indices is not None:
            raise ParameterError("indices", indices, "must be None: the copies share attributes")
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refused: the copies are not separate environments."""
        raise ParameterError("method_name", method_name, "must be none: copies have no methods")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Whether the copies are wrapped: always False."""
        return [False for _ in self._indices(indices)]


def _made(name: str, num_envs: int, options: dict[str, Any]) -> TaskVectorEnv:
    """A vector environment by its name."""
    id = f"{NAMESPACE}/{choice('env', name, tuple(ENTRIES))}"
    given = {"autoreset_mode": "SAME_STEP", **options}
    made: Any = gymnasium.make_vec(id, integer("num_envs", num_envs, 1, MOST_COPIES), **given)
    return made.unwrapped


def _of_copy(infos: dict[str, Any], i: int) -> dict[str, Any]:
    """The infos of one copy."""
    return {
        name: x[i].item()
        for name, x in infos.items()
        if not name.startswith(("_", "final")) and infos[f"_{name}"][i]
    }
