"""Compensator and reference model over a control sample, as matrices; a delay in samples."""

from __future__ import annotations

import functools
import math

import numpy as np

from ..formulas import compensator
from ..model import controller
from ..model.compensator import Compensator
from ..model.controller import Servo
from .sampled import SLACK


@functools.lru_cache(maxsize=256)
def formed_memory(servo: Servo, shape: Compensator, K: float, T: float) -> np.ndarray:
    """Rows of `next_form` of one axis: exact, by a matrix exponential, under a held force."""
    n, most = shape.order, compensator.ORDER
    A, B = controller.controller_matrices(servo, shape, K)
    m = np.zeros((n + 4, n + 4))
    m[: n + 2, : n + 2], m[: n + 2, n + 3] = A, B
    m[n + 1, n + 2] = servo.G.gain  # the start adds to delta
    e = controller.matrix_exponential(T * m)
    used = [*range(n), *range(most, most + 2)]
    out = np.zeros((most + 2, most + 4))
    out[np.ix_(used, [*used, most + 2, most + 3])] = e[: n + 2]
    out.flags.writeable = False
    return out


@functools.lru_cache(maxsize=256)
def held_memory(servo: Servo, shape: Compensator, K: float, T: float) -> np.ndarray:
    """State `memory` of one axis."""
    out = np.column_stack(controller.held_compensator(servo, shape, K, T)).ravel()
    out.flags.writeable = False
    return out


def delay_in_samples(delay: float, Ts: float) -> tuple[int, float]:
    """A delay in whole samples, and the remaining share of a sample."""
    delay /= Ts
    whole = math.floor(delay + SLACK)
    return whole, max(delay - whole, 0.0)
