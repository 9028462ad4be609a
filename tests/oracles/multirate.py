"""A sampled controller on one mass, moved by the matrix exponential, and its fundamental.

Independent of `theory`: a march in time, the muscle force a pair of states of the same exponential,
the controller a law in the time domain, its late forces in a list.
"""

import numpy as np
from scipy.linalg import expm


def fundamental(  # noqa: PLR0913  # one case, spelt out
    mass, damper, spring, law, Ts, delay, omega, samples, periods
):
    """Fundamentals (p, v, u) per unit of a muscle force cos(omega t), complex.

    law(p, v, force of the muscles, motor force that acted until now, memory) returns the motor
    force asked for and the memory. `samples` go by for the transient, then whole `periods` are
    read, which must be whole samples.
    """
    whole = int(np.floor(delay / Ts + 1e-9))
    part = max(0.0, delay - whole * Ts)
    n = round(periods * 2.0 * np.pi / (omega * Ts))
    assert abs(n * Ts * omega / (2.0 * np.pi) - periods) < 1e-9
    A = np.zeros((8, 8), complex)  # p, v, u, cos, sin, then y' = j omega y + (p, v, u)
    A[0, 1] = 1.0
    A[1, :4] = np.array([-spring, -damper, 1.0, 1.0]) / mass
    A[3, 4], A[4, 3] = -omega, omega
    A[5:, :3], A[5:, 5:] = np.eye(3), 1j * omega * np.eye(3)
    head, rest = expm(A * part), expm(A * (Ts - part))
    state, memory, forces = np.zeros(8, complex), None, [0.0] * (whole + 2)
    state[3] = 1.0
    for k in range(samples + n):
        if k == samples:
            state[5:] = 0.0  # y e^(-j omega t) is the integral of x e^(-j omega t)
        p, v, _, muscle = state[:4].real
        asked, memory = law(p, v, muscle, forces[-1 - whole], memory)
        forces.append(asked)
        state[2] = forces[-2 - whole]
        state = head @ state
        state[2] = forces[-1 - whole]
        state = rest @ state
    phase = np.exp(-1j * omega * (samples + n) * Ts)
    return 2.0 * state[5:] * phase / (n * Ts)
