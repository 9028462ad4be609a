"""A device as a service sees it, and the motors and sensors of a simulated one."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

from ..errors import number
from ..formulas.arm import handle_velocity, jacobian, joint_torques
from ..model.sampled_controller import Controller
from ..scene.scenario import Scenario
from .commands import ANGLE, POSITION, RATE, VELOCITY, Pair, is_bounded, shortening

LARGEST_FORCE = 10.0  # [N] default limit of the length of a force
TARGET_STIFFNESS, TARGET_DAMPING = 1000.0, 60.0  # [N/m], [N.s/m] to hold a position
NOWHERE: Pair = (0.0, 0.0)


class Sensed(NamedTuple):
    """Measurements of the device at a control sample."""

    t: float  # [s]
    position: Pair  # [m] of the handle
    velocity: Pair  # [m/s] of the handle
    angles: Pair = NOWHERE  # [rad] of the joints
    rates: Pair = NOWHERE  # [rad/s] of the joints


class Drive(NamedTuple):
    """Command to the motors, in the plane of the arm."""

    force: Pair = NOWHERE  # [N] on the handle
    target: Pair | None = None  # [m] at which to hold the handle
    torques: Pair = NOWHERE  # [N.m] on the joints, in addition


LIMP = Drive()


class Device(Protocol):
    """The device of a service: a `SimulatedDevice`, or the arm of a session with a viewer."""

    paced: bool  # whether anything but the clock of the service advances the device

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        ...

    @property
    def sensed(self) -> Sensed:
        """The newest measurement."""
        ...

    @property
    def force(self) -> Pair:
        """The force that acts on the handle [N]."""
        ...

    @property
    def torques(self) -> Pair:
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

    def drive(self, drive: Drive) -> Pair:
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
        self._origin, self._links = scenario.origin, scenario.arm.links
        self._reach = scenario.arm.l1 + scenario.arm.l2, scenario.arm.l2  # of both joints [m]
        (x, y), (vx, vy) = scenario.start, scenario.velocity
        self.sensed = Sensed(0.0, (float(x), float(y)), (float(vx), float(vy)))
        self.asked, self.force = LIMP, NOWHERE
        self.controller = Controller(self._law)

    def drive(self, drive: Drive) -> Pair:
        """Changes what the motors do from the next control sample on."""
        self.asked = drive._replace(torques=self._limited(drive.torques))
        self.force = self._at(self.sensed)
        return self.force

    def _limited(self, torques: Pair) -> Pair:
        """Joint torques that the largest force can cause, in the ratio of those given [N.m]."""
        limits = [self.largest_force * r for r in self._reach]
        scales = [shortening((t,), most) for t, most in zip(torques, limits, strict=True) if t]
        scale = min(scales, default=1.0)
        return torques[0] * scale, torques[1] * scale

    def _at(self, seen: Sensed) -> Pair:
        """Force on the handle at a measurement."""
        fx, fy = self.asked.force
        if self.asked.target is not None:
            (px, py), (vx, vy), (tx, ty) = seen.position, seen.velocity, self.asked.target
            fx += TARGET_STIFFNESS * (tx - px) - TARGET_DAMPING * vx
            fy += TARGET_STIFFNESS * (ty - py) - TARGET_DAMPING * vy
        scale = shortening((fx, fy), self.largest_force)
        return (fx * scale, fy * scale) if scale else NOWHERE

    def _law(self, t: float, q: Pair, qd: Pair, fh: Pair, state: Any, params: Any) -> Any:
        """Torques of a control sample: the transposed Jacobian at the measured angles."""
        u = jacobian(q[0], q[1], self._links)
        place = u[1] + u[3] - self._origin[0], -u[0] - u[2] - self._origin[1]
        rate = handle_velocity(qd[0], qd[0] + qd[1], u)
        seen = Sensed(t, place, rate, (float(q[0]), float(q[1])), (float(qd[0]), float(qd[1])))
        if _is_usable(seen):
            self.sensed = seen
        self.force = force = self._at(seen)
        first, second = joint_torques(*force, u)
        extra = self.asked.torques
        return (first + extra[0], second + extra[1]), state


def _is_usable(seen: Sensed) -> bool:
    """Whether a measurement can be sent: a run that diverges ends with numbers that cannot."""
    degrees = (math.degrees(x) for x in seen.angles), (math.degrees(x) for x in seen.rates)
    parts = (seen.position, POSITION), (seen.velocity, VELOCITY), (degrees[0], ANGLE)
    return all(is_bounded(x, of) for x, of in (*parts, (degrees[1], RATE)))
