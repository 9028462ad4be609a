"""Judges a run of an arm from a file by its joints: which one buzzes, or leaves its range."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..arms.joint_law import JointPD, compensated
from ..arms.joint_ranges import widened
from ..arms.joint_units import of_joint
from ..scene.scenario import Scenario
from ..theory.client_loop import with_hands_of
from ..theory.joint_gains import joint_loop
from .monitor import LIMITS, OFTEN, STILL, WHILE, Outcome, at_rest, with_own_lists

FASTEST = 200.0  # [rad/s or m/s] beyond any joint of an arm
GROWTH = 30.0  # an oscillation that has grown so much, swing by swing, is unstable
SWINGS = 6  # that a verdict needs
STEP_GROWTH = 2.0  # growth of one swing counts to this factor: a push is no instability
CYCLE = 30  # swings into the torque limits that do not decay are a limit cycle
PERIOD = 0.1  # [s] before a verdict: of the joints that oscillate, the fastest is to blame
FLOOR = 1e-9  # [rad/s] swings below this are rounding


class Swings:
    """Turning points of the rate of one joint."""

    def __init__(self) -> None:
        self.turn, self.hits, self.sizes = 0.0, 0, [0.0]
        self.bound: list[bool] = [False]
        self.count, self.grown = 1, 1.0  # swings without a smaller one, and their growth
        self.past = np.zeros(2)

    def look(self, rate: np.ndarray, bound: np.ndarray) -> tuple[int, str] | None:
        """Number of samples to a verdict, and its cause."""
        v = np.concatenate((self.past, rate))
        self.past = v[-2:]
        rise = v[1:] > v[:-1]
        turns = np.flatnonzero(rise[1:] != rise[:-1]) + 1
        sums = np.concatenate(([0, 0], np.cumsum(bound)))
        before = 0
        for at in turns.tolist():
            self.hits += int(sums[at] - before)
            before = int(sums[at])
            cause = self._swing(abs(float(v[at]) - self.turn), self.hits > 0)
            self.turn, self.hits = float(v[at]), 0
            if cause:
                return max(at - 1, 1), cause
        self.hits += int(sums[-1] - before)
        return None

    def _swing(self, size: float, bound: bool) -> str:
        if size < FLOOR or size < (0.8 if bound else 1.0) * self.sizes[-1]:
            self.sizes, self.bound, self.count, self.grown = [], [], 0, 1.0
        if self.sizes and self.sizes[-1] > 0.0:
            self.grown *= min(size / self.sizes[-1], STEP_GROWTH)
        self.sizes.append(size)
        self.bound.append(bound)
        self.count += 1
        del self.sizes[:-CYCLE], self.bound[:-CYCLE]
        last = self.sizes
        if len(last) == CYCLE and all(self.bound) and last[-1] >= 0.95 * last[0]:
            return LIMITS
        return "growing oscillation" if self.count > SWINGS and self.grown > GROWTH else ""


class JointMonitor:
    """Judges rows of joint positions, rates and torques; the interface of `StabilityMonitor`.

    Under a muscle force that varies, growth counts only where the loop at the arm's pose is
    unstable by theory: joints may swing as they are driven.
    """

    def __init__(self, scenario: Scenario, monitored: bool = True):
        self.scenario = scenario
        self.monitored = monitored and not (scenario.driven and is_stable_at_start(scenario))
        arm = scenario.file_arm
        self.names, self.ranges, self.turning = arm.names, arm.ranges, arm.mechanism.turning
        self.limits = np.array(arm.torque_limit)
        self.onset: Outcome | None = None
        self.seen = self.often = 0
        self.moved = self.unbound = -1
        self.swings = [Swings() for _ in self.names]
        self.bound = np.zeros(0, dtype=bool)

    def copied(self) -> JointMonitor:
        """The monitor as it is now, which further rows do not change."""
        made = with_own_lists(self)
        made.swings = [with_own_lists(x) for x in self.swings]
        return made

    def look(self, rows: np.ndarray, first: int) -> tuple[int, Outcome | None]:
        """Judges the next rows, joints by samples: number of good ones, and an outcome if any."""
        n = len(self.names)
        q, rates, tau = rows[:n], rows[n : 2 * n], rows[2 * n : 3 * n]
        good, lost = self._good(rows, q, rates)
        bound = np.abs(tau[:, :good]) >= self.limits[:, None]
        self._count(rates[:, :good], np.any(bound, axis=0))
        found = self._unstable(rates[:, :good], bound) if self.monitored else None
        if found is not None:
            at, joint, cause = found
            code = "limit cycle" if cause == LIMITS else "diverged"
            verdict = self._outcome(code, first + at - 1, joint, cause)
            if self.scenario.stop_when_unstable:
                return at, verdict
            self.onset = self.onset or verdict
        if good == rows.shape[1]:
            return good, None
        code, joint, cause = lost
        return good, self._outcome(code, max(first + good - 1, 0), joint, cause)

    def _good(self, rows: np.ndarray, q: np.ndarray, rates: np.ndarray) -> tuple[int, Any]:
        """Number of rows before the first bad one: its code, joint and cause."""
        fast = ~(np.abs(rates) <= FASTEST)
        low, high = widened(self.ranges).T
        out = (q < low[:, None]) | (q > high[:, None])
        bad = fast | out | ~np.isfinite(rows).all(axis=0)
        good = int(bad.any(axis=0).argmax()) if bad.any() else rows.shape[1]
        if good == rows.shape[1]:
            return good, None
        if fast[:, good].any() or not out[:, good].any():
            joint = int(np.nan_to_num(np.abs(rates[:, good]), nan=math.inf).argmax())
            return good, ("diverged", joint, f"faster than {FASTEST:g} {self._unit(joint)}/s")
        joint = int(out[:, good].argmax())
        low, high = self.ranges[joint]
        range_ = f"{low:.4g} to {high:.4g} {self._unit(joint)}"
        return good, ("out of reach", joint, f"beyond its range, {range_}")

    def _unit(self, joint: int) -> str:
        return of_joint("rad", self.turning[joint])

    def _count(self, rates: np.ndarray, bound: np.ndarray) -> None:
        """Notes when a joint last moved, and when no motor was at its limit."""
        last = rates.shape[1] - 1
        moving = np.flatnonzero(np.abs(rates).max(axis=0, initial=0.0) > STILL)
        free = np.flatnonzero(~bound)
        self.moved = self.seen + int(moving[-1]) if len(moving) else self.moved
        self.unbound = self.seen + int(free[-1]) if len(free) else self.unbound
        self.often += int(bound.sum())
        self.seen += last + 1
        while_ = max(1, round(WHILE / self.scenario.dt))
        self.bound = np.concatenate((self.bound, bound))[-while_:]

    def _unstable(self, rates: np.ndarray, bound: np.ndarray) -> tuple[int, int, str] | None:
        verdicts = []
        for joint, swings in enumerate(self.swings):
            found = swings.look(rates[joint], bound[joint])
            if found is not None:
                verdicts.append((found[0], joint, found[1]))
        if not verdicts:
            return None
        at, _, cause = min(verdicts)
        span = np.ptp(rates[:, max(0, at - round(PERIOD / self.scenario.dt)) : at + 1], axis=1)
        return at, max((x[1] for x in verdicts), key=lambda j: span[j]), cause

    def _outcome(self, code: str, step: int, joint: int, cause: str) -> Outcome:
        dt, name = self.scenario.dt, self.names[joint]
        return Outcome(code, step * dt, step, name, cause, self._advice(code))

    def _advice(self, code: str) -> str:
        if code == "out of reach":
            return "choose a pose, a reference or a force that keeps the joints within their ranges"
        if code == "limit cycle":
            return "raise torque_limit: the motors saturate"
        return "joint_limits says which gains, rate and delay the arm carries"

    def end(self, outcome: Outcome) -> Outcome:
        """The final outcome of a run, after all its rows."""
        if outcome.code == "interrupted":
            since = self.onset
            return replace(outcome, cause=f"{since.axis}: {since.cause}") if since else outcome
        if self.onset is not None:
            if self.bound.sum() <= OFTEN * len(self.bound):
                return self.onset
            cause = f"{self.onset.cause}, bounded by the torque limits"
            return replace(self.onset, code="limit cycle", cause=cause)
        if outcome.code != "time limit":
            return outcome
        saturated, _ = at_rest(self.seen, self.moved, self.unbound, self.scenario.dt)
        if saturated:
            cause, advice = "a motor stays in its limit", "raise torque_limit, or lower the force"
            return replace(outcome, code="saturated", cause=cause, advice=advice)
        return outcome


def is_stable_at_start(scenario: Scenario) -> bool:
    """Whether the loop of the joints is stable at the arm's pose; so is one that is not known."""
    law = scenario.controller
    if not isinstance(law, JointPD):
        return True
    delay = scenario.hardware.delay if scenario.hardware else 0.0
    feeds, Ts = compensated(scenario.file_arm, law), scenario.Ts or scenario.dt
    return joint_loop(with_hands_of(scenario), law, Ts, delay, feeds).stable()
