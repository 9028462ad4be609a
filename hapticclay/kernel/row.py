"""A run as a row: its model, its state, and the arrays that they name."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numpy as np

from ..model.sampled_controller import Controller
from ..scene.scenario import Scenario
from . import begin, layout, march, path, records, rows, scene
from .mover import Mover

CHUNK = 4096  # rows between two looks at a run (progress, Ctrl-C, outcome); fits the cache
CROSSINGS, STOPS = 64, 4 * CHUNK  # between two looks: an axis stops and starts again in each step


class Saved(NamedTuple):
    """A run between two steps: its state, and copies of the arrays that steps write."""

    state: np.ndarray
    arrays: list[np.ndarray]


class Buffers:
    """What rows fill between two looks; successive runs use the same."""

    def __init__(self):
        self.rows = np.empty((CHUNK + 1, rows.ROW))
        self.crossings = np.empty((CROSSINGS, 4))
        self.stops, self.rendered = np.empty((1, 3)), np.empty((1, 3))

    def make_room(self, m: Any) -> None:
        """Makes room for what a scene records in addition to its rows."""
        if (m.flow or m.modal) and len(self.stops) < STOPS:
            self.stops = np.empty((STOPS, 3))
        if (m.told or m.holds) and len(self.rendered) <= CHUNK:
            self.rendered = np.empty((CHUNK + 1, 3))

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """By the names of their fields."""
        names = "rows", "crossings", "stops", "rendered"
        return {name: getattr(self, name) for name in names}


class Row:
    """A run: the model of its scene, its state, and the arrays that they name.

    `m` and `s` have the attributes of records.Model and records.State, whoever advances the row.
    """

    m: Any
    s: Any

    def __init__(self, scenario: Scenario, mover: Mover, buffers: Buffers):
        self.buffers, self.mover = buffers, mover
        self.take(scenario)

    def take(self, scenario: Scenario, controller: Controller | None = None) -> None:
        """Takes a scene; the state stays.

        Args:
            scenario: the scene.
            controller: the user's own, in place of the scene's.
        """
        made = scene.compile_scene(scenario, controller)
        self.arrays, self.caller, self.laws = made.arrays, made.caller, made.laws
        self.buffers.make_room(made.m)
        made.m.most_crossings, made.m.most_stops = CROSSINGS - 3, max(len(self.buffers.stops) - 8, 1)
        names = [name for name in made.written if name in self.arrays]
        self.written = [self.arrays[name].reshape(-1) for name in names]
        self.written += [law.z for law in self.laws]
        self.kept = [np.empty_like(x) for x in self.written]
        made.m.laws, made.m.spans = len(self.laws), len(self.written)
        self.m = self.model_of(made.m)
        self.m.engine = self.engine()
        self.replace(self.buffers.arrays | self.arrays)
        for span, at, kept in zip(self.m.span, self.written, self.kept, strict=False):
            span.at, span.kept, span.size = self.place(at), self.place(kept), len(at)
        self.put_functions()

    def model_of(self, m: Any) -> Any:
        """The model, as this row reads it."""
        raise NotImplementedError

    def engine(self) -> Any:
        """The engine, as this row calls it."""
        raise NotImplementedError

    def place(self, array: np.ndarray) -> Any:
        """An array, as a record names it."""
        raise NotImplementedError

    def put_functions(self) -> None:
        """Lets the model name the functions of the user."""
        raise NotImplementedError

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


class PlainRow(Row):
    """A row that CPython advances."""

    def __init__(self, scenario: Scenario, mover: Mover, buffers: Buffers):
        self.s, self.spare = records.State(), records.State()
        super().__init__(scenario, mover, buffers)

    def model_of(self, m: Any) -> Any:
        return m

    def engine(self) -> Any:
        return self.mover.plain

    def place(self, array: np.ndarray) -> Any:
        return memoryview(array)  # type: ignore[arg-type]

    def put_functions(self) -> None:
        self.m.control = self.caller
        for slot, law in zip(self.m.law, self.laws, strict=False):
            slot.load, slot.moved, slot.force = law.module.load, law.module.moved, law.module.force
            slot.z, slot.scratch = memoryview(law.z), memoryview(law.z.copy())
            slot.size = len(law.z)

    def begin(self, scenario: Scenario) -> None:
        """Puts the state to the start of a run."""
        begin.begin(self.m, self.s, *map(float, (*scenario.start, *scenario.velocity)))

    def advance(self, room: int) -> None:
        """Makes steps until so many rows are filled, other buffers are full, or the run is over."""
        self._made(path.advance, self.m, self.s, room)

    def _made(self, make: Any, *arguments: Any) -> None:
        """Makes steps, where the step of an exactly straight arm raises."""
        try:
            make(*arguments)
        except ArithmeticError:
            self.s.code = path.NOT_FINITE
        except ValueError:  # of the sine of an infinite angle
            if np.isfinite(self.mover.data.qpos).all() and np.isfinite(self.mover.data.qvel).all():
                raise
            self.s.code = path.NOT_FINITE


class NativeRow(Row):
    """A row that the compiled kernel advances."""

    def __init__(self, scenario: Scenario, mover: Mover, buffers: Buffers):
        from ..native.kernel import machine

        self.machine = machine
        self.models = np.zeros(1, layout.dtype_of(records.Model))
        self.states = np.zeros(2, layout.dtype_of(records.State))  # the run's, and a spare
        self.s = layout.view_of(records.State, self.states)
        self.addresses = self.models.ctypes.data, self.states.ctypes.data
        self.which = np.zeros(1, np.int64)
        super().__init__(scenario, mover, buffers)

    def model_of(self, m: Any) -> Any:
        self.models[:] = 0
        layout.save(m, self.models[0])
        return layout.view_of(records.Model, self.models)

    def engine(self) -> Any:
        return self.mover.row.ctypes.data

    def place(self, array: np.ndarray) -> Any:
        return array.ctypes.data

    def put_functions(self) -> None:
        self.called: list[Any] = []
        if self.caller is not None:
            self.m.control = self._address(CONTROL, lambda buffer: self.caller())
        for slot, law in zip(self.m.law, self.laws, strict=False):
            scratch = law.z.copy()
            slot.z, slot.scratch, slot.size = law.z.ctypes.data, scratch.ctypes.data, len(law.z)
            both = {x.ctypes.data: memoryview(x) for x in (law.z, scratch)}
            for name, kind, function in called_by_address(law.module, both):
                setattr(slot, name, self._address(kind, function))

    def _address(self, kind: Any, function: Any) -> int:
        made = kind(function)
        self.called.append(made)
        return ctypes.cast(made, ctypes.c_void_p).value  # type: ignore[return-value]

    def begin(self, scenario: Scenario) -> None:
        """Puts the state to the start of a run."""
        self.machine.begin_run(*self.addresses, *map(float, (*scenario.start, *scenario.velocity)))

    def advance(self, room: int) -> None:
        """Makes steps until so many rows are filled, other buffers are full, or the run is over."""
        self.machine.advance(*self.addresses, self.which.ctypes.data, 1, room)


PLACE, FLOAT = ctypes.c_void_p, ctypes.c_double
CONTROL = ctypes.CFUNCTYPE(None, PLACE)
LOAD = ctypes.CFUNCTYPE(None, PLACE, PLACE)
MOVED = ctypes.CFUNCTYPE(None, PLACE, *[FLOAT] * 5)
FORCE = ctypes.CFUNCTYPE(None, PLACE, *[FLOAT] * 4, ctypes.POINTER(FLOAT))


def called_by_address(law: Any, at: dict[int, Any]) -> Any:
    """The functions of a law of a user, as compiled code calls them: name, type, function.

    Args:
        law: the module.
        at: its numbers by their address.
    """
    kick = layout.struct_of(records.Kick)
    yield "load", LOAD, lambda z, k: law.load(at[z], kick.from_address(k))
    yield "moved", MOVED, lambda z, *numbers: law.moved(at[z], *numbers)
    yield "force", FORCE, lambda z, *numbers: law.force(at[z], *numbers)
