"""One run: the engine steps the arm, the loop closes around it, the record keeps what happened."""

from __future__ import annotations

import time
from collections.abc import Callable

from . import record, scene
from .errors import ParameterError, integer
from .leapfrog import Leapfrog
from .params import Scenario
from .rungekutta import RungeKutta
from .sampled import Sampled


def simulate(
    scenario: Scenario, *, every: int = 1, progress: Callable[[float, float], None] | None = None
) -> record.Record:
    """Runs a scenario to its end.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        progress: called now and then with (simulated time [s], handle x [m]).

    Returns:
        The record. Instability and its like are outcomes (record.status), not exceptions.

    Raises:
        ParameterError: scenario or every is of the wrong kind, or the scene too stiff for its integrator.
    """
    if not isinstance(scenario, Scenario):
        raise ParameterError("scenario", scenario, "must be a Scenario, as constant_cut() returns")
    every = integer("every", every, 1, 1_000_000)
    with scene.warnings_caught():
        kind = RungeKutta if scenario.integrator == "accurate" else Leapfrog
        if scenario.control == "sampled":
            kind = _wired() if scenario.interface else Sampled
        run = kind(scenario, every)
        begin = time.perf_counter()
        run.go(progress)
        wall = time.perf_counter() - begin
    return run.result(wall)


def _wired() -> type[Sampled]:
    from .wired import Wired  # only a run with hardware pays for it

    return Wired
