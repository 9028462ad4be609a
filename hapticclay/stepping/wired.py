"""The sampled run through real hardware: jitter, encoders, converters, a delay, friction, passivity."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..model import arm, interface
from ..model.scenario import Scenario
from ..simulation.record import Record
from . import energy, loop
from .sampled import NONE, Pair, Sampled

NEAR = 1e-9  # of dt: events so close are one


class Held(NamedTuple):
    """What the motors hold, and of what it is made: torques [N.m]; forces on the handle, resisting [N].

    clay: as rendered, with what the passivity controller adds, `guard`. coupling, tool: force of the virtual
    coupling and velocity of its tool [m/s].
    """

    torque: Pair = NONE
    clay: Pair = NONE
    guard: Pair = NONE
    coupling: Pair = NONE
    tool: Pair = NONE


class Electronics(NamedTuple):
    """State of the hardware between two samples.

    k: index of the next sample. queue: (time [s], Held) still to come. history: of the angles, see
    interface.difference. rates: behind their filter [rad/s]. filters: of the force, x and y. force: net force last
    given to the compensator [N]. energy: that the clay took on each axis [J], up to position [m]. forces: of the clay,
    the last ones, newest first [N]. tool: of the coupling [m].
    """

    k: int
    queue: tuple[tuple[float, Held], ...]
    history: tuple[tuple[int, Pair], ...]
    rates: Pair
    filters: tuple[tuple[float, ...], tuple[float, ...]]
    force: Pair
    energy: Pair
    position: Pair
    forces: tuple[Pair, ...]
    tool: Pair


class Wired(Sampled):
    """Samples and changes of torque come at their own times; a step ends on each, as it does on borders."""

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        assert scenario.interface is not None
        self.parts = scenario.interface
        self.Ts = self.n * scenario.dt
        self.chance = interface.Chance(self.parts)
        cutoff, order = self.parts.force_filter, self.parts.filter_order
        self.filter = None if cutoff is None else interface.butterworth(cutoff, order, self.Ts)
        self.whole_delay = math.floor(self.parts.delay / self.Ts + NEAR)  # samples
        self.part_delay = max(self.parts.delay / self.Ts - self.whole_delay, 0.0)
        q, w = tuple(self.angles), tuple(self.rates)
        # before the start the joints have turned so for long
        past = tuple((j, self._encoded((q[0] + j * self.Ts * w[0], q[1] + j * self.Ts * w[1])))
                     for j in range(-self.parts.window, 0))  # fmt: skip
        start: Pair = scenario.start
        rest = (0.0,) * order
        hw = Electronics(0, (), past, w, (rest, rest), NONE, NONE, start, (NONE,) * (self.whole_delay + 2), start)
        self.state = (*self.state[:2], Held(), hw, NONE)
        self.extra: list[tuple[float, ...]] = []
        self.extras: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())  # of the row at an event, and after it
        self.acting = Held()
        self.rendered: list[tuple[float, float, float]] = []  # time [s], clay as rendered [N]
        self.ledger = energy.Ledger(scenario, self.extra)
        self.grid = 0.0

    def target(self) -> tuple[float, float, bool]:
        target, after, on_grid = super().target()
        self.grid, near = target, NEAR * self.scenario.dt
        hw = self.state[3]
        soon = [self._when(hw.k), self._when(hw.k + 1), self._when(hw.k) + self.parts.delay, *(d for d, _ in hw.queue)]
        stop = min((t for t in soon if t > self.t + near), default=target)
        if after and stop < target - near:
            return stop, stop - self.t, on_grid
        return target, after, on_grid

    def _arrive(self, target: float) -> None:
        if target == self.grid:
            super()._arrive(target)
        self.t = target

    def _when(self, k: int) -> float:
        return k * self.n * self.scenario.dt + self.chance(k)[0]

    def _is_sample(self) -> bool:
        return False  # an event has its own row already

    def _tick(self, q: tuple[float, ...], w: tuple[float, ...], after: float) -> Any:
        x, y, held, hw, owed = self.state
        before, now = self.before, self.t + NEAR * self.scenario.dt
        self.row, shown = None, (x[0], y[0])
        sample = after > 0.0 and self._when(hw.k) <= now
        if sample or after > 0.0 and hw.queue and hw.queue[0][0] <= now:
            seen = w
            if before:
                at, out, owed, slip = self._push(before, 0.0, q, w, held, owed)
                self.row = (*q, *at[:4], *out[:2], *at[4:6], *held.torque, *shown, *at[6:])
                self.extras = (_memo(slip, held), ())
                tau = held.torque[0] + slip[0], held.torque[1] + slip[1]
                seen, w = self._seen(q, w, out), out[2:]
                force = self._felt(q, seen, tau)
            else:
                force = self._first(q, w)
            if sample:
                x, y, hw = self._sample(q, seen, x, y, force, hw)
            while hw.queue and hw.queue[0][0] <= now:
                held, hw = hw.queue[0][1], hw._replace(queue=hw.queue[1:])
            before = 0.0
        at, out, owed, slip = self._push(before, after, q, w, held, owed)
        self.extras, self.acting = (self.extras[0], _memo(slip, held)), held
        return (x, y, held, hw, owed), (*held.torque, 0.0, 0.0, 0.0, 0.0), (*at[:6], *shown, *at[6:]), out

    def _whole_kick(self, q, w) -> tuple[Any, Any]:
        _, _, held, _, owed = self.state
        at, out, _, _ = self._push(self.before, self.before, q, w, held, owed)
        return (*at[:6], *NONE, *at[6:]), out

    def _push(self, before: float, after: float, q, w, held: Held, owed: Pair) -> tuple[Any, Any, Any, Pair]:
        """loop.push under the held torques and the friction, and the torques of the latter [N.m]."""
        c, k, (t1, t2) = loop.plant(self.scenario, before, after), self._inputs(before, after), held.torque
        at, out, left = loop.push(c, k, q[0], q[1], w[0], w[1], t1, t2, *owed)
        limit: Any = self.parts.friction
        if limit == NONE:
            return at, out, left, NONE
        one, two = (
            loop.push(c, k, q[0], q[1], w[0], w[1], t1 + d1, t2 + d2, *owed)[1] for d1, d2 in ((1.0, 0.0), (0.0, 1.0))
        )
        a12 = 0.5 * (one[3] - out[3] + two[2] - out[2])  # equal but for rounding
        f1, f2 = interface.stuck(out[2:], one[2] - out[2], a12, two[3] - out[3], limit)
        return *loop.push(c, k, q[0], q[1], w[0], w[1], t1 + f1, t2 + f2, *owed), (f1, f2)

    def _encoded(self, q) -> Pair:
        return interface.encoded(q[0], self.parts.encoder), interface.encoded(q[1], self.parts.encoder)

    def _sample(self, q, w, x, y, force, hw: Electronics):
        """One sample: what is measured, the torques to come, and compensator and reference model up to the next."""
        s, parts, k = self.scenario, self.parts, hw.k
        _, lost, noise = self.chance(k)
        force, filters = self._sensed(force, noise, hw)
        hw = hw._replace(k=k + 1, filters=filters)
        if not lost:
            q, w, hw = self._turned(k, q, w, hw)
            u, p, v, c = self._measure(q, w)
            held, hw = self._render(u, p, v, hw)
            tau, f = self._torques(u, p, v, c, x, y, force, held.clay)
            span = parts.dac_range or s.torque_limit
            t1, t2 = (interface.converted(t, parts.dac_bits, r) for t, r in zip(tau, span, strict=True))
            due = self._when(k) + parts.delay
            hw = hw._replace(force=f, queue=(*hw.queue, (due, held._replace(torque=(t1, t2)))))
        shift = self.shift(self.t, self.t + self.Ts).tolist() if self.command else NONE
        x, y = map(self._hold, (x, y), self.blocks, hw.force, shift)
        return x, y, hw

    def _sensed(self, force, noise: Pair, hw: Electronics):
        """The hand's force behind noise, filter and converter [N], and the state of the filters after it."""
        force, filters = (force[0] + noise[0], force[1] + noise[1]) if any(noise) else force, hw.filters
        if self.filter:
            shown = filters[0][0], filters[1][0]
            filters = tuple(interface.filtered(*self.filter, z, f) for z, f in zip(filters, force, strict=True))
            force = shown
        bits, span = self.parts.adc_bits, self.parts.adc_range
        return (interface.converted(force[0], bits, span), interface.converted(force[1], bits, span)), filters

    def _turned(self, k: int, q, w, hw: Electronics):
        """Joint angles [rad] and rates [rad/s] as they are measured."""
        parts, old = self.parts, hw.history
        q = self._encoded(q)
        if parts.velocity == "exact":
            return q, w, hw
        w = interface.difference(old, k, q, self.Ts)
        if parts.velocity_filter is not None:
            span = (k - old[-1][0]) * self.Ts
            w = tuple(interface.smoothed(a, b, parts.velocity_filter, span) for a, b in zip(hw.rates, w, strict=True))
        return q, w, hw._replace(history=(*old, (k, q))[-parts.window :], rates=w)

    def _render(self, u, p: Pair, v: Pair, hw: Electronics) -> tuple[Held, Electronics]:
        """The clay's force on the handle at p [m] and v [m/s], by coupling and passivity controller."""
        parts, b = self.parts, self.regions.b(self.t)
        fe, held = (b[0] * v[0], b[1] * v[1]), Held()
        if parts.coupling:
            k, d = parts.coupling.spring, parts.coupling.damper
            tool = [interface.coupled(hw.tool[i], p[i], v[i], b[i], k, d, self.Ts) for i in (0, 1)]
            hw = hw._replace(tool=(tool[0][0], tool[1][0]))
            fe = b[0] * tool[0][1], b[1] * tool[1][1]
            held = held._replace(coupling=fe, tool=(tool[0][1], tool[1][1]))
        if not parts.passivity:
            return held._replace(clay=fe), hw
        f0, f1 = (
            hw.forces[self.whole_delay],
            hw.forces[self.whole_delay + 1],
        )  # acting since the last sample: f1, then f0
        mean = [(1.0 - self.part_delay) * f0[i] + self.part_delay * f1[i] for i in (0, 1)]
        e: Any = tuple(hw.energy[i] + mean[i] * (p[i] - hw.position[i]) for i in (0, 1))
        W = arm.mobility(*u)[::2]
        safe: Any = tuple(interface.guarded(e[i], fe[i], v[i], self.Ts, W[i]) for i in (0, 1))
        hw = hw._replace(energy=e, position=p, forces=(safe, *hw.forces)[: self.whole_delay + 2])
        return held._replace(clay=safe, guard=(safe[0] - fe[0], safe[1] - fe[1])), hw

    def _keep(self, is_sample: bool, q, sample, command, out, after: float) -> None:
        self.extra += self.extras if self.row else self.extras[1:]
        fx, fy = self.acting.clay
        self.rendered.append((self.t, fx, fy))
        super()._keep(is_sample, q, sample, command, out, after)

    def result(self, wall: float) -> Record:
        """As Run.result; where the motors render the clay, fe is what they hold."""
        record = super().result(wall)
        if self.physical or not self.rendered:
            return record
        held = np.array(self.rendered)
        near = NEAR * self.scenario.dt
        return replace(record, fe=held[np.searchsorted(held[:, 0], record.t + near, side="right") - 1, 1:])


def _memo(slip: Pair, held: Held) -> tuple[float, ...]:
    """A row of energy.Ledger.extra."""
    return *slip, *held.guard, *held.coupling, *held.tool
