"""The default run: a leapfrog of one engine step a sample, second order, in pure Python at speed."""

from __future__ import annotations

import ctypes
import functools
import math
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from . import arm, energy, loop
from .inline import inline
from .params import Scenario
from .run import CHUNK, TOUCH, Run, root

LANDINGS = 4  # on borders in one step; a handle that slides along a border then completes the step beside it
FUSE_FROM = 50_000  # steps from which inlining the loop (some 50 ms, once per process) pays

_row = struct.Struct("14d")


@functools.cache
def _fused() -> Callable[..., tuple[float, ...]]:
    return inline(loop.advance)


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


class Leapfrog(Run):
    """One engine step a sample; a step that would cross a border ends on it, and another completes it."""

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        self.motion, self.read = _window(self.data.qpos, self.data.qvel)
        self.drive, self.write = _outlet(self.data.ctrl, self.data.qfrc_applied)
        self.state: Any = loop.initial_state(scenario.start)
        self.whole = loop.coefficients(scenario, scenario.dt, scenario.dt)
        ready = _fused.cache_info().currsize > 0
        self.many = _fused() if ready or self.last >= FUSE_FROM else loop.advance
        self.landings = 0  # on borders since the last sample
        self.before = 0.0  # length of the step that led here [s]
        self.b = self.regions.b  # clay before the sample [N.s/m]
        self.rows = bytearray(CHUNK * loop.ROW)
        self.filled = 0
        self.stretches: list[_Stretch] = []
        self.ledger = energy.Ledger(scenario)

    def advance(self) -> bool:
        if not self._glide():
            self._careful()
        return self.filled >= CHUNK - 1

    def _glide(self) -> bool:
        """Whole steps in one go; undone from the first that a border lies in. False if there is none to make."""
        dt, b = self.scenario.dt, self.regions.b
        n = min(self.last - self.i, CHUNK - 1 - self.filled)
        if self.before != dt or self.b != b or n < 1:
            return False
        p, ahead = self.position(self.angles, self.rates, 0.0), self.position(self.angles, self.rates, dt)
        for i in (0, 1):  # do not run far beyond the border that lies ahead
            d = ahead[i] - p[i]
            if d:
                way = ((self.regions.high[i] if d > 0.0 else self.regions.low[i]) - p[i]) / d
                n = min(n, max(16, int(min(0.95 * way, n))))
        k = loop.damping(b, b, dt, dt)
        q, w, state = tuple(self.angles), tuple(self.rates), self.state
        begin = self.filled * loop.ROW
        while True:
            self.state = self.many(
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
        end = self.position(self.angles, self.rates, 0.0)
        out = np.zeros(n + 1, dtype=bool)
        for i in (0, 1):
            low, high = self.regions.low[i], self.regions.high[i]
            if low > -math.inf or high < math.inf:
                x = np.append(rows[first:, 2 + i], end[i])
                out |= ~((x >= low - TOUCH) & (x <= high + TOUCH))
        return int(out.argmax()) - 1 if out.any() else n

    def _careful(self) -> None:
        """One step that looks where it ends, and ends on a border if one is in its way."""
        target, after, on_grid = self.target()
        if not after:
            return self._close("time limit")
        if on_grid:
            self.landings = 0
        q, w = tuple(self.angles), tuple(self.rates)
        crossed: dict[int, bool] = {}  # borders stepped over without a step: axis, upwards
        while True:
            new, command, sample, out = self._tick(q, w, after)
            here, there = self.position(q, out[2:], 0.0), self.position(q, out[2:], after)
            ups = {i: there[i] > self.regions.high[i] for i in (0, 1) if not self.inside(i, there[i])}
            hit = [i for i in ups if crossed.get(i, ups[i]) == ups[i]]  # no way back: a border must not hold the run
            if not hit:
                landing = None
                break
            beyond = [i for i in hit if not self.inside(i, here[i])]
            if beyond:
                i = beyond[0]
                if self._cross(i, ups[i]):
                    return None
                crossed[i] = ups[i]
                continue
            if self.landings >= LANDINGS:
                landing = None
                break
            spans = {i: self._landing(q, w, i, ups[i], after, there[i]) for i in hit}
            i = min(hit, key=lambda i: spans[i])
            landing, after = (i, ups[i]), spans[i]
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
            self.landings += 1
            self.t += after
            if target - self.t <= 1e-9 * self.scenario.dt:  # the border lies at the sample itself
                self.i += 1
                self.t = target
            self._cross(*landing)
        return None

    def _tick(self, q: tuple[float, ...], w: tuple[float, ...], after: float) -> Any:
        s = self.scenario
        c = self.whole if self.before == after == s.dt else loop.coefficients(s, self.before, after)
        k = loop.damping(self.b, self.regions.b, self.before, after)
        return loop.tick(c, k, q[0], q[1], w[0], w[1], self.state)

    def _landing(self, q, w, i: int, up: bool, after: float, there: float) -> float:
        """Length of the step that ends on the border of coordinate i."""
        border = self.regions.high[i] if up else self.regions.low[i]

        def miss(h: float) -> float:
            return self.position(q, self._tick(q, w, h)[3][2:], h)[i] - border

        return root(miss, after, there - border)

    def _cross(self, i: int, up: bool) -> bool:
        # half a kick, on the near side of the border, brings the velocity to it
        speed = self._tick(tuple(self.angles), tuple(self.rates), 0.0)[3][i] if self.before else 0.0
        end = self.cross(i, up, speed)
        if end:
            self._close("finished")
        return end

    def _close(self, code: str) -> None:
        """The last sample: half a kick brings the rates to it, nothing is stepped."""
        q = tuple(self.angles)
        if self.before > 0.0:
            _, command, sample, out = self._tick(q, tuple(self.rates), 0.0)
            self._keep(True, q, sample, command, out, 0.0)
        self.finish(code)

    def _keep(self, is_sample: bool, q, sample, command, out, after: float) -> None:
        b0, b1 = self.b, self.regions.b
        row = (*q, *sample[:4], *out[:2], *sample[4:6], *command[:2], *sample[6:])
        k = loop.damping(b0, b1, self.before, after)
        self._put(is_sample, row, k, 0.5 * (self.before + after), b1 if after else b0)

    def _put(self, is_sample: bool, row: tuple[float, ...], k: tuple[float, ...], H: float, b) -> None:
        _row.pack_into(self.rows, self.filled * loop.ROW, *row)
        self.stretches.append(_Stretch(1, is_sample, b, k, H))
        self.filled += 1

    def _engine(self, w, command, out, after: float) -> None:
        """Steps the engine by after. If that differs from the length of the kick, the kick goes in whole."""
        model, data, dt = self.model, self.data, self.scenario.dt
        self.steps += 1
        if after == self.before == dt:
            self.write(self.drive, 0, *command)
            mujoco.mj_step(model, data)
        else:
            self._whole(w, command, out, after)

    def _whole(self, w, command, out, after: float) -> None:
        """Steps the engine by after, from joint rates w to those of out, whatever the length of the kick."""
        t1, t2 = command[:2]
        a1, a2 = (out[2] - w[0]) / after, (out[2] + out[3] - w[0] - w[1]) / after
        self.write(self.drive, 0, t1, t2, 0.0, 0.0, arm.I1 * a1 + arm.I2 * a2 - t1, arm.I2 * a2 - t2)
        self.model.opt.timestep = after
        mujoco.mj_step(self.model, self.data)
        self.model.opt.timestep = self.scenario.dt

    def flush(self) -> None:
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
        samples = [x for x in pieces if x.is_sample]
        good = self.judge(
            _sampled(raw, k, self.scenario)[:, at],
            lambda: np.repeat([x.b for x in samples], [x.n for x in samples], axis=0).T,
        )
        if self.outcome is not None and self.end_time is None:
            n = good if isinstance(at, slice) or not good else int(at[good - 1]) + 1
        self.ledger.add(raw[:, :n], k[:, :n], H[:n])

    def balance(self) -> dict[str, float]:
        return self.ledger.close()
