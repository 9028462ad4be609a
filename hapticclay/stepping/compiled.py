"""Compiled runs: `stride`, `march` and the laws they call, compiled by numba for whole runs.

They call the engine's own functions at their addresses and hold no lock, so runs go on in parallel
threads. The machine code is kept on disk, in a folder named after the sources it was made from.
"""

from __future__ import annotations

import contextlib
import copy
import ctypes
import functools
import hashlib
import math
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic, overload

from ..model import arm, clay, signals
from ..model.clay import slab
from ..model.constants import AXES
from ..model.operator import NO_HAND
from ..model.scenario import Scenario
from . import energy, engine, loop, monitor, runge_kutta, stride
from .engine import CHUNK, Run, mujoco
from .inline import inline
from .runge_kutta import RungeKutta

FLAT = (  # laws that are compiled with their own laws written into them
    *stride.INLINED,
    arm.handle_position,
    clay.damping_at,
    clay.enter_region,
    loop.loop_coefficients,
    loop.step_loop,
    loop.vector_field,
    loop.velocity_at_sample,
    loop.whole_kick,
)
PLAIN = (
    *stride.COMPILED,
    *runge_kutta.COMPILED_STAGES,
    engine.find_root,
    engine.next_sample,
    signals.multisine_line,
)
LAST_ONLY = 1_000_000_000  # keep each so-many-th sample, and the last: the last alone
LAW: Any = {"error_model": "numpy", "no_cfunc_wrapper": True}
NOTICE = "hapticclay: compiling, this once"
CROSSINGS_ROOM = 64  # crossings between two looks at them


def _pointer(builder, address, kind):
    return builder.inttoptr(address, cgutils.ir.PointerType(kind))


@intrinsic
def _load(typing, address):
    def build(context, builder, signature, args):
        return builder.load(_pointer(builder, args[0], cgutils.ir.DoubleType()))

    return types.float64(address), build


@intrinsic
def _store(typing, address, x):
    def build(context, builder, signature, args):
        builder.store(args[1], _pointer(builder, args[0], cgutils.ir.DoubleType()))
        return context.get_dummy_value()

    return types.void(address, x), build


@intrinsic
def _call(typing, address, a, b):
    def build(context, builder, signature, args):
        byte = cgutils.ir.IntType(8)
        kind = cgutils.ir.FunctionType(cgutils.ir.VoidType(), [byte.as_pointer()] * 2)
        builder.call(
            _pointer(builder, args[0], kind), [_pointer(builder, x, byte) for x in args[1:]]
        )
        return context.get_dummy_value()

    return types.void(address, a, b), build


overload(stride.load_double)(lambda address: lambda address: _load(address))  # type: ignore
overload(stride.store_double)(lambda address, x: lambda address, x: _store(address, x))  # type: ignore
overload(stride.call_engine)(lambda address, a, b: lambda address, a, b: _call(address, a, b))  # type: ignore


def _compiled(*functions: Any) -> list[Any]:
    """The functions, each to be compiled when first called, or taken from the disk."""
    for law in (*PLAIN, *FLAT):
        body = inline(law) if law in FLAT else law
        overload(law, jit_options=LAW, strict=False)(lambda *args, body=body: body)
    options: Any = {"nogil": True, "error_model": "numpy"}
    before = numba.config.CACHE_DIR
    try:
        numba.config.CACHE_DIR = str(cache_folder())
        return [numba.njit(cache=True, **options)(f) for f in functions]
    except (OSError, RuntimeError):  # nowhere to keep it
        return [numba.njit(**options)(f) for f in functions]
    finally:
        numba.config.CACHE_DIR = before


def _whole(g, muscle, commanded, table, engine, run, rows, crossings, most, room):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """stride.step_many, compiled like the laws."""
    return stride.step_many(g, muscle, commanded, table, engine, run, rows, crossings, most, room)


def cache_folder() -> Path:
    """Folder of the machine code, in NUMBA_CACHE_DIR or the user's cache, named by the sources."""
    digest = hashlib.sha256(numba.__version__.encode())
    package = Path(__file__).resolve().parents[1]
    for file in sorted((*package.glob("model/*.py"), *package.glob("stepping/*.py"))):
        digest.update(file.read_bytes())
    root = (
        os.environ.get("NUMBA_CACHE_DIR")
        or os.environ.get("XDG_CACHE_HOME")
        or Path.home() / ".cache"
    )
    return Path(root) / "hapticclay" / digest.hexdigest()[:16]


_stride, _calm, _march, _once = _compiled(
    _whole, monitor.is_quiet, runge_kutta.march, runge_kutta.march_once
)


def _addresses(*names: str) -> list[int]:
    """Addresses of functions of the engine."""
    library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("*mujoco.*"))))
    found = [ctypes.cast(getattr(library, name), ctypes.c_void_p).value for name in names]
    return [x for x in found if x is not None]


MJ_STEP, MJ_FORWARD = _addresses("mj_step", "mj_forward")


class EngineStore:
    """Engines of one thread, used by run after run: one with clay, one without.

    Args:
        models: to copy, by whether there is clay; missing ones are built when needed.
    """

    def __init__(self, models: dict[bool, mujoco.MjModel]):
        self.engines: dict[bool, tuple[mujoco.MjModel, mujoco.MjData, stride.StrideEngine]] = {}
        for with_clay, model in models.items():
            self._take(with_clay, copy.copy(model))
        self.rows = np.empty((CHUNK - 1, stride.STRIDE_ROW))

    def _take(self, with_clay: bool, model: mujoco.MjModel) -> None:
        data = mujoco.MjData(model)
        views = data.qpos, data.qvel, data.ctrl, data.qfrc_applied, _timestep(model)
        at = MJ_STEP, model._address, data._address, *(x.ctypes.data for x in views)
        self.engines[with_clay] = model, data, stride.StrideEngine(*at)

    def engine(self, s: Scenario) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The engine as engine.build would make it, at rest.

        Args:
            s: the scenario.

        Returns:
            (model, data).
        """
        if (s.clay is not None) not in self.engines:
            self._take(s.clay is not None, engine.build(s))
        model, data, _ = self.engines[s.clay is not None]
        model.opt.timestep = s.dt
        for i, limit in enumerate(s.torque_limit):
            model.actuator_ctrlrange[i] = -limit, limit
        mujoco.mj_resetData(model, data)
        return model, data


class NativeLeapfrog(Run):
    """The leapfrog, compiled: a chunk of steps at a time, borders included.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        bench: engines to use; None for its own.
        quiet: keep no samples, for `brief` alone; raise NeedsMonitor where the monitor would look.
    """

    def __init__(
        self, scenario: Scenario, every: int, bench: EngineStore | None = None, quiet: bool = False
    ):
        self.bench = bench or EngineStore({})
        super().__init__(scenario, every)
        s, engine = scenario, self.bench.engines[scenario.clay is not None][2]
        th = s.operator or NO_HAND
        given = stride.Given(
            s.gain, s.force, s.origin, s.torque_limit, stride.Hand(th.mass, th.damper, th.spring),
            s.shaping, s.operator is not None, s.clay is not None, s.dt, s.t_max, self.last,
        )  # fmt: skip
        self.now = np.zeros(1, stride.STATE)
        self.now["loop"] = loop.initial_state(s.start, s.velocity)
        self.now["fine"], self.now["struck"] = math.inf, 1
        self.now["clay"] = *self.regions.base, *self.regions.rate
        self.now["index"] = self.regions.index
        self.rows, self.filled = self.bench.rows, 0
        self.crossed = np.empty((CROSSINGS_ROOM, 4))
        given = (
            given,
            _signal_lines(self.muscle),
            _signal_lines(self.command),
            self.regions.table,
            engine,
        )
        self.given = (*given, self.now, self.rows, self.crossed)
        w1, w2 = self.data.qvel
        self.first = energy.stored_energy(th, w1, w1 + w2, s.start, s.velocity)
        self.quiet = quiet
        self.calm = s.stop and every == 1  # so far; later `look` may want all rows once more
        self.swings, self.seen = np.zeros((2, 6)), np.array([0, -1, -1, 0])

    def engine(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        return self.bench.engine(self.scenario)

    def advance(self) -> bool:
        if not self.quiet:
            self.before = self.now.copy(), self.data.qpos.copy(), self.data.qvel.copy()
        code, self.filled, n = _stride(*self.given, CHUNK - 1, CHUNK - 1)
        now = self.now[0]
        self.t, self.i, self.steps = float(now["t"]), int(now["i"]), int(now["steps"])
        for axis, *crossing in self.crossed[:n].tolist():
            self.crossings.append(engine.Crossing(AXES[int(axis)], *crossing))
        if code == stride.NOT_FINITE:
            raise NeedsMonitor if self.quiet else ArithmeticError
        if code:
            self.finish("finished" if code == stride.FINISHED else "time limit")
        return True

    def flush(self) -> None:
        n, self.filled = self.filled, 0
        if self.quiet:
            if not n or not self._still_calm(n):
                raise NeedsMonitor
            if self.outcome is not None:
                self.outcome = self.watch.end(self.outcome)
                self.end = self.rows[n - 1, 2:].tolist()
            self.looked += n
            return
        rows = self.rows[:n].T.copy()
        good = self.judge(rows[:12], lambda: rows[12:])
        if self.outcome is not None and self.end_time is None:  # the ledger ends with the good rows
            self.now[:], self.data.qpos[:], self.data.qvel[:] = self.before
            _stride(*self.given, CHUNK - 1, good)

    def look(self, rows: np.ndarray) -> tuple[int, monitor.Outcome | None]:
        """As Run.look; the monitor sees the rows of a quiet run only once it is no longer quiet.

        Args:
            rows: shape (12, n).
        """
        if self.calm:
            if self._still_calm(rows.shape[1]):
                return rows.shape[1], None
            self.calm = False
            for index, earlier, _ in self.kept:
                self.watch.look(earlier, int(index[0]))
        return super().look(rows)

    def _still_calm(self, n: int) -> bool:
        """Whether n more rows give the monitor nothing to report; at the end it gets the counts."""
        if not _calm(self.rows, n, *self.scenario.torque_limit, self.swings, self.seen):
            return False
        if self.outcome is not None:
            watch = self.watch
            watch.seen, watch.moved, watch.unbound, watch.often = self.seen.tolist()
        return True

    def brief(self) -> tuple[Any, ...]:
        if not self.quiet:
            return super().brief()
        px, py, vx, vy, fx, fy, _, _, _, _, bx, by = self.end
        last = (px, py), (vx, vy), (fx, fy), clay.viscous_force(bx, by, vx, vy), (bx, by)
        return self.outcome, self.steps, self.crossings, last, self.balance()

    def balance(self) -> dict[str, float]:
        px, py, vx, vy, w1, w2 = self.now["last"][0].tolist()
        last = energy.stored_energy(
            self.scenario.operator or NO_HAND, w1, w1 + w2, (px, py), (vx, vy)
        )
        made = self.looked > 0
        return energy.energy_balance(
            self.now["work"][0].tolist(), self.first if made else last, last
        )


class NativeRungeKutta(RungeKutta):
    """The accurate run, compiled: many samples at a time, and each step on the way to a border.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
    """

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        views = (
            self.data.qpos,
            self.data.qvel,
            self.data.qacc,
            self.data.ctrl,
            self.data.qfrc_applied,
        )
        at = (x.ctypes.data for x in views)
        self.arm = runge_kutta.MarchEngine(MJ_FORWARD, self.model._address, self.data._address, *at)
        self.y, self.work = np.empty(runge_kutta.STATES), np.empty((6, runge_kutta.STATES))
        self.room = np.empty((CHUNK, runge_kutta.MARCH_ROW))

    def go(self, progress: Any) -> None:
        """As Run.go, without the callback.

        Args:
            progress: as in Run.go.
        """
        Run.go(self, progress)

    def _given(self) -> tuple[Any, ...]:
        y = self.y
        y[:2], y[2:4], y[4:] = self.data.qpos, self.data.qvel, self.data.act
        return (
            self.c,
            self.regions.b(self.t),
            self.scenario.force,
            self.scenario.clay is not None,
            self.arm,
        )

    def _take(self) -> None:
        self.data.qpos[:], self.data.qvel[:], self.data.act[:] = self.y[:2], self.y[2:4], self.y[4:]

    def advance(self) -> bool:
        i, dt = self.i, self.scenario.dt
        n = min(self.last - i, CHUNK - len(self.rows)) if self.t == i * dt else 0
        if n > 0:
            low, high = tuple(self.regions.low), tuple(self.regions.high)
            given, rows = self._given(), self.room[:n]
            made = _march(
                *given, dt, self.substeps, low, high, self.scenario.origin, self.y, self.work, rows
            )
            self._take()
            if made:
                self.rows += rows[:made].tolist()
                self.b += [self.regions.b(self.t)] * made
                self.i, self.t, self.steps = (
                    i + made,
                    (i + made) * dt,
                    self.steps + made * self.substeps,
                )
                return len(self.rows) >= CHUNK
        return super().advance()

    def _leap(self, h: float) -> None:
        _once(*self._given(), h, self.y, self.work)
        self._take()


class NeedsMonitor(Exception):
    """A run to repeat under the monitor."""


class BatchPool:
    """What the threads of a batch share, and what each has of its own.

    Args:
        every: keep each every-th sample, and the last.
    """

    def __init__(self, every: int):
        self.every = every
        self.own = threading.local()
        self.models = {
            x.clay is not None: engine.build(x)
            for x in (Scenario(), Scenario(clay=slab(0.0, 0.0, 1.0)))
        }

    def _go(self, scenario: Scenario, every: int, quiet: bool) -> tuple[NativeLeapfrog, float]:
        """The run, made, and the seconds it took."""
        if not hasattr(self.own, "bench"):
            self.own.bench = EngineStore(self.models)
        run = NativeLeapfrog(scenario, every, self.own.bench, quiet)
        begin = time.perf_counter()
        run.go(None)
        return run, time.perf_counter() - begin

    def run(self, scenario: Scenario) -> tuple[NativeLeapfrog, float]:
        """Makes a run.

        Args:
            scenario: one that `NativeLeapfrog` can run.

        Returns:
            The run, and the seconds it took.
        """
        return self._go(scenario, self.every, False)

    def brief(self, scenario: Scenario) -> tuple[Any, ...]:
        """The end of a run, without its samples.

        Args:
            scenario: one that `NativeLeapfrog` can run.

        Returns:
            As Run.brief.
        """
        if scenario.stop:
            with contextlib.suppress(NeedsMonitor):
                return self._go(scenario, LAST_ONLY, True)[0].brief()
        return self._go(scenario, LAST_ONLY, False)[0].brief()


def _timestep(model: mujoco.MjModel) -> np.ndarray:
    """A view of model.opt.timestep, shape (1,)."""
    head = np.ctypeslib.as_array((ctypes.c_double * 256).from_address(model._address))
    before = model.opt.timestep
    found = np.ones(256, dtype=bool)
    for mark in (0.0123456789, 0.00987654321):
        model.opt.timestep = mark
        found &= head == mark
    model.opt.timestep = before
    (at,) = np.flatnonzero(found)
    return head[at : at + 1]


def _signal_lines(signal: Any) -> np.ndarray:
    """A signals.Signal, one row a line: omega [rad/s], phase x, y [rad], amplitude x, y."""
    if signal is None:
        return np.zeros((0, 5))
    return np.column_stack(
        (signal.omega, signal.phase, np.tile(signal.amplitude, (len(signal.omega), 1)))
    )


@functools.cache
def warm(accurate: bool) -> None:
    """Compiles, or loads the machine code, before the first run; Ctrl-C waits for the end of it.

    Args:
        accurate: whether for accurate runs.
    """
    entry = "runge_kutta.march" if accurate else "compiled._whole"
    told = (
        NOTICE
        if sys.stderr and sys.stderr.isatty() and not any(cache_folder().rglob(f"{entry}-*.nbi"))
        else ""
    )
    print(end=told, file=sys.stderr, flush=True)
    caught: list[object] = []
    mine = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, lambda *what: caught.append(what)) if mine else None
    try:
        for damping in (None, slab(1.0, 0.0, 1.0)):
            s = Scenario(clay=damping, t_max=1e-2, integrator="accurate" if accurate else "fast")
            (NativeRungeKutta if accurate else NativeLeapfrog)(s, 1).go(None)
    finally:
        print(end=told and f"\r{' ' * len(told)}\r", file=sys.stderr, flush=True)
        if before is not None:
            signal.signal(signal.SIGINT, before)
    if caught:
        raise KeyboardInterrupt
