"""Compiled runs: numba compiles the loops that CPython runs, and the laws they call.

They call the engine's own functions and hold no lock, so runs go on in parallel threads. The
machine code is kept on disk, in a folder named after the sources it was made from.
"""

from __future__ import annotations

import contextlib
import ctypes
import dis
import functools
import inspect
import math
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numba.core import types
from numba.extending import overload, overload_method, register_jitable

from ..model import (
    arm,
    clay,
    compensator,
    controller,
    flow,
    groove,
    hardware,
    operator,
    pieces,
    regions,
    spring,
)
from ..model.sampled_controller import DESK, TORQUE, LawCaller
from ..model.scenario import Scenario
from . import cache, energy, leapfrog, loop, many, modes, monitor, path, run, runge_kutta, sampled
from .engine import mujoco
from .notice import Notice

SOURCES = (
    arm, clay, compensator, controller, flow, groove, hardware, operator, regions, pieces, spring,
    energy, leapfrog, loop, many, modes, monitor, path, runge_kutta, sampled,
)  # fmt: skip
LOOPS = (leapfrog.Leapfrog, runge_kutta.RungeKutta, sampled.Sampled)
LAW: Any = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}
TOLD = {  # name of a kind of run; processor time to compile its path, its whole steps [s], measured
    "LeapfrogRun": ("fast runs", 80.0, 40.0),
    "RungeKuttaRun": ("accurate runs", 70.0, 25.0),
    "SampledRun": ("sampled runs", 85.0, 85.0),
}
LAST_ONLY = 1_000_000_000  # keep each so-many-th sample, and the last: the last alone
BORDERS = 2000  # that a run has met from which it pays to compile the whole path
BLOCK = 256  # whole steps between two entries into the record: they stay in the cache


def _register() -> None:
    """Lets numba find the source of every law and of every method."""
    own = {leapfrog.tabulate: leapfrog.tabulate_each}
    for module in SOURCES:
        for law in vars(module).values():
            if isinstance(law, FunctionType) and law.__module__ == module.__name__:
                body = own.get(law, law)
                overload(law, jit_options=LAW, strict=False)(lambda *args, body=body: body)
    method: Any = overload_method
    named = {name: law for m in LOOPS for name, law in vars(m).items()}
    for name, law in named.items():
        if isinstance(law, FunctionType) and not name.startswith("_"):
            choice = _choice(name, inspect.signature(law))
            method(types.NamedUniTuple, name, jit_options=LAW, strict=False)(choice)
    for put in (leapfrog.put_raw, leapfrog.put_varied, runge_kutta.put_sample):
        overload(put, jit_options=LAW, strict=False)(lambda rows, at, *row: _put_row)
    parts = path, runge_kutta, sampled
    puts = [f for m in parts for x, f in vars(m).items() if re.match(r"put\d", x)]
    for put in {id(f): f for f in puts}.values():
        overload(put, jit_options=LAW, strict=False)(lambda array, at, *x: _put)


def _choice(name: str, signature: inspect.Signature) -> Any:
    """What numba asks for the source of a method."""

    def choose(self, *args):
        return vars(self.instance_class).get(name)

    choose.__signature__ = signature  # type: ignore[attr-defined]
    return choose


def _put(array, at, *x):
    for j in range(len(x)):
        array[at // 8 + j] = x[j]


def _put_row(rows, at, *row):
    i = at // (8 * len(row))
    for j in range(len(row)):
        rows[i, j] = row[j]


def _mark(kind: type[run.Run], whole: bool) -> Path:
    """A file that says that this machine code is kept on disk; the null device if it is not."""
    with contextlib.suppress(OSError, RuntimeError):  # without a home
        if (folder := run.cache_folder()) not in cache.lost:
            return folder / f"{kind.__name__}.{'whole' if whole else 'mixed'}"
    return Path(os.devnull, "nothing")


def _compiled(*functions: Any) -> list[Any]:
    """The functions, each to be compiled when first called, or taken from the disk."""
    options: Any = {"nogil": True, "error_model": "numpy", "_nrt": False}
    made = [numba.njit(**options)(f) for f in functions]
    with contextlib.suppress(OSError, RuntimeError):  # nowhere to keep them
        for dispatcher in made:
            dispatcher._cache = cache.FileCache(dispatcher.py_func, run.cache_folder())
    return made


_register()
_advance, _leap, _vary, _march, _calm = _compiled(
    many.advance_or_carry,
    leapfrog.leap_block,
    leapfrog.vary,
    runge_kutta.march_block,
    monitor.is_quiet,
)


def _library() -> ctypes.CDLL:
    return ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("*mujoco.*"))))


def _function(name: str) -> Any:
    found = getattr(LIBRARY, name)
    found.argtypes, found.restype = [ctypes.c_size_t, ctypes.c_size_t], None
    return found


LIBRARY = _library()
STEP, FORWARD, RESET = _function("mj_step"), _function("mj_forward"), _function("mj_resetData")


class _Mixed:
    """A method whose whole steps are compiled, on a path that CPython runs."""

    native: path.Engine
    law: Any

    def block(self, s, e, n):
        s.push()
        made = self.law(s.record, self.native, n)
        s.pull()
        return made


class _MixedLeapfrog(_Mixed, leapfrog.Leapfrog):
    law = staticmethod(_leap)

    def vary(self, s, e, n):
        s.push()
        _vary(s.record, self.native, n)


class _MixedRungeKutta(_Mixed, runge_kutta.RungeKutta):
    law = staticmethod(_march)


MIXED_OF: dict[type, Any] = {
    leapfrog.Leapfrog: _MixedLeapfrog,
    runge_kutta.RungeKutta: _MixedRungeKutta,
}


def _mixed(run: Any, room: int) -> None:
    met = len(run.crossings)
    if met >= BORDERS:
        warm(type(run))
        run.kernel = WHOLE
        return _whole(run, room)
    method = MIXED_OF[type(run.method)]()
    method.native = run.native
    path.advance(method, run.s, run.e, room)


def _whole(run: Any, room: int) -> None:
    run.s.push()
    _advance(run.method, run.s.record, run.native, room, _no_runs(type(run)))
    run.s.pull()


@functools.cache
def _no_runs(kind: type[run.Run]) -> many.ManyRuns:
    states: Any = np.zeros(0, run.state_type(kind))
    return many.ManyRuns.of(states, np.zeros((0, 0)), np.zeros((0, 4)), np.zeros((0, 2)), RESET)


def _handles(model: Any, data: Any) -> tuple[Any, ...]:
    return STEP, FORWARD, model._address, data._address


CALL = ctypes.CFUNCTYPE(None, ctypes.c_size_t)
NO_LAW = ctypes.cast(STEP, CALL)  # any address: it is never called


def own_law(caller: LawCaller | None, desk: np.ndarray) -> tuple[Any, Any]:
    """Law and data of Engine: the function of a controller, compiled if it can be.

    Args:
        caller: of the law; None for none.
        desk: what it shares with the loop.
    """
    if caller is None:
        return NO_LAW, 0
    controller = caller.controller
    n, m = len(controller.state), len(controller.params)
    compiled = _compile_law(caller.law, n, m, _outside(caller.law))
    if compiled is not None:
        return CALL(compiled.address), desk.ctypes.data
    caller.pointer = CALL(caller)  # lives as long as its run
    return caller.pointer, desk.ctypes.data


@functools.lru_cache(maxsize=64)
def _compile_law(law: Any, n: int, m: int, outside: tuple[Any, ...]) -> Any:
    """A C function that reads the desk, calls the law and writes what it returns; None if numba
    cannot compile it, and a line says so. What is `outside` the law is a constant in it.
    """
    names = [f"desk[{j}]" for j in range(DESK + 2 * n + m)]
    state, after, params = names[DESK : DESK + n], names[DESK + n :][:n], names[DESK + 2 * n :]
    returned = [f"{x} = state[{j}]" for j, x in enumerate(after)]
    lines = [
        f"desk = carray(pointer, {len(names)})",
        f"desk[{TORQUE}] = desk[{TORQUE + 1}] = nan",  # what a law that raises leaves behind
        "try:",
        " torque, state = law(desk[0], (desk[1], desk[2]), (desk[3], desk[4]), (desk[5], desk[6]), "
        f"{_tuple_of(state)}, {_tuple_of(params)})",
        f" assert_length(state, {n})",
        f" desk[{TORQUE}], desk[{TORQUE + 1}] = torque",
        *(f" {x}" for x in returned),
        "except Exception:",
        " pass",
    ]
    options: Any = {"error_model": "numpy"}
    _let_call(law)
    try:
        if changed := _changed_outside(law):
            raise TypeError(f"it changes {changed}, a variable outside of it")
        scope: dict[str, Any] = {
            "carray": numba.carray,
            "nan": math.nan,
            "law": law if hasattr(law, "py_func") else numba.njit(**options)(law),
            "assert_length": _assert_length,
        }
        exec("def call(pointer):\n    " + "\n    ".join(lines), scope)  # tuples of fixed length
        kind = types.void(types.CPointer(types.float64))
        return numba.cfunc(kind, **options)(scope["call"])
    except (numba.core.errors.NumbaError, TypeError, ValueError, AssertionError) as error:
        said = re.sub(r"\x1b\[[0-9;]*m", "", str(error)).splitlines()  # without its colours
        said = [x.strip() for x in said if x.strip()]
        reason = next((x for x in said if not x.startswith("Failed in nopython mode")), "no reason")
        name = getattr(law, "__qualname__", repr(law))
        print(f"hapticclay: Python runs the controller {name}: {reason}", file=sys.stderr)
        return None


def _outside(law: Any) -> tuple[Any, ...]:
    """Values of the numbers, words and arrays that a law names and that lie outside of it."""
    function = getattr(law, "py_func", law)
    code, scope = getattr(function, "__code__", None), getattr(function, "__globals__", {})
    if code is None:
        return ()
    found = [scope.get(x) for x in code.co_names]
    with contextlib.suppress(ValueError):  # a variable that has no value yet
        found += [cell.cell_contents for cell in function.__closure__ or ()]
    arrays = [(x.dtype.str, x.shape, x.tobytes()) for x in found if isinstance(x, np.ndarray)]
    return *(repr(x) for x in found if isinstance(x, int | float | str | tuple)), *arrays


def _changed_outside(law: Any) -> str:
    """The first variable of a function around it that a law changes; "" for none."""
    code = getattr(getattr(law, "py_func", law), "__code__", None)
    free = code.co_freevars if code else ()
    steps = dis.get_instructions(code) if free and code else ()
    return next((x.argval for x in steps if x.opname == "STORE_DEREF" and x.argval in free), "")


def _let_call(law: Any) -> None:
    """Lets compiled code call the plain functions that a law names, as Python does."""
    code, scope = getattr(law, "__code__", None), getattr(law, "__globals__", {})
    for name in code.co_names if code else ():
        found = scope.get(name)
        ours = getattr(found, "__module__", "").startswith("hapticclay.")  # registered above
        if not isinstance(found, FunctionType) or ours or found in LET:
            continue
        if not _changed_outside(found):
            LET.add(found)
            register_jitable(error_model="numpy")(found)
            _let_call(found)


LET: set[Any] = set()  # functions that compiled code has been let call


def _tuple_of(names: list[str]) -> str:
    return f"({''.join(x + ', ' for x in names)})"


def _assert_length(state, n):
    raise NotImplementedError


@overload(_assert_length)
def _typed_length(state, n):
    if not isinstance(state, types.BaseTuple) or not isinstance(n, types.IntegerLiteral):
        raise numba.core.errors.TypingError("state must be a tuple")
    if len(state) != n.literal_value:
        raise numba.core.errors.TypingError(
            f"state must have {n.literal_value} numbers, not {len(state)}"
        )
    return lambda state, n: None


MIXED = run.Kernel(_mixed, BLOCK, _handles, _calm, own_law)
WHOLE = run.Kernel(_whole, BLOCK, _handles, _calm, own_law)


class BatchPool:
    """What the threads of a batch share, and what each has of its own.

    Args:
        every: keep each every-th sample, and the last.
    """

    def __init__(self, every: int):
        self.every = every
        self.own = threading.local()

    def _go(self, scenario: Scenario, every: int, brief: bool) -> tuple[run.Run, float]:
        """The run, made by this thread's engines, and the seconds it took."""
        return run.completed(scenario, every, WHOLE, self.store(), None, brief)

    def store(self) -> run.EngineStore:
        """The engines of this thread."""
        if not hasattr(self.own, "store"):
            self.own.store = run.EngineStore(WHOLE)
        return self.own.store

    def run(self, scenario: Scenario) -> tuple[run.Run, float]:
        """Makes a run.

        Args:
            scenario: what to run.

        Returns:
            The run, and the seconds it took.
        """
        return self._go(scenario, self.every, False)

    def brief(self, scenario: Scenario) -> tuple[Any, ...]:
        """The end of a run, without its samples.

        Args:
            scenario: what to run.

        Returns:
            As Run.brief.
        """
        return self._go(scenario, LAST_ONLY, True)[0].brief()

    def many(
        self, scenarios: Sequence[Scenario]
    ) -> tuple[list[tuple[np.ndarray, dict[str, Any]]], list[int]]:
        """Makes short runs of one kind together, without their samples.

        Args:
            scenarios: what to run.

        Returns:
            As many.Lane.make.
        """
        if not hasattr(self.own, "lane"):
            self.own.lane = many.Lane(WHOLE, self.store(), _advance, RESET)
        return self.own.lane.make(scenarios)


def kernel(scenario: Scenario) -> run.Kernel:
    """What runs a scenario fastest, compiled or loaded before it begins.

    Args:
        scenario: the scenario.
    """
    kind = run.kind_of(scenario)
    if _mixes(kind) and not (kind in WARM or _mark(kind, True).exists()):
        warm(kind, False)  # what surrounds the whole steps is rare, and takes longest to compile
        return MIXED
    warm(kind)
    return WHOLE


def is_warm(kind: type[run.Run]) -> bool:
    """Whether machine code for a kind of run is loaded.

    Args:
        kind: the kind.
    """
    return kind in WARM or (_mixes(kind) and bool(MIXED_OF[type(kind.method)].law.signatures))


def _mixes(kind: type[run.Run]) -> bool:
    return type(kind.method) in MIXED_OF


WARM: set[type[run.Run]] = set()  # whose whole path is compiled in this process


@functools.cache
def warm(kind: type[run.Run], whole: bool = True) -> None:
    """Compiles, or loads the machine code, before the first run; Ctrl-C waits for the end of it.

    Args:
        kind: of the run.
        whole: the whole path, or the whole steps alone.
    """
    caught: list[object] = []
    mine = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, lambda *what: caught.append(what)) if mine else None
    try:
        with _telling(kind, whole):
            kind(EXAMPLES[kind.__name__], 1, WHOLE if whole else MIXED).go(None)
    finally:
        if before is not None:
            signal.signal(signal.SIGINT, before)
    if whole:
        WARM.add(kind)
    with contextlib.suppress(OSError):  # nowhere to keep it
        _mark(kind, whole).touch()
    if caught:
        raise KeyboardInterrupt


@contextlib.contextmanager
def _telling(kind: type[run.Run], whole: bool) -> Iterator[None]:
    """Says that machine code is compiled, once it is: what is taken from the disk needs no word."""
    what, path, steps = TOLD[kind.__name__]
    with Notice(what, path if whole else steps) as notice:
        if not isinstance(_advance._cache, cache.FileCache):  # without a home none can miss it
            notice.begin()
        before = cache.on_miss.set(notice.begin)
        try:
            yield
        finally:
            cache.on_miss.reset(before)


EXAMPLES = {
    "LeapfrogRun": Scenario(t_max=1e-2),
    "RungeKuttaRun": Scenario(t_max=1e-2, integrator="accurate"),
    "SampledRun": Scenario(t_max=1e-2, control="sampled"),
}
