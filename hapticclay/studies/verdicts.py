"""Whether runs of a loop or a wall are unstable.

The verdict on a linear loop is that of the map of small motions over one period, which the steps of
a run give. Where there is none, or where a push is given, a run is made and judged by its samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..model.constants import AXES
from ..scene.scenario import Scenario
from ..simulation.batch import simulate_batch
from ..simulation.period_map import PeriodMaps
from . import boundary, growth
from .wall import Wall

LEAST_OF_MAP = 1e-3  # [1/s] slower growth or decay of a map of a loop is left undecided
LEAST_MAP_CHANGE = 1e-3  # so is a smaller change over a wall's run: a kick changes 3e-4 of it
ENDED = ("limit cycle", "saturated")  # runs that the motors bound: a small push has grown to that
LOST = ("diverged", "out of reach", "singular")  # runs that nothing bounds
SPAN_STEPS = 200.0  # of a repeated run, at least
WALL_SPANS = (1.0, 4.0)  # of a wall's run, then of the one that repeats it
LEAST_RUN_CHANGE = 0.01  # a wall's run with a smaller relative change is repeated
WALL_BATCH = 100  # walls per batch, limited by the memory for their samples
NOT_RUN = -1  # in place of 0, stable, and 1, unstable


class Case(NamedTuple):
    """A run to judge: a wall, or an arm in clay."""

    wall: Wall
    scenario: Scenario  # a trial may change more of it than the wall


Cases = dict[int, Case]  # by index
Rates = dict[int, float]  # growth rates by index [1/s], NaN where the verdict is open


class Reading(NamedTuple):
    """How the growth of runs is read."""

    # rates below which a mode does not count, and below which growth is left open [1/s]
    scale: Callable[[Case], tuple[float, float]]
    short: Callable[[Cases, int | None], Rates]
    long: Callable[[Cases, int | None], Rates]  # none of them open


def judge(
    cases: Cases, n: int, pushed: bool, threads: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Whether each of n runs is unstable (1, 0, or NOT_RUN), and whether it took a longer run.

    A run is unstable if its oscillation grows, by the map of a period or, where a scene has no map
    or is pushed, by a short run; a longer run decides what is left open. A run that ends early, or
    saturates the motors after so small a push, is unstable.
    """
    reading = WALLS if any(x.wall.read_by_samples for x in cases.values()) else ARMS
    rate = {} if pushed else mapped_rates(cases, reading)
    if left := {i: x for i, x in cases.items() if i not in rate}:
        rate |= reading.short(left, threads)
    if again := {i: cases[i] for i, x in rate.items() if math.isnan(x)}:
        rate |= reading.long(again, threads)
    unstable, repeated = np.full(n, NOT_RUN), np.zeros(n, dtype=bool)
    unstable[[*rate]] = np.array([*rate.values()]) > 0.0
    repeated[[*again]] = True
    return unstable, repeated


def mapped_rates(cases: Cases, reading: Reading) -> Rates:
    """Growth rates of those cases that have a map."""
    maps, rate = PeriodMaps(), {}
    for i, case in cases.items():
        m = maps.of(case.scenario, AXES.index(case.wall.axis))
        if m is not None:
            slowest, least = reading.scale(case)
            found = growth.growth_of_map(m, slowest)
            rate[i] = found if abs(found) >= least else math.nan
    return rate


def lasting(s: Scenario, steps: float) -> Scenario:
    """The scenario with a length of so many steps."""
    return replace(s, t_max=steps * s.dt)


# ---- loops ---------------------------------------------------------------------------------------


def arm_scale(case: Case) -> tuple[float, float]:  # noqa: ARG001
    """Reading.scale of a loop."""
    return growth.SLOWEST_MODE, LEAST_OF_MAP


def short_arms(cases: Cases, threads: int | None) -> Rates:
    """Growth rates of loops from a few samples."""
    # Odd, so that half the sampling frequency is not aliased onto zero.
    steps = {i: 2 * round(0.5 * growth.GROWTH_SAMPLE / x.scenario.dt) + 1 for i, x in cases.items()}
    rate = {}
    for every in sorted(set(steps.values())):
        some = {i: x for i, x in cases.items() if steps[i] == every}
        rate |= zip(some, _short_arms([*some.values()], every, threads), strict=True)
    return rate


def _short_arms(cases: list[Case], every: int, threads: int | None) -> list[float]:
    """The rates of loops, from one step in `every`."""
    n = growth.MOTION_SAMPLES
    jobs = [lasting(x.scenario, (n + 0.5) * every) for x in cases]
    rate, v = np.full(len(cases), math.inf), np.full((len(cases), n), np.nan)
    records = simulate_batch(jobs, threads=threads, every=every)
    for k, (case, record) in enumerate(zip(cases, records, strict=True)):
        if len(record.v) > n:  # else it ended before its time
            v[k] = record.v[1 : n + 1, AXES.index(case.wall.axis)]
    whole, dt = np.isfinite(v).all(axis=1), np.array([job.dt for job in jobs])
    for step in np.unique(dt[whole]).tolist():
        at = whole & (dt == step)
        rate[at] = growth.short_growth(v[at], every * step)
    return rate.tolist()


def long_arms(cases: Cases, threads: int | None) -> Rates:
    """Growth rates of loops from longer runs."""
    made = [x.scenario for x in cases.values()]
    jobs = [lasting(s, max(boundary.GROWTH_SPAN / s.dt, SPAN_STEPS)) for s in made]
    records = simulate_batch(jobs, threads=threads)
    return {
        i: math.inf if x.outcome.code in ENDED else growth.growth_rate(x, case.wall.axis)
        for (i, case), x in zip(cases.items(), records, strict=True)
    }


# ---- walls ---------------------------------------------------------------------------------------


def wall_scale(case: Case) -> tuple[float, float]:
    """Reading.scale of a wall."""
    n, _, slowest = case.wall.growth_reading()
    return slowest, LEAST_MAP_CHANGE / (n * case.wall.subject.Ts)


def short_walls(cases: Cases, threads: int | None) -> Rates:
    """Growth rates of walls from a run each."""
    rate, span = long_walls(cases, threads, WALL_SPANS[0]), {}
    for i, x in cases.items():
        n, *_ = x.wall.growth_reading(WALL_SPANS[0])
        span[i] = n * x.wall.subject.Ts
    return {i: x if abs(x) * span[i] >= LEAST_RUN_CHANGE else math.nan for i, x in rate.items()}


def long_walls(cases: Cases, threads: int | None, span: float = WALL_SPANS[1]) -> Rates:
    """Growth rates of walls from longer runs."""
    # walls with as many steps per sample run together: their records keep one step per sample
    steps = {i: round(x.wall.subject.Ts / x.scenario.dt) for i, x in cases.items()}
    rate = {}
    for every in sorted(set(steps.values())):
        members = [i for i in cases if steps[i] == every]
        for first in range(0, len(members), WALL_BATCH):
            some = [(i, cases[i]) for i in members[first : first + WALL_BATCH]]
            read = [x.wall.growth_reading(span) for _, x in some]
            jobs = [
                replace(x.scenario, t_max=n * x.wall.subject.Ts)
                for (_, x), (n, *_) in zip(some, read, strict=True)
            ]
            records = simulate_batch(jobs, threads=threads, every=every)
            for (i, _), (_, sample, slowest), record in zip(some, read, records, strict=True):
                lost = record.outcome.code in (*ENDED, *LOST)
                rate[i] = math.inf if lost else growth.growth_of_run(record, sample, slowest)
    return rate


ARMS = Reading(arm_scale, short_arms, long_arms)
WALLS = Reading(wall_scale, short_walls, long_walls)
