"""A run step by step, for a loop of one's own around it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..errors import ParameterError, numbers_of, pair
from ..model.hardware import JOINTS
from ..model.plausible import warn_of
from ..model.sampled_controller import Controller
from ..model.scenario import Scenario
from ..stepping.engine import warnings_caught
from ..stepping.monitor import Outcome
from ..stepping.run import STEPWISE, borrowed_store, kind_of
from . import record

MOST = 1e6  # largest force [N] and torque [N.m] that may be given


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


@checked
class Simulation:
    """A run that makes a step when it is told to, to the same numbers as `simulate`.

        with hc.Simulation(scenario) as sim:
            while sim.outcome is None:
                v = sim.state.v
                sim.step(force=(1.0 - 10.0 * v[0], 0.0))
        record = sim.record()

    A step leads from one sample to the next, dt later; a border in its way is landed on. As in
    `simulate` the samples are judged 4095 at a time: a verdict of instability comes late by so many
    steps at most, and the record ends where it was due.

    Args:
        scenario: what to run.

    Raises:
        ParameterError: scenario is of another type, or refused as by `simulate`.
    """

    def __init__(self, scenario: Scenario):
        if not isinstance(scenario, Scenario):
            bound = "must be a Scenario, as constant_cut() returns"
            raise ParameterError("scenario", scenario, bound)
        warn_of(scenario)
        self.scenario = scenario
        self._store = borrowed_store(STEPWISE)
        self._run = kind_of(scenario)(scenario, 1, STEPWISE, self._store.__enter__())
        self._wall = 0.0
        self._state: Sample | None = None
        self._torque: tuple[float, float] | None = None
        self._record: record.Record | None = None

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Gives the engine back, after which no step can be made."""
        if self._store is not None:
            if self._run.filled or self._run.looked:
                self.record()  # while rows and state are this run's
            self._store.__exit__(None, None, None)
            self._store = None

    @property
    def outcome(self) -> Outcome | None:
        """How the run ended; None while it goes on."""
        return self._run.outcome

    @property
    def t(self) -> float:
        """Time of the present sample [s]."""
        return self._run.t

    @property
    def state(self) -> Sample:
        """The present sample, under the force and torques now in effect.

        What belongs to a sample (velocity, forces, torques) also depends on what acts after it, so
        it is what a step from here on would record.
        """
        if self._state is None:
            if self._run.outcome is None:
                if self._store is None:
                    raise RuntimeError("the simulation is closed")
                found = {"t": np.array([self._run.i * self.scenario.dt]), **self._run.ahead()}
            else:
                found = {name: getattr(self.record(), name) for name in Sample._fields}
            last = {name: x[-1] for name, x in found.items()}
            self._state = Sample(**last)
        return self._state

    def step(
        self,
        force: Sequence[float] | None = None,
        torque: Sequence[float] | None = None,
    ) -> None:
        """Makes a step; does nothing once the run has ended.

        Args:
            force: muscle force uh on the handle from this sample on [N], in place of the
                scenario's constant force; None for the one in effect.
            torque: torques of shoulder and elbow motor from this sample on [N.m], in place of the
                controller's; with control="sampled" and from the first step on. None for those in
                effect.

        Raises:
            ParameterError: a value is no finite number within 1e6, or torques come too late, or
                without control="sampled".
            RuntimeError: the simulation is closed.
        """
        if self._store is None:
            raise RuntimeError("the simulation is closed")
        if self.outcome is not None:
            return
        if force is not None:
            force = pair("force", force, -MOST, MOST, unit="N")
            if force != self._run.scenario.force:
                self._run.change_force(force)
        if torque is not None:
            self._drive(numbers_of("torque", torque, JOINTS, -MOST, MOST, unit="N.m"))
        self._state = None
        run = self._run
        begin = time.perf_counter()
        with warnings_caught():
            run.step()
        self._wall += time.perf_counter() - begin

    def record(self) -> record.Record:
        """The record up to the last sample stepped from; from then on the simulation has ended.

        That of a run which had not ended has the outcome "interrupted".

        Raises:
            RuntimeError: no step has been made.
        """
        if self._record is not None:
            return self._record
        if self._run.outcome is None:
            if not (self._run.filled or self._run.looked):
                raise RuntimeError("no step has been made")
            self._run.interrupt()
        self._record = record.Record.of(self._run, self._wall)
        return self._record

    def _drive(self, torque: tuple[float, ...]) -> None:
        if self._torque is None:
            if self.scenario.control != "sampled":
                bound = "must be 'sampled' where torques are given"
                raise ParameterError("control", self.scenario.control, bound)
            if self._run.i or self.scenario.controller:
                bound = "must be given from the first step on, and not beside a controller"
                raise ParameterError("torque", torque, bound)
            own: Any = self._run
            own.take_over(Controller(lambda *measured: (self._torque, ())))
        self._torque = torque[0], torque[1]
