"""Held joint loops solved another way: piece by piece between switches of the torque, by SciPy."""

import numpy as np
from scipy.linalg import expm


def sample_map(arm, gains, Ts, delay, velocity="exact", cutoff=None):
    """The map over a sample, columns found by running it from unit states.

    arm: (M, D, S); gains: (P, R). The state is q, w, the last q, the filtered rate, past torques.
    """
    M, D, S = arm
    n, queue = len(M), int(np.ceil(delay / Ts - 1e-9))
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, S), -np.linalg.solve(M, D)]])
    b = np.vstack([np.zeros((n, n)), np.linalg.inv(M)])

    def held(x, tau, t):
        """State after a time under a constant torque: one exponential of the augmented system."""
        big = np.zeros((2 * n + 1, 2 * n + 1))
        big[: 2 * n, : 2 * n], big[: 2 * n, 2 * n] = a, b @ tau
        return (expm(big * t) @ np.append(x, 1.0))[: 2 * n]

    def after(state):
        x, rest = state[: 2 * n], state[2 * n :].reshape(-1, n)
        last, rate, past = rest[0], rest[1], list(rest[2:])
        q, w = x[:n], x[n:]
        if velocity == "exact":
            v = w
        elif velocity == "difference":
            v = (q - last) / Ts
        else:
            v = (rate + cutoff * (q - last)) / (1.0 + cutoff * Ts)
        torques = [-(gains[0] @ q + gains[1] @ v), *past]
        switch = queue * Ts - delay  # how long the newer of two torques acts
        x = held(x, torques[queue], Ts - switch)
        if switch > 1e-9 * Ts:
            x = held(x, torques[queue - 1], switch)
        return np.concatenate([x, q, v, *torques[:queue]])

    return np.array([after(unit) for unit in np.eye((4 + queue) * n)]).T


def radius(*args, **given):
    """Largest eigenvalue of the map."""
    return np.abs(np.linalg.eigvals(sample_map(*args, **given))).max()
