"""A run from start to end: it advances by a method, keeps the record and asks the monitor."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import math
import os
import platform
import struct
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..arguments import named
from ..errors import ParameterError
from ..model import arm, compensator, regions
from ..model.compensator import Compensator
from ..model.constants import AXES
from ..model.controller import Servo
from ..model.operator import NO_HAND
from ..model.scenario import Scenario
from ..model.spring import RESOLVED
from ..theory import gain_limit
from . import energy, engine, leapfrog, loop, monitor, path
from .engine import mujoco

CHUNK = 4096  # rows between two looks at the run (progress, Ctrl-C, outcome); fits the cache
STORED = 8  # that one store keeps: two of an arm, with clay and without
CROSSINGS_ROOM = 64  # crossings between two looks
SPRING_STEPS = 10_000  # parts of a step that springs may need; at most a second or two each


@named
@dataclass(frozen=True)
class Crossing:
    """The handle crossed a border.

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
    """The clay held the handle still.

    Attributes:
        axis: "x" or "y" where that axis alone was held by its own law, "xy" for the handle as a
            whole.
        start: when it came to rest [s].
        end: when it moved on [s]; None if it still rested at the end of the run.
    """

    axis: str
    start: float
    end: float | None = None


class State(dict[str, Any]):
    """The state of a run, by name; its arrays are memoryviews of a record that compiled loops use.

    Args:
        fields: (name, type, length of an array), as path.STATE.

    Attributes:
        record: the record; the numbers among its fields are what `push` left there.
    """

    def __init__(self, fields: list[Any]):
        fields = sorted(fields, key=len)  # numbers first
        memory: Any = np.zeros(1, _type_of(fields))
        self.record: Any = memory[0]
        self._names = [x[0] for x in fields if len(x) == 2]
        self._format = struct.Struct(
            "".join({"f8": "d", "i8": "q"}[x[1]] for x in fields[: len(self._names)])
        )
        self._bytes = memoryview(memory).cast("B")
        self.pull()
        for name, kind, n in fields[len(self._names) :]:
            at = memory.dtype.fields[name][1]
            self[name] = self._bytes[at : at + 8 * n].cast("d" if kind == "f8" else "q")

    def zero(self) -> State:
        """Makes everything zero."""
        self._bytes[:] = bytes(len(self._bytes))
        self.pull()
        return self

    def push(self) -> None:
        """Writes the numbers to the record."""
        self._format.pack_into(self._bytes, 0, *[self[name] for name in self._names])

    def pull(self) -> None:
        """Takes the numbers from the record."""
        self.update(zip(self._names, self._format.unpack_from(self._bytes), strict=True))

    def save(self) -> bytes:
        """Everything, to `load` later."""
        self.push()
        return bytes(self._bytes)

    def load(self, saved: bytes) -> None:
        """Takes back what `save` returned.

        Args:
            saved: that.
        """
        self._bytes[:] = saved
        self.pull()


def _type_of(fields: list[Any]) -> np.dtype[Any]:
    return np.dtype([tuple(x) for x in sorted(fields, key=len)])


def state_type(kind: type[Run]) -> np.dtype[Any]:
    """Type of the record of a run's state.

    Args:
        kind: of the run.
    """
    return _type_of(path.SCENARIO + path.STATE + kind.fields)


class Kernel(NamedTuple):
    """How the loops are run: by CPython, or compiled.

    Attributes:
        advance: path.advance, called with (run, room).
        block: rows that `leapfrog.kicks` writes at once.
        handles: (step, forward, model, data) as compiled loops call the engine; None if there are
            none.
        quiet: monitor.is_quiet, compiled; None asks the monitor itself.
        law: (law, law_data) of Engine for compiled loops, from a LawCaller or None, and the desk.
    """

    advance: Callable[[Run, int], None]
    block: int = CHUNK
    handles: Callable[[Any, Any], tuple[Any, ...]] | None = None
    quiet: Callable[..., bool] | None = None
    law: Callable[[Any, Any], tuple[Any, Any]] | None = None


def _to_next_sample(run: Run, room: int) -> None:
    s, e, begin = run.s, run.e, run.s["i"]
    while s["code"] == path.OPEN and s["i"] == begin:
        if not run.method.glide(s, e, s["filled"] + 1):
            path.careful(run.method, s, e)


PLAIN = Kernel(lambda run, room: path.advance(run.method, run.s, run.e, room))
STEPWISE = Kernel(_to_next_sample)


class NeedsMonitor(Exception):
    """A run without samples that is to be repeated with them, for the monitor."""


class EngineStore:
    """Engines and arrays that run after run uses: engines with clay and without.

    Args:
        kernel: of the runs.
    """

    def __init__(self, kernel: Kernel):
        self.kernel = kernel
        self.engines: dict[Any, tuple[Any, Any, path.Engine, path.Engine | None]] = {}
        self.states: dict[type[Run], State] = {}
        self.rows = np.empty((CHUNK - 1, path.ROW))
        self.crossings = np.empty((CROSSINGS_ROOM, 4))

    def state(self, kind: type[Run]) -> State:
        """The state of a run, all zero.

        Args:
            kind: of the run.
        """
        if kind not in self.states:
            self.states[kind] = State(path.SCENARIO + path.STATE + kind.fields)
        return self.states[kind].zero()

    def engine(self, s: Scenario) -> tuple[Any, Any, path.Engine, path.Engine | None]:
        """The engine as engine.build would make it, at rest.

        Args:
            s: the scenario.

        Returns:
            (model, data, arrays of a run for CPython, for compiled loops).
        """
        key = s.clay is not None, s.arm
        if key not in self.engines:
            if len(self.engines) >= STORED:
                del self.engines[next(iter(self.engines))]  # the one longest there
            self.engines[key] = self._equip(engine.build(s))
        model, data, *_ = self.engines[key]
        model.opt.timestep = s.dt
        for i, limit in enumerate(s.torque_limit):
            model.actuator_ctrlrange[i] = -limit, limit
        engine.turn_dampers(model, s)
        mujoco.mj_resetData(model, data)
        return self.engines[key]

    def _equip(self, model: Any) -> tuple[Any, Any, path.Engine, path.Engine | None]:
        data, block = mujoco.MjData(model), self.kernel.block
        none = np.zeros((0, 5))
        arrays: Any = (
            data.qpos, data.qvel, data.qacc, data.ctrl, data.qfrc_applied,
            engine.timestep_view(model), regions.region_table(None, None), none, none, none,
            self.rows, self.crossings,
            np.zeros((block, leapfrog.RAW)), np.zeros((block, leapfrog.VARIED)),
            none, none, none, none, none, none, none, np.zeros(0),
        )  # fmt: skip
        desk: Any = np.zeros(0)
        views: Any = map(memoryview, arrays)
        calls: Any = (mujoco.mj_step, mujoco.mj_forward, model, data)
        plain = path.Engine._make((*calls, *views, None, None, memoryview(desk)))
        native, kernel = None, self.kernel
        if kernel.handles and kernel.law:
            calls, own = kernel.handles(model, data), kernel.law(None, desk)
            native = path.Engine._make((*calls, *arrays, *own, desk))
        return model, data, plain, native


_idle: dict[Kernel, list[EngineStore]] = {}  # engines that no run uses


@contextlib.contextmanager
def borrowed_store(kernel: Kernel) -> Iterator[EngineStore]:
    """Engines for one run, made anew only while others are in use.

    Args:
        kernel: of the run.
    """
    idle = _idle.setdefault(kernel, [])
    try:
        store = idle.pop()
    except IndexError:
        store = EngineStore(kernel)
    yield store
    idle.append(store)  # but not after an exception


class Run:
    """One run of a scenario by a method; this class makes its steps and keeps their results.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        kernel: how the loops are run.
        store: engines to use; None for its own.
        brief: keep no samples, for `brief` alone.
        watched: let the monitor look at all rows; else NeedsMonitor is raised where it has to look
            at rows that are not kept.

    Raises:
        ParameterError: a control callback is installed in the engine, which would interfere.

    Attributes:
        last: number of whole steps.
        pause: index of the sample to pause at.
    """

    fields: list[Any] = []  # of the state, beside those of path
    method: Any = None
    first_loop: Any = None  # of a method that has a state `loop`: what it is at the start
    beyond = "the arm is stretched or folded"  # why the loops cannot go on

    def __init__(
        self,
        scenario: Scenario,
        every: int,
        kernel: Kernel = PLAIN,
        store: EngineStore | None = None,
        brief: bool = False,
        watched: bool = False,
    ):
        if mujoco.get_mjcb_control() is not None:
            bound = "the engine must be free of control callbacks"
            raise ParameterError("mjcb_control", mujoco.get_mjcb_control(), bound)
        self.scenario, self.every, self.kernel = scenario, every, kernel
        self.store = store or EngineStore(kernel)
        self.model, self.data, self.e, self.native = self.store.engine(scenario)
        self.drives = _drives(scenario)
        self.muscle, self.command = self.drives.get("muscle"), self.drives.get("command")
        self.last = math.floor(scenario.t_max / scenario.dt + 1e-6)
        self.table = regions.region_table(scenario.clay, scenario.length)
        grows = scenario.clay and scenario.clay.grows
        self.varies = bool(self.muscle or self.command or grows)  # from step to step
        self._arrays(table=self.table, **{name: d.table for name, d in self.drives.items()})
        self.s = self.store.state(type(self))
        self.pause = math.inf
        self.watch = monitor.StabilityMonitor(scenario)
        self.looked = 0  # samples judged so far
        self.kept: list[tuple[np.ndarray, np.ndarray]] = []  # index, rows
        self.crossings: list[Crossing] = []
        self.stops: list[Stop] = []
        self.rendered = np.zeros((0, 2))  # force of the clay where b v does not tell it
        self.rendered_kept: list[np.ndarray] = []
        self.last_rendered: Any = None
        self.ground: Any = None  # of clay that stays cut, share of each cell that is left
        self.outcome: monitor.Outcome | None = None
        self.end_time: float | None = None
        self.without_samples = brief
        # nothing to report so far; later the monitor may want all rows once more
        self.calm = kernel.quiet is not None and scenario.stop and not watched
        self.swings, self.seen = np.zeros((2, monitor.QUIET)), np.array([0, -1, -1, 0])
        self._start()

    def _arrays(self, **arrays: Any) -> None:
        """Gives arrays to the loops."""
        self.e = self.e._replace(**{name: memoryview(x) for name, x in arrays.items()})
        self.native = self.native and self.native._replace(**arrays)

    def _start(self) -> None:
        """Puts the handle to its start."""
        s, now = self.scenario, self.s
        self._tell(s)
        path.put_handle(now, self.e, *s.start, *s.velocity)
        if now["beyond"]:
            self.render()
            self.stop_rows = np.zeros((4 * CHUNK, 3))  # an axis stops and goes on in each step
            felt = np.zeros((self.kernel.block, path.FELT))
            self._arrays(stops=self.stop_rows, felt=felt)
        if now["grooved"]:
            block: Any = s.clay and s.clay.groove
            self._put(block=block.numbers, cut_at=(math.nan, math.nan))
            now["drag"], self.ground = block.damping, block.shares.copy()
            self._arrays(ground=self.ground, relief=block.relief)
        path.settle(now, self.e.table, -1)
        if now["grooved"]:
            self._put(bare=(*now["base"], *now["base"]))
            path.cut_place(now, self.e)
        self._put(old=(*now["base"], *now["rate"]), flow_old=now["flow"])
        w1, w2 = now["w"]
        self.first = energy.stored_energy(now, w1, w1 + w2, s.start, s.velocity)

    def render(self) -> None:
        """Keeps the force of the clay, which b v does not tell."""
        self.rendered = np.zeros((CHUNK - 1, 3 if self.s["grooved"] else 2))
        self._arrays(rendered=self.rendered)

    def _tell(self, s: Scenario) -> None:
        """Gives the scenario's numbers to the loops."""
        now, (x, y) = self.s, (th or NO_HAND for th in s.operators)
        for name in ("dt", "t_max"):
            now[name] = float(getattr(s, name))
        names = "gain", "origin", "torque_limit"
        self._put(force=_steady_force(s), **{x: getattr(s, x) for x in names})
        self._put(handx=(x.mass, x.damper, x.spring), handy=(y.mass, y.damper, y.spring))
        now["mobility"], now["sprung_step"] = s.mobility, spring_step(s)
        self._put(arm=s.arm.links, servox=s.servo[0].numbers, servoy=s.servo[1].numbers)
        self._tell_compensator(s.compensators)
        now["held"], now["shaping"] = int(any(s.operators)), int(s.shaping)
        now["dampers"], now["last"] = int(s.clay is not None), self.last
        angle = s.clay.angle if s.clay else 0.0
        now["turned_clay"] = int(angle != 0.0)
        now["smooth"] = s.clay.smooth if s.clay else 0
        held = s.control == "sampled" and s.render == "held"
        now["springs"] = (2 if held else 1) if s.clay is not None and s.clay.springs else 0
        now["beyond"] = int(s.clay is not None and (s.clay.yields or s.clay.springs))
        now["yields"] = (2 if s.clay.isotropic else 1) if s.clay and s.clay.yields else 0
        if s.clay and s.clay.groove:
            now["yields"], now["grooved"] = 2, 2 if s.clay.groove.damping else 1
        self._put(grain=(math.cos(angle), math.sin(angle)))

    def _tell_compensator(self, shapes: tuple[Compensator, Compensator]) -> None:
        """Gives the compensators to the loops: as printed by two numbers, others by all."""
        lags = [c.lag for c in shapes]
        if all(lag and lag[0] == 1.0 for lag in lags):
            self._put(lag=[lag[1] for lag in lags if lag])
            return
        self.s["formed"] = max(1, *(c.order for c in shapes))
        self._put(form=[x for c in shapes for x in compensator.form_numbers(c)])

    def moving_states(self) -> list[float]:
        """States of the compensators where the handle has long moved evenly."""
        s = self.scenario
        both = zip(s.compensators, s.servo, s.velocity, strict=True)
        return [
            x for c, servo, v in both for x in compensator.moving_states(c, v / servo.numbers[0])
        ]

    def _put(self, **arrays: Any) -> None:
        for name, values in arrays.items():
            array = self.s[name]
            for j, x in enumerate(values):
                array[j] = x

    @property
    def t(self) -> float:
        """Now [s]."""
        return self.s["t"]

    @property
    def i(self) -> int:
        """Index of the sample at or before now."""
        return self.s["i"]

    @property
    def steps(self) -> int:
        """Engine steps made."""
        return self.s["steps"]

    @property
    def filled(self) -> int:
        """Samples that have not been judged yet."""
        return self.s["filled"]

    def b(self) -> tuple[float, float]:
        """Clay of the present region, (x, y) [N.s/m]."""
        x, y = path.damping_now(self.s, self.t)
        return float(x), float(y)

    def advance(self, room: int = CHUNK - 1) -> None:
        """Makes steps until rows are filled, or the run is over.

        Args:
            room: largest number of rows.
        """
        if not self.filled and not (self.without_samples and self.looked):
            self._snapshot = self._save()  # of what has been judged
        try:
            self._make(room)
        finally:  # in CPython a step may raise, where the arm is exactly straight
            self._note_events()
        code = int(self.s["code"])
        if code == path.NOT_FINITE:
            raise ArithmeticError
        if code == path.UNRESOLVED:
            self.give_up()
        elif code:
            self.finish("finished" if code == path.FINISHED else "time limit")

    def _note_events(self) -> None:
        """Takes the crossings and stops of the steps just made."""
        for axis, *crossing in self.store.crossings[: int(self.s["crossed"])].tolist():
            self.crossings.append(Crossing(AXES[int(axis)], *crossing))
        if self.s["stopped"]:
            for axis, stops, t in self.stop_rows[: int(self.s["stopped"])].tolist():
                self._note_stop(("x", "y", "xy")[int(axis)], stops > 0.0, t)

    def _note_stop(self, axis: str, stops: bool, t: float) -> None:
        if stops:
            self.stops.append(Stop(axis, t))
            return
        for i in reversed(range(len(self.stops))):
            if self.stops[i].axis == axis:
                self.stops[i] = replace(self.stops[i], end=t)
                break

    def _prepare_drives(self, n: int, further: int = 0) -> tuple[float, float]:
        """Readies the signals for the next n whole steps, and further ones to look ahead.

        Returns:
            The part of the run that this covers, (begin, end) [s].
        """
        dt = self.scenario.dt
        begin = max(self.i - 1, 0) * dt
        end = min((self.i + n + 2 + further) * dt, self.scenario.t_max)
        for name, drive in self.drives.items():
            drive.prepare(begin, end)
            self._arrays(**{name: drive.table})
        return begin, end

    def _make(self, room: int) -> None:
        self.s["crossed"] = self.s["stopped"] = 0
        self.kernel.advance(self, room)

    def _save(self) -> Any:
        dents = self.table.copy() if self.s["springs"] else None
        ground = None if self.ground is None else self.ground.copy()
        return self.s.save(), self.data.qpos.copy(), self.data.qvel.copy(), dents, ground

    def _restore(self, saved: Any) -> None:
        state, self.data.qpos[:], self.data.qvel[:], dents, ground = saved
        self.s.load(state)
        if dents is not None:
            self.table[:] = dents
        if ground is not None:
            self.ground[:] = ground

    def go(self, progress: Callable[[float, float], bool | None] | None) -> None:
        """Runs to the end, until progress returns True, or until sample `pause`.

        A run that was paused is not flushed.

        Args:
            progress: called now and then with (time [s], handle x [m]); True ends the run.
        """
        try:
            while self.outcome is None and self.i < self.pause:
                self.advance(int(min(CHUNK - 1, self.pause - self.i + self.filled)))
                if self.filled >= CHUNK - 1 or self.outcome:
                    if progress and progress(self.t, self.position()[0]) and self.outcome is None:
                        self.outcome = monitor.Outcome("interrupted", self.t, self.i)
                    self.flush()
        except (ArithmeticError, ValueError) as error:
            finite = bool(np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all())
            if isinstance(error, ValueError) and finite:
                raise
            self.flush()  # beyond floating point, or the arm exactly straight
            if self.outcome is None:
                self.outcome = monitor.Outcome("out of reach", self.t, self.i, cause=self.beyond)

    def step(self) -> None:
        """Goes on to the next sample, with the kernel STEPWISE."""
        self.pause = self.i + 1
        self.go(None)

    def interrupt(self) -> None:
        """Ends the run at its last sample."""
        self.outcome = monitor.Outcome("interrupted", self.t, self.i)
        self.flush()

    def ahead(self) -> dict[str, np.ndarray]:
        """The sample that `step` would write now, as `arrays`; the run stays where it is."""
        saved, entered, n = self._save(), self.table.copy(), self.filled
        try:
            self._make(n + 1)
            return self.columns(self.store.rows[n : n + 1], n)
        finally:
            self._restore(saved)
            self.table[:] = entered

    def change_force(self, force: tuple[float, float]) -> None:
        """Goes on under another constant muscle force.

        Args:
            force: (x, y) [N].
        """
        self.scenario = replace(self.scenario, force=force)
        self._put(force=_steady_force(self.scenario))

    def uh(self, t: np.ndarray, h: float) -> np.ndarray:
        """Mean muscle force over intervals.

        Args:
            t: their centres [s], shape (n,).
            h: half their length [s].

        Returns:
            Force [N], shape (n, 2).
        """
        force = np.broadcast_to(_steady_force(self.scenario), (len(t), 2))
        return force + self.muscle.mean(t, h) if self.muscle else force

    def shift(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Change of the command over intervals.

        Args:
            begin: starts [s], shape (n,).
            end: ends [s], as begin.

        Returns:
            Change [m], shape (n, 2).
        """
        if self.command:
            return self.command(end) - self.command(begin)
        return np.zeros((len(begin), 2))

    def position(self, h: float = 0.0) -> tuple[float, float]:
        """Handle position after the joints have turned at their present rates.

        Args:
            h: time [s].

        Returns:
            (x, y) [m].
        """
        (q1, q2), (w1, w2) = self.data.qpos.tolist(), self.data.qvel.tolist()
        x, y = arm.handle_position(q1 + h * w1, q2 + h * w2, self.scenario.arm.links)
        return x - self.scenario.origin[0], y - self.scenario.origin[1]

    def finish(self, code: str) -> None:
        """Ends the run now.

        Args:
            code: as Outcome.code.
        """
        self.end_time = self.t
        self.outcome = monitor.Outcome(code, self.t, self.i)

    def give_up(self, most: int = path.MOST_STEPS) -> None:
        """Ends the run at its last sample: the steps behind it become too short.

        Args:
            most: steps that one sample may take.
        """
        cause = f"more than {most} steps in one sample"
        other = "fast" if self.scenario.integrator == "accurate" else "accurate"
        advice = f"change dt, or choose integrator {other!r}"
        step = max(self.looked + self.filled - 1, 0)
        at = step * self.scenario.dt
        self.outcome = monitor.Outcome("unresolved", at, step, cause=cause, advice=advice)
        self._cut_events(at)

    def flush(self) -> None:
        """Judges the rows since the last look."""
        n, self.s["filled"] = self.filled, 0
        if n and len(self.rendered):
            self.last_rendered = self.rendered[n - 1, :2].tolist()
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
        if self.outcome is not None and self.end_time is None and good < n:
            made = self.steps
            self._restore(self._snapshot)  # the ledger ends with the good rows
            while self.filled < good:  # in parts, where borders are many
                self._make(good)
            self.s["filled"], self.s["steps"] = 0, made

    def look(self, rows: np.ndarray) -> tuple[int, monitor.Outcome | None]:
        """Judges the next rows, as StabilityMonitor.look.

        Args:
            rows: of the record, shape (n, path.ROW).
        """
        if self.calm:
            if self._still_calm(len(rows)):
                return len(rows), None
            if self.looked and self.every != 1:
                raise NeedsMonitor
            self.calm = False
            for index, earlier in self.kept:
                self.watch.look(_columns(earlier), int(index[0]))
        return self.watch.look(_columns(rows), self.looked)

    def _still_calm(self, n: int) -> bool:
        """Whether n more rows give the monitor nothing to report; at the end it gets the counts."""
        quiet, watch = self.kernel.quiet, self.watch
        limit = self.scenario.torque_limit
        if not quiet or not quiet(self.store.rows, n, *limit, self.swings, self.seen):
            return False
        if self.outcome is not None:
            watch.seen, watch.moved, watch.unbound, watch.often = self.seen.tolist()
        return True

    def judge(self, rows: np.ndarray) -> int:
        """Takes samples into the record, up to the end of the good part of the run.

        Args:
            rows: of the record, shape (n, path.ROW).

        Returns:
            Number of samples taken.
        """
        good, found = self.look(rows)
        if found is not None:
            self.outcome, self.end_time = found, None
            self._cut_events(found.time)
        elif self.outcome is not None:
            if self.outcome.code == "interrupted":  # anywhere: the record ends with its last sample
                step = self.looked + good - 1
                self.outcome = replace(self.outcome, time=step * self.scenario.dt, step=step)
                self._cut_events(self.outcome.time)
            self.outcome = self.watch.end(self.outcome)
        if good:
            keep = np.arange(-self.looked % self.every, good, self.every)
            if self.outcome is not None and (not len(keep) or keep[-1] != good - 1):
                keep = np.append(keep, good - 1)
            everything = len(keep) == len(rows)
            self.kept.append((self.looked + keep, rows.copy() if everything else rows[keep]))
            if len(self.rendered):
                self.rendered_kept.append(self.rendered[keep])
        self.looked += good
        return good

    def _cut_events(self, t: float) -> None:
        """Leaves out what came after the end of the record."""
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
        out = {"t": t} | self._columns([rows for _, rows in self.kept])
        if self.rendered_kept:
            kept = np.concatenate(self.rendered_kept)
            out["fe"] = kept[:, :2]
            if self.ground is not None:
                out["removed"] = kept[:, 2]
        return out

    def left_ground(self) -> np.ndarray | None:
        """As Record.ground."""
        clay = self.scenario.clay
        if self.ground is None or clay is None or clay.groove is None:
            return None
        return clay.groove.relief * self.ground

    def columns(self, rows: np.ndarray, first: int) -> dict[str, np.ndarray]:
        """Rows by the names of Record's arrays, without their times.

        Args:
            rows: shape (n, path.ROW).
            first: index of the first one among those not yet judged.
        """
        out = self._columns([rows])
        if len(self.rendered):
            out["fe"] = self.rendered[first : first + len(rows), :2].copy()
        return out

    def _columns(self, rows: list[np.ndarray]) -> dict[str, np.ndarray]:
        columns = (np.concatenate([x[:, j : j + 2] for x in rows]) for j in range(0, path.ROW, 2))
        q, p, v, fh, tau, delta, b, qd = columns
        fe = np.column_stack(self._force(*b.T, *v.T))
        return dict(p=p, v=v, fh=fh, fe=fe, b=b, q=q, qd=qd, tau=tau, delta=delta)

    def _force(self, bx: Any, by: Any, vx: Any, vy: Any) -> tuple[Any, Any]:
        """Force of the clay's damping, (x, y) [N]."""
        return path.viscous_parts(self.s, bx, by, vx, vy)

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

    def balance(self) -> dict[str, float]:
        """The energy balance, as Record.energy."""
        px, py, vx, vy, w1, w2 = (float(x) for x in self.s["final"])
        last = energy.stored_energy(self.s, w1, w1 + w2, (px, py), (vx, vy))
        work = [float(x) for x in self.s["work"]][:5]
        out = energy.energy_balance(work, self.first if self.looked else last, last)
        if self.s["springs"]:
            lost, stored = self.s["sprung_energy"]
            out |= {"springs_stored": float(stored), "springs_lost": float(lost)}
        return out


def _columns(rows: np.ndarray) -> np.ndarray:
    """Rows as the monitor takes them, shape (12, n)."""
    return np.ascontiguousarray(rows[:, :12].T)


def _drives(scenario: Scenario) -> dict[str, Any]:
    """The Drive of the muscle and of the command, where they vary."""
    if not scenario.driven:
        return {}
    from .drive import Drive  # only a run that has one pays for it

    both = {"muscle": scenario.muscle, "command": scenario.command}
    return {
        name: Drive(signal, scenario.dt, name == "command")
        for name, signal in both.items()
        if signal is not None and signal.varies
    }


def _steady_force(scenario: Scenario) -> tuple[float, float]:
    """The constant part of the muscle force, (x, y) [N]."""
    (x, y), muscle = scenario.force, scenario.muscle
    if muscle is not None and not muscle.varies:
        more = muscle(0.0)
        x, y = x + float(more[0]), y + float(more[1])
    return x, y


class LeapfrogRun(Run):
    """A run by `leapfrog`."""

    fields, method = leapfrog.LEAPFROG_STATE, leapfrog.Leapfrog()

    def _start(self) -> None:
        super()._start()
        s = self.scenario
        self._put(loop=self.first_loop(s.start, s.velocity, s.servo))
        if self.s["formed"]:
            self._put(form_of=(-1.0, -1.0), form_states=self.moving_states())

    @staticmethod
    def first_loop(p: Sequence[Any], v: Sequence[Any], servo: tuple[Servo, Servo]) -> list[Any]:
        """State `loop` at the start. Floats, or arrays over runs.

        Args:
            p: handle position, (x, y) [m].
            v: handle velocity, (x, y) [m/s].
            servo: of each axis.
        """
        x = loop.initial_state(p, v, servo)
        ratio = [each.numbers[0] for each in servo] * 2
        return [a * b for a, b in zip(x[:4], ratio, strict=True)] + list(x[4:])

    def _make(self, room: int) -> None:
        if self.varies or self.s["smooth"] or self.s["grooved"] == 2:  # b varies too
            n = min(room - self.filled + 1, max(self.last - self.i, 0) + 1)
            self.s["first"] = self.i
            self._prepare_drives(n)
            self._arrays(ahead=leapfrog.steps_ahead(self, self.i, n))
        super()._make(room)


def spring_step(scenario: Scenario) -> float:
    """Longest step that resolves the springs of the clay, inf without any [s].

    The force of a spring enters a kick from the place before it, so a step must resolve the fastest
    motion that the spring can drive. Where control is continuous, that is one of the whole loop:
    the compensator may pass a force on at once, and the servo may impose a lighter handle.

    Args:
        scenario: the run.

    Raises:
        ParameterError: dt would be divided into more than SPRING_STEPS.
    """
    laws = scenario.clay.laws if scenario.clay and scenario.clay.springs else ()
    most = [max((x.k + x.k1 for x in law.springs), default=0.0) for law in laws]
    if not any(most):
        return math.inf
    if scenario.control == "sampled":
        omega = math.sqrt(max(most) * scenario.mobility)
    else:
        omega = max(gain_limit.spring_crossover(scenario, i, k) for i, k in enumerate(most))
    longest = RESOLVED / omega if omega else math.inf
    if longest * SPRING_STEPS < scenario.dt:
        bound = (
            f"must be at most {longest * SPRING_STEPS:.3g} s: in clay of {max(most):g} N/m this "
            f"loop moves at up to {omega:.3g} rad/s, and needs steps of {longest:.2g} s"
        )
        raise ParameterError("dt", scenario.dt, bound)
    return longest


def kind_of(scenario: Scenario) -> type[Run]:
    """The class that runs a scenario.

    Args:
        scenario: the scenario.
    """
    if scenario.control == "sampled":
        from .sampled import SampledRun

        return SampledRun
    if scenario.integrator == "accurate":
        from .runge_kutta import RungeKuttaRun

        return RungeKuttaRun
    return LeapfrogRun


def completed(  # noqa: PLR0913  # one a condition of the run
    scenario: Scenario,
    every: int,
    kernel: Kernel,
    store: EngineStore,
    progress: Callable[[float, float], bool | None] | None = None,
    brief: bool = False,
) -> tuple[Run, float]:
    """Makes a run; a second time if the monitor has to look at rows that are not kept.

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
    kind, brief = kind_of(scenario), brief and scenario.stop
    watched = every > 1 and progress is not None  # which must not begin anew
    while True:
        run = kind(scenario, every, kernel, store, brief, watched)
        begin = time.perf_counter()
        try:
            run.go(progress)
            return run, time.perf_counter() - begin
        except NeedsMonitor:
            brief, watched = False, True


@functools.cache
def cache_folder() -> Path:
    """Folder of the machine code, in NUMBA_CACHE_DIR or the user's cache.

    It is named by all that the code depends on: sources, versions, processor.
    """
    packages = [version(x) for x in ("numba", "llvmlite", "mujoco", "numpy")]
    digest = hashlib.sha256(repr((sys.version, packages, _processor())).encode())
    package = Path(__file__).resolve().parents[1]
    for file in sorted((*package.glob("model/*.py"), *package.glob("stepping/*.py"))):
        digest.update(file.read_bytes())
    root = (
        os.environ.get("NUMBA_CACHE_DIR")
        or os.environ.get("XDG_CACHE_HOME")
        or Path.home() / ".cache"
    )
    return Path(root) / "hapticclay" / digest.hexdigest()[:16]


def _processor() -> str:
    """Name and abilities of the processor."""
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return "".join(sorted({x for x in lines if x.startswith(("model name", "flags", "Feat"))}))
    return f"{platform.machine()} {platform.processor()}"
