"""Runs to a requested error: choose integrator and step, run, verify at other steps, refine.

Each choice is run at steps 4h, 2h and h. Their differences give the error (Richardson): that of the
border times at h, or that of the positions at 4h. Only runs with a requested error load this.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from ..errors import ParameterError, number
from ..kernel import native
from ..kernel.pace import STABLE_STEP, check_explicit, fastest_rate
from ..scene.scenario import Scenario
from ..units import from_unit
from .accuracy import Accuracy
from .columns import ARRAYS
from .one_run import run_once
from .record import Record
from .run import Progress
from .step_comparison import Comparison, Trace, compare_positions, compare_times, hides_events

UNITS = ("s", "m")
ROUNDING = 1e-11  # [s], [m] finest error that can be requested; runs keep some 1e-12 at best
SMALLEST = 1e-6  # [s] shortest step, the lower bound of Scenario.dt
LARGEST = 1e-3  # [s] finest step of three; RATIO times as long, poles of 30 1/s are still resolved
RATIO = 4  # coarsest step of a comparison over the finest
ROUNDS = 9  # comparisons at most, each at a step at least two times finer
MARGIN = 0.75  # share of the requested error to keep: in 2 %, estimates are low by this much
DOUBTS = 4  # comparisons that may fail to confirm the order before a plain bound is taken
INTERRUPTED = Comparison(None, None, False, "interrupted", True)
LEAST_SAMPLES = 2000  # of a run to t_max at which positions are compared, however few are kept


class IntegratorFacts(NamedTuple):
    """What is known of an integrator before any run."""

    order: int  # of its error in the step
    constants: dict[str, float]  # error over step to the power of the order, by unit
    cost: float  # run time of a step, over that of the fast integrator


# Medians over 120 cuts and hits like those of tests/simulation/test_accuracy.py, against their
# exact solutions; run times compiled: at equal steps 1.0 to 1.1 in the three cuts of the benchmarks
# and more in yielding clay. A scene may have 100 times the error, and is then refined.
METHODS = {
    "fast": IntegratorFacts(2, {"s": 0.35, "m": 0.5}, 1.0),
    "accurate": IntegratorFacts(4, {"s": 50.0, "m": 100.0}, 1.5),
}


def parse_error(error: object) -> tuple[float, str]:
    """Parses a requested error."""
    if not isinstance(error, str):
        return number("error", error, ROUNDING, 1.0, unit="s"), "s"
    for unit in UNITS:
        try:
            given = from_unit(error, unit)
            value = float(error) if given is None else given
        except ValueError:
            continue
        return number("error", value, ROUNDING, 1.0, unit=unit), unit
    bound = "must be a number of seconds, or of metres with its unit, such as '1e-7 m' or '0.1 um'"
    raise ParameterError("error", error, bound)


def simulate_within(
    scenario: Scenario,
    error: float | str,
    *,
    every: int = 1,
    progress: Progress | None = None,
    engine: str = "auto",
) -> Record:
    """Runs a scenario with the integrator and the step that keep a requested error."""
    asked, unit = parse_error(error)
    if not scenario.is_closed_form:
        bound = "must be None with an arm from a file: compare a run with one at half its dt"
        raise ParameterError("error", error, bound)
    if unit == "s" and not _has_border(scenario):
        bound = "must be in m, as in '1e-6 m': this scene has no border whose crossing has a time"
        raise ParameterError("error", error, bound)
    if scenario.control == "sampled":
        scenario = dataclasses.replace(scenario, Ts=scenario.Ts or scenario.dt)
    trial = Trial(scenario, unit, every, engine, progress)
    *others, last = choices(scenario, asked, unit)
    integrator, dt = next((x for x in others if _is_taken(scenario, *x)), last)
    trial.scenario = dataclasses.replace(scenario, integrator=integrator)
    record, found = trial.compare(dt)
    order, most, doubts = METHODS[trial.scenario.integrator].order, MARGIN * asked, 0
    for rounds in range(1, ROUNDS + 1):
        doubts += not found.confirmed
        # an order not observed at so many steps will not appear; the estimate then is a bound
        sure = found.confirmed or doubts > DOUBTS
        if found.final or (sure and found.estimate is not None and found.estimate <= most):
            break
        finer = _finer(dt, found, most, order)
        if rounds == ROUNDS or finer < SMALLEST:
            limit = f"{ROUNDS} steps were tried" if rounds == ROUNDS else "no step is smaller"
            found = found._replace(note=found.note or limit)
            break
        try:
            dt = finer
            record, found = trial.compare(dt)
        except ParameterError as refusal:  # memory is short: keep the results so far
            found = found._replace(note=f"the next step was refused, {refusal}")
            break
    if found.finest is not None and found.estimate is not None and found.estimate > asked:
        record, found = trial.finest(dt, found)  # no finer step is left to compare with
    reached = found.estimate is not None and found.estimate <= asked
    accuracy = Accuracy(
        asked=asked,
        unit=unit,
        estimate=found.estimate,
        reached=reached,
        integrator=integrator,
        dt=record.scenario.dt,
        order=found.order,
        runs=trial.runs,
        wall_time=trial.wall,
        note="" if reached else found.note,
    )
    return dataclasses.replace(record, error=accuracy)


def _has_border(scenario: Scenario) -> bool:
    clay = scenario.clay
    return scenario.length is not None or (clay is not None and any(clay.edges))


def _finer(dt: float, found: Comparison, most: float, order: int) -> float:
    """The next step: its predicted error is the largest allowed one."""
    halvings = 2
    if found.estimate is not None:
        wanted = math.ceil(math.log2(max(found.estimate / most, 1.0)) / order)
        halvings = min(max(wanted, 1), 5 if found.confirmed else 2)
    possible = math.floor(math.log2(dt / SMALLEST))
    return dt / 2.0 ** max(min(halvings, possible), 1)


def choices(scenario: Scenario, asked: float, unit: str) -> list[tuple[str, float]]:
    """Integrators for a requested error, cheapest by METHODS first, and steps of a finest run."""
    steps = {}
    for name, method in METHODS.items():
        wanted = (MARGIN * asked / method.constants[unit]) ** (1.0 / method.order)
        wanted /= 1 if unit == "s" else RATIO
        steps[name] = min(max(wanted, SMALLEST), LARGEST)
    if scenario.control == "sampled":
        return [("fast", _divided(scenario.Ts or scenario.dt, steps["fast"]))]
    fast = "fast", steps["fast"]
    if not native.is_there():  # the accurate method is too slow in Python
        return [fast]
    # beyond, the explicit method divides its steps, and other steps are no other runs
    steps["accurate"] = min(
        steps["accurate"], STABLE_STEP / max(fastest_rate(scenario), STABLE_STEP) / RATIO
    )
    cost = {name: METHODS[name].cost / step for name, step in steps.items()}
    if steps["accurate"] < SMALLEST or cost["fast"] <= cost["accurate"]:
        return [fast]
    return [("accurate", steps["accurate"]), fast]


def _is_taken(scenario: Scenario, integrator: str, dt: float) -> bool:
    """Whether an integrator accepts a scene at the coarsest step of a comparison."""
    try:
        s = dataclasses.replace(scenario, integrator=integrator, dt=RATIO * dt)
        if integrator == "accurate":
            check_explicit(s)
    except ParameterError as refusal:
        if refusal.field == "integrator":
            return False
        raise
    return True


def _divided(Ts: float, dt: float) -> float:
    """The largest part of Ts that is at most dt and whose RATIO-fold divides Ts too."""
    most = math.ceil(Ts / (RATIO * LARGEST) - 1e-9)
    n = RATIO * most
    while Ts / n > dt and Ts / (2 * n) >= SMALLEST:
        n *= 2
    if Ts / n < SMALLEST:
        bound = f"must be at least {RATIO * SMALLEST:g} s if an error is requested"
        raise ParameterError("Ts", Ts, bound)
    return Ts / n


@dataclasses.dataclass
class Trial:
    """Runs of one scenario at several steps, and their comparison; arguments as in simulate."""

    scenario: Scenario
    unit: str  # of the error, "s" or "m"
    every: int
    engine: str
    progress: Progress | None
    runs: int = 0
    wall: float = 0.0  # total run time [s]
    traces: dict[float, Trace] = dataclasses.field(default_factory=dict)  # by step

    def compare(self, dt: float) -> tuple[Record, Comparison]:
        """Runs at 4 dt, 2 dt and dt, unless done already, and compares."""
        traces: dict[float, Trace] = {}
        kept = dt if self.unit == "s" else RATIO * dt
        record = None
        for step in (RATIO * dt, RATIO // 2 * dt, dt):
            if step in self.traces:
                traces[step] = self.traces[step]
                continue
            r = self._run(step, kept)
            if r.outcome.code == "interrupted":
                return r, INTERRUPTED
            record = r if step == kept else record
            traces[step] = Trace(step, r.outcome.code, r.crossings, r.t, r.p)
        assert record is not None
        self.traces = traces if self.unit == "s" else {}  # whose samples are those of one record
        order = METHODS[record.scenario.integrator].order
        if self.unit == "s":
            return record, compare_times(*traces.values(), order=order)
        compared = compare_positions(*traces.values(), order=order)
        # a decay that no step resolves leaves its error in one sample, where it may not show
        if fastest_rate(self.scenario) * dt > STABLE_STEP and hides_events(*traces.values()):
            compared = compared._replace(confirmed=False)
        return self._thinned(record), compared

    def finest(self, dt: float, found: Comparison) -> tuple[Record, Comparison]:
        """The record of the finest run, in place of the coarsest."""
        r = self._run(dt, dt)
        if r.outcome.code == "interrupted":
            return r, INTERRUPTED
        return self._thinned(r), found._replace(estimate=found.finest)

    def _run(self, dt: float, kept: float) -> Record:
        """The run at a step; the one at step `kept` is the record."""
        if self.unit == "m":
            every = self._compared(kept) * round(kept / dt)
        else:
            every = self.every if dt == kept else 1_000_000  # only crossings are compared
        scenario = dataclasses.replace(self.scenario, dt=dt)
        r = run_once(scenario, every, self.engine, self.progress)
        self.runs, self.wall = self.runs + 1, self.wall + r.wall_time
        return r

    def _compared(self, dt: float) -> int:
        """Samples kept where positions are compared: a divisor of every, enough to see peaks."""
        most = min(max(1, int(self.scenario.t_max / dt / LEAST_SAMPLES)), 1_000_000 // RATIO)
        return next(k for k in range(min(most, self.every), 0, -1) if self.every % k == 0)

    def _thinned(self, r: Record) -> Record:
        """The record with the requested samples."""
        ratio = self.every // self._compared(r.scenario.dt) if self.unit == "m" else 1
        if ratio == 1:
            return r
        last = len(r.t) - 1
        keep = np.unique(np.append(np.arange(0, last + 1, ratio), last))
        return dataclasses.replace(r, **{name: getattr(r, name)[keep] for name in ARRAYS})
