"""Sessions beside a device: one that is a device for other programs, one whose hand is a device.

Their slices are those of the device, a millisecond or two; frames are kept as often as a picture
needs them.
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import replace
from typing import Any

from ..ports.coupled import DeviceHand
from ..ports.device import device_scenario
from ..ports.driven_arm import LARGEST_FORCE, Drive, DrivenArm, Sensed
from ..ports.service import Service
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..stepping.run import PLAIN, Kernel
from ..studies.removal import TOOL, Tool
from .clock import FRAME_TIME
from .live_run import played
from .live_verdict import LiveVerdict
from .session import Session, refuse_other

SERVED_SPAN = 0.002  # [s] between two slices of an arm that programs drive
WATCHED = 1.0  # [s] over which their rate is taken


class ServedSession(Session):
    """A session whose arm is a simulated device: programs drive the motors, a person is the hand.

    The clay of the scenario acts beside their forces; compensator and servo do not act.

    Attributes:
        arm: the motors.
        service: that programs talk to; None before there is one.
    """

    frame_time = FRAME_TIME
    service: Service | None = None

    def __init__(
        self,
        scenario: Scenario,
        stiffness: float = 1.0,
        tool: Tool = TOOL,
        every: int = 1,
        largest_force: float = LARGEST_FORCE,
    ):
        """Begins at the start of a scenario.

        Args:
            scenario: clay, arm and hardware.
            stiffness: as of a session.
            tool: at the handle.
            every: keep each every-th sample.
            largest_force: longer forces are shortened to this [N], > 0, at most 1e3.

        Raises:
            ParameterError: a value is out of its bounds, or the scenario is accurate.
        """
        self._largest_force = largest_force
        self._seen: deque[tuple[float, int]] = deque()
        self.partner = _Pace()
        super().__init__(scenario, stiffness, tool, every)

    def prepared(self, scenario: Scenario) -> Scenario:
        """The scenario with motors that do what programs ask.

        Args:
            scenario: as it was given.
        """
        refuse_other(scenario, integrator="fast")
        driven, _ = device_scenario(played(scenario, self.stiffness), None, clay=True)
        self.undriven = played(driven, 1.0)
        self.arm = DrivenArm(self.undriven, self._largest_force)
        return replace(self.undriven, controller=self.arm.controller)

    def kernel(self) -> Kernel:
        """Steps in Python: the motors' law changes while it runs."""
        return PLAIN

    def verdict(self) -> LiveVerdict:
        """Says who drives the arm: whether their loop is stable is told by the loop report."""
        if self.service is None or not self.service.clients:
            return LiveVerdict("no program drives the arm", False)
        force = math.hypot(*self.arm.force)
        n = self.service.clients
        who = "1 program drives" if n == 1 else f"{n} programs drive"
        return LiveVerdict(f"{who} the arm: {self._rate():.0f} Hz, {force:.2f} N", False)

    def _rate(self) -> float:
        """Messages in a second, of late [Hz]."""
        assert self.service is not None
        now, count = time.monotonic(), sum(log.count for log in self.service.logs)
        self._seen.append((now, count))
        while len(self._seen) > 2 and self._seen[1][0] < now - WATCHED:
            self._seen.popleft()
        before, fewer = self._seen[0]
        return (count - fewer) / (now - before) if now > before else 0.0

    def record(self) -> Record:
        """Ends the run and returns its record, without the law that the programs stand for."""
        return replace(super().record(), scenario=self.undriven)


class _Pace:
    """Slices that are short enough for a program's loop."""

    span = SERVED_SPAN

    def exchange(self) -> None:
        pass

    def lead(self, play: Session) -> None:
        pass

    def follow(self, play: Session) -> None:
        pass


class LiveDevice:
    """The arm of a session as the device of a service, which the session's player moves."""

    paced = True

    def __init__(self, session: ServedSession):
        """The arm of a session.

        Args:
            session: which may begin anew.
        """
        self._session = session

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self._session.t

    @property
    def sensed(self) -> Sensed:
        """The newest measurement."""
        return self._session.arm.sensed

    @property
    def force(self) -> tuple[float, float]:
        """The force that acts on the handle [N]."""
        return self._session.arm.force

    @property
    def torques(self) -> tuple[float, float]:
        """Torques that act beside that force [N.m]."""
        return self._session.arm.asked.torques

    @property
    def ended(self) -> str:
        """ "": a person may begin the session again."""
        return ""

    @property
    def scenario(self) -> Scenario:
        """What is simulated."""
        return self._session.undriven

    def drive(self, drive: Drive) -> tuple[float, float]:
        """Changes what the motors do from the next control sample on.

        Args:
            drive: in the plane of the arm.

        Returns:
            The force that will act [N].
        """
        return self._session.arm.drive(drive)

    def advance(self, samples: int | None = None) -> None:
        """Does nothing: the player moves the arm.

        Args:
            samples: are not made.
        """


class DeviceSession(Session):
    """A session whose hand is a device, real or simulated.

    Attributes:
        hand: the device.
    """

    frame_time = FRAME_TIME

    def __init__(self, scenario: Scenario, hand: DeviceHand, tool: Tool = TOOL, every: int = 1):
        """Begins at the start of a scenario.

        Args:
            scenario: clay, gain and arm.
            hand: the device.
            tool: at the handle.
            every: keep each every-th sample.

        Raises:
            ParameterError: a value is out of its bounds, or the scenario is sampled or accurate.
        """
        self.hand, self.partner = hand, DevicePartner(hand)
        super().__init__(scenario, 1.0, tool, every)

    def prepared(self, scenario: Scenario) -> Scenario:
        """The scenario with the coupling to the device as its operator.

        Args:
            scenario: as it was given.
        """
        return replace(super().prepared(scenario), operator=self.hand.coupling.operator)

    def record(self) -> Record:
        """Ends the run and returns its record; its notes have rate, latency and jitter."""
        record = super().record()
        return replace(record, notes={**record.notes, "device": self.hand.notes()})


class DevicePartner:
    """Exchanges force and place with a device, a slice for each sample.

    Where the session stands still, the device gets no force.
    """

    def __init__(self, hand: DeviceHand):
        """Between a device and a session.

        Args:
            hand: the device.
        """
        self.hand, self.span = hand, hand.client.limits.Ts
        self._handle: Any = None  # place and velocity of the simulated handle; None at rest

    def exchange(self) -> None:
        """Sends the force of the coupling, and reads the device."""
        handle, self._handle = self._handle, None
        if handle is None:
            self.hand.watch()
        else:
            self.hand.exchange(*handle)

    def lead(self, play: Session) -> None:
        """Pulls the handle to where the device is; lets go where that is not known.

        Args:
            play: the session.
        """
        hand, held = self.hand, self.hand.held
        play.pull(hand.place if held else None)
        B = hand.coupling.B
        play.run.pull.carried = (B * hand.rate[0], B * hand.rate[1]) if held else (0.0, 0.0)

    def follow(self, play: Session) -> None:
        """Takes where the handle has come.

        Args:
            play: the session.
        """
        self._handle = play.handle()
