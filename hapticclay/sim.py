"""One run: the engine steps the arm, the loop closes around it, the record keeps what happened."""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Callable
from typing import Any

from . import record, scene
from .errors import ParameterError, choice, integer
from .leapfrog import Leapfrog
from .params import Scenario
from .run import Run
from .rungekutta import RungeKutta
from .sampled import Sampled

ENGINES = ("auto", "python", "native")
NATIVE_FROM = 300_000  # steps from which loading the compiled loop (a second, once per process) pays


def simulate(
    scenario: Scenario,
    *,
    every: int = 1,
    progress: Callable[[float, float], None] | None = None,
    engine: str = "auto",
) -> record.Record:
    """Runs a scenario to its end.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        engine: "python", "native" (compiled, needs hapticclay[fast]; what it cannot do, Python does, and says so) or
            "auto": native where it is installed and the run may take 300000 steps or more.
        progress: called now and then with (simulated time [s], handle x [m]).

    Returns:
        The record. Instability and its like are outcomes (record.status), not exceptions.

    Raises:
        ParameterError: scenario, every or engine is of the wrong kind, numba is not installed, or the scene is too
            stiff for its integrator.
    """
    if not isinstance(scenario, Scenario):
        raise ParameterError("scenario", scenario, "must be a Scenario, as constant_cut() returns")
    every = integer("every", every, 1, 1_000_000)
    with scene.warnings_caught():
        kind = _kind(scenario, choice("engine", engine, ENGINES))
        run = kind(scenario, every)
        begin = time.perf_counter()
        run.go(progress)
        wall = time.perf_counter() - begin
    return run.result(wall)


def _kind(scenario: Scenario, engine: str) -> type[Run]:
    """What runs this scenario."""
    if not fits(scenario):
        if engine == "native":
            print("hapticclay: native runs neither sampled control nor 'accurate'; Python does", file=sys.stderr)
        if scenario.interface:
            from .wired import Wired  # only a run with hardware pays for it

            return Wired
        return Sampled if scenario.control == "sampled" else RungeKutta
    if engine == "native" and not has_numba():
        raise ParameterError("engine", engine, NUMBA)
    if engine == "native" or (engine == "auto" and scenario.t_max / scenario.dt >= NATIVE_FROM and has_numba()):
        native = compiled()
        return native.Native if native else Leapfrog
    return Leapfrog


def compiled() -> Any:
    """The module native, which only a run that takes it pays for; None, and a line that says why, where it fails."""
    try:
        from . import native

        native.warm()
        return native
    except (ImportError, OSError, StopIteration, AttributeError) as error:  # of numba, or the engine's library
        print(f"hapticclay: Python runs what native cannot: {error or type(error).__name__}", file=sys.stderr)
        return None


def fits(scenario: Scenario) -> bool:
    """Whether native can run this: continuous control, the fast integrator."""
    return scenario.control == "continuous" and scenario.integrator == "fast"


NUMBA = "needs numba: pip install hapticclay[fast]"


def has_numba() -> bool:
    """Whether the compiled loop can be had."""
    return importlib.util.find_spec("numba") is not None
