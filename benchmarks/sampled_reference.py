"""The sampled loop with hardware, solved without hapticclay: a reference for `sampled_loop`.

The arm is that of tests/oracles/parts.py, its handle a complex number, under SciPy between events.
Controller and force filter are SciPy's own discretisations. Every number that is rounded is kept,
so that two solutions can be compared level by level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.signal import butter, cont2discrete

from hapticclay.scene.scenario import Scenario
from tests.oracles import parts

KINDS = ("encoder", "force", "torque")


@dataclass
class Solution:
    """A solution of the sampled loop.

    Attributes:
        p: handle position at the samples [m], (n + 1, 2).
        levels: the level that each rounded number was given, by kind, (n + 1, 2).
        spare: its distance from the nearest edge of that level, in levels, by kind, (n + 1, 2).
    """

    p: np.ndarray
    levels: dict[str, np.ndarray]
    spare: dict[str, np.ndarray]


class Rounding:
    """Rounds, and keeps what was rounded."""

    def __init__(self):
        self.raw = {kind: [] for kind in KINDS}

    def __call__(self, kind, x, step, half=None):
        x = np.asarray(x) / step
        self.raw[kind].append(x)
        n = np.rint(x)
        return (n if half is None else np.clip(n, -half, half - 1)) * step


def blocks(loop, Ts):
    """Of each axis: states of the compensator, y, y' over a sample in which f is held."""
    out = []
    for i, (A, B, C, D) in enumerate(loop.C):
        n, (gain, damping, stiffness) = len(B), loop.G[:, i]
        m = np.zeros((n + 3, n + 3))
        m[:n, :n], m[:n, n + 2], m[n, n + 1] = A, B, 1.0
        m[n + 1] = [*gain * C, -stiffness, -damping, gain * D]
        out.append(expm(m * Ts))
    return out


def force_filter(io, Ts):
    """A, B, C of the filter of one axis under a held input."""
    A, B, C, D = _state_space(io.filter_order, 2.0 * np.pi * io.force_filter)
    Ad, Bd, Cd, _, _ = cont2discrete((A, B, C, D), Ts)
    return Ad, Bd[:, 0], Cd[0]


def _state_space(order, w):
    from scipy.signal import tf2ss

    return tf2ss(*butter(order, w, analog=True))


class Body:
    """The arm under held torques, from event to event."""

    def __init__(self, s, loop, method, rtol):
        self.s, self.loop, self.method, self.rtol = s, loop, method, rtol
        self.physical, self.edge = s.render == "physical", s.clay.x.edges[0]
        self.z = loop.start()[:4]
        self.b = s.clay.x.values[0] if self.physical else 0.0

    def acceleration(self, tau):
        """Of the handle [m/s^2]."""
        p, v, J, c, W = self.loop.motion(self.z)
        return self.loop.moved(J, c, W, tau, self.loop.force_of(0.0, p, v) - self.b * v)

    def rates(self, t, z, tau):
        p, v, J, c, W = self.loop.motion(z)
        acc = self.loop.moved(J, c, W, tau, self.loop.force_of(t, p, v) - self.b * v)
        return np.concatenate((z[2:], np.linalg.solve(J, acc - c)))

    def go(self, t, end, tau):
        """To the end, through the border where the clay is physical."""

        def border(t, z, tau):
            return self.loop.motion(z)[0][0] - self.edge

        border.terminal = True
        while end - t > 1e-15:
            ahead = self.physical and self.b == self.s.clay.x.values[0]
            r = solve_ivp(
                self.rates, (t, end), self.z, self.method, args=(tau,), rtol=self.rtol,
                atol=1e-2 * self.rtol, first_step=end - t, events=border if ahead else None,
            )  # fmt: skip
            t, self.z = r.t[-1], r.y[:, -1]
            if r.status == 1:
                self.b = self.s.clay.x.values[1]


def solve(s: Scenario, method: str = "DOP853", rtol: float = 1e-12) -> Solution:
    """The solution at all samples of a run.

    Args:
        s: a cut from rest with encoder, difference, force filter, converters and delay.
        method: SciPy's, between events.
        rtol: its tolerance.
    """
    io, Ts, loop = s.hardware, s.Ts, parts.Loop(s)
    body, keep, z = Body(s, loop, method, rtol), Rounding(), loop.start()
    Ad, Bd, Cd = force_filter(io, Ts)
    lag, steps = np.zeros((2, len(Bd))), blocks(loop, Ts)
    limit, half = np.array(s.torque_limit), 2 ** (io.dac_bits - 1)
    count, force_half = 2.0 * np.pi / io.encoder, 2 ** (io.adc_bits - 1)
    tau, coming, P = np.zeros(2), [], []
    first = np.rint(np.array([body.z[0], body.z[1] - body.z[0]]) / count) * count
    read = [first] * io.velocity_window
    n = round(s.t_max / Ts)
    for k in range(n + 1):
        t, following = k * Ts, (k + 1) * Ts
        p, v, *_ = loop.motion(body.z)
        P.append(p)
        fh = loop.force_of(t, p, v) - (loop.th[0] * body.acceleration(tau) if k else 0.0)
        heard = keep("force", lag @ Cd, io.adc_range / force_half, force_half)
        lag = lag @ Ad.T + np.outer(fh, Bd)
        q = keep("encoder", [body.z[0], body.z[1] - body.z[0]], count)
        w = (q - read[k]) / (io.velocity_window * Ts)
        read.append(q)
        seen = np.array([q[0], q.sum(), w[0], w.sum()])
        mp, mv, J, c, W = loop.motion(seen)
        fe = loop.clay(p) * mv
        f = heard - fe
        want, _ = loop.wanted(z, mp, mv)
        asked = loop.torque(J, c, W, want, f)
        if s.render == "held":
            on_links = J.T @ fe
            asked = asked - [on_links.sum(), on_links[1]]
        asked = keep("torque", np.clip(asked, -limit, limit), limit / half, half)
        for i, at in enumerate(loop.own):
            y = [loop.y + i, loop.y + 2 + i]
            new = steps[i] @ [*z[at], *z[y], f[i]]
            z[at], z[y] = new[:-3], new[-3:-1]
        coming.append((t + io.delay, asked))
        while coming and coming[0][0] < following:
            when, new = coming.pop(0)
            body.go(t, when, tau)
            t, tau = when, new
        if k < n:
            body.go(t, following, tau)
    raw = {kind: np.array(x) for kind, x in keep.raw.items()}
    levels = {kind: np.rint(x) for kind, x in raw.items()}
    spare = {kind: 0.5 - np.abs(x - levels[kind]) for kind, x in raw.items()}
    return Solution(np.array(P), levels, spare)
