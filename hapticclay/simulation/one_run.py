"""One run as the scenario defines it, without a search for the step of a requested error."""

from __future__ import annotations

import math

from ..errors import ParameterError
from ..kernel.engine import warnings_caught
from ..model.sampled_controller import Controller
from ..scene.scenario import Scenario
from .engines import engine_for
from .memory import memory_left
from .record import Record
from .run import Progress, borrowed_workspace, completed

SAMPLE = 430  # bytes per kept sample at the end of a run, measured
SMALL_MEMORY = 2.0**28  # [bytes] smaller runs skip the check of memory


def run_once(
    scenario: Scenario,
    every: int,
    engine: str,
    progress: Progress | None = None,
) -> Record:
    """Runs a scenario to its end, with its own integrator and dt."""
    check_memory(scenario, every)
    if isinstance(scenario.controller, Controller):
        scenario.controller.function()  # refused before a run is made
    engine = engine_for(engine, scenario.t_max / scenario.dt)
    with warnings_caught(), borrowed_workspace() as workspace:
        return Record.of(*completed(scenario, every, engine, workspace, progress))


def check_memory(scenario: Scenario, every: int) -> None:
    """Refuses a run whose record would not fit into memory if it lasted for t_max."""
    steps = scenario.t_max / scenario.dt
    samples = math.floor(steps / every) + 2
    if SAMPLE * samples < SMALL_MEMORY or SAMPLE * samples < (room := memory_left()):
        return
    took, left = SAMPLE * samples / 1e9, max(room, 0.0) / 1e9
    need = f"{took:.3g} GB of memory, and {left:.3g} GB are left"
    more = math.ceil(1.1 * SAMPLE * steps / room) if room > 0.0 else math.inf
    if more <= 1_000_000:
        bound = f"up to {samples} samples take {need}: keep fewer (--every {more}), or lower t_max"
        raise ParameterError("every", every, bound)
    raise ParameterError(
        "t_max", scenario.t_max, f"up to {math.floor(steps)} steps take {need}: lower it"
    )
