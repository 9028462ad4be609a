"""The probability that a loop is unstable: many short runs over random hands, clay and hardware.

Each run is pushed, and judged by itself: its oscillation grows, or it does not. A few samples tell
most runs (`growth`); the others are repeated for longer. Chunks of runs are stored as those of a
sweep are, so that an interrupted study goes on where it stopped.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import math
import multiprocessing
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..errors import ParameterError, choice, integer, number
from ..files import versions
from ..model.constants import AXES
from ..results import Result
from ..scene.changes import nested, with_fields
from ..scene.scenario import Scenario
from ..scene.virtual_wall import VirtualWall
from ..simulation.batch import simulate_batch
from ..theory import wall_limits
from . import boundary, growth, sweep, sweep_store, wall_runs
from .boundary import PushedLoop
from .distribution import Distribution
from .population import HAND, Hands, hands_of, open_uniform
from .sampling import MOST_RUNS, Range

SCHEMA = "hapticclay-trials-1"
TRIAL_PUSH = 1e-6  # [m/s] so small that the arm stays linear to 1e-6
SAMPLE_PUSH = 1e-7  # [m] a sample: of a wall, far above rounding and far below the arm's length
ENDED = ("limit cycle", "saturated")  # runs that the motors bound: a small push has grown to that
LOST = ("diverged", "out of reach", "singular")  # runs that nothing bounds
SPAN_STEPS = 200.0  # of a repeated run, at least
WALL_SPANS = (1.0, 4.0)  # of a wall's run, then of the one that repeats it
WALL_TOLD = 0.01  # a wall's run that changes by a smaller share of itself is repeated
WALL_BATCH = 100  # walls that run together, for their samples take room in memory
PROBED = 200  # runs that an estimate of the cost is made from
NOT_RUN = -1  # in place of 0, stable, and 1, unstable
LEVEL = 0.95  # of a confidence interval
CURVE_POINTS = 61  # of a boundary


@checked
@dataclass(frozen=True)
class Trials:
    """Random runs of a loop, or of a virtual wall: what is fixed, what varies, and how.

    A wall must be linear: no surface, friction or encoder. `zwidth` judges the others, by rest.

    Parameters have dotted names: those of the base ("b", "K", "delay", "pose.x", "operator.mass",
    "servo.G.damping"; of a wall "K", "B", "device.damper"), else those of the scenario of its runs
    ("hardware.force_filter", "torque_limit.elbow"); `hapticclay fields` lists the latter.

    Attributes:
        base: what does not vary: a PushedLoop or a VirtualWall. Its own push does not matter.
        vary: distributions by name; the numbers are independent.
        hands: population of the hand, or its name in POPULATIONS; None for the hand of the base.
        grid: one or two parameters with a range of values each, lists or with a count; each
            combination is a cell.
        runs: number of runs, of each cell where there is a grid.
        push: velocity of the handle at the start [m/s], 1e-9 to 1; None for one that leaves the
            motion linear: TRIAL_PUSH, of a wall SAMPLE_PUSH a sample. Larger ones show what
            friction, encoder and torque limits of an arm do, and take longer.
        seed: of the generator, 0 to 2^32 - 1.
        chunk: runs that are stored together, the most that a killed process loses.
    """

    base: PushedLoop | VirtualWall
    vary: dict[str, Distribution] = field(default_factory=dict)
    hands: str | Hands | None = None
    grid: dict[str, Range] = field(default_factory=dict)
    runs: int = 1000
    push: float | None = None
    seed: int = 0
    chunk: int = 1000

    def __post_init__(self):
        for name, law in self.vary.items():
            if not isinstance(law, Distribution):
                raise ParameterError(name, law, "must be a Distribution")
        for name, values in self.grid.items():
            if not isinstance(values, Range) or not (values.values or values.n):
                raise ParameterError(name, values, "must be a Range with a count, or a list")
        if self.hands is not None:
            object.__setattr__(self, "hands", hands_of(self.hands))
        if len(self.grid) > 2:
            raise ParameterError("grid", list(self.grid), "must have two parameters at most")
        if len(set(self.names)) < len(self.names):
            raise ParameterError("names", self.names, "must each be given once")
        if not self.vary and self.hands is None:
            raise ParameterError("vary", self.vary, "must hold a distribution, or give hands")
        if self.push is not None:
            push = number("push", self.push, 1e-9, 1.0, unit="m/s")
            object.__setattr__(self, "push", push)
        integer("seed", self.seed, 0, 2**32 - 1)
        integer("chunk", self.chunk, 1, 100_000)
        integer("runs", self.runs, 1, MOST_RUNS)
        integer("runs", len(self), 1, MOST_RUNS)
        self.scenario(self.middle(), 0.1)  # refuses an unknown name

    def __len__(self) -> int:
        return self.runs * self.cells

    @property
    def cells(self) -> int:
        """Number of cells of the grid, 1 without one."""
        return math.prod(len(r.grid()) for r in self.grid.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters of a run: of the grid, the hand, and what varies."""
        hand = tuple(f"operator.{n}" for n in HAND) if self.hands else ()
        return (*self.grid, *hand, *self.vary)

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-len(self) // self.chunk)

    def chunk_runs(self, number: int) -> range:
        """The runs of one chunk.

        Args:
            number: of the chunk, from 0.
        """
        return range(number * self.chunk, min((number + 1) * self.chunk, len(self)))

    def points(self, number: int) -> np.ndarray:
        """Parameters of the runs of one chunk, shape (runs, names).

        Run i lies in cell i modulo the number of cells, so that all cells fill evenly.

        Args:
            number: of the chunk, from 0.
        """
        runs = np.array(self.chunk_runs(number))
        rng = np.random.default_rng([self.seed, number])
        columns = []
        if self.grid:
            axes = [r.grid() for r in self.grid.values()]
            index = np.unravel_index(runs % self.cells, [len(x) for x in axes])
            columns += [x[i] for x, i in zip(axes, index, strict=True)]
        if isinstance(self.hands, Hands):
            columns += list(self.hands.spread_over(open_uniform(rng, (len(runs), 3))).T)
        u = open_uniform(rng, (len(runs), len(self.vary)))
        columns += [law.spread(x) for law, x in zip(self.vary.values(), u.T, strict=True)]
        return np.column_stack(columns)

    def middle(self) -> dict[str, float]:
        """The parameters of a run in the middle: medians, and the first cell."""
        hand = self.hands.median if isinstance(self.hands, Hands) else None
        return (
            {name: float(r.grid()[0]) for name, r in self.grid.items()}
            | {f"operator.{n}": getattr(hand, n) for n in HAND if hand}
            | {name: law.median for name, law in self.vary.items()}
        )

    def loop(self, values: Mapping[str, float]) -> PushedLoop | VirtualWall:
        """The base with some of its parameters changed.

        Args:
            values: parameters by name; those of the scenario are left out.
        """
        return with_fields(self.base, self._split(values)[0])

    def scenario(self, values: Mapping[str, float], t_max: float) -> Scenario:
        """The scenario of one run.

        Args:
            values: its parameters, by name.
            t_max: its length [s].

        Raises:
            ParameterError: there is no such parameter, a value is out of its bounds, or a wall is
                not linear.
        """
        own, others = self._split(values)
        base = with_fields(self.base, own)
        if isinstance(base, PushedLoop):
            scenario = replace(base, push=self.push or TRIAL_PUSH).scenario(
                t_max, stop_when_unstable=False
            )
        else:
            push = self.push or min(SAMPLE_PUSH / base.Ts, 1.0)
            scenario = base.scenario(t_max, push=push, steps=wall_runs.growth_steps(base))
        made = with_fields(scenario, others) if others else scenario
        if isinstance(base, VirtualWall):
            hardware = made.hardware
            rough = hardware and (hardware.encoder or any(hardware.friction))
            if base.unilateral or rough:
                bound = "must be a wall without surface, friction and encoder; see hc.walls.zwidth"
                raise ParameterError("base", base, bound)
        return made

    def _split(self, values: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float]]:
        """Parameters of the base, and of the scenario."""
        fields = {f.name for f in dataclasses.fields(self.base)}
        own = {k: v for k, v in values.items() if next(iter(nested({k: v}))) in fields}
        return own, {k: v for k, v in values.items() if k not in own}

    @property
    def axis(self) -> str:
        """Axis of the motion."""
        return self.base.axis if isinstance(self.base, PushedLoop) else "x"

    def described(self) -> dict[str, Any]:
        """The trials as data."""
        kind = type(self.base).__name__
        return {"schema": SCHEMA, "kind": kind, **dataclasses.asdict(self)}

    def digest(self) -> str:
        """Fingerprint of the trials and of the release that runs them."""
        text = json.dumps({**self.described(), "release": versions()["hapticclay"]}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    # What `sweep` asks of that which it stores.

    def blank_row(self) -> dict[str, Any]:
        """A row of the data set, for the types of its columns."""
        return {"run": 0, **dict.fromkeys(self.names, 0.0), "unstable": 0, "longer": False}

    def chunk_rows(self, number: int) -> list[dict[str, Any]]:
        """Makes the runs of a chunk; a row each.

        Args:
            number: of the chunk, from 0.
        """
        points = self.points(number)
        # A worker is one of several processes, one a core.
        threads = None if multiprocessing.parent_process() is None else 1
        unstable, longer = judge(self, points, threads)
        values = points.tolist()
        return [
            {"run": run, **dict(zip(self.names, values[i], strict=True)),
             "unstable": int(unstable[i]), "longer": bool(longer[i])}
            for i, run in enumerate(self.chunk_runs(number))
        ]  # fmt: skip


def judge(
    trials: Trials, points: np.ndarray, threads: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Makes runs and tells which are unstable.

    A run is unstable if its oscillation grows. Where `growth.short_growth` leaves that of an arm
    undecided, it is repeated for `boundary.GROWTH_SPAN` and judged by `growth.growth_rate`. That
    of a wall is as long, and is read, as `wall_runs.growth_rates` does, at the wall's own samples;
    where it hardly changes in size it is repeated, four times as long. A run that ends early, or
    drives the motors into their limits from so small a push, is unstable.

    Args:
        trials: what the runs are of.
        points: their parameters, shape (runs, trials.names).
        threads: as in `simulate_batch`.

    Returns:
        Whether each is unstable: 1 or 0, NOT_RUN for one that cannot be run (a pose out of reach),
        shape (runs,); whether it was repeated, shape (runs,).
    """
    if isinstance(trials.base, VirtualWall):
        return _judge_walls(trials, points, threads)
    unstable = np.full(len(points), NOT_RUN)
    rate = np.full(len(points), np.nan)
    short: dict[int, Scenario] = {}
    steps = np.zeros(len(points), dtype=int)
    for i, row in enumerate(points.tolist()):
        with contextlib.suppress(ParameterError):
            made = trials.scenario(dict(zip(trials.names, row, strict=True)), 1.0)
            # Odd, so that half the sampling frequency does not fold onto zero.
            steps[i] = 2 * round(0.5 * growth.GROWTH_SAMPLE / made.dt) + 1
            short[i] = replace(
                made, t_max=(growth.MOTION_SAMPLES + 0.5) * float(steps[i]) * made.dt
            )
    axis = AXES.index(trials.axis)
    for every in np.unique(steps[steps > 0]).tolist():
        members = np.flatnonzero(steps == every)
        scenarios = [short[i] for i in members.tolist()]
        records = simulate_batch(scenarios, threads=threads, every=every)
        v = np.full((len(members), growth.MOTION_SAMPLES), np.nan)
        for k, record in enumerate(records):
            if len(record.v) > growth.MOTION_SAMPLES:
                v[k] = record.v[1 : growth.MOTION_SAMPLES + 1, axis]
            else:  # it ended before its time
                rate[members[k]] = math.inf
        dt = np.array([s.dt for s in scenarios])
        for step in np.unique(dt).tolist():
            some = members[dt == step]
            found = growth.short_growth(v[dt == step], every * step)
            rate[some] = np.where(np.isnan(found), rate[some], found)
    longer = np.isnan(rate) & (steps > 0)
    unstable[steps > 0] = rate[steps > 0] > 0.0
    again = np.flatnonzero(longer).tolist()
    spans = [max(boundary.GROWTH_SPAN, SPAN_STEPS * short[i].dt) for i in again]
    runs = [replace(short[i], t_max=t) for i, t in zip(again, spans, strict=True)]
    for i, record in zip(again, simulate_batch(runs, threads=threads), strict=True):
        ended = record.outcome.code in ENDED
        unstable[i] = ended or growth.growth_rate(record, trials.axis) > 0.0
    return unstable, longer


def _judge_walls(
    trials: Trials, points: np.ndarray, threads: int | None
) -> tuple[np.ndarray, np.ndarray]:
    """As `judge`, of walls."""
    unstable, longer = np.full(len(points), NOT_RUN), np.zeros(len(points), dtype=bool)
    walls: dict[int, VirtualWall] = {}
    runs: dict[int, Scenario] = {}
    for i, row in enumerate(points.tolist()):
        values = dict(zip(trials.names, row, strict=True))
        with contextlib.suppress(ParameterError):
            runs[i], wall = trials.scenario(values, 1.0), trials.loop(values)
            assert isinstance(wall, VirtualWall)
            walls[i] = wall
    # Those with as many steps a sample run together: their records keep one step of so many.
    steps = {i: round(walls[i].Ts / run.dt) for i, run in runs.items()}
    for every in sorted(set(steps.values())):
        members = [i for i in runs if steps[i] == every]
        for first in range(0, len(members), WALL_BATCH):
            left = members[first : first + WALL_BATCH]
            for span in WALL_SPANS:
                read = {i: wall_runs.growth_reading(walls[i], span) for i in left}
                jobs = [replace(runs[i], t_max=read[i][0] * walls[i].Ts) for i in left]
                undecided = []
                records = simulate_batch(jobs, threads=threads, every=every)
                for i, job, record in zip(left, jobs, records, strict=True):
                    if record.outcome.code in (*ENDED, *LOST):
                        unstable[i] = True
                        continue
                    rate = growth.growth_of_run(record, *read[i][1:])
                    unstable[i] = rate > 0.0
                    if abs(rate) * job.t_max < WALL_TOLD:
                        undecided.append(i)
                left = undecided
                if span == WALL_SPANS[0]:
                    longer[left] = True
    return unstable, longer


# ---- what comes out ------------------------------------------------------------------------------


def clopper_pearson(events: Any, runs: Any, level: float = LEVEL) -> tuple[np.ndarray, np.ndarray]:
    """Confidence interval of a probability, exact: it holds it at least as often as it says.

    Clopper, Pearson, Biometrika 26, 1934.

    Args:
        events: number of events, any shape.
        runs: number of runs, of the same shape.
        level: of confidence, 0 to 1.

    Returns:
        Lower and upper ends; 0 and 1 where there are no runs.
    """
    from scipy.special import betaincinv

    level = number("level", level, 0.0, 1.0)
    k, n = np.asarray(events, dtype=float), np.asarray(runs, dtype=float)
    out = 0.5 * (1.0 - level)
    with np.errstate(invalid="ignore"):
        low = np.where(k > 0.0, betaincinv(np.maximum(k, 1e-9), n - k + 1.0, out), 0.0)
        high = np.where(k < n, betaincinv(k + 1.0, np.maximum(n - k, 1e-9), 1.0 - out), 1.0)
    return low, high


@named
@dataclass(frozen=True)
class Probability:
    """A probability that was counted.

    Attributes:
        probability: share of the runs; NaN without runs.
        low: lower end of its confidence interval.
        high: upper end.
        runs: number of runs.
        events: number of runs that were counted.
        level: of confidence.
    """

    probability: float
    low: float
    high: float
    runs: int
    events: int
    level: float = LEVEL

    def __str__(self) -> str:
        share = f"{100.0 * self.probability:.3g} % ({100.0 * self.low:.3g} to"
        return f"{share} {100.0 * self.high:.3g} %, {100.0 * self.level:g} % interval)"


@named
@dataclass(frozen=True)
class RiskMap:
    """The probability of instability over two parameters, or over one.

    Attributes:
        x_name: the first parameter.
        y_name: the second; "" for none.
        x: its values or the middles of its bins, shape (n,).
        y: of the second, shape (m,); one NaN for none.
        runs: number of runs of each cell, shape (n, m).
        events: unstable ones among them, shape (n, m).
    """

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
            level: of confidence, 0 to 1.
        """
        return clopper_pearson(self.events, self.runs, level)


@named
@dataclass(frozen=True, repr=False)
class Instability(Result):
    """Runs that were judged.

    Attributes:
        trials: what they are of.
        points: their parameters, shape (n, trials.names).
        unstable: 1, 0, or NOT_RUN, shape (n,).
        longer: whether the first run left it undecided, shape (n,).
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
        """Number of draws that cannot be run; no probability counts them."""
        return int(np.sum(self.unstable == NOT_RUN))

    @property
    def total(self) -> Probability:
        """Probability of instability over all runs; over a grid, the mean of its cells."""
        return self.estimate()

    def estimate(self, level: float = LEVEL) -> Probability:
        """Probability of instability over all runs.

        Args:
            level: of confidence, 0 to 1.
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
        """Probability over bins of one or two parameters that vary, each bin with as many runs.

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

        The limit is that of K, so K must be one of the two parameters of the grid.

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
        return x, np.array([_exact_limit(self.trials.loop({**middle, other[0]: v})) for v in x])

    def tables(self) -> dict[str, dict[str, Sequence]]:
        """What the figure shows, by table name: columns by name."""
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


def _exact_limit(loop: PushedLoop | VirtualWall) -> float:
    """Largest stable K of the linear loop."""
    if isinstance(loop, VirtualWall):
        return wall_limits.stiffness_band(loop)[1]
    placed = loop.pose != (0.0, 0.0) and not loop.inertia_shaping
    return boundary.pose_limit(loop) if placed else boundary.nominal_limit(loop)


# ---- making the runs -----------------------------------------------------------------------------


@named
@dataclass(frozen=True)
class Cost:
    """What the runs that are left will take, measured on a few of them.

    Attributes:
        runs: number of runs left.
        seconds: time [s].
        size: room on disk [bytes]; 0 where nothing is stored.
        free: room that is there [bytes].
    """

    runs: int
    seconds: float
    size: float = 0.0
    free: float = math.inf


def measure_cost(trials: Trials, left: int, out: Path | None = None, workers: int = 1) -> Cost:
    """Measures what runs will take, on a few of the first chunk.

    Args:
        trials: what they are of.
        left: number of runs.
        out: folder that they are stored in; None for none.
        workers: processes that make them.
    """
    threads = None if workers == 1 else 1
    points = trials.points(0)[:PROBED]
    judge(trials, points[:4], threads)  # the first run loads and compiles
    begin = time.perf_counter()
    judge(trials, points, threads)
    each = (time.perf_counter() - begin) / len(points) / workers
    if out is None:
        return Cost(left, each * left)
    blank = trials.blank_row()
    rows = [{**blank, **dict(zip(trials.names, v, strict=True))} for v in trials.points(0).tolist()]
    size = sweep_store.row_size(trials, rows) * left
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

    With a folder, chunks that are done are kept whatever happens, Ctrl-C too, and the same call
    makes those that are missing. Without, all is kept in memory.

    Args:
        trials: what the runs are of.
        out: folder for the runs (needs pyarrow); None for none.
        workers: processes that make chunks, with a folder; 1 for this one, on all its cores.
        announce: called with the Cost of the runs that are left, measured on PROBED of them, before
            they begin; None measures nothing, except with a folder.
        progress: called with the number of runs of each chunk.

    Raises:
        ParameterError: the folder has no room for the runs, holds others, or cannot be written.
    """
    workers, show = integer("workers", workers, 1, 1024), progress or (lambda n: None)
    if out is None:
        if announce:
            announce(measure_cost(trials, len(trials)))
        rows = []
        for n in range(trials.chunks):
            rows.append(_judged_chunk(trials, n))
            show(len(rows[-1][1]))
        return Instability(trials, *(np.concatenate(x) for x in zip(*rows, strict=True)))
    folder = Path(out)
    with sweep_store.claimed(trials, folder) as (_, todo):
        if todo:
            left = sum(len(trials.chunk_runs(n)) for n in todo)
            cost = measure_cost(trials, left, folder, sweep.processes(todo, workers))
            if announce:
                announce(cost)
            if cost.size > cost.free:
                bound = f"must have room for {cost.size:.3g} bytes; {cost.free:.3g} are free"
                raise ParameterError("out", str(folder), bound)
            with contextlib.closing(sweep.run_chunks(trials, folder, todo, workers)) as results:
                for n in results:
                    show(n)
    return stored_runs(trials, folder)


@checked
def stored_runs(trials: Trials, out: Path | str) -> Instability:
    """The runs that a folder holds, all or those that an interruption left.

    Args:
        trials: what they are of.
        out: the folder.

    Raises:
        ParameterError: it holds none, or others.
    """
    digest = sweep_store.stored_digest(Path(out))
    if digest is None:
        raise ParameterError("out", str(out), "holds no runs")
    if digest != trials.digest():
        raise ParameterError("out", str(out), "holds the runs of other trials")
    table = sweep_store.read_sweep(out)
    columns = {n: table[n].to_numpy() for n in (*trials.names, "unstable", "longer")}
    points = np.column_stack([columns[n] for n in trials.names])
    return Instability(trials, points, columns["unstable"], columns["longer"])


def _judged_chunk(trials: Trials, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    points = trials.points(number)
    return (points, *judge(trials, points))
