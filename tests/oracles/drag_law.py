"""A law of the clay: a quadratic drag that grows while the tool moves.

f = c m |v| v, m' = (|v|/v0 - m)/tau.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple

from hapticclay.stepping.state import Load


class Part(NamedTuple):
    """The numbers of the law.

    Attributes:
        c: drag [N.s^2/m^2].
        v0: speed at which m becomes 1 [m/s].
        tau: time in which it does [s].
    """

    c: float
    v0: float
    tau: float


class State(NamedTuple):
    """Its state.

    Attributes:
        m: share of the drag.
    """

    m: float


def part(scenario):
    return Part(40.0, 0.1, 0.2) if scenario.clay else None


def start(part, p):
    return State(0.0)


def refuses(scenario):
    return ""


def speed(v):
    return sqrt(v[0] * v[0] + v[1] * v[1])


def load(part, state, load, step, at):
    b, f, d = part.c * state.m * speed(at.v), load.f, load.d
    x, y = step.L * b * at.v[0], step.L * b * at.v[1]
    return Load((f[0] - x, f[1] - y), (d[0] + step.R * b, d[1] + step.R * b, d[2]))


def moved(part, state, at, h):
    e = exp(-h / part.tau)
    return State(e * state.m + (1.0 - e) * speed(at.v) / part.v0)


def force(part, state, p, v):
    b = part.c * state.m * speed(v)
    return b * v[0], b * v[1]
