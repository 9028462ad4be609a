"""Episodes of a task: one copy (`Episode`), or many side by side (`Episodes`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..simulation.simulation_batch import SimulationBatch
from ..simulation.stepwise import COLUMNS, Simulation
from .columns import bounded, columns_of, replaced, shown, value_of
from .draws import Truth, draw
from .task import Handle, Memory, Task

PLACES = tuple(COLUMNS[name] for name in ("p", "v", "fh", "fe"))


class Period(NamedTuple):
    """Results of a control period, of one copy or of all.

    Attributes:
        observation: shape (m,) or (n, m), float32.
        reward: number or shape (n,).
        ended: whether the episode is over, bool or shape (n,).
        info: values by name, numbers or shape (n,) each.
    """

    observation: np.ndarray
    reward: Any
    ended: Any
    info: Memory


class Episode:
    """Episodes of a task in one copy.

    Args:
        task: the task.
        engine: as in `Simulation`.

    Attributes:
        truth: numbers drawn for the episode.
        memory: of the task.
        handle: at the end of the last control period.
    """

    truth: Truth
    memory: Memory
    handle: Handle

    def __init__(self, task: Task, engine: str):
        self.task, self.engine = task, engine
        self._ends = [(q.low, q.high) for q in task.observations]
        self._run: Simulation | None = None
        self._gain: Any = None

    def reset(self, rng: np.random.Generator, fixed: Truth) -> None:
        """Starts an episode."""
        self.truth = draw(self.task.ranges, rng, fixed)
        scenario = self.task.scenario(self.truth)
        if self._run is None:
            self._run = Simulation(scenario, engine=self.engine, recorded=False, monitored=False)
        else:
            self._run.reset(scenario)
        self._gain = None
        self.memory = self.task.begin(self.truth, rng)
        self.handle = self._handle(self._run)

    def _handle(self, run: Simulation) -> Handle:
        x, held = run.numbers(), run.torque_reached(self.task.steps, self.task.held)
        return self.task.handle([(x[i], x[i + 1]) for i in PLACES], held, run.outcome is not None)

    def observe(self) -> np.ndarray:
        """The present observation, clipped to its bounds, shape (m,), float32."""
        found = zip(self.task.observe(self.memory, self.handle), self._ends, strict=True)
        return np.array([shown(x, low, high) for x, (low, high) in found], np.float32)

    def step(self, action: Sequence[float]) -> Period:
        """Advances by one control period."""
        run, task = self._run, self.task
        assert run is not None
        clipped = tuple([bounded(x, -1.0, 1.0) for x in action])
        force, gain = task.command(self.memory, clipped)
        if gain != self._gain:
            run.set(gain=gain)
            self._gain = gain
        run.advance(task.steps, force=force)
        self.handle = self._handle(run)
        reward, ended, info = task.judge(self.memory, self.handle, clipped)
        return Period(self.observe(), reward, ended, info)

    def close(self) -> None:
        """Ends the run."""
        if self._run is not None:
            self._run.close()
        self._run = None


class Episodes:
    """Episodes of a task in n copies.

    Args:
        task: the task.
        n: number of copies.
        engine: as in `Simulation`.

    Attributes:
        truth: numbers drawn for the episodes, by name, shape (n,) each.
        memory: of the task, in columns.
        handle: at the end of the last control period, in columns.
    """

    truth: Memory
    memory: Memory
    handle: Handle

    def __init__(self, task: Task, n: int, engine: str):
        self.task, self.n, self.engine = task, n, engine
        self._low, self._high = np.array([(q.low, q.high) for q in task.observations]).T
        self._runs: SimulationBatch | None = None

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
        """Starts episodes; the first call must start all of them."""
        ranges = self.task.ranges
        drawn = [draw(ranges, rng, x) for rng, x in zip(generators, fixed, strict=True)]
        scenarios = [self.task.scenario(truth) for truth in drawn]
        begun = [self.task.begin(x, rng) for x, rng in zip(drawn, generators, strict=True)]
        if self._runs is None:
            self._runs = SimulationBatch(scenarios, engine=self.engine, monitored=False)
            self.truth = {name: columns_of([x[name] for x in drawn]) for name in drawn[0]}
            self.memory = {name: columns_of([m[name] for m in begun]) for name in begun[0]}
        else:
            self._runs.reset(list(which), scenarios)
            for kept, rows in ((self.truth, drawn), (self.memory, begun)):
                for name in kept:
                    kept[name] = replaced(kept[name], which, [x[name] for x in rows])
        self.handle = self._handle(self._runs)

    def _handle(self, runs: SimulationBatch) -> Handle:
        x, held = runs.numbers().T, tuple(runs.torque_reached(self.task.steps, self.task.held).T)
        return self.task.handle([(x[i], x[i + 1]) for i in PLACES], held, runs.ended)

    def observe(self) -> np.ndarray:
        """Present observations, clipped to their bounds, shape (n, m), float32."""
        found = self.task.observe(self.memory, self.handle)
        return shown(np.stack(found, axis=1), self._low, self._high).astype(np.float32)

    def step(self, actions: np.ndarray, live: np.ndarray) -> Period:
        """Advances by one control period."""
        runs, task = self._runs, self.task
        assert runs is not None
        action = tuple(bounded(actions, -1.0, 1.0).T)
        force, gain = task.command(self.memory, action)
        if live.any():
            if gain is not None:
                runs.set(live, gain=np.stack(gain, axis=1)[live])
            runs.advance(task.steps, force=np.stack(force, axis=1), mask=live)
        self.handle = self._handle(runs)
        reward, ended, info = task.judge(self.memory, self.handle, action)
        return Period(self.observe(), reward, ended, info)

    def copy(self, i: int) -> tuple[Truth, Memory, Handle]:
        """Numbers drawn, memory and handle of one copy."""
        memory = {name: value_of(x, i) for name, x in self.memory.items() if name != "at"}
        return self.truth_of(i), memory, Handle(*value_of(tuple(self.handle), i))

    def truth_of(self, i: int) -> Truth:
        """The numbers drawn for a copy, by name."""
        return {name: float(x[i]) for name, x in self.truth.items()}

    def close(self) -> None:
        """Ends the runs."""
        if self._runs is not None:
            self._runs.close()
        self._runs = None
