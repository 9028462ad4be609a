"""The runs behind an environment: one for each copy, advanced together by one call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model.constants import TORQUE_LIMIT
from ..scene.scenario import Scenario
from ..simulation.simulation_batch import SimulationBatch
from .task import Command, Handles


class Copies:
    """Runs that advance together by control periods.

    Args:
        n: number of copies.
        engine: as in `SimulationBatch`.
        strain: share of the torque limit from which on a run counts as unstable.
    """

    def __init__(self, n: int, engine: str, strain: float):
        self.n, self.engine, self.most = n, engine, strain * np.array(TORQUE_LIMIT)
        self._runs: SimulationBatch | None = None

    def reset(self, which: Sequence[int], scenarios: Sequence[Scenario]) -> None:
        """Begins runs anew; at first all of them.

        Args:
            which: numbers of the copies.
            scenarios: of each.
        """
        if self._runs is None:
            given = dict(zip(which, scenarios, strict=True))
            first = [given.get(i, scenarios[0]) for i in range(self.n)]
            self._runs = SimulationBatch(first, engine=self.engine)
        else:
            self._runs.reset(list(which), list(scenarios))

    def advance(self, steps: int, command: Command, live: np.ndarray) -> None:
        """Makes a control period.

        Args:
            steps: engine steps in it.
            command: what acts.
            live: which copies go on, shape (n,).
        """
        if self._runs is None or not live.any():
            return
        if command.gain is not None:
            self._runs.set(live, gain=command.gain[live])
        self._runs.advance(steps, force=command.force, mask=live)

    def handles(self) -> Handles:
        """The handles now.

        A run diverges where it is over, as out of reach, or faster than 20 m/s, and where a motor
        needs a torque that no stable run of the task does. The monitor of a run is not asked: under
        a muscle that jumps with each action it takes growing swings for growth.
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
