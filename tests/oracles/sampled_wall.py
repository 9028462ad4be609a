"""The map of a sample of a linear virtual wall, from its definition."""

import math

import numpy as np
from scipy.linalg import expm


def sample_map(wall):
    """x(k+1) = A x(k) of a linear wall, from one sample after another of each unit state."""
    d, hand, Ts = wall.device, wall.hand, wall.Ts
    m, b, k = d.mass + hand.mass, d.damper + hand.damper, hand.spring
    whole = math.floor(wall.delay / Ts + 1e-9)
    part = wall.delay - whole * Ts
    past, queue = wall.velocity_window + 1, whole + 1

    def moved(x, v, f, t):
        own = np.array([[0.0, 1.0, 0.0], [-k / m, -b / m, 1.0 / m], [0.0, 0.0, 0.0]])
        return (expm(own * t) @ [x, v, f])[:2]

    def step(state):
        x, v = state[:2]
        old, y, forces = state[2 : 2 + past], 0.0, state[3 + past :]
        if wall.velocity == "exact":
            rate = v
        else:
            rate = (x - old[wall.velocity_window - 1]) / (wall.velocity_window * Ts)
            if wall.velocity_filter:
                keep = math.exp(-2.0 * math.pi * wall.velocity_filter * Ts)
                rate = y = keep * state[2 + past] + (1.0 - keep) * rate
        late = [-(wall.K * x + wall.B * rate), *forces]
        now = moved(x, v, late[whole + 1], part)
        now = moved(*now, late[whole], Ts - part)
        return np.array([*now, x, *old[:-1], y, *late[:queue]])

    return np.array([step(unit) for unit in np.eye(3 + past + queue)]).T
