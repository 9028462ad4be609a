"""A device as a service sees it, and the motors and sensors of a simulated one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..errors import ParameterError, number
from ..formulas.arm import handle_velocity, jacobian, joint_torques
from ..model.sampled_controller import Controller
from ..scene.scenario import Scenario
from .commands import ANGLE, POSITION, RATE, VELOCITY, Numbers, Pair, is_bounded, shortening

LARGEST_FORCE = 10.0  # [N] default limit of the length of a force
TARGET_STIFFNESS, TARGET_DAMPING = 1000.0, 60.0  # [N/m], [N.s/m] to hold a position
NOWHERE: Pair = (0.0, 0.0)


class Sensed(NamedTuple):
    """Measurements of the device at a control sample."""

    t: float  # [s]
    position: Numbers  # [m] of the handle
    velocity: Numbers  # [m/s] of the handle
    angles: Numbers = NOWHERE  # [rad] of the joints, [m] of those that slide
    rates: Numbers = NOWHERE  # [rad/s] or [m/s] of the joints


class Drive(NamedTuple):
    """Command to the motors, along the axes of the handle; what is left out is 0."""

    force: Numbers = ()  # [N] on the handle
    target: Numbers | None = None  # [m] at which to hold the handle
    torques: Numbers = ()  # [N.m] on the joints, in addition


LIMP = Drive()


class Device(Protocol):
    """The device of a service: a `SimulatedDevice`, or the arm of a session with a viewer."""

    paced: bool  # whether anything but the clock of the service advances the device
    takes_torques: bool = True  # whether programs may drive its joints

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        ...

    @property
    def sensed(self) -> Sensed:
        """The newest measurement."""
        ...

    @property
    def force(self) -> Numbers:
        """The force that acts on the handle [N]."""
        ...

    @property
    def torques(self) -> Numbers:
        """Torques that act on the joints in addition to that force [N.m]."""
        ...

    @property
    def ended(self) -> str:
        """Why the device stopped; "" while it runs."""
        ...

    @property
    def scenario(self) -> Scenario:
        """The simulated scenario."""
        ...

    def drive(self, drive: Drive) -> Numbers:
        """Changes what the motors do from the next control sample on."""
        ...

    def advance(self, samples: int | None = None) -> None:
        """Advances the simulation."""


class DrivenArm:
    """Motors that apply a force, hold a position, or apply torques, held for a control sample.

    `largest_force` [N] limits the sum of the force and the pull to the target; joint torques are
    limited to those of such a force on the stretched arm. `sensed` is the newest measurement that
    is finite and within the bounds of messages, `asked` the command with its torques limited,
    `force` [N] acts on the handle from the newest sample on.
    """

    def __init__(self, scenario: Scenario, largest_force: float = LARGEST_FORCE):
        """Starts without torque, at the initial state of a scenario."""
        self.largest_force = number("largest_force", largest_force, 0.0, 1e3, above=True)
        self._reach = self.reach_of(scenario)  # of the handle from each joint [m]
        self._still = (0.0,) * len(scenario.axes)
        self.sensed = self.start_of(scenario)
        self.asked, self.force = Drive(torques=(0.0,) * len(scenario.joints)), self._still
        self.controller = Controller(self._law)

    def reach_of(self, scenario: Scenario) -> Sequence[float]:
        """Largest distance of the handle from each joint [m]."""
        raise NotImplementedError

    def start_of(self, scenario: Scenario) -> Sensed:
        """The measurement before the first sample."""
        raise NotImplementedError

    def see(self, t: float, q: Numbers, qd: Numbers) -> tuple[Sensed, Any]:
        """The measurement at joint positions and rates, and what `torques_of` needs there."""
        raise NotImplementedError

    def torques_of(self, force: Numbers, at: Any) -> Numbers:
        """Joint torques of a force on the handle [N.m]."""
        raise NotImplementedError

    def drive(self, drive: Drive) -> Numbers:
        """Changes what the motors do from the next control sample on."""
        self.asked = drive._replace(torques=self._limited(drive.torques))
        self.force = self._at(self.sensed)
        return self.force

    def _limited(self, torques: Numbers) -> Numbers:
        """Joint torques that the largest force can cause, in the ratio of those given [N.m]."""
        n = len(self._reach)
        torques = (*torques, *(0.0,) * n)[:n]
        limits = [self.largest_force * r for r in self._reach]
        scales = [shortening((t,), most) for t, most in zip(torques, limits, strict=True) if t]
        scale = min(scales, default=1.0)
        return tuple(t * scale for t in torques)

    def _at(self, seen: Sensed) -> Numbers:
        """Force on the handle at a measurement."""
        return force_at(self.asked, seen, self.largest_force)

    def _law(self, t: float, q: Numbers, qd: Numbers, fh: Any, state: Any, params: Any) -> Any:
        """Torques of a control sample: the transposed Jacobian at the measured angles."""
        seen, at = self.see(t, q, qd)
        if _is_usable(seen):
            self.sensed = seen
        self.force = force = self._at(seen)
        torques = self.torques_of(force, at)
        return tuple(x + more for x, more in zip(torques, self.asked.torques, strict=True)), state


class PlanarMotors(DrivenArm):
    """The motors of the two-link arm in closed form."""

    def reach_of(self, scenario: Scenario) -> Sequence[float]:
        arm = scenario.planar_arm
        return arm.l1 + arm.l2, arm.l2

    def start_of(self, scenario: Scenario) -> Sensed:
        self._origin, self._links = scenario.origin, scenario.planar_arm.links
        (x, y), (vx, vy) = scenario.start, scenario.velocity
        return Sensed(0.0, (float(x), float(y)), (float(vx), float(vy)))

    def see(self, t: float, q: Numbers, qd: Numbers) -> tuple[Sensed, Any]:
        u = jacobian(q[0], q[1], self._links)
        place = u[1] + u[3] - self._origin[0], -u[0] - u[2] - self._origin[1]
        rate = handle_velocity(qd[0], qd[0] + qd[1], u)
        return Sensed(t, place, rate, tuple(map(float, q)), tuple(map(float, qd))), u

    def torques_of(self, force: Numbers, at: Any) -> Numbers:
        return joint_torques(force[0], force[1], at)


class MechanismMotors(DrivenArm):
    """The motors of an arm from a file."""

    def reach_of(self, scenario: Scenario) -> Sequence[float]:
        return scenario.file_arm.mechanism.reach

    def start_of(self, scenario: Scenario) -> Sensed:
        arm = scenario.file_arm
        self._mechanism, self._rows = arm.mechanism, ["xyz".index(axis) for axis in arm.axes]
        self._origin = arm.handle()[self._rows]
        return self.see(0.0, tuple(arm.q.tolist()), (0.0,) * len(arm.names))[0]

    def see(self, t: float, q: Numbers, qd: Numbers) -> tuple[Sensed, Any]:
        place, J = self._mechanism.at_handle(np.array(q))
        J = J[self._rows]
        p, v = place[self._rows] - self._origin, J @ qd
        return Sensed(t, tuple(p.tolist()), tuple(v.tolist()), tuple(q), tuple(qd)), J

    def _law(self, t: float, q: Numbers, qd: Numbers, fh: Any, state: Any, params: Any) -> Any:
        try:
            return super()._law(t, q, qd, fh, state, params)
        except ParameterError:  # a chain that is torn apart: the run ends
            return (math.nan,) * len(q), state

    def torques_of(self, force: Numbers, at: Any) -> Numbers:
        return tuple((at.T @ force).tolist())


def force_at(asked: Drive, seen: Sensed, largest: float) -> Numbers:
    """Force of a command on the handle at a measurement, shortened to the largest one [N]."""
    still = (0.0,) * len(seen.position)
    force, target = asked.force or still, asked.target
    if target is not None:
        force = tuple(
            f + (TARGET_STIFFNESS * (to - p) - TARGET_DAMPING * v)
            for f, p, v, to in zip(force, seen.position, seen.velocity, target, strict=True)
        )
    scale = shortening(force, largest)
    return tuple(f * scale for f in force) if scale else still


def driven_arm(scenario: Scenario, largest_force: float = LARGEST_FORCE) -> DrivenArm:
    """The motors of the arm of a scenario."""
    motors = PlanarMotors if scenario.is_closed_form else MechanismMotors
    return motors(scenario, largest_force)


def _is_usable(seen: Sensed) -> bool:
    """Whether a measurement can be sent: a run that diverges ends with numbers that cannot."""
    degrees = map(math.degrees, seen.angles), map(math.degrees, seen.rates)
    parts = (seen.position, POSITION), (seen.velocity, VELOCITY), (degrees[0], ANGLE)
    return all(is_bounded(x, of) for x, of in (*parts, (degrees[1], RATE)))
