"""A run step by step, for a loop of one's own around it."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..errors import ParameterError, integer, pair
from ..model.plausible import warn_of
from ..model.scenario import Scenario
from ..stepping.engine import warnings_caught
from .run import PLAIN, Kernel, Run, Snapshot, borrowed_store

MOST = 1e6  # largest force [N] and torque [N.m] that may be given
LOOK = 0.02  # [s] of simulated time between two looks at whether the run diverges


class Sample(NamedTuple):
    """The state at a sample, as a row of a `Record`."""

    t: float
    p: np.ndarray
    v: np.ndarray
    fh: np.ndarray
    fe: np.ndarray
    b: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    delta: np.ndarray


@checked
class Simulation:
    """A run that makes steps when it is told to, to the same numbers as `simulate`.

    Args:
        scenario: what to run.
    """

    def __init__(self, scenario: Scenario, kernel: Kernel = PLAIN):
        self._kernel, self._lock = kernel, threading.Lock()
        self._begin(scenario)

    def _begin(self, scenario: Scenario) -> None:
        if not isinstance(scenario, Scenario):
            bound = "must be a Scenario, as constant_cut() returns"
            raise ParameterError("scenario", scenario, bound)
        warn_of(scenario)
        self._store = borrowed_store(self._kernel)
        self._run = Run(scenario, 1, self._kernel, self._store.__enter__(), watched=True)
        self._wall, self._looked, self._diverging = 0.0, -np.inf, False
        self._state: Sample | None = None
        self._record: Any = None

    @contextlib.contextmanager
    def _alone(self) -> Iterator[Run]:
        """The run, for this thread alone."""
        if not self._lock.acquire(blocking=False):
            raise RuntimeError("another thread uses this simulation: give each thread its own")
        try:
            if self._store is None:
                raise RuntimeError("the simulation is closed")
            yield self._run
        finally:
            self._lock.release()

    def advance(
        self,
        n: int = 1,
        *,
        force: Sequence[float] | None = None,
    ) -> None:
        """Makes n steps under the same action; fewer where the run ends.

        Args:
            n: number of steps, at least 1.
            force: as in `step`.
        """
        n = integer("n", n, 1, 1_000_000_000)
        with self._alone() as run:
            if run.outcome is not None:
                return
            if force is not None:
                force = pair("force", force, -MOST, MOST, unit="N")
                if force != run.scenario.force:
                    run.change_force(force)
            self._state, began = None, time.perf_counter()
            run.pause = run.i + n
            with warnings_caught():
                run.go(None)
            self._wall += time.perf_counter() - began

    step = advance

    def snapshot(self) -> Snapshot:
        """The run as it is now, to `restore`; it can be pickled."""
        with self._alone() as run:
            return run.snapshot()

    def restore(self, snapshot: Snapshot) -> None:
        """Goes back to a snapshot.

        Args:
            snapshot: of this simulation, or of one of the same scenario.
        """
        with self._alone() as run:
            run.return_to(snapshot)
            self._state, self._record, self._looked = None, None, -np.inf

    def set(self, **changes: Any) -> None:
        """Goes on with other values.

        Args:
            changes: gain, operator, force.
        """
        with self._alone() as run:
            run.change(replace(run.scenario, **changes))
            self._state = None

    def reset(self, scenario: Scenario | None = None) -> None:
        """Begins anew.

        Args:
            scenario: what to run; None for the same.
        """
        with self._alone() as run:
            self._store.__exit__(None, None, None)
            self._begin(scenario or run.scenario)

    @property
    def diverging(self) -> bool:
        """Whether the monitor finds the run unstable; it looks each 20 ms of simulated time."""
        run = self._run
        if run.outcome is None and run.t >= self._looked + LOOK:
            self._looked, self._diverging = run.t, run.is_diverging()
        return self._diverging or (run.outcome is not None and run.outcome.code in ("diverged", "limit cycle"))

    @property
    def state(self) -> Sample:
        """The present sample."""
        if self._state is None:
            found = {"t": np.array([self._run.i * self._run.scenario.dt]), **self._run.ahead()}
            self._state = Sample(**{name: x[-1] for name, x in found.items()})
        return self._state
