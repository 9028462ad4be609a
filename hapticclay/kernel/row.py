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


class PlainRow:
    """A row that CPython advances."""

    def __init__(
        self,
        scenario: Scenario,
        mover: Mover,
        buffers: Buffers,
        controller: Controller | None = None,
    ):
        self.buffers, self.mover = buffers, mover
        self.s, self.spare = records.State(), None
        self.take(scenario, controller)

    def take(self, scenario: Scenario, controller: Controller | None = None) -> None:
        """Takes a scene; the state stays."""
        self.compiled = scene.compile_scene(scenario, controller)
        self.m, self.arrays = self.compiled.m, self.compiled.arrays
        self.buffers.make_room(self.m)
        self.m.engine = self.mover.plain
        self.m.most_crossings, self.m.most_stops = CROSSINGS - 3, max(len(self.buffers.stops) - 8, 1)
        for name in (*self.buffers.arrays, *self.arrays):
            self.put(name)
        if self.compiled.caller is not None:
            self.m.control = self.compiled.caller
        self.put_laws()
        self.put_spans()

    def put(self, name: str) -> None:
        """Lets the model name an array."""
        array = self.buffers.arrays[name] if name in self.buffers.arrays else self.arrays[name]
        setattr(self.m, name, memoryview(array.reshape(-1)))

    def replace(self, arrays: dict[str, np.ndarray]) -> None:
        """Lets the model name other arrays."""
        for name, array in arrays.items():
            self.arrays[name] = np.ascontiguousarray(array, float)
            self.put(name)

    def substeps(self, i: int) -> int:
        """Engine steps of the accurate method in the sample after sample i."""
        blocks = self.arrays.get("blocks")
        return self.m.substeps if blocks is None else int(blocks[i // march.GROWTH_BLOCK])

    def put_laws(self) -> None:
        """Lets the model name the laws of a user."""
        self.m.laws = len(self.compiled.laws)
        for slot, law in zip(self.m.law, self.compiled.laws, strict=False):
            slot.load, slot.moved, slot.force = law.module.load, law.module.moved, law.module.force
            slot.z, slot.scratch = memoryview(law.z), memoryview(law.z.copy())
            slot.size = len(law.z)

    @property
    def written(self) -> list[np.ndarray]:
        """Arrays that steps write."""
        found = [self.arrays[name] for name in self.compiled.written]
        return [x.reshape(-1) for x in found] + [law.z for law in self.compiled.laws]

    def put_spans(self) -> None:
        """Lets the model name the arrays that steps write, and room for copies."""
        self.m.spans = len(self.written)
        for span, array in zip(self.m.span, self.written, strict=False):
            span.at, span.kept = memoryview(array), memoryview(np.empty_like(array))
            span.size = len(array)

    def begin(self, scenario: Scenario) -> None:
        """Puts the state to the start of a run."""
        x, y = map(float, scenario.start)
        vx, vy = map(float, scenario.velocity)
        begin.begin(self.m, self.s, x, y, vx, vy)

    def advance(self, room: int) -> None:
        """Makes steps until so many rows are filled, other buffers are full, or the run is over."""
        m, s = self.m, self.s
        try:
            path.advance(m, s, room)
        except ArithmeticError:  # the step of an exactly straight arm
            s.code = path.NOT_FINITE
        except ValueError:  # of the sine of an infinite angle
            if np.isfinite(self.mover.data.qpos).all() and np.isfinite(self.mover.data.qvel).all():
                raise
            s.code = path.NOT_FINITE
