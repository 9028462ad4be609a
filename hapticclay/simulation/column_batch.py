"""Many runs that differ in columns of numbers, without a scenario for each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np

from ..arguments import checked
from ..errors import Bound, ParameterError, array_of, number
from ..fields import nodes_of
from ..kernel import scene
from ..kernel.engine import warnings_caught
from ..model.cells import Profile
from ..model.constants import AXES
from ..scene.changes import HAND, with_fields
from ..scene.scenario import Scenario
from . import batch, summaries
from .engines import engine_for
from .many import FEWEST, Differences, differences_of, kind_key

MOST = 4096  # runs of one part: their models and states take 40 MB
PART = 100_000.0  # steps of one part of the work of a thread: a quarter of a second
PAIRS = {"gain": "gain", "force": "force", "velocity": "starts"}  # and where `Differences` has them
Entry = tuple[str, tuple[int, ...]]


@checked
def simulate_columns(
    base: Scenario,
    columns: Mapping[str, Any],
    *,
    threads: Annotated[int | None, Bound(1, 1024)] = None,
) -> np.ndarray:
    """Runs a scenario with columns of numbers in place of some of its fields.

    The results are those of `simulate_batch([with_fields(base, row) ...], keep="summaries")`, bit
    for bit. Columns of gain, force, velocity, the operator's arm, the damping of clay or the delay
    need no scenario per run; any other column costs a scenario per run.

        hands = {"operator.mass": mass, "operator.damper": damper}  # arrays, shape (n,)
        steady = hc.simulate_columns(hc.constant_cut(operator=hc.Operator()), hands)["v"]

    Args:
        base: what the runs have in common.
        columns: values by dotted name, as of `with_fields`, shape (n,) each.
        threads: number of parallel runs; None for one per core.

    Returns:
        An array of SUMMARY, shape (n,).

    Raises:
        ParameterError: there is no such field, a column has another length, or a value was
            refused; the error names column and row.
    """
    runs = Columns(base, columns)
    many = len(runs) >= batch.MANY and runs.is_plain
    if not many or engine_for("auto", math.inf) == "python":
        scenarios = map(runs.scenario, range(len(runs)))
        return batch.simulate_batch(scenarios, threads=threads, keep="summaries")
    pool, out, n = batch.BatchPool(), summaries.Summaries(), len(runs)
    size = max(FEWEST, min(int(PART * runs.like.dt / runs.like.t_max), MOST))
    parts = (range(k, min(k + size, n)) for k in range(0, n, size))

    def make(rows: range) -> np.ndarray:
        return _summaries_of(pool, runs, rows)

    with warnings_caught():
        batch.on_threads(
            parts, make, out.put, min(threads or batch.cores(), -(-n // size)), pool.stop
        )
    return out.all()


class Columns:
    """Scenarios as columns of values by dotted name.

    Attributes:
        like: the first scenario.
        is_plain: whether the numbers of all runs are known without their scenarios.
    """

    def __init__(self, base: Scenario, columns: Mapping[str, Any]):
        if not columns:
            raise ParameterError("columns", columns, "must hold at least one column")
        self.base = base
        self.columns = {name: _column(name, x) for name, x in columns.items()}
        lengths = {len(x) for x in self.columns.values()}
        if len(lengths) > 1:
            bound = "must all be of one length"
            raise ParameterError("columns", {n: len(x) for n, x in self.columns.items()}, bound)
        self.n = lengths.pop()
        for name, x in self.columns.items():
            _check_bounds(base, name, x)
        self.like = self.scenario(0)
        self.key = kind_key(self.like)
        self.places = [places_of(name, self.like) for name in self.columns]
        self.is_plain = self.key is not None and all(self.places)
        if "hardware.delay" in self.columns:  # its bound depends on the sample: check the longest
            self.scenario(int(self.columns["hardware.delay"].argmax()))

    def __len__(self) -> int:
        return self.n

    def scenario(self, k: int) -> Scenario:
        """One of the scenarios."""
        try:
            return with_fields(self.base, {n: float(x[k]) for n, x in self.columns.items()})
        except ParameterError as error:
            raise ParameterError(f"{error.field}[{k}]", error.value, error.bound) from None

    def differences(self, first: int, end: int) -> Differences:
        """Differences between the scenarios of some rows."""
        d = differences_of([self.like]).repeated(end - first)
        into = d._asdict()
        into |= {f"clay.{axis}": x for axis, x in zip(AXES, d.values or (), strict=False)}
        both = zip(self.columns.values(), self.places, strict=True)
        for x, places in sorted(both, key=lambda each: -len(each[1])):  # a pair, then its entries
            for name, index in places:
                into[name][(slice(None), *index)] = x[first:end]
        return d

    def of_kind(self, d: Differences) -> np.ndarray:
        """Which runs are of the kind of the first: equally delayed, with equally stiff clay."""
        one, good = differences_of([self.like]), np.ones(len(d.gain), bool)
        if len(d.delays):
            good &= (d.delays > 0.0) == (one.delays[0] > 0.0)
        if d.values is None or not any(name.startswith("clay.") for name in self.columns):
            return good
        x, y, (x1, y1) = *d.values, one.values
        if x.shape == y.shape:
            good &= (x == y).all(axis=1) == (x1 == y1).all()
        most, most1 = (np.maximum(a.max(axis=1), b.max(axis=1)) for a, b in ((x, y), (x1, y1)))
        hard, hard1 = (scene.hardness(self.like, b) for b in (most, most1))
        for made, wanted in zip(hard, hard1, strict=True):
            good &= np.equal(made, wanted)
        return good


def places_of(name: str, base: Scenario) -> list[Entry]:
    """Where `Differences` has a field: names, indices; none for a field that needs a scenario."""
    head, *rest = name.split(".")
    axes = (0, 1)
    if rest and rest[0] in AXES:
        axes, rest = (AXES.index(rest[0]),), rest[1:]
    if head in PAIRS and not rest:
        first = 2 if head == "velocity" else 0
        return [(PAIRS[head], (first + i,)) for i in axes]
    if head == "operator" and all(base.operators) and len(rest) == 1:
        return [("hands", (i, HAND.index(rest[0]))) for i in axes]
    if name == "hardware.delay" and base.hardware is not None:
        return [("delays", ())]
    law = base.clay.laws[axes[0]] if head == "clay" and base.clay and len(axes) == 1 else None
    if type(law) is Profile and rest[:1] == ["values"] and len(rest) == 2:
        return [(f"clay.{AXES[axes[0]]}", (int(rest[1]),))]
    return []


def _column(name: str, given: Any) -> np.ndarray:
    column = array_of(name, given)
    if column.ndim != 1 or not len(column):
        raise ParameterError(name, given, "must be a column of numbers, shape (n,)")
    return column


def _check_bounds(base: Scenario, name: str, column: np.ndarray) -> None:
    """Refuses an unknown field, and a number out of bounds, with its row."""
    (head, *rest), known = str(name).split("."), nodes_of(Scenario)
    bounds = known[head].bounds_at(rest) if head in known else []
    if not bounds:
        with_fields(base, {name: float(column[0])})
    lows = [float(x.low) for x in bounds if not isinstance(x.low, str)]
    low = min(lows) if len(lows) == len(bounds) > 0 else -np.inf  # else the scenario checks
    high = max((x.high for x in bounds), default=np.inf)
    above = bool(bounds) and all(x.above for x in bounds)
    bad = ~(np.isfinite(column) & (column >= low) & (column <= high))
    for k in np.flatnonzero(bad | (column == low) if above else bad)[:1].tolist():
        unit = bounds[0].unit if bounds else ""
        number(f"{name}[{k}]", float(column[k]), low, high, above=above, unit=unit)


def _summaries_of(pool: batch.BatchPool, runs: Columns, rows: range) -> np.ndarray:
    """Summaries of some runs: together where they are of one kind, else one by one."""
    out, lane = np.zeros(len(rows), summaries.SUMMARY), pool.lane()
    pattern, together = lane.pattern(runs.key, runs.like), np.zeros(len(rows), bool)
    if pattern.is_made:
        d = runs.differences(rows.start, rows.stop)
        fields, good = lane.group(pattern, d)
        alike = runs.of_kind(d)
        together = good & alike
        kept = {name: values[alike[good]] for name, values in fields.items()}
        summaries.put_fields(out, together, kept)
    for i in np.flatnonzero(~together).tolist():
        out[i] = pool.summary(runs.scenario(rows[i]))
    return out
