"""One run: the engine steps the arm, the loop closes around it, the record keeps the result."""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Callable
from typing import Any

from ..arguments import checked
from ..errors import ParameterError, choice, integer
from ..scene.plausible import warn_of
from ..scene.scenario import Scenario
from ..stepping import scene
from ..stepping.engine import warnings_caught
from ..stepping.machine_code import compile_time, is_kept, kind_of
from ..stepping.run import PLAIN, Kernel, Run, borrowed_store, completed, plainly
from . import record
from .memory import memory_left

ENGINES = ("auto", "python", "native")
# measured: time that machine code saves in a step, and in clay that stays cut; to load it [s]
SAVED, SAVED_IN_GROOVE = {"continuous": 50e-6, "sampled": 90e-6, "accurate": 150e-6}, 400e-6
LOADING = 0.8
TRIED = 128  # rows made in CPython between two looks at whether machine code repays itself
saved: dict[Any, float] = {}  # time that it would have saved in this process, by kind of scene [s]
SAMPLE = 430  # bytes that a run needs at its end for each sample kept, measured
SMALL_MEMORY = 2.0**28  # [bytes] runs that need less need not ask what there is


@checked
def simulate(
    scenario: Scenario,
    *,
    every: int = 1,
    progress: Callable[[float, float], bool | None] | None = None,
    engine: str = "auto",
    error: float | str | None = None,
) -> record.Record:
    """Runs a scenario to its end.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        progress: called now and then with (simulated time [s], handle x [m]); True ends the run, as
            "interrupted".
        engine: "python"; "native", compiled (needs hapticclay[fast]); or "auto", compiled where
            numba is installed and the machine code is loaded already or the run is long enough to
            repay loading it. All give the same record, bit for bit.
        error: largest error to allow: seconds at the border crossings (1e-6, "1e-6 s"), or metres
            of position ("1e-7 m"), 1e-11 or more. Integrator and dt of the scenario are then
            chosen, finer until runs at other steps confirm the error; record.error says what was
            reached, and progress goes from 0 s on in each run. None to run the scenario as it is.

    Returns:
        The record. Instability and its like are outcomes (record.status), not exceptions.

    Raises:
        ParameterError: an argument is of the wrong kind, numba is not installed, the scene is too
            stiff for its integrator, the record may not fit into memory, the law of its controller
            is not found, or an error in seconds is asked for without a border to cross.
        RuntimeError: the law of its controller raised an exception (`LawFailed`). What is no error,
            as Ctrl-C, is raised as it is.
    """
    every = integer("every", every, 1, 1_000_000)
    warn_of(scenario)
    if error is not None:
        from .accuracy import simulate_within  # only a run that asks for an error pays for it

        return simulate_within(scenario, error, every=every, progress=progress, engine=engine)
    _check_memory(scenario, every)
    if scenario.controller is not None:
        scenario.controller.function()  # refused before anything is compiled
    with warnings_caught():
        kernel = kernel_for(scenario, choice("engine", engine, ENGINES))
        with borrowed_store() as store:
            return record.Record.of(*completed(scenario, every, kernel, store, progress))


def _check_memory(scenario: Scenario, every: int) -> None:
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
    """Time that machine code may save in the rest of a run [s]: half of it, as runs tend to end
    before t_max.

    Args:
        scenario: what to run.
        i: index of the sample at which the run is.
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
    if time < LOADING or not has_numba():
        return False
    return is_kept(kind) or time >= compile_time(kind)


def pays(scenario: Scenario, steps: float) -> bool:
    """Whether machine code repays loading or compiling it: for what this process has run of a kind
    of scene so far, and is about to run.

    Args:
        scenario: what to run.
        steps: how many steps of its kind are about to be made.
    """
    kind = kind_of(scene.parts_of(scenario))
    saved[kind] = saved.get(kind, 0.0) + 0.5 * saved_in_a_step(scenario) * steps
    return repays(kind, saved[kind])


def as_it_pays(run: Run, room: int) -> None:
    """Makes steps in CPython, and from where machine code repays itself, compiled.

    Args:
        run: the run.
        room: rows that it may have.
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
        if run.state.filled.rows < made.rows + TRIED:  # it is over, or has no room
            return


AUTO = PLAIN._replace(advance=as_it_pays)


def saved_in_a_step(scenario: Scenario) -> float:
    """Time that machine code saves in a step [s].

    Args:
        scenario: what to run.
    """
    method = "accurate" if scenario.integrator == "accurate" else "continuous"
    each = SAVED["sampled" if scenario.control == "sampled" else method]
    grooved = scenario.clay is not None and scenario.clay.groove is not None
    return each + (SAVED_IN_GROOVE if grooved else 0.0)


def load_compiled() -> Any:
    """Imports the compiled steps; prints a line that says why, where this fails.

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
