"""The simulated device: an arm and a hand, driven by forces and measured by simulated hardware."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, part
from ..columns.log import columns_of
from ..errors import Bound, ParameterError
from ..model.constants import TS
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..simulation.stepwise import Simulation
from .commands import Pair
from .driven_arm import LARGEST_FORCE, Device, Drive, DrivenArm, Sensed

LONGEST = 1e5  # [s] longest session
FASTEST = 100.0  # [m/s] of a hand


@part("hand.")
class Trajectory:
    """Target of the hand over time: straight from point to point, at rest after the last.

    Attributes:
        t: times [s], ascending, -1e9 to 1e9, shape (n,).
        points: positions of the handle [m], -10 to 10, no further apart than a hand of 100 m/s
            moves meanwhile, shape (n, 2).
    """

    t: Annotated[tuple[float, ...], Bound(-1e9, 1e9, "s")]
    points: Annotated[tuple[tuple[float, ...], ...], Bound(-10.0, 10.0, "m")]

    def __post_init__(self):
        if not self.t or len(self.t) != len(self.points):
            raise ParameterError("hand.t", self.t, "must have a place for each time")
        if any(len(p) != 2 for p in self.points):
            raise ParameterError("hand.points", self.points, "must have x and y each")
        if any(b <= a for a, b in zip(self.t[:-1], self.t[1:], strict=True)):
            raise ParameterError("hand.t", self.t, "must ascend")
        for i in range(1, len(self.t)):
            span, way = self.t[i] - self.t[i - 1], math.dist(self.points[i], self.points[i - 1])
            if way > FASTEST * span:
                bound = f"must be within {FASTEST:g} m/s; the point before is {way:.3g} m away"
                raise ParameterError(f"hand.points[{i}]", self.points[i], f"{bound}, {span:.3g} s")

    def at(self, t: float) -> tuple[Pair, Pair]:
        """Position [m] and velocity [m/s] at a time.

        Args:
            t: the time [s].
        """
        i = int(np.searchsorted(self.t, t, side="right"))
        if i in (0, len(self.t)):
            x, y = self.points[min(i, len(self.t) - 1)]
            return (x, y), (0.0, 0.0)
        (x0, y0), (x1, y1) = self.points[i - 1], self.points[i]
        span = self.t[i] - self.t[i - 1]
        vx, vy = (x1 - x0) / span, (y1 - y0) / span
        after = t - self.t[i - 1]
        return (x0 + vx * after, y0 + vy * after), (vx, vy)

    @classmethod
    def to(cls, target: Pair) -> Trajectory:
        """A hand with a constant target.

        Args:
            target: the position [m].
        """
        return cls((0.0,), (target,))

    @classmethod
    @checked
    def of_file(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Reads a trajectory from a log with the columns t [s], x and y [m].

        A unit in the name of a column, as in "x [mm]", or in a row below the names is converted.

        Args:
            path: the file.

        Raises:
            ParameterError: the file cannot be read, has other columns, a cell that is no number, or
                a unit that does not fit.
        """
        found = columns_of("hand", path, {"t": ("s",), "x": ("m",), "y": ("m",)})
        t, x, y = (column.tolist() for column in found.values())
        return cls(tuple(t), tuple(zip(x, y, strict=True)))


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
    ):
        """Makes the device, at rest."""
        self._scenario, self._samples = device_scenario(scenario, period, clay)
        self._hand = None if hand is None else _follower(hand, self.scenario)
        self._arm = DrivenArm(self.scenario, largest_force)
        driven = replace(self.scenario, controller=self._arm.controller)
        self._simulation = Simulation(driven)

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
    def force(self) -> Pair:
        return self._arm.force

    @property
    def torques(self) -> Pair:
        return self._arm.asked.torques

    @property
    def ended(self) -> str:
        outcome = self._simulation.outcome
        return "" if outcome is None else str(outcome)

    def drive(self, drive: Drive) -> Pair:
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
        controller=None,
        clay=scenario.clay if clay else None,
        render="physical" if clay and scenario.clay else scenario.render,
        length=None,
        t_max=LONGEST,
        stop_when_unstable=False,
        **changes,
    )
    sample = float(out.Ts or out.dt)
    samples = 1 if period is None else round(period / sample)
    if period is not None and abs(samples * sample - period) > 1e-9 * period:
        bound = f"must be a whole multiple of the control sample, {sample:g} s"
        raise ParameterError("period", period, bound)
    return out, samples


def _follower(hand: Trajectory, scenario: Scenario) -> Any:
    """Muscle force over time with which a hand follows a trajectory."""
    if any(h is None or not h.spring for h in scenario.operators):
        bound = "needs an operator with a spring on both axes, which pulls the handle along"
        raise ParameterError("hand", hand, bound)
    hands = [h for h in scenario.operators if h is not None]

    def force(t: float) -> Pair:
        place, rate = hand.at(t)
        x, y = (h.spring * p + h.damper * v for h, p, v in zip(hands, place, rate, strict=True))
        return x, y

    return force
