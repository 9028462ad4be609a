"""The simulated device: an arm with a hand at it, moved by forces and measured by its hardware."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ..arguments import named
from ..errors import Bound, ParameterError, check_fields, number
from ..model.constants import TS
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..simulation.stepwise import Simulation
from .commands import Pair
from .driven_arm import LARGEST_FORCE, Drive, DrivenArm, Sensed

LONGEST = 1e5  # [s] of a session


@named
@dataclass(frozen=True)
class Trajectory:
    """Where the hand wants to be over time: straight from point to point, at rest behind the last.

    Attributes:
        t: times [s], ascending, shape (n,).
        points: places of the handle [m], shape (n, 2).
    """

    t: Annotated[tuple[float, ...], Bound(unit="s")]
    points: Annotated[tuple[tuple[float, ...], ...], Bound(-10.0, 10.0, "m")]

    def __post_init__(self):
        check_fields(self, "hand.")
        if not self.t or len(self.t) != len(self.points):
            raise ParameterError("hand.t", self.t, "must have a place for each time")
        if any(len(p) != 2 for p in self.points):
            raise ParameterError("hand.points", self.points, "must have x and y each")
        if any(b <= a for a, b in zip(self.t[:-1], self.t[1:], strict=True)):
            raise ParameterError("hand.t", self.t, "must ascend")

    def at(self, t: float) -> tuple[Pair, Pair]:
        """Place [m] and velocity [m/s] at a time.

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
        """A hand that wants to be at one place.

        Args:
            target: the place [m].
        """
        return cls((0.0,), (target,))

    @classmethod
    def of_file(cls, path: str | os.PathLike[str]) -> Trajectory:
        """A hand of a CSV file with the columns t [s], x and y [m].

        Args:
            path: the file.

        Raises:
            ParameterError: the file cannot be read, or has other columns.
        """
        rows = read_columns("hand", path, ("t", "x", "y"))
        return cls(tuple(r[0] for r in rows), tuple((r[1], r[2]) for r in rows))


def read_columns(
    field: str, path: str | os.PathLike[str], names: tuple[str, ...]
) -> list[tuple[float, ...]]:
    """Numbers of some columns of a CSV file.

    Args:
        field: name for the error.
        path: the file, whose first line has the names of its columns.
        names: of the columns to read.

    Raises:
        ParameterError: the file cannot be read, or lacks a column.
    """
    try:
        with Path(path).open(newline="") as f:
            rows = [tuple(float(row[name]) for name in names) for row in csv.DictReader(f)]
    except (OSError, KeyError, TypeError, ValueError) as error:
        bound = f"must be a CSV file with the columns {', '.join(names)} ({error!r})"
        raise ParameterError(field, str(path), bound) from None
    if not rows:
        raise ParameterError(field, str(path), "must have a row or more")
    return rows


class SimulatedDevice:
    """The arm of a scenario beside its hand, driven by a client in place of its controller.

    A force acts through the transposed Jacobian at the measured joint angles, held for a control
    sample, within the torque limits and behind the delay of the scenario's hardware.

    Attributes:
        scenario: what is simulated.
        paced: whether something else than the clock of a service moves it: no.
    """

    paced = False

    def __init__(
        self,
        scenario: Scenario,
        *,
        period: float | None = None,
        hand: Trajectory | None = None,
        largest_force: float = LARGEST_FORCE,
        clay: bool = False,
    ):
        """Builds the device; nothing moves yet.

        Args:
            scenario: its arm, hand, hardware, clay and step; compensator and servo do not act.
            period: time of which `advance` makes a whole part [s]; None for the control sample.
            hand: where the hand wants to be; None for the muscle force of the scenario.
            largest_force: longest force that acts [N], > 0, at most 1e3.
            clay: whether the clay of the scenario acts as well.

        Raises:
            ParameterError: the period is no whole multiple of the control sample, or the hand has
                no spring to follow a trajectory by.
        """
        self.scenario, self._samples = device_scenario(scenario, period, clay)
        self._hand = None if hand is None else _follower(hand, self.scenario)
        self._arm = DrivenArm(self.scenario, largest_force)
        driven = replace(self.scenario, controller=self._arm.controller)
        self._simulation = Simulation(driven, engine="python")

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self._simulation.t

    @property
    def sensed(self) -> Sensed:
        """The newest measurement."""
        return self._arm.sensed

    @property
    def force(self) -> Pair:
        """The force that acts on the handle [N]."""
        return self._arm.force

    @property
    def torques(self) -> Pair:
        """Torques that act on the joints beside that force [N.m]."""
        return self._arm.asked.torques

    @property
    def ended(self) -> str:
        """Why the device no longer moves; "" while it does."""
        outcome = self._simulation.outcome
        return "" if outcome is None else str(outcome)

    def drive(self, drive: Drive) -> Pair:
        """Changes what the motors do from the next control sample on.

        Args:
            drive: in the plane of the arm.

        Returns:
            The force that will act: shortened where it is longer than the limit [N].
        """
        return self._arm.drive(drive)

    def advance(self, samples: int | None = None) -> None:
        """Moves on.

        Args:
            samples: control samples; None for a period.
        """
        steps = round(float(self.scenario.Ts or self.scenario.dt) / self.scenario.dt)
        n = steps * (self._samples if samples is None else samples)
        force = None if self._hand is None else self._hand(self.t)
        self._simulation.advance(n, force=force)

    def record(self) -> Record:
        """The record so far; the device no longer moves.

        Raises:
            RuntimeError: it has not moved.
        """
        return replace_scenario(self._simulation.record(), self.scenario)


def replace_scenario(record: Record, scenario: Scenario) -> Record:
    """A record that names its scenario without the law that a client stands for.

    Args:
        record: the record.
        scenario: what it is to name.
    """
    return replace(record, scenario=scenario)


def device_scenario(scenario: Scenario, period: float | None, clay: bool) -> tuple[Scenario, int]:
    """The scenario of a device, and its control samples in a period.

    Args:
        scenario: what was given; without Ts, the control sample is a whole part of the period, and
            0.36 ms at most.
        period: of a client [s]; None for the control sample.
        clay: whether its clay acts.

    Raises:
        ParameterError: the period is no whole multiple of Ts.
    """
    if period is not None:
        period = number("period", period, 1e-5, 1.0, unit="s")
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
    """Muscle force of a hand that is to follow a trajectory, over time."""
    if any(h is None or not h.spring for h in scenario.operators):
        bound = "needs an operator with a spring on both axes, which pulls the handle along"
        raise ParameterError("hand", hand, bound)
    hands = [h for h in scenario.operators if h is not None]

    def force(t: float) -> Pair:
        place, rate = hand.at(t)
        x, y = (h.spring * p + h.damper * v for h, p, v in zip(hands, place, rate, strict=True))
        return x, y

    return force
