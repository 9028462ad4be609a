"""A Gymnasium vector environment: many copies of a task, advanced by one call."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ..arguments import checked
from ..errors import Bound, ParameterError, choice, integer
from .draws import Truth, fixed_by
from .environment import FPS, MODES, Engine
from .episodes import Episodes, Many, Period
from .inputs import action_of, options_of, seeds_of, task_of
from .quantities import box_of
from .task import Memory, Task

MOST_COPIES = 100_000


class TaskVectorEnv(VectorEnv):
    """Many copies of a task. Copy i with seed s gives the same numbers as one with seed s + i.

    Args:
        num_envs: number of copies, 1 to 100000.
        max_episode_steps: control periods after which an episode is truncated; None for the task's.
        autoreset_mode: "NEXT_STEP", "SAME_STEP" or "DISABLED", as a word or a member of
            `AutoresetMode`.
        render_mode: "rgb_array" or None.
        engine: "auto", "python" or "native", as in `Simulation`.
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        **options: options of the task.

    Raises:
        ParameterError: an argument is refused.
    """

    task_type: ClassVar[type[Task]]

    @checked
    def __init__(
        self,
        num_envs: Annotated[int, Bound(1, MOST_COPIES)] = 1,
        max_episode_steps: Annotated[int | None, Bound(1, 1_000_000_000)] = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: Literal["rgb_array"] | None = None,
        engine: Engine = "auto",
        ranges: Any = None,
        **options: Any,
    ):
        self.num_envs = num_envs
        self.autoreset_mode = mode_of(autoreset_mode)
        self.metadata = {
            "render_modes": MODES[1:], "render_fps": FPS, "autoreset_mode": self.autoreset_mode,
        }  # fmt: skip
        self.render_mode = render_mode
        self.task = task_of(self.task_type, ranges, options, self)
        self._most = self.task.limit if max_episode_steps is None else max_episode_steps
        self.single_action_space = box_of(self.task.actions)
        self.single_observation_space = box_of(self.task.observations)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._episodes = Episodes(self.task, Many, engine)
        self._generators: list[np.random.Generator] = []
        self._seeds: list[int] = []
        self._count = np.zeros(self.num_envs, np.int64)
        self._over = np.ones(self.num_envs, bool)
        self._is_amid = False  # a call, or one was interrupted: copies differ in their period
        self._pictures: list[Any] = []

    @property
    def np_random(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
    ) -> tuple[np.random.Generator, ...]:
        """The generator of each copy."""
        return tuple(self._generators)

    @property
    def np_random_seed(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
    ) -> tuple[int, ...]:
        """The seed of each copy."""
        return tuple(self._seeds)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | Sequence[Mapping[str, Any] | None] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Starts episodes.

        Args:
            seed: seed of the first copy, counted up for the others; or one seed per copy; None to
                keep the present generators.
            options: values to use instead of drawn ones, by name, for all copies; or such a
                dictionary for each copy. In the first form also "reset_mask", which copies to
                reset, shape (n,), bool.

        Raises:
            ParameterError: a seed or the mask is refused, a name is unknown, or a value out of its
                bounds; or the values make no scene, and the copies have no episode until the next
                reset.
        """
        fixed, mask = self._options(options)
        seeds = seeds_of(seed, self.num_envs)
        self.closed = False
        if not self._generators:
            pairs = [seeding.np_random() for _ in range(self.num_envs)]
            self._generators, self._seeds = map(list, zip(*pairs, strict=True))
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._generators[i], self._seeds[i] = seeding.np_random(seeds[i])
        with self._whole():
            self._begin(mask, fixed)
        return self._episodes.observe(), _masked(self._episodes.truth, mask)

    def _options(self, given: Any) -> tuple[list[Truth], np.ndarray]:
        """Values to use instead of drawn ones, of each copy; and which copies to reset."""
        n = self.num_envs
        if isinstance(given, list | tuple):
            if len(given) != n:
                raise ParameterError("options", given, f"must be a dictionary, or {n} of them")
            fixed = [fixed_by(self.task.ranges, options_of(x)) for x in given]
            return fixed, self._mask(None)
        common = options_of(given)
        mask = self._mask(common.pop("reset_mask", None))
        return [fixed_by(self.task.ranges, common)] * n, mask

    def _mask(self, given: Any) -> np.ndarray:
        """Which copies to reset, from the option "reset_mask"."""
        n = self.num_envs
        if given is None:
            return np.ones(n, bool)
        bound = f"must be {n} bools, one of them True"
        try:
            mask = np.array(given)
        except ValueError:  # rows of unequal length
            raise ParameterError("reset_mask", given, bound) from None
        if mask.shape != (n,) or mask.dtype != bool or not mask.any():
            raise ParameterError("reset_mask", given, bound)
        if (self._is_amid or not self._episodes.begun) and not mask.all():
            bound = "must be True for all at the first reset, and after an interrupted call"
            raise ParameterError("reset_mask", given, bound)
        return mask

    def _begin(self, mask: np.ndarray, fixed: Sequence[Truth] | None = None) -> None:
        """Starts the episodes of some copies."""
        which = np.flatnonzero(mask).tolist()
        self._over[mask] = True  # and stays so where the values drawn are refused
        given = [{} if fixed is None else fixed[i] for i in which]
        self._episodes.reset(which, [self._generators[i] for i in which], given)
        self._count[mask] = 0
        self._over[mask] = False
        for i in which if self._pictures else ():
            self._pictures[i].begin()

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advances all copies by one control period.

        Args:
            actions: finite numbers, shape (n, k), clipped to the action space.

        Raises:
            ParameterError: the actions have another shape, or are not of finite real numbers.
            RuntimeError: there was no reset, or not after an interrupted call; or an episode is
                over with autoreset "DISABLED".
        """
        numbers = action_of("actions", actions, (self.num_envs, len(self.task.actions)))
        live = ~self._over
        if self._is_amid or not self._episodes.begun:
            raise RuntimeError("reset the environments before their first step")
        if self.autoreset_mode is AutoresetMode.DISABLED and not live.all():
            raise RuntimeError("an episode is over: reset its copy before the next step")
        with self._whole():
            return self._step(numbers, live)

    def _step(
        self, numbers: np.ndarray, live: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        found = self._episodes.step(numbers.T, live)
        self._count += live
        ended = found.ended & live
        cut_off = (self._count >= self._most) & live
        self._over = over = ended | cut_off
        again, final = ~live, {}  # the episode ended before this step, or its restart was refused
        if self.autoreset_mode is AutoresetMode.SAME_STEP and over.any():
            again, final = again | over, self._final(found, over.copy())
        observations = found.observation
        if again.any():
            self._begin(again)
            observations = self._episodes.observe()
        everywhere = np.ones(self.num_envs, bool)
        infos = _masked(self._episodes.truth, everywhere) | _masked(found.info, live & ~again)
        return observations, np.where(live, found.reward, 0.0), ended, cut_off, infos | final

    @contextlib.contextmanager
    def _whole(self) -> Iterator[None]:
        """Notes where Ctrl-C, but not an error, ended a call."""
        self._is_amid = True
        try:
            yield
        except Exception:
            self._is_amid = False
            raise
        self._is_amid = False

    def _final(self, found: Period, over: np.ndarray) -> dict[str, Any]:
        """Observations and infos of the episodes that are over, as Gymnasium hands them out."""
        last = np.full(self.num_envs, None, object)
        for i in np.flatnonzero(over).tolist():
            last[i] = found.observation[i].copy()
        info = _masked(self._episodes.truth | found.info, over)
        final = {"final_obs": last, "final_info": info}
        return final | {f"_{name}": over.copy() for name in final}

    def render(self) -> tuple[Any, ...] | None:
        """A picture of each copy from above, in mode "rgb_array"."""
        if self.render_mode is None:
            gymnasium.logger.warn("give render_mode to gymnasium.make_vec to see pictures")
            return None
        if not self._episodes.begun:
            raise RuntimeError("reset the environments before they are drawn")
        from .picture import Picture

        if not self._pictures:
            self._pictures = [Picture(self.task, False) for _ in range(self.num_envs)]
        frames = []
        for i, picture in enumerate(self._pictures):
            truth, memory, handle = self._episodes.copy(i)
            picture.note(handle.p)
            frames.append(picture.draw(truth, memory, handle))
        return tuple(frames)

    def info_of(self, i: int) -> dict[str, Any]:
        """The numbers drawn for a copy.

        Args:
            i: number of the copy, 0 to n - 1.

        Raises:
            ParameterError: there is no such copy.
            RuntimeError: there was no reset.
        """
        if not self._episodes.begun:
            raise RuntimeError("reset the environments before their first step")
        return self._episodes.truth_of(integer("i", i, 0, self.num_envs - 1))

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Refused: the copies run in threads.

        Raises:
            TypeError: always.
        """
        remedy = "make another with the same arguments, or take single environments"
        raise TypeError(f"{type(self).__name__} cannot be copied or pickled: {remedy}")

    def close_extras(self, **_: Any) -> None:
        """Ends the runs."""
        for picture in self._pictures:
            picture.close()
        self._pictures = []
        self._episodes.close()


def mode_of(given: str | AutoresetMode) -> AutoresetMode:
    """An autoreset mode, given as a member or by name."""
    if isinstance(given, AutoresetMode):
        return given
    return AutoresetMode[choice("autoreset_mode", given, [x.name for x in AutoresetMode])]


def _masked(info: Memory, mask: np.ndarray) -> dict[str, Any]:
    """Info in the form of Gymnasium: arrays, with masks of the copies that have a value."""
    found: dict[str, Any] = {}
    every = mask.all()
    for name, x in info.items():
        found[name] = x.copy() if every else np.where(mask, x, np.zeros_like(x))
        found[f"_{name}"] = mask.copy()
    return found
