"""Episodes of a task: of one copy in numbers, or of many copies in columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..kernel.engine import warnings_caught
from ..kernel.scene import takes_gain
from ..simulation.simulation_batch import SimulationBatch
from ..simulation.stepwise import COLUMNS, Alone, Simulation, make_steps
from .columns import Value, clipped, columns_of, observed, replaced, value_of
from .draws import Truth, draw
from .task import Command, Handle, Memory, Task

PLACES = tuple(COLUMNS[name] for name in ("p", "v", "fh", "fe"))
Ends = Sequence[tuple[float, float]]  # of the quantities of an observation
# the sample, in how many samples each motor was strained, whether the run has ended; or columns
Measured = tuple[Any, Any, Any]


class Period(NamedTuple):
    """Results of a control period, of one copy or of all."""

    observation: np.ndarray  # float32, shape (m,) or (n, m)
    reward: Any  # a number, or shape (n,)
    ended: Any  # whether the episode is over: bool, or shape (n,)
    info: Memory  # by name: numbers, or shape (n,) each


class One:
    """The run of a copy, in numbers: three times as fast as columns with one value each.

    Its scenario keeps the force and the gain that it began with: to make one anew takes a period
    5 us.
    """

    def __init__(self, scenarios: Sequence[Any], engine: str):
        self.run = Simulation(scenarios[0], engine=engine, recorded=False, monitored=False)
        self.gain = scenarios[0].gain

    def reset(self, which: Sequence[int], scenarios: Sequence[Any]) -> None:
        self.run.reset(scenarios[0])
        self.gain = scenarios[0].gain

    def advance(self, n: int, command: Command, live: Any) -> None:
        """Makes n steps under a command."""
        with Alone(self.run) as run:
            if run.outcome is not None:
                return
            if command.gain is not None and command.gain != self.gain:
                self.gain = command.gain
                change = run.put_gain if takes_gain(run.row.m) else run.change_gain
                change(self.gain)
            run.push_evenly((0.0, *command.force, 0.0, 0.0))
            make_steps(run, n)

    def measured(self, n: int, limits: tuple[float, float]) -> Measured:
        with Alone(self.run) as run:
            return run.numbers_ahead(), run.strained(n, limits), run.outcome is not None

    def observation(self, values: Iterable[Value], ends: Ends) -> np.ndarray:
        """Values, clipped to their ends, as float32."""
        found = [
            x if low <= x <= high else observed(x, low, high)  # most need no call
            for x, (low, high) in zip(values, ends, strict=True)
        ]
        return np.array(found, np.float32)

    @staticmethod
    def merged(kept: Memory, which: Sequence[int], rows: Sequence[Memory]) -> Memory:
        """Values by name, those of the copies that begin anew replaced."""
        return rows[0]


class Many:
    """The runs of n copies, in columns."""

    def __init__(self, scenarios: Sequence[Any], engine: str):
        self.run = SimulationBatch(scenarios, engine=engine, monitored=False)

    def reset(self, which: Sequence[int], scenarios: Sequence[Any]) -> None:
        self.run.reset(which, scenarios)

    def advance(self, n: int, command: Command, live: np.ndarray) -> None:
        """Makes n steps of the live runs under a command."""
        with Alone(self.run) as runs, warnings_caught():
            which = np.flatnonzero(live & ~runs.over)
            if command.gain is not None:
                runs.set_gain(which, np.stack(command.gain, axis=1)[which])
            runs.push(which, np.stack(command.force, axis=1)[which])
            runs.advance(which, n, shows=True)

    def measured(self, n: int, limits: tuple[float, float]) -> Measured:
        with Alone(self.run) as runs, warnings_caught():
            return runs.show().T.copy(), runs.strained(n, limits).T, runs.over.copy()

    def observation(self, values: Iterable[Value], ends: Ends) -> np.ndarray:
        low, high = np.array(ends).T
        return observed(np.stack(tuple(values), axis=1), low, high).astype(np.float32)

    @staticmethod
    def merged(kept: Memory, which: Sequence[int], rows: Sequence[Memory]) -> Memory:
        new = {name: columns_of([x[name] for x in rows]) for name in rows[0]}
        return {name: replaced(kept[name], which, x) for name, x in new.items()} if kept else new


class Episodes:
    """Episodes of a task, with the numbers drawn for them, of `One` copy or of `Many`."""

    def __init__(self, task: Task, kind: type[One | Many], engine: str):
        self.task, self.kind, self.engine = task, kind, engine
        self.truth: Memory = {}
        self.memory: Memory = {}
        self.handle: Handle
        self._ends = [(q.low, q.high) for q in task.observations]
        self._runs: One | Many | None = None

    @property
    def begun(self) -> bool:
        """Whether there are runs: a reset was made, and no `close` since."""
        return self._runs is not None

    def reset(
        self,
        which: Sequence[int],
        generators: Sequence[np.random.Generator],
        fixed: Sequence[Truth],
    ) -> None:
        """Starts episodes of some copies; the first call must start all of them."""
        task = self.task
        drawn = [draw(task.ranges, rng, x) for rng, x in zip(generators, fixed, strict=True)]
        scenarios = [task.scenario(truth) for truth in drawn]
        begun = [task.begin(truth, rng) for truth, rng in zip(drawn, generators, strict=True)]
        if self._runs is None:
            self._runs, self.truth, self.memory = self.kind(scenarios, self.engine), {}, {}
        else:
            self._runs.reset(which, scenarios)
        self.truth = self.kind.merged(self.truth, which, drawn)
        self.memory = self.kind.merged(self.memory, which, begun)
        self.handle = self._handle(self._runs)

    def _handle(self, runs: One | Many) -> Handle:
        x, strained, over = runs.measured(self.task.steps, self.task.strain_limits)
        return self.task.handle([(x[i], x[i + 1]) for i in PLACES], strained, over)

    def observe(self) -> np.ndarray:
        """Present observations, clipped to their bounds, float32."""
        assert self._runs is not None
        return self._runs.observation(self.task.observe(self.memory, self.handle), self._ends)

    def step(self, action: Iterable[Value], live: Any = True) -> Period:
        """Advances the live copies by one control period."""
        runs, task = self._runs, self.task
        assert runs is not None
        inside = tuple([clipped(x, -1.0, 1.0) for x in action])
        runs.advance(task.steps, task.command(self.memory, inside), live)
        self.handle = self._handle(runs)
        reward, ended, info = task.judge(self.memory, self.handle, inside)
        return Period(self.observe(), reward, ended, info)

    def copy(self, i: int) -> tuple[Truth, Memory, Handle]:
        """Numbers drawn, memory and handle of one of many copies."""
        memory = {name: value_of(x, i) for name, x in self.memory.items()}
        return self.truth_of(i), memory, Handle(*value_of(tuple(self.handle), i))

    def truth_of(self, i: int) -> Truth:
        """The numbers drawn for one of many copies, by name."""
        return {name: float(x[i]) for name, x in self.truth.items()}

    def close(self) -> None:
        if self._runs is not None:
            self._runs.run.close()
        self._runs = None
