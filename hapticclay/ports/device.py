"""The simulated device: an arm and a hand, driven by forces and measured by simulated hardware."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, part
from ..arms.joint_law import JointPD
from ..arms.mjcf_arm import MjcfArm
from ..columns.log import columns_of
from ..errors import Bound, ParameterError, Real
from ..model.constants import TS
from ..model.operator import Operator
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..simulation.stepwise import Simulation
from .commands import Numbers
from .driven_arm import LARGEST_FORCE, Device, Drive, Sensed, driven_arm

LONGEST = 1e5  # [s] longest session
FASTEST = 100.0  # [m/s] of a hand
HOLD = Operator(0.25, 5.0, 200.0)  # a hand that holds the handle of an arm from a file at its pose
LONGEST_STEP = 1e-3  # [s] of such an arm, where a scenario does not say


@part("hand.")
class Trajectory:
    """Target of the hand over time: straight from point to point, at rest after the last.

    Attributes:
        t: times [s], ascending, -1e9 to 1e9, shape (n,).
        points: positions of the handle from its start [m], -10 to 10, no further apart than a hand
            of 100 m/s moves meanwhile, shape (n, 2), or (n, 3) for an arm that moves along z too.
    """

    t: Annotated[tuple[Real, ...], Bound(-1e9, 1e9, "s")]
    points: Annotated[tuple[tuple[Real, ...], ...], Bound(-10.0, 10.0, "m")]

    def __post_init__(self):
        if not self.t or len(self.t) != len(self.points):
            raise ParameterError("hand.t", self.t, "must have a place for each time")
        if {len(p) for p in self.points} not in ({2}, {3}):
            bound = "must have x and y each, or x, y and z"
            raise ParameterError("hand.points", self.points, bound)
        if any(b <= a for a, b in zip(self.t[:-1], self.t[1:], strict=True)):
            raise ParameterError("hand.t", self.t, "must ascend")
        for i in range(1, len(self.t)):
            span, way = self.t[i] - self.t[i - 1], math.dist(self.points[i], self.points[i - 1])
            if way > FASTEST * span:
                bound = f"must be within {FASTEST:g} m/s; the point before is {way:.3g} m away"
                raise ParameterError(f"hand.points[{i}]", self.points[i], f"{bound}, {span:.3g} s")

    def at(self, t: float) -> tuple[Numbers, Numbers]:
        """Position [m] and velocity [m/s] at a time.

        Args:
            t: the time [s].
        """
        i = int(np.searchsorted(self.t, t, side="right"))
        if i in (0, len(self.t)):
            point = self.points[min(i, len(self.t) - 1)]
            return point, (0.0,) * len(point)
        before, then = self.points[i - 1], self.points[i]
        span, after = self.t[i] - self.t[i - 1], t - self.t[i - 1]
        rate = tuple((b - a) / span for a, b in zip(before, then, strict=True))
        return tuple(a + v * after for a, v in zip(before, rate, strict=True)), rate

    @classmethod
    def to(cls, target: Numbers) -> Trajectory:
        """A hand with a constant target.

        Args:
            target: the position [m].
        """
        return cls((0.0,), (target,))

    @classmethod
    @checked
    def of_file(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Reads a trajectory from a log with the columns t [s], x and y, and perhaps z [m].

        A unit in the name of a column, as in "x [mm]", or in a row below the names is converted.

        Args:
            path: the file.

        Raises:
            ParameterError: the file cannot be read, has other columns, a cell that is no number, or
                a unit that does not fit.
        """
        names = {"t": ("s",), "x": ("m",), "y": ("m",)}
        found = columns_of("hand", path, names, {"z": ("m",)})
        t, *points = (column.tolist() for column in found.values())
        return cls(tuple(t), tuple(zip(*points, strict=True)))


class SimulatedDevice(Device):
    """The arm and hand of a scenario, driven by a client instead of the controller.

    A force acts through the transposed Jacobian at the measured joint angles. It is held for a
    control sample, limited by the torque limits and delayed as the scenario's hardware says.
    """

    paced = False  # the clock of a service advances it

    def __init__(
        self,
        scenario: Scenario,
        *,
        period: float | None = None,
        hand: Trajectory | None = None,
        largest_force: float = LARGEST_FORCE,
        clay: bool = False,
        every: int = 1,
    ):
        """Makes the device, at rest; its record keeps each every-th sample."""
        self._scenario, self._samples = device_scenario(scenario, period, clay)
        self._hand = None if hand is None else _follower(hand, self.scenario)
        self._arm = driven_arm(self.scenario, largest_force)
        driven = replace(self.scenario, controller=self._arm.controller)
        self._simulation = Simulation(driven, every=every)

    @property
    def scenario(self) -> Scenario:
        return self._scenario

    @property
    def t(self) -> float:
        return self._simulation.t

    @property
    def sensed(self) -> Sensed:
        return self._arm.sensed

    @property
    def force(self) -> Numbers:
        return self._arm.force

    @property
    def torques(self) -> Numbers:
        return self._arm.asked.torques

    @property
    def ended(self) -> str:
        outcome = self._simulation.outcome
        return "" if outcome is None else str(outcome)

    def drive(self, drive: Drive) -> Numbers:
        return self._arm.drive(drive)

    def advance(self, samples: int | None = None) -> None:
        steps = round(float(self.scenario.Ts or self.scenario.dt) / self.scenario.dt)
        n = steps * (self._samples if samples is None else samples)
        force = None if self._hand is None else self._hand(self.t)
        self._simulation.advance(n, force=force)

    def record(self) -> Record:
        """Stops the device and returns the record so far, without the law of its motors."""
        return replace(self._simulation.record(), scenario=self.scenario)


def ended_as_planned(record: Record) -> Record:
    """A record of a session that lasted as long as it was to last."""
    if record.outcome.code != "interrupted":
        return record
    return replace(record, outcome=replace(record.outcome, code="time limit"))


def device_scenario(scenario: Scenario, period: float | None, clay: bool) -> tuple[Scenario, int]:
    """The scenario of a device, and the number of control samples per period."""
    Ts = scenario.Ts
    if Ts is None and period is not None:
        Ts = period / math.ceil(period / TS - 1e-9)
    changes: dict[str, Any] = {} if Ts is None else {"Ts": Ts}
    if scenario.Ts is None and Ts is not None:
        changes["dt"] = Ts / math.ceil(Ts / scenario.dt - 1e-9)
    out = replace(
        scenario,
        control="sampled",
        controller=limp(scenario),
        clay=scenario.clay if clay else None,
        render="physical" if clay and scenario.clay else scenario.render,
        length=None,
        t_max=LONGEST,
        stop_when_unstable=False,
        **changes,
    )
    sample = float(out.Ts or out.dt)
    return out, samples_of(period, sample)


def samples_of(period: float | None, sample: float) -> int:
    """Control samples of a period, one if none is given.

    Raises:
        ParameterError: it is no whole multiple of the sample.
    """
    if period is None:
        return 1
    samples = round(period / sample)
    if abs(samples * sample - period) > 1e-9 * period:
        bound = f"must be a whole multiple of the control sample, {sample:g} s"
        raise ParameterError("period", period, bound)
    return samples


def held_scenario(arm: MjcfArm, Ts: float, hand: Operator | None = None) -> Scenario:
    """An arm from a file under no law but that of programs, held by a hand at its pose."""
    return Scenario(
        name=arm.name or "arm",
        arm=arm,
        operator=hand or HOLD,
        controller=_no_gains(len(arm.names)),
        control="sampled",
        Ts=Ts,
        dt=Ts / math.ceil(Ts / LONGEST_STEP - 1e-9),
    )


def limp(scenario: Scenario) -> JointPD | None:
    """The law of an arm that no program drives: joints without gains, for one from a file."""
    return None if scenario.is_closed_form else _no_gains(len(scenario.joints))


def _no_gains(n: int) -> JointPD:
    return JointPD((0.0,) * n, (0.0,) * n)


def _follower(hand: Trajectory, scenario: Scenario) -> Any:
    """Muscle force over time with which a hand follows a trajectory."""
    if any(h is None or not h.spring for h in scenario.operators):
        bound = "needs an operator with a spring on both axes, which pulls the handle along"
        raise ParameterError("hand", hand, bound)
    axes = len(hand.points[0])
    if axes > len(scenario.axes):
        bound = f"must have {' and '.join(scenario.axes)} each, along which the handle moves"
        raise ParameterError("hand.points", hand.points, bound)
    hands = scenario.hands[:axes]

    def force(t: float) -> Numbers:
        place, rate = hand.at(t)
        pairs = zip(hands, place, rate, strict=True)
        return tuple(h.spring * p + h.damper * v for h, p, v in pairs)

    return force
