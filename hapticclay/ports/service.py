"""The service behind the sockets: sessions of clients, a clock that moves the device, a watchdog.

What a client says is read and answered by a protocol; here all clients only have commands. Two
clocks. "tick": each command of the first client moves the device by a period, so that the same
messages give the same run to the last bit. "wall": the device moves in real time in a thread of its
own, under the newest command of each client (a zero-order hold).
"""

from __future__ import annotations

import logging
import math
import re
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Protocol

from ..arguments import named
from ..errors import Bound, ParameterError, check_fields
from ..scene.scenario import Scenario
from .buttons import ButtonScript
from .commands import IDLE, NOTHING, Command, Pair, Vector
from .driven_arm import LARGEST_FORCE, LIMP, Drive, Sensed
from .exchanges import Exchange, ExchangeLog
from .inverse import Cursor
from .planes import across, flat, lifted

REST: Vector = (0.08, -0.15, 0.14)  # [m] where an Inverse3 has its cursor at rest: handle at p = 0
ID = re.compile("[0-9A-F]{1,16}")
PORTS = {"inverse": 10_001, "rosbridge": 9090}  # where clients look for each protocol
# [s] without a message after which a client's command no longer acts: with the thread's turn, 50 ms
PATIENCE = 0.048
LATE = 0.1  # [s] behind the clock from which on time is skipped
MOST_LOGS = 100  # of clients
MOST_NOTICES, LONGEST_NOTICE = 100, 120  # kinds that are counted apart; characters
AT_ONCE = 8  # control samples that the thread makes before clients get their turn
LOOK = 0.002  # [s] between two looks at the clients of a device that something else moves
LOG = logging.getLogger("hapticclay.ports")


@named
@dataclass(frozen=True)
class Inverse3:
    """What the simulated device shows itself as.

    Attributes:
        device_id: of the Inverse3, 1 to 16 hexadecimal digits.
        grip_id: of the grip, 1 to 16 hexadecimal digits.
        plane: "xy" or "xz", plane of the cursor in which the arm moves.
        buttons: of the grip, over time.
        largest_force: longer forces are shortened to this length [N], > 0, at most 1e3.
        protocol: "inverse", of the Haply Inverse service, or "rosbridge", topics of ROS as JSON.
    """

    device_id: str = "04EA"
    grip_id: str = "F00D"
    plane: Literal["xy", "xz"] = "xy"
    buttons: ButtonScript = ButtonScript()
    largest_force: Annotated[float, Bound(0.0, 1e3, "N", above=True)] = LARGEST_FORCE
    protocol: Literal["inverse", "rosbridge"] = "inverse"

    def __post_init__(self):
        check_fields(self)
        for name in ("device_id", "grip_id"):
            if not ID.fullmatch(getattr(self, name)):
                bound = "must be 1 to 16 hexadecimal digits, as 04EA"
                raise ParameterError(name, getattr(self, name), bound)


PLAIN = Inverse3()


class Device(Protocol):
    """What a service drives: a `SimulatedDevice`, or the arm of a session that a person watches.

    Attributes:
        paced: whether something else than the clock of the service moves it.
    """

    paced: bool

    @property
    def t(self) -> float: ...
    @property
    def sensed(self) -> Sensed: ...
    @property
    def force(self) -> Pair: ...
    @property
    def torques(self) -> Pair: ...
    @property
    def ended(self) -> str: ...
    @property
    def scenario(self) -> Scenario: ...
    def drive(self, drive: Drive) -> Pair: ...
    def advance(self, samples: int | None = None) -> None: ...


@dataclass
class Session:
    """A client that is connected.

    Attributes:
        number: 1 for the first client, and so on.
        command: its newest one.
        heard: when its last command came [s].
        log: its exchanges.
        profile: name that it gave itself.
        memory: what its protocol keeps.
    """

    number: int
    command: Command = IDLE
    heard: float = -math.inf
    log: ExchangeLog = field(default_factory=ExchangeLog)
    profile: str = ""
    memory: Any = None


class Speech(Protocol):
    """A protocol: reads what a client sends, and writes what it is sent.

    Attributes:
        name: of the protocol.
        pushes: whether clients are sent states that they have not asked for.
    """

    name: str
    pushes: bool

    def greet(self, service: Service, session: Session) -> list[str]: ...
    def answer(self, service: Service, session: Session, data: str | bytes) -> list[str]: ...
    def due(self, service: Service, session: Session) -> list[str]: ...
    def inventory(self, service: Service) -> dict[str, Any]: ...


class Service:
    """Clients, their commands, and the clock.

    Attributes:
        device: what is driven.
        clock: "tick" or "wall".
        inverse3: what the device shows itself as.
        speech: the protocol.
        notices: what was left out of messages, and how often.
        skipped: control samples that the wall clock left out, since the computer was late.
        samples: control samples that it made.
    """

    def __init__(
        self,
        device: Device,
        *,
        clock: str = "wall",
        inverse3: Inverse3 = PLAIN,
    ):
        """Waits for clients; the wall clock goes from `start` on.

        Args:
            device: what is driven.
            clock: "tick" or "wall".
            inverse3: what the device shows itself as, and the protocol it speaks.
        """
        self.device, self.clock, self.notices = device, clock, Counter[str]()
        self.inverse3, self._plane = inverse3, inverse3.plane
        self.speech = speech_of(inverse3.protocol)
        self.skipped = self.samples = 0
        self._sessions: dict[int, Session] = {}
        self._logs: dict[int, ExchangeLog] = {}
        self._count = 0  # of clients so far
        self._lock, self._stop = threading.RLock(), threading.Event()
        self._thread: threading.Thread | None = None

    # ---- clients

    def connect(self) -> tuple[int, list[str]]:
        """A new client.

        Returns:
            The number of its session, and what to send first.
        """
        with self._lock:
            self._count += 1
            number = self._count
            session = self._sessions[number] = Session(number)
            self._logs[number] = session.log
            if len(self._logs) > MOST_LOGS:  # clients that come and go fill no memory
                gone = [k for k in self._logs if k not in self._sessions]
                if gone:
                    del self._logs[min(gone, key=lambda k: self._logs[k].count)]
            return number, self.speech.greet(self, session)

    def leave(self, number: int) -> None:
        """A client has gone, and its command with it.

        Args:
            number: of its session.
        """
        with self._lock:
            self._sessions.pop(number, None)
            self.device.drive(LIMP if self.clock == "tick" else self._drive())

    def answer(self, number: int, data: str | bytes) -> list[str]:
        """What to send for a message.

        Args:
            number: of the client's session.
            data: its message, text or binary, whatever it is.
        """
        with self._lock:
            return self.speech.answer(self, self._sessions[number], data)

    def due(self, number: int) -> list[str]:
        """What to send a client that has not asked.

        Args:
            number: of its session.
        """
        with self._lock:
            session = self._sessions.get(number)
            return [] if session is None else self.speech.due(self, session)

    def obey(self, session: Session, command: Command) -> None:
        """Takes a client's command; with the clock "tick", the first client's moves the device.

        Args:
            session: of the client.
            command: what it asks; without anything it is idle.
        """
        device = self.device
        session.command, session.heard = command, time.monotonic()
        force = command.force or NOTHING
        x, y = flat(force, self._plane)
        z = across(force, self._plane)
        if z:
            self.count("force across the plane of the arm is recorded and cannot act")
        began = device.t
        applied = device.drive(self._drive())
        if self.clock == "tick" and session.number == min(self._sessions):
            device.advance()
            for s in self._sessions.values():  # a command holds for a tick
                if s.number != session.number:
                    s.command = IDLE
        seen = device.sensed
        place, rate = seen.position, seen.velocity
        row = Exchange(session.heard, began, seen.t, place, rate, (x, y, z), applied)
        session.log.add(row)

    @property
    def logs(self) -> list[ExchangeLog]:
        """Exchanges of each client, in the order of their connection; of 100 at most."""
        return list(self._logs.values())

    @property
    def clients(self) -> int:
        """Number of clients that are connected."""
        return len(self._sessions)

    def inventory(self) -> dict[str, Any]:
        """What the device shows itself as, as plain data."""
        with self._lock:
            return self.speech.inventory(self)

    def count(self, notice: str) -> None:
        """Counts what was left out of a message, and says it the first time.

        Args:
            notice: what, and why.
        """
        notice = notice[:LONGEST_NOTICE]
        if notice not in self.notices and len(self.notices) >= MOST_NOTICES:
            notice = "further kinds"  # whoever sends rubbish at random fills no memory
        self.notices[notice] += 1
        if self.notices[notice] == 1:
            LOG.warning(notice)

    # ---- between cursor and arm

    def _drive(self) -> Drive:
        """What all clients ask together, those that were silent for too long left out."""
        now = time.monotonic()
        fresh = [
            s.command
            for s in self._sessions.values()
            if self.clock == "tick" or now - s.heard < PATIENCE
        ]
        forces = [flat(c.force, self._plane) for c in fresh if c.force is not None]
        torques = [c.torques for c in fresh if c.torques is not None]
        targets = [flat(c.target, self._plane) for c in fresh if c.target is not None]
        target = None
        if targets:  # the newest client's
            (x, y), (x0, y0) = targets[-1], flat(REST, self._plane)
            target = x - x0, y - y0
        return Drive(
            (sum(f[0] for f in forces), sum(f[1] for f in forces)),
            target,
            (sum(x[0] for x in torques), sum(x[1] for x in torques)),
        )

    def cursor(self, mode: str = "idle") -> Cursor:
        """The newest measurement, in the frame of the device.

        Args:
            mode: what the client that it is for drives.
        """
        seen, device, plane = self.device.sensed, self.device, self._plane
        return Cursor(
            lifted(seen.position, plane, REST),
            lifted(seen.velocity, plane),
            lifted(device.force, plane),
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
        """Lets the wall clock go; does nothing with the clock "tick"."""
        if self.clock == "wall":
            self._thread = threading.Thread(target=self._go, name="device", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stops the clock; the device no longer moves."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        self.device.drive(LIMP)

    def _go(self) -> None:
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


def speech_of(protocol: str) -> Speech:
    """The protocol of a name.

    Args:
        protocol: "inverse" or "rosbridge".
    """
    if protocol == "rosbridge":
        from .rosbridge_service import RosbridgeSpeech

        return RosbridgeSpeech()
    from .inverse_service import InverseSpeech

    return InverseSpeech()
