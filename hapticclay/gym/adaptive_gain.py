"""`hapticclay/AdaptiveGain-v0`: a controller sets its gain under a hand that it does not see."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from ..model.clay import slab
from ..scene.scenario import Scenario
from .columns import Value, clipped, each, entry, where
from .draws import HAND, Range, Truth
from .environment import TaskEnv
from .quantities import Quantity, symmetric
from .task import DT, Command, Handle, Judged, Memory, Task, saturated, scene_of
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
        symmetric("change of the gain: K is multiplied by 2^(action / 4)", 1.0),
    )
    drawn: ClassVar[dict[str, Range]] = {
        **HAND,
        "b": Range(20.0, 60.0, "N.s/m", 1.0, 1e4, True, "damping of the clay"),
        "force": Range(2.0, 4.0, "N", 0.0, 100.0, False, "amplitude of each tone of the muscle"),
    }

    @property
    def observations(self) -> tuple[Quantity, ...]:
        v = (symmetric(f"velocity, {k} periods ago", 200.0, "cm/s") for k in range(SAMPLES))
        f = (symmetric(f"force of the hand, {k} periods ago", 100.0, "N") for k in range(SAMPLES))
        return (
            *v, *f,
            Quantity("decimal logarithm of the gain K [1/kg]", -1.5, 1.5),
            Quantity("damping of the clay / 60 N.s/m", 0.0, 20.0),
        )  # fmt: skip

    @override
    def scenario(self, truth: Truth) -> Scenario:
        return scene_of(truth, name="adaptive gain", clay=slab(truth["b"]), gain=(FIRST, GAIN_Y))

    @override
    def begin(self, truth: Truth, rng: np.random.Generator) -> Memory:
        t = np.arange(CYCLE) * (28 * DT)
        phases = rng.uniform(0.0, 2.0 * math.pi, len(TONES))
        tones = [np.sin(2.0 * math.pi * f * t + x) for f, x in zip(TONES, phases, strict=True)]
        none = (0.0,) * SAMPLES
        return {
            "muscle": (truth["force"] * sum(tones)).tolist(), "count": 0, "K": FIRST,
            "b": truth["b"], "errors": 0.0, "v": none, "f": none,
        }  # fmt: skip

    @override
    def command(self, m: Memory, action: tuple[Value, ...]) -> Command:
        factor = each(lambda a: math.pow(2.0, RATE * a), action[0])
        m["K"] = clipped(m["K"] * factor, LEAST, MOST)
        push = entry(m["muscle"], m["count"] % CYCLE)
        push = push * clipped((m["count"] + 1) / RAMP, 0.0, 1.0)
        nothing = 0.0 * m["K"]
        return Command((push, nothing), (m["K"], nothing + GAIN_Y))

    @override
    def observe(self, m: Memory, h: Handle) -> tuple[Value, ...]:
        return *m["v"], *m["f"], each(math.log10, m["K"]), m["b"] / 60.0

    @override
    def judge(self, m: Memory, h: Handle, action: tuple[Value, ...]) -> Judged:
        m["count"] = m["count"] + 1
        m["v"] = 100.0 * h.v[0], *m["v"][:-1]
        m["f"] = h.fh[0], *m["f"][:-1]
        error = (h.fh[0] - h.fe[0]) / WEIGHT
        cost = saturated(error * error)
        left = clipped(self.limit - m["count"], 0, self.limit)
        reward = where(h.diverged, -1.0 - left, -cost)
        m["errors"] = m["errors"] + cost
        info = {"K": m["K"], "lost": h.diverged, "mean_cost": m["errors"] / m["count"]}
        return Judged(reward, h.diverged, info)


class AdaptiveGain(TaskEnv):
    """A controller sets its gain under a hand that it does not see.

    Args:
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        engine: "auto", "python" or "native", as in `Simulation`.
        render_mode: "human", "rgb_array" or None.
    """

    task_type = AdaptiveGainTask


class AdaptiveGainVector(TaskVectorEnv):
    """Many copies of `AdaptiveGain`."""

    task_type = AdaptiveGainTask
