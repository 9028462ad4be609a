"""The simulations of an environment, one per copy, advanced together by one call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model.constants import TORQUE_LIMIT
from ..scene.scenario import Scenario
from ..simulation.simulation_batch import SimulationBatch
from .task import Command, Handles


class Copies:
    """Simulations that advance together by control periods.

    Args:
        n: number of copies.
        engine: as in `SimulationBatch`.
        strain: share of the torque limit beyond which a run counts as unstable.
    """

    def __init__(self, n: int, engine: str, strain: float):
        self.n, self.engine, self.most = n, engine, strain * np.array(TORQUE_LIMIT)
        self._runs: SimulationBatch | None = None

    def reset(self, which: Sequence[int], scenarios: Sequence[Scenario]) -> None:
        """Restarts runs; the first call starts all of them.

        Args:
            which: numbers of the copies.
            scenarios: one scenario per copy.
        """
        if self._runs is None:
            given = dict(zip(which, scenarios, strict=True))
            first = [given.get(i, scenarios[0]) for i in range(self.n)]
            self._runs = SimulationBatch(first, engine=self.engine)
        else:
            self._runs.reset(list(which), list(scenarios))

    def advance(self, steps: int, command: Command, live: np.ndarray) -> None:
        """Advances by one control period.

        Args:
            steps: engine steps per period.
            command: command during the period.
            live: which copies advance, shape (n,).
        """
        if self._runs is None or not live.any():
            return
        if command.gain is not None:
            self._runs.set(live, gain=command.gain[live])
        self._runs.advance(steps, force=command.force, mask=live)

    def handles(self) -> Handles:
        """The present state of the handles.

        A run counts as diverged if it is over (for example out of reach), if it is faster than
        20 m/s, or if a motor needs a torque that no stable run of the task needs. The stability
        monitor of a run is not used: with a muscle force that jumps at each action, it would
        mistake larger swings for growth.
        """
        r = self._runs
        if r is None:
            p, v, fh, fe = np.zeros((4, self.n, 2))
            return Handles(p, v, fh, fe, np.zeros(self.n, bool))
        strained = ~(np.abs(r.tau) < self.most).all(axis=1)
        return Handles(r.p, r.v, r.fh, r.fe, r.ended | strained)

    def close(self) -> None:
        """Ends the runs."""
        if self._runs is not None:
            self._runs.close()
        self._runs = None
