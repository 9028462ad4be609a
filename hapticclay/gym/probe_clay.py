"""`hapticclay/ProbeClay-v0`: a hand moves through unknown clay for 3 s, then names b and Fy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from ..model.clay import slab
from ..model.flow import Flow
from ..scene.scenario import Scenario
from .columns import Value, each, where
from .draws import HAND, Range, Truth
from .environment import TaskEnv
from .quantities import Quantity, symmetric
from .task import DT, FORCE, Command, Handle, Judged, Memory, Task, scene_of
from .vector import TaskVectorEnv

MIDDLE, DECADES = (50.0, 1.5), 0.8  # b [N.s/m] and Fy [N] that an answer of 0 names; at 1, above
LOST = -5.0  # an error of a factor e^5


@dataclass(frozen=True)
class ProbeClayTask(Task):
    """Task: identify damping and yield force of clay by moving through it."""

    limit: ClassVar[int] = 150
    share: ClassVar[float] = 0.5
    actions: ClassVar[tuple[Quantity, ...]] = (
        symmetric("muscle force along x / 30 N", 1.0),
        symmetric("muscle force along y / 30 N", 1.0),
        symmetric("answer: log10(b / 50 N.s/m) / 0.8, counts at the end", 1.0),
        symmetric("answer: log10(Fy / 1.5 N) / 0.8, counts at the end", 1.0),
    )
    drawn: ClassVar[dict[str, Range]] = {
        **HAND,
        "b": Range(20.0, 120.0, "N.s/m", 8.0, 315.0, True, "damping of the clay"),
        "Fy": Range(0.5, 5.0, "N", 0.24, 9.4, True, "yield force of the clay"),
    }

    @property
    def observations(self) -> tuple[Quantity, ...]:
        return (
            symmetric("position x", 200.0, "mm"),
            symmetric("position y", 200.0, "mm"),
            symmetric("velocity x", 100.0, "cm/s"),
            symmetric("velocity y", 100.0, "cm/s"),
            symmetric("force of the hand on the handle, x", 100.0, "N"),
            symmetric("force of the hand on the handle, y", 100.0, "N"),
            symmetric("last action, x", 1.0),
            symmetric("last action, y", 1.0),
            Quantity("time left", 0.0, self.limit * self.steps * DT, "s"),
        )

    @override
    def scenario(self, truth: Truth) -> Scenario:
        clay = slab(Flow(Fy=truth["Fy"], b=truth["b"]))
        return scene_of(truth, name="probe clay", clay=clay)

    @override
    def begin(self, truth: Truth, rng: np.random.Generator) -> Memory:
        return {"count": 0, "action": (0.0, 0.0), "b": truth["b"], "Fy": truth["Fy"]}

    @override
    def command(self, m: Memory, action: tuple[Value, ...]) -> Command:
        return Command((FORCE * action[0], FORCE * action[1]))

    @override
    def observe(self, m: Memory, h: Handle) -> tuple[Value, ...]:
        left = (self.limit - m["count"]) * (self.steps * DT)
        x, y = h.p
        vx, vy = h.v
        return 1000.0 * x, 1000.0 * y, 100.0 * vx, 100.0 * vy, *h.fh, *m["action"], left

    @override
    def judge(self, m: Memory, h: Handle, action: tuple[Value, ...]) -> Judged:
        m["count"] = m["count"] + 1
        m["action"] = action[:2]
        over = m["count"] >= self.limit
        b, Fy = _error(action[2], m["b"], MIDDLE[0]), _error(action[3], m["Fy"], MIDDLE[1])
        reward = where(h.diverged, LOST, where(over, -(b + Fy), 0.0))
        info = {"error_b": b, "error_Fy": Fy, "lost": h.diverged}
        return Judged(reward, over | h.diverged, info)


def answer_of(b: float, Fy: float) -> tuple[float, float]:
    """The answer part of an action for a given clay."""
    x, y = (
        min(max(math.log10(max(value, 1e-9) / middle) / DECADES, -1.0), 1.0)
        for value, middle in zip((b, Fy), MIDDLE, strict=True)
    )
    return x, y


def _error(answer: Value, truth: Value, middle: float) -> Value:
    """|ln(answer/truth)|."""
    named = DECADES * math.log(10.0) * answer
    return abs(named - each(math.log, truth / middle))


class ProbeClay(TaskEnv):
    """A hand moves through unknown clay for 3 s, then names its b and Fy.

    Args:
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        engine: "auto", "python" or "native", as in `Simulation`.
        render_mode: "human", "rgb_array" or None.
    """

    task_type = ProbeClayTask


class ProbeClayVector(TaskVectorEnv):
    """Many copies of `ProbeClay`."""

    task_type = ProbeClayTask
