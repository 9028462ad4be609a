"""A run from start to end: it advances by a method, keeps the record and asks the monitor."""

from __future__ import annotations

import bisect
import contextlib
import functools
import hashlib
import math
import os
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError
from ..model import arm, clay
from ..model.constants import AXES
from ..model.operator import NO_HAND
from ..model.scenario import Scenario
from ..model.signals import Multisine
from . import energy, engine, leapfrog, loop, monitor, path
from .engine import mujoco

CHUNK = 4096  # rows between two looks at the run (progress, Ctrl-C, outcome); fits the cache
CROSSINGS_ROOM = 64  # crossings between two looks


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


class State(dict[str, Any]):
    """The state of a run, by name; its arrays are memoryviews of a record that compiled loops use.

    Args:
        fields: (name, type, length of an array), as path.STATE.

    Attributes:
        record: the record; the numbers among its fields are what `push` left there.
    """

    def __init__(self, fields: list[Any]):
        fields = sorted(fields, key=len)  # numbers first
        memory: Any = np.zeros(1, np.dtype([tuple(x) for x in fields]))
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


class Kernel(NamedTuple):
    """How the loops are run: by CPython, or compiled.

    Attributes:
        advance: path.advance, called with (run, room).
        block: rows that `leapfrog.kicks` writes at once.
        handles: (step, forward, model, data) as compiled loops call the engine; None if there are
            none.
        quiet: monitor.is_quiet, compiled; None asks the monitor itself.
    """

    advance: Callable[[Run, int], None]
    block: int = CHUNK
    handles: Callable[[Any, Any], tuple[Any, ...]] | None = None
    quiet: Callable[..., bool] | None = None


PLAIN = Kernel(lambda run, room: path.advance(run.method, run.s, run.e, room))


class NeedsMonitor(Exception):
    """A run without samples that is to be repeated with them, for the monitor."""


class EngineStore:
    """Engines and arrays that run after run uses: engines with clay and without.

    Args:
        kernel: of the runs.
    """

    def __init__(self, kernel: Kernel):
        self.kernel = kernel
        self.engines: dict[bool, tuple[Any, Any, path.Engine, path.Engine | None]] = {}
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
        dampers = s.clay is not None
        if dampers not in self.engines:
            self.engines[dampers] = self._equip(engine.build(s))
        model, data, *_ = self.engines[dampers]
        model.opt.timestep = s.dt
        for i, limit in enumerate(s.torque_limit):
            model.actuator_ctrlrange[i] = -limit, limit
        mujoco.mj_resetData(model, data)
        return self.engines[dampers]

    def _equip(self, model: Any) -> tuple[Any, Any, path.Engine, path.Engine | None]:
        data, block = mujoco.MjData(model), self.kernel.block
        none = np.zeros((0, 5))
        arrays: Any = (
            data.qpos, data.qvel, data.qacc, data.ctrl, data.qfrc_applied,
            engine.timestep_view(model), clay.region_table(None, None), none, none, none,
            self.rows, self.crossings,
            np.zeros((block, leapfrog.RAW)), np.zeros((block, leapfrog.VARIED)),
            none, none, none,
        )  # fmt: skip
        plain = path.Engine(
            mujoco.mj_step, mujoco.mj_forward, model, data, *map(memoryview, arrays)
        )
        handles: Any = self.kernel.handles
        native = path.Engine(*handles(model, data), *arrays) if handles else None
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
        self.muscle, self.command = _build_signal(scenario.muscle), _build_signal(scenario.command)
        self.last = math.floor(scenario.t_max / scenario.dt + 1e-6)
        self.table = clay.region_table(scenario.clay, scenario.length)
        grows = scenario.clay and (scenario.clay.x.growth or scenario.clay.y.growth)
        self.varies = bool(self.muscle or self.command or grows)  # from step to step
        driven = {"muscle": self.muscle, "command": self.command}
        lines = {name: signal.lines for name, signal in driven.items() if signal}
        self._arrays(table=self.table, **lines)
        self.s = self.store.state(type(self))
        self.pause = math.inf
        self.watch = monitor.StabilityMonitor(scenario)
        self.looked = 0  # samples judged so far
        self.kept: list[tuple[np.ndarray, np.ndarray]] = []  # index, rows
        self.crossings: list[Crossing] = []
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
        s, data, now = self.scenario, self.data, self.s
        self._tell(s)
        (x, y), (ox, oy) = s.start, s.origin
        q1, q2 = arm.inverse_kinematics(ox + x, oy + y)
        r1, r2 = arm.joint_velocity(*s.velocity, arm.jacobian(q1, q2), 1.0)
        data.qpos[:], data.qvel[:] = (q1, q2), (r1, r2 - r1)
        self._put(q=data.qpos, w=data.qvel)
        now["fine"], now["struck"], now["first"] = math.inf, 1, -1
        for i in (0, 1):
            edges = self.table[clay.EDGE_ROW + i].tolist()
            now["index"][i] = bisect.bisect_right(edges, s.start[i], 1) - 1
        path.settle(now, self.e.table)
        self._put(old=(*now["base"], *now["rate"]))
        w1, w2 = now["w"]
        th = s.operator or NO_HAND
        self.first = energy.stored_energy(th, w1, w1 + w2, s.start, s.velocity)

    def _tell(self, s: Scenario) -> None:
        """Gives the scenario's numbers to the loops."""
        th, now = s.operator or NO_HAND, self.s
        for name in ("dt", "t_max"):
            now[name] = float(getattr(s, name))
        names = "gain", "force", "origin", "torque_limit"
        self._put(hand=(th.mass, th.damper, th.spring), **{x: getattr(s, x) for x in names})
        now["held"], now["shaping"] = int(s.operator is not None), int(s.shaping)
        now["dampers"], now["last"] = int(s.clay is not None), self.last
        now["landings_most"] = path.LANDINGS

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
        self._make(room)
        for axis, *crossing in self.store.crossings[: int(self.s["crossed"])].tolist():
            self.crossings.append(Crossing(AXES[int(axis)], *crossing))
        code = int(self.s["code"])
        if code == path.NOT_FINITE:
            raise ArithmeticError
        if code:
            self.finish("finished" if code == path.FINISHED else "time limit")

    def _make(self, room: int) -> None:
        self.s["crossed"] = 0
        self.kernel.advance(self, room)

    def _save(self) -> Any:
        return self.s.save(), self.data.qpos.copy(), self.data.qvel.copy()

    def _restore(self, saved: Any) -> None:
        state, self.data.qpos[:], self.data.qvel[:] = saved
        self.s.load(state)

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
                cause = "the arm is stretched or folded"
                self.outcome = monitor.Outcome("out of reach", self.t, self.i, cause=cause)

    def uh(self, t: np.ndarray, h: float) -> np.ndarray:
        """Mean muscle force over intervals.

        Args:
            t: their centres [s], shape (n,).
            h: half their length [s].

        Returns:
            Force [N], shape (n, 2).
        """
        force = np.broadcast_to(self.scenario.force, (len(t), 2))
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
        x, y = arm.handle_position(q1 + h * w1, q2 + h * w2)
        return x - self.scenario.origin[0], y - self.scenario.origin[1]

    def finish(self, code: str) -> None:
        """Ends the run now.

        Args:
            code: as Outcome.code.
        """
        self.end_time = self.t
        self.outcome = monitor.Outcome(code, self.t, self.i)

    def flush(self) -> None:
        """Judges the rows since the last look."""
        n, self.s["filled"] = self.filled, 0
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
            self.crossings = [c for c in self.crossings if c.time <= found.time]
        elif self.outcome is not None:
            if self.outcome.code == "interrupted":  # anywhere: the record ends with its last sample
                step = self.looked + good - 1
                self.outcome = replace(self.outcome, time=step * self.scenario.dt, step=step)
                self.crossings = [c for c in self.crossings if c.time <= self.outcome.time]
            self.outcome = self.watch.end(self.outcome)
        if good:
            keep = np.arange(-self.looked % self.every, good, self.every)
            if self.outcome is not None and (not len(keep) or keep[-1] != good - 1):
                keep = np.append(keep, good - 1)
            everything = len(keep) == len(rows)
            self.kept.append((self.looked + keep, rows.copy() if everything else rows[keep]))
        self.looked += good
        return good

    def arrays(self) -> dict[str, np.ndarray]:
        """The samples kept, by the names of Record's arrays."""
        t = np.concatenate([index for index, _ in self.kept]) * self.scenario.dt
        if self.end_time is not None and len(t):
            t[-1] = self.end_time
        columns = (
            np.concatenate([rows[:, j : j + 2] for _, rows in self.kept])
            for j in range(0, path.ROW, 2)
        )
        q, p, v, fh, tau, delta, b, qd = columns
        fe = np.column_stack(clay.viscous_force(*b.T, *v.T))
        return dict(t=t, p=p, v=v, fh=fh, fe=fe, b=b, q=q, qd=qd, tau=tau, delta=delta)

    def brief(self) -> tuple[Any, ...]:
        """The end of the run: outcome, steps, crossings, the last p, v, fh, fe and b, energy."""
        if self.without_samples:
            px, py, vx, vy, fx, fy, _, _, _, _, bx, by = self.last_row[2:14]
            force = clay.viscous_force(bx, by, vx, vy)
            last: Any = [(px, py), (vx, vy), (fx, fy), force, (bx, by)]
            return self.outcome, self.steps, tuple(self.crossings), last, self.balance()
        arrays = self.arrays()
        final = (arrays[name] for name in ("p", "v", "fh", "fe", "b"))
        last = [x[-1] if len(x) else (np.nan, np.nan) for x in final]
        return self.outcome, self.steps, tuple(self.crossings), last, self.balance()

    def balance(self) -> dict[str, float]:
        """The energy balance, as Record.energy."""
        px, py, vx, vy, w1, w2 = (float(x) for x in self.s["final"])
        th = self.scenario.operator or NO_HAND
        last = energy.stored_energy(th, w1, w1 + w2, (px, py), (vx, vy))
        work = [float(x) for x in self.s["work"]][:5]
        return energy.energy_balance(work, self.first if self.looked else last, last)


def _columns(rows: np.ndarray) -> np.ndarray:
    """Rows as the monitor takes them, shape (12, n)."""
    return np.ascontiguousarray(rows[:, :12].T)


def _build_signal(multisine: Multisine | None) -> Any:
    if multisine is None:
        return None
    from ..model.signals import Signal  # only a run that has one pays for it

    return Signal(multisine)


class LeapfrogRun(Run):
    """A run by `leapfrog`."""

    fields, method = leapfrog.LEAPFROG_STATE, leapfrog.Leapfrog()

    def _start(self) -> None:
        super()._start()
        self._put(loop=loop.initial_state(self.scenario.start, self.scenario.velocity))

    def _make(self, room: int) -> None:
        if self.varies:
            n = min(room - self.filled + 1, max(self.last - self.i, 0) + 1)
            self.s["first"] = self.i
            self._arrays(ahead=leapfrog.steps_ahead(self, self.i, n))
        super()._make(room)


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
    """Folder of the machine code, in NUMBA_CACHE_DIR or the user's cache, named by the sources."""
    digest = hashlib.sha256(version("numba").encode())
    package = Path(__file__).resolve().parents[1]
    for file in sorted((*package.glob("model/*.py"), *package.glob("stepping/*.py"))):
        digest.update(file.read_bytes())
    root = (
        os.environ.get("NUMBA_CACHE_DIR")
        or os.environ.get("XDG_CACHE_HOME")
        or Path.home() / ".cache"
    )
    return Path(root) / "hapticclay" / digest.hexdigest()[:16]
