"""A leader and a follower of one axis at control samples, step by step: runs for the classics."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...model.controller import matrix_exponential
from ...model.operator import NO_HAND
from ...scene.pair import Contact, Pair

SETTLED = 120.0  # [s] of a run whose growth is measured, in its last half


class Seen(NamedTuple):
    """What a host measures at a sample; `F` is the force on what the arm carries [N]."""

    x: float
    v: float
    a: float
    F: float


End = Callable[[Seen, Any], tuple[float, Any]]  # to (force, message)


class HeldArm:
    """m x'' + b x' + k x = a force held over a sample: arm and load, stepped exactly.

    Attributes:
        x: position [m].
        v: rate [m/s].
        a: acceleration at the sample, just before the new force acts [m/s^2].
    """

    def __init__(self, arm: tuple[float, float], load: tuple[float, float, float], Ts: float):
        (mass, damper), self.load = arm, load
        self.m, self.b, self.k = mass + load[0], damper + load[1], load[2]
        whole = np.array([[0, 1, 0], [-self.k, -self.b, 1], [0, 0, 0]], float)
        whole[1] /= self.m
        step = matrix_exponential(whole * Ts)
        (self.xx, self.xv, self.xf), (self.vx, self.vv, self.vf) = step[:2].tolist()
        self.x = self.v = self.a = 0.0

    def step(self, force: float) -> None:
        """Moves over a sample."""
        x, v = self.x, self.v
        self.x = self.xx * x + self.xv * v + self.xf * force
        self.v = self.vx * x + self.vv * v + self.vf * force
        self._accelerate(force)

    def let_go(self, x: float) -> None:
        """Places it at rest, under no force."""
        self.x, self.v = x, 0.0
        self._accelerate(0.0)

    def seen(self) -> Seen:
        """What its host measures."""
        m, b, k = self.load
        return Seen(self.x, self.v, self.a, m * self.a + b * self.v + k * self.x)

    def _accelerate(self, force: float) -> None:
        self.a = (force - self.b * self.v - self.k * self.x) / self.m


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
    """What both hosts compute; a message is what was seen, or a wave."""
    Kp, Kd, kind = pair.law.Kp[0], pair.law.Kd[0], pair.link.kind
    if kind == "waves":
        b = pair.link.impedance
        return wave_ends(Kp, Kd, float(b) if isinstance(b, (int, float)) else Kd, pair.Ts)

    def led(own: Seen, other: Seen) -> float:
        return Kp * (other.x - own.x) + Kd * (other.v - own.v)

    def leader(own: Seen, other: Seen) -> tuple[float, Seen]:
        force = led(own, other) if kind != "position-force" else 0.0
        return force - (other.F if kind != "position-position" else 0.0), own

    def follower(own: Seen, other: Seen) -> tuple[float, Seen]:
        return led(own, other) - (other.F if kind == "four-channel" else 0.0), own

    return leader, follower


def leader_wave(b: float, v: float, w: float) -> tuple[float, float]:
    """Force that the leader feels, and its wave: b v - sqrt(2 b) w, sqrt(2 b) v - w."""
    root = math.sqrt(2.0 * b)
    return b * v - root * w, root * v - w


def follower_wave(b: float, F: float, u: float) -> tuple[float, float]:
    """Rate that leads the follower, and its wave: sqrt(2/b) u - F/b, u - sqrt(2/b) F."""
    root = math.sqrt(2.0 / b)
    return root * u - F / b, u - root * F


def wave_ends(Kp: float, Kd: float, b: float, Ts: float) -> tuple[End, End]:
    """Both ends of a link that carries waves; the follower's law is behind them."""
    desired = 0.0

    def leader(own: Seen, w: float) -> tuple[float, float]:
        force, u = leader_wave(b, own.v, w)
        return -force, u

    def follower(own: Seen, u: float) -> tuple[float, float]:
        nonlocal desired
        force = Kp * (desired - own.x) + Kd * (math.sqrt(2.0 / b) * u - own.v)
        force /= 1.0 + Kd / b
        rate, w = follower_wave(b, force, u)
        desired += Ts * rate
        return force, w

    return leader, follower


def free_run(
    pair: Pair, delay: int, samples: int, ends: tuple[End, End] | None = None
) -> np.ndarray:
    """Positions of leader and follower after the leader is let go, shape (samples, 2).

    delay: one way, in samples, one at least. ends: other ones than those of the pair's link, with
    messages of what was seen.
    """
    leader, follower = arms_of(pair)
    waves = ends is None and pair.link.kind == "waves"
    lead, follow = ends or ends_of(pair)
    first: Any = 0.0 if waves else Seen(0.0, 0.0, 0.0, 0.0)
    there, back = deque([first] * delay), deque([first] * delay)
    leader.let_go(1.0)
    out = []
    for _ in range(samples):
        out.append((leader.x, follower.x))
        force, sent = lead(leader.seen(), back.popleft())
        pushed, answer = follow(follower.seen(), there.popleft())
        there.append(sent)
        back.append(answer)
        leader.step(force)
        follower.step(pushed)
    return np.array(out)


def growth(
    pair: Pair, delay: int, settled: float = SETTLED, ends: tuple[End, End] | None = None
) -> float:
    """Rate at which a run grows in the last half of a time [1/s]."""
    x = free_run(pair, delay, round(settled / pair.Ts), ends)
    quarter = len(x) // 4
    before, after = (float(np.sum(x[i * quarter : (i + 1) * quarter] ** 2)) for i in (2, 3))
    return 0.5 * math.log(after / before) / (quarter * pair.Ts)


def delay_limit(
    pair: Pair, near: float, settled: float = SETTLED, ends: tuple[End, End] | None = None
) -> float:
    """One-way delay at which runs neither grow nor decay [s]: on a line over whole samples."""
    low = max(1, math.floor(near / pair.Ts) - 1)
    rates = [growth(pair, each, settled, ends) for each in (low, low + 3)]
    return pair.Ts * (low + 3.0 * rates[0] / (rates[0] - rates[1]))
