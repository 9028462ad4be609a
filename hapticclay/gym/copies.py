"""The runs behind an environment: one for each copy, advanced together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..scene.scenario import Scenario
from ..simulation.stepwise import Simulation
from .task import Command, Handles


class Copies:
    """Runs that advance together by control periods.

    Args:
        n: number of copies.
        engine: as in `Simulation`.
    """

    def __init__(self, n: int, engine: str):
        self.n, self.engine = n, engine
        self._runs: list[Simulation | None] = [None] * n

    def reset(self, which: Sequence[int], scenarios: Sequence[Scenario]) -> None:
        """Begins runs anew.

        Args:
            which: numbers of the copies.
            scenarios: of each.
        """
        for i, scenario in zip(which, scenarios, strict=True):
            run = self._runs[i]
            if run is None:
                self._runs[i] = Simulation(scenario, engine=self.engine)
            else:
                run.reset(scenario)

    def advance(self, steps: int, command: Command, live: np.ndarray) -> None:
        """Makes a control period.

        Args:
            steps: engine steps in it.
            command: what acts.
            live: which copies go on, shape (n,).
        """
        for i in np.flatnonzero(live).tolist():
            run = self._runs[i]
            if run is None:
                continue
            if command.gain is not None and run.outcome is None:
                x, y = command.gain[i].tolist()
                run.set(gain=(x, y))
            x, y = command.force[i].tolist()
            run.advance(steps, force=(x, y))

    def handles(self) -> Handles:
        """The handles now."""
        n = self.n
        p, v, fh, fe = np.zeros((4, n, 2))
        diverged = np.zeros(n, bool)
        for i, run in enumerate(self._runs):
            if run is None:
                continue
            s = run.state
            p[i], v[i], fh[i], fe[i] = s.p, s.v, s.fh, s.fe
            diverged[i] = run.outcome is not None or run.diverging
        return Handles(p, v, fh, fe, diverged)

    def close(self) -> None:
        """Ends the runs."""
        self._runs = [None] * self.n
