"""How a limit of a joint loop moves with rotor inertia, damping and delay.

At a limit p an eigenvalue x of the open loop is 1 at an angle theta of the unit circle. A change of
a number a moves p and theta so that it stays 1: x_theta dtheta + x_p dp + x_a da = 0, a complex
equation for both. At z = -1 all is real and theta stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import matrices
from ..arms.mechanism import Linear
from .joint_loop import JointLoop

STEP = 1e-4  # relative step of differences
LEAST = 1e-6  # [kg.m^2 or N.m.s/rad] of a number whose step is relative
TURN = 1e-6  # relative step of the angle


class Edge(NamedTuple):
    """A limit.

    Attributes:
        at: the loop at a value of the limited number, and with other things changed.
        p: the limit.
        theta: angle of the eigenvalue on the circle [rad]; NaN if there is none.
        size: of the number, for a step.
    """

    at: Callable[..., JointLoop]
    p: float
    theta: float
    size: float


class Number(NamedTuple):
    """A number of an arm or a loop, and how a derivative over it is had.

    Attributes:
        changes: of the loop, for values around the present one.
        weights: of what is found there, the step divided out.
    """

    changes: Sequence[dict[str, Any]]
    weights: Sequence[float]


def numbers(linear: Linear, delay: float, Ts: float) -> list[list[Number]]:
    """Rotor inertia of each joint, damping of each joint, and the delay: three lists."""
    step = STEP * Ts  # the derivative over the delay may jump at whole samples: from one side
    late = Number(
        [{"delay": delay + i * step} for i in (0, 1, 2)], [w / step for w in (-1.5, 2.0, -0.5)]
    )
    joints = range(len(linear.inertia))
    return [[_nudged(linear, x, j) for j in joints] for x in ("inertia", "damping")] + [[late]]


def _nudged(linear: Linear, name: str, j: int) -> Number:
    matrix = getattr(linear, name)
    size = STEP * max(matrix[j, j], LEAST)
    changes = []
    for sign in (1.0, -1.0):
        changed = matrix.copy()
        changed[j, j] += sign * size
        changes.append({"linear": linear._replace(**{name: changed})})
    return Number(changes, (0.5 / size, -0.5 / size))


def slopes(edge: Edge, over: Sequence[Number]) -> np.ndarray:
    """Change of the limit per number; NaN without a limit."""
    theta, p = edge.theta, edge.p
    if not (math.isfinite(p) and 0.0 <= theta <= math.pi):
        return np.full(len(over), math.nan)
    h = STEP * max(abs(p), edge.size)
    if not theta:
        return _of_steady_motion(edge, h, over)
    by_p = (_open(edge.at(p + h), theta) - _open(edge.at(p - h), theta)) / (2.0 * h)
    turn = min(TURN * theta, 0.5 * (math.pi - theta))
    here = edge.at(p)
    by_theta = 1j  # at z = -1, where x stays real
    if turn:
        by_theta = (_open(here, theta + turn) - _open(here, theta - turn)) / (2.0 * turn)
    out = []
    for number in over:
        found = [_open(edge.at(p, **change), theta) for change in number.changes]
        by_a = sum(w * x for w, x in zip(number.weights, found, strict=True))
        out.append(-(by_a * np.conj(by_theta)).imag)
    below = (by_p * np.conj(by_theta)).imag
    return np.array(out) / below if below else np.full(len(out), math.nan)


def _of_steady_motion(edge: Edge, h: float, over: Sequence[Number]) -> np.ndarray:
    """The same of a limit at which steady motion loses its resistance, or rest its stiffness."""
    if not edge.at(edge.p + h).structural:
        return np.full(len(over), math.nan)

    def least(loop: JointLoop) -> float:
        found = loop.resistance().real
        return float(found[np.abs(found).argmin()])

    by_p = (least(edge.at(edge.p + h)) - least(edge.at(edge.p - h))) / (2.0 * h)
    by_a = [
        sum(w * least(edge.at(edge.p, **c)) for w, c in zip(x.weights, x.changes, strict=True))
        for x in over
    ]
    return -np.array(by_a) / by_p if by_p else np.full(len(over), math.nan)


def _open(loop: JointLoop, theta: float) -> complex:
    """The eigenvalue of the open loop that is 1 at a limit."""
    x = matrices.eigenvalues(loop.opened(np.array([theta])))[0]
    return complex(x[np.argmin(np.abs(x - 1.0))])
