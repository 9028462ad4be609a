"""A run from start to end: it advances, stores the record and calls the monitor."""

from __future__ import annotations

import contextlib
import copy
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..arguments import named
from ..errors import ParameterError
from ..model import hardware
from ..model.constants import AXES
from ..model.sampled_controller import Controller
from ..scene.scenario import Scenario
from . import begin, energy, engine, monitor, path, rows, scene, viscous
from .engine import mujoco
from .engine_step import Dynamics, Engine, Probe
from .machine_code import kind_of
from .modes import SUBSTEPS
from .parts import Chance, Parts
from .state import FINISHED, NOT_FINITE, OPEN, UNRESOLVED, Filled, State

CHUNK = 4096  # rows between two checks of the run (progress, Ctrl-C, outcome); fits the cache
STORED = 8  # engines per store: two of an arm, with clay and without
CROSSINGS, STOPS = 64, 4 * CHUNK  # between two checks: an axis stops and restarts in each step
NONE_MADE = Filled(0, 0, 0, 0)
RECORDED = (  # of a run
    "steps", "watch", "looked", "kept", "rendered_kept", "last_rendered", "crossings", "stops",
    "outcome", "end_time", "calm", "swings", "seen", "first",
)  # fmt: skip


@named
@dataclass(frozen=True)
class Crossing:
    """A crossing of a border by the handle.

    Attributes:
        axis: coordinate of the border, "x" or "y".
        border: where it lies [m].
        time: when it was crossed [s].
        speed: velocity along the axis [m/s].
    """

    axis: str
    border: float
    time: float
    speed: float


@dataclass(frozen=True)
class Stop:
    """An interval in which the clay held the handle still.

    Attributes:
        axis: "x" or "y" where that axis alone was held by its own law, "xy" for the handle as a
            whole.
        start: when it came to rest [s].
        end: when it moved on [s]; None if it still rested at the end of the run.
    """

    axis: str
    start: float
    end: float | None = None


class Kernel(NamedTuple):
    """How the steps of a run are made: by CPython, or compiled.

    Attributes:
        advance: makes steps, called with (run, room).
        calls: mj_step, Dynamics, model and data as these steps call them.
        place: an array as they write into it: a memoryview, or its address.
        quiet: monitor.is_quiet, compiled; None calls the monitor itself.
        ahead: tries the next step of a run, called with the run. Returns the row that it would
            write, and the force of the clay where b v does not give it; None if it cannot. Without
            this function the run makes the step and returns to its state.
    """

    advance: Callable[[Run, int], None]
    calls: Callable[[Any, Any], tuple[Any, ...]]
    place: Callable[[Any], Any]
    quiet: Callable[..., bool] | None = None
    ahead: Callable[[Run], np.ndarray | None] | None = None


def one_plainly(run: Run, step: Callable[..., State]) -> None:
    """Makes a step in CPython, where the step of an exactly straight arm raises.

    Args:
        run: the run.
        step: path.step or path.step_to_event.
    """
    try:
        run.state = step(run.views, run.state, run.e)
    except ArithmeticError:
        run.state = path.ended(run.state, NOT_FINITE)
    except ValueError:  # of the sine of an infinite angle
        if np.isfinite(run.data.qpos).all() and np.isfinite(run.data.qvel).all():
            raise
        run.state = path.ended(run.state, NOT_FINITE)


def plainly(run: Run, room: int) -> None:
    """Makes steps in CPython.

    Args:
        run: the run.
        room: largest number of rows.
    """
    while is_open(run, room):
        one_plainly(run, path.step)


def is_open(run: Run, room: int) -> bool:
    """Whether a run goes on, and has room.

    Args:
        run: the run.
        room: largest number of rows.
    """
    return run.state.status.code == OPEN and path.has_room(run.parts.time, run.state, run.e, room)


def bias(model: Any, data: Any, accelerated: int, to: Any) -> None:  # noqa: ARG001
    """mj_rne, into data.qfrc_bias.

    Args:
        model: of the engine.
        data: of the engine.
        accelerated: 1 to add the torques of the accelerations.
        to: a view of that array, which mj_rne does not accept.
    """
    mujoco.mj_rne(model, data, accelerated, data.qfrc_bias)


DYNAMICS = Dynamics(mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_makeM, mujoco.mj_comVel, bias)
PLAIN = Kernel(plainly, lambda model, data: (mujoco.mj_step, DYNAMICS, model, data), memoryview)


def at_rest(model: Any, data: Any, s: Scenario) -> None:
    """Sets an engine to a scenario, at rest.

    Args:
        model: of the engine.
        data: of the engine.
        s: the scenario.
    """
    model.opt.timestep = s.dt
    for i, limit in enumerate(s.torque_limit):
        model.actuator_ctrlrange[i] = -limit, limit
    engine.rotate_dampers(model, s)
    mujoco.mj_resetData(model, data)


class NeedsMonitor(Exception):
    """A run without samples that is to be repeated with them, for the monitor."""


class EngineStore:
    """Engines and arrays that successive runs reuse: engines with clay and without.

    Args:
        engines: those of another store, which makes no steps meanwhile; None for its own.
    """

    def __init__(self, engines: dict[Any, tuple[Any, Any]] | None = None):
        self.engines = {} if engines is None else engines
        self.rows = np.empty((CHUNK, rows.ROW))  # one more where a run ends between samples
        self.crossings = np.empty((CROSSINGS, 4))
        self.stops, self.rendered = np.empty((0, 3)), np.empty((0, 3))

    def engine(self, s: Scenario) -> tuple[Any, Any]:
        """The engine as engine.build would make it, at rest: model and data.

        Args:
            s: the scenario.
        """
        key = s.clay is not None, s.arm
        if key not in self.engines:
            if len(self.engines) >= STORED:
                del self.engines[next(iter(self.engines))]  # the oldest one
            model = engine.build(s)
            self.engines[key] = model, mujoco.MjData(model)
        at_rest(*self.engines[key], s)
        return self.engines[key]

    def room_for(self, parts: Parts) -> None:
        """Allocates the arrays for what a scene records in addition to its rows.

        Args:
            parts: the scene.
        """
        special = parts.special
        flows = parts.modal is not None or (special is not None and special.flow is not None)
        if flows and not len(self.stops):
            self.stops = np.empty((STOPS, 3))
        if scene.tells(parts) and not len(self.rendered):
            self.rendered = np.empty((CHUNK, 3))

    def arrays(self, parts: Parts, model: Any, data: Any, kernel: Kernel) -> Engine:
        """The engine and the arrays that a run fills.

        Args:
            parts: the scene.
            model: of the engine.
            data: of the engine.
            kernel: how the steps are made.
        """
        self.room_for(parts)
        kept: Any = self.rows, self.crossings, self.stops, self.rendered
        own: Any = data.qpos, data.qvel, data.ctrl, data.qfrc_applied, engine.timestep_view(model)
        probed: Any = data.qpos, data.qvel, data.M, data.qfrc_bias
        step, dynamics, *engine_ = kernel.calls(model, data)
        probe = None
        if parts.accurate is not None:
            probe = Probe(dynamics, *engine_, *map(kernel.place, probed))
        places = map(kernel.place, [*own, *(x.reshape(-1) for x in kept)])
        rest: Any = *places, CROSSINGS - 3, max(len(self.stops) - 8, 1), probe
        return Engine(step, *engine_, *rest)


_idle: list[EngineStore] = []  # engines that no run uses


@contextlib.contextmanager
def borrowed_store() -> Iterator[EngineStore]:
    """Engines for one run, made new only while others are in use."""
    try:
        store = _idle.pop()
    except IndexError:
        store = EngineStore()
    yield store
    _idle.append(store)  # but not after an exception


class Saved(NamedTuple):
    """A run between two steps, to return to.

    Attributes:
        state: its state.
        arrays: copies of what steps write into its parts.
    """

    state: State
    arrays: list[np.ndarray]


class Snapshot(NamedTuple):
    """A run with its record, to return to; it can be pickled.

    Attributes:
        scenario: of the run.
        saved: the run, Saved.
        before: the run at the last check of the monitor, Saved.
        rows: not judged yet.
        rendered: force of the clay in them [N].
        record: what the run keeps of those judged.
    """

    scenario: Scenario
    saved: Any
    before: Any
    rows: np.ndarray
    rendered: np.ndarray
    record: dict[str, Any]


class Run:
    """One run of a scenario; this class makes its steps and keeps their results.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        kernel: how the steps are made.
        store: engines to use; None for its own.
        brief: keep no samples, for `brief` alone.
        watched: let the monitor check all rows; else NeedsMonitor is raised where it must check
            rows that are not kept.
        recorded: whether judged rows are kept; else only the rows since then and, after the end,
            `last_row`.
        monitored: whether its stability is judged.

    Raises:
        ParameterError: a control callback is installed in the engine, which would interfere.

    Attributes:
        parts: the scenario, compiled of its parts.
        row: where compiled steps keep the state between calls, vector.Row; None where they do not.
        e: the engine and the arrays that it fills, for CPython.
        pause: index of the sample to pause at.
    """

    def __init__(
        self,
        scenario: Scenario,
        every: int,
        kernel: Kernel = PLAIN,
        store: EngineStore | None = None,
        brief: bool = False,
        watched: bool = False,
        recorded: bool = True,
        monitored: bool = True,
    ):
        if mujoco.get_mjcb_control() is not None:
            bound = "the engine must be free of control callbacks"
            raise ParameterError("mjcb_control", mujoco.get_mjcb_control(), bound)
        self.scenario, self.every, self.kernel = scenario, every, kernel
        self.store = store or EngineStore()
        self.model, self.data = self.store.engine(scenario)
        self._controller: Controller | None = None  # in place of the scenario's
        self.row: Any = None
        self._equip(scene.parts_of(scenario))
        self.state = scene.start(self.views, scenario, self.e)
        self.drives = _drives(scenario)
        self._noise: hardware.SampleNoise | None = None
        self.steps = 0
        self.pause = math.inf
        judge = monitor.StabilityMonitor if monitored else monitor.RangeMonitor
        self.watch = judge(scenario)
        self.looked = 0  # samples judged so far
        self.kept: list[tuple[np.ndarray, np.ndarray]] = []  # index, rows
        self.rendered = scene.tells(self.parts)
        self.rendered_kept: list[np.ndarray] = []
        self.last_rendered: Any = None
        self.crossings: list[Crossing] = []
        self.stops: list[Stop] = []
        self.outcome: monitor.Outcome | None = None
        self.end_time: float | None = None
        self.without_samples, self.recorded = brief, recorded
        self.last_row: Any = None
        # nothing to report so far; later the monitor may need all rows again
        self.calm = kernel.quiet is not None and scenario.stop_when_unstable and not watched
        self.swings, self.seen = np.zeros((2, monitor.QUIET)), np.array([0, -1, -1, 0])
        self.first = energy.stored(self.parts, self.state)
        self._saved = self.saved()

    @property
    def state(self) -> State:
        """The state between two steps."""
        if self.leads:
            self._state = self.row.given()
        return self._state

    @state.setter
    def state(self, s: State) -> None:
        self._state = s
        if self.row is not None:
            self.row.follow()

    @property
    def leads(self) -> bool:
        """Whether the row holds the state, and `_state` is outdated."""
        return self.row is not None and self.row.leads

    @property
    def t(self) -> float:
        """Present time [s]."""
        return self.row.t if self.leads else self._state.clock.t

    @property
    def i(self) -> int:
        """Index of the sample at or before now."""
        return self.row.marks[0] if self.leads else self._state.clock.i

    @property
    def filled(self) -> int:
        """Number of samples not judged yet."""
        return self.row.marks[1] if self.leads else self._state.filled.rows

    @property
    def code(self) -> int:
        """Status code of the run: OPEN and so on."""
        return self.row.marks[2] if self.leads else self._state.status.code

    @property
    def views(self) -> Parts:
        """The parts of the run, for CPython."""
        if self._views is None:
            self._views = scene.viewed(self.parts)
        return self._views

    def sample_time(self) -> float:
        """Time of the present sample [s]; of the last good one after the end."""
        if self.end_time is not None:
            return self.end_time
        return (self.i if self.outcome is None else self.looked - 1) * self.scenario.dt

    def b(self) -> tuple[float, float]:
        """Damping of the clay in the present region, (x, y) [N.s/m]."""
        return viscous.now(self.parts.clay, self.state.clay, False, self.t)

    # ---- steps

    def advance(self, room: int = CHUNK - 1) -> None:
        """Makes steps until rows are filled, or the run is over.

        Args:
            room: largest number of rows.
        """
        if self.recorded and not self.filled and not (self.without_samples and self.looked):
            self._saved = self.saved()  # of what has been judged
        self._make(room)
        self.note_end()

    def note_end(self) -> None:
        """Notes the outcome of a run that is over."""
        code = self.code
        if code == UNRESOLVED:
            self.give_up()
        elif code == NOT_FINITE:
            self._end(
                monitor.Outcome(
                    "out of reach", self.t, self.i, cause=scene.cause_of_end(self.parts)
                )
            )
        elif code != OPEN:
            self.finish("finished" if code == FINISHED else "time limit")

    def _make(self, room: int) -> None:
        ready = max(min(room - self.filled, self.parts.time.last - self.i), 0) + 1
        self.draw(ready)
        if self.drives is not None:
            parts, n = self.drives.prepared(self.parts, self.i, ready)
            self.take(parts)
            room = room if n == ready else min(room, self.filled + n)
        self.kernel.advance(self, room)
        if (law := scene.own_law(self.parts)) is not None:
            law.check()
        made = self.row.made() if self.leads else self._state.filled
        if self.recorded:
            self._note_events(made.crossings, made.stops)
        self.steps += made.steps
        if not self.leads:
            self.state = path.with_filled(self._state, Filled(0, made.rows, 0, 0))

    def draw(self, n: int) -> None:
        """Draws the random effects on the control samples of the next whole steps.

        Args:
            n: how many.
        """
        if self.parts.sampler is None or self.parts.sampler.chance is None:
            return
        x, k = self.parts.sampler.chance, self.state.loop.machine.samples.k
        io: Any = self.scenario.hardware
        most = n // self.parts.sampler.ratio + 8  # and a look ahead
        if x.first <= k and k + most <= x.first + len(x.numbers) // 4:
            return
        if self._noise is None or k < self._noise.first:
            self._noise = hardware.SampleNoise(io)
        chance = Chance(self._noise.table(k, most + scene.NOISE_AHEAD).ravel(), k)
        self._noise.forget(k)
        self.take(self.parts._replace(sampler=self.parts.sampler._replace(chance=chance)))

    def take_over(self, controller: Controller) -> None:
        """Lets the user's own controller act, before the first step of a sampled run.

        Args:
            controller: the user's own.
        """
        self._controller = controller
        self._equip(scene.parts_of(self.scenario, controller))
        self.state = scene.start(self.views, self.scenario, self.e)
        self.rendered = scene.tells(self.parts)
        self._saved = self.saved()

    def take(self, parts: Parts) -> None:
        """Continues with other numbers in the same parts.

        Args:
            parts: the parts with these numbers.
        """
        self.parts: Parts = parts
        self._views: Any = None
        self._kind = self._native = None

    @property
    def kind(self) -> Any:
        """Key of scenes whose steps share the same machine code."""
        if self._kind is None:
            self._kind = kind_of(self.parts)
        return self._kind

    @property
    def native(self) -> Engine:
        """The engine as compiled steps call it."""
        if self._native is None:
            self._native = self.store.arrays(self.parts, self.model, self.data, self.kernel)
        return self._native

    def _note_events(self, crossings: int, stops: int) -> None:
        """Stores the crossings and stops of the steps just made."""
        for axis, *crossing in self.store.crossings[:crossings].tolist():
            self.crossings.append(Crossing(AXES[int(axis)], *crossing))
        for axis, begins, t in self.store.stops[:stops].tolist():
            self._note_stop(("x", "y", "xy")[int(axis)], begins > 0.0, t)

    def _note_stop(self, axis: str, begins: bool, t: float) -> None:
        if begins:
            self.stops.append(Stop(axis, t))
            return
        for i in reversed(range(len(self.stops))):
            if self.stops[i].axis == axis:
                self.stops[i] = replace(self.stops[i], end=t)
                break

    def saved(self) -> Saved:
        """The run at its sample, to return to."""
        return Saved(self.state, [x.copy() for x in scene.written(self.parts)])

    def restore(self, saved: Saved) -> None:
        """Returns to a sample; the record is not changed.

        Args:
            saved: from `saved`.
        """
        self.state = saved.state
        self.data.qpos[:], self.data.qvel[:] = saved.state.body.q, saved.state.body.w
        for x, before in zip(scene.written(self.parts), saved.arrays, strict=True):
            x[:] = before

    def resume(self) -> None:
        """Takes back an engine that other runs have used meanwhile."""
        at_rest(self.model, self.data, self.scenario)
        self.data.qpos[:], self.data.qvel[:] = self.state.body.q, self.state.body.w

    def restart(self) -> None:
        """Restarts without a record; not after `change`, or where signals are prepared ahead."""
        self.restore(self._saved)
        self.steps = self.looked = 0
        self.watch = type(self.watch)(self.scenario)
        self.outcome, self.end_time = None, None
        self.last_row = self.last_rendered = None

    def snapshot(self) -> Snapshot:
        """The run with its record, to return to."""
        n = self.filled
        kept = copy.deepcopy({name: getattr(self, name) for name in RECORDED})
        return Snapshot(
            self.scenario, self.saved(), self._saved, self.store.rows[:n].copy(),
            self.store.rendered[:n].copy(), kept,
        )  # fmt: skip

    def return_to(self, x: Snapshot) -> None:
        """Returns to a snapshot of a run of this scenario, or of one that it was changed from.

        Args:
            x: the snapshot.
        """
        if x.scenario != self.scenario:
            self.scenario = x.scenario
            self._equip(scene.parts_of(x.scenario, self._controller))
        self.restore(x.saved)
        self._saved, n = x.before, len(x.rows)
        self.store.rows[:n], self.store.rendered[: len(x.rendered)] = x.rows, x.rendered
        for name, value in copy.deepcopy(x.record).items():
            setattr(self, name, value)

    def change(self, scenario: Scenario) -> None:
        """Continues with another gain, operator, force or clay between the same borders.

        Args:
            scenario: the scenario with these.
        """
        before = self.parts
        parts = scene.parts_of(scenario, self._controller)
        scene.keep_written(parts, before)
        self.scenario = self.watch.scenario = scenario
        self._equip(parts)
        self.state = begin.changed(self.views, scene.blocks(parts, scenario), self.state, before)

    def _equip(self, parts: Parts) -> None:
        self.take(parts)
        self.e = self.store.arrays(parts, self.model, self.data, PLAIN)

    def go(self, progress: Callable[[float, float], bool | None] | None) -> None:
        """Runs to the end, until progress returns True, or until sample `pause`.

        A run that was paused is not flushed.

        Args:
            progress: called now and then with (time [s], handle x [m]); True ends the run.
        """
        while self.outcome is None and self.i < self.pause:
            self.advance(int(min(CHUNK - 1, self.pause - self.looked)))
            if self.filled >= CHUNK - 1 or self.outcome:
                if progress and progress(self.t, self.position()[0]) and self.outcome is None:
                    self.outcome = monitor.Outcome("interrupted", self.t, self.i)
                self.flush()

    def hop(self, n: int) -> bool:
        """Makes n compiled steps where there is nothing to prepare, nor a check among them.

        Args:
            n: number of steps.

        Returns:
            Whether it did; else `go` makes those that are left.
        """
        row = self.row
        if row is None or not (row.leads and row.is_plain and row.parts is self.parts):
            return False
        room = row.marks[1] + n
        if room == n or room >= CHUNK - 1:
            return False
        row.move(room)
        _, filled, code, steps, crossings, stops = row.marks
        self.steps += steps
        if self.recorded and (crossings or stops):
            self._note_events(crossings, stops)
        if code != OPEN:
            self.note_end()
            self.flush()
        return code != OPEN or filled == room

    def interrupt(self) -> None:
        """Ends the run at its last sample."""
        self.outcome = monitor.Outcome("interrupted", self.t, self.i)
        self.flush()

    def change_force(self, force: tuple[float, float]) -> None:
        """Continues under another constant muscle force.

        Args:
            force: (x, y) [N].
        """
        self.scenario = with_checked(self.scenario, force=force)
        self.push_evenly((0.0, *scene.steady_force(self.scenario), 0.0, 0.0))

    def change_gain(self, gain: tuple[float, float]) -> None:
        """Continues with another gain.

        Args:
            gain: K of x and y [1/kg], within the bounds of a scenario.
        """
        changed = with_checked(self.scenario, gain=gain)
        if scene.takes_gain(self.parts):
            self.scenario = self.watch.scenario = changed
            self._renumber(scene.with_gain(self.parts, gain))
        else:
            self.change(changed)

    def push_evenly(self, steady: tuple[float, ...]) -> None:
        """Continues under a muscle force that changes evenly.

        Args:
            steady: as Push.steady.
        """
        self._renumber(self.parts._replace(push=self.parts.push._replace(steady=steady)))

    def _renumber(self, parts: Parts) -> None:
        """Continues with another muscle force or gain in the same parts."""
        row = self.row if self.row is not None and self.row.parts is self.parts else None
        kind, native = self._kind, self._native
        self.take(parts)
        self._kind, self._native = kind, native
        if row is not None:
            row.renumber(parts)

    def position(self, h: float = 0.0) -> tuple[float, float]:
        """Handle position after the joints have turned at their present rates, (x, y) [m].

        Args:
            h: time [s].
        """
        (q1, q2), (w1, w2) = self.state.body.q, self.state.body.w
        return path.place(self.parts.arm, (q1 + h * w1, q2 + h * w2))

    def finish(self, code: str) -> None:
        """Ends the run now.

        Args:
            code: as Outcome.code.
        """
        self.end_time = self.t
        self._end(monitor.Outcome(code, self.t, self.i))

    def _end(self, outcome: monitor.Outcome) -> None:
        self.outcome = self.outcome or outcome

    def give_up(self) -> None:
        """Ends the run at its last sample, because the steps after it become too short."""
        cut_short = self.state.status.careful >= path.MOST_STEPS  # else divided by too many
        most = path.MOST_STEPS if cut_short else SUBSTEPS
        cause = f"more than {most} steps in one sample"
        other = "fast" if self.scenario.integrator == "accurate" else "accurate"
        advice = f"change dt, or choose integrator {other!r}"
        step = max(self.looked + self.filled - 1, 0)
        at = step * self.scenario.dt
        self.outcome = monitor.Outcome("unresolved", at, step, cause=cause, advice=advice)
        self._cut_events(at)

    def ahead(self) -> np.ndarray:
        """The row that a step would write now, and the force of the clay in it [N].

        The run does not advance.

        Returns:
            rows.ROW numbers, and two.
        """
        if self.kernel.ahead is not None and (found := self.kernel.ahead(self)) is not None:
            return self._with_force(found)
        n, saved, events = (
            self.filled,
            self.saved(),
            (self.steps, list(self.crossings), list(self.stops)),
        )
        try:
            self._make(n + 1)
            return self._row_and_force(n)
        finally:
            self.restore(saved)
            self.steps, self.crossings, self.stops = events

    def numbers_ahead(self) -> list[float]:
        """As `ahead`; the numbers of the last row if the run has ended."""
        row = self.row
        if self.outcome is not None:
            none = [math.nan] * (rows.ROW + 2)
            return none if self.last_row is None else [*self.last_row, *self.last_force()]
        if row is None or not (row.shows and row.leads and row.parts is self.parts):
            return self.ahead().tolist()
        found = row.numbers()
        if not self.rendered:
            found[rows.ROW :] = self._force(*found[12:14], *found[4:6])
        return found

    def torque_reached(self, n: int, k: int) -> list[float]:
        """As `torque_reached`, in the last rows of those not judged yet.

        Args:
            n: number of rows.
            k: how many reach it.
        """
        end = self.filled
        return torque_reached(self.store.rows[max(end - n, 0) : end], k).tolist()

    def _row_and_force(self, n: int) -> np.ndarray:
        """Row n of those since the last check, and the force of the clay in it [N]."""
        told = self.store.rendered[n, :2] if self.rendered else (0.0, 0.0)
        return self._with_force(np.concatenate((self.store.rows[n], told)))

    def _with_force(self, row: np.ndarray) -> np.ndarray:
        """A row with the force of the clay appended; already there if b v does not give it."""
        if not self.rendered:
            vx, vy, bx, by = *row[4:6].tolist(), *row[12:14].tolist()
            row[rows.ROW], row[rows.ROW + 1] = self._force(bx, by, vx, vy)
        return row

    def is_diverging(self) -> bool:
        """Whether the monitor would find the run unstable by now."""
        watch = copy.deepcopy(self.watch)
        n = self.filled
        _, found = watch.look(_columns(self.store.rows[:n]), self.looked) if n else (0, None)
        return found is not None or watch.onset is not None

    # ---- the record

    def flush(self) -> None:
        """Judges the rows since the last check."""
        n = self.filled
        self.state = path.with_filled(self.state, NONE_MADE)
        if n and self.rendered and self.recorded:
            self.last_rendered = self.store.rendered[n - 1, :2].tolist()
        if self.without_samples and n and self._still_calm(n):
            if self.outcome is not None:
                self.outcome = self.watch.end(self.outcome)
                self.last_row = self.store.rows[n - 1].tolist()
            self.looked += n
            return
        if self.without_samples and self.looked:
            raise NeedsMonitor
        if self.without_samples:  # the monitor can have all rows so far
            self.without_samples = self.calm = False
        good = self.judge(self.store.rows[:n])
        if not self.recorded:
            self._keep_last(good)
        elif self.outcome is not None and self.end_time is None and good < n:
            made, crossings, stops = self.steps, list(self.crossings), list(self.stops)
            self.restore(self._saved)  # the ledger ends with the good rows
            while self.filled < good:  # in parts, where borders are many
                self._make(good)
            self.state = path.with_filled(self.state, NONE_MADE)
            self.steps, self.crossings, self.stops = made, crossings, stops

    def _keep_last(self, good: int) -> None:
        """Stores the last good row since the last check."""
        if good:
            self.last_row = self.store.rows[good - 1].tolist()
            if self.rendered:
                self.last_rendered = self.store.rendered[good - 1, :2].tolist()

    def look(self, made: np.ndarray) -> tuple[int, monitor.Outcome | None]:
        """Judges the next rows, as StabilityMonitor.look.

        Args:
            made: rows of the record, shape (n, rows.ROW).
        """
        if self.calm:
            if self._still_calm(len(made)):
                return len(made), None
            if self.looked and self.every != 1:
                raise NeedsMonitor
            self.calm = False
            for index, earlier in self.kept:
                self.watch.look(_columns(earlier), int(index[0]))
        return self.watch.look(_columns(made), self.looked)

    def _still_calm(self, n: int) -> bool:
        """Whether n more rows give the monitor nothing to report; at the end it gets the counts."""
        quiet, watch = self.kernel.quiet, self.watch
        limit = self.scenario.torque_limit
        if not quiet or not quiet(self.store.rows, n, *limit, self.swings, self.seen):
            return False
        if self.outcome is not None:
            watch.seen, watch.moved, watch.unbound, watch.often = self.seen.tolist()
        return True

    def judge(self, made: np.ndarray) -> int:
        """Adds samples to the record, up to the end of the good part of the run.

        Args:
            made: rows of the record, shape (n, rows.ROW).

        Returns:
            Number of samples taken.
        """
        good, found = self.look(made)
        if found is not None:
            self.outcome, self.end_time = found, None
            self._cut_events(found.time)
        elif self.outcome is not None:
            if self.outcome.code == "interrupted":  # anywhere: the record ends with its last sample
                step = self.looked + good - 1
                self.outcome = replace(self.outcome, time=step * self.scenario.dt, step=step)
                self._cut_events(self.outcome.time)
            self.outcome = self.watch.end(self.outcome)
        if good and self.recorded:
            keep = np.arange(-self.looked % self.every, good, self.every)
            if self.outcome is not None and (not len(keep) or keep[-1] != good - 1):
                keep = np.append(keep, good - 1)
            everything = len(keep) == len(made)
            self.kept.append((self.looked + keep, made.copy() if everything else made[keep]))
            if self.rendered:
                self.rendered_kept.append(self.store.rendered[keep])
        self.looked += good
        return good

    def _cut_events(self, t: float) -> None:
        """Removes events after the end of the record."""
        self.crossings = [c for c in self.crossings if c.time <= t]
        self.stops = [
            replace(x, end=None) if x.end is not None and x.end > t else x
            for x in self.stops
            if x.start <= t
        ]

    def arrays(self) -> dict[str, np.ndarray]:
        """The samples kept, by the names of Record's arrays."""
        t = np.concatenate([index for index, _ in self.kept]) * self.scenario.dt
        if self.end_time is not None and len(t):
            t[-1] = self.end_time
        out = {"t": t} | self._columns([x for _, x in self.kept])
        if self.rendered_kept:
            kept = np.concatenate(self.rendered_kept)
            out["fe"] = kept[:, :2]
            special = self.parts.special
            if special is not None and special.groove is not None:
                out["removed"] = kept[:, 2]
        return out

    def left_ground(self) -> np.ndarray | None:
        """As Record.ground."""
        special = self.parts.special
        if special is None or special.groove is None:
            return None
        return special.groove.relief * special.groove.ground

    def _columns(self, parts: list[np.ndarray]) -> dict[str, np.ndarray]:
        columns = (np.concatenate([x[:, j : j + 2] for x in parts]) for j in range(0, rows.ROW, 2))
        q, p, v, fh, tau, delta, b, qd = columns
        fe = np.column_stack(self._force(*b.T, *v.T))
        return dict(p=p, v=v, fh=fh, fe=fe, b=b, q=q, qd=qd, tau=tau, delta=delta)

    def _force(self, bx: Any, by: Any, vx: Any, vy: Any) -> tuple[Any, Any]:
        """Force of the clay's damping, (x, y) [N]."""
        return viscous.force(self.parts.grain, (bx, by), (vx, vy))

    def brief(self) -> tuple[Any, ...]:
        """The end of the run: outcome, steps, crossings, the last p, v, fh, fe and b, energy."""
        if self.without_samples:
            px, py, vx, vy, fx, fy, _, _, _, _, bx, by = self.last_row[2:14]
            force = self.last_rendered or self._force(bx, by, vx, vy)
            last: Any = [(px, py), (vx, vy), (fx, fy), force, (bx, by)]
            return self.outcome, self.steps, tuple(self.crossings), last, self.balance()
        arrays = self.arrays()
        final = (arrays[name] for name in ("p", "v", "fh", "fe", "b"))
        last = [x[-1] if len(x) else (np.nan, np.nan) for x in final]
        return self.outcome, self.steps, tuple(self.crossings), last, self.balance()

    def last_force(self) -> tuple[float, float]:
        """Force of the clay in `last_row` [N]."""
        vx, vy, bx, by = *self.last_row[4:6], *self.last_row[12:14]
        return tuple(self.last_rendered or self._force(bx, by, vx, vy))

    def balance(self) -> dict[str, float]:
        """The energy balance, as Record.energy."""
        last = energy.stored(self.parts, self.state)
        out = energy.balance(self.state.work[:5], self.first if self.looked else last, last)
        laws = self.state.clay.laws
        if laws is not None and laws.elastic is not None:
            x = laws.elastic
            out |= {"springs_stored": float(x.stored), "springs_dissipated": float(x.lost)}
        return out | self._hardware(out)

    def _hardware(self, out: dict[str, float]) -> dict[str, float]:
        """Energy that hardware and held clay take; friction is not part of the motors' share."""
        x, io = self.state.work.hardware, self.scenario.hardware
        if x is None:
            return {}
        used = (any(io.friction), io.passivity, io.coupling is not None) if io else (False,) * 3
        used = *used, scene.renders_clay(self.parts)
        names = "friction", "passivity_controller", "coupling", "rendered_clay"
        found = {n: float(each) for n, each, on in zip(names, x, used, strict=True) if on}
        return found | {"residual": out["residual"] - found.get("friction", 0.0)}


def torque_reached(made: np.ndarray, k: int) -> np.ndarray:
    """|tau| of shoulder and elbow that at least k rows reach [N.m]; 0 if there are fewer rows.

    Args:
        made: rows of the record, shape (n, rows.ROW).
        k: how many, at least 1.
    """
    return np.sort(np.abs(made[:, 8:10]), axis=0)[-k] if len(made) >= k else np.zeros(2)


def with_checked(scenario: Scenario, **fields: Any) -> Scenario:
    """A scenario with other fields, whose values have been checked, as has all else.

    Args:
        scenario: the scenario.
        **fields: the fields.
    """
    made = object.__new__(type(scenario))
    made.__dict__.update(scenario.__dict__, **fields)
    return made


def _drives(scenario: Scenario) -> Any:
    """The signals of a run; None where none varies."""
    if not scenario.driven:
        return None
    from .signal_ahead import Drives  # imported only if a signal varies

    return Drives(scenario)


def _columns(made: np.ndarray) -> np.ndarray:
    """Rows as the monitor takes them, shape (12, n)."""
    return np.ascontiguousarray(made[:, :12].T)


def completed(
    scenario: Scenario,
    every: int,
    kernel: Kernel,
    store: EngineStore,
    progress: Callable[[float, float], bool | None] | None = None,
    brief: bool = False,
) -> tuple[Run, float]:
    """Makes a run; repeats it if the monitor must check rows that are not kept.

    Args:
        scenario: what to run.
        every: as in Run.
        kernel: as in Run.
        store: as in Run.
        progress: as in Run.go.
        brief: as in Run.

    Returns:
        The run, and the seconds it took.
    """
    brief = brief and scenario.stop_when_unstable
    watched = every > 1 and progress is not None  # progress must not start again
    while True:
        run = Run(scenario, every, kernel, store, brief, watched)
        begin = time.perf_counter()
        try:
            run.go(progress)
            return run, time.perf_counter() - begin
        except NeedsMonitor:
            brief, watched = False, True
