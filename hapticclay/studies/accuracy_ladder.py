"""Error against run time of one scenario over a ladder of steps, to find the cheapest setting.

The reference is a run of the same scenario at a far finer step. Its own error is estimated as for a
run to a requested error.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..display import fields_of, table_of
from ..errors import ParameterError
from ..results import Result, figure_of
from ..scene.scenario import Scenario
from ..simulation.asked_error import METHODS, choices
from ..simulation.engines import engine_for
from ..simulation.record import Record
from ..simulation.simulate import simulate
from ..simulation.step_comparison import ROUNDING_LEFT, Trace, compare_positions, compare_times

TOP = 0.02  # [s] longest step; the others are halves of halves of it
RUNGS, QUICK_RUNGS = 9, 6  # steps of the fast integrator, down to 0.08 ms, 0.6 ms
ACCURATE_FROM = 2  # halvings at which the accurate integrator begins: 5 ms
SAMPLED_RUNGS = 7  # of Ts = dt, in Python: down to 0.3 ms
HELD_RUNGS = 3  # of a scenario that is sampled: Ts, Ts/2, Ts/4
FINER = 4  # steps of the reference in one of the finest rung
SAMPLES_APART = 5e-4  # [s] at least, of the samples at which positions are compared
SHARP = 1e-10  # [s] the reference is run by the integrator that is cheaper for so small an error
BRIEF, REPEATS = 0.3, 3  # [s] runs that take less are timed so often; the median counts
CLEAR = 3.0  # an error so many times that of the reference is one of the setting
ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)  # [s], [m] cheapest settings are named for
SAMPLED = "sampled, Ts = dt"
CHEAPEST = {  # tables of the fastest settings, by unit of the error
    "s": "Cheapest setting by error in the times of the border crossings",
    "m": "Cheapest setting by error in the position",
}


@dataclass(frozen=True)
class Setting:
    """One setting of the scenario, with its errors and cost.

    Attributes:
        series: "fast", "accurate", or SAMPLED, which is a different system from the continuous one.
        dt: step [s].
        time: largest error of the crossing times [s]; None if no border or other borders are
            crossed.
        position: largest error of the position [m]; None if the run ends with another status.
        wall: run time [s], a median.
        status: how the run ended, or why there is none.
    """

    series: str
    dt: float
    time: float | None
    position: float | None
    wall: float | None
    status: str

    def error(self, unit: str) -> float | None:
        """Error of the setting."""
        return self.time if unit == "s" else self.position


@dataclass(frozen=True, repr=False)
class Ladder(Result):
    """Errors of one scenario at many settings.

    Attributes:
        scenario: what was run.
        engine: "native" or "python".
        settings: all, series by series, from the longest step on.
        reference: description of the reference run.
        left: estimated error of the reference, by unit; None if no bound is known.
        simulated: simulated time of the reference [s].
        notes: remarks for the reader.
    """

    drawn_by = "hapticclay.views.accuracy_plots:accuracy_plot"
    written_as = "accuracy"
    printed = dict.fromkeys(CHEAPEST.values(), ())
    formats = {
        "requested error [s]": ".0e",
        "requested error [m]": ".0e",
        "error of border times [s]": ".1e",
        "error of position [m]": ".1e",
        "dt [s]": ".3g",
        "run time [s]": ".2g",
    }
    summary_units = {"dt": "s", "time": "s", "position": "m", "wall": "s", "simulated_time": "s"}

    scenario: Scenario
    engine: str
    settings: tuple[Setting, ...]
    reference: str
    left: dict[str, float | None]
    simulated: float
    notes: tuple[str, ...] = ()

    def units(self) -> list[str]:
        """Units in which there are errors, of "s" and "m"."""
        return [u for u in ("s", "m") if any(x.error(u) is not None for x in self.settings)]

    def least(self, unit: str) -> float:
        """The least error that clearly exceeds that of the reference."""
        return CLEAR * (self.left[unit] or 0.0)

    def shown(self, setting: Setting, unit: str) -> float | None:
        """The error of a setting if it clearly exceeds that of the reference; else None."""
        error = setting.error(unit)
        return error if error and error >= self.least(unit) else None

    def cheapest(self, unit: str) -> dict[float, Setting]:
        """The fastest setting by requested error; sampled control replaces no continuous one."""
        bounds = {
            x: max(error, self.least(unit))
            for x in self.settings
            if x.series != SAMPLED and x.wall is not None and (error := x.error(unit)) is not None
        }
        fit = {asked: [x for x, e in bounds.items() if e <= asked] for asked in ASKED}
        return {e: min(xs, key=lambda x: x.wall or math.inf) for e, xs in fit.items() if xs}

    def tables(self) -> dict[str, dict[str, list]]:
        """Errors and run time of each setting; the fastest setting for each requested error."""
        head = (
            "method",
            "dt [s]",
            "error of border times [s]",
            "error of position [m]",
            "run time [s]",
            "status",
        )
        tables = {"settings": table_of(head, self.settings)}
        for u in self.units():
            head = f"requested error [{u}]", "integrator", "dt [s]", f"error [{u}]", "run time [s]"
            tables[CHEAPEST[u]] = table_of(
                head,
                [
                    (asked, x.series, x.dt, self.error_text(x, u), x.wall)
                    for asked, x in self.cheapest(u).items()
                ],
            )
        return tables

    def error_text(self, setting: Setting, unit: str) -> str:
        """The error of a setting; "<" where it does not clearly exceed that of the reference."""
        error = self.shown(setting, unit)
        return f"{error:.1e}" if error else f"< {self.least(unit):.1e}"

    def remarks(self) -> list[str]:
        """The reference, its error, and notes."""
        left = [f"{e:.1e} {u}" for u, e in self.left.items() if e and u in self.units()]
        within = f", good to {' and '.join(left)}" if left else ""
        return [f"Errors are against the {self.reference}{within}.", *self.notes]

    def headline(self) -> str:
        """Settings and their reference, in one line."""
        return f"{len(self.settings)} settings of {self.scenario.name}: {self.remarks()[0]}"

    def figures(self) -> dict[str, Any]:
        """Error over run time."""
        shown = {"settings": self.tables()["settings"]}
        return {"accuracy": figure_of(self, tables=shown)}

    def contents(self) -> dict[str, Any]:
        """Everything."""
        cheapest = {
            unit: [{"asked": e, **fields_of(x)} for e, x in self.cheapest(unit).items()]
            for unit in self.units()
        }
        more = {"reference_error": self.left, "simulated_time": self.simulated}
        return fields_of(self, "left", "simulated") | more | {"cheapest": cheapest}


def accuracy_ladder(
    scenario: Scenario, quick: bool = False, progress: Callable[[Iterable], Iterable] = iter
) -> Ladder:
    """Runs a scenario at a ladder of steps, with both integrators.

    A continuous scenario also runs under sampled control with Ts = dt. A sampled scenario keeps its
    Ts, and its steps divide Ts.
    """
    if scenario.control == "sampled":
        scenario = dataclasses.replace(scenario, Ts=scenario.Ts or scenario.dt)
    top = _top(scenario)
    rungs = _rungs(scenario, top, quick)
    grid = top / 2.0 ** max(0, math.floor(math.log2(top / SAMPLES_APART)))
    finest = min(s.dt for _, s in rungs if s.integrator == "fast") / FINER
    best = dataclasses.replace(scenario, dt=finest)
    if choices(scenario, SHARP, "s")[0][0] == "accurate":
        best = dataclasses.replace(scenario, dt=FINER * finest / 2.0, integrator="accurate")
    timed = 1 if quick else REPEATS
    jobs = iter(progress([("reference", best), *rungs]))
    exact = _reference(next(jobs)[1], grid)
    return Ladder(
        scenario,
        engine_for("auto"),
        tuple(_setting(series, s, exact, grid, timed) for series, s in jobs),
        f"{best.integrator} integrator at dt = {best.dt:.3g} s",
        exact.left,
        float(exact.record.t[-1]),
        exact.notes,
    )


def _top(scenario: Scenario) -> float:
    """The longest step [s]: TOP, or a part of Ts."""
    if scenario.control == "continuous":
        return TOP
    Ts = scenario.Ts or scenario.dt
    least = 1e-6 * FINER * 2 ** (HELD_RUNGS - 1)  # 1e-6 s is the smallest step there is
    if Ts < least:
        raise ParameterError(
            "Ts", Ts, f"must be at least {least:g} s, so that several steps divide it"
        )
    return Ts / math.ceil(Ts / TOP - 1e-9)


def _rungs(scenario: Scenario, top: float, quick: bool) -> list[tuple[str, Scenario]]:
    """Series and scenario of each run."""
    if scenario.control == "sampled":
        return [("fast", dataclasses.replace(scenario, dt=top / 2**k)) for k in range(HELD_RUNGS)]
    n = QUICK_RUNGS if quick else RUNGS
    out = [
        (name, dataclasses.replace(scenario, dt=top / 2**k, integrator=name))
        for name, first in (("fast", 0), ("accurate", ACCURATE_FROM))
        for k in range(first, n)
    ]
    held = dataclasses.replace(scenario, control="sampled", Ts=None, integrator="fast")
    for k in range(min(n, SAMPLED_RUNGS)):
        out.append((SAMPLED, dataclasses.replace(held, dt=top / 2**k)))
    return out


class Reference(NamedTuple):
    """The reference run and its error.

    Attributes:
        record: of the finest run.
        left: its own error, by unit; None if no bound is known.
        notes: on that error.
    """

    record: Record
    left: dict[str, float | None]
    notes: tuple[str, ...]


def _reference(s: Scenario, grid: float) -> Reference:
    """The run at the finest step, and its error by runs at two and four times that step."""
    records = [_run(dataclasses.replace(s, dt=k * s.dt), grid) for k in (4, 2, 1)]
    three = [Trace(r.scenario.dt, r.outcome.code, r.crossings, r.t, r.p) for r in records]
    order = METHODS[s.integrator].order
    time, place = compare_times(*three, order=order), compare_positions(*three, order=order)
    # that of positions is of the coarsest of the three
    away = place.estimate and max(place.estimate / 4.0**order, ROUNDING_LEFT)
    asked = (time, place) if records[-1].crossings else (place,)
    notes = tuple(dict.fromkeys(x.note for x in asked if x.estimate is None))
    return Reference(records[-1], {"s": time.estimate, "m": away}, notes)


def _run(s: Scenario, grid: float) -> Record:
    """A run that keeps samples at multiples of grid [s], or all if they are further apart."""
    engine = engine_for("auto")
    return simulate(s, every=max(1, round(grid / s.dt)), engine=engine)


def _setting(series: str, s: Scenario, exact: Reference, grid: float, timed: int) -> Setting:
    """The run of a setting, its errors and its time."""
    try:
        r = _run(s, grid)
    except ParameterError as refusal:  # an explicit method in clay too stiff for it
        return Setting(series, s.dt, None, None, None, refusal.bound)
    walls = [r.wall_time]
    while len(walls) < timed and r.wall_time < BRIEF:
        walls.append(_run(s, grid).wall_time)
    wall = statistics.median(walls)
    best = exact.record
    time = position = None
    if r.outcome.code == best.outcome.code:
        pairs = list(zip(r.crossings, best.crossings, strict=False))
        same = len(r.crossings) == len(best.crossings) > 0
        if same and all((a.axis, a.border) == (b.axis, b.border) for a, b in pairs):
            time = max(abs(a.time - b.time) for a, b in pairs)
        index = np.rint(r.t / grid).astype(int)
        there = np.flatnonzero(index < len(best.t))
        there = there[np.abs(best.t[index[there]] - r.t[there]) <= 1e-9 * grid]
        away = np.linalg.norm(r.p[there] - best.p[index[there]], axis=1)
        position = float(away.max(initial=0.0))
    return Setting(series, s.dt, time, position, wall, r.status)
