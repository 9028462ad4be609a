"""Sessions with a device: one serves as a device for other programs, one has a device as its hand.

Their slices have the period of the device, one or two milliseconds; frames are kept at the rate of
the picture.
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import replace
from typing import Any

from ..ports.commands import Numbers
from ..ports.coupled import DeviceHand
from ..ports.device import device_scenario
from ..ports.driven_arm import LARGEST_FORCE, Device, Drive, Sensed, driven_arm
from ..ports.service import Service
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..studies.removal import TOOL, Tool
from .clock import FRAME_TIME
from .frame import Partner
from .run import session_scenario
from .session import Session, refuse_other
from .verdict import LiveVerdict

SERVED_SPAN = 0.002  # [s] between two slices of an arm that programs drive
RATE_SPAN = 1.0  # [s] over which their rate is averaged


class ServedSession(Session):
    """A session with a simulated device: programs drive the motors, a person is the hand.

    The clay of the scenario acts in addition to their forces; compensator and servo are off.
    """

    frame_time = FRAME_TIME
    service: Service | None = None  # for the programs; None before it exists

    def __init__(
        self,
        scenario: Scenario,
        stiffness: float = 1.0,
        tool: Tool = TOOL,
        every: int = 1,
        largest_force: float = LARGEST_FORCE,
    ):
        self._largest_force = largest_force
        self._counts: deque[tuple[float, int]] = deque()
        self.partner = Partner(SERVED_SPAN)
        super().__init__(scenario, stiffness, tool, every)

    def prepared(self, scenario: Scenario) -> Scenario:
        """The scenario with motors commanded by programs."""
        refuse_other(scenario, integrator="fast")
        driven, _ = device_scenario(session_scenario(scenario, self.stiffness), None, clay=True)
        self.undriven = session_scenario(driven, 1.0)
        self.arm = driven_arm(self.undriven, self._largest_force)
        return replace(self.undriven, controller=self.arm.controller)

    def verdict(self) -> LiveVerdict:
        """Names the programs that drive the arm; the loop report judges their stability."""
        if self.service is None or not self.service.clients:
            return LiveVerdict("no program drives the arm", False)
        force = math.hypot(*self.arm.force)
        n = self.service.clients
        who = "1 program drives" if n == 1 else f"{n} programs drive"
        return LiveVerdict(f"{who} the arm: {self._rate():.0f} Hz, {force:.2f} N", False)

    def _rate(self) -> float:
        """Recent rate of messages [Hz]."""
        assert self.service is not None
        now, count = time.monotonic(), sum(log.count for log in self.service.logs)
        self._counts.append((now, count))
        while len(self._counts) > 2 and self._counts[1][0] < now - RATE_SPAN:
            self._counts.popleft()
        before, fewer = self._counts[0]
        return (count - fewer) / (now - before) if now > before else 0.0

    def record(self) -> Record:
        """Ends the run and returns its record, without the control law of the programs."""
        return replace(super().record(), scenario=self.undriven)


class LiveDevice(Device):
    """The arm of a session as the device of a service; the session's player advances it."""

    paced = True

    def __init__(self, session: ServedSession):
        self._session = session

    @property
    def t(self) -> float:
        return self._session.t

    @property
    def sensed(self) -> Sensed:
        return self._session.arm.sensed

    @property
    def force(self) -> Numbers:
        return self._session.arm.force

    @property
    def torques(self) -> Numbers:
        return self._session.arm.asked.torques

    @property
    def ended(self) -> str:
        """Always "", because a person may restart the session."""
        return ""

    @property
    def scenario(self) -> Scenario:
        return self._session.undriven

    def drive(self, drive: Drive) -> Numbers:
        return self._session.arm.drive(drive)

    def advance(self, samples: int | None = None) -> None:
        """Does nothing, because the player advances the arm."""


class DeviceSession(Session):
    """A session whose hand is a device, real or simulated."""

    frame_time = FRAME_TIME

    def __init__(self, scenario: Scenario, hand: DeviceHand, tool: Tool = TOOL, every: int = 1):
        self.hand, self.partner = hand, DevicePartner(hand)
        super().__init__(scenario, 1.0, tool, every)

    def prepared(self, scenario: Scenario) -> Scenario:
        """The scenario with the coupling to the device as its operator."""
        return replace(super().prepared(scenario), operator=self.hand.coupling.operator)

    def record(self) -> Record:
        """Ends the run and returns its record; its notes have rate, latency and jitter."""
        record = super().record()
        return replace(record, notes={**record.notes, "device": self.hand.notes()})


class DevicePartner(Partner):
    """Exchanges force and position with a device, one slice per sample.

    While the session is paused, the device receives no force.
    """

    def __init__(self, hand: DeviceHand):
        super().__init__(hand.client.limits.Ts)
        self.hand = hand
        self._handle: Any = None  # position and velocity of the simulated handle; None at rest
        self._run: Any = None  # of the newest slice

    def exchange(self) -> None:
        """Sends the force of the coupling, and reads the device."""
        handle, self._handle = self._handle, None
        if handle is None:
            self.hand.read_position()
        else:
            self.hand.exchange(*handle)

    def before_slice(self, play: Session) -> None:
        """Pulls the handle to the device's position; releases it while that is unknown.

        A run begins where the device is, and its forces rise from zero: after a restart, too.
        """
        if play.run is not self._run:
            self._run = play.run
            self.hand.begin_at(play.handle()[0])
        hand, held = self.hand, self.hand.held
        play.pull(hand.place if held else None)
        B = hand.coupling.B
        play.run.pull.damper_force = (B * hand.rate[0], B * hand.rate[1]) if held else (0.0, 0.0)

    def after_slice(self, play: Session) -> None:
        """Stores the new position of the handle."""
        self._handle = play.handle()
