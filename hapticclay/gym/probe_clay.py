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
from .draws import HAND, Range, Truth
from .environment import TaskEnv
from .quantities import Quantity, either_way
from .task import DT, FORCE, Arrays, Command, Handles, Judged, Task, scene_of
from .vector import TaskVectorEnv

MIDDLE, DECADES = (50.0, 1.5), 0.8  # b [N.s/m] and Fy [N] that an answer of 0 names; at 1, above
LOST = -5.0  # an error of a factor e^5


@dataclass(frozen=True)
class ProbeClayTask(Task):
    """Task: identify damping and yield force of clay by moving through it."""

    limit: ClassVar[int] = 150
    actions: ClassVar[tuple[Quantity, ...]] = (
        either_way("muscle force along x / 30 N", 1.0),
        either_way("muscle force along y / 30 N", 1.0),
        either_way("answer: log10(b / 50 N.s/m) / 0.8, counts at the end", 1.0),
        either_way("answer: log10(Fy / 1.5 N) / 0.8, counts at the end", 1.0),
    )
    drawn: ClassVar[dict[str, Range]] = {
        **HAND,
        "b": Range(20.0, 120.0, "N.s/m", 8.0, 315.0, True, "damping of the clay"),
        "Fy": Range(0.5, 5.0, "N", 0.24, 9.4, True, "yield force of the clay"),
    }

    @property
    def observations(self) -> tuple[Quantity, ...]:
        """Quantities of an observation."""
        return (
            either_way("position x", 200.0, "mm"),
            either_way("position y", 200.0, "mm"),
            either_way("velocity x", 100.0, "cm/s"),
            either_way("velocity y", 100.0, "cm/s"),
            either_way("force of the hand on the handle, x", 100.0, "N"),
            either_way("force of the hand on the handle, y", 100.0, "N"),
            either_way("last action, x", 1.0),
            either_way("last action, y", 1.0),
            Quantity("time left", 0.0, self.limit * self.steps * DT, "s"),
        )

    @override
    def scenario(self, truth: Truth) -> Scenario:
        clay = slab(Flow(Fy=truth["Fy"], b=truth["b"]))
        return scene_of(truth, name="probe clay", clay=clay)

    @override
    def memory(self, n: int) -> Arrays:
        return {
            "count": np.zeros(n, np.int64), "action": np.zeros((n, 2)), "b": np.ones(n),
            "Fy": np.ones(n),
        }  # fmt: skip

    @override
    def begin(self, m: Arrays, i: int, truth: Truth, rng: np.random.Generator) -> None:
        m["count"][i], m["action"][i] = 0, 0.0
        m["b"][i], m["Fy"][i] = truth["b"], truth["Fy"]

    @override
    def command(self, m: Arrays, actions: np.ndarray) -> Command:
        return Command(FORCE * actions[:, :2])

    @override
    def observe(self, m: Arrays, h: Handles) -> np.ndarray:
        left = (self.limit - m["count"]) * (self.steps * DT)
        return np.concatenate((1000.0 * h.p, 100.0 * h.v, h.fh, m["action"], left[:, None]), axis=1)

    @override
    def judge(self, m: Arrays, h: Handles, actions: np.ndarray) -> Judged:
        m["count"] = m["count"] + 1
        m["action"] = actions[:, :2].copy()
        over = m["count"] >= self.limit
        errors = [
            _error(actions[:, 2], m["b"], MIDDLE[0]),
            _error(actions[:, 3], m["Fy"], MIDDLE[1]),
        ]
        answer = np.where(over, -(errors[0] + errors[1]), 0.0)
        reward = np.where(h.diverged, LOST, answer)
        info = {"error_b": errors[0], "error_Fy": errors[1], "lost": h.diverged}
        return Judged(reward, over | h.diverged, info)


def answer_of(b: float, Fy: float) -> tuple[float, float]:
    """The answer part of an action for a given clay.

    Args:
        b: damping [N.s/m].
        Fy: yield force [N].
    """
    x, y = (
        min(max(math.log10(max(value, 1e-9) / middle) / DECADES, -1.0), 1.0)
        for value, middle in zip((b, Fy), MIDDLE, strict=True)
    )
    return x, y


def _error(answer: np.ndarray, truth: np.ndarray, middle: float) -> np.ndarray:
    """|ln(answer/truth)|."""
    pairs = zip(answer.tolist(), truth.tolist(), strict=True)
    return np.array([abs(DECADES * math.log(10.0) * a - math.log(x / middle)) for a, x in pairs])


class ProbeClay(TaskEnv):
    """A hand moves through unknown clay for 3 s, then names its b and Fy.

    Args:
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        engine: as in `Simulation`: "auto", "python" or "native".
        render_mode: "human", "rgb_array" or None.
    """

    task_type = ProbeClayTask


class ProbeClayVector(TaskVectorEnv):
    """Many copies of `ProbeClay`."""

    task_type = ProbeClayTask
