"""`hapticclay/AdaptiveGain-v0`: a controller sets its gain under a hand that it does not see."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from ..model.clay import slab
from ..scene.scenario import Scenario
from .draws import HAND, Range, Truth
from .environment import TaskEnv
from .quantities import Quantity, either_way
from .task import DT, Arrays, Command, Handles, Judged, Task, saturated, scene_of
from .vector import TaskVectorEnv

SAMPLES = 16  # seen by the controller
FIRST = 1.0  # K of x at the start [1/kg]
LEAST, MOST = 0.1, 30.0  # K of x [1/kg]
RATE = 0.25  # doublings of K at an action of 1
GAIN_Y = 0.2  # K of y [1/kg], far below its limit
WEIGHT = 1.0  # [N] deviation of force that costs half a point
TONES = (0.4, 0.9, 1.7)  # [Hz] of the muscle; common period 10 s
CYCLE = 1000  # control periods in that period
RAMP = 20  # control periods over which the muscle force rises


@dataclass(frozen=True)
class AdaptiveGainTask(Task):
    """Task: set the compensator gain along x for a hand that moves through clay."""

    steps: ClassVar[int] = 28
    limit: ClassVar[int] = 500
    strain: ClassVar[float] = 0.5
    actions: ClassVar[tuple[Quantity, ...]] = (
        either_way("change of the gain: K is multiplied by 2^(action / 4)", 1.0),
    )
    drawn: ClassVar[dict[str, Range]] = {
        **HAND,
        "b": Range(20.0, 60.0, "N.s/m", 1.0, 1e4, True, "damping of the clay"),
        "force": Range(2.0, 4.0, "N", 0.0, 100.0, False, "amplitude of each tone of the muscle"),
    }

    @property
    def observations(self) -> tuple[Quantity, ...]:
        """Quantities of an observation."""
        v = (either_way(f"velocity, {k} periods ago", 200.0, "cm/s") for k in range(SAMPLES))
        f = (either_way(f"force of the hand, {k} periods ago", 100.0, "N") for k in range(SAMPLES))
        return (
            *v, *f,
            Quantity("decimal logarithm of the gain K [1/kg]", -1.5, 1.5),
            Quantity("damping of the clay / 60 N.s/m", 0.0, 20.0),
        )  # fmt: skip

    @override
    def scenario(self, truth: Truth) -> Scenario:
        return scene_of(truth, name="adaptive gain", clay=slab(truth["b"]), gain=(FIRST, GAIN_Y))

    @override
    def memory(self, n: int) -> Arrays:
        return {
            "muscle": np.zeros((n, CYCLE)), "count": np.zeros(n, np.int64), "K": np.ones(n),
            "v": np.zeros((n, SAMPLES)), "f": np.zeros((n, SAMPLES)), "b": np.zeros(n),
            "errors": np.zeros(n),
        }  # fmt: skip

    @override
    def begin(self, m: Arrays, i: int, truth: Truth, rng: np.random.Generator) -> None:
        t = np.arange(CYCLE) * (28 * DT)
        phases = rng.uniform(0.0, 2.0 * math.pi, len(TONES))
        tones = [np.sin(2.0 * math.pi * f * t + x) for f, x in zip(TONES, phases, strict=True)]
        m["muscle"][i] = truth["force"] * sum(tones)
        m["count"][i], m["K"][i], m["b"][i], m["errors"][i] = 0, FIRST, truth["b"], 0.0
        m["v"][i] = m["f"][i] = 0.0

    @override
    def command(self, m: Arrays, actions: np.ndarray) -> Command:
        factors = np.array([math.pow(2.0, RATE * a) for a in actions[:, 0].tolist()])
        m["K"] = np.minimum(np.maximum(m["K"] * factors, LEAST), MOST)
        push = m["muscle"][np.arange(len(factors)), m["count"] % CYCLE]
        push = push * np.minimum((m["count"] + 1) / RAMP, 1.0)
        nothing = np.zeros(len(push))
        gain = np.stack((m["K"], nothing + GAIN_Y), axis=1)
        return Command(np.stack((push, nothing), axis=1), gain)

    @override
    def observe(self, m: Arrays, h: Handles) -> np.ndarray:
        told = np.array([math.log10(x) for x in m["K"].tolist()])
        return np.concatenate((m["v"], m["f"], told[:, None], m["b"][:, None] / 60.0), axis=1)

    @override
    def judge(self, m: Arrays, h: Handles, actions: np.ndarray) -> Judged:
        m["count"] = m["count"] + 1
        for name, now in (("v", 100.0 * h.v[:, :1]), ("f", h.fh[:, :1])):
            m[name] = np.concatenate((now, m[name][:, :-1]), axis=1)
        error = (h.fh[:, 0] - h.fe[:, 0]) / WEIGHT
        cost = saturated(error * error)
        left = np.maximum(self.limit - m["count"], 0)
        reward = np.where(h.diverged, -1.0 - left, -cost)
        m["errors"] = m["errors"] + cost
        info = {"K": m["K"], "lost": h.diverged, "mean_cost": m["errors"] / m["count"]}
        return Judged(reward, h.diverged, info)


class AdaptiveGain(TaskEnv):
    """A controller sets its gain under a hand that it does not see.

    Args:
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        engine: as in `Simulation`: "auto", "python" or "native".
        render_mode: "human", "rgb_array" or None.
    """

    task_type = AdaptiveGainTask


class AdaptiveGainVector(TaskVectorEnv):
    """Many copies of `AdaptiveGain`."""

    task_type = AdaptiveGainTask
