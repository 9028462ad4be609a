"""The fourth-order Runge-Kutta of `rungekutta` in numbers alone, many steps at a time; `native` compiles it.

The engine gives the arm's acceleration at each stage; what it would integrate is integrated here, the same way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..model import arm
from . import loop
from .run import TOUCH
from .stride import call, drive, load, store

STATES = 17  # q, q', then the states of loop.derivative and the works
ROW = 12  # floats of a row, as Run.judge takes them


class Engine(NamedTuple):
    """Addresses in the engine: of mj_forward, the model and the data, and of what it reads and gives."""

    forward: int
    model: int
    data: int
    q: int
    w: int
    acceleration: int
    ctrl: int
    push: int


def slope(c, b, uh, dampers, engine, y, dy):
    """Writes the derivative of all states y into dy, both (STATES,).

    Args:
        c: from loop.instant. b: clay [N.s/m]. uh: muscle force [N]. dampers: whether the engine has clay.

    Returns:
        (command, sample) as loop.derivative.
    """
    state = (y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11])
    command, rates, sample = loop.derivative(c, b[0], b[1], uh[0], uh[1], y[0], y[1], y[2], y[3], state)
    store(engine.q, y[0])
    store(engine.q + 8, y[1])
    store(engine.w, y[2])
    store(engine.w + 8, y[3])
    drive(engine, dampers, (command[0], command[1], b[0], b[1], command[2], command[3]))
    call(engine.forward, engine.model, engine.data)
    dy[0], dy[1] = y[2], y[3]
    dy[2], dy[3] = load(engine.acceleration), load(engine.acceleration + 8)
    for j in range(13):
        dy[4 + j] = rates[j]
    return command, sample


def leap(c, b, uh, dampers, engine, h, y, k):
    """Carries y over one step of h [s]. k: (5, STATES), to work in; its first row is the slope at y."""
    for stage in range(1, 4):
        ahead = h if stage == 3 else 0.5 * h
        for j in range(STATES):
            k[4, j] = y[j] + ahead * k[stage - 1, j]
        slope(c, b, uh, dampers, engine, k[4], k[stage])
    for j in range(STATES):
        y[j] += h / 6.0 * (k[0, j] + 2.0 * (k[1, j] + k[2, j]) + k[3, j])


def march(c, b, uh, dampers, engine, dt, substeps, low, high, origin, y, k, rows):
    """Steps from sample to sample, until as many as there are rows, or before the one that would end elsewhere.

    Args:
        dt: from sample to sample [s], in so many substeps. low, high: borders of the present region [m].
        origin: as in Scenario. y: state, which is advanced. k: (6, STATES), to work in. rows: (n, ROW), to be filled.

    Returns:
        Number of samples passed, and of rows filled.
    """
    h = dt / substeps
    for i in range(len(rows)):
        for j in range(STATES):
            k[5, j] = y[j]
        for part in range(substeps):
            command, sample = slope(c, b, uh, dampers, engine, y, k[0])
            if part == 0:
                row = rows[i]
                row[0], row[1] = y[0], y[1]
                for j in range(6):
                    row[2 + j] = sample[j]
                row[8], row[9], row[10], row[11] = command[0], command[1], y[4], y[5]
            leap(c, b, uh, dampers, engine, h, y, k)
            px, py = arm.position(y[0], y[1])
            px, py = px - origin[0], py - origin[1]
            inside = low[0] - TOUCH <= px <= high[0] + TOUCH and low[1] - TOUCH <= py <= high[1] + TOUCH
            if not (inside and abs(y[2]) + abs(y[3]) < np.inf):
                for j in range(STATES):
                    y[j] = k[5, j]
                return i
    return len(rows)


def once(c, b, uh, dampers, engine, h, y, k):
    """One step of h [s] from y."""
    slope(c, b, uh, dampers, engine, y, k[0])
    leap(c, b, uh, dampers, engine, h, y, k)
