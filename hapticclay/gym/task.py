"""Tasks: random scenes, actions, observations and rewards.

The functions of a task work on the numbers of one copy, or on columns with one value per copy, see
`columns`. So each formula stands once, and a copy has the same numbers alone and among others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..model.constants import GAIN, TORQUE_LIMIT
from ..model.operator import Operator
from ..scene.scenario import Scenario
from .columns import Pair, Value, negated
from .draws import HAND, Range, Truth, with_ranges
from .quantities import Quantity

DT = 3.5714286e-4  # [s] 56 steps are 20 ms, and a step is at most the paper's 0.36 ms
FORCE = 30.0  # [N] muscle force at an action of 1
SPEED_LIMIT = 20.0  # [m/s] beyond which a run counts as unstable
Memory = dict[str, Any]  # values, tables, or tuples of them, by name: of one copy, or columns


class Handle(NamedTuple):
    """State of the handle at the end of a control period; pairs (x, y) of numbers or columns."""

    p: Pair  # [m]
    v: Pair  # [m/s]
    fh: Pair  # [N] of the hand on the handle
    fe: Pair  # [N] resistance of the clay
    diverged: Value  # whether the run is unstable or over


class Command(NamedTuple):
    """Command for a control period; pairs (x, y) of numbers or columns."""

    force: Pair  # [N] muscle force on the handle
    gain: Pair | None = None  # K of the compensator [1/kg]; None to keep it


class Judged(NamedTuple):
    """Reward of a control period; numbers or columns."""

    reward: Value
    ended: Value  # whether the episode is over
    info: Memory  # values by name


@dataclass(frozen=True)
class Task:
    """A task: its numbers and functions, independent of the engine."""

    given: Any = None  # ends (low, high) of ranges that differ from the task's own, by name
    ranges: dict[str, Range] = field(init=False)  # those of `drawn`, with the given ends
    steps: ClassVar[int] = 56  # engine steps per control period
    limit: ClassVar[int] = 500  # control periods after which an episode is truncated
    strain: ClassVar[float] = 1.0  # share of the torque limit beyond which a run counts as unstable
    # share of a control period in which that torque is needed; after a jump of the muscle force
    # stable runs need it for less
    share: ClassVar[float] = 0.25
    actions: ClassVar[tuple[Quantity, ...]]
    drawn: ClassVar[dict[str, Range]]  # ranges of the numbers drawn for each episode

    def __post_init__(self):
        object.__setattr__(self, "ranges", with_ranges(self.drawn, self.given))

    @property
    def period(self) -> float:
        """Control period [s]."""
        return self.steps * DT

    @property
    def strain_limits(self) -> tuple[float, float]:
        """Torques of shoulder and elbow beyond which a motor is strained [N.m]."""
        shoulder, elbow = TORQUE_LIMIT
        return self.strain * shoulder, self.strain * elbow

    @property
    def observations(self) -> tuple[Quantity, ...]:
        """Quantities of an observation."""
        raise NotImplementedError

    def scenario(self, truth: Truth) -> Scenario:
        """The scene of an episode."""
        raise NotImplementedError

    def begin(self, truth: Truth, rng: np.random.Generator) -> Memory:
        """Memory of the task at the start of an episode."""
        raise NotImplementedError

    def command(self, m: Memory, action: tuple[Value, ...]) -> Command:
        """Command of an action, whose numbers lie from -1 to 1."""
        raise NotImplementedError

    def observe(self, m: Memory, h: Handle) -> tuple[Value, ...]:
        """The quantities of an observation."""
        raise NotImplementedError

    def judge(self, m: Memory, h: Handle, action: tuple[Value, ...]) -> Judged:
        """Reward of a control period; updates the memory."""
        raise NotImplementedError

    def handle(self, sample: Sequence[Pair], strained: Sequence[Value], over: Value) -> Handle:
        """The handle in a sample; `strained`: samples of the period in which each motor was.

        A run counts as diverged if it is over (for example out of reach), if it is faster than
        SPEED_LIMIT, or if a motor needed a torque that no stable run of the task needs.
        """
        p, v, fh, fe = sample
        least = round(self.share * self.steps)
        calm = (strained[0] < least) & (strained[1] < least)
        slow = v[0] * v[0] + v[1] * v[1] <= SPEED_LIMIT * SPEED_LIMIT
        return Handle(p, v, fh, fe, over | negated(calm & slow))


def hand_of(truth: Truth) -> Operator:
    return Operator(*(truth[name] for name in HAND))


def scene_of(truth: Truth, **parts: Any) -> Scenario:
    """The scene common to all tasks: a hand at the arm, without an end condition."""
    share = truth.get("gain", 1.0)
    shared = dict(
        operator=hand_of(truth), gain=(share * GAIN[0], share * GAIN[1]), force=(0.0, 0.0),
        length=None, inertia_shaping=True, dt=DT, t_max=1e4,
    )  # fmt: skip
    return Scenario(**(shared | parts))  # type: ignore[arg-type]


def saturated(x: Value) -> Value:
    """x/(1 + x): a cost that grows like x for small x and stays below 1."""
    return x / (1.0 + x)
