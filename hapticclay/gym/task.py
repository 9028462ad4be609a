"""Tasks: random scenes, actions, observations and rewards, for many copies at once.

The functions of a task work on arrays with one row per copy. Array operations are limited to +, -,
*, / and square roots; all others use `math`, number by number. So a row depends only on its own
copy, bit for bit, for any number of copies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..model.constants import GAIN
from ..model.operator import Operator
from ..scene.scenario import Scenario
from .draws import Range, Truth, with_ranges
from .quantities import Quantity

DT = 3.5714286e-4  # [s] 56 steps are 20 ms, and a step is at most the paper's 0.36 ms
FORCE = 30.0  # [N] muscle force at an action of 1
Arrays = dict[str, Any]  # one row per copy


class Handles(NamedTuple):
    """State of the handles at the end of a control period, one row per copy.

    Attributes:
        p: position [m], shape (n, 2).
        v: velocity [m/s], shape (n, 2).
        fh: force of the hand on the handle [N], shape (n, 2).
        fe: resisting force of the clay [N], shape (n, 2).
        diverged: whether the run is unstable or over, shape (n,).
    """

    p: np.ndarray
    v: np.ndarray
    fh: np.ndarray
    fe: np.ndarray
    diverged: np.ndarray


class Command(NamedTuple):
    """Command for a control period.

    Attributes:
        force: muscle force on the handle [N], shape (n, 2).
        gain: K of the compensator [1/kg], shape (n, 2); None to keep it.
    """

    force: np.ndarray
    gain: np.ndarray | None = None


class Judged(NamedTuple):
    """Reward of a control period.

    Attributes:
        reward: reward, shape (n,).
        ended: whether the episode is over, shape (n,).
        info: numbers by name, shape (n,) each.
    """

    reward: np.ndarray
    ended: np.ndarray
    info: Arrays


@dataclass(frozen=True)
class Task:
    """A task: its numbers and functions, independent of the engine.

    Attributes:
        given: ends (low, high) of ranges other than the task's own, by name; None for none.
        period: control period [s].
        steps: engine steps per control period.
        limit: control periods after which an episode is truncated.
        strain: share of the torque limit beyond which a run counts as unstable.
        actions: quantities of an action.
        observations: quantities of an observation.
        drawn: ranges of the numbers drawn for each episode.
        ranges: these ranges with the given ends.
    """

    given: Mapping[str, Any] | None = None
    ranges: dict[str, Range] = field(init=False)
    steps: ClassVar[int] = 56
    limit: ClassVar[int] = 500
    strain: ClassVar[float] = 1.0
    actions: ClassVar[tuple[Quantity, ...]]
    drawn: ClassVar[dict[str, Range]]

    def __post_init__(self):
        object.__setattr__(self, "ranges", with_ranges(self.drawn, self.given))

    @property
    def period(self) -> float:
        """Control period [s]."""
        return self.steps * DT

    @property
    def observations(self) -> tuple[Quantity, ...]:
        """Quantities of an observation."""
        raise NotImplementedError

    def scenario(self, truth: Truth) -> Scenario:
        """The scene of an episode.

        Args:
            truth: numbers drawn, by name.
        """
        raise NotImplementedError

    def memory(self, n: int) -> Arrays:
        """State of the task for n copies, one row per copy.

        Args:
            n: number of copies.
        """
        raise NotImplementedError

    def begin(self, m: Arrays, i: int, truth: Truth, rng: np.random.Generator) -> None:
        """Starts an episode of one copy.

        Args:
            m: memory of the task.
            i: number of the copy.
            truth: numbers drawn, by name.
            rng: generator for further random numbers.
        """
        raise NotImplementedError

    def command(self, m: Arrays, actions: np.ndarray) -> Command:
        """Command of an action for a control period.

        Args:
            m: memory of the task.
            actions: actions within -1 to 1, shape (n, number of actions).
        """
        raise NotImplementedError

    def observe(self, m: Arrays, h: Handles) -> np.ndarray:
        """Observations, shape (n, number of observations).

        Args:
            m: memory of the task.
            h: handles.
        """
        raise NotImplementedError

    def judge(self, m: Arrays, h: Handles, actions: np.ndarray) -> Judged:
        """Rewards of a control period.

        Args:
            m: memory of the task; it is updated.
            h: handles at the end of the period.
            actions: actions of the period.
        """
        raise NotImplementedError


def hand_of(truth: Truth) -> Operator:
    """The hand of an episode.

    Args:
        truth: numbers drawn.
    """
    return Operator(truth["mass"], truth["damper"], truth["spring"])


def scene_of(truth: Truth, **parts: Any) -> Scenario:
    """The scene common to all tasks: a hand at the arm, without an end condition.

    Args:
        truth: numbers drawn.
        **parts: fields of the scenario.
    """
    share = truth.get("gain", 1.0)
    shared = dict(
        operator=hand_of(truth), gain=(share * GAIN[0], share * GAIN[1]), force=(0.0, 0.0),
        length=None, inertia_shaping=True, dt=DT, t_max=1e4,
    )  # fmt: skip
    return Scenario(**(shared | parts))  # type: ignore[arg-type]


def saturated(x: np.ndarray) -> np.ndarray:
    """x/(1 + x): a cost that grows like x for small x and stays below 1.

    Args:
        x: cost, >= 0.
    """
    return x / (1.0 + x)
