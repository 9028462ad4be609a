"""A law of the clay: a damper that hardens with the way that the handle has gone."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from hapticclay.stepping.state import Load

DAMPING, WAY = 4.0, 0.02  # [N.s/m]; [m] after which it is twice as much


class Part(NamedTuple):
    """The numbers of the law.

    Attributes:
        damping: at the start [N.s/m].
        way: after which it is twice as much [m].
    """

    damping: float
    way: float


class State(NamedTuple):
    """Its state.

    Attributes:
        gone: way so far [m].
        at: place of the handle [m].
    """

    gone: float
    at: tuple[float, float]


def part(scenario):
    return Part(DAMPING, WAY) if scenario.clay else None


def start(part, p):
    return State(0.0, p)


def refuses(scenario):
    return "must not have rotated axes" if scenario.clay.angle else ""


def damping(part, state):
    return part.damping * (1.0 + state.gone / part.way)


def load(part, state, load, step, at):
    b, f, d = damping(part, state), load.f, load.d
    x, y = step.L * b * at.v[0], step.L * b * at.v[1]
    return Load((f[0] - x, f[1] - y), (d[0] + step.R * b, d[1] + step.R * b, d[2]))


def moved(part, state, at, h):
    x, y = at.p[0] - state.at[0], at.p[1] - state.at[1]
    return State(state.gone + sqrt(x * x + y * y), at.p)


def force(part, state, p, v):
    b = damping(part, state)
    return b * v[0], b * v[1]
