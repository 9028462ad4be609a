"""Episodes of a task in one or more copies: resets, control periods, observations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .copies import Copies
from .draws import Truth, draw
from .task import Arrays, Task


class Period(NamedTuple):
    """Results of a control period of all copies.

    Attributes:
        observations: shape (n, m), float32.
        rewards: shape (n,).
        ended: whether an episode is over, shape (n,).
        info: numbers by name, shape (n,) each.
    """

    observations: np.ndarray
    rewards: np.ndarray
    ended: np.ndarray
    info: Arrays


class Episodes:
    """Episodes of a task in n copies.

    Args:
        task: the task.
        n: number of copies.
        engine: as in `Simulation`.
    """

    def __init__(self, task: Task, n: int, engine: str):
        self.task, self.n = task, n
        self.copies = Copies(n, engine, task.strain)
        self.memory = task.memory(n)
        self.truth = {name: np.zeros(n) for name in task.ranges}
        bounds = np.array([(q.low, q.high) for q in task.observations])
        self._low, self._high = bounds.T
        self.handles = self.copies.handles()

    def reset(
        self,
        which: Sequence[int],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any] | None,
    ) -> None:
        """Starts episodes.

        Args:
            which: numbers of the copies.
            generators: random generator of each copy.
            options: values to use instead of drawn ones; None for none.
        """
        drawn = [draw(self.task.ranges, rng, options) for rng in generators]
        self.copies.reset(which, [self.task.scenario(truth) for truth in drawn])
        for i, truth, rng in zip(which, drawn, generators, strict=True):
            self.task.begin(self.memory, i, truth, rng)
            self._keep(i, truth)
        self.handles = self.copies.handles()

    def _keep(self, i: int, truth: Truth) -> None:
        for name, value in truth.items():
            self.truth[name][i] = value

    def observe(self) -> np.ndarray:
        """Present observations, clipped to their bounds, shape (n, m), float32."""
        found = self.task.observe(self.memory, self.handles)
        found = np.minimum(np.maximum(found, self._low), self._high).astype(np.float32)
        found[np.isnan(found)] = 0.0
        return found

    def step(self, actions: np.ndarray, live: np.ndarray) -> Period:
        """Advances by one control period.

        Args:
            actions: actions, shape (n, k), clipped to -1 to 1.
            live: which copies advance, shape (n,); results of the others are meaningless.
        """
        clipped = np.minimum(np.maximum(np.asarray(actions, np.float64), -1.0), 1.0)
        clipped[np.isnan(clipped)] = 0.0
        command = self.task.command(self.memory, clipped)
        self.copies.advance(self.task.steps, command, live)
        self.handles = self.copies.handles()
        rewards, ended, info = self.task.judge(self.memory, self.handles, clipped)
        return Period(self.observe(), rewards, ended, info)

    def truth_of(self, i: int) -> Truth:
        """The numbers drawn for a copy, by name.

        Args:
            i: number of the copy.
        """
        return {name: float(x[i]) for name, x in self.truth.items()}

    def info(self) -> Arrays:
        """The numbers drawn, by name, shape (n,) each."""
        return {name: x.copy() for name, x in self.truth.items()}
