"""The engine that makes the steps of a run: CPython, machine code, or one after the other."""

from __future__ import annotations

import importlib.util
import sys
from typing import Any

from ..errors import ParameterError
from ..scene.scenario import Scenario
from ..stepping import scene
from ..stepping.machine_code import kind_of, loading_time, ready_time
from ..stepping.run import PLAIN, Kernel, Run, plainly

ENGINES = ("auto", "python", "native")
# measured: time that machine code saves in a step, and in clay that stays cut; to import numba [s]
SAVED, SAVED_IN_GROOVE = {"continuous": 50e-6, "sampled": 90e-6, "accurate": 150e-6}, 400e-6
IMPORTING = 0.4
TRIED = 128  # rows made in CPython between two checks whether machine code repays itself
saved: dict[Any, float] = {}  # time that it would have saved in this process, by kind of scene [s]


def kernel_for(scenario: Scenario, engine: str) -> Kernel:
    """How the steps of a run are made.

    Args:
        scenario: what to run.
        engine: as in `simulate`.

    Raises:
        ParameterError: numba is not installed.
    """
    if engine == "native" and not has_numba():
        raise ParameterError("engine", engine, NUMBA)
    if engine == "python" or not has_numba():
        return PLAIN
    kind = kind_of(scene.parts_of(scenario))
    if engine == "auto" and not repays(kind, time_ahead(scenario, 0) + saved.get(kind, 0.0)):
        return AUTO
    compiled = load_compiled()
    return compiled.KERNEL if compiled else PLAIN


def time_ahead(scenario: Scenario, i: int) -> float:
    """Time that machine code may save in the rest of a run [s].

    Half of the rest counts, as runs tend to end before t_max.

    Args:
        scenario: what to run.
        i: index of the present sample.
    """
    return 0.5 * saved_in_a_step(scenario) * max(scenario.t_max / scenario.dt - i, 0.0)


def repays(kind: Any, time: float) -> bool:
    """Whether machine code that saves some time repays loading or compiling it.

    Args:
        kind: of scene.
        time: in this process, so far and ahead [s].
    """
    compiled = sys.modules.get("hapticclay.stepping.compiled")
    if compiled is not None and kind in compiled.ready:
        return has_numba()
    return outweighs(time, kind) and has_numba()


def outweighs(time: float, kind: Any) -> bool:
    """Whether some time is longer than that to load or compile machine code of a kind.

    Args:
        time: the time [s].
        kind: from `kind_of`, or (CARRY, kind, ...).
    """
    compiled = sys.modules.get("hapticclay.stepping.compiled")
    if compiled is None:
        time -= IMPORTING
    if time < loading_time(kind) or not has_numba():  # not even to load it: no look at the disk
        return False
    return time >= ready_time(kind, started=compiled is not None and bool(compiled.ready))


def pays(scenario: Scenario, steps: float) -> bool:
    """Whether machine code repays loading or compiling it.

    All steps of a kind of scene count that this process has made so far and is about to make.

    Args:
        scenario: what to run.
        steps: number of steps of its kind that are about to be made.
    """
    kind = kind_of(scene.parts_of(scenario))
    return repays_with(kind, 0.5 * saved_in_a_step(scenario) * steps)


def repays_with(kind: Any, more: float) -> bool:
    """As `repays`, with all that machine code would have saved in this process.

    Args:
        kind: of scene.
        more: time that it may save now, which is added to that [s].
    """
    saved[kind] = saved.get(kind, 0.0) + more
    return repays(kind, saved[kind])


def as_it_pays(run: Run, room: int) -> None:
    """Makes steps in CPython, and compiled once machine code repays itself.

    Args:
        run: the run.
        room: largest number of rows.
    """
    kind, s = run.kind, run.scenario
    while True:
        made = run.state.filled
        substeps = max(1.0, (run.steps + made.steps) / max(run.i, 1))
        if repays(kind, time_ahead(s, run.i) * substeps + saved.get(kind, 0.0)):
            if compiled := load_compiled():
                run.kernel = compiled.KERNEL
                run.kernel.advance(run, room)
                return
        plainly(run, min(room, made.rows + TRIED))
        steps = run.state.filled.steps - made.steps
        saved[kind] = saved.get(kind, 0.0) + saved_in_a_step(s) * steps
        if run.state.filled.rows < made.rows + TRIED:  # the run is over, or has no room
            return


AUTO = PLAIN._replace(advance=as_it_pays)


def saved_in_a_step(scenario: Scenario) -> float:
    """Time that machine code saves in a step [s].

    Args:
        scenario: what to run.
    """
    method = "accurate" if scenario.integrator == "accurate" else "continuous"
    each = SAVED["sampled" if scenario.control == "sampled" else method]
    grooved = scenario.clay is not None and scenario.clay.ground is not None
    return each + (SAVED_IN_GROOVE if grooved else 0.0)


def load_compiled() -> Any:
    """Imports the compiled steps; prints a line with the cause if this fails.

    Returns:
        The module stepping.compiled; None where it fails.
    """
    try:
        from ..stepping import compiled

        return compiled
    except (
        ImportError,
        OSError,
        StopIteration,
        AttributeError,
    ) as error:  # of numba, or the engine's library
        print(
            f"hapticclay: Python runs what native cannot: {error or type(error).__name__}",
            file=sys.stderr,
        )
        return None


NUMBA = "needs numba: pip install hapticclay[fast]"


def has_numba() -> bool:
    """Whether compiled steps are available."""
    return importlib.util.find_spec("numba") is not None
