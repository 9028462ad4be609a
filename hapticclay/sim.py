"""One run: the engine steps the arm, the loop closes around it, the record keeps what happened."""

from __future__ import annotations

import functools
import math
import struct
import time
from collections.abc import Callable

import mujoco
import numpy as np

from . import arm, loop, outcome, record, scene
from .clay import Regions
from .errors import ParameterError, integer
from .inline import inline
from .params import Scenario

CHUNK = 1024  # rows between two looks at the run: progress, Ctrl-C, outcome; small enough for the cache
FUSE_FROM = 5_000  # steps from which inlining the loop (about 10 ms, once per process) pays

_row = struct.Struct("14d")
_two = struct.Struct("2d")


@functools.cache
def _advance() -> Callable[..., tuple[int, tuple[float, ...]]]:
    return inline(loop.advance)


def simulate(
    scenario: Scenario, *, every: int = 1, progress: Callable[[float, float], None] | None = None
) -> record.Record:
    """Runs a scenario to its end.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        progress: called now and then with (simulated time [s], handle x [m]).

    Returns:
        The record. Instability and its like are outcomes (record.status), not exceptions.

    Raises:
        ParameterError: scenario or every is of the wrong kind.
    """
    if not isinstance(scenario, Scenario):
        raise ParameterError("scenario", scenario, "must be a Scenario, as constant_cut() returns")
    every = integer("every", every, 1, 1_000_000)
    with scene.warnings_caught():
        run = _Run(scenario, every)
        begin = time.perf_counter()
        run.go(progress)
        wall = time.perf_counter() - begin
    return run.result(wall)


class _Run:
    def __init__(self, scenario: Scenario, every: int):
        self.scenario, self.every = scenario, every
        self.model = scene.build(scenario)
        self.data = data = mujoco.MjData(self.model)
        data.qpos[:] = arm.inverse(scenario.origin[0] + scenario.start[0], scenario.origin[1] + scenario.start[1])
        self.angles, self.rates = memoryview(data.qpos), memoryview(data.qvel)
        self.drive, self.push = memoryview(data.ctrl), memoryview(data.qfrc_applied)
        self.state = loop.initial_state(scenario.start)
        self.regions = Regions(scenario.clay, scenario.length, scenario.start)
        self.whole = loop.coefficients(scenario, scenario.dt, scenario.dt)
        self.last = math.floor(scenario.t_max / scenario.dt + 1e-6)  # number of whole steps
        self.advance = _advance() if self.last >= FUSE_FROM else loop.advance
        self.i = 0  # index of the sample at or before now
        self.t = 0.0
        self.before = 0.0  # length of the step that led here [s]
        self.b = self.regions.b  # clay before the sample [N.s/m]
        self.rows = bytearray(CHUNK * loop.ROW)
        self.filled = 0
        self.damping: list[tuple[float, float]] = []
        self.kept: list[np.ndarray] = []
        self.kept_b: list[np.ndarray] = []
        self.crossings: list[record.Crossing] = []
        self.watch = outcome.Watch(scenario)
        self.steps = 0  # of the engine
        self.outcome: record.Outcome | None = None
        self.end_time: float | None = None

    def go(self, progress: Callable[[float, float], None] | None) -> None:
        try:
            while self.outcome is None:
                if not self._glide():
                    self._careful()
                if self.filled >= CHUNK - 1 or self.outcome:
                    self._flush()
                    if progress:
                        progress(self.t, self._handle()[0])
        except ZeroDivisionError:  # the arm is exactly stretched or folded
            self.outcome = record.Outcome("out of reach", self.t, self.i, cause="the arm is stretched or folded")
            self._flush()

    def _handle(self) -> tuple[float, float]:
        u1x, u1y, u2x, u2y = arm.columns(*self.angles)
        return u1y + u2y - self.scenario.origin[0], -u1x - u2x - self.scenario.origin[1]

    def _glide(self) -> bool:
        """Whole steps while no border is near; False if there is none to make."""
        dt, b = self.scenario.dt, self.regions.b
        n = min(self.last - self.i, CHUNK - 1 - self.filled)
        if self.before != dt or self.b != b or n < 1:
            return False
        # a border is safe at 2 h^2 a from the extrapolated position, a = 50 m/s^2
        low, high, margin = self.regions.low, self.regions.high, 100.0 * dt * dt
        box = (low[0] + margin, high[0] - margin, low[1] + margin, high[1] - margin)
        for h in (0.0, loop.AHEAD * dt):
            x, y = self._ahead(self.angles, self.rates, h)
            if not (box[0] < x < box[1] and box[2] < y < box[3]):
                return False
        k = loop.damping(b, b, dt, dt)
        self._set_clay(k)
        done, self.state = self.advance(
            n, self.whole, k, box, self.state, _two.unpack_from, _two.pack_into, _row.pack_into,
            self.angles, self.rates, self.drive, self.push, self.rows, self.filled * loop.ROW,
            mujoco.mj_step, self.model, self.data,
        )  # fmt: skip
        self.damping += [b] * done
        self.filled += done
        self.steps += done
        self.i += done
        self.t = self.i * dt
        return True

    def _set_clay(self, k: tuple[float, ...]) -> None:
        if self.scenario.clay:
            _two.pack_into(self.drive, 2 * 8, k[1], k[3])

    def _careful(self) -> None:
        """One step that looks where it ends, and ends on a border if one is in its way."""
        s = self.scenario
        target = (self.i + 1) * s.dt if self.i < self.last else s.t_max
        after = target - self.t
        if after <= 1e-9 * s.dt or self.i > self.last:
            return self._close(record.Outcome("time limit", self.t, self.i))
        if self.before == s.dt and self.i < self.last:
            after = s.dt
        q = tuple(self.angles)
        w = tuple(self.rates)
        crossed = set()
        while True:
            new, command, sample, out = self._tick(q, w, after)
            hit = [i for i in (0, 1) if i not in crossed and not self._inside(i, self._ahead(q, out[2:], after)[i])]
            if not hit:
                landing = None
                break
            i = hit[0]
            up = self._ahead(q, out[2:], after)[i] >= self.regions.high[i]
            if self._beyond(i, up, self._ahead(q, out[2:], 0.0)[i]):
                if self._cross(i, up, sample[4:6], self.t):
                    return None
                crossed.add(i)  # at most once a sample, so that a border cannot hold the run
                continue
            spans = {j: self._landing(q, w, j, after) for j in hit}
            i = min(spans, key=lambda j: spans[j])
            landing, after = (i, self._ahead(q, out[2:], after)[i] >= self.regions.high[i]), spans[i]
            new, command, sample, out = self._tick(q, w, after)
            break
        on_grid = self.t == self.i * s.dt
        if on_grid:
            self._keep(q, sample, command, self.regions.b)
        self._engine(w, command, out, after)
        self.state, self.b = new, self.regions.b
        self.before = after
        if landing is None:
            self.i += 1
            self.t = target
            self.before = s.dt if after == s.dt else after
        else:
            self.t += after
            i, up = landing
            velocity = self._tick(tuple(self.angles), tuple(self.rates), 0.0)[2][4:6]
            self._cross(i, up, velocity, self.t)

    def _tick(self, q, w, after: float):
        s = self.scenario
        c = self.whole if self.before == after == s.dt else loop.coefficients(s, self.before, after)
        k = loop.damping(self.b, self.regions.b, self.before, after)
        return loop.tick(c, k, *q, *w, self.state)

    def _ahead(self, q, w, h: float) -> tuple[float, float]:
        """Handle position [m] when the joints have turned from q with w for h seconds."""
        u1x, u1y, u2x, u2y = arm.columns(q[0] + h * w[0], q[1] + h * w[1])
        return u1y + u2y - self.scenario.origin[0], -u1x - u2x - self.scenario.origin[1]

    def _inside(self, i: int, p: float) -> bool:
        return not (p >= self.regions.high[i] or p < self.regions.low[i])

    def _beyond(self, i: int, up: bool, p: float) -> bool:
        return p >= self.regions.high[i] if up else p < self.regions.low[i]

    def _landing(self, q, w, i: int, after: float) -> float:
        """Length of the step that ends on the border of coordinate i (false position, Illinois)."""
        up = self._ahead(q, self._tick(q, w, after)[3][2:], after)[i] >= self.regions.high[i]
        border = self.regions.high[i] if up else self.regions.low[i]

        def miss(h: float) -> float:
            return self._ahead(q, self._tick(q, w, h)[3][2:], h)[i] - border

        a, b = 1e-9 * after, after
        fa, fb = miss(a), miss(b)
        if fa == 0.0 or (fa > 0.0) == (fb > 0.0):
            return a
        for _ in range(60):
            h = b - fb * (b - a) / (fb - fa)
            f = miss(h)
            if (f > 0.0) != (fb > 0.0):
                a, fa = b, fb
            else:
                fa *= 0.5
            b, fb = h, f
            if f == 0.0 or abs(b - a) <= 1e-15 * after or abs(f) < 1e-17:
                break
        return b

    def _cross(self, i: int, up: bool, velocity, t: float) -> bool:
        """Steps over a border; True if it was the end of the path."""
        end = self.regions.at_end(i, up)
        border = self.regions.high[i] if up else self.regions.low[i]
        self.crossings.append(record.Crossing(axis="xy"[i], border=border, time=t, speed=float(velocity[i])))
        if end:
            self._close(record.Outcome("finished", t, self.i))
        else:
            self.regions.cross(i, up)
        return end

    def _close(self, result: record.Outcome) -> None:
        """The last sample: half a kick brings the rates to it, nothing is stepped."""
        q = tuple(self.angles)
        if self.before > 0.0:
            _, command, sample, _ = self._tick(q, tuple(self.rates), 0.0)
            self._keep(q, sample, command, self.b)
        self.end_time = self.t
        self.outcome = result

    def _keep(self, q, sample, command, b: tuple[float, float]) -> None:
        qd1, qd2, px, py, vx, vy, hx, hy, dx, dy = sample
        _row.pack_into(
            self.rows, self.filled * loop.ROW, *q, qd1, qd2, px, py, vx, vy, hx, hy, command[0], command[1], dx, dy
        )
        self.damping.append(b)
        self.filled += 1

    def _engine(self, w, command, out, after: float) -> None:
        """Steps the engine by after. If that differs from the length of the kick, the kick goes in whole."""
        model, data, dt = self.model, self.data, self.scenario.dt
        t1, t2, p1, p2 = command
        self.steps += 1
        _two.pack_into(self.drive, 0, t1, t2)
        if after == self.before == dt:
            self._set_clay(loop.damping(self.b, self.regions.b, dt, dt))
            _two.pack_into(self.push, 0, p1, p2)
            mujoco.mj_step(model, data)
            return
        self._set_clay((0.0,) * 4)
        a1, a2 = (out[2] - w[0]) / after, (out[2] + out[3] - w[0] - w[1]) / after
        _two.pack_into(self.push, 0, arm.I1 * a1 + arm.I2 * a2 - t1, arm.I2 * a2 - t2)
        model.opt.timestep = after
        mujoco.mj_step(model, data)
        model.opt.timestep = dt

    def _flush(self) -> None:
        """Judges the rows since the last look and moves them to the record."""
        n, self.filled = self.filled, 0
        rows = np.frombuffer(self.rows, dtype=float, count=14 * n).reshape(n, 14).copy()
        b = np.array(self.damping[:n], dtype=float).reshape(n, 2)
        self.damping = []
        first = sum(len(r) for r in self.kept)
        good, found = self.watch.look(rows, first)
        if found is not None:
            self.outcome, self.end_time = found, None
            self.crossings = [c for c in self.crossings if c.time <= found.time]
            rows, b = rows[:good], b[:good]
        self.kept.append(rows)
        self.kept_b.append(b)

    def result(self, wall: float) -> record.Record:
        rows, b = np.concatenate(self.kept), np.concatenate(self.kept_b)
        t = np.arange(len(rows)) * self.scenario.dt
        if self.end_time is not None and len(t):
            t[-1] = self.end_time
        assert self.outcome is not None
        x = [np.ascontiguousarray(rows[:, j : j + 2]) for j in range(0, 14, 2)]
        q, qd, p, v, fh, tau, delta = x
        return record.Record(
            t=t, p=p, v=v, fh=fh, fe=b * v, b=b, q=q, qd=qd, tau=tau, delta=delta,
            scenario=self.scenario, outcome=self.outcome, crossings=tuple(self.crossings),
            steps=self.steps, wall_time=wall,
        )  # fmt: skip
