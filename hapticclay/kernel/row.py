"""A run as a row: its model, its state, and the arrays that they name."""

from __future__ import annotations

import ctypes
import math
import signal
import threading
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..model import regions
from ..model.sampled_controller import Controller
from ..scene.scenario import Scenario
from . import arm, begin, joints, layout, march, native, path, records, rows, scene, watch
from .mover import Mover

CHUNK = 4096  # rows between two looks at a run (progress, Ctrl-C, outcome); fits the cache
CROSSINGS, STOPS = 64, 4 * CHUNK  # between two looks: an axis stops and starts again in each step
# of one step: a handle thrown beyond many borders crosses each of them once, and then one more
CROSSED_MORE = 3

SHOWN = rows.ROW + 2  # numbers of a sample shown: its row, and the force of the clay [N]


class Saved(NamedTuple):
    """A run between two steps: bytes of its state, and copies of the arrays that steps write."""

    state: np.ndarray
    arrays: list[np.ndarray]


class Buffers:
    """What rows fill between two looks; successive runs use the same."""

    def __init__(self):
        self.rows = np.empty((CHUNK + 1, rows.ROW))
        self.crossings = np.empty((CROSSINGS, 4))
        self.stops, self.rendered = np.empty((1, 3)), np.empty((1, 3))
        self.extra = np.empty((1, 0))

    def make_room(self, m: Any, borders: int) -> None:
        """Makes room for what a scene with so many borders records in addition to its rows."""
        if len(self.crossings) < CROSSINGS + borders:
            self.crossings = np.empty((CROSSINGS + borders, 4))
        if (m.flow or m.modal) and len(self.stops) < STOPS:
            self.stops = np.empty((STOPS, 3))
        if m.records_clay_force and len(self.rendered) <= CHUNK:
            self.rendered = np.empty((CHUNK + 1, 3))
        if m.general and self.extra.shape != (CHUNK + 1, joints.width(m)):
            self.extra = np.empty((CHUNK + 1, joints.width(m)))

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """By the names of their fields."""
        names = "rows", "crossings", "stops", "rendered", "extra"
        return {name: getattr(self, name) for name in names}


class Row:
    """A run: the model of its scene, its state, and the arrays that they name.

    CPython advances it. `m` and `s` have the attributes of records.Model and records.State, as
    those of a `NativeRow` do.

    Attributes:
        caller: calls the user's own controller; None without one.
        failed: what functions of the user's laws raised.
    """

    engine = "python"
    drops_events = 0  # crossings and stops are overwritten, since nothing reads them
    m: Any
    s: Any

    def __init__(self, scenario: Scenario, mover: Mover, buffers: Buffers):
        self.s, self.spare, self._is_amid = records.State(), records.State(), False
        self._start(scenario, mover, buffers)

    def _start(self, scenario: Scenario, mover: Mover, buffers: Buffers) -> None:
        self.buffers, self.mover = buffers, mover
        self.failed: list[BaseException] = []
        self.take(scenario)
        self.begin(scenario)

    # ---- the scene

    def take(self, scenario: Scenario, controller: Controller | None = None) -> None:
        """Takes a scene; the state stays."""
        made = scene.compile_scene(scenario, controller)
        self.arrays, self.caller, self.laws = made.arrays, made.caller, made.laws
        borders = regions.border_count(made.arrays["table"])
        self.buffers.make_room(made.m, borders)
        made.m.max_crossings = len(self.buffers.crossings) - borders - CROSSED_MORE
        made.m.max_stops = max(len(self.buffers.stops) - 8, 1)
        made.m.drops_events = self.drops_events
        self.names = [name for name in made.written if name in self.arrays]
        self.written = [self.arrays[name].reshape(-1) for name in self.names]
        self.written += [law.z for law in self.laws]
        self.kept = [np.empty_like(x) for x in self.written]
        made.m.laws, made.m.spans = len(self.laws), len(self.written)
        self.m = self.model_of(made.m)
        self.put_engine(self.mover)
        self.replace(self.buffers.arrays | self.arrays)
        for span, at, kept in zip(self.m.span, self.written, self.kept, strict=False):
            span.at, span.kept, span.size = self.place(at), self.place(kept), len(at)
        self.put_functions()

    def model_of(self, m: Any) -> Any:
        """The model, as this row reads it."""
        return m

    def place(self, array: np.ndarray) -> Any:
        """An array, as a record names it."""
        return memoryview(array)  # type: ignore[arg-type]

    def put_engine(self, mover: Mover) -> None:
        """Lets the model name the engine that moves the arm."""
        self.mover, self.m.engine = mover, mover.plain

    def put_functions(self) -> None:
        """Lets the model name the functions of the user."""
        self.m.control = self.caller
        for slot, law in zip(self.m.law, self.laws, strict=False):
            slot.load, slot.moved, slot.force = kept(law.module, self.failed)
            slot.z, slot.scratch = memoryview(law.z), memoryview(law.z.copy())
            slot.size = len(law.z)

    def replace(self, arrays: dict[str, np.ndarray]) -> None:
        """Lets the model name other arrays."""
        for name, array in arrays.items():
            array = np.ascontiguousarray(array)
            self.arrays[name] = array
            setattr(self.m, name, self.place(array.reshape(-1)))

    def substeps(self, i: int) -> int:
        """Engine steps of the accurate method in the sample after sample i."""
        blocks = self.arrays.get("blocks")
        return self.m.substeps if blocks is None else int(blocks[i // march.GROWTH_BLOCK])

    def change(self, scenario: Scenario, controller: Controller | None = None) -> None:
        """Continues in another scene with the same borders."""
        before = dict(zip(self.names, self.written, strict=False))
        laws = [law.z.copy() for law in self.laws]
        self.take(scenario, controller)
        for name, array in zip(self.names, self.written, strict=False):
            if name == "table":
                regions.keep_entries(array, before[name])
            elif name in before and len(before[name]) == len(array):
                array[:] = before[name]
        for law, z in zip(self.laws, laws, strict=False):
            law.z[law.first :] = z[law.first :]
        self.go_on()

    def drop_events(self, drops: bool) -> None:
        """Says whether crossings and stops are dropped, in this scene and in later ones."""
        self.drops_events = self.m.drops_events = int(drops)

    def checkpoint(self) -> Any:
        """The run in its scene, to return to from a change."""
        return dict(vars(self)), self.state(), self.model()

    def model(self) -> Any:
        """The numbers of the scene that a change overwrites."""
        return None

    def change_back(self, before: Any) -> None:
        """Returns to a checkpoint from a change that was interrupted anywhere."""
        attributes, state, model = before
        vars(self).update(attributes)
        self.put_model(model)
        self.put_state(state)
        self.replace(self.buffers.arrays)  # which the change may have made larger

    def put_model(self, model: Any) -> None:
        """Puts the numbers of a scene back."""

    def go_on(self) -> None:
        """Continues in a changed scene."""
        begin.change(self.m, self.s)

    # ---- the run

    def begin(self, scenario: Scenario) -> None:
        """Puts the state to the start of a run."""
        if self.caller is not None:
            state = self.caller.controller.state
            start = self.caller.start
            self.arrays["buffer"][start : start + len(state)] = state
        for law in self.laws:
            law.z[:] = law.start
        self.put_start(*map(float, (*scenario.start, *scenario.velocity)))

    def put_start(self, px: float, py: float, vx: float, vy: float) -> None:
        """Puts the state to the start of a run, the handle at p with velocity v."""
        begin.begin(self.m, self.s, px, py, vx, vy)

    def advance(self, room: int) -> None:
        """Makes steps until so many rows are filled, other buffers are full, or the run is over."""
        arm.put(self.m, self.s)
        self._step(path.advance, self.m, self.s, room)

    def peek(self) -> np.ndarray:
        """The row that the next step would write, and the force of the clay, shape (18,).

        Then comes what an arm from a file adds to rows.
        """
        n, out = self.s.row, np.full(SHOWN, np.nan)
        arm.put(self.m, self.s)
        self._step(path.show, self.m, self.s, self.spare, out)
        return np.append(out, self.extra_at(n))

    def extra_at(self, n: int) -> np.ndarray:
        """What an arm from a file adds to a row."""
        return self.buffers.extra[n] if self.m.general else self.buffers.extra[0, :0]

    def _step(self, make: Any, *arguments: Any) -> None:
        """Makes steps, where the step of an exactly straight arm raises.

        Between two lines of a step the state is none of the run. So Ctrl-C waits for its end, but
        where a function of the user is called.
        """
        if self.is_called:
            self._step_through(make, *arguments)
        else:
            uninterrupted(self._step_through, make, *arguments)

    def _step_through(self, make: Any, *arguments: Any) -> None:
        self._is_amid = True
        try:
            make(*arguments)
        except ArithmeticError:
            self.s.code = path.NOT_FINITE
        except ValueError:  # from the sine of an infinite angle
            if np.isfinite(self.mover.data.qpos).all() and np.isfinite(self.mover.data.qvel).all():
                raise
            self.s.code = path.NOT_FINITE
        self._is_amid = False

    @property
    def is_torn(self) -> bool:
        """Whether a step was interrupted within, so that the state is none of the run."""
        errors = [*self.failed, *self.mover.failures()]
        errors += [] if self.caller is None else [self.caller.error]
        return self._is_amid or any(x and not isinstance(x, Exception) for x in errors)

    @property
    def is_called(self) -> bool:
        """Whether steps call functions of Python, which may fail."""
        return self.caller is not None or bool(self.laws) or self.mover.calls_python

    def check(self) -> None:
        """Raises what functions of the user raised, and Ctrl-C that came within one of Python."""
        for error in (*self.failed, *self.mover.failures()):
            raise error
        if self.caller is not None:
            self.caller.check()

    def strained(self, n: int, limits: Sequence[float]) -> list[int]:
        """How many of the last n rows have |tau| of each motor at its limit or above."""
        return [watch.strained(self.m, self.s, n, i, limit) for i, limit in enumerate(limits)]

    def is_quiet(self, first: int, n: int) -> bool:
        """Whether the monitor can have nothing to report on rows, nor had it before."""
        watch.look(self.m, self.s, first, n)
        return bool(self.s.watch.quiet)

    # ---- to return to

    def state(self) -> np.ndarray:
        """A copy of the state, as the bytes of a record."""
        made = one(records.State)
        layout.save(self.s, made)
        return made

    def put_state(self, state: np.ndarray) -> None:
        """Puts a state back."""
        layout.load(self.s, state)

    def saved(self) -> Saved:
        """The run at its sample."""
        return Saved(self.state(), [x.copy() for x in self.written])

    def restore(self, saved: Saved) -> None:
        """Returns to a sample."""
        self.put_state(saved.state)
        for x, before in zip(self.written, saved.arrays, strict=True):
            x[:] = before
        self.failed.clear()
        self.mover.forgive()
        if self.caller is not None:
            self.caller.error = None
        self._is_amid = False


class NativeRow(Row):
    """A row that the compiled kernel advances."""

    engine = "native"

    def __init__(self, scenario: Scenario, mover: Mover, buffers: Buffers, at: Any = None):
        self.machine, self.spare = native.machine(), one(records.State)
        self._is_amid = False
        self.models, self.states = at or (one(records.Model), one(records.State))
        self.s = layout.view_of(records.State, self.states)
        self.addresses = self.models.ctypes.data, self.states.ctypes.data
        self.rooms, self.which = np.zeros(1, np.int64), np.zeros(1, np.int64)
        self.shown, self.counts = np.zeros(SHOWN), np.zeros(2, np.int64)
        self.call = *self.addresses, self.which.ctypes.data, 1
        # finding an address takes as long as a step
        self.rooms_at, self.counts_at = self.rooms.ctypes.data, self.counts.ctypes.data
        self.shown_at = self.spare.ctypes.data, self.shown.ctypes.data
        self._start(scenario, mover, buffers)

    def model_of(self, m: Any) -> Any:
        bytes_of(self.models)[:] = 0
        layout.save(m, self.models)
        return layout.view_of(records.Model, self.models)

    def put_engine(self, mover: Mover) -> None:
        self.mover, self.m.engine = mover, mover.row.ctypes.data

    def place(self, array: np.ndarray) -> Any:
        return array.ctypes.data

    def put_functions(self) -> None:
        self.called: list[Any] = []
        if self.caller is not None:
            self.m.control = self._address(CONTROL, self.caller)
        for slot, law in zip(self.m.law, self.laws, strict=False):
            scratch = law.z.copy()
            slot.z, slot.scratch, slot.size = law.z.ctypes.data, scratch.ctypes.data, len(law.z)
            both = {x.ctypes.data: memoryview(x) for x in (law.z, scratch)}
            for name, kind, function in called_by_address(kept(law.module, self.failed), both):
                setattr(slot, name, self._address(kind, function))

    def _address(self, kind: Any, function: Any) -> Any:
        made = kind(function)
        self.called.append(made)
        return ctypes.cast(made, ctypes.c_void_p).value

    def put_start(self, px: float, py: float, vx: float, vy: float) -> None:
        self.machine.begin_run(*self.addresses, px, py, vx, vy)

    def go_on(self) -> None:
        self.machine.change(*self.addresses)

    def advance(self, room: int) -> None:
        self.rooms[0] = room
        self.machine.advance(*self.call, self.rooms_at, False)

    def peek(self) -> np.ndarray:
        n = self.s.row
        self.machine.peek(*self.call, *self.shown_at)
        return np.append(self.shown, self.extra_at(n)) if self.m.general else self.shown.copy()

    def strained(self, n: int, limits: Sequence[float]) -> list[int]:
        self.machine.strained(*self.call, n, *limits, self.counts_at)
        return self.counts.tolist()

    def is_quiet(self, first: int, n: int) -> bool:
        return self.machine.look(*self.addresses, first, n)

    def state(self) -> np.ndarray:
        return bytes_of(self.states).copy()

    def put_state(self, state: np.ndarray) -> None:
        bytes_of(self.states)[:] = state

    def model(self) -> Any:
        return bytes_of(self.models).copy()

    def put_model(self, model: Any) -> None:
        bytes_of(self.models)[:] = model


ROWS: dict[str, type[Row]] = {"python": Row, "native": NativeRow}


def one(record: Any) -> np.ndarray:
    """The bytes of a record: NumPy would look through its fields with each new array."""
    return np.zeros(layout.dtype_of(record).itemsize, np.uint8)


def bytes_of(rows: np.ndarray) -> np.ndarray:
    """The bytes of rows: NumPy would copy records field by field, which takes 0.1 ms."""
    return rows.view(np.uint8)


def uninterrupted(call: Any, *arguments: Any) -> None:
    """Makes a call that Ctrl-C does not end: it takes effect afterwards, a second one at once."""
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler) or threading.current_thread() is not threading.main_thread():
        call(*arguments)
        return
    came: list[Any] = []

    def note(*signal_and_frame: Any) -> None:
        came.append(signal_and_frame)
        if len(came) > 1:
            handler(*signal_and_frame)

    try:
        signal.signal(signal.SIGINT, note)
        call(*arguments)
    finally:
        signal.signal(signal.SIGINT, handler)
    if came:
        handler(*came[0])


PLACE, FLOAT = ctypes.c_void_p, ctypes.c_double
CONTROL = ctypes.CFUNCTYPE(None, PLACE)
LOAD = ctypes.CFUNCTYPE(None, PLACE, PLACE)
MOVED = ctypes.CFUNCTYPE(None, PLACE, *[FLOAT] * 5)
FORCE = ctypes.CFUNCTYPE(None, PLACE, *[FLOAT] * 4, ctypes.POINTER(FLOAT))


def called_by_address(functions: Any, at: dict[int, Any]) -> Any:
    """The functions of a law of a user, as compiled code calls them: name, type, function."""
    load, moved, force = functions
    kick = layout.struct_of(records.Kick)
    yield "load", LOAD, lambda z, k: load(at[z], kick.from_address(k))
    yield "moved", MOVED, lambda z, *numbers: moved(at[z], *numbers)
    yield "force", FORCE, lambda z, *numbers: force(at[z], *numbers)


def kept(law: Any, failed: list[BaseException]) -> Any:
    """load, moved and force of a law of a user, whose exceptions are kept: the run ends by NaN.

    Compiled code would drop them; in CPython one of arithmetic would be that of a straight arm.
    """

    def tried(function: Any, *arguments: Any) -> bool:
        try:
            if not failed:
                function(*arguments)
        except BaseException as error:  # Ctrl-C too
            failed.append(error)
        return not failed

    def load(z: Any, k: Any) -> None:
        if not tried(law.load, z, k):
            k.x.f = k.y.f = math.nan

    def moved(z: Any, *numbers: float) -> None:
        tried(law.moved, z, *numbers)

    def force(z: Any, px: float, py: float, vx: float, vy: float, out: Any) -> None:
        if not tried(law.force, z, px, py, vx, vy, out):
            out[0] = out[1] = math.nan

    return load, moved, force
