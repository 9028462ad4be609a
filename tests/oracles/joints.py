"""Held joint loops solved another way: piece by piece between switches of the torque, by SciPy."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq


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


@dataclass(frozen=True)
class FrictionRun:
    """A run with Coulomb friction at one joint, by matrix exponentials; stops are exact.

    arm: (M, D, S); gains: (P, R); law: torque of the measured rate, fed forward at that joint;
    count: of the encoder [rad].
    """

    arm: tuple
    gains: tuple
    law: Callable
    Ts: float
    delay: float = 0.0
    velocity: str = "exact"
    cutoff: float = 0.0
    coulomb: float = 0.0
    joint: int = 0
    count: float | None = None

    def __post_init__(self):
        M, D, S = self.arm
        n, inverse = len(M), np.linalg.inv(M)
        e = np.eye(n)[self.joint]
        rows = np.hstack([-inverse @ S, -inverse @ D, inverse])  # acceleration of q, w, torques
        given = {"n": n, "e": e, "rows": rows, "own": e @ inverse @ e, "flows": {}}
        given["hold"] = np.eye(n) - np.outer(inverse @ e, e) / given["own"]
        for name, value in given.items():
            object.__setattr__(self, name, value)

    def positions(self, start, seconds):
        """Positions of the joint at the samples, from a start at rest."""
        n, queue = self.n, int(np.ceil(self.delay / self.Ts - 1e-9))
        x, side = np.concatenate([start, np.zeros(n)]), 0.0
        last, rate, past, out = self.read(x[:n]), np.zeros(n), [np.zeros(n)] * queue, []
        late = self.Ts - (queue * self.Ts - self.delay) if queue else 0.0
        for _ in range(round(seconds / self.Ts)):
            q = self.read(x[:n])
            rate, last = self.rate(q, last, rate, x[n:]), q
            fed = self.law(rate[self.joint]) * self.e
            torques = [fed - self.gains[0] @ q - self.gains[1] @ rate, *past]
            past = torques[:queue]
            for torque, t in ((torques[queue], late), (torques[max(queue - 1, 0)], self.Ts - late)):
                if t > 1e-9 * self.Ts:
                    x, side = self.advanced(x, torque, side, t)
            out.append(x[self.joint])
        return np.array(out)

    def read(self, q):
        return np.round(q / self.count) * self.count if self.count else q

    def rate(self, q, last, rate, w):
        if self.velocity == "exact":
            return w
        if self.velocity == "difference":
            return (q - last) / self.Ts
        return (rate + self.cutoff * (q - last)) / (1.0 + self.cutoff * self.Ts)

    def flow(self, stuck, t):
        """Transition, and response to torques."""
        if (stuck, t) not in self.flows:
            n, big = self.n, np.zeros((3 * self.n, 3 * self.n))
            big[:n, n : 2 * n] = np.eye(n)
            big[n : 2 * n] = self.hold @ self.rows if stuck else self.rows
            whole = expm(big * t)
            self.flows[stuck, t] = whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n :]
        return self.flows[stuck, t]

    def moved(self, x, torque, side, t):
        step, given = self.flow(not side, t)
        return step @ x + given @ (torque - self.coulomb * side * self.e)

    def advanced(self, x, torque, side, t):
        """State after a time under held torques, and the side the joint turns to, 0 if stuck."""
        w = self.n + self.joint
        while t > 0.0:
            if not side:
                push = self.e @ self.rows @ np.concatenate([x, torque]) / self.own
                side = np.sign(push) if abs(push) > self.coulomb else 0.0
            after = self.moved(x, torque, side, t)
            if not side or side * after[w] > 0.0:
                return after, side
            stop = min(1e-9 * self.Ts, t)
            if side * self.moved(x, torque, side, stop)[w] > 0.0:
                stop = brentq(lambda s, x=x, side=side: self.moved(x, torque, side, s)[w], stop, t)
            x = self.moved(x, torque, side, stop)
            x[w] = 0.0
            self.flows.pop((False, stop), None)
            t, side = t - stop, 0.0
        return x, side
