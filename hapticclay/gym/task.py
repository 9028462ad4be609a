"""What a task is: a scene to draw, actions, observations and rewards, for many copies at once.

The functions of a task work on arrays with a row for each copy. They use +, -, *, / and square
roots alone, and `math` number by number for the rest, so that a row depends on its own copy to the
last bit, however many copies there are.
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

DT = 3.5714286e-4  # [s] 56 of them are 20 ms, and no step is longer than the paper's 0.36 ms
FORCE = 30.0  # [N] of the muscle at an action of 1
Arrays = dict[str, Any]  # a row for each copy


class Handles(NamedTuple):
    """The handles at the end of a control period, a row for each copy.

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
    """What acts for a control period.

    Attributes:
        force: of the muscle on the handle [N], shape (n, 2).
        gain: K of the compensator [1/kg], shape (n, 2); None to keep it.
    """

    force: np.ndarray
    gain: np.ndarray | None = None


class Judged(NamedTuple):
    """What a control period was worth.

    Attributes:
        reward: shape (n,).
        ended: whether the episode is over, shape (n,).
        info: numbers by name, shape (n,) each.
    """

    reward: np.ndarray
    ended: np.ndarray
    info: Arrays


@dataclass(frozen=True)
class Task:
    """A task: numbers and functions, without an engine.

    Attributes:
        given: ends (low, high) of ranges other than the task's own, by name; None for none.
        period: control period [s].
        steps: engine steps in it.
        limit: control periods after which an episode is cut off.
        strain: share of the torque limit from which on a run counts as unstable.
        actions: quantities of an action.
        observations: quantities of an observation.
        drawn: ranges of what is drawn for each episode.
        ranges: the same, with the ends that were given.
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
        """What the task keeps of n copies, a row for each.

        Args:
            n: number of copies.
        """
        raise NotImplementedError

    def begin(self, m: Arrays, i: int, truth: Truth, rng: np.random.Generator) -> None:
        """Begins an episode of a copy.

        Args:
            m: of the task.
            i: number of the copy.
            truth: numbers drawn, by name.
            rng: for what else is drawn.
        """
        raise NotImplementedError

    def command(self, m: Arrays, actions: np.ndarray) -> Command:
        """What an action does for a control period.

        Args:
            m: of the task.
            actions: within -1 to 1, shape (n, number of actions).
        """
        raise NotImplementedError

    def observe(self, m: Arrays, h: Handles) -> np.ndarray:
        """Observations, shape (n, number of observations).

        Args:
            m: of the task.
            h: handles.
        """
        raise NotImplementedError

    def judge(self, m: Arrays, h: Handles, actions: np.ndarray) -> Judged:
        """Rewards of a control period.

        Args:
            m: of the task, which is brought up to date.
            h: handles at its end.
            actions: in it.
        """
        raise NotImplementedError


def hand_of(truth: Truth) -> Operator:
    """The hand of an episode.

    Args:
        truth: numbers drawn.
    """
    return Operator(truth["mass"], truth["damper"], truth["spring"])


def scene_of(truth: Truth, **parts: Any) -> Scenario:
    """The scene that all tasks share: a hand at the arm, without an end of its own.

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
    """x/(1 + x): a cost that grows as x where x is small, and is less than 1 always.

    Args:
        x: >= 0.
    """
    return x / (1.0 + x)
