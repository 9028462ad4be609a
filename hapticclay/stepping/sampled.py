"""The sampled run: what hardware does. Measured, computed and held every Ts, between which only the arm moves."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np

from ..model import arm, controller, operator
from ..model.clay import at
from ..model.scenario import AXES, G, S, Scenario
from ..theory import linear_loop
from . import loop
from .leapfrog import CHUNK, Leapfrog

NONE = (0.0, 0.0)
Pair = tuple[float, float]


class Sampled(Leapfrog):
    """Leapfrog of the arm and the hand under torques that change at samples; the controller is exact between them.

    At a sample the kick falls into two: one under the old torques, which brings the velocity to the sample, where it
    is measured, and one under the new. Steps end on borders as they do in continuous time.
    """

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        self.n = round((scenario.Ts or scenario.dt) / scenario.dt)
        # rows of (A, B) of each axis, as floats: a product of so small matrices costs more in NumPy
        self.blocks = [
            np.column_stack(linear_loop.held(axis, K, self.n * scenario.dt)).tolist()
            for axis, K in zip(AXES, scenario.gain, strict=True)
        ]
        s = self.state
        # (delta, delta', y, y') of each axis, the torques held, and what stiff clay owes, see loop.push
        self.state = (s[0:8:2], s[1:8:2], NONE, NONE)
        self.fresh = -1  # index of the last sample that was acted upon
        self.physical = scenario.render == "implicit"
        self.row: tuple[float, ...] | None = None
        # of each sample kept since the last look: fh over the kick before the torques change [N], and its weight
        self.early: list[tuple[float, float, float]] = []

    def advance(self) -> bool:
        self._careful()
        return self.filled >= CHUNK - 4

    def _inputs(self, before: float, after: float) -> tuple[float, ...]:
        if self.physical:
            return super()._inputs(before, after)
        uh = self.uh(self.t - 0.5 * before, self.t + 0.5 * after)
        return loop.inputs(NONE, NONE, uh, before, after, self.hand)

    def _first_of_a_hit(self, q: tuple[float, ...], w: tuple[float, ...], after: float) -> float:
        return inf  # torques that are held do not follow a hit

    def _tick(self, q: tuple[float, ...], w: tuple[float, ...], after: float) -> Any:
        x, y, tau, owed = self.state
        before, s = self.before, self.scenario
        self.row, shown = None, (x[0], y[0])
        if after > 0.0 and self._is_sample():
            seen = w
            if before:
                c, k = loop.plant(s, before, 0.0), self._inputs(before, 0.0)
                at, out, owed = loop.push(c, k, q[0], q[1], w[0], w[1], *tau, *owed)
                self.row = (*q, *at[:4], *out[:2], *at[4:6], *tau, *shown, *at[6:])
                seen, w = self._seen(q, w, out), out[2:]
                force = self._felt(q, seen, tau)
            else:
                force = self._first(q, w)
            tau, f = self._control(q, seen, x, y, force)
            shift = self.shift(self.t, self.t + self.n * s.dt).tolist() if self.command else NONE
            x, y = map(self._hold, (x, y), self.blocks, f, shift)
            before = 0.0
        at, out, owed = loop.push(
            loop.plant(s, before, after), self._inputs(before, after), q[0], q[1], w[0], w[1], *tau, *owed
        )
        return (x, y, tau, owed), (*tau, 0.0, 0.0, 0.0, 0.0), (*at[:6], *shown, *at[6:]), out

    def _seen(self, q, w, out) -> Any:
        """Joint rates at the sample [rad/s], see `_velocity`."""
        v = self._velocity(q, w, out)
        if v == out[:2]:
            return out[2:]
        r1, r2 = arm.rates(v[0], v[1], *self._measure(q, w)[0], 1.0)
        return r1, r2 - r1

    def _whole_kick(self, q, w) -> tuple[Any, Any]:
        _, _, tau, owed = self.state
        h = self.before
        at, out, _ = loop.push(loop.plant(self.scenario, h, h), self._inputs(h, h), q[0], q[1], w[0], w[1], *tau, *owed)
        return (*at[:6], *NONE, *at[6:]), out

    def _measure(self, q, w) -> tuple[tuple[float, float, float, float], Pair, Pair, Pair]:
        """arm.columns, position, velocity and centripetal acceleration of the handle."""
        ox, oy = self.scenario.origin
        u1x, u1y, u2x, u2y, px, py, _, vx, vy, cx, cy = loop.measure(q[0], q[1], w[0], w[1], 0.0, 0.0, ox, -oy)
        return (u1x, u1y, u2x, u2y), (px, py), (vx, vy), (cx, cy)

    def _first(self, q, w) -> Pair:
        """The operator's force that the sensor shows while the handle does not accelerate [N], as before the start."""
        uh, th = self.uh(self.t, self.t), self.scenario.operator
        if th is None:
            return uh
        _, p, v, _ = self._measure(q, w)
        return uh[0] - th.spring * p[0] - th.damper * v[0], uh[1] - th.spring * p[1] - th.damper * v[1]

    def _felt(self, q, w, tau) -> Pair:
        """The operator's force that the sensor shows at the sample, before the torques change [N]."""
        uh, th = self.uh(self.t, self.t), self.scenario.operator
        if th is None:
            return uh
        u, p, v, c = self._measure(q, w)
        b = at(*self.clay, self.t) if self.physical else NONE
        rest = [uh[i] - operator.impedance(th.spring, th.mass, th.damper, p[i], c[i], v[i]) for i in (0, 1)]
        # a kick of one second from rest, in which the velocity after it is the acceleration
        fx, fy = rest[0] - b[0] * v[0], rest[1] - b[1] * v[1]
        a = controller.pushed(1.0, 0.0, 0.0, *u, tau[0], tau[1], fx, fy, th.mass, th.mass)
        return rest[0] - th.mass * a[0], rest[1] - th.mass * a[1]

    def _is_sample(self) -> bool:
        return self.i % self.n == 0 and self.t == self.i * self.scenario.dt and self.fresh != self.i

    def _control(self, q, w, x, y, force):
        """Torques to hold and the net force that the compensator is given, from what is measured now."""
        u, p, v, c = self._measure(q, w)
        bx, by = self.regions.b(self.t)
        return self._torques(u, p, v, c, x, y, force, (bx * v[0], by * v[1]))

    def _torques(self, u: tuple[float, float, float, float], p: Pair, v: Pair, c: Pair, x, y, force: Pair, fe: Pair):
        """The same from handle position [m], velocity, acceleration, hand force and the clay's force [N]."""
        s = self.scenario
        f = (force[0] - fe[0], force[1] - fe[1])
        a = []
        for i, (g, h, z) in enumerate(zip(G, S, (x, y), strict=True)):
            y2 = g.stiffness * (z[0] - z[2]) - g.damping * z[3]
            a.append(controller.acceleration(1.0, -h.damping, h.stiffness, y2, z[3], v[i], z[2], p[i], c[i]))
        sxx, sxy, syy = (S[0].gain, 0.0, S[1].gain) if s.shaping else arm.mobility(*u)
        *_, t1, t2 = controller.resolve(  # the limits come last, after the clay's share
            1.0, 0.0, 0.0, *u, 1.0, 1.0, a[0], a[1], sxx, sxy, syy, *f, 0.0, 0.0, inf, inf, inf, inf
        )  # fmt: skip
        if not self.physical:
            p1, p2 = arm.torques(*fe, *u)
            t1, t2 = t1 - p1, t2 - p2
        (l1, l2) = s.torque_limit
        return (min(max(t1, -l1), l1), min(max(t2, -l2), l2)), f

    @staticmethod
    def _hold(z, block, f: float, shift: float) -> tuple[float, ...]:
        z0, z1, z2, z3 = z
        delta, *rest = [a0 * z0 + a1 * z1 + a2 * z2 + a3 * z3 + b * f for a0, a1, a2, a3, b in block]
        return delta + shift, *rest

    def _keep(self, is_sample: bool, q, sample, command, out, after: float) -> None:
        before, early = self.before, (0.0, 0.0, 0.0)
        if self.row:
            k = self._inputs(before, 0.0)
            self._put(False, self.row, k, 0.5 * before, False)
            _, _, _, _, v0x, v0y, v1x, v1y, fx, fy, *_, restx, resty = self.row
            fx, fy = fx + k[0] * v0x + k[1] * v1x + restx, fy + k[2] * v0y + k[3] * v1y + resty
            # the means of both kicks, half of the step before and half of the one after, interpolated at the sample
            early = fx, fy, after / (before + after)
            before = 0.0
            self.fresh = self.i
        elif after and self._is_sample():
            before, self.fresh = 0.0, self.i
        row = (*q, *sample[:4], *out[:2], *sample[4:6], *command[:2], *sample[6:])
        k = self._inputs(before, after)
        self._put(is_sample, row, k, 0.5 * (before + after), after > 0.0)
        if is_sample:
            self.early.append(early)

    def judge(self, rows: np.ndarray, b: Callable[[], np.ndarray]) -> int:
        early = np.array(self.early).T
        self.early.clear()
        rows[6:8] += early[2] * (early[:2] - rows[6:8])
        return super().judge(rows, b)

    def _engine(self, w, command, out, after: float) -> None:
        self.steps += 1
        self._whole(w, command, out, after)
