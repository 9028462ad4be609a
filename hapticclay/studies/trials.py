"""Random trials of a loop or a wall."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Annotated, Any, ClassVar

import numpy as np

from ..arguments import part
from ..errors import Bound, ParameterError, Real, integer
from ..scene.changes import nested, with_fields
from ..scene.scenario import Scenario
from .distribution import Distribution
from .population import HAND, Hands, hands_of, open_uniform
from .sampling import MOST_RUNS, Range, grid_columns
from .store import Plan
from .sweep_rows import RESULT_COLUMNS, Notes
from .verdicts import Case, judge
from .wall import Subject, as_wall
from .workers import batch_threads

SCHEMA = "hapticclay-trials-2"


@part()
class Trials(Plan):
    """Random runs of a loop or of a virtual wall: fixed parts, varying parts and their laws.

    A wall must be linear: no surface, friction or encoder. `zwidth` judges other walls, by rest.

    Parameters have dotted names: those of the base ("b", "K", "delay", "pose.x", "operator.mass",
    "servo.G.damping"; of a wall "K", "B", "device.damper"), else those of the scenario of its runs
    ("hardware.force_filter", "torque_limit.elbow"); `hapticclay fields` lists the latter.

    Attributes:
        base: the fixed parts: a PushedLoop or a VirtualWall. Its own push is ignored.
        vary: distributions by name; the numbers are independent.
        hands: population of the hand, or its name in POPULATIONS; None for the hand of the base.
        grid: one or two parameters with a range of values each, lists or with a count; each
            combination is a cell.
        runs: number of runs, of each cell where there is a grid.
        push: velocity of the handle at the start [m/s], 1e-9 to 1; None for one that keeps the
            motion linear: TRIAL_PUSH, for a wall SAMPLE_PUSH per sample. Larger pushes show the
            effect of friction, encoder and torque limits of an arm, and take longer.
        seed: seed of the generator, 0 to 2^32 - 1.
        chunk: runs per stored chunk, the most that a killed process loses.
    """

    notes: ClassVar[Notes] = {
        "run": RESULT_COLUMNS["run"],
        "unstable": ("", "1 if the oscillation grows, 0 if not, -1 if the run cannot be made"),
        "longer": ("", "whether a longer run was made to decide"),
    }

    base: Subject
    vary: dict[str, Distribution] = field(default_factory=dict)
    hands: str | Hands | None = None
    grid: dict[str, Range] = field(default_factory=dict)
    runs: Annotated[int, Bound(1, MOST_RUNS)] = 1000
    push: Annotated[Real | None, Bound(1e-9, 1.0, "m/s")] = None
    seed: Annotated[int, Bound(0, 2**32 - 1)] = 0
    chunk: Annotated[int, Bound(1, 100_000)] = 1000  # pyright: ignore[reportIncompatibleVariableOverride]

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
        integer("runs", len(self), 1, MOST_RUNS)
        self.scenario(self.middle(), 0.1)  # refuses an unknown name

    def __len__(self) -> int:
        return self.runs * self.cells

    @property
    def cells(self) -> int:
        """Number of cells of the grid, 1 without one."""
        return math.prod(r.count for r in self.grid.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters of a run: those of the grid, the hand, and what varies."""
        hand = tuple(f"operator.{n}" for n in HAND) if self.hands else ()
        return (*self.grid, *hand, *self.vary)

    def points(self, number: int) -> np.ndarray:
        """Parameters of the runs of one chunk, shape (runs, names).

        Run i lies in cell i modulo the number of cells, so that all cells fill evenly.

        Args:
            number: number of the chunk, from 0.
        """
        runs = np.array(self.chunk_runs(number))
        rng = np.random.default_rng([self.seed, number])
        columns = grid_columns(self.grid.values(), runs % self.cells) if self.grid else []
        if isinstance(self.hands, Hands):
            columns += list(self.hands.spread_over(open_uniform(rng, (len(runs), 3))).T)
        u = open_uniform(rng, (len(runs), len(self.vary)))
        columns += [law.spread(x) for law, x in zip(self.vary.values(), u.T, strict=True)]
        return np.column_stack(columns)

    def middle(self) -> dict[str, float]:
        """The parameters of the middle run: medians, and the first cell."""
        hand = self.hands.median if isinstance(self.hands, Hands) else None
        return (
            {name: float(r.grid()[0]) for name, r in self.grid.items()}
            | {f"operator.{n}": getattr(hand, n) for n in HAND if hand}
            | {name: law.median for name, law in self.vary.items()}
        )

    def loop(self, values: Mapping[str, float]) -> Subject:
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
        return self._case(values, t_max).scenario

    def _case(self, values: Mapping[str, float], t_max: float) -> Case:
        """One run, with its loop or wall."""
        own, others = self._split(values)
        wall = as_wall(with_fields(self.base, own))
        scenario = wall.trial(t_max, self.push)
        made = with_fields(scenario, others) if others else scenario
        wall.check_trial(made)
        return Case(wall, made)

    def _split(self, values: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float]]:
        """Parameters of the base, and of the scenario."""
        fields = {f.name for f in dataclasses.fields(self.base)}
        own = {k: v for k, v in values.items() if next(iter(nested({k: v}))) in fields}
        return own, {k: v for k, v in values.items() if k not in own}

    @property
    def axis(self) -> str:
        """Axis of the motion."""
        return as_wall(self.base).axis

    def described(self) -> dict[str, Any]:
        """The trials as plain data."""
        kind = type(self.base).__name__
        return {"schema": SCHEMA, "kind": kind, **dataclasses.asdict(self)}

    def judge(
        self, points: np.ndarray, threads: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Makes verdicts on runs, see `verdicts.judge`.

        Args:
            points: their parameters, shape (runs, names).
            threads: number of parallel runs; None for one per core.

        Returns:
            Whether each is unstable: 1 or 0, NOT_RUN for one that cannot be run (a pose out of
            reach), shape (runs,); whether a longer run was made, shape (runs,).
        """
        cases = {}
        for i, row in enumerate(points.tolist()):
            with contextlib.suppress(ParameterError):
                cases[i] = self._case(dict(zip(self.names, row, strict=True)), 1.0)
        return judge(cases, len(points), self.push is not None, threads)

    def blank_row(self) -> dict[str, Any]:
        """A row of the data set, for the types of its columns."""
        return {"run": 0, **dict.fromkeys(self.names, 0.0), "unstable": 0, "longer": False}

    def rows(self, runs: range, late: Callable[[], bool]) -> list[dict[str, Any]]:
        """Makes the runs of a chunk, one row per run.

        Args:
            runs: numbers of the runs.
            late: not called: a chunk is made whole.
        """
        points = self.points(self.part_number(runs))
        unstable, longer = self.judge(points, batch_threads())
        judged = zip(runs, points.tolist(), unstable.tolist(), longer.tolist(), strict=True)
        names = tuple(self.blank_row())
        return [dict(zip(names, (i, *x, u, more), strict=True)) for i, x, u, more in judged]
