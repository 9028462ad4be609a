"""The sampled run, as on hardware: measured, computed and held every Ts; the arm moves in between.

`HardwareLoop` adds the hardware: jitter, encoders, converters, delay, friction, passivity control.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from math import inf
from typing import Any, NamedTuple

import numpy as np

from ..model import arm, controller, hardware, operator
from ..model.clay import damping_at, viscous_force
from ..model.constants import AXES, G, S
from ..model.hardware import Pair
from ..model.scenario import Scenario
from . import energy, loop
from .leapfrog import CHUNK, ZERO, Leapfrog


class Sampled(Leapfrog):
    """Leapfrog under torques that change at samples; the controller is exact in between.

    At a sample the kick falls into two: one under the old torques, which brings the velocity to the
    sample, where it is measured, and one under the new torques. Steps end on borders as in
    continuous time.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
    """

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        self.n = round((scenario.Ts or scenario.dt) / scenario.dt)
        # rows of (A, B) of each axis, as floats: a product of so small matrices costs more in NumPy
        self.blocks = [
            np.column_stack(controller.held_compensator(axis, K, self.n * scenario.dt)).tolist()
            for axis, K in zip(AXES, scenario.gain, strict=True)
        ]
        s = self.state
        # (delta, delta', y, y') of each axis, the torques held, the impulse that stiff clay owes
        self.state = (s[0:8:2], s[1:8:2], ZERO, ZERO)
        self.fresh = -1  # index of the last sample that was acted upon
        self.physical = scenario.render == "implicit"
        self.row: tuple[float, ...] | None = None
        # a sample each since the last look: fh before the torques change [N], its weight
        self.early: list[tuple[float, float, float]] = []

    def advance(self) -> bool:
        self._careful()
        return self.filled >= CHUNK - 4

    def _inputs(self, before: float, after: float) -> tuple[float, ...]:
        if self.physical:
            return super()._inputs(before, after)
        uh = self.uh(self.t - 0.5 * before, self.t + 0.5 * after)
        return loop.step_inputs(ZERO, ZERO, uh, before, after, self.hand)

    def _first_of_a_hit(self, q: tuple[float, ...], w: tuple[float, ...], after: float) -> float:
        return inf  # torques that are held do not follow a hit

    def _tick(self, q: tuple[float, ...], w: tuple[float, ...], after: float) -> Any:
        x, y, tau, owed = self.state
        before, s = self.before, self.scenario
        self.row, shown = None, (x[0], y[0])
        if after > 0.0 and self._is_sample():
            seen = w
            if before:
                c, k = loop.plant_coefficients(s, before, 0.0), self._inputs(before, 0.0)
                at, out, owed = loop.step_plant(c, k, q[0], q[1], w[0], w[1], *tau, *owed)
                self.row = (*q, *at[:4], *out[:2], *at[4:6], *tau, *shown, *at[6:])
                seen, w = self._seen(q, w, out), out[2:]
                force = self._felt(q, seen, tau)
            else:
                force = self._first(q, w)
            tau, f = self._control(q, seen, x, y, force)
            shift = self.shift(self.t, self.t + self.n * s.dt).tolist() if self.command else ZERO
            x, y = map(self._hold, (x, y), self.blocks, f, shift)
            before = 0.0
        c, k = loop.plant_coefficients(s, before, after), self._inputs(before, after)
        at, out, owed = loop.step_plant(c, k, *q, *w, *tau, *owed)
        return (x, y, tau, owed), (*tau, 0.0, 0.0, 0.0, 0.0), (*at[:6], *shown, *at[6:]), out

    def _seen(self, q, w, out) -> Any:
        """Joint rates at the sample [rad/s], see `_velocity`."""
        v = self._velocity(q, w, out)
        if v == out[:2]:
            return out[2:]
        r1, r2 = arm.joint_velocity(v[0], v[1], self._measure(q, w)[0], 1.0)
        return r1, r2 - r1

    def _whole_kick(self, q, w) -> tuple[Any, Any]:
        _, _, tau, owed = self.state
        h = self.before
        c, k = loop.plant_coefficients(self.scenario, h, h), self._inputs(h, h)
        at, out, _ = loop.step_plant(c, k, *q, *w, *tau, *owed)
        return (*at[:6], *ZERO, *at[6:]), out

    def _measure(self, q, w) -> tuple[tuple[float, float, float, float], Pair, Pair, Pair]:
        """arm.jacobian, position, velocity and centripetal acceleration of the handle."""
        ox, oy = self.scenario.origin
        u, p, _, v, c = loop.measure_handle(q[0], q[1], w[0], w[1], 0.0, 0.0, ox, -oy)
        return u, p, v, c

    def _first(self, q, w) -> Pair:
        """The operator's force on the sensor of a handle that does not accelerate [N]."""
        uh, th = self.uh(self.t, self.t), self.scenario.operator
        if th is None:
            return uh
        _, p, v, _ = self._measure(q, w)
        x, y = (uh[i] - th.spring * p[i] - th.damper * v[i] for i in (0, 1))
        return x, y

    def _felt(self, q, w, tau) -> Pair:
        """The operator's force on the sensor at the sample, before the torques change [N]."""
        uh, th = self.uh(self.t, self.t), self.scenario.operator
        if th is None:
            return uh
        u, p, v, c = self._measure(q, w)
        b = damping_at(*self.clay, self.t) if self.physical else ZERO
        rest = [
            uh[i] - operator.operator_force(th.spring, th.mass, th.damper, p[i], c[i], v[i])
            for i in (0, 1)
        ]
        # a kick of one second from rest, in which the velocity after it is the acceleration
        fex, fey = viscous_force(*b, *v)
        f = rest[0] - fex, rest[1] - fey
        a = controller.velocity_under_torque(1.0, ZERO, u, tau, f, (th.mass, th.mass))
        return rest[0] - th.mass * a[0], rest[1] - th.mass * a[1]

    def _is_sample(self) -> bool:
        return self.i % self.n == 0 and self.t == self.i * self.scenario.dt and self.fresh != self.i

    def _control(self, q, w, x, y, force):
        """Torques to hold, and the net force for the compensator, from the present measurements."""
        u, p, v, c = self._measure(q, w)
        fe = viscous_force(*self.regions.b(self.t), *v)
        return self._torques(u, p, v, c, x, y, force, fe)

    def _torques(
        self,
        u: tuple[float, float, float, float],
        p: Pair,
        v: Pair,
        c: Pair,
        x,
        y,
        force: Pair,
        fe: Pair,
    ):
        """`_control` from the state of the handle, the hand force and the force of the clay [N]."""
        s = self.scenario
        f = (force[0] - fe[0], force[1] - fe[1])
        law = controller.feedback_law
        a = [law(G[i], S[i], z[0], z[2], z[3], p[i], v[i], c[i])[0] for i, z in enumerate((x, y))]
        W = (S[0].gain, 0.0, S[1].gain) if s.shaping else arm.mobility(u)
        limit = inf, inf, inf, inf  # the limits come last, after the clay's share
        *_, t1, t2 = controller.saturated_step(1.0, ZERO, u, (1.0, 1.0), a, W, f, ZERO, limit)
        if not self.physical:
            p1, p2 = arm.joint_torques(*fe, u)
            t1, t2 = t1 - p1, t2 - p2
        (l1, l2) = s.torque_limit
        return (min(max(t1, -l1), l1), min(max(t2, -l2), l2)), f

    @staticmethod
    def _hold(z, block, f: float, shift: float) -> tuple[float, ...]:
        z0, z1, z2, z3 = z
        delta, *rest = [
            a0 * z0 + a1 * z1 + a2 * z2 + a3 * z3 + b * f for a0, a1, a2, a3, b in block
        ]
        return delta + shift, *rest

    def _keep(self, is_sample: bool, q, sample, command, out, after: float) -> None:
        before, early = self.before, (0.0, 0.0, 0.0)
        if self.row:
            k = self._inputs(before, 0.0)
            self._put(False, self.row, k, 0.5 * before, False)
            _, _, _, _, v0x, v0y, v1x, v1y, fx, fy, *_, restx, resty = self.row
            fx, fy = fx + k[0] * v0x + k[1] * v1x + restx, fy + k[2] * v0y + k[3] * v1y + resty
            # the means of both kicks, half of each step, interpolated at the sample
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
        """As Run.judge, with the hand force of both kicks at a sample.

        Args:
            rows: as in Run.judge.
            b: as in Run.judge.
        """
        early = np.array(self.early).T
        self.early.clear()
        rows[6:8] += early[2] * (early[:2] - rows[6:8])
        return super().judge(rows, b)

    def _engine(self, w, command, out, after: float) -> None:
        self.steps += 1
        self._whole(w, command, out, after)


TIME_SLACK = 1e-9  # of dt: events so close are one


class HeldForce(NamedTuple):
    """What the motors hold, and its parts; all (x, y) or (shoulder, elbow).

    Attributes:
        torque: of the motors [N.m].
        clay: force as rendered, with that of the passivity controller [N].
        guard: force added by the passivity controller [N].
        coupling: force of the virtual coupling [N].
        tool: velocity of the tool of the coupling [m/s].
    """

    torque: Pair = ZERO
    clay: Pair = ZERO
    guard: Pair = ZERO
    coupling: Pair = ZERO
    tool: Pair = ZERO


class HardwareState(NamedTuple):
    """State of the hardware between two samples.

    Attributes:
        k: index of the next sample.
        queue: (time [s], force to hold) still to come.
        history: (index, angles [rad]) of past samples, see hardware.velocity_difference.
        rates: joint rates behind their filter [rad/s].
        filters: states of the filters of the force, x and y.
        force: net force last given to the compensator [N].
        energy: energy that the clay has taken on each axis [J], up to `position`.
        position: of the handle at the last sample [m].
        forces: last forces of the clay, newest first [N].
        tool: position of the tool of the coupling [m].
    """

    k: int
    queue: tuple[tuple[float, HeldForce], ...]
    history: tuple[tuple[int, Pair], ...]
    rates: Pair
    filters: tuple[tuple[float, ...], tuple[float, ...]]
    force: Pair
    energy: Pair
    position: Pair
    forces: tuple[Pair, ...]
    tool: Pair


class HardwareLoop(Sampled):
    """The sampled loop with hardware: samples and changes of torque come at their own times.

    A step ends on each, as it does on borders.

    Args:
        scenario: what to run; it has an interface.
        every: keep each every-th sample, and the last.
    """

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        assert scenario.interface is not None
        self.parts = scenario.interface
        self.Ts = self.n * scenario.dt
        self.chance = hardware.SampleNoise(self.parts)
        cutoff, order = self.parts.force_filter, self.parts.filter_order
        self.filter = None if cutoff is None else hardware.butterworth(cutoff, order, self.Ts)
        self.whole_delay = math.floor(self.parts.delay / self.Ts + TIME_SLACK)  # samples
        self.part_delay = max(self.parts.delay / self.Ts - self.whole_delay, 0.0)
        q, w = tuple(self.angles), tuple(self.rates)
        # before the start the joints have turned so for long
        past = tuple((j, self._encoded((q[0] + j * self.Ts * w[0], q[1] + j * self.Ts * w[1])))
                     for j in range(-self.parts.window, 0))  # fmt: skip
        start: Pair = scenario.start
        rest = (0.0,) * order
        hw = HardwareState(
            0, (), past, w, (rest, rest), ZERO, ZERO, start, (ZERO,) * (self.whole_delay + 2), start
        )
        self.state = (*self.state[:2], HeldForce(), hw, ZERO)
        self.extra: list[tuple[float, ...]] = []
        # of the row at an event, and after it
        self.extras: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
        self.acting = HeldForce()
        self.rendered: list[tuple[float, float, float]] = []  # time [s], clay as rendered [N]
        self.ledger = energy.EnergyLedger(scenario, self.extra)
        self.grid = 0.0

    def target(self) -> tuple[float, float, bool]:
        target, after, on_grid = super().target()
        self.grid, near = target, TIME_SLACK * self.scenario.dt
        hw = self.state[3]
        soon = [
            self._when(hw.k),
            self._when(hw.k + 1),
            self._when(hw.k) + self.parts.delay,
            *(d for d, _ in hw.queue),
        ]
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
        before, now = self.before, self.t + TIME_SLACK * self.scenario.dt
        self.row, shown = None, (x[0], y[0])
        sample = after > 0.0 and self._when(hw.k) <= now
        if sample or after > 0.0 and hw.queue and hw.queue[0][0] <= now:
            seen = w
            if before:
                at, out, owed, slip = self._push(before, 0.0, q, w, held, owed)
                self.row = (*q, *at[:4], *out[:2], *at[4:6], *held.torque, *shown, *at[6:])
                self.extras = (_hardware_work(slip, held), ())
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
        self.extras, self.acting = (self.extras[0], _hardware_work(slip, held)), held
        return (
            (x, y, held, hw, owed),
            (*held.torque, 0.0, 0.0, 0.0, 0.0),
            (*at[:6], *shown, *at[6:]),
            out,
        )

    def _whole_kick(self, q, w) -> tuple[Any, Any]:
        _, _, held, _, owed = self.state
        at, out, _, _ = self._push(self.before, self.before, q, w, held, owed)
        return (*at[:6], *ZERO, *at[6:]), out

    def _push(
        self, before: float, after: float, q, w, held: HeldForce, owed: Pair
    ) -> tuple[Any, Any, Any, Pair]:
        """loop.step_plant under held torques and friction, and the friction torques [N.m]."""
        c, k = loop.plant_coefficients(self.scenario, before, after), self._inputs(before, after)
        t1, t2 = held.torque
        at, out, left = loop.step_plant(c, k, q[0], q[1], w[0], w[1], t1, t2, *owed)
        limit: Any = self.parts.friction
        if limit == ZERO:
            return at, out, left, ZERO
        one, two = (
            loop.step_plant(c, k, q[0], q[1], w[0], w[1], t1 + d1, t2 + d2, *owed)[1]
            for d1, d2 in ((1.0, 0.0), (0.0, 1.0))
        )
        a12 = 0.5 * (one[3] - out[3] + two[2] - out[2])  # equal but for rounding
        f1, f2 = hardware.coulomb_friction(out[2:], one[2] - out[2], a12, two[3] - out[3], limit)
        return *loop.step_plant(c, k, q[0], q[1], w[0], w[1], t1 + f1, t2 + f2, *owed), (f1, f2)

    def _encoded(self, q) -> Pair:
        return hardware.encode(q[0], self.parts.encoder), hardware.encode(q[1], self.parts.encoder)

    def _sample(self, q, w, x, y, force, hw: HardwareState):
        """One sample: the measurement, the torques to come, the controller's states at the next."""
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
            t1, t2 = (
                hardware.quantize(t, parts.dac_bits, r) for t, r in zip(tau, span, strict=True)
            )
            due = self._when(k) + parts.delay
            hw = hw._replace(force=f, queue=(*hw.queue, (due, held._replace(torque=(t1, t2)))))
        shift = self.shift(self.t, self.t + self.Ts).tolist() if self.command else ZERO
        x, y = map(self._hold, (x, y), self.blocks, hw.force, shift)
        return x, y, hw

    def _sensed(self, force, noise: Pair, hw: HardwareState):
        """The hand force behind noise, filter and converter [N], and the states of the filters."""
        filters = hw.filters
        if any(noise):
            force = force[0] + noise[0], force[1] + noise[1]
        if self.filter:
            shown = filters[0][0], filters[1][0]
            filters = tuple(
                hardware.filter_step(*self.filter, z, f)
                for z, f in zip(filters, force, strict=True)
            )
            force = shown
        bits, span = self.parts.adc_bits, self.parts.adc_range
        x, y = (hardware.quantize(f, bits, span) for f in force)
        return (x, y), filters

    def _turned(self, k: int, q, w, hw: HardwareState):
        """Joint angles [rad] and rates [rad/s] as they are measured."""
        parts, old = self.parts, hw.history
        q = self._encoded(q)
        if parts.velocity == "exact":
            return q, w, hw
        w = hardware.velocity_difference(old, k, q, self.Ts)
        if parts.velocity_filter is not None:
            span = (k - old[-1][0]) * self.Ts
            w = tuple(
                hardware.low_pass(a, b, parts.velocity_filter, span)
                for a, b in zip(hw.rates, w, strict=True)
            )
        return q, w, hw._replace(history=(*old, (k, q))[-parts.window :], rates=w)

    def _render(self, u, p: Pair, v: Pair, hw: HardwareState) -> tuple[HeldForce, HardwareState]:
        """Force of the clay on the handle, by coupling and passivity controller [N]."""
        parts, b = self.parts, self.regions.b(self.t)
        fe, held = viscous_force(*b, *v), HeldForce()
        if parts.coupling:
            k, d = parts.coupling.spring, parts.coupling.damper
            tool = [
                hardware.virtual_coupling(hw.tool[i], p[i], v[i], b[i], k, d, self.Ts)
                for i in (0, 1)
            ]
            hw = hw._replace(tool=(tool[0][0], tool[1][0]))
            fe = viscous_force(*b, tool[0][1], tool[1][1])
            held = held._replace(coupling=fe, tool=(tool[0][1], tool[1][1]))
        if not parts.passivity:
            return held._replace(clay=fe), hw
        f0, f1 = hw.forces[self.whole_delay : self.whole_delay + 2]  # since the last: f1, then f0
        mean = [(1.0 - self.part_delay) * f0[i] + self.part_delay * f1[i] for i in (0, 1)]
        e: Any = tuple(hw.energy[i] + mean[i] * (p[i] - hw.position[i]) for i in (0, 1))
        W = arm.mobility(u)[::2]
        safe: Any = tuple(
            hardware.passivity_controller(e[i], fe[i], v[i], self.Ts, W[i]) for i in (0, 1)
        )
        hw = hw._replace(energy=e, position=p, forces=(safe, *hw.forces)[: self.whole_delay + 2])
        return held._replace(clay=safe, guard=(safe[0] - fe[0], safe[1] - fe[1])), hw

    def _keep(self, is_sample: bool, q, sample, command, out, after: float) -> None:
        self.extra += self.extras if self.row else self.extras[1:]
        fx, fy = self.acting.clay
        self.rendered.append((self.t, fx, fy))
        super()._keep(is_sample, q, sample, command, out, after)

    def arrays(self) -> dict[str, np.ndarray]:
        """As Run.arrays; where the motors render the clay, fe is what they hold."""
        arrays = super().arrays()
        if not self.physical and self.rendered:
            held = np.array(self.rendered)
            near = TIME_SLACK * self.scenario.dt
            last = np.searchsorted(held[:, 0], arrays["t"] + near, side="right") - 1
            arrays["fe"] = held[last, 1:]
        return arrays


def _hardware_work(slip: Pair, held: HeldForce) -> tuple[float, ...]:
    """A row of energy.EnergyLedger.extra."""
    return *slip, *held.guard, *held.coupling, *held.tool
