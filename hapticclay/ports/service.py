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
from typing import Any

from ..display import one_line
from .commands import IDLE, NOTHING, Command, Vector
from .driven_arm import LIMP, Device, Drive
from .exchanges import Exchange, ExchangeLog
from .inverse import Cursor
from .planes import normal_component, to_plane, to_space
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
        self.inverse3, self._plane = inverse3, inverse3.plane
        self.protocol = protocol_of(inverse3.protocol)
        self.skipped = self.samples = 0  # control samples by the wall clock: late, and made
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
            session = self._sessions[number] = Session(number)
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
        device = self.device
        session.command, session.heard = command, time.monotonic()
        force = command.force or NOTHING
        x, y = to_plane(force, self._plane)
        z = normal_component(force, self._plane)
        if z:
            self.count("force across the plane of the arm is recorded and cannot act")
        began = device.t
        applied = device.drive(self._drive())
        if self.clock == "tick" and session.number == min(self._sessions):
            device.advance()
            for s in self._sessions.values():  # a command acts for one tick
                if s.number != session.number:
                    s.command = IDLE
        seen = device.sensed
        place, rate = seen.position, seen.velocity
        row = Exchange(session.heard, began, seen.t, place, rate, (x, y, z), applied)
        session.log.add(row)

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

    # ---- conversion between cursor and arm

    def _drive(self) -> Drive:
        """The combined command of all clients, except those that have timed out."""
        now = time.monotonic()
        fresh = [
            s.command
            for s in self._sessions.values()
            if self.clock == "tick" or now - s.heard < PATIENCE
        ]
        forces = [to_plane(c.force, self._plane) for c in fresh if c.force is not None]
        torques = [c.torques for c in fresh if c.torques is not None]
        targets = [to_plane(c.target, self._plane) for c in fresh if c.target is not None]
        target = None
        if targets:  # the newest client's
            (x, y), (x0, y0) = targets[-1], to_plane(REST, self._plane)
            target = x - x0, y - y0
        return Drive(
            (sum(f[0] for f in forces), sum(f[1] for f in forces)),
            target,
            (sum(x[0] for x in torques), sum(x[1] for x in torques)),
        )

    def cursor(self, mode: str = "idle") -> Cursor:
        """The newest measurement, in the frame of the device."""
        seen, device, plane = self.device.sensed, self.device, self._plane
        return Cursor(
            to_space(seen.position, plane, REST),
            to_space(seen.velocity, plane),
            to_space(device.force, plane),
            mode,
            (math.degrees(seen.angles[0]), math.degrees(seen.angles[1])),
            (math.degrees(seen.rates[0]), math.degrees(seen.rates[1])),
            device.torques,
        )

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
        while not self._stop.is_set() and not self.device.ended:
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
                    self.device.advance(due)
                    self.samples += due
            time.sleep(0.0 if due else 0.25 * sample)


def protocol_of(protocol: str) -> WireProtocol:
    if protocol == "rosbridge":
        from .rosbridge_service import RosbridgeProtocol

        return RosbridgeProtocol()
    from .inverse_service import InverseProtocol

    return InverseProtocol()
