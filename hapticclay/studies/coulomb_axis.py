"""An axis with inertia, viscous and Coulomb friction under held torques: exact over a sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

PIECES = 8  # of a sample between which the axis stops or turns; more are not needed
LOST = 1e6  # position at which an axis counts as lost
SERIES = 1e-2  # relative decay below which (h - phi) / r is its series, exact to 1e-13


class Axis(NamedTuple):
    """An axis: J a + b v + friction = torque - offset.

    Attributes:
        J: inertia [kg.m^2].
        b: viscous friction [N.m.s/rad].
        friction: Coulomb friction, at most this torque at rest [N.m].
        offset: constant torque against the motors [N.m].
    """

    J: float
    b: float = 0.0
    friction: float = 0.0
    offset: float = 0.0

    def step(self, q: float, v: float, torque: float, h: float) -> tuple[float, float]:
        """Position and velocity after a time under a constant torque, stops and turns included."""
        push = torque - self.offset
        for _ in range(PIECES):
            if v == 0.0 and abs(push) <= self.friction:
                return q, 0.0
            way = math.copysign(1.0, v if v != 0.0 else push)
            a, r = (push - way * self.friction) / self.J, self.b / self.J
            t = min(h, _stop(v, a, r))
            q, v, h = *_slid(q, v, a, r, t), h - t
            if h <= 0.0:
                return q, v
            v = 0.0
        return q, v


def _stop(v: float, a: float, r: float) -> float:
    """When a sliding axis stops; inf if it does not."""
    if v == 0.0 or v * a >= 0.0:
        return math.inf
    x = -v / a
    return math.log1p(r * x) / r if r * x > 1e-12 else x


def _slid(q: float, v: float, a: float, r: float, h: float) -> tuple[float, float]:
    """Position and velocity after a time without a stop: v' = a - r v."""
    phi, psi = _weights(r, h)
    return q + v * phi + a * psi, v * (1.0 - r * phi) + a * phi


def _weights(r: float, h: float) -> tuple[float, float]:
    """Integrals of exp(-r t) over a time, once and twice."""
    x = r * h
    phi = -math.expm1(-x) / r if x > 1e-12 else h
    if x < SERIES:
        psi = h * h * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x / 720.0))))
    else:
        psi = (h - phi) / r
    return phi, psi


def stepper(axis: Axis, h: float) -> Callable[[float, float, float], tuple[float, float]]:
    """`Axis.step` over a time, position, velocity and torque given; quicker where it slides."""
    J, b, friction, offset = axis
    r = b / J
    phi, psi = _weights(r, h)
    fade = 1.0 - r * phi

    def step(q: float, v: float, torque: float) -> tuple[float, float]:
        a = (torque - offset - math.copysign(friction, v)) / J
        after = v * fade + a * phi
        if v * after > 0.0:  # it has not stopped
            return q + v * phi + a * psi, after
        return axis.step(q, v, torque, h)

    return step


def follow(
    axis: Axis,
    target: Sequence[float],
    law: Callable[[], Callable[[float], float]],
    start: tuple[float, float],
    Ts: float,
    late: float = 0.0,
) -> np.ndarray:
    """Positions of an axis behind a target, each torque held for a sample, (n,).

    Args:
        axis: the axis.
        target: position that it follows at each sample.
        law: starts a law, torque of an error, a call for each sample.
        start: position and velocity.
        Ts: sample [s].
        late: from a sample to its torque [s].
    """
    torque, (q, v) = law(), start
    whole = math.floor(late / Ts)
    part = late - whole * Ts
    begin, end = (stepper(axis, h) for h in (part, Ts - part))
    queue = [torque(target[0] - q)] * (whole + 1)
    out = np.empty(len(target))
    for k, aim in enumerate(target):
        out[k] = q
        if not abs(q) < LOST:  # an unstable loop
            out[k:] = math.copysign(LOST, q)
            break
        queue.append(torque(aim - q))
        before = queue.pop(0)
        if part > 0.0:
            q, v = begin(q, v, before)
        q, v = end(q, v, queue[0])
    return out
