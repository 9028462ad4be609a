"""Runs of one kind that advance in one call of compiled code, inside a loop of the user's.

Between calls a run is a row: the numbers of its parts, the addresses of their arrays, and its
state. `advance` reads the row, makes steps, runs the quick test of the monitor, and writes the
state back. `run` handles the rare cases: the monitor itself, the end of a run, other numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from . import many, monitor, path, rows, scene, viscous
from .engine_step import Engine, pair, put
from .machine_code import STEPWISE, kind_of
from .parts import Parts
from .run import CHUNK, EngineStore, Kernel, Run
from .state import OPEN, Filled, State

STEPS, TRY, BOTH = range(3)  # what a call does
SHOWN = rows.ROW + 2  # numbers of a sample shown: its row, and the force of the clay [N]


# ---- compiled ------------------------------------------------------------------------------------


class Place(NamedTuple):
    """Workspace in which one thread makes steps.

    Attributes:
        engine: the engine; rows of the record and force of the clay lie with each run.
        limits: of its motors [N.m], shape (2, 2).
        scratch: room for the arrays that steps write into, while a step is only tried.
    """

    engine: Engine
    limits: Any
    scratch: Any


class Vector(NamedTuple):
    """Runs of one kind, or of several: one row each.

    Attributes:
        numbers: of their parts, see many.numbers_of, shape (n, m).
        arrays: of the arrays of their parts: address, and number of rows and columns, shape (n, a).
        states: numbers of their states, shape (n, l).
        written: of the arrays that steps write into: address and bytes, shape (n, w).
        kept: addresses of their rows that have not been judged, and of the force of the clay in
            them; 1 where b v does not give that force, 1 where crossings and stops are noted, else
            0; shape (n, 4).
        until: samples to pause at, shape (n,).
        looked: samples judged so far, shape (n,).
        marks: sample, rows not judged and code of each; engine steps, crossings and stops of the
            last call; shape (n, 6).
        times: now [s], shape (n,).
        quiet: 1 while the monitor can have nothing to report, shape (n,).
        swings: see monitor.is_quiet, shape (n, 2, monitor.QUIET).
        seen: counts of the monitor, shape (n, 4).
        shown: the present sample, shape (n, SHOWN).
    """

    numbers: Any
    arrays: Any
    states: Any
    written: Any
    kept: Any
    until: Any
    looked: Any
    marks: Any
    times: Any
    quiet: Any
    swings: Any
    seen: Any
    shown: Any


def parts_at(like, numbers, arrays, k):
    """The parts of run k, with the types of `like`; compiled only.

    Args:
        like: parts of the same kind.
        numbers: of the parts of each run, shape (runs, m).
        arrays: addresses and lengths of the arrays of each run, shape (runs, 2 m).
        k: index of the run.
    """
    raise NotImplementedError


def put_state(s, states, k):
    """Stores the state of run k; compiled only."""
    raise NotImplementedError


def copied(to, source, n):
    """Copies bytes; compiled only.

    Args:
        to: address that they are written to.
        source: address that they are read from.
        n: number of bytes.
    """
    raise NotImplementedError


def table_at(address):
    """The rows at an address, shape (CHUNK, rows.ROW), alone in a tuple; compiled only.

    Args:
        address: of the first row.
    """
    raise NotImplementedError


def engine_of(e, x, k):
    """The engine, with the rows of run k."""
    return Engine(
        e.step, e.model, e.data, e.q, e.w, e.ctrl, e.push, e.timestep, x.kept[k, 0], e.crossings,
        e.stops, x.kept[k, 1], e.most_crossings, e.most_stops, e.probe,
    )  # fmt: skip


def readied(parts, s, e, limits):
    """Prepares the engine for a run."""
    put(e.timestep, 0, (parts.time.dt,))
    put(e.q, 0, s.body.q)
    put(e.w, 0, s.body.w)
    for j in range(2):
        limits[j, 0], limits[j, 1] = -parts.limits[j], parts.limits[j]


def swap_written(written, k, scratch, back):
    """Copies the arrays that steps write into aside, or back.

    Args:
        written: addresses and numbers of bytes of these arrays, shape (runs, 2 m).
        k: index of the run.
        scratch: room for the copy, bytes.
        back: whether the copy is written back.
    """
    at = scratch.ctypes.data
    for j in range(written.shape[1] // 2):
        address, n = written[k, 2 * j], written[k, 2 * j + 1]
        if back:
            copied(address, at, n)
        else:
            copied(at, address, n)
        at += n


def judged(parts, x, k, table, first, n):
    """Runs the quick test of the monitor on the rows made."""
    limit = parts.limits
    if x.quiet[k] and n > first:
        made, swings, seen = table[first:n], x.swings[k], x.seen[k]
        good = monitor.is_quiet(made, n - first, limit[0], limit[1], swings, seen)
        x.quiet[k] = 1 if good else 0


def show(e, x, k, table, n):
    """Stores row n as the present sample, and the force of the clay where b v does not give it."""
    for j in range(rows.ROW):
        x.shown[k, j] = table[n, j]
    if x.kept[k, 2]:
        f = pair(e.rendered + 24 * n)
        x.shown[k, rows.ROW], x.shown[k, rows.ROW + 1] = f[0], f[1]


def moved(like, state, place, x, k, ahead):
    """Advances run k, or tries its next step, for the sample that this would write."""
    parts, s = parts_at(like, x.numbers, x.arrays, k), many.filled(state, x.states, k)
    e, first, table = engine_of(place.engine, x, k), s.filled.rows, table_at(x.kept[k, 0])[0]
    room = min(CHUNK - 1, x.until[k] - x.looked[k])
    if ahead:
        room = first + 1
        swap_written(x.written, k, place.scratch, False)
    readied(parts, s, e, place.limits)
    while s.status.code == OPEN and path.has_room(parts.time, s, e, room):
        s = path.advance(parts, s, e, room)
        if x.kept[k, 3] == 0:  # nobody reads crossings: make room for more
            s = path.with_filled(s, Filled(0, s.filled.rows, 0, 0))
    if ahead:
        swap_written(x.written, k, place.scratch, True)
        show(e, x, k, table, first)
        return
    made = s.filled
    x.marks[k, 3], x.marks[k, 4], x.marks[k, 5] = made.steps, made.crossings, made.stops
    put_state(path.with_filled(s, Filled(0, made.rows, 0, 0)), x.states, k)
    judged(parts, x, k, table, first, s.filled.rows)
    x.times[k] = s.clock.t
    x.marks[k, 0], x.marks[k, 1], x.marks[k, 2] = s.clock.i, s.filled.rows, s.status.code


def has_events(x, k):
    """Whether crossings or stops of the last call are unread: trying a step overwrites them."""
    return x.kept[k, 3] == 1 and x.marks[k, 4] + x.marks[k, 5] > 0


def advance(like, state, place, x, which, ahead):
    """Advances runs, one after the other.

    Args:
        like: parts of their kind.
        state: of their kind.
        place: where steps are made.
        x: the runs.
        which: their indices.
        ahead: STEPS makes steps, TRY tries the next one, BOTH does one after the other.
    """
    for k in which:
        for tried in range(1 if ahead == TRY else 0, 1 if ahead == STEPS else 2):
            if tried == 0 or ahead == TRY or not has_events(x, k):
                moved(like, state, place, x, k, tried == 1)


# ---- which runs, and their rows ------------------------------------------------------------------


def arrays_in(part: Any) -> Iterator[np.ndarray]:
    """The arrays of parts, in the order in which `parts_at` takes them.

    Args:
        part: the parts of a scene.
    """
    if isinstance(part, tuple):
        for x in part:
            yield from arrays_in(x)
    elif isinstance(part, np.ndarray):
        yield part


def addresses_of(arrays: Iterable[np.ndarray]) -> list[int]:
    """Where arrays lie, as a row of `Vector.arrays` has it: address, rows and columns of each.

    Args:
        arrays: of one or two dimensions.
    """
    return [n for a in arrays for n in (a.ctypes.data, *a.shape, 1)[:3]]


def kind_of_steps(kind: Any, state: State) -> Any:
    """What machine code for steps of runs is compiled for.

    Args:
        kind: of their scenes.
        state: of one of them.
    """
    return STEPWISE, kind, kind_of(state)


def is_vectored(run: Run) -> bool:
    """Whether `advance` makes the steps of a run: not with signals, nor with the user's own law.

    Args:
        run: the run.
    """
    return run.drives is None and scene.own_law(run.parts) is None


def kind_key(run: Run) -> tuple[Any, ...]:
    """Key of runs that advance together.

    Args:
        run: one of them.
    """
    s, arrays = run.scenario, arrays_in(run.parts)
    types = tuple((x.dtype.char, x.ndim) for x in arrays)
    angle = None if s.clay is None else s.clay.angle
    return kind_of(run.parts), kind_of(run.state), types, s.arm, angle


def unpacked(like: Any, numbers: Iterator[float]) -> Any:
    """Tuples with other numbers, of the types of `like`.

    Args:
        like: the tuples.
        numbers: from many.numbers_of.
    """
    if isinstance(like, tuple):
        made = [unpacked(x, numbers) for x in like]
        return type(like)._make(made) if hasattr(like, "_make") else tuple(made)
    return type(like)(next(numbers)) if isinstance(like, float | int) else like


class Common:
    """Rows of runs of all kinds: the arrays of Vector that do not depend on the kind.

    Args:
        n: number of runs.
    """

    def __init__(self, n: int):
        self.kept = np.zeros((n, 4), np.int64)
        self.until, self.looked = np.zeros((2, n), np.int64)
        self.marks, self.times = np.zeros((n, 6), np.int64), np.zeros(n)
        self.quiet, self.swings = np.zeros(n, np.int64), np.zeros((n, 2, monitor.QUIET))
        self.seen, self.shown = np.zeros((n, 4), np.int64), np.zeros((n, SHOWN))


class RunVector:
    """The runs of one kind.

    Args:
        run: one of them.
        common: rows of all runs.
        kernel: how compiled steps are made.

    Attributes:
        kind: what machine code is compiled for.
        x: their rows; those of runs of other kinds are not used.
    """

    def __init__(self, run: Run, common: Common, kernel: Kernel):
        self.parts, self.state, self.scenario = run.parts, run.state, run.scenario
        self.kind = kind_of_steps(run.kind, run.state)
        self.at, self.put = many.places(run.state), many.places(run.parts)
        self.kernel, self.tells = kernel, scene.tells(run.parts)
        self.written = len(scene.written(run.parts))
        n, c = len(common.times), common
        sizes = len(many.numbers_of(run.parts)), len(many.numbers_of(run.state))
        self.x = Vector(
            np.zeros((n, sizes[0])), np.zeros((n, 3 * len([*arrays_in(run.parts)])), np.int64),
            np.zeros((n, sizes[1])), np.zeros((n, 2 * self.written), np.int64), c.kept, c.until,
            c.looked, c.marks, c.times, c.quiet, c.swings, c.seen, c.shown,
        )  # fmt: skip
        self.places: dict[int, tuple[Place, Any]] = {}
        self.advance: Any = None  # vector.advance for them, compiled
        self.most = 0  # bytes that a run's steps may write into

    def take(self, k: int, run: Run) -> None:
        """Takes a run over, as it is now.

        Args:
            k: its index.
            run: the run.
        """
        x, written, store = self.x, scene.written(run.parts), run.store
        x.numbers[k] = many.numbers_of(run.parts)
        x.arrays[k] = addresses_of(arrays_in(run.parts))
        x.written[k] = [n for a in written for n in (a.ctypes.data, a.nbytes)]
        kept = store.rows.ctypes.data, store.rendered.ctypes.data
        x.kept[k] = *kept, self.tells, run.recorded
        self.most = max(self.most, sum(a.nbytes for a in written))
        self.take_state(k, run)

    def take_state(self, k: int, run: Run) -> None:
        """Takes the state of a run over.

        Args:
            k: its index.
            run: the run.
        """
        s, x = run.state, self.x
        x.states[k] = many.numbers_of(s)
        x.looked[k], x.times[k] = run.looked, s.clock.t
        x.marks[k, :3] = s.clock.i, s.filled.rows, s.status.code

    def give(self, k: int, run: Run) -> None:
        """Gives a run its state back.

        Args:
            k: its index.
            run: the run.
        """
        run.state = unpacked(self.state, iter(self.x.states[k].tolist()))

    def push(self, which: np.ndarray, force: np.ndarray) -> None:
        """Sets the constant part of muscle forces.

        Args:
            which: indices of runs.
            force: (x, y) of each [N], shape (n, 2).
        """
        at = self.put.push.steady[1:3]
        self.x.numbers[which[:, None], at] = force

    def set_gain(self, which: np.ndarray, gain: np.ndarray) -> None:
        """Sets gains, where scene.takes_gain.

        Args:
            which: indices of runs.
            gain: K of x and y of each [1/kg], shape (n, 2).
        """
        self.x.numbers[which[:, None], [lag.K for lag in self.put.lag]] = gain

    def place(self, thread: int) -> Place:
        """Where a thread makes steps.

        Args:
            thread: its index.
        """
        found = self.places.get(thread)
        if found is None or len(found[0].scratch) * 8 < self.most:
            store = EngineStore() if found is None else found[1][0]
            model, data = store.engine(self.scenario)
            e = store.arrays(self.parts, model, data, self.kernel)
            scratch = np.empty(self.most // 8 + 1)
            found = Place(e, model.actuator_ctrlrange, scratch), (store, model, data)
            self.places[thread] = found
        return found[0]

    def force(self, which: np.ndarray) -> np.ndarray:
        """Force of the clay in the samples shown [N], shape (n, 2).

        Args:
            which: indices of runs.
        """
        shown = self.x.shown[which]
        if self.tells:
            return shown[:, rows.ROW :]
        v, b = shown[:, 4:6], shown[:, 12:14]
        return np.column_stack(viscous.force(self.parts.grain, b.T, v.T))


class Row:
    """A run as a single row, for a Simulation.

    Args:
        run: the run.
        kernel: how compiled steps are made.

    Attributes:
        parts: of the run, as the row has them.
        leads: whether the row holds the state, and that of the run is outdated.
        shows: whether the present sample is known.
        is_plain: whether nothing is drawn for the steps ahead of them.
        marks: see Vector.marks.
        t: now [s].
    """

    def __init__(self, run: Run, kernel: Kernel):
        self.common = Common(1)
        self.vector = RunVector(run, self.common, kernel)
        self.key, self.parts, self.leads, self.taken = kind_key(run), None, False, False
        self.shows = self.asked = self.is_plain = False
        self.marks, self.t, self.which = [0] * 6, 0.0, np.zeros(1, np.int64)
        scratch = np.empty(sum(a.nbytes for a in scene.written(run.parts)) // 8 + 1)
        place = Place(run.native, run.model.actuator_ctrlrange, scratch)
        v = self.vector
        self.arguments = v.parts, v.state, place, v.x, self.which
        self.advance: Any = None  # vector.advance for these arguments, compiled

    def take(self, run: Run) -> None:
        """Takes over what has changed in the run: its parts, its state.

        Args:
            run: the run.
        """
        if self.parts is not run.parts:
            self.vector.take(0, run)
            self.parts, self.shows = run.parts, False
            sampler = run.parts.sampler
            self.is_plain = sampler is None or sampler.chance is None
        elif not self.taken:
            self.vector.take_state(0, run)
        self.taken = True

    def follow(self) -> None:
        """Notes that the run has another state."""
        self.leads = self.taken = self.shows = False

    def renumber(self, parts: Parts) -> None:
        """Takes over another muscle force or gain.

        Args:
            parts: with these, otherwise the same.
        """
        at, numbers = self.vector.put, self.vector.x.numbers[0]
        for i, x in zip(at.push.steady, parts.push.steady, strict=True):
            numbers[i] = x
        for place, lag in zip(at.lag or (), parts.lag or (), strict=True):
            numbers[place.K] = lag.K
        self.parts, self.shows = parts, False

    def move(self, room: int) -> None:
        """Makes steps.

        Args:
            room: largest number of rows.
        """
        x = self.common
        x.until[0], x.looked[0] = room, 0
        self.shows = self.asked  # a caller that reads one sample will read the next
        self.asked = False
        self.advance(*self.arguments, BOTH if self.shows else STEPS)
        self.marks, self.t, self.leads = x.marks[0].tolist(), float(x.times[0]), True
        self.shows = self.shows and not any(self.marks[4:])

    def sample(self) -> np.ndarray:
        """The row that a step would write now, and the force of the clay, see Vector.shown."""
        if not self.shows:
            self.advance(*self.arguments, TRY)
        self.shows = self.asked = True
        return self.common.shown[0].copy()

    def numbers(self) -> list[float]:
        """The present sample, see Vector.shown, where it is known."""
        self.asked = True
        return self.common.shown[0].tolist()

    def made(self) -> Filled:
        """What the last call has made, and the rows so far."""
        _, n, _, steps, crossings, stops = self.marks
        return Filled(steps, n, crossings, stops)

    def given(self) -> State:
        """The state."""
        return unpacked(self.vector.state, iter(self.vector.x.states[0].tolist()))
