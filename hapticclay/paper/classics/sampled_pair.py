"""A leader and a follower of one axis at control samples, step by step: runs for the classics."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from ...model.controller import matrix_exponential
from ...model.operator import NO_HAND
from ...scene.pair import Contact, Pair

SETTLED = 120.0  # [s] of a run whose growth is measured, in its last half

# From (x, v, F, what arrived) to (force, message); F is the force on what the arm carries.
End = Callable[[float, float, float, Any], tuple[float, Any]]


class HeldArm:
    """m x'' + b x' + k x = a force held over a sample: arm and load, stepped exactly.

    Attributes:
        x: position [m].
        v: rate [m/s].
        felt: force on the load at the sample, just before the new force acts [N].
    """

    def __init__(self, arm: tuple[float, float], load: tuple[float, float, float], Ts: float):
        (mass, damper), self.load = arm, load
        self.m, self.b, self.k = mass + load[0], damper + load[1], load[2]
        whole = np.array([[0, 1, 0], [-self.k, -self.b, 1], [0, 0, 0]], float)
        whole[1] /= self.m
        step = matrix_exponential(whole * Ts)
        (self.xx, self.xv, self.xf), (self.vx, self.vv, self.vf) = step[:2].tolist()
        self.x = self.v = self.felt = 0.0

    def step(self, force: float) -> None:
        """Moves over a sample."""
        x, v = self.x, self.v
        self.x = self.xx * x + self.xv * v + self.xf * force
        self.v = self.vx * x + self.vv * v + self.vf * force
        a = (force - self.b * self.v - self.k * self.x) / self.m
        self.felt = self.load[0] * a + self.load[1] * self.v + self.load[2] * self.x


class Line:
    """What goes one way, some samples late."""

    def __init__(self, samples: int, first: Any):
        self.on_the_way = deque([first] * samples)

    def through(self, message: Any) -> Any:
        """Sends a message; returns the one that arrives."""
        self.on_the_way.append(message)
        return self.on_the_way.popleft()


def arms_of(pair: Pair) -> tuple[HeldArm, HeldArm]:
    """Leader with its hand and follower with what it touches, at rest."""
    hand, thing = pair.leader_operator or NO_HAND, pair.follower_clay or Contact()
    loads = (hand.mass, hand.damper, hand.spring), (thing.mass, thing.B, thing.K)
    leader, follower = (
        HeldArm((arm.mass, arm.damper), load, pair.Ts)
        for arm, load in zip(pair.arms, loads, strict=True)
    )
    return leader, follower


def ends_of(pair: Pair) -> tuple[End, End]:
    """What both hosts compute; a message is (x, v, F)."""
    Kp, Kd, kind = pair.law.Kp[0], pair.law.Kd[0], pair.link.kind

    def led(x: float, v: float, arrived: tuple[float, float, float]) -> float:
        return Kp * (arrived[0] - x) + Kd * (arrived[1] - v)

    def leader(x, v, F, arrived):
        force = led(x, v, arrived) if kind != "position-force" else 0.0
        return force - (arrived[2] if kind != "position-position" else 0.0), (x, v, F)

    def follower(x, v, F, arrived):
        pushed = arrived[2] if kind == "four-channel" else 0.0
        return led(x, v, arrived) - pushed, (x, v, F)

    return leader, follower


def free_run(pair: Pair, delay: int, samples: int) -> np.ndarray:
    """Positions of leader and follower after the leader is let go, shape (samples, 2)."""
    arms, ends = arms_of(pair), ends_of(pair)
    lines = Line(delay, (0.0,) * 3), Line(delay, (0.0,) * 3)
    arms[0].x = 1.0
    arms[0].felt = arms[0].load[2]
    out = []
    for _ in range(samples):
        out.append((arms[0].x, arms[1].x))
        seen = [(arm.x, arm.v, arm.felt) for arm in arms]
        arrived = lines[1].through(seen[1]), lines[0].through(seen[0])
        for arm, end, values, message in zip(arms, ends, seen, arrived, strict=True):
            arm.step(end(*values, message)[0])
    return np.array(out)


def growth(pair: Pair, delay: int) -> float:
    """Rate at which a run grows in the end [1/s]."""
    x = free_run(pair, delay, round(SETTLED / pair.Ts))
    quarter = len(x) // 4
    before, after = (float(np.sum(x[i * quarter : (i + 1) * quarter] ** 2)) for i in (2, 3))
    return 0.5 * math.log(after / before) / (quarter * pair.Ts)


def delay_limit(pair: Pair, near: float) -> float:
    """One-way delay at which runs neither grow nor decay [s]: on a line over whole samples."""
    low = math.floor(near / pair.Ts) - 1
    rates = [growth(pair, low), growth(pair, low + 3)]
    return pair.Ts * (low + 3.0 * rates[0] / (rates[0] - rates[1]))
