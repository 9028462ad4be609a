"""A run step by step, inside a loop of your own."""

from __future__ import annotations

import contextlib
import math
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..errors import Bound, ParameterError, integer, is_series, number, numbers_of, pair
from ..kernel.engine import warnings_caught
from ..kernel.row import SHOWN
from ..model.operator import Operator
from ..scene.plausible import warn_implausible
from ..scene.scenario import Scenario
from . import record
from .engines import engine_for
from .monitor import Outcome
from .run import COLUMNS, Run, Snapshot, Workspace, joint_arrays

MOST = 1e6  # largest force [N] and torque [N.m] that may be given
MOST_GAIN = 1e6  # largest K of a scenario [1/kg]
LOOK = 0.02  # [s] of simulated time between two checks for divergence


class Sample(NamedTuple):
    """The state at a sample, as a row of a `Record`.

    Attributes:
        t: time [s].
        p: handle position [m], shape (2,).
        v: handle velocity [m/s], shape (2,).
        fh: force of the operator on the handle [N], shape (2,).
        fe: resisting force of the clay [N], shape (2,).
        b: damping of the clay [N.s/m], shape (2,).
        q: joint angles [rad], shape (2,).
        qd: joint rates [rad/s], shape (2,).
        tau: motor torques [N.m], shape (2,).
        delta: compensator output [m], shape (2,).
    """

    t: float
    p: np.ndarray
    v: np.ndarray
    fh: np.ndarray
    fe: np.ndarray
    b: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    delta: np.ndarray


PLACES = [slice(COLUMNS[name], COLUMNS[name] + 2) for name in Sample._fields[1:]]


@checked
class Simulation:
    """A run that you advance step by step, with results bit-identical to those of `simulate`.

        with hc.Simulation(scenario) as sim:
            while sim.outcome is None:
                v = sim.state.v
                sim.step(force=(1.0 - 10.0 * v[0], 0.0))
        record = sim.record()

    A step leads from one sample to the next, dt later; it ends on a border that it would cross.
    As in `simulate` the samples are judged 4095 at a time: a verdict of instability is late by at
    most so many steps, and the record ends where it was due. `diverging` detects it sooner.

    A simulation belongs to one thread at a time. It can be pickled and copied; a copy continues
    independently.

    Args:
        scenario: what to run.
        engine: as in `simulate`.
        every: keep each every-th sample in the record, and the last.
        recorded: whether a record is kept; else at most the last 4095 samples, for the monitor.
        monitored: whether the run ends when an axis is judged unstable; else it ends only at its
            limits, out of reach or above 20 m/s, and `diverging` is False. For muscle forces that
            jump, whose larger swings the monitor would mistake for growth.

    Raises:
        ParameterError: scenario is of another type, or refused as by `simulate`.
    """

    _noun = "simulation"

    def __init__(
        self,
        scenario: Scenario,
        *,
        engine: str = "auto",
        every: Annotated[int, Bound(1, 1_000_000)] = 1,
        recorded: bool = True,
        monitored: bool = True,
    ):
        self._engine, self._maker = engine, engine_for(engine, scenario.t_max / scenario.dt)
        self._workspace = Workspace()
        self._closed, self._warned, self._recorded = False, (), recorded
        self._monitored, self._every = monitored, every
        self._begin(scenario)

    def _begin(self, scenario: Scenario) -> None:
        place = scenario.clay, scenario.origin, scenario.arm, scenario.operators
        if place != self._warned:  # warn of clay out of reach and the like once
            warn_implausible(scenario)
            self._warned = place
        self._forget()
        kept: dict[str, Any] = self._kept() | {"keep_for_monitor": True}
        run = Run(scenario, engine=self._maker, workspace=self._workspace, **kept)
        self._run, self._wall = run, 0.0

    def _kept(self) -> dict[str, Any]:
        return {"every": self._every, "recorded": self._recorded, "monitored": self._monitored}

    def _forget(self) -> None:
        """Discards cached results of the run, which has changed."""
        self._state: Sample | None = None
        self._record: record.Record | None = None
        self._looked, self._diverging = -math.inf, False

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        with Alone(self) as run:
            found = {name: getattr(self, name) for name in ("_engine", "_wall")}
            return found | {"kept": self._kept(), "snapshot": run.snapshot()}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        snapshot = kept["snapshot"]
        self.__init__(snapshot.given, engine=kept["_engine"], **kept["kept"])  # type: ignore[misc]
        if snapshot.kept["torque"]:
            self._run.take_over()
        self._run.return_to(snapshot)
        self._wall = kept["_wall"]

    def close(self) -> None:
        """Closes the simulation; no further step can be made.

        Raises:
            RuntimeError: another thread uses it.
        """
        if self._closed:
            return
        with Alone(self, mends=False) as run:
            is_torn = run.row.is_torn
            if not is_torn:
                run.mend()
        if self._has_record and not is_torn:
            self.record()
        self._closed = True

    @property
    def _has_record(self) -> bool:
        return self._recorded and bool(self._run.filled or self._run.judged)

    @property
    def scenario(self) -> Scenario:
        """What is run, with the force, gain, operator and clay now in effect."""
        return mended(self).scenario

    @property
    def outcome(self) -> Outcome | None:
        """How the run ended; None while it is running."""
        return mended(self).outcome

    @property
    def t(self) -> float:
        """Time of the present sample [s]."""
        return mended(self).t

    @property
    def state(self) -> Sample:
        """The present sample, under the force and torques now in effect.

        Velocity, forces and torques of a sample also depend on what acts after it. They are those
        that a step from here would record.
        """
        if self._state is None and self._closed and self._has_record:
            record = self.record()
            self._state = Sample(**{name: getattr(record, name)[-1] for name in Sample._fields})
        if self._state is None:
            m = self._run.row.m
            self._state = sample_of(self._run.sample_time(), np.array(self.numbers()), m)
        return self._state

    def numbers(self) -> list[float]:
        """The present sample as plain numbers; cheaper than `state`.

        Returns:
            Pairs of two each, of shoulder and elbow or of x and y: q, p, v, fh, tau, delta, b, qd,
            fe, as in `Sample`; 18 numbers.
        """
        with Alone(self) as run:
            return run.numbers_ahead()

    def torque_reached(self, n: int, k: int = 1) -> list[float]:
        """|tau| of shoulder and elbow motor that at least k of the last n samples reach [N.m].

        Every 4095 samples the run is checked, and those before are left out.

        Args:
            n: number of samples, at least 1.
            k: how many reach it, at least 1; with 1 it is the largest torque.
        """
        n, k = integer("n", n, 1, 1_000_000_000), integer("k", k, 1, 1_000_000_000)
        with Alone(self) as run:
            return run.torque_reached(n, k).tolist()

    def handle(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Place of the handle [m], and its velocity half a step ago [m/s]; cheaper than `state`."""
        with Alone(self) as run:
            p, before = run.position(), run.position(-run.scenario.dt)
            vx, vy = ((a - b) / run.scenario.dt for a, b in zip(p, before, strict=True))
        return p, (vx, vy)

    @property
    def diverging(self) -> bool:
        """Whether the motion so far is unstable by the rules of the monitor.

        It is evaluated every 20 ms of simulated time. It is not a verdict: the run continues.
        """
        with Alone(self) as run:
            if run.outcome is None and run.t >= self._looked + LOOK:
                self._looked, self._diverging = run.t, run.is_diverging()
            return self._diverging or run.watch.onset is not None

    def step(
        self,
        force: Sequence[float] | None = None,
        torque: Sequence[float] | None = None,
    ) -> None:
        """Makes a step; does nothing once the run has ended.

        Args:
            force: muscle force uh on the handle from this sample on [N], in place of the
                scenario's constant force, along two or all axes of the handle; None for the one in
                effect.
            torque: torques of shoulder and elbow motor from this sample on [N.m], in place of the
                controller's; with control="sampled" and from the first step on. None for those in
                effect.

        Raises:
            ParameterError: a value is not a finite number within 1e6, or torques begin too late or
                without control="sampled".
            RuntimeError: the simulation is closed, or another thread uses it.
        """
        self.advance(1, force=force, torque=torque)

    def advance(
        self,
        n: int = 1,
        *,
        force: Sequence[float] | None = None,
        torque: Sequence[float] | None = None,
    ) -> None:
        """Makes n steps under the same action; fewer if the run ends.

        Args:
            n: number of steps, at least 1.
            force: as in `step`.
            torque: as in `step`.

        Raises:
            ParameterError: as by `step`.
            RuntimeError: as by `step`.
        """
        n = integer("n", n, 1, 1_000_000_000)
        with Alone(self) as run:
            if run.outcome is not None:
                return
            if force is not None:
                force = force_of(force, run.scenario.axes)
                if force != run.scenario.force:
                    run.change_force(force)
            if torque is not None:
                self._drive(
                    numbers_of("torque", torque, run.scenario.joints, -MOST, MOST, unit="N.m")
                )
            self._state, begin = None, time.perf_counter()
            make_steps(run, n)
            self._wall += time.perf_counter() - begin

    @checked
    def reset(self, scenario: Scenario | None = None) -> None:
        """Restarts the run.

        Args:
            scenario: what to run; None for the same.

        Raises:
            ParameterError: scenario is of another type, or refused as by `simulate`.
        """
        with Alone(self, mends=False) as run:
            self._begin(scenario or run.given)

    def snapshot(self) -> Snapshot:
        """The run as it is now, to `restore`; it can be pickled."""
        with Alone(self) as run:
            return run.snapshot()

    @checked
    def restore(self, snapshot: Snapshot) -> None:
        """Returns to a snapshot, with the record as it was.

        Args:
            snapshot: of this simulation, or of another one of the same scenario, which may have
                begun with another force, gain or operator.

        Raises:
            ParameterError: it is of another scenario, or of a simulation with another `every`,
                `recorded` or `monitored`, or with torques given where this one has none.
        """
        with Alone(self, mends=False) as run:
            self._forget()
            run.return_to(snapshot)

    def set(
        self,
        *,
        gain: tuple[float, float] | None = None,
        operator: Operator | tuple[Operator | None, Operator | None] | None = None,
        b: float | None = None,
    ) -> None:
        """Changes numbers from this sample on.

        Args:
            gain: K of x and y [1/kg]; None keeps it.
            operator: the operator's arm; None keeps it. A run without one cannot get one.
            b: damping, yield force, consistency and pressure of all clay as a multiple of those
                of the scenario that the run began with; None keeps them.

        Raises:
            ParameterError: a value is out of its bounds, or an operator would be added or removed.
        """
        with Alone(self) as run:
            gain = None if gain is None else gain_of(gain)
            changes: dict[str, Any] = {}
            if operator is not None:
                started_with_operator(run.scenario, operator)
                changes["operator"] = operator
            if b is not None:
                factor, clay = number("b", b, 0.0, 1e6), run.given.clay
                changes["clay"] = clay and clay.scaled(factor)
            self._state = None
            if changes:
                run.change(replace(run.scenario, **changes))
            if gain is not None:
                run.change_gain(gain)

    def record(self) -> record.Record:
        """The record up to the last sample stepped from; from then on the simulation has ended.

        A run that had not ended gets the outcome "interrupted".

        Raises:
            RuntimeError: no step has been made, or no record is kept.
        """
        if not self._recorded:
            raise RuntimeError("no record is kept: make the simulation with recorded=True")
        if self._record is not None:
            return self._record
        with Alone(self) as run:
            if run.outcome is None:
                if not (run.filled or run.judged):
                    raise RuntimeError("no step has been made")
                run.interrupt()
            self._record = record.Record.of(run, self._wall)
        return self._record

    def _drive(self, torque: tuple[float, ...]) -> None:
        run = self._run
        if run.controller is None:
            if run.scenario.control != "sampled":
                bound = "must be 'sampled' where torques are given"
                raise ParameterError("control", run.scenario.control, bound)
            own = run.scenario.is_closed_form and run.scenario.controller
            if run.i or own:
                bound = "must be given from the first step on, and not beside a controller"
                raise ParameterError("torque", torque, bound)
            run.torque = torque
            run.take_over()
        run.torque = torque


def make_steps(run: Run, n: int) -> None:
    """Makes n steps of a run that has not ended, fewer if it ends."""
    goal = run.i + n
    with warnings_caught():
        if not run.advance_unprepared(n):
            run.pause = goal
            run.go(None)


class Alone:
    """Access of one thread to what an owner runs, for `with`: a generator takes a step's time.

    The owner has its `_run`, whether it is `_closed`, and a `_noun` for errors. Who uses it is
    noted in one operation, by thread and frame: an access that Ctrl-C ended before its end could be
    noted is recognized, as its frame does not run any more. What Ctrl-C left half done is mended.
    """

    def __init__(self, owner: Any, mends: bool = True):
        self.owner, self.mends = owner, mends

    def __enter__(self) -> Any:
        owner, me = self.owner, (threading.get_ident(), sys._getframe(1))
        while (user := vars(owner).setdefault("_user", me)) is not me:
            if is_running(*user):
                noun = owner._noun
                raise RuntimeError(f"another thread uses this {noun}: give each thread its own")
            with _taking:
                if vars(owner).get("_user") is user:
                    del owner._user
        try:
            if owner._closed:
                raise RuntimeError(f"the {owner._noun} is closed")
            if self.mends and owner._run.pending:
                owner._run.mend()
            return owner._run
        except BaseException:
            self.__exit__()
            raise

    def __exit__(self, *error: object) -> None:
        vars(self.owner).pop("_user", None)


_taking = threading.Lock()


def is_running(thread: int, frame: Any) -> bool:
    """Whether a frame is among those that a thread runs."""
    now = sys._current_frames().get(thread)
    while now is not None and now is not frame:
        now = now.f_back
    return now is not None


def mended(owner: Any) -> Any:
    """What an owner runs, mended where Ctrl-C left something half done and nothing else uses it."""
    if owner._run.pending:
        with contextlib.suppress(RuntimeError), Alone(owner):
            pass
    return owner._run


def sample_of(t: float, row: np.ndarray, m: Any = None) -> Sample:
    """A sample from its row; m: the model of a run whose arm may be from a file."""
    pairs = [row[place] for place in PLACES]
    if m is None or not m.general:
        return Sample(t, *pairs)
    found = {name: x[None] for name, x in zip(Sample._fields[1:], pairs, strict=True)}
    found |= joint_arrays(m, found, row[None, SHOWN:])
    return Sample(t, **{name: x[0] for name, x in found.items()})


def force_of(value: object, axes: Sequence[str]) -> tuple[float, ...]:
    """Muscle force along two axes of the handle, or all [N]."""
    if len(axes) > 2 and is_series(value):
        value = tuple(value)  # type: ignore[arg-type]
        axes = axes[:2] if len(value) == 2 else axes
    return numbers_of("force", value, axes, -MOST, MOST, unit="N")


def gain_of(value: object) -> tuple[float, float]:
    """Gains K of x and y [1/kg], checked as those of a scenario."""
    return pair("gain", value, 0.0, MOST_GAIN, unit="1/kg")


def started_with_operator(scenario: Scenario, operator: object) -> None:
    """Refuses an operator for a run that began without one."""
    if not any(scenario.operators):
        bound = "must be given from the start on: this run has no operator"
        raise ParameterError("operator", operator, bound)
