"""A leader and a follower of one axis, linear and continuous: runs and responses for the classics.

Signals are rows over (x_l, v_l, x_f, v_f, a_l, a_f, u): a law is a sum of them, accelerations and
forces among them, and what acts on itself through a measured force is solved for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...model.controller import matrix_exponential
from ...model.operator import Operator
from ...scene.pair import Contact
from ...scene.virtual_wall import Device


class Signals(NamedTuple):
    """What a law may use, each a row: motion of both arms, forces at both handles."""

    x: tuple[np.ndarray, np.ndarray]
    v: tuple[np.ndarray, np.ndarray]
    a: tuple[np.ndarray, np.ndarray]
    f: tuple[np.ndarray, np.ndarray]  # of the hand on the leader, of the follower on the object


Law = Callable[[Signals], tuple[np.ndarray, np.ndarray]]


class Push(NamedTuple):
    """A muscle force: steady + swing cos(omega t) [N]."""

    steady: float
    swing: float
    omega: float

    def at(self, t: np.ndarray) -> np.ndarray:
        """The force at times [N]."""
        return self.steady + self.swing * np.cos(self.omega * t)


@dataclass(frozen=True, eq=False)
class Motion:
    """A run: motion and forces of leader and follower, shape (n, 2) each."""

    t: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    f: np.ndarray


@dataclass(frozen=True, eq=False)
class Bilateral:
    """Two arms, a hand and an object under a law."""

    arms: tuple[Device, Device]
    hand: Operator
    thing: Contact
    law: Law

    @cached_property
    def signals(self) -> Signals:
        """The rows."""
        xl, vl, xf, vf, al, af, u = np.eye(7)
        hand, thing = self.hand, self.thing
        pushed = u - (hand.mass * al + hand.damper * vl + hand.spring * xl)
        touched = thing.mass * af + thing.B * vf + thing.K * xf
        return Signals((xl, xf), (vl, vf), (al, af), (pushed, touched))

    @cached_property
    def accelerations(self) -> np.ndarray:
        """Accelerations of both arms per (x_l, v_l, x_f, v_f, u), shape (2, 5)."""
        signals = self.signals
        torques, outside = self.law(signals), (signals.f[0], -signals.f[1])
        rest = [
            arm.mass * a + arm.damper * v - torque - force
            for arm, a, v, torque, force in zip(
                self.arms, signals.a, signals.v, torques, outside, strict=True
            )
        ]
        both = np.array(rest)
        return -np.linalg.solve(both[:, 4:6], both[:, [0, 1, 2, 3, 6]])

    @cached_property
    def dynamics(self) -> tuple[np.ndarray, np.ndarray]:
        """A and B of (x_l, v_l, x_f, v_f)' = A (...) + B u."""
        A, B = np.zeros((4, 4)), np.zeros(4)
        A[0, 1] = A[2, 3] = 1.0
        A[1::2], B[1::2] = self.accelerations[:, :4], self.accelerations[:, 4]
        return A, B

    def run(self, push: Push, times: np.ndarray, start: np.ndarray | None = None) -> Motion:
        """The motion at even times, exactly: the push is part of the matrix exponential."""
        A, B = self.dynamics
        whole = np.zeros((7, 7))  # state, 1, cos, sin
        whole[:4, :4], whole[:4, 4], whole[:4, 5] = A, push.steady * B, push.swing * B
        whole[5, 6], whole[6, 5] = -push.omega, push.omega
        step = matrix_exponential(whole * (times[1] - times[0]))
        z = np.concatenate([np.zeros(4) if start is None else start, [1.0, 1.0, 0.0]])
        rows, n = z[None], len(times)
        while len(rows) < n:  # as many samples again, moved on by all of them
            rows = np.concatenate([rows, rows[: n - len(rows)] @ step.T])
            step = step @ step
        return self.shown(times, rows[:, :4], push.at(times))

    def shown(self, times: np.ndarray, states: np.ndarray, u: np.ndarray) -> Motion:
        """Motion and forces of states under a push."""
        accelerations = np.column_stack([states, u]) @ self.accelerations.T
        every = np.column_stack([states, accelerations, u])
        x, v, a, f = (every @ np.array(rows).T for rows in self.signals)
        return Motion(times, x, v, a, f)


def poles_of_run(x: np.ndarray, step: float, order: int) -> np.ndarray:
    """Poles of free motion from its samples: Prony's method, sorted by real part."""
    n = len(x) - order
    past = np.column_stack([x[order - 1 - k : order - 1 - k + n] for k in range(order)])
    recurrence = np.linalg.lstsq(past, x[order:], rcond=None)[0]
    found = np.log(np.roots([1.0, *-recurrence]).astype(complex)) / step
    return found[np.lexsort((found.imag, found.real))]
