"""Outcome of a push over the yield force of the clay and the gain: theory and runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..display import table_of, text_table
from ..errors import ParameterError, choice
from ..model.clay import slab
from ..model.constants import AXES
from ..model.flow import Flow
from ..results import Result
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..simulation.simulate import simulate
from ..theory.describing import limit_cycles, push_outcomes
from ..theory.gain_limits import gain_limit
from ..theory.loops import TIMING, Loop
from ..theory.relay_cycle import critical_push, exact_cycles
from ..theory.roots import first_failure
from .boundary import LARGE_PUSH, PushedLoop

YIELD_FORCES = (0.1, 100.0)  # [N] of the map
GAINS = (0.1, 100.0)  # gains among which the least with a limit cycle is searched
NO_LIMITS = (1e6, 1e6)  # [N.m] motors for which the loop is linear
RUN_SPANS = (6.0, 24.0, 96.0)  # [s] of a run, longer where it has not settled
SETTLED = 0.01  # relative change of a settled cycle's speed from quarter to quarter

PushClass = Literal["sticks", "limit cycle", "grows"]


@dataclass(frozen=True)
class MeasuredCycle:
    """The oscillation in the last half of a run."""

    speed: float  # largest velocity [m/s]
    fundamental: float  # amplitude of the velocity at omega [m/s]
    amplitude: float  # half the distance between its ends [m]
    omega: float  # [rad/s]
    change: float  # relative growth of the speed from the third to the last quarter of the run


@dataclass(frozen=True)
class YieldCell:
    """A push at one yield force and gain: theory, and a run. Speeds are NaN without a cycle."""

    Fy: float  # [N]
    K: float  # gain of the compensator
    expected: PushClass  # by theory
    predicted: float  # V of the limit cycle by the describing function [m/s]
    exact: float  # largest velocity of the limit cycle [m/s]
    simulated: PushClass  # by a run
    speed: float  # largest velocity of the cycle in that run [m/s]


@dataclass(frozen=True, repr=False)
class YieldMap(Result):
    """Outcome of a push over yield force and gain.

    Motions of the loop scale with Fy: lines over the gain hold for a yield force of 1 N.
    """

    drawn_by = "hapticclay.views.stability_map_plots:yield_map_plot"
    written_as = "gain-yield"

    loop: PushedLoop  # the fixed parts, with the push and the damping b of the clay
    least: float  # gain below which every push ends stuck: there is no limit cycle
    limit: float  # gain from which a push that does not stick grows
    K: tuple[float, ...]  # of the lines, ascending, from least on
    critical: tuple[float, ...]  # least velocity of a push that does not stick [m/s per N]
    speed: tuple[float, ...]  # largest of the limit cycle [m/s per N]; NaN at and above `limit`
    cells: tuple[YieldCell, ...]  # at which theory and a run are compared

    def tables(self) -> dict[str, dict[str, Any]]:
        """Returns the numbers of the figure: cells, and lines over the gain."""
        head = (
            "Fy [N]",
            "K [1/kg]",
            "expected",
            "predicted speed [m/s]",
            "exact speed [m/s]",
            "run",
            "speed of the run [m/s]",
        )
        lines = {
            "K [1/kg]": self.K,
            "push that just sticks [m/s per N]": self.critical,
            "speed of the cycle [m/s per N]": self.speed,
        }
        return {"cells": table_of(head, self.cells), "lines": lines}

    def headline(self) -> str:
        """The number of runs that differ from theory."""
        wrong = sum(c.simulated != c.expected for c in self.cells)
        return f"{wrong} of {len(self.cells)} runs end otherwise than theory says"

    def text(self, form: str = "") -> str:
        """How the runs compare with theory."""
        gaps = [abs(c.speed / c.exact - 1.0) for c in self.cells if c.exact > 0.0 and c.speed > 0.0]
        lines = [self.headline()]
        if gaps:
            share = f"within {100.0 * max(gaps):.2g} % of the exact"
            lines.append(f"largest speed of the cycles: {share}")
        if wrong := [c for c in self.cells if c.simulated != c.expected]:
            rows = [(c.Fy, c.K, c.expected, c.simulated) for c in wrong]
            lines.append(text_table(table_of(("Fy [N]", "K", "theory", "run"), rows), form=form))
        return "\n".join(lines)


def yielding_run(loop: PushedLoop, flow: Flow, t_max: float) -> Scenario:
    """The scenario of a pushed loop in yielding clay, not its own, with unlimited motors."""
    scenario = replace(loop, torque_limit=NO_LIMITS).scenario(t_max, stop_when_unstable=False)
    return replace(scenario, clay=slab(flow))


def measured_cycle(record: Record, axis: str) -> MeasuredCycle | None:
    """The oscillation in the last half of a run; None if it rests or completes no period."""
    i = AXES.index(choice("axis", axis, AXES))
    last = record.t >= 0.5 * record.t[-1]
    t, v, p = record.t[last], record.v[last, i], record.p[last, i]
    up = np.flatnonzero((v[:-1] < 0.0) & (v[1:] >= 0.0))
    if len(up) < 4:
        return None
    passed = t[up] - v[up] * (t[up + 1] - t[up]) / (v[up + 1] - v[up])
    omega = 2.0 * math.pi * (len(passed) - 1) / (passed[-1] - passed[0])
    whole = slice(up[0] + 1, up[-1] + 1)
    wave = v[whole] * np.exp(-1j * omega * t[whole])
    middle = up[len(up) // 2]
    early, late = np.max(np.abs(v[:middle])), np.max(np.abs(v[middle:]))
    return MeasuredCycle(
        speed=float(np.max(np.abs(v[whole]))),
        fundamental=float(2.0 * abs(np.mean(wave))),
        amplitude=float(0.5 * np.ptp(p[whole])),
        omega=float(omega),
        change=float(late / early - 1.0),
    )


def classify_push(loop: PushedLoop, flow: Flow) -> tuple[PushClass, float]:
    """Outcome of a push in a run, and its limit cycle's largest velocity [m/s], NaN for none."""
    cycle = None
    for t_max in RUN_SPANS:
        record = simulate(yielding_run(loop, flow, t_max))
        if record.t[-1] < t_max - 2.0 * record.scenario.dt:  # the arm is folded, or the run failed
            return "grows", math.nan
        cycle = measured_cycle(record, loop.axis)
        if cycle is None:
            return "sticks", math.nan
        if abs(cycle.change) < SETTLED:
            return "limit cycle", cycle.speed
    assert cycle is not None
    return ("grows" if cycle.change > 0.0 else "limit cycle"), cycle.speed


def yield_map(
    loop: PushedLoop, quick: bool = False, progress: Callable[[Iterable], Iterable] = iter
) -> YieldMap:
    """The map for Bingham clay of the loop's b: continuous time, no delay, unlimited motors."""
    loop = replace(loop, **TIMING, push=LARGE_PUSH)
    linear, unit = loop.linear, Flow(Fy=1.0, b=loop.b)
    lines, rows, columns = (6, 4, 4) if quick else (12, 6, 7)
    limit = gain_limit(linear)  # inf in clay without damping, which has no damping once it flows

    def rests(K: float) -> bool:
        return math.isnan(_stable_speed(replace(linear, K=K), unit))

    end = min(limit, GAINS[1])
    some = np.geomspace(min(GAINS[0], 0.1 * end), 0.99 * end, 30).tolist() if end else []
    _, least = first_failure(rests, some, rtol=0.01) if some else (0.0, 0.0)
    if not 0.0 < least < end:
        raise ParameterError("map", "gain-yield", "no gain gives a limit cycle here")
    top = 1.5 * limit if limit < math.inf else 6.0 * least
    K = np.geomspace(least, min(0.995 * limit, top), lines).tolist()
    K += np.linspace(1.005 * limit, top, lines // 3).tolist() if limit < top else []
    tried = np.geomspace(0.8 * least, 0.95 * top, rows).tolist()
    cells, critical, speed = [], [], []
    for i, gain in enumerate(progress([*K, *tried])):
        at = replace(linear, K=gain)
        push, peak = critical_push(at, flow=unit), _stable_speed(at, unit)
        if i < len(K):
            critical.append(push)
            speed.append(peak)
            continue
        for Fy in np.geomspace(*YIELD_FORCES, columns).tolist():
            flow = replace(unit, Fy=Fy)
            expected: PushClass = "sticks"
            if loop.push >= Fy * push:
                expected = "grows" if push_outcomes(at, flow=flow)[1] == "grows" else "limit cycle"
            predicted = exact = math.nan
            if expected == "limit cycle":
                kept = [x.speed for x in limit_cycles(at, flow=flow) if x.kind == expected]
                predicted, exact = kept[-1] if kept else math.nan, Fy * peak
            found = classify_push(replace(loop, K=gain), flow)
            cells.append(YieldCell(Fy, gain, expected, predicted, exact, *found))
    return YieldMap(loop, least, limit, tuple(K), tuple(critical), tuple(speed), tuple(cells))


def _stable_speed(loop: Loop, flow: Flow) -> float:
    """Largest velocity of the exact limit cycle [m/s]; NaN for none."""
    return max((x.speed for x in exact_cycles(loop, flow=flow) if x.stable), default=math.nan)
