"""Compiled runs: numba compiles the functions that CPython runs, for the parts of a scene.

They call the engine's own functions and hold no lock, so threads run in parallel. The machine code
is stored on disk by the types of its parts, in a folder named by the sources.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import gc
import inspect
import itertools
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple, cast

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, overload
from numba.np import arrayobj

from ..model import (
    arm,
    compensator,
    controller,
    damping,
    flow,
    groove,
    hardware,
    operator,
    pieces,
    regions,
    smooth,
    spring,
)
from ..scene.scenario import Scenario
from . import (
    begin,
    borders,
    cache,
    driver,
    ends,
    energy,
    engine_step,
    friction,
    grooves,
    hand,
    hits,
    instant,
    kick,
    lacking,
    laws,
    many,
    march,
    modes,
    monitor,
    own_law,
    path,
    rows,
    run,
    sampled,
    sampled_controller,
    search,
    servo,
    springs,
    stiff,
    vector,
    viscous,
    yielding,
)
from . import hardware as wires
from .engine import mujoco
from .inlining import EntryCompiler, InlinedCompiler
from .machine_code import (
    COMPLETE,
    cache_folder,
    failures,
    give_up,
    known_time,
    mark,
    ready_time,
)
from .notice import Notice

SOURCES = (
    arm, compensator, controller, damping, flow, groove, hardware, operator, pieces, regions,
    smooth, spring, borders, grooves, hand, hits, kick, path, rows, servo, springs, stiff,
    viscous, yielding,
    engine_step, begin, energy, laws, many, monitor, driver, friction, sampled, sampled_controller,
    wires, ends, instant, march, modes, search, vector,
)  # fmt: skip
LAW: Any = {
    "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False,
    "pipeline_class": InlinedCompiler,
}  # fmt: skip
ENTRY: Any = {
    "nogil": True, "error_model": "numpy", "_nrt": False, "pipeline_class": EntryCompiler,
}  # fmt: skip
SIGNALS = [getattr(signal, x) for x in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, x)]
CAREFUL = 2.5e-4  # measured: time that machine code saves in a careful step [s]
IN_A_ROW = 64  # most steps made in CPython between two calls of machine code that make none


# ---- numbers at an address -----------------------------------------------------------------------


def place_of(builder: Any, address: Any, i: Any) -> Any:
    """Pointer to a number of an array.

    Args:
        builder: of LLVM.
        address: of the array.
        i: index of the number.
    """
    return builder.gep(builder.inttoptr(address, ir.DoubleType().as_pointer()), [i])


@intrinsic
def store(context, address, i, values):  # noqa: ARG001
    """Writes numbers into an array from i on.

    Args:
        context: of what numba compiles.
        address: of the array.
        values: the numbers.
    """

    def generate(context, builder, signature, arguments):
        address, i, tuple_ = arguments
        for j in range(len(signature.args[2])):
            at = builder.add(i, ir.Constant(i.type, j))
            builder.store(builder.extract_value(tuple_, j), place_of(builder, address, at))
        return context.get_dummy_value()

    numbers = types.UniTuple(types.float64, len(values)) if len(values) else values
    return types.none(types.intp, types.intp, numbers), generate


def number_at(context: Any, builder: Any, address: Any, i: int, kind: Any) -> Any:
    """Number i of an array of floats, as one of another type.

    Args:
        context: of what numba compiles.
        builder: of LLVM.
        address: of the array.
        i: index of the number.
        kind: the type.
    """
    number = builder.load(place_of(builder, address, ir.Constant(ir.IntType(64), i)))
    return context.cast(builder, number, types.float64, kind)


def array_at(context: Any, builder: Any, kind: Any, address: Any, shape: Sequence[Any]) -> Any:
    """An array over memory that it does not own.

    Args:
        context: of what numba compiles.
        builder: of LLVM.
        kind: its type, in C order.
        address: of its first element.
        shape: its lengths.
    """
    made = arrayobj.make_array(kind)(context, builder)
    size = context.get_constant(
        types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype))
    )
    strides = [size]
    for n in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], n))
    arrayobj.populate_array(
        made, builder.inttoptr(address, made.data.type), shape=list(shape), strides=strides,
        itemsize=size, meminfo=None,
    )  # fmt: skip
    return made._getvalue()


def filled_with(
    context: Any, builder: Any, kind: Any, value: Any, leaf: Callable[[Any, Any], Any]
) -> Any:
    """A value of nested tuples with each leaf replaced.

    Args:
        context: of what numba compiles.
        builder: of LLVM.
        kind: its type.
        value: the value.
        leaf: returns the new leaf for a leaf of some type.
    """
    if not isinstance(kind, types.BaseTuple):
        return leaf(kind, value)
    kinds: Any = kind
    parts = [
        filled_with(context, builder, x, builder.extract_value(value, j), leaf)
        for j, x in enumerate(kinds)
    ]
    return context.make_tuple(builder, kind, parts)


@intrinsic
def fill(context, like, row):  # noqa: ARG001
    """The tuple `like`, with its numbers replaced by those at an address, in order.

    Args:
        context: of what numba compiles.
        like: the tuple.
        row: the address.
    """

    def generate(context, builder, signature, arguments):
        count = itertools.count()

        def leaf(kind, value):
            if not isinstance(kind, types.Float | types.Integer):
                return value
            return number_at(context, builder, arguments[1], next(count), kind)

        return filled_with(context, builder, signature.args[0], arguments[0], leaf)

    return like(like, types.intp), generate


@intrinsic
def fill_all(context, like, row, places):  # noqa: ARG001
    """As `fill`, with its arrays replaced as well.

    Args:
        context: of what numba compiles.
        like: the tuple.
        row: address of the numbers.
        places: of the arrays, in order: address, number of rows and columns.
    """

    def generate(context, builder, signature, arguments):
        numbers, arrays = itertools.count(), itertools.count()
        first = builder.inttoptr(arguments[2], ir.IntType(64).as_pointer())

        def leaf(kind, value):
            if isinstance(kind, types.Array):
                at = 3 * next(arrays)
                found = [
                    builder.load(builder.gep(first, [ir.Constant(ir.IntType(64), at + j)]))
                    for j in range(3)
                ]
                return array_at(context, builder, kind, found[0], found[1 : 1 + kind.ndim])
            if isinstance(kind, types.Float | types.Integer):
                return number_at(context, builder, arguments[1], next(numbers), kind)
            return value

        return filled_with(context, builder, signature.args[0], arguments[0], leaf)

    return like(like, types.intp, types.intp), generate


@intrinsic
def keep(context, value, row):  # noqa: ARG001
    """Writes the numbers of a tuple to an address, in order; `fill` reads them.

    Args:
        context: of what numba compiles.
        value: the tuple.
        row: the address.
    """

    def generate(context, builder, signature, arguments):
        count = itertools.count()

        def leaf(kind, value):
            if isinstance(kind, types.Float | types.Integer):
                at = place_of(builder, arguments[1], ir.Constant(ir.IntType(64), next(count)))
                builder.store(context.cast(builder, value, kind, types.float64), at)
            return value

        filled_with(context, builder, signature.args[0], arguments[0], leaf)
        return context.get_dummy_value()

    return types.none(value, types.intp), generate


@intrinsic
def copy_bytes(context, to, source, n):  # noqa: ARG001
    """Copies bytes.

    Args:
        context: of what numba compiles.
        to: address.
        source: address.
        n: how many.
    """

    def generate(context, builder, signature, arguments):  # noqa: ARG001
        byte = ir.IntType(8).as_pointer()
        to, source = (builder.inttoptr(x, byte) for x in arguments[:2])
        cgutils.raw_memcpy(builder, to, source, arguments[2], 1)
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.intp), generate


@intrinsic
def rows_at(context, address):  # noqa: ARG001
    """The rows of a record at an address.

    Args:
        context: of what numba compiles.
        address: of the first.
    """

    def generate(context, builder, signature, arguments):
        shape = [context.get_constant(types.intp, x) for x in (run.CHUNK, rows.ROW)]
        made = array_at(context, builder, signature.return_type[0], arguments[0], shape)
        return context.make_tuple(builder, signature.return_type, [made])

    # in a tuple: numba lets a function return no array that was not given to it
    return types.Tuple([types.Array(types.float64, 2, "C")])(types.intp), generate


@intrinsic
def load_pair(context, address):  # noqa: ARG001
    """The first two numbers of an array.

    Args:
        context: of what numba compiles.
        address: of the array.
    """

    def generate(context, builder, signature, arguments):
        at = [ir.Constant(ir.IntType(64), j) for j in range(2)]
        found = [builder.load(place_of(builder, arguments[0], i)) for i in at]
        return context.make_tuple(builder, signature.return_type, found)

    return types.UniTuple(types.float64, 2)(types.intp), generate


# ---- sources -------------------------------------------------------------------------------------


@functools.cache
def shape_of(kind: Any) -> lacking.Shape:
    """The parts that an argument has, by its type.

    Args:
        kind: of numba.
    """
    if isinstance(kind, types.NoneType):
        return None
    if not isinstance(kind, types.BaseTuple):
        return lacking.GIVEN
    items = {i: shape_of(x) for i, x in enumerate(cast(Any, kind))}
    return items | dict(zip(getattr(kind, "fields", ()), items.values(), strict=False))


def choice(f: FunctionType) -> Callable[..., Any]:
    """Callback that gives numba the source of a function, by which parts are None.

    Args:
        f: the function.
    """
    names = list(inspect.signature(f).parameters)

    def choose(*arguments):
        shapes = dict(zip(names, map(shape_of, arguments), strict=False))
        return lacking.without(f, shapes, stepped.__contains__)

    return choose


OF_LAW = {"load": laws.load_of, "moved": laws.moved_of, "force": laws.force_of}
OUTLINED = {
    driver.kick,
    search.find_root,
    path.towards,
    path.crossed,
    borders.clay_in,
    borders.first_border,
    path.step_to_event,
    borders.passed_alike,
}
ATOMS = {
    *OF_LAW.values(), engine_step.put, engine_step.pair, engine_step.numbers_at, many.filled,
    vector.parts_at, vector.put_state, vector.copied, vector.table_at,
}  # fmt: skip
laws_known: set[ModuleType] = set()
stepped: set[FunctionType] = set()  # functions whose source numba finds


def choice_of_law(name: str) -> Callable[..., Any]:
    """Callback that gives numba the source of a function of a law, by the type of its part.

    Args:
        name: of the function.
    """

    def choose(part, *arguments):
        module = sys.modules[part.instance_class.__module__]
        if module not in laws_known and module not in SOURCES:
            laws_known.add(module)
            register((module,))
        return choice(getattr(module, name))(part, *arguments)

    choose.__signature__ = inspect.signature(OF_LAW[name])  # type: ignore[attr-defined]
    return choose


def register(modules: tuple[ModuleType, ...]) -> None:
    """Lets numba find the source of every function of some modules.

    Args:
        modules: of the stepping.
    """
    for module in modules:
        for f in list(vars(module).values()):
            if isinstance(f, FunctionType) and f.__module__ == module.__name__ and f not in ATOMS:
                inline = f not in OUTLINED
                if inline:
                    stepped.add(f)
                overload(f, jit_options=LAW | {"forceinline": inline}, strict=False)(choice(f))


def register_atoms() -> None:
    """Lets numba find the functions that machine code implements differently from CPython."""
    for name, f in OF_LAW.items():
        overload(f, jit_options=LAW, strict=False)(choice_of_law(name))
    overload(engine_step.put, inline="always")(
        lambda array, i, values: lambda array, i, values: store(array, i, values)  # type: ignore[call-arg]
    )
    overload(engine_step.pair, inline="always")(
        lambda array: lambda array: load_pair(array)  # type: ignore[call-arg]
    )
    overload(engine_step.numbers_at, inline="always")(
        lambda like, array, i: lambda like, array, i: fill(like, array + 8 * i)  # type: ignore[call-arg]
    )
    overload(many.filled, jit_options=LAW)(
        lambda like, numbers, k: (
            lambda like, numbers, k: fill(  # type: ignore[call-arg]
                like, numbers[k].ctypes.data
            )
        )
    )
    overload(vector.parts_at, inline="always")(
        lambda like, numbers, arrays, k: (
            lambda like, numbers, arrays, k: fill_all(  # type: ignore[call-arg]
                like, numbers[k].ctypes.data, arrays[k].ctypes.data
            )
        )
    )
    overload(vector.put_state, inline="always")(
        lambda s, states, k: (
            lambda s, states, k: keep(s, states[k].ctypes.data)  # type: ignore[call-arg]
        )
    )
    overload(vector.copied, inline="always")(
        lambda to, source, n: lambda to, source, n: copy_bytes(to, source, n)  # type: ignore[call-arg]
    )
    overload(vector.table_at, inline="always")(
        lambda address: lambda address: rows_at(address)  # type: ignore[call-arg]
    )


# ---- entries: all that is called between them is compiled with the same flags --------------------


def run_whole_steps(parts, s, e, room):
    """path.run_whole_steps."""
    return path.run_whole_steps(parts, s, e, room)


def advance(parts, s, e, room):
    """path.advance."""
    return path.advance(parts, s, e, room)


def carry(like, blocks, e, runs):
    """many.carry."""
    many.carry(like, blocks, e, runs)


def advance_all(like, state, place, x, which, ahead):
    """Advances runs of one kind, see `vector.advance`.

    Args:
        like: parts of the same kind.
        state: of the same kind.
        place: where steps are made.
        x: the runs.
        which: indices of the runs that advance.
        ahead: vector.STEPS, TRY or BOTH.
    """
    vector.advance(like, state, place, x, which, ahead)


def entry(f: Any) -> Any:
    """A function that is compiled at its first call with its types, or loaded from disk.

    Args:
        f: the function.
    """
    made = numba.njit(**ENTRY)(f)
    with contextlib.suppress(OSError, RuntimeError):  # no place to store it
        made._cache = cache.FileCache(made.py_func, cache_folder())
    return made


register(SOURCES)
register_atoms()
WHOLE_STEPS, ADVANCE, CARRY = entry(run_whole_steps), entry(advance), entry(carry)
ADVANCE_ALL = entry(advance_all)


def library() -> ctypes.CDLL:
    """The engine."""
    return ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("*mujoco.*"))))


def function(name: str, *more: Any) -> Any:
    """A function of the engine that takes model and data.

    Args:
        name: its name.
        more: types of further arguments.
    """
    found = getattr(library(), name)
    found.argtypes, found.restype = [ctypes.c_size_t, ctypes.c_size_t, *more], None
    return found


STEP, RESET = map(function, ("mj_step", "mj_resetData"))
DYNAMICS = engine_step.Dynamics(
    function("mj_kinematics"),
    function("mj_comPos"),
    function("mj_makeM"),
    function("mj_comVel"),
    function("mj_rne", ctypes.c_int, ctypes.c_size_t),
)


# ---- kernels -------------------------------------------------------------------------------------

QUIET = entry(monitor.is_quiet)


class Unavailable(Exception):
    """Machine code cannot be had; CPython makes the steps."""


def is_quiet(*arguments: Any) -> bool:
    """monitor.is_quiet; without machine code the monitor itself is asked.

    Args:
        *arguments: of that function.
    """
    try:
        return QUIET(*arguments)
    except Exception as error:  # as in `compiling`
        give_up(error)
        return False


ready: set[Any] = set()  # kinds of scene whose whole steps are compiled or loaded in this process
complete: set[Any] = set()  # those whose careful steps are, too
advances: dict[Any, Callable[..., None]] = {}  # vector.advance by the types of its arguments
met: dict[Any, int] = {}  # careful steps that CPython has made, by kind of scene


def natively(r: run.Run, room: int) -> None:
    """Makes steps: whole ones compiled, the others compiled once they are numerous.

    Args:
        r: the run.
        room: largest number of rows.
    """
    try:
        by_code(r, room)
    except Unavailable:
        plainly(r, room)


def plainly(r: run.Run, room: int) -> None:
    """Makes steps in CPython, from now on.

    Args:
        r: the run.
        room: largest number of rows.
    """
    r.kernel = run.PLAIN
    run.plainly(r, room)


def by_code(r: run.Run, room: int) -> None:
    """As `natively`.

    Raises:
        Unavailable: the compiler failed, before a step was made.
    """
    kind, parts, careful = r.kind, own_law.called(r.parts), 1
    while run.is_open(r, room):
        if met.get(kind, 0) > enough(kind):
            with first_call(complete, (COMPLETE, kind), "borders and hits of such runs"):
                r.state = ADVANCE(parts, r.state, r.native, room)
            continue
        before = r.state.filled.steps
        with first_call(ready, kind, "runs of this kind"):
            r.state = WHOLE_STEPS(parts, r.state, r.native, room)
        careful = 1 if r.state.filled.steps > before else min(2 * careful, IN_A_ROW)
        met[kind] = met.get(kind, 0) + carefully(r, room, careful)


def carefully(r: run.Run, room: int, most: int) -> int:
    """Makes steps in CPython, the first of which machine code did not make.

    Args:
        r: the run.
        room: largest number of rows.
        most: number of steps.

    Returns:
        The number of steps that it made.
    """
    for n in range(most):
        if not run.is_open(r, room):
            return n
        run.one_plainly(r, path.step if n else path.step_to_event)
    return most


def row_of(r: run.Run) -> vector.Row:
    """The row of a run in its present state; compiles what it needs.

    Args:
        r: the run.
    """
    row = r.row
    if row is None or (row.parts is not r.parts and row.key != vector.kind_key(r)):
        r.state, r.row = r.state, None
        row = vector.Row(r, KERNEL)
        types_ = row.key[:3]  # of the arguments; numba takes a millisecond to find them
        if types_ not in advances:
            advances[types_] = advancing(row.vector.kind, *row.arguments, vector.STEPS)
        row.advance = advances[types_]
        r.row = row
    row.take(r)
    return row


def advancing(kind: Any, *arguments: Any) -> Callable[..., None]:
    """vector.advance for the types of some arguments, compiled, without type checks at a call.

    Args:
        kind: of the runs.
        *arguments: of that function; of no run.
    """
    sizes = [x[:0] if isinstance(x, np.ndarray) else x for x in arguments]
    with first_call(ready, kind, "steps of this kind, one call at a time"):
        ADVANCE_ALL(*sizes)
    return entry_point(ADVANCE_ALL, *sizes)


def entry_point(entry: Any, *arguments: Any) -> Callable[..., Any]:
    """An entry for the types of some arguments, for which it has been called before.

    Args:
        entry: from `entry`.
        *arguments: of these types.
    """
    return entry.overloads[tuple(entry.typeof_pyval(x) for x in arguments)].entry_point


def by_rows(r: run.Run, room: int) -> None:
    """Makes steps of a run that is advanced often, a few at a time.

    Args:
        r: the run.
        room: largest number of rows.
    """
    if not vector.is_vectored(r):
        natively(r, room)
        return
    try:
        row = row_of(r)
    except Unavailable:
        plainly(r, room)
        return
    row.move(room)


def try_step(r: run.Run) -> np.ndarray | None:
    """Tries the next step of a run: returns the row that it would write, see run.Kernel.

    Args:
        r: the run.
    """
    if not vector.is_vectored(r):
        return None
    r.draw(1)
    try:
        return row_of(r).sample()
    except Unavailable:
        return None


@functools.cache
def enough(kind: Any) -> float:
    """How many careful steps of a kind repay the machine code for them.

    Args:
        kind: of the scene.
    """
    return ready_time((COMPLETE, kind)) / CAREFUL


@contextlib.contextmanager
def compiling(kinds: set[Any], kind: Any, what: str) -> Iterator[None]:
    """A first call, which compiles or loads from disk; signals wait until it ends.

    Args:
        kinds: that are ready; this kind is added at the end.
        kind: of the scene.
        what: is compiled, in words.

    Raises:
        Unavailable: the compiler failed, now or before in this process.
    """
    if failures:
        raise Unavailable(failures[0])
    with Notice(what, known_time(kind, started=bool(ready))) as notice, signals_held():
        if not isinstance(WHOLE_STEPS._cache, cache.FileCache):  # without a home none can miss it
            notice.begin()
        before, collects = cache.on_miss.set(notice.begin), gc.isenabled()
        gc.disable()  # numba makes millions of objects, and to search them for cycles takes long
        try:
            yield
        except Exception as error:  # numba raises anything where its private parts differ
            give_up(error)
            raise Unavailable(failures[0]) from error
        finally:
            cache.on_miss.reset(before)
            if collects:
                gc.enable()
        kinds.add(kind)
        keep_mark(kind)


def first_call(kinds: set[Any], kind: Any, what: str) -> contextlib.AbstractContextManager[None]:
    """As `compiling` before the first call of a kind; `signals_held` before the others.

    Args:
        kinds: that are ready.
        kind: of the scene.
        what: is compiled, in words.
    """
    return signals_held() if kind in kinds else compiling(kinds, kind, what)


@contextlib.contextmanager
def signals_held() -> Iterator[None]:
    """Delays signals that Python handles until the end of this block.

    A handler that raises, such as that of Ctrl-C, could interrupt the conversion of machine code's
    return values to Python objects; numba assumes that this conversion succeeds.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    held = {x: f for x in SIGNALS if callable(f := signal.getsignal(x))}
    for number in held:
        signal.signal(number, lambda number, frame: caught.append(number))
    try:
        yield
    finally:
        for number, handler in held.items():
            signal.signal(number, handler)
    for number in caught:
        held[number](number, None)  # type: ignore[operator]


def keep_mark(kind: Any) -> None:
    """Marks on disk that machine code of a kind is stored.

    Args:
        kind: of the scene.
    """
    with contextlib.suppress(OSError, RuntimeError):  # no place to store it
        if cache_folder() not in cache.lost:
            mark(kind).touch()


def warm(scenario: Scenario) -> None:
    """Compiles what steps of a scene need, or loads it from disk, before the first run.

    Args:
        scenario: the scene.
    """
    with run.borrowed_store() as store:
        run.Run(scenario, 1, KERNEL, store).advance(1)


def calls(model: Any, data: Any) -> tuple[Any, ...]:
    """mj_step, dynamics, model and data as compiled code calls them.

    Args:
        model: of the engine.
        data: of the engine.
    """
    return STEP, DYNAMICS, model._address, data._address


# ---- whether it works with the numba that is installed -------------------------------------------


class Tried(NamedTuple):
    """Parts as small as they can be."""

    number: Any
    whole: Any
    table: Any
    nothing: Any


def trial(like, numbers, arrays, scratch):
    """A bit of all that the other entries are made of.

    Args:
        like: a Tried.
        numbers: those of it, shape (1, 2).
        arrays: addresses and lengths of its arrays, shape (1, 3).
        scratch: room, shape (1, 9).
    """
    parts, alike = vector.parts_at(like, numbers, arrays, 0), many.filled(like, numbers, 0)
    step, d = kick.step_around(parts.number, alike.number), hand.dampers(parts.nothing)
    address = scratch.ctypes.data
    vector.put_state(step, scratch, 0)
    engine_step.put(address, 5, d)
    vector.copied(address + 56, address, 8)
    x, y = engine_step.pair(address)
    found = engine_step.numbers_at(step, address, 0)
    return found.after + x + y + vector.table_at(address)[0][0, 7] + parts.table[alike.whole]


TRIAL = entry(trial)


def try_out() -> None:
    """Compiles and calls a small entry, or loads it from disk.

    Private parts of numba that the code above uses differ between its versions, and what is
    missing shows when something is compiled.

    Raises:
        Exception: whatever numba raises where machine code cannot be had.
    """
    table, numbers = np.array([8.0, 16.0]), np.array([[2.0, 1.0]])
    arrays, like = np.array([[table.ctypes.data, 2, 1]]), Tried(0.0, 0, table, None)
    arguments = like, numbers, arrays, np.zeros((1, 9))
    with signals_held():
        first = TRIAL(*arguments)
        again = entry_point(TRIAL, *arguments)(*arguments)
    if not first == again == 2.0 + 2.0 + 0.5 + 2.0 + 16.0:
        raise RuntimeError(f"numba {numba.__version__} compiles other steps")


KERNEL = run.Kernel(natively, calls, lambda x: x.ctypes.data, is_quiet)
BY_ROWS = KERNEL._replace(advance=by_rows, ahead=try_step)
