"""Runs over a space of parameters, as a data set that survives interruptions."""

from __future__ import annotations

import dataclasses
import math
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import checked, part
from ..errors import Bound, ParameterError, choice, integer
from ..fields import join_names
from ..files import MOST_SETTINGS, parse_toml, read_text
from ..scene.earlier_names import with_present_names
from ..scene.experiments import EXPERIMENTS, parameter_unit
from ..scene.files import read_settings
from ..scene.scenario import Scenario
from ..simulation.simulate import simulate
from . import store, store_runs
from .sampling import MOST_RUNS, Range, grid_columns, unit_samples
from .sweep_rows import result_row

SWEEP_SCHEMA = "hapticclay-sweep-2"
PROBES = 20  # runs used for an estimate ...
PROBE_TIME = 5.0  # ... or fewer after this time [s]


@part()
class Sweep(store.Plan):
    """Runs of one experiment, or of a scenario file, over a space of its numbers.

    A number is a parameter of the experiment, as on the command line, or any field of the scenario
    by dotted name: "servo.x.G.damping", "gain.x", "compensator.den.1". A pair
    without axis gets the value on both axes. "operator.mass" adds an arm at the handle.

    Attributes:
        experiment: a name in EXPERIMENTS; not used with a scenario.
        vary: ranges by name.
        fixed: values by name, the same in all runs.
        design: "grid" (all combinations, the last parameter fastest), "lhs" (Latin hypercube) or
            "sobol".
        runs: number of runs of "lhs" and "sobol"; None for "grid".
        seed: seed of both.
        chunk: runs per file, 1 to 100,000; None for as many as a process makes in 1.5 s, or in 5 %
            of the time spent so far.
        scenario: plain data of a scenario file, from `read_settings`; empty for the experiment.
    """

    experiment: str
    vary: dict[str, Range]
    fixed: dict[str, Any] = dataclasses.field(default_factory=dict)
    design: Literal["grid", "lhs", "sobol"] = "grid"
    runs: Annotated[int | None, Bound(1, MOST_RUNS)] = None
    seed: Annotated[int, Bound(0, 2**32 - 1)] = 0
    chunk: Annotated[int | None, Bound(1, 100_000)] = None
    scenario: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        choice("experiment", self.experiment, tuple(EXPERIMENTS))
        if not self.vary:
            raise ParameterError("grid", "", "must vary a parameter, as in b=1:1000:50log")
        for name in self.vary.keys() & self.fixed.keys():
            bound = "is varied: leave it out of the fixed ones"
            raise ParameterError(name, self.fixed[name], bound)
        if (self.runs is None) != (self.design == "grid"):
            bound = "must be given for 'lhs' and 'sobol', and for them alone"
            raise ParameterError("runs", self.runs, bound)
        for name, r in self.vary.items():
            if not r.values and (r.n is None) == (self.design == "grid"):
                bound = "must have no count: runs gives it"
                if self.runs is None:
                    bound = "must have a count, as in 1:1000:50log"
                given = f"{r.low:g}:{r.high:g}{f':{r.n}' if r.n else ''}"
                raise ParameterError(name, given, f"{bound} ({self.design})")
        integer("runs", len(self), 1, MOST_RUNS)
        self.run_scenario(self.points(0, 1)[0])  # raises the errors of the first run

    def __len__(self) -> int:
        if self.runs is not None:
            return self.runs
        return math.prod(r.count for r in self.vary.values())

    def points(self, first: int, last: int) -> np.ndarray:
        """Parameters of some runs, shape (last - first, parameters).

        Args:
            first: number of the first run.
            last: number of the run after the last.
        """
        axes = list(self.vary.values())
        if self.design == "grid":
            return np.column_stack(grid_columns(axes, np.arange(first, last)))
        unit = unit_samples(self.design, len(axes), len(self), self.seed)[first:last]
        return np.column_stack([r.spread(u) for r, u in zip(axes, unit.T, strict=True)])

    @property
    def title(self) -> str:
        """Name of the experiment or the scenario."""
        return str(self.scenario.get("name", "scenario")) if self.scenario else self.experiment

    def run_scenario(self, point: np.ndarray) -> Scenario:
        """The scenario of one run.

        Args:
            point: its parameters, a row of `points`.

        Raises:
            ParameterError: there is no such parameter, or a value is out of its bounds.
        """
        settings = self.scenario or {"experiment": self.experiment}
        varied = dict(zip(self.vary, point.tolist(), strict=True))
        return Scenario.of(settings, self.fixed, varied)

    def described(self) -> dict[str, Any]:
        """The sweep as plain data."""
        return {"schema": SWEEP_SCHEMA, **dataclasses.asdict(self)}

    def blank_row(self) -> dict[str, Any]:
        """A row of the data set, for the types of its columns."""
        return result_row(0, list(self.vary), np.zeros(len(self.vary)), None)

    def rows(self, runs: range, late: Callable[[], bool]) -> list[dict[str, Any]]:
        """Makes some runs, one row per run.

        Args:
            runs: numbers of the runs.
            late: whether to end, called after each run where the sweep has no chunk size.
        """
        rows: list[dict[str, Any]] = []
        for index, point in zip(runs, self.points(runs.start, runs.stop), strict=True):
            rows.append(run_point(self, index, point))
            if self.chunk is None and late():
                break
        return rows


def run_point(sweep: Sweep, index: int, point: np.ndarray) -> dict[str, Any]:
    """Makes one run of a sweep and returns its row."""
    names = list(sweep.vary)
    try:
        return result_row(index, names, point, simulate(sweep.run_scenario(point)))
    except ParameterError as error:
        return result_row(index, names, point, None, str(error))


def load_sweep(path: Path) -> dict[str, Any]:
    """Reads the arguments of a Sweep from TOML; dotted names may be written as tables."""
    try:
        data = parse_toml(read_text(path, MOST_SETTINGS))
    except (OSError, ValueError) as error:
        fault = getattr(error, "strerror", None) or error
        raise ParameterError("spec", str(path), f"must be a TOML file ({fault})") from None
    fields = [f.name for f in dataclasses.fields(Sweep)]
    for name in data:
        choice("field of the spec", name, fields)
    for name in ("vary", "fixed"):
        if not isinstance(data.get(name, {}), dict):
            raise ParameterError(name, data[name], "must be a table")
        data[name] = _dotted(with_present_names(data.get(name, {})))
    if "scenario" in data:
        if "experiment" in data or not isinstance(data["scenario"], str):
            bound = "must be the path of a scenario file; remove the experiment"
            raise ParameterError("scenario", data["scenario"], bound)
        data["scenario"] = read_settings(path.parent / data["scenario"])
    data["vary"] = {k: Range.parse(k, v, parameter_unit(k)) for k, v in data["vary"].items()}
    return {"experiment": "constant", **data}


def _dotted(table: Mapping[str, Any], path: str = "") -> dict[str, Any]:
    """Flattens a nested table to dotted names: a.b = 1 and "a.b" = 1 are equivalent."""
    out: dict[str, Any] = {}
    for name, value in table.items():
        inner = join_names(path, name)
        out |= _dotted(value, inner) if isinstance(value, dict) else {inner: value}
    return out


@checked
def run_sweep(
    sweep: Sweep,
    out: str | os.PathLike[str],
    *,
    workers: Annotated[int | None, Bound(1, 1024)] = None,
    scheduler: str | None = None,
    progress: Callable[[int], object] | None = None,
) -> int:
    """Makes the missing runs of a sweep; returns their number.

    Args:
        sweep: the sweep.
        out: folder of sweep.json and data/.
        workers: processes on this machine; None for one per core.
        scheduler: address of a dask scheduler to use instead.
        progress: called with the number of runs of each finished file.

    Raises:
        ParameterError: the folder holds another sweep or cannot be written, or a package is
            missing.
        ChildProcessError: workers here cannot be started, or one was killed.
        ConnectionError: the connection to the scheduler is lost.
        FileNotFoundError: the folder, or a file in it, was removed while the runs were made.
    """
    return store_runs.run_plan(sweep, Path(out), workers, scheduler, progress)


def estimate_time(sweep: Sweep) -> tuple[float, float]:
    """Process time [s] and disk space [bytes] of a run, estimated from random runs."""
    _probe(sweep, 0.0)  # the first run imports
    rows, spent = _probe(sweep, PROBE_TIME)
    each = spent / len(rows)
    if sweep.chunk is None:
        size = min(store_runs.MOST_IN_CHUNK, int(store_runs.CHUNK_TIME / max(each, 1e-6)))
        sweep = dataclasses.replace(sweep, chunk=max(1, size))
    return each, store.row_size(sweep, rows)


def _probe(sweep: Sweep, patience: float) -> tuple[list[dict[str, Any]], float]:
    """Rows of random runs, and their total time [s]."""
    rows, spent, begin = [], 0.0, time.perf_counter()
    for i in np.random.default_rng(0).integers(0, len(sweep), PROBES).tolist():
        rows.append(run_point(sweep, i, sweep.points(i, i + 1)[0]))
        spent = time.perf_counter() - begin
        if spent > patience:
            break
    return rows, spent
