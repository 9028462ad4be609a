"""A Gymnasium environment: one copy of a task."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ..arguments import checked
from .draws import fixed_by
from .episodes import Episodes, One
from .inputs import action_of, options_of, seed_of, task_of
from .quantities import box_of
from .task import Task

if TYPE_CHECKING:
    from .picture import Picture

FPS = 50
MODES = ["human", "rgb_array"]
Engine = Literal["auto", "python", "native"]


class TaskEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One copy of a task.

    Args:
        render_mode: "human", "rgb_array" or None.
        engine: "auto", "python" or "native", as in `Simulation`.
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        **options: options of the task.

    Raises:
        ParameterError: an argument is refused.
    """

    metadata: dict[str, Any] = {"render_modes": MODES, "render_fps": FPS}  # noqa: RUF012
    task_type: ClassVar[type[Task]]

    @checked
    def __init__(
        self,
        render_mode: Literal["human", "rgb_array"] | None = None,
        engine: Engine = "auto",
        ranges: Any = None,
        **options: Any,
    ):
        self.render_mode = render_mode
        self.task = task_of(self.task_type, ranges, options, self)
        self._episodes = Episodes(self.task, One, engine)
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
            self._present_picture().begin()
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
            RuntimeError: the environment was not reset, or not after a step that was interrupted.
        """
        if not self._live:
            raise RuntimeError("reset the environment before its first step")
        numbers = action_of("action", action, self._shape)
        self._live = False  # a step that is interrupted has no end from which to go on
        observation, reward, ended, info = self._episodes.step(numbers.tolist())
        self._live = True
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
        return self._draw() if self.render_mode == "rgb_array" else None

    def __getstate__(self) -> dict[str, Any]:
        """What a copy or a pickle keeps: all but the picture, whose path starts anew in it."""
        return self.__dict__ | {"_picture": None}

    def _draw(self) -> Any:
        now = self._episodes
        return self._present_picture().draw(now.truth, now.memory, now.handle)

    def _present_picture(self) -> Picture:
        """The picture; a new one at the first reset, after `close` and in a copy."""
        if self._picture is None:
            from .picture import Picture

            self._picture = Picture(self.task, self.render_mode == "human")
            if self._picture.unseen and not self._warned:
                fault = f"render_mode='human' shows nothing here: {self._picture.unseen}"
                gymnasium.logger.warn(f"{fault}; 'rgb_array' needs no display")
                self._warned = True
        return self._picture

    def _show(self) -> None:
        picture = self._present_picture()
        picture.note(self._episodes.handle.p)
        if self.render_mode == "human" and not picture.unseen:
            self._draw()

    def close(self) -> None:
        """Ends the run and closes the window, if any."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None
        self._episodes.close()
        self._live = False
