"""Judges a run in progress: whether it is still good, and whether an axis is unstable."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from ..arguments import named
from ..kernel.watch import (
    CYCLE,
    FLOOR,
    FOLD,
    SPEED,
    STEP_GROWTH,
    STILL,
    SWING_GROWTH,
    SWING_SPACING,
    SWINGS,
)
from ..model.constants import AXES
from ..model.signals import Multisine
from ..model.traits import Hold
from ..scene.scenario import Scenario
from ..theory.pose_limits import PlacedLimit, PoseLimits

LIMITS = "oscillation against the torque limits"
TRANSFER = 3.0  # swing over that of the other axis whose energy it takes: > sqrt(Lambda_y/Lambda_x)
MEMORY = 200  # swings stored
WHILE = 1.0  # [s] at rest for so long at the time limit: stalled; motors at their limits: saturated
OFTEN = 0.1  # share of the last WHILE at the torque limits that makes an unstable run a limit cycle


class StabilityMonitor:
    """Searches the rows of a run, chunk by chunk, for the end of its good part.

    An axis is unstable if the swings of its velocity (from one turning point to the next) grow one
    by one, SWINGS of them at least and by SWING_GROWTH together; or if CYCLE of them in a row drive
    a motor into its torque limit without decay; or if the handle swings out of reach while its gain
    is above the limit of its loop in some clay that it has visited. Under a muscle force or a
    command that varies, growth counts only above that limit: the handle may swing as it is driven.
    Below the limit, the axis must grow beyond what the other axis may have passed to it.
    """

    def __init__(self, scenario: Scenario):
        self.scenario = scenario
        self.past = np.zeros((2, 2))  # last two velocities seen [m/s]
        self.turn = [0.0, 0.0]  # velocity at the last turning point [m/s]
        self.hits = [0, 0]  # samples since then with a motor in its limit
        self.since = [0, 0]  # samples since then
        self.seen = 0  # samples
        # where the handle has been [m]
        self.least, self.most = [math.inf, math.inf], [-math.inf, -math.inf]
        self.moved = -1  # last sample with the handle faster than STILL
        self.unbound = -1  # last sample with no motor at its limit
        self.bound = np.zeros(0, dtype=bool)  # whether a motor is in its limit, of the last WHILE
        self.often = 0  # samples with a motor in its limit
        self.onset: Outcome | None = None  # of an instability that did not end the run
        # of the present growth: size [m/s], whether a motor was in its limit, samples
        self.swings: list[list[tuple[float, bool, int]]] = [[], []]
        self.largest = [0.0, 0.0]  # swing so far [m/s]
        self._limits = PoseLimits(scenario)

    def copied(self) -> StabilityMonitor:
        """The monitor as it is now, which further rows do not change."""
        made = with_own_lists(self)
        made._limits = self._limits.copied()
        return made

    def look(self, rows: np.ndarray, first: int) -> tuple[int, Outcome | None]:
        """Judges the next rows, shape (12, n): number of good ones, and an outcome if any."""
        good = _good_rows(rows)
        if good:
            for i in (0, 1):
                self.least[i] = min(self.least[i], float(rows[2 + i, :good].min()))
                self.most[i] = max(self.most[i], float(rows[2 + i, :good].max()))
        found = self._unstable(rows[:, :good])
        if found is not None:
            n, axis, cause = found
            code = "limit cycle" if cause == LIMITS else "diverged"
            verdict = self._outcome(code, first + n - 1, axis, cause)
            if self.scenario.stop_when_unstable:
                return n, verdict
            self.onset = self.onset or verdict
        if good == rows.shape[1]:
            return good, None
        return good, self._lost(rows[:, good], max(first + good - 1, 0))

    def _lost(self, row: np.ndarray, step: int) -> Outcome:
        """Outcome of a run whose next row is not good."""
        v, q2, count = row[4:6], float(row[1]), [len(x) for x in self.swings]
        above = [i for i in (0, 1) if count[i] and self._above_limit(i)]
        axis = self._blame(above) if max(count) >= 3 or any(count[i] >= 2 for i in above) else ""
        if axis:
            return self._outcome("diverged", step, axis, "oscillation out of reach")
        if abs(math.sin(q2)) < FOLD:
            stretched = math.cos(q2) > 0.0
            code, where = ("out of reach", "stretched") if stretched else ("singular", "folded")
            low, high = self.scenario.arm.reach
            reach = f"within {low:.3g} to {high:.3g} m of the shoulder"
            advice = f"choose a force, start or origin that keeps the handle {reach}"
            return Outcome(code, step * self.scenario.dt, step, "", f"the arm is {where}", advice)
        axis = AXES[int(np.argmax(np.nan_to_num(np.abs(v), nan=np.inf)))]
        return self._outcome("diverged", step, axis, f"faster than {SPEED:g} m/s")

    def _outcome(self, code: str, step: int, axis: str, cause: str) -> Outcome:
        """Outcome of an unstable axis."""
        return Outcome(code, step * self.scenario.dt, step, axis, cause, self._advice(axis))

    def end(self, outcome: Outcome) -> Outcome:
        """The final outcome of a run, after all its rows."""
        s = self.scenario
        if outcome.code == "interrupted":
            since = self.onset
            return replace(outcome, cause=f"{since.axis} axis: {since.cause}") if since else outcome
        if self.onset is not None:
            if self.bound.sum() <= OFTEN * len(self.bound):
                return replace(self.onset, code="diverged")
            cause = f"{self.onset.cause}, bounded by the torque limits"
            return replace(self.onset, code="limit cycle", cause=cause)
        if outcome.code == "unresolved":
            return outcome
        saturated, stalled = at_rest(self.seen, self.moved, self.unbound, s.dt)
        if outcome.code == "time limit" and saturated:
            least = "rms" if isinstance(s.muscle, Multisine) else "the force"
            cause, advice = "a motor stays in its limit", f"{self._raise_limit()}, or lower {least}"
            return replace(outcome, code="saturated", cause=cause, advice=advice)
        if outcome.code == "time limit" and stalled:
            cause, advice = f"slower than {STILL:g} m/s", self._why_still()
            return replace(outcome, code="stalled", cause=cause, advice=advice)
        share = self.often / max(self.seen, 1)
        if share >= 0.01:
            cause = f"motors in their limits for {100.0 * share:.0f} % of the time"
            return replace(outcome, cause=cause)
        return outcome

    def _why_still(self) -> str:
        s = self.scenario
        if isinstance(s.muscle, Multisine):
            return "raise rms"
        if any(th and th.spring for th in s.operators):
            holds = "the spring of the hand holds the muscle's force"
            return f"{holds}: raise force, or lower operator.spring"
        if not any(s.force):
            return "give a force"
        way = int(abs(s.force[1]) > abs(s.force[0]))
        hold = s.clay.hold(way) if s.clay else Hold(0.0)
        push = math.hypot(*s.force) if hold.together else abs(s.force[way])
        if push > hold.force:
            return "raise force, or lower b"
        return f"raise the force above the yield force, {hold.force:.6g} N, or lower {hold.field}"

    def _count(self, v: np.ndarray, bound: np.ndarray) -> None:
        """Notes when the handle last moved, and when the motors were at their limits."""
        last = len(bound) - 1
        fast = np.abs(v).max(axis=0) > STILL
        if fast.any():
            self.moved = self.seen + last - int(fast[::-1].argmax())
        if not bound.all():
            self.unbound = self.seen + last - int((~bound)[::-1].argmax())
        self.often += int(bound.sum())
        self.seen += last + 1
        if not self.scenario.stop_when_unstable:
            last = max(1, round(WHILE / self.scenario.dt))
            self.bound = np.concatenate((self.bound, bound))[-last:]

    def _unstable(self, rows: np.ndarray) -> tuple[int, str, str] | None:
        verdicts = {}
        v = np.concatenate((self.past, rows[4:6]), axis=1)
        self.past = v[:, -2:]
        tau, limit = np.abs(rows[8:10]), np.reshape(self.scenario.torque_limit, (2, 1))
        hit = np.zeros(v.shape[1], dtype=int)
        bound = np.zeros(rows.shape[1], dtype=bool)
        if np.any(tau.max(axis=1, initial=0.0) >= limit[:, 0]):
            bound = np.asarray((tau >= limit).any(axis=0))
            hit[2:] = np.cumsum(bound)
        if len(bound):
            self._count(rows[4:6], bound)
        for i in range(2):
            rise = v[i, 1:] > v[i, :-1]
            turns = np.flatnonzero(rise[1:] != rise[:-1]) + 1
            if not len(turns):
                self.hits[i] += int(hit[-1])
                self.since[i] += rows.shape[1]
                continue
            spans = np.diff(turns, prepend=1 - self.since[i])
            self.since[i] = v.shape[1] - 1 - int(turns[-1])
            hits = np.diff(hit[turns], prepend=-self.hits[i])
            sizes = np.abs(np.diff(v[i, turns], prepend=self.turn[i]))
            self.turn[i] = float(v[i, turns[-1]])
            self.hits[i] = int(hit[-1] - hit[turns[-1]])
            big = np.flatnonzero(sizes >= FLOOR)
            before = -1
            for j in big:
                if j != before + 1:
                    self.swings[i] = []
                before = j
                self._swing(i, float(sizes[j]), bool(hits[j]), int(spans[j]))
                cause = "" if self.onset or i in verdicts else self._verdict(i)
                if cause:
                    verdicts[i] = (max(int(turns[j]) - 1, 1), cause)
                    if self.scenario.stop_when_unstable:
                        break
            if before != len(turns) - 1 and i not in verdicts:
                self.swings[i] = []
        if not verdicts:
            return None
        growing = [i for i in (0, 1) if len(self.swings[i]) >= 3]
        axis = self._blame([i for i in growing if self._above_limit(i)] or list(verdicts))
        n, cause = min(verdicts.values())
        return n, axis, cause

    def _swing(self, i: int, size: float, saturated: bool, span: int) -> None:
        last = self.swings[i][-1][0] if self.swings[i] else 0.0
        if size < (0.8 if saturated else 1.0) * last:
            self.swings[i] = []
        self.swings[i].append((size, saturated, span))
        self.largest[i] = max(self.largest[i], size)
        del self.swings[i][:-MEMORY]

    def _verdict(self, i: int) -> str:
        swings = self.swings[i]
        if len(swings) < SWINGS:
            return ""
        cycle = swings[-CYCLE:]
        if len(cycle) == CYCLE and all(x[1] for x in cycle) and cycle[-1][0] >= 0.95 * cycle[0][0]:
            if cycle[-1][0] >= self.largest[1 - i] or self._above_limit(i):
                return LIMITS
        sizes = [x[0] for x in swings]
        if sum(x[2] for x in swings[-SWINGS:]) < SWING_SPACING * SWINGS:
            return ""
        steps = zip(sizes, sizes[1:], strict=False)
        if math.prod(min(b / a, STEP_GROWTH) for a, b in steps) <= SWING_GROWTH:
            return ""
        driven = self.scenario.driven
        if (driven or sizes[-1] < TRANSFER * self.largest[1 - i]) and not self._above_limit(i):
            return ""
        return "growing oscillation"

    def _blame(self, axes: list[int]) -> str:
        return AXES[max(axes, key=lambda i: self.swings[i][-1][0])] if axes else ""

    def _visited(self, i: int) -> PlacedLimit:
        """The lowest gain limit of axis i where the handle has been."""
        return self._limits.least(i, (self.least[0], self.least[1]), (self.most[0], self.most[1]))

    def _above_limit(self, i: int) -> bool:
        return self.scenario.gain[i] > self._visited(i).K

    def _raise_limit(self) -> str:
        shoulder, elbow = self.scenario.torque_limit
        return f"raise torque_limit from {shoulder:g}, {elbow:g} N.m"

    def _advice(self, axis: str) -> str:
        s = self.scenario
        i = AXES.index(axis)
        limit = min((self._limits.ahead(i), self._visited(i)), key=lambda x: s.gain[i] <= x.K)
        if s.gain[i] > limit.K:
            shape = ", or turn shaping on" if self._limits.stable_if_shaped(i, limit.b) else ""
            return (
                f"lower gain[{axis}] from {s.gain[i]:g} to less than {limit.K:.4g}, "
                f"the limit of the linear loop {limit}{shape}"
            )
        if any(x[1] for x in self.swings[i]):
            return f"{self._raise_limit()}: the motors saturate"
        if s.controller is not None:
            return "change the controller, or lower dt or Ts"
        if not s.inertia_shaping:
            changes = "the arm's inertia changes along the path"
            return f"turn shaping on: the loop is stable at the nominal pose, {changes}"
        return f"lower dt from {s.dt:g} s, or gain[{axis}] from {s.gain[i]:g}"


def _good_rows(rows: np.ndarray) -> int:
    """Number of rows before the first that is not finite, too fast, or of a straight arm."""
    v, bend = np.abs(rows[4:6]), np.abs(np.sin(rows[1]))
    # first a cheap test: is anything wrong at all?
    if not bend.size or (np.isfinite(rows.sum()) and v.max() <= SPEED and bend.min() >= FOLD):
        return rows.shape[1]
    bad = ~np.isfinite(rows).all(axis=0) | (v > SPEED).any(axis=0) | (bend < FOLD)
    return int(bad.argmax()) if bad.any() else rows.shape[1]


Judge = TypeVar("Judge")


def with_own_lists(judge: Judge) -> Judge:
    """A copy of an object whose lists, of numbers and of lists of them, are its own."""
    made = copy.copy(judge)
    for name, value in vars(judge).items():
        if isinstance(value, list):
            setattr(made, name, [list(x) if isinstance(x, list) else x for x in value])
    return made


class RangeMonitor(StabilityMonitor):
    """Ends a run only out of reach or above the largest speed; gives no verdict on stability."""

    def _unstable(self, rows: np.ndarray) -> None:
        return None


def at_rest(seen: Any, moved: Any, unbound: Any, dt: float) -> tuple[Any, Any]:
    """How a handle rests at the time limit, if it does. Numbers, or arrays over runs."""
    recent = np.maximum(1, np.minimum(seen, round(WHILE / dt)))
    return seen - 1 - unbound >= recent, seen - 1 - moved >= recent


@named
@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        code: "finished", "time limit"; "stalled" (at rest at the time limit), "saturated" (at rest
            with a motor at its limit); "diverged", "limit cycle" (an unstable axis, bounded by the
            torque limits); "out of reach" (the arm is stretched), "singular" (it is folded);
            "unresolved" (one sample takes too many steps); "interrupted" (on request of progress).
        time: simulated time of the end, or of the verdict on an unstable run that went on [s].
        step: index of the last good sample.
        axis: the unstable axis, or joint of an arm from a file, "" if none.
        cause: what happened, in words.
        advice: what to change, in words.
    """

    code: str
    time: float
    step: int
    axis: str = ""
    cause: str = ""
    advice: str = ""

    def __str__(self) -> str:
        where = f": {self.axis}{' axis' * (self.axis in AXES)}" if self.axis else ""
        return f"{self.code}{where} at {self.time:.4f} s" + (
            f" ({self.cause})" if self.cause else ""
        )
