"""One run: the engine steps the arm, the loop closes around it, the record keeps the result."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import ParameterError, choice, integer
from ..model.scenario import Scenario
from ..stepping.engine import Run, warnings_caught
from ..stepping.leapfrog import Leapfrog
from ..stepping.runge_kutta import RungeKutta
from ..stepping.sampled import Sampled
from . import record

ENGINES = ("auto", "python", "native")
STAGES = 15  # steps of the fast run that one of the accurate run costs
SAMPLE, WIRE = (
    470,
    480,
)  # bytes that a run needs at its end, measured: a sample kept; a step, where there is hardware
SMALL_MEMORY = 2.0**28  # [bytes] runs that need less need not ask what there is
NATIVE_FROM = (
    300_000  # steps from which loading the compiled loop (a second, once per process) pays
)


def simulate(
    scenario: Scenario,
    *,
    every: int = 1,
    progress: Callable[[float, float], bool | None] | None = None,
    engine: str = "auto",
) -> record.Record:
    """Runs a scenario to its end.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        progress: called now and then with (simulated time [s], handle x [m]); True ends the run, as
            "interrupted".
        engine: "python"; "native", compiled (needs hapticclay[fast]; scenes that it cannot run are
            run by Python, with a notice); or "auto", native where it is installed and the run may
            take 300000 steps or more (20000 of "accurate").

    Returns:
        The record. Instability and its like are outcomes (record.status), not exceptions.

    Raises:
        ParameterError: an argument is of the wrong kind, numba is not installed, the scene is too
            stiff for its integrator, or the record may not fit into memory.
    """
    if not isinstance(scenario, Scenario):
        raise ParameterError("scenario", scenario, "must be a Scenario, as constant_cut() returns")
    every = integer("every", every, 1, 1_000_000)
    _check_memory(scenario, every)
    with warnings_caught():
        kind = _stepper(scenario, choice("engine", engine, ENGINES))
        run = kind(scenario, every)
        begin = time.perf_counter()
        run.go(progress)
        wall = time.perf_counter() - begin
    return record.Record.of(run, wall)


def _check_memory(scenario: Scenario, every: int) -> None:
    """Refuses a run whose record would not fit into memory if it lasted for t_max."""
    steps = scenario.t_max / scenario.dt
    fixed = WIRE * steps if scenario.interface else 0.0
    samples = math.floor(steps / every) + 2
    if fixed + SAMPLE * samples < SMALL_MEMORY or fixed + SAMPLE * samples < (
        room := memory_left()
    ):
        return
    took, left = (fixed + SAMPLE * samples) / 1e9, max(room, 0.0) / 1e9
    need = f"{took:.3g} GB of memory, and {left:.3g} GB are left"
    if (
        room > 2.0 * fixed
        and (more := math.ceil(1.1 * SAMPLE * steps / (room - fixed))) <= 1_000_000
    ):
        bound = f"up to {samples} samples take {need}: keep fewer (--every {more}), or lower t_max"
        raise ParameterError("every", every, bound)
    raise ParameterError(
        "t_max", scenario.t_max, f"up to {math.floor(steps)} steps take {need}: lower it"
    )


def _stepper(scenario: Scenario, engine: str) -> type[Run]:
    """The class that runs this scenario."""
    if not native_fits(scenario) and not native_marches(scenario):
        if engine == "native":
            print(
                f"hapticclay: native runs no {_not_native(scenario)}; Python does", file=sys.stderr
            )
        if scenario.interface:
            from ..stepping.sampled import HardwareLoop  # only a run with hardware pays for it

            return HardwareLoop
        return Sampled if scenario.control == "sampled" else RungeKutta
    if engine == "native" and not has_numba():
        raise ParameterError("engine", engine, NUMBA)
    accurate = native_marches(scenario)
    work = scenario.t_max / scenario.dt * (STAGES if accurate else 1)
    compile_it = engine == "native" or (engine == "auto" and work >= NATIVE_FROM and has_numba())
    native = load_compiled(accurate) if compile_it else None
    if accurate:
        return native.NativeRungeKutta if native else RungeKutta
    return native.NativeLeapfrog if native else Leapfrog


def _not_native(scenario: Scenario) -> str:
    """The feature of a scenario that native does not have."""
    return (
        "sampled control"
        if scenario.control == "sampled"
        else "'accurate' run that is driven or whose clay grows"
    )


def load_compiled(accurate: bool = False) -> Any:
    """Imports the compiled loop; prints a line that says why, where this fails.

    Args:
        accurate: whether for an accurate run.

    Returns:
        The module stepping.compiled; None where it fails.
    """
    try:
        from ..stepping import compiled

        compiled.warm(accurate)
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


def native_fits(scenario: Scenario) -> bool:
    """Whether the compiled leapfrog can run a scenario: continuous control, fast integrator.

    Args:
        scenario: the scenario.
    """
    return scenario.control == "continuous" and scenario.integrator == "fast"


def native_marches(scenario: Scenario) -> bool:
    """Whether the compiled Runge-Kutta can run a scenario: accurate, and nothing changes with time.

    Args:
        scenario: the scenario.
    """
    clay = scenario.clay
    grows = clay is not None and any((*(clay.x.growth or ()), *(clay.y.growth or ())))
    driven = scenario.muscle is not None or scenario.command is not None
    return (
        scenario.control == "continuous"
        and scenario.integrator == "accurate"
        and not (grows or driven)
    )


NUMBA = "needs numba: pip install hapticclay[fast]"


def has_numba() -> bool:
    """Whether the compiled loop is available."""
    return importlib.util.find_spec("numba") is not None


GROUPS = (  # limit and use of a control group (of containers), version 2 and version 1
    ("sys/fs/cgroup/memory.max", "sys/fs/cgroup/memory.current"),
    ("sys/fs/cgroup/memory/memory.limit_in_bytes", "sys/fs/cgroup/memory/memory.usage_in_bytes"),
)


def memory_left(root: Path = Path("/")) -> float:
    """Bytes that this process may still take, by machine, container and ulimit; inf if unknown.

    Args:
        root: root of the file system.
    """
    return min(
        _machine(root),
        *(_group(root / most, root / taken) for most, taken in GROUPS),
        _process(root),
    )


def _machine(root: Path) -> float:
    with contextlib.suppress(OSError, ValueError, StopIteration):
        lines = (root / "proc/meminfo").read_text().splitlines()
        return 1024.0 * int(next(x for x in lines if x.startswith("MemAvailable:")).split()[1])
    with contextlib.suppress(
        AttributeError, OSError, ValueError
    ):  # not Linux: all there is, if that is said
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return math.inf


def _group(most: Path, taken: Path) -> float:
    with contextlib.suppress(OSError, ValueError):  # no such group, or "max"
        cache = 0
        for line in most.with_name("memory.stat").read_text().splitlines():
            name, _, value = line.partition(" ")
            if name in ("inactive_file", "total_inactive_file"):  # given back when asked for
                cache = int(value)
        return float(int(most.read_text()) - int(taken.read_text()) + cache)
    return math.inf


def _process(root: Path) -> float:
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            pages = int((root / "proc/self/statm").read_text().split()[0])
            return float(limit - pages * resource.getpagesize())
    return math.inf
