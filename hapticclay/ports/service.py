"""The service behind the sockets: client sessions, the clock of the device, a watchdog.

A protocol reads and answers the messages; this module handles only commands. There are two clocks.
"tick": each command of the first client advances the device by a period, so that the same messages
give bit-identical runs. "wall": the device runs in real time in its own thread, under the newest
command of each client (a zero-order hold).
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..display import one_line
from ..scene.joint_numbers import turning
from .commands import AXES, IDLE, NOTHING, Command, Joints, Numbers, Vector
from .driven_arm import LIMP, Device, Drive
from .exchanges import Exchange, ExchangeLog
from .inverse import Cursor, first_three
from .planes import along, cursor_axes, moving_axes, to_cursor
from .sessions import PLAIN, Inverse3, Session, WireProtocol

REST: Vector = (0.08, -0.15, 0.14)  # [m] cursor of an Inverse3 at rest: handle at p = 0
# [s] without a message after which a client's command no longer acts: with the thread's turn, 50 ms
PATIENCE = 0.048
LATE = 0.1  # [s] lag behind the clock beyond which time is skipped
MOST_LOGS = 100  # of clients
MOST_NOTICES, LONGEST_NOTICE = 100, 120  # kinds of notices counted separately; characters
AT_ONCE = 8  # control samples per turn of the thread, before clients get theirs
LOOK = 0.002  # [s] between two checks of the clients of an externally paced device
LOG = logging.getLogger("hapticclay.ports")


class Service:
    """Clients, their commands, and the clock: "tick" or "wall"."""

    def __init__(
        self,
        device: Device,
        *,
        clock: str = "wall",
        inverse3: Inverse3 = PLAIN,
    ):
        """Makes the service; `start` starts the wall clock."""
        self.device, self.clock = device, clock
        self.notices = Counter[str]()  # what was dropped from messages, and how often
        self.inverse3 = inverse3
        self._axes = cursor_axes(device.scenario, inverse3.plane)
        self._moving = moving_axes(device.scenario, inverse3.plane)
        self._turns = turning(device.scenario)
        self.protocol = protocol_of(inverse3.protocol)
        self.skipped = self.samples = 0  # control samples by the wall clock: late, and made
        self._fault = ""  # that ended the device
        self._sessions: dict[int, Session] = {}
        self._logs: dict[int, ExchangeLog] = {}
        self._count = 0  # of clients so far
        self._lock, self._stop = threading.RLock(), threading.Event()
        self._thread: threading.Thread | None = None

    # ---- clients

    def connect(self) -> tuple[int, list[str]]:
        with self._lock:
            self._count += 1
            number = self._count
            log = ExchangeLog(axes=len(self._axes))
            session = self._sessions[number] = Session(number, log=log)
            self._logs[number] = session.log
            if len(self._logs) > MOST_LOGS:  # bounds memory when many clients come and go
                gone = [k for k in self._logs if k not in self._sessions]
                if gone:
                    del self._logs[min(gone, key=lambda k: self._logs[k].count)]
            return number, self.protocol.greet(self, session)

    def leave(self, number: int) -> None:
        """Removes a client and its command."""
        with self._lock:
            self._sessions.pop(number, None)
            self.device.drive(LIMP if self.clock == "tick" else self._drive())

    def answer(self, number: int, data: str | bytes) -> list[str]:
        with self._lock:
            return self.protocol.answer(self, self._sessions[number], data)

    def due(self, number: int) -> list[str]:
        """Messages to push to a client."""
        with self._lock:
            session = self._sessions.get(number)
            return [] if session is None else self.protocol.due(self, session)

    def apply(self, session: Session, command: Command) -> None:
        """Applies a client's command; with the clock "tick", the first client's advances it."""
        device, command = self.device, self._possible(command)
        session.command, session.heard = command, time.monotonic()
        force = command.force or NOTHING
        asked = along(force, self._axes)
        if len(asked) < len(force):
            asked = (*asked, force[3 - sum(self._axes)])
        began = device.t
        applied = device.drive(self._drive())
        if self.clock == "tick" and session.number == min(self._sessions):
            self._advance()
            for s in self._sessions.values():  # a command acts for one tick
                if s.number != session.number:
                    s.command = IDLE
        seen = device.sensed
        place, rate = seen.position, seen.velocity
        session.log.add(Exchange(session.heard, began, seen.t, place, rate, asked, applied))

    def _possible(self, command: Command) -> Command:
        """A command with a torque for each joint, if it has any; tells what cannot act."""
        force, torques, n = command.force, command.torques, len(self.device.scenario.joints)
        for i, axis in enumerate(AXES):
            if force and force[i] and i not in self._moving:
                where = "across the plane of the arm"
                if not self.device.scenario.is_closed_form:
                    where = f"along {axis}, where the handle does not move,"
                self.count(f"force {where} is recorded and cannot act")
        if torques is None:
            return command
        if not self.device.takes_torques:
            self.count("joint torques cannot act: the motors are those of the pair")
            return replace(command, torques=None)
        if len(torques) < n:
            self.count(f"{len(torques)} joint torques were given: this arm has {n} joints")
            return replace(command, torques=None)
        if any(torques[n:]):
            self.count(f"torques beyond the arm's {n} joints cannot act")
        return replace(command, torques=torques[:n])

    @property
    def logs(self) -> list[ExchangeLog]:
        """Exchanges of each client, in the order of connection; 100 clients at most."""
        return list(self._logs.values())

    @property
    def clients(self) -> int:
        """Number of clients that are connected."""
        return len(self._sessions)

    def inventory(self) -> dict[str, Any]:
        """Identity of the device, as plain data."""
        with self._lock:
            return self.protocol.inventory(self)

    def count(self, notice: str) -> None:
        """Counts what was dropped from a message, and reports it the first time."""
        notice = one_line(notice, LONGEST_NOTICE)  # a client's text may hold control characters
        if notice not in self.notices and len(self.notices) >= MOST_NOTICES:
            notice = "further kinds"  # bounds memory under random input
        self.notices[notice] += 1
        if self.notices[notice] == 1:
            LOG.warning(notice)

    @property
    def ended(self) -> str:
        """Why the device stopped; "" while it runs."""
        return self._fault or self.device.ended

    def _advance(self, samples: int | None = None) -> None:
        """Advances the device, which stops where its simulation fails: clients are not to wait."""
        if self._fault:
            return
        try:
            self.device.advance(samples)
        except Exception as error:
            self._fault = one_line(f"{type(error).__name__}: {error}", LONGEST_NOTICE)
            LOG.error("the device stopped: %s", self._fault, exc_info=error)

    # ---- conversion between cursor and arm

    def _drive(self) -> Drive:
        """The combined command of all clients, except those that have timed out."""
        now = time.monotonic()
        fresh = [
            s.command
            for s in self._sessions.values()
            if self.clock == "tick" or now - s.heard < PATIENCE
        ]
        forces = [along(c.force, self._axes) for c in fresh if c.force is not None]
        torques = [c.torques for c in fresh if c.torques is not None]
        targets = [along(c.target, self._axes) for c in fresh if c.target is not None]
        target = None
        if targets:  # the newest client's
            rest = along(REST, self._axes)
            target = tuple(x - x0 for x, x0 in zip(targets[-1], rest, strict=True))
        return Drive(_sums(forces), target, _sums(torques))

    def cursor(self, mode: str = "idle") -> Cursor:
        """The newest measurement, in the frame of the device."""
        seen, device, axes = self.device.sensed, self.device, self._axes
        return Cursor(
            to_cursor(seen.position, axes, REST),
            to_cursor(seen.velocity, axes),
            to_cursor(device.force, axes),
            mode,
            _in_degrees(seen.angles, self._turns),
            _in_degrees(seen.rates, self._turns),
            first_three(device.torques),
        )

    @property
    def joints(self) -> Joints:
        """The joints, as newly measured."""
        seen = self.device.sensed
        return Joints(self.device.scenario.joints, seen.angles, seen.rates, self.device.torques)

    @property
    def pressed(self) -> frozenset[str]:
        """Names of the buttons that are pressed."""
        return self.inverse3.buttons.at(self.device.sensed.t)

    # ---- the wall clock

    def start(self) -> None:
        """Starts the wall clock; does nothing with the clock "tick"."""
        if self.clock == "wall":
            self._thread = threading.Thread(target=self._run_clock, name="device", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        self.device.drive(LIMP)

    def _run_clock(self) -> None:
        sample = float(self.device.scenario.Ts or self.device.scenario.dt)
        begin = time.perf_counter()
        while not self._stop.is_set() and not self.ended:
            if self.device.paced:
                with self._lock:
                    self.device.drive(self._drive())
                self._stop.wait(LOOK)
                continue
            with self._lock:
                late = time.perf_counter() - begin - self.device.t
                if late > LATE:
                    skip = int(late / sample)
                    begin, late = begin + skip * sample, late - skip * sample
                    self.skipped += skip
                due = min(int(late / sample), AT_ONCE)
                if due:
                    self.device.drive(self._drive())
                    self._advance(due)
                    self.samples += due
            time.sleep(0.0 if due else 0.25 * sample)


def _sums(rows: Sequence[Numbers]) -> Numbers:
    return tuple(map(sum, zip(*rows, strict=True)))


def _in_degrees(values: Numbers, turns: Sequence[bool]) -> Vector:
    """Positions or rates of the first three joints; those that slide as they are."""
    pairs = zip(values, turns, strict=True)
    return first_three(tuple(math.degrees(x) if turning else x for x, turning in pairs))


def protocol_of(protocol: str) -> WireProtocol:
    if protocol == "rosbridge":
        from .rosbridge_service import RosbridgeProtocol

        return RosbridgeProtocol()
    from .inverse_service import InverseProtocol

    return InverseProtocol()
