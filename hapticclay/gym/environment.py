"""A Gymnasium environment: one copy of a task."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError, choice
from ..simulation.engines import ENGINES
from .episodes import Episodes
from .quantities import box_of
from .task import DT, Arrays, Task

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
        self.task = self.task_type(ranges, **options)
        self._episodes = Episodes(self.task, 1, choice("engine", engine, ENGINES))
        self.action_space = box_of(self.task.actions)
        self.observation_space = box_of(self.task.observations)
        self._picture: Any = None
        self._live = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Starts an episode.

        Args:
            seed: seed of the generator; None to keep the present generator.
            options: values to use instead of drawn ones, by name.

        Raises:
            ParameterError: a name is unknown, or a value out of its bounds.
        """
        super().reset(seed=seed)
        self._episodes.reset([0], [self.np_random], options)
        self._live = True
        self._begin_picture()
        return self._episodes.observe()[0], numbers_of_copy(self._episodes.info(), 0)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advances by one control period.

        Args:
            action: action, clipped to the action space.

        Raises:
            ParameterError: the action has the wrong shape.
            RuntimeError: the environment was not reset.
        """
        if not self._live:
            raise RuntimeError("reset the environment before its first step")
        action = np.asarray(action)
        if action.shape != self.action_space.shape:
            bound = f"must have shape {self.action_space.shape}, has {action.shape}"
            raise ParameterError("action", action, bound)
        found = self._episodes.step(action[None, :], np.ones(1, bool))
        self._show()
        info = numbers_of_copy(self._episodes.info() | found.info, 0)
        return found.observations[0], float(found.rewards[0]), bool(found.ended[0]), False, info

    def render(self) -> Any:
        """A picture of the scene from above, shape (h, w, 3), in mode "rgb_array"."""
        if self.render_mode is None:
            gymnasium.logger.warn("give render_mode to gymnasium.make to see pictures")
            return None
        if not self._live:
            raise RuntimeError("reset the environment before it is drawn")
        return self._picture.drawn(self._episodes) if self.render_mode == "rgb_array" else None

    def _begin_picture(self) -> None:
        if self.render_mode is not None:
            from .picture import Picture

            self._picture = self._picture or Picture(self.task, self.render_mode == "human")
            self._picture.begin()
            self._show()

    def _show(self) -> None:
        if self._picture is not None:
            self._picture.note(self._episodes.handles.p[0])
            if self.render_mode == "human":
                self._picture.drawn(self._episodes)

    def close(self) -> None:
        """Ends the run and closes the window, if any."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None
        self._episodes.copies.close()
        self._live = False


def numbers_of_copy(info: Arrays, i: int) -> dict[str, Any]:
    """Info of one copy, as Python numbers.

    Args:
        info: numbers by name, shape (n,) each.
        i: number of the copy.
    """
    return {name: x[i].item() for name, x in info.items()}


def fps_of(task: type[Task]) -> int:
    """Control periods per second of a task.

    Args:
        task: its class.
    """
    return round(1.0 / (task.steps * DT))
