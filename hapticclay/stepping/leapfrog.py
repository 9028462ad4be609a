"""The default run: a leapfrog of one engine step a sample, second order, in plain Python."""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..model import arm
from ..model.clay import damping_at
from ..model.operator import NO_HAND
from ..model.scenario import Scenario
from . import energy, loop
from .engine import CHUNK, TOUCH, Run, command_view, find_root, mujoco, shared_view
from .inline import inline

LANDINGS = 4  # on borders in one step; a handle that slides along one then completes the step
FIRST_OF_HIT = 0.02  # first step of a hit that saturates the motors, in decay times of the speed
HIT_GROWTH = 1.01  # of each step of it over the one before
INPUTS = 12  # numbers in loop.step_inputs
ZERO = (0.0, 0.0)
FUSE_FROM = 50_000  # steps from which inlining the loop (some 50 ms, once per process) pays

_row = struct.Struct("14d")
_fused: dict[Callable[..., Any], Callable[..., Any]] = {}  # loops that have been inlined


def written_out(law: Any, steps: int) -> Callable[..., tuple[float, ...]]:
    """The loop with its laws inlined, where that many steps repay the effort or it is done already.

    Args:
        law: `glide_constant` or `glide_varying`.
        steps: steps to come.

    Returns:
        A function of the same arguments.
    """
    if law not in _fused:
        if steps < FUSE_FROM:
            return law
        _fused[law] = inline(law, frozenset({"stiff"} if law is glide_constant else ()))
    return _fused[law]


class _Stretch(NamedTuple):
    """Consecutive rows with these values in common."""

    n: int
    is_sample: bool  # False at a border between two samples
    b: Any  # clay at the sample [N.s/m], (2, n), (2, 1) or a tuple
    k: Any  # loop.step_inputs, (INPUTS, n), (INPUTS, 1) or a tuple
    H: float  # length of the kick [s]
    rest: Any = ZERO  # clay's force beside its dampers [N], (2, n) or a tuple


def _spread_rows(columns: list[Any], counts: list[int]) -> np.ndarray:
    """Columns side by side, each repeated to its count; a tuple is one column."""
    out: list[np.ndarray] = []
    pairs = zip(columns, counts, strict=True)
    for single, some in itertools.groupby(pairs, key=lambda pair: isinstance(pair[0], tuple)):
        if single:  # of careful runs there are thousands
            out.append(np.array([x for x, _ in some]).T)
        else:
            out += [np.broadcast_to(x, (len(x), n)) for x, n in some]
    return np.concatenate(out, axis=1) if out else np.empty((2, 0))


def _rows_at_samples(
    raw: np.ndarray, k: np.ndarray, rest: np.ndarray, scenario: Scenario
) -> np.ndarray:
    """Converts kicks, shape (14, n), to (q, p, v, fh, tau, delta) at their samples, shape (12, n).

    Args:
        raw: the kicks.
        k: loop.step_inputs of each kick, shape (INPUTS, n), or (INPUTS, 1) for all.
        rest: clay force beside its dampers [N], shape (2, n) or (2, 1).
        scenario: the scenario.
    """
    out = np.empty((12, raw.shape[1]))
    before, after = raw[4:6], raw[6:8]
    out[0:4] = raw[0:4]
    out[4:6] = before + k[4] * (after - before)
    if k[10:12].any():  # see loop.velocity_at_sample
        soft = k[10:12] * (k[0:4:2] * before + k[1:4:2] * after + rest)
        out[4:6] = np.where(k[10:12] > 0.0, soft, out[4:6])
    if scenario.operator:
        out[6:8] = raw[8:10] + k[0:4:2] * before + k[1:4:2] * after + rest
    else:
        out[6:8] = k[5:7]
    out[8:12] = raw[10:14]
    return out


class Leapfrog(Run):
    """One engine step a sample; a step that would cross a border ends on it, another completes it.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
    """

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        self.motion, self.read = shared_view(self.data.qpos, self.data.qvel)
        self.drive, self.write = command_view(self.data.ctrl, self.data.qfrc_applied)
        self.state: Any = loop.initial_state(scenario.start, scenario.velocity)
        self.whole = loop.loop_coefficients(scenario, scenario.dt, scenario.dt)
        self.hand = scenario.operator or NO_HAND
        if scenario.control == "continuous":  # `_glide` needs these, before the run is timed
            written_out(glide_varying if self.varies else glide_constant, self.last)
            if 0.5 * scenario.dt * self.regions.stiffest * arm.TRACE_W > 1.0:
                written_out(glide_varying, self.last)
        self.landings = 0  # on borders since the last sample
        self.struck = True  # the handle has just come into this clay
        self.fine = math.inf  # longest step on the way from a hit [s]
        self.final: Any = None  # velocity of the handle at the end [m/s]
        self.before = 0.0  # length of the step that led here [s]
        self.clay = self.regions.base, self.regions.rate  # before the sample
        self.rows = bytearray(CHUNK * GLIDE_ROW)
        self.filled = 0
        self.stretches: list[_Stretch] = []
        self.ledger = energy.EnergyLedger(scenario)

    def advance(self) -> bool:
        if not self._glide():
            self._careful()
        return self.filled >= CHUNK - 1

    def _glide(self) -> bool:
        """Makes whole steps, up to the first that crosses a border; False if there is none."""
        dt = self.scenario.dt
        n = min(self.last - self.i, CHUNK - 1 - self.filled)
        if self.before != dt or self.clay != (self.regions.base, self.regions.rate) or n < 1:
            return False
        p, ahead = (self.position(self.angles, self.rates, h) for h in (0.0, dt))
        for i in (0, 1):  # do not run far beyond the border that lies ahead
            d = ahead[i] - p[i]
            if d:
                way = ((self.regions.high[i] if d > 0.0 else self.regions.low[i]) - p[i]) / d
                n = min(n, max(16, int(min(0.95 * way, n))))
        q, w, state = tuple(self.angles), tuple(self.rates), self.state
        rows = range(self.filled * GLIDE_ROW, (self.filled + n) * GLIDE_ROW, GLIDE_ROW)
        rest: list[tuple[float, float]] = []
        if self.varies:
            b, inputs, shift = self._ahead(n)
            b, k = np.array(b).T, np.array(inputs).T
        else:
            b = self.regions.b(self.t)
            inputs = loop.step_inputs(b, b, self.scenario.force, dt, dt, self.hand)
            shift = [0.0] * n, [0.0] * n
            b, k = np.reshape(b, (2, 1)), np.reshape(inputs, (INPUTS, 1))
        simple = not self.varies and not k[7, 0]
        many = written_out(glide_constant if simple else glide_varying, self.last)
        if simple:
            steps, given = rows, (self.whole, inputs)
        else:
            each = inputs if self.varies else itertools.repeat(inputs, n)
            steps, given = list(zip(rows, each, *shift, strict=True)), (rest, self.whole)
        while True:
            self.state = many(
                steps[:n], *given, state,
                self.read, self.write, _row.pack_into, self.motion, self.drive, self.rows,
                mujoco.mj_step, self.model, self.data,
            )  # fmt: skip
            good = self._good(self.filled, n)
            if good == n:
                break
            self.angles[0], self.angles[1] = q
            self.rates[0], self.rates[1] = w
            n = good
            rest.clear()
            if n < 1:
                self.state = state
                return False
        self.stretches.append(_Stretch(n, True, b[:, :n], k[:, :n], dt, np.array(rest or [ZERO]).T))
        self.filled += n
        self.steps += n
        self.i += n
        self.t = self.i * dt
        return True

    def _ahead(self, n: int) -> tuple[list, list, list]:
        """Clay at the next n samples, loop.step_inputs there, change of the command (x, y)."""
        dt = self.scenario.dt
        t = (self.i + np.arange(n + 1)) * dt
        now = t[:n].tolist()
        b = [self.regions.b(x) for x in now]
        uh = self.uh(t[:n] - 0.5 * dt, t[:n] + 0.5 * dt).tolist()
        if self.regions.grows:
            halves = [(self.regions.b(x - 0.25 * dt), self.regions.b(x + 0.25 * dt)) for x in now]
            k = [
                loop.step_inputs(b0, b1, u, dt, dt, self.hand)
                for (b0, b1), u in zip(halves, uh, strict=True)
            ]
        else:
            same = loop.step_inputs(b[0], b[0], ZERO, dt, dt, self.hand)
            k = [(*same[:5], *u, *same[7:]) for u in uh]
        return b, k, self.shift(t[:n], t[1:]).T.tolist()

    def _good(self, first: int, n: int) -> int:
        """Number of the n steps from row first that stay in the region."""
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
        """One step with a look at its end, which lies on a border if one is in the way."""
        target, after, on_grid = self.target()
        if not after:
            return self._close("time limit")
        if on_grid:
            self.landings = 0
        q, w = tuple(self.angles), tuple(self.rates)
        crossed: dict[int, bool] = {}  # borders stepped over without a step: axis, upwards
        after = min(after, self.fine)
        while True:
            if self.struck:
                self.struck, self.fine = False, self._first_of_a_hit(q, w, after)
                if self.fine < after:
                    after, w = self.fine, self._halve(q, w)
            new, command, sample, out = self._tick(q, w, after)
            here, there = self.position(q, out[2:], 0.0), self.position(q, out[2:], after)
            ups = {
                i: there[i] > self.regions.high[i] for i in (0, 1) if not self.inside(i, there[i])
            }
            # no way back over a border: it must not hold the run
            hit = [i for i in ups if crossed.get(i, ups[i]) == ups[i]]
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
        self.state, self.clay = new, (self.regions.base, self.regions.rate)
        self.before = after
        self.fine *= HIT_GROWTH if self._limited(command) else math.inf
        self.t += after
        if target - self.t <= 1e-9 * self.scenario.dt:
            self._arrive(target)
        if landing is not None:
            self.landings += 1
            self._cross(*landing)
        return None

    def _velocity(self, q, w, out) -> tuple[float, float]:
        """Handle velocity now [m/s], on the near side of a border.

        Half a kick has led to `out`. In stiff clay that half holds too little of the clay; the
        velocity is then that of a whole kick.
        """
        k = self._inputs(self.before, self.before)
        if not (k[10] or k[11]):
            return out[:2]
        at, end = self._whole_kick(q, w)
        x, y = (
            loop.velocity_at_sample(k, i, at[2 + i], end[i], at[8 + i]) if k[10 + i] else out[i]
            for i in (0, 1)
        )
        return x, y

    def _whole_kick(self, q, w) -> tuple[Any, Any]:
        """Sample and end of a kick here, with the step before it repeated; see loop.step_loop."""
        return self._tick(q, w, self.before)[2:]

    def _halve(self, q: tuple[float, ...], w: tuple[float, ...]) -> tuple[float, ...]:
        """Ends the step that led here with its half of the kick; returns the joint rates now."""
        if self.before:
            self.state, command, sample, out = self._tick(q, w, 0.0)
            self._keep(False, q, sample, command, out, 0.0)
            self.before, w = 0.0, out[2:]
            self.rates[0], self.rates[1] = w
        return w

    def _first_of_a_hit(self, q: tuple[float, ...], w: tuple[float, ...], after: float) -> float:
        """First of the steps that resolve a hit which saturates the motors [s]; else inf."""
        b = max(self.regions.b(self.t))
        first = FIRST_OF_HIT / (b * arm.TRACE_W) if b else math.inf
        if first >= after:
            return math.inf
        state, before = self.state, self.before
        if before:
            self.state, _, _, out = self._tick(q, w, 0.0)
            self.before, w = 0.0, out[2:]
        command = self._tick(q, w, first)[1]
        self.state, self.before = state, before
        return first if self._limited(command) else math.inf

    def _limited(self, command: tuple[float, ...]) -> bool:
        """Whether a motor is at its limit in this kick."""
        limit = self.scenario.torque_limit
        return abs(command[0]) >= limit[0] or abs(command[1]) >= limit[1]

    def _arrive(self, target: float) -> None:
        """Moves the clock to the time of `target` [s]."""
        self.i += 1
        self.t = target

    def _tick(self, q: tuple[float, ...], w: tuple[float, ...], after: float) -> Any:
        s = self.scenario
        whole = self.before == after == s.dt
        c = self.whole if whole else loop.loop_coefficients(s, self.before, after)
        k = self._inputs(self.before, after)
        state, *rest = loop.step_loop(c, k, q[0], q[1], w[0], w[1], self.state)
        if self.command and after:
            cx, cy = self.shift(self.t, self.t + after).tolist()
            state = (state[0] + cx, state[1] + cy, *state[2:])
        return state, *rest

    def _inputs(self, before: float, after: float) -> tuple[float, ...]:
        """loop.step_inputs of the kick at this time, between steps of these lengths."""
        t = self.t
        b0, b1 = damping_at(*self.clay, t - 0.25 * before), self.regions.b(t + 0.25 * after)
        return loop.step_inputs(
            b0, b1, self.uh(t - 0.5 * before, t + 0.5 * after), before, after, self.hand
        )

    def _landing(self, q, w, i: int, up: bool, after: float, there: float) -> float:
        """Length of the step that ends on the border of coordinate i."""
        border = self.regions.high[i] if up else self.regions.low[i]

        def miss(h: float) -> float:
            return self.position(q, self._tick(q, w, h)[3][2:], h)[i] - border

        return find_root(miss, after, there - border)

    def _cross(self, i: int, up: bool) -> bool:
        q, w = tuple(self.angles), tuple(self.rates)
        speed = self._velocity(q, w, self._tick(q, w, 0.0)[3])[i] if self.before else 0.0
        end = self.cross(i, up, speed)
        self.struck = True
        if end:
            self._close("finished")
        return end

    def _close(self, code: str) -> None:
        """Takes the last sample: half a kick brings the rates to it, nothing is stepped."""
        q = tuple(self.angles)
        if self.before > 0.0:
            w = tuple(self.rates)
            _, command, sample, out = self._tick(q, w, 0.0)
            self._keep(True, q, sample, command, out, 0.0)
            self.final = self._velocity(q, w, out)
        self.finish(code)

    def _keep(self, is_sample: bool, q, sample, command, out, after: float) -> None:
        row = (*q, *sample[:4], *out[:2], *sample[4:6], *command[:2], *sample[6:])
        k = self._inputs(self.before, after)
        self._put(is_sample, row, k, 0.5 * (self.before + after), after > 0.0)

    def _put(
        self, is_sample: bool, row: tuple[float, ...], k: tuple[float, ...], H: float, goes_on: bool
    ) -> None:
        """Keeps the row of one kick, with the clay of the region in which the run continues."""
        _row.pack_into(self.rows, self.filled * GLIDE_ROW, *row[:14])
        b = self.regions.b(self.t) if goes_on else damping_at(*self.clay, self.t)
        self.stretches.append(_Stretch(1, is_sample, b, k, H, row[14:]))
        self.filled += 1

    def _engine(self, w, command, out, after: float) -> None:
        """Steps the engine by after; the kick goes in whole if it has another length."""
        model, data, dt = self.model, self.data, self.scenario.dt
        self.steps += 1
        if after == self.before == dt:
            self.write(self.drive, 0, *command)
            mujoco.mj_step(model, data)
        else:
            self._whole(w, command, out, after)

    def _whole(self, w, command, out, after: float) -> None:
        """Steps the engine by after, from joint rates w to those of out."""
        t1, t2, *_ = command
        self.write(self.drive, 0, *loop.whole_kick(w[0], w[1], out[2], out[3], t1, t2, after))
        self.model.opt.timestep = after
        mujoco.mj_step(self.model, self.data)
        self.model.opt.timestep = self.scenario.dt

    def flush(self) -> None:
        n, self.filled = self.filled, 0
        raw = np.frombuffer(self.rows, dtype=float, count=14 * n).reshape(n, 14).T.copy()
        pieces, self.stretches = self.stretches, []
        k, H, which = np.empty((INPUTS, 0)), np.array([x.H for x in pieces]), slice(n)
        rest = np.empty((2, 0))
        if len(pieces) == 1:
            k, rest = np.reshape(pieces[0].k, (INPUTS, -1)), np.reshape(pieces[0].rest, (2, -1))
        elif pieces:
            counts = [x.n for x in pieces]
            k, H = _spread_rows([x.k for x in pieces], counts), np.repeat(H, counts)
            rest = _spread_rows([x.rest for x in pieces], counts)
            if not all(x.is_sample for x in pieces):
                which = np.flatnonzero(np.repeat([x.is_sample for x in pieces], counts))
        samples = [x for x in pieces if x.is_sample]
        rows = _rows_at_samples(raw, k, rest, self.scenario)
        if self.final and n:
            rows[4:6, -1] = self.final
        good = self.judge(
            rows[:, which],
            lambda: _spread_rows([x.b for x in samples], [x.n for x in samples]),
        )
        if self.outcome is not None and self.end_time is None:
            n = good if isinstance(which, slice) or not good else int(which[good - 1]) + 1
        self.ledger.add(raw[:, :n], k[:, :n], rest[:, :n], H[:n])

    def balance(self) -> dict[str, float]:
        return self.ledger.close()


GLIDE_ROW = 14 * 8  # bytes of a row: q, p, v before and after, f, tau, delta, two axes each


def glide_constant(rows, c, k, state, read, write, keep, motion, drive, buffer, step, model, data):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """Whole steps within one region of clay that is not stiff.

    Args:
        rows: range of offsets into the record, one a step [bytes].
        c: from `loop.loop_coefficients`, for whole steps.
        k: from `loop.step_inputs`, for whole steps.
        state: see `loop.step_loop`.
        read: unpacks q1, q2, w1, w2 from `motion`.
        write: packs a command into `drive`.
        keep: packs one row into `buffer`.
        motion: the engine's memory.
        drive: the engine's memory.
        buffer: the record.
        step: mj_step.
        model: the engine's model.
        data: the engine's data.

    Returns:
        The state after the last step.
    """
    s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11 = state
    for row in rows:
        q1, q2, w1, w2 = read(motion)
        (
            (s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11),
            (t1, t2, bx, by, p1, p2),
            (px, py, vx, vy, fx, fy, dx, dy, _, _),
            (ux, uy, n1, n2),
        ) = loop.step_loop(c, k, q1, q2, w1, w2, (s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11))
        write(drive, 0, t1, t2, bx, by, p1, p2)
        keep(buffer, row, q1, q2, px, py, vx, vy, ux, uy, fx, fy, t1, t2, dx, dy)
        step(model, data)
    return s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11


def glide_varying(  # noqa: PLR0913  # compiled and inlined: plain numbers
    steps, rest, c, state, read, write, keep, motion, drive, buffer, step, model, data
):
    """As `glide_constant`, where the clay is stiff or anything changes from step to step.

    Args:
        steps: a step each: offset into the record [bytes], `loop.step_inputs`, change of the
            command over it x, y [m].
        rest: list that gets the clay force beside its dampers in each kick, (x, y) [N].
        c: as in `glide_constant`.
        state: as in `glide_constant`.
        read: as in `glide_constant`.
        write: as in `glide_constant`.
        keep: as in `glide_constant`.
        motion: as in `glide_constant`.
        drive: as in `glide_constant`.
        buffer: as in `glide_constant`.
        step: as in `glide_constant`.
        model: as in `glide_constant`.
        data: as in `glide_constant`.

    Returns:
        The state after the last step.
    """
    s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11 = state
    for row, k, cx, cy in steps:
        q1, q2, w1, w2 = read(motion)
        (
            (s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11),
            (t1, t2, bx, by, p1, p2),
            (px, py, vx, vy, fx, fy, dx, dy, rx, ry),
            (ux, uy, n1, n2),
        ) = loop.step_loop(c, k, q1, q2, w1, w2, (s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11))
        s0 += cx
        s1 += cy
        write(drive, 0, t1, t2, bx, by, p1, p2)
        keep(buffer, row, q1, q2, px, py, vx, vy, ux, uy, fx, fy, t1, t2, dx, dy)
        rest.append((rx, ry))
        step(model, data)
    return s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11
