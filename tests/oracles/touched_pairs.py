"""A pair of one axis whose follower meets a wall, solved from touch to touch by SciPy.

Both hosts hold their torques for a sample; between samples the arms are integrated by DOP853 at
1e-12, and where the wall is met, let go or gives way is found by its events. The wall stands at
`at`: K e + B e' where that is positive, with e from where it last gave way at a force `limit`.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

FREE, TOUCHES, GIVES = range(3)


class Wall:
    """What a follower of mass m and damper b does against a wall under a held force."""

    def __init__(self, m, b, K, B, at, limit=math.inf):
        self.m, self.b, self.K, self.B, self.rest, self.limit = m, b, K, B, at, limit
        self.mode = FREE

    def force(self, x, v):
        """Force of the wall in the present mode."""
        if self.mode == FREE:
            return 0.0
        spring = self.limit if self.mode == GIVES else self.K * (x - self.rest)
        return spring + self.B * v

    def pushes(self, x, v):
        """Force that it would have if touched."""
        return self.K * (x - self.rest) + self.B * v

    def events(self):
        """What ends the present mode: functions of (x, v), directions, and the mode after each."""
        if self.mode == FREE:
            return [(lambda x, v: min(x - self.rest, self.pushes(x, v)), 1.0, TOUCHES)]
        if self.mode == GIVES:
            return [(lambda x, v: v, -1.0, TOUCHES)]
        out = [(self.pushes, -1.0, FREE)]
        if math.isfinite(self.limit):
            out.append((lambda x, v: self.K * (x - self.rest) - self.limit, 1.0, GIVES))
        return out

    def step(self, y, force, T):
        """Motion over a time under a force, shape (2,)."""
        t = 0.0
        if force == 0.0 and not np.any(y):
            return y  # at rest: its events would happen all the time
        while t < T:
            events = self.events()
            watched = [_event(f, direction) for f, direction, _ in events]

            def slope(_, y):
                return y[1], (force - self.b * y[1] - self.force(*y)) / self.m

            exact = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-15}
            got = solve_ivp(slope, (t, T), y, events=watched, **exact)
            t, y = got.t[-1], got.y[:, -1]
            for (_, _, after), times in zip(events, got.t_events, strict=True):
                if len(times):
                    if self.mode == GIVES:
                        self.rest = y[0] - self.limit / self.K
                    self.mode = after
        return y


def _event(f, direction):
    """An event of SciPy that ends an integration."""

    def event(_, y):
        return f(*y)

    event.terminal, event.direction = True, direction
    return event


def solve(pair, wall, samples, push):
    """Positions of both arms and the force on the wall at each sample, shape (samples, 3).

    A pair that sends positions and rates without delay; push: force on the leader of each sample.
    """
    Kp, Kd, Ts = pair.law.Kp[0], pair.law.Kd[0], pair.Ts
    leader = Wall(pair.leader.mass, pair.leader.damper, 0.0, 0.0, 1e3)  # met by nobody
    a, b, out = np.zeros(2), np.zeros(2), []
    for k in range(samples):
        out.append((a[0], b[0], wall.force(*b)))
        pull = Kp * (b[0] - a[0]) + Kd * (b[1] - a[1])
        a, b = leader.step(a, pull + push[k], Ts), wall.step(b, -pull, Ts)
    return np.array(out)
