"""One run: the engine steps the arm, the loop closes around it, the record keeps what happened."""

from __future__ import annotations

import ctypes
import functools
import math
import struct
import time
from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np

from . import arm, energy, loop, outcome, record, scene
from .clay import Regions
from .errors import ParameterError, integer
from .inline import inline
from .params import AXES, Scenario

CHUNK = 4096  # rows between two looks at the run: progress, Ctrl-C, outcome; small enough for the cache
FUSE_FROM = 5_000  # steps from which inlining the loop (about 10 ms, once per process) pays

_row = struct.Struct("14d")


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


def _outlet(ctrl: np.ndarray, push: np.ndarray) -> tuple[memoryview, Callable[..., None]]:
    """A view of the engine's memory from ctrl on, and what writes a whole command into it.

    ctrl holds the motors and, where there is clay, two dampers; its first 32 bytes are its own either
    way if the next array begins only 64 bytes on (the engine aligns arrays so). One call then does
    for both arrays; where they lie otherwise, two calls do.
    """
    first, second = ctrl.ctypes.data, push.ctypes.data
    if second - first == 64:
        view = memoryview((ctypes.c_char * 80).from_address(first))
        return view, struct.Struct("4d32x2d").pack_into

    def write(view, offset, t1, t2, bx, by, p1, p2):
        ctrl[:] = (t1, t2, bx, by)[: len(ctrl)]
        push[:] = p1, p2

    return memoryview(ctrl), write  # type: ignore[arg-type]


class _Stretch(NamedTuple):
    """Rows in a row that have this in common."""

    n: int
    is_sample: bool  # False at a border between two samples
    b: tuple[float, float]  # clay at the sample [N.s/m]
    k: tuple[float, ...]  # loop.damping
    H: float  # length of the kick [s]


def _window(a: np.ndarray, b: np.ndarray) -> tuple[memoryview, Callable[..., tuple[float, ...]]]:
    """A view of the engine's memory from a to b, two floats each, and what reads all four at once."""
    first, second = a.ctypes.data, b.ctypes.data
    gap = second - first - a.nbytes
    view = memoryview((ctypes.c_char * (a.nbytes + gap + b.nbytes)).from_address(first))
    return view, struct.Struct(f"2d{gap}x2d").unpack_from


def _sampled(raw: np.ndarray, k: np.ndarray, scenario: Scenario) -> np.ndarray:
    """What each kick did, shape (14, n), to (q, p, v, fh, tau, delta) at its sample, shape (12, n).

    k is loop.damping of each kick, shape (5, n), or (5, 1) where it is the same for all.
    """
    out = np.empty((12, raw.shape[1]))
    before, after = raw[4:6], raw[6:8]
    out[0:4] = raw[0:4]
    out[4:6] = before + k[4] * (after - before)
    if scenario.operator:
        out[6:8] = raw[8:10] + k[0:4:2] * before + k[1:4:2] * after
    else:
        out[6:8] = np.reshape(scenario.force, (2, 1))
    out[8:12] = raw[10:14]
    return out


class _Run:
    def __init__(self, scenario: Scenario, every: int):
        self.scenario, self.every = scenario, every
        self.model = scene.build(scenario)
        self.data = data = mujoco.MjData(self.model)
        data.qpos[:] = arm.inverse(scenario.origin[0] + scenario.start[0], scenario.origin[1] + scenario.start[1])
        self.angles, self.rates = memoryview(data.qpos), memoryview(data.qvel)
        self.motion, self.read = _window(data.qpos, data.qvel)
        self.drive, self.write = _outlet(data.ctrl, data.qfrc_applied)
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
        self.stretches: list[_Stretch] = []
        self.ledger = energy.Ledger(scenario)
        self.looked = 0  # rows judged so far
        self.kept: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # index, rows, b
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
                        progress(self.t, self._ahead(self.angles, self.rates, 0.0)[0])
        except (ArithmeticError, ValueError) as error:  # beyond floating point, or the arm exactly straight
            if isinstance(error, ValueError) and all(map(math.isfinite, (*self.angles, *self.rates))):
                raise
            self._flush()
            if self.outcome is None:
                self.outcome = record.Outcome("out of reach", self.t, self.i, cause="the arm is stretched or folded")

    def _glide(self) -> bool:
        """Whole steps in one go; undone from the first that a border lies in. False if there is none to make."""
        dt, b = self.scenario.dt, self.regions.b
        n = min(self.last - self.i, CHUNK - 1 - self.filled)
        if self.before != dt or self.b != b or n < 1:
            return False
        p, ahead = self._ahead(self.angles, self.rates, 0.0), self._ahead(self.angles, self.rates, dt)
        for i in (0, 1):  # do not run far beyond the border that lies ahead
            d = ahead[i] - p[i]
            if d:
                way = ((self.regions.high[i] if d > 0.0 else self.regions.low[i]) - p[i]) / d
                n = min(n, max(16, int(min(0.95 * way, n))))
        k = loop.damping(b, b, dt, dt)
        q, w, state = tuple(self.angles), tuple(self.rates), self.state
        begin = self.filled * loop.ROW
        while True:
            self.state = self.advance(
                range(begin, begin + n * loop.ROW, loop.ROW), self.whole, k, state,
                self.read, self.write, _row.pack_into, self.motion, self.drive, self.rows,
                mujoco.mj_step, self.model, self.data,
            )  # fmt: skip
            good = self._good(self.filled, n)
            if good == n:
                break
            self.angles[0], self.angles[1] = q
            self.rates[0], self.rates[1] = w
            n = good
            if n < 1:
                self.state = state
                return False
        self.stretches.append(_Stretch(n, True, b, k, dt))
        self.filled += n
        self.steps += n
        self.i += n
        self.t = self.i * dt
        return True

    def _good(self, first: int, n: int) -> int:
        """How many of n steps from row first stay in the region, the position after the last included."""
        rows = np.frombuffer(self.rows, dtype=float, count=14 * (first + n)).reshape(-1, 14)
        end = self._ahead(self.angles, self.rates, 0.0)
        out = np.zeros(n + 1, dtype=bool)
        for i in (0, 1):
            low, high = self.regions.low[i], self.regions.high[i]
            if low > -math.inf or high < math.inf:
                x = np.append(rows[first:, 2 + i], end[i])
                out |= ~((x >= low) & (x < high))
        return int(out.argmax()) - 1 if out.any() else n

    def _careful(self) -> None:
        """One step that looks where it ends, and ends on a border if one is in its way."""
        s = self.scenario
        target = (self.i + 1) * s.dt if self.i < self.last else s.t_max
        on_grid = self.t == self.i * s.dt
        after = s.dt if on_grid and self.i < self.last else target - self.t
        if after <= 1e-9 * s.dt or self.i > self.last:
            return self._close(record.Outcome("time limit", self.t, self.i))
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
                if self._cross(i, up, self.t):
                    return None
                crossed.add(i)  # at most once a sample, so that a border cannot hold the run
                continue
            spans = {j: self._landing(q, w, j, after) for j in hit}
            i = min(spans, key=lambda j: spans[j])
            landing, after = (i, self._ahead(q, out[2:], after)[i] >= self.regions.high[i]), spans[i]
            new, command, sample, out = self._tick(q, w, after)
            break
        self._keep(on_grid, q, sample, command, out, after)
        self._engine(w, command, out, after)
        self.state, self.b = new, self.regions.b
        self.before = after
        if landing is None:
            self.i += 1
            self.t = target
        else:
            self.t += after
            i, up = landing
            self._cross(i, up, self.t)

    def _tick(self, q: tuple[float, ...], w: tuple[float, ...], after: float):
        s = self.scenario
        c = self.whole if self.before == after == s.dt else loop.coefficients(s, self.before, after)
        k = loop.damping(self.b, self.regions.b, self.before, after)
        return loop.tick(c, k, q[0], q[1], w[0], w[1], self.state)

    def _ahead(self, q, w, h: float) -> tuple[float, float]:
        """Handle position [m] when the joints have turned from q with w for h seconds."""
        x, y = arm.position(q[0] + h * w[0], q[1] + h * w[1])
        return x - self.scenario.origin[0], y - self.scenario.origin[1]

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

    def _cross(self, i: int, up: bool, t: float) -> bool:
        """Steps over a border; True if it was the end of the path."""
        end = self.regions.at_end(i, up)
        border = self.regions.high[i] if up else self.regions.low[i]
        # half a kick, on the near side of the border, brings the velocity to it
        velocity = self._tick(tuple(self.angles), tuple(self.rates), 0.0)[3] if self.before else (0.0, 0.0)
        self.crossings.append(record.Crossing(axis=AXES[i], border=border, time=t, speed=velocity[i]))
        if end:
            self._close(record.Outcome("finished", t, self.i))
        else:
            self.regions.cross(i, up)
        return end

    def _close(self, result: record.Outcome) -> None:
        """The last sample: half a kick brings the rates to it, nothing is stepped."""
        q = tuple(self.angles)
        if self.before > 0.0:
            _, command, sample, out = self._tick(q, tuple(self.rates), 0.0)
            self._keep(True, q, sample, command, out, 0.0)
        self.end_time = self.t
        self.outcome = result

    def _keep(self, is_sample: bool, q, sample, command, out, after: float) -> None:
        b0, b1 = self.b, self.regions.b
        _row.pack_into(
            self.rows, self.filled * loop.ROW, *q, *sample[:4], *out[:2], *sample[4:6], *command[:2], *sample[6:]
        )
        k = loop.damping(b0, b1, self.before, after)
        self.stretches.append(_Stretch(1, is_sample, b1 if after else b0, k, 0.5 * (self.before + after)))
        self.filled += 1

    def _engine(self, w, command, out, after: float) -> None:
        """Steps the engine by after. If that differs from the length of the kick, the kick goes in whole."""
        model, data, dt = self.model, self.data, self.scenario.dt
        self.steps += 1
        if after == self.before == dt:
            self.write(self.drive, 0, *command)
            mujoco.mj_step(model, data)
            return
        t1, t2 = command[:2]
        a1, a2 = (out[2] - w[0]) / after, (out[2] + out[3] - w[0] - w[1]) / after
        self.write(self.drive, 0, t1, t2, 0.0, 0.0, arm.I1 * a1 + arm.I2 * a2 - t1, arm.I2 * a2 - t2)
        model.opt.timestep = after
        mujoco.mj_step(model, data)
        model.opt.timestep = dt

    def _flush(self) -> None:
        """Judges the rows since the last look and moves them to the record."""
        n, self.filled = self.filled, 0
        raw = np.frombuffer(self.rows, dtype=float, count=14 * n).reshape(n, 14).T.copy()
        pieces, self.stretches = self.stretches, []
        k, H = np.array([x.k for x in pieces]).reshape(-1, 5).T, np.array([x.H for x in pieces])
        at = slice(n)
        if len(pieces) != 1:
            counts = [x.n for x in pieces]
            k, H = np.repeat(k, counts, axis=1), np.repeat(H, counts)
            if not all(x.is_sample for x in pieces):
                at = np.flatnonzero(np.repeat([x.is_sample for x in pieces], counts))
        rows = _sampled(raw, k, self.scenario)[:, at]
        good, found = self.watch.look(rows, self.looked)
        if found is not None:
            self.outcome, self.end_time = found, None
            self.crossings = [c for c in self.crossings if c.time <= found.time]
            n = good if isinstance(at, slice) or not good else int(at[good - 1]) + 1
        self.ledger.add(raw[:, :n], k[:, :n], H[:n])
        if good:
            b = np.repeat([x.b for x in pieces if x.is_sample], [x.n for x in pieces if x.is_sample], axis=0).T
            keep = np.arange(-self.looked % self.every, good, self.every)
            if self.outcome is not None and (not len(keep) or keep[-1] != good - 1):
                keep = np.append(keep, good - 1)
            self.kept.append((self.looked + keep, rows[:, keep] if len(keep) < len(rows.T) else rows, b[:, keep]))
        self.looked += good

    def result(self, wall: float) -> record.Record:
        index, rows, b = (np.concatenate(x, axis=-1) for x in zip(*self.kept, strict=True))
        t = index * self.scenario.dt
        if self.end_time is not None and len(t):
            t[-1] = self.end_time
        assert self.outcome is not None
        q, p, v, fh, tau, delta = (rows[j : j + 2].T.copy() for j in range(0, 12, 2))
        a = q.sum(axis=1)
        u = arm.columns(*(f(x) for x in (q[:, 0], a) for f in (np.sin, np.cos)))  # type: ignore[arg-type]
        r1, r2 = arm.rates(v[:, 0], v[:, 1], *u, 1.0)  # type: ignore[arg-type]
        qd = np.column_stack((r1, r2 - r1))
        return record.Record(
            t=t, p=p, v=v, fh=fh, fe=b.T * v, b=b.T.copy(), q=q, qd=qd, tau=tau, delta=delta,
            scenario=self.scenario, outcome=self.outcome, crossings=tuple(self.crossings), energy=self.ledger.close(),
            steps=self.steps, wall_time=wall,
        )  # fmt: skip
