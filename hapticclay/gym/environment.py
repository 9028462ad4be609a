"""A Gymnasium environment: one copy of a task."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ..errors import choice
from ..simulation.engines import ENGINES
from .draws import fixed_by
from .episodes import Episodes, One
from .inputs import action_of, options_of, seed_of, task_of
from .quantities import box_of
from .task import DT, Task

if TYPE_CHECKING:
    from .picture import Picture

FPS = 50
MODES = ["human", "rgb_array"]


class TaskEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One copy of a task.

    Args:
        render_mode: "human", "rgb_array" or None.
        engine: as in `Simulation`: "auto", "python" or "native".
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        **options: options of the task.

    Raises:
        ParameterError: an argument is refused.
    """

    metadata: dict[str, Any] = {"render_modes": MODES, "render_fps": FPS}  # noqa: RUF012
    task_type: ClassVar[type[Task]]

    def __init__(
        self,
        render_mode: str | None = None,
        engine: str = "auto",
        ranges: Mapping[str, Any] | None = None,
        **options: Any,
    ):
        if render_mode is not None:
            choice("render_mode", render_mode, MODES)
        self.render_mode = render_mode
        self.task = task_of(self.task_type, ranges, options, self)
        self._episodes = Episodes(self.task, One, choice("engine", engine, ENGINES))
        self.action_space = box_of(self.task.actions)
        self.observation_space = box_of(self.task.observations)
        self._shape = (len(self.task.actions),)
        self._picture: Picture | None = None
        self._warned = False
        self._live = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Starts an episode.

        Args:
            seed: seed of the generator; None to keep the present generator.
            options: values to use instead of drawn ones, by name.

        Raises:
            ParameterError: the seed is refused, a name is unknown, or a value out of its bounds;
                or the values make no scene, and there is no episode until the next reset.
        """
        fixed = fixed_by(self.task.ranges, options_of(options))
        super().reset(seed=seed_of("seed", seed))
        self._live = False
        self._episodes.reset([0], [self.np_random], [fixed])
        self._live = True
        if self.render_mode is not None:
            self._shown_by().begin()
            self._show()
        return self._episodes.observe(), dict(self._episodes.truth)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advances by one control period.

        Args:
            action: finite numbers, shape (k,), clipped to the action space.

        Raises:
            ParameterError: the action has another shape, or is not of finite real numbers.
            RuntimeError: the environment was not reset.
        """
        if not self._live:
            raise RuntimeError("reset the environment before its first step")
        numbers = action_of("action", action, self._shape)
        observation, reward, ended, info = self._episodes.step(numbers.tolist())
        if self.render_mode is not None:
            self._show()
        return observation, reward, ended, False, self._episodes.truth | info

    def render(self) -> Any:
        """A picture of the scene from above, shape (h, w, 3), in mode "rgb_array"."""
        if self.render_mode is None:
            gymnasium.logger.warn("give render_mode to gymnasium.make to see pictures")
            return None
        if not self._live:
            raise RuntimeError("reset the environment before it is drawn")
        return self._drawn() if self.render_mode == "rgb_array" else None

    def __getstate__(self) -> dict[str, Any]:
        """What a copy or a pickle keeps: all but the picture, whose path starts anew in it."""
        return self.__dict__ | {"_picture": None}

    def _drawn(self) -> Any:
        now = self._episodes
        return self._shown_by().drawn(now.truth, now.memory, now.handle)

    def _shown_by(self) -> Picture:
        """The picture; a new one at the first reset, after `close` and in a copy."""
        if self._picture is None:
            from .picture import Picture

            self._picture = Picture(self.task, self.render_mode == "human")
            if self._picture.unseen and not self._warned:
                shown = "render_mode='human' shows nothing here"
                gymnasium.logger.warn(
                    f"{shown}: {self._picture.unseen}; 'rgb_array' needs no display"
                )
                self._warned = True
        return self._picture

    def _show(self) -> None:
        picture = self._shown_by()
        picture.note(self._episodes.handle.p)
        if self.render_mode == "human" and not picture.unseen:
            self._drawn()

    def close(self) -> None:
        """Ends the run and closes the window, if any."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None
        self._episodes.close()
        self._live = False


def fps_of(task: type[Task]) -> int:
    """Control periods per second of a task."""
    return round(1.0 / (task.steps * DT))
