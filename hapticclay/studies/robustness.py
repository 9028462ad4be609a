"""The probability that a loop is unstable: many verdicts over random hands, clay and hardware.

Each verdict is on a run of its own: its oscillation grows or not (`verdicts`). Chunks of runs are
stored like those of a sweep, so an interrupted study resumes where it stopped.
"""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..display import brief
from ..errors import ParameterError, choice, integer
from ..results import Result, figure_of
from . import store, store_runs
from .population import Band
from .probability import LEVEL, Probability, clopper_pearson
from .trials import Trials
from .verdicts import NOT_RUN
from .wall import as_wall

PROBED = 200  # runs used to estimate the cost
CURVE_POINTS = 61  # of a boundary


@named
@dataclass(frozen=True)
class RiskMap:
    """The probability of instability over two parameters, or over one.

    Attributes:
        x_name: the first parameter.
        y_name: the second; "" for none.
        x: its values or the middles of its bins, shape (n,).
        y: values of the second, shape (m,); one NaN for none.
        runs: number of runs of each cell, shape (n, m).
        events: number of unstable runs of each cell, shape (n, m).
    """

    def __repr__(self) -> str:
        return brief(self)

    x_name: str
    y_name: str
    x: np.ndarray
    y: np.ndarray
    runs: np.ndarray
    events: np.ndarray

    @property
    def probability(self) -> np.ndarray:
        """Share of unstable runs, NaN for none, shape (n, m)."""
        with np.errstate(invalid="ignore"):
            return np.where(self.runs > 0, self.events / np.maximum(self.runs, 1), np.nan)

    def interval(self, level: float = LEVEL) -> tuple[np.ndarray, np.ndarray]:
        """Confidence interval of each cell, shape (n, m) each.

        Args:
            level: confidence level, 0 to 1.
        """
        return clopper_pearson(self.events, self.runs, level)


@named
@dataclass(frozen=True, repr=False)
class Instability(Result):
    """Judged runs.

    Attributes:
        trials: specification of the runs.
        points: their parameters, shape (n, trials.names).
        unstable: 1, 0, or NOT_RUN, shape (n,).
        longer: whether the first run was undecided, shape (n,).
    """

    drawn_by = "hapticclay.views.robustness_plots:instability_plot"

    trials: Trials
    points: np.ndarray
    unstable: np.ndarray
    longer: np.ndarray

    def headline(self) -> str:
        """Probability of instability, in one line."""
        return f"{self.total} of {self.total.runs} runs unstable"

    @property
    def refused(self) -> int:
        """Number of draws that cannot be run; they are excluded from all probabilities."""
        return int(np.sum(self.unstable == NOT_RUN))

    @property
    def total(self) -> Probability:
        """Probability of instability over all runs; over a grid, the mean of its cells."""
        return self.estimate()

    def estimate(self, level: float = LEVEL) -> Probability:
        """Probability of instability over all runs.

        Args:
            level: confidence level, 0 to 1.
        """
        judged = self.unstable[self.unstable != NOT_RUN]
        n, k = len(judged), int(judged.sum())
        low, high = clopper_pearson(k, n, level)
        return Probability(k / n if n else math.nan, float(low), float(high), n, k, level)

    def map(self) -> RiskMap:
        """Probability in each cell of the grid.

        Raises:
            ParameterError: the trials have no grid.
        """
        if not self.trials.grid:
            raise ParameterError("grid", self.trials.grid, "must be given: see binned()")
        names = list(self.trials.grid)
        values = [r.grid() for r in self.trials.grid.values()]
        index = [
            np.abs(self._column(n)[:, None] - v).argmin(axis=1)
            for n, v in zip(names, values, strict=True)
        ]
        return self._counted(names, values, index, [len(v) for v in values])

    def binned(self, x: str, y: str = "", bins: int = 10) -> RiskMap:
        """Probability over bins of one or two varying parameters, with equally many runs per bin.

        Args:
            x: name of the first parameter.
            y: name of the second; "" for none.
            bins: number of bins of each, 1 to 1000.

        Raises:
            ParameterError: no such parameter.
        """
        bins, names = integer("bins", bins, 1, 1000), [n for n in (x, y) if n]
        values: list[np.ndarray] = []
        index, counts = [], []
        for name in names:
            column = self._column(choice("parameter", name, self.trials.names))
            edges = np.unique(np.quantile(column, np.linspace(0.0, 1.0, bins + 1)))
            counts.append(max(1, len(edges) - 1))
            index.append(np.clip(np.searchsorted(edges, column, "right") - 1, 0, counts[-1] - 1))
            values.append(0.5 * (edges[1:] + edges[:-1]) if len(edges) > 1 else edges)
        return self._counted(names, values, index, counts)

    def _column(self, name: str) -> np.ndarray:
        return self.points[:, self.trials.names.index(name)]

    def _counted(
        self, names: list[str], values: list[np.ndarray], index: list[Any], counts: list[int]
    ) -> RiskMap:
        if len(names) < 2:
            names, values = [*names, ""], [*values, np.array([math.nan])]
            index, counts = [*index, np.zeros(len(self.points), dtype=int)], [*counts, 1]
        (x_name, y_name), (x, y) = names, values
        cell = np.asarray(np.ravel_multi_index(index, counts))
        judged = self.unstable != NOT_RUN
        size = math.prod(counts)
        runs = np.bincount(cell[judged], minlength=size).reshape(counts)
        events = np.bincount(cell[self.unstable == 1], minlength=size).reshape(counts)
        return RiskMap(x_name, y_name, x, y, runs, events)

    def boundary(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Exact limit of the linear loop of the middle run over the other parameter of the grid.

        The limit is one of K, so K must be one of the two parameters of the grid.

        Returns:
            (values of the other parameter, K), shape (n,) each; None where K is not in the grid.
        """
        other = [n for n in self.trials.grid if n != "K"]
        if "K" not in self.trials.grid or len(other) != 1:
            return None
        grid = self.trials.grid[other[0]].grid()
        log = grid.min() > 0.0 and grid.max() > 30.0 * grid.min()
        x = (np.geomspace if log else np.linspace)(grid.min(), grid.max(), CURVE_POINTS)
        middle = {k: v for k, v in self.trials.middle().items() if k != "K"}
        subjects = (self.trials.loop({**middle, other[0]: v}) for v in x)
        return x, np.array([as_wall(subject).trial_limit() for subject in subjects])

    def tables(self) -> dict[str, dict[str, Sequence]]:
        """The numbers of the figure, by table name: columns by name."""
        total = self.total
        out: dict[str, dict[str, Sequence]] = {
            "total": {"runs": [total.runs], "unstable": [total.events],
                      "probability": [total.probability], "low, 95 %": [total.low],
                      "high, 95 %": [total.high], "refused": [self.refused],
                      "repeated": [int(self.longer.sum())]}
        }  # fmt: skip
        if self.trials.grid:
            chart = self.map()
            low, high = chart.interval()
            x, y = np.meshgrid(chart.x, chart.y, indexing="ij")
            cells: dict[str, Sequence] = {chart.x_name: x.ravel().tolist()}
            if chart.y_name:
                cells[chart.y_name] = y.ravel().tolist()
            cells |= {
                name: a.ravel().tolist()
                for name, a in (("runs", chart.runs), ("unstable", chart.events),
                                ("probability", chart.probability), ("low, 95 %", low),
                                ("high, 95 %", high))
            }  # fmt: skip
            out["cells"] = cells
        return out


@named
@dataclass(frozen=True, repr=False)
class Robustness(Result):
    """Judged runs, and a band of gain limits over the same hands.

    Attributes:
        instability: the runs.
        band: the band; None for none.
    """

    instability: Instability
    band: Band | None = None

    def headline(self) -> str:
        """Probability of instability, in one line."""
        return self.instability.headline()

    def tables(self) -> dict[str, dict[str, Sequence]]:
        """The tables of the runs."""
        return self.instability.tables()

    def remarks(self) -> list[str]:
        """The probability, and what it is a mean of."""
        mean = ["over a grid this is the mean of its cells"] * bool(self.instability.trials.grid)
        return [self.headline(), *mean]

    def figures(self) -> dict[str, Any]:
        """Instability over the grid, and the band."""
        band = {"gain_band": figure_of(self.band)} if self.band else {}
        return {"instability": figure_of(self.instability), **band}

    def contents(self) -> dict[str, Any]:
        """Trials, counts and tables."""
        found = self.instability
        return {
            "trials": found.trials.described(),
            "total": found.total,
            "repeated": int(found.longer.sum()),
            "refused": found.refused,
            "tables": self.tables(),
            "band": self.band.tables()["band"] if self.band else None,
        }


# ---- making the runs -----------------------------------------------------------------------------


@named
@dataclass(frozen=True)
class Cost:
    """Estimated cost of the remaining runs, measured on a few of them.

    Attributes:
        runs: number of remaining runs.
        seconds: time [s].
        size: required disk space [bytes]; 0 if nothing is stored.
        free: free disk space [bytes].
    """

    runs: int
    seconds: float
    size: float = 0.0
    free: float = math.inf


def measure_cost(trials: Trials, left: int, out: Path | None = None, workers: int = 1) -> Cost:
    """Estimates the cost of runs from a few of the first chunk."""
    threads = None if workers == 1 else 1
    points = trials.points(0)[:PROBED]
    trials.judge(points[:4], threads)  # the first run imports
    begin = time.perf_counter()
    trials.judge(points, threads)
    each = (time.perf_counter() - begin) / len(points) / workers
    if out is None:
        return Cost(left, each * left)
    blank = trials.blank_row()
    rows = [{**blank, **dict(zip(trials.names, v, strict=True))} for v in trials.points(0).tolist()]
    size = store.row_size(trials, rows) * left
    return Cost(left, each * left, size, shutil.disk_usage(out).free)


@checked
def monte_carlo(
    trials: Trials,
    *,
    out: Path | str | None = None,
    workers: int = 1,
    announce: Callable[[Cost], object] | None = None,
    progress: Callable[[int], object] | None = None,
) -> Instability:
    """Makes random runs of a loop and counts the unstable ones.

    With a folder, finished chunks survive any interruption, including Ctrl-C, and the same call
    makes the missing ones. Without a folder all runs are kept in memory.

    Args:
        trials: specification of the runs.
        out: folder for the runs (needs pyarrow); None for none.
        workers: processes that make chunks, with a folder; 1 for this one, on all its cores.
        announce: called before the runs with the Cost of the remaining runs, measured on PROBED of
            them; None measures nothing, except with a folder.
        progress: called with the number of runs of each chunk.

    Raises:
        ParameterError: the disk has too little space, the folder holds other runs or cannot be
            written.
        ChildProcessError: workers cannot be started, or one was killed.
        FileNotFoundError: the folder, or a file in it, was removed while the runs were made.
    """
    workers = integer("workers", workers, 1, 1024)
    if out is None:
        if announce:
            announce(measure_cost(trials, len(trials)))
        rows = []
        for n in range(trials.chunks):
            rows.append(_judged_chunk(trials, n))
            if progress:
                progress(len(rows[-1][1]))
        return Instability(trials, *(np.concatenate(x) for x in zip(*rows, strict=True)))
    folder = Path(out)

    def check_room(_: Trials, todo: list[range]) -> None:
        left, crew = sum(map(len, todo)), store_runs.processes(trials, todo, workers)
        if not left:
            return
        cost = measure_cost(trials, left, folder, crew)
        if announce:
            announce(cost)
        if cost.size > cost.free:
            bound = f"must have room for {cost.size:.3g} bytes; {cost.free:.3g} are free"
            raise ParameterError("out", str(folder), bound)

    store_runs.run_plan(trials, folder, workers, progress=progress, before=check_room)
    return stored_runs(trials, folder)


@checked
def stored_runs(trials: Trials, out: Path | str) -> Instability:
    """The runs stored in a folder, complete or interrupted.

    Args:
        trials: specification of the runs.
        out: the folder.

    Raises:
        ParameterError: it holds no runs, or other runs.
    """
    digest = store.stored_digest(Path(out))
    if digest is None:
        raise ParameterError("out", str(out), "holds no runs")
    if digest != trials.digest():
        raise ParameterError("out", str(out), "holds the runs of other trials")
    table = store.read_sweep(out)
    columns = {n: table[n].to_numpy() for n in (*trials.names, "unstable", "longer")}
    points = np.column_stack([columns[n] for n in trials.names])
    return Instability(trials, points, columns["unstable"], columns["longer"])


def _judged_chunk(trials: Trials, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    points = trials.points(number)
    return (points, *trials.judge(points))
