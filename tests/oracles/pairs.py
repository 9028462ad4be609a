"""A leader and a follower run from event to event: samples, torques and messages as they arrive."""

import heapq

import numpy as np
from scipy.linalg import expm


class Arm:
    """M q'' + D q' + S q = held torques, from one event to the next by an exponential."""

    def __init__(self, M, D, S, load, q, w):
        self.M, self.D, self.S, self.load = M, D, S, load
        self.x, self.own, self.other = np.concatenate([q, w]), 0.0 * q, 0.0 * q

    def move(self, t):
        n = len(self.M)
        inverse = np.linalg.inv(self.M)
        a = np.zeros((2 * n + 1, 2 * n + 1))
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n, :n], a[n : 2 * n, n : 2 * n] = -inverse @ self.S, -inverse @ self.D
        a[n : 2 * n, -1] = inverse @ (self.own + self.other)
        self.x = (expm(a * t) @ np.append(self.x, 1.0))[:-1]

    def felt(self):
        """The torque on the load just before a switch."""
        q, w = np.split(self.x, 2)
        m, d, k = self.load
        pushed = self.own + self.other - self.D @ w - self.S @ q
        return m @ np.linalg.solve(self.M, pushed) + d @ w + k @ q


TICKS = 10**6  # of a sample: events at the same tick are at the same time
MESSAGE, SAMPLE, TORQUE = range(3)  # in this order at the same time


def run(arms, ends, Ts, delay, link, samples):
    """Positions and rates of both arms at the samples, shape (samples + 1, ...).

    ends: two functions (q, w, F, arrived) -> (own torque, torque on the other arm, message).
    link: delays there and back [s].
    """
    events, out, now, inbox = [], [], 0, [None, None]

    def after(seconds, kind, arm, name, value):
        tick = now + round(seconds / Ts * TICKS)
        heapq.heappush(events, (tick, kind, len(events) + 1000 * now, arm, name, value))

    while len(out) <= samples:
        if now % TICKS == 0 and (not events or events[0][:2] > (now, SAMPLE)):
            out.append(np.concatenate([each.x for each in arms]))
            for i, (each, end) in enumerate(zip(arms, ends, strict=True)):
                own, pull, message = end(*np.split(each.x, 2), each.felt(), inbox[i])
                after(delay, TORQUE, i, "own", own)
                after(delay + link[i], TORQUE, 1 - i, "other", pull)
                after(link[i], MESSAGE, 1 - i, "", message)
            while events and events[0][0] == now:
                _take(heapq.heappop(events), arms, inbox)
            due = now + TICKS
        else:
            _take(heapq.heappop(events), arms, inbox)
        until = min([due, *(event[0] for event in events[:1])])
        for each in arms:
            each.move((until - now) * Ts / TICKS)
        now = until
    return np.array(out)


def _take(event, arms, inbox):
    _, _, _, arm, name, value = event
    if name:
        setattr(arms[arm], name, value)
    else:
        inbox[arm] = value
