"""The service behind the sockets: sessions of clients, a clock that moves the device, a watchdog.

Two clocks. "tick": each message of the first client moves the device by a period under its force,
so that the same messages give the same run to the last bit. "wall": the device moves in real time
in a thread of its own, under the newest force of each client (a zero-order hold).
"""

from __future__ import annotations

import logging
import re
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from ..arguments import named
from ..errors import Bound, ParameterError, check_fields
from . import inverse
from .buttons import ButtonScript
from .device import LARGEST_FORCE, Pair, Sensed, SimulatedDevice
from .exchanges import Exchange, ExchangeLog
from .inverse import Vector

REST: Vector = (0.08, -0.15, 0.14)  # [m] where an Inverse3 has its cursor at rest: handle at p = 0
ID = re.compile("[0-9A-F]{1,16}")
PLANES = {"xy": (0, 1), "xz": (0, 2)}  # axes of the cursor that are x and y of the arm
PATIENCE = 0.05  # [s] without a message after which a client's force is no longer applied
LATE = 0.1  # [s] behind the clock from which on time is skipped
MOST_NOTICES, LONGEST_NOTICE = 100, 120  # kinds that are counted apart; characters
AT_ONCE = 8  # control samples that the thread makes before clients get their turn
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
    """

    device_id: str = "04EA"
    grip_id: str = "F00D"
    plane: Literal["xy", "xz"] = "xy"
    buttons: ButtonScript = ButtonScript()
    largest_force: Annotated[float, Bound(0.0, 1e3, "N", above=True)] = LARGEST_FORCE

    def __post_init__(self):
        check_fields(self)
        for name in ("device_id", "grip_id"):
            if not ID.fullmatch(getattr(self, name)):
                bound = "must be 1 to 16 hexadecimal digits, as 04EA"
                raise ParameterError(name, getattr(self, name), bound)


PLAIN = Inverse3()


@dataclass
class Session:
    """A client that is connected.

    Attributes:
        number: 1 for the first client, and so on.
        asked: its force, along x, y, z of the device [N].
        heard: when its last message came [s].
        driving: whether its last message had a force.
        log: its exchanges.
        profile: name that it gave itself.
    """

    number: int
    asked: Vector = inverse.NOTHING
    heard: float = 0.0
    driving: bool = False
    log: ExchangeLog = field(default_factory=ExchangeLog)
    profile: str = ""


class Service:
    """Answers messages with frames: an inventory at first, then one frame a message.

    Attributes:
        device: what is driven.
        clock: "tick" or "wall".
        notices: what was left out of messages, and how often.
        skipped: control samples that the wall clock left out, since the computer was late.
        samples: control samples that it made.
    """

    def __init__(
        self,
        device: SimulatedDevice,
        *,
        clock: str = "wall",
        inverse3: Inverse3 = PLAIN,
    ):
        """Waits for clients; the wall clock goes from `start` on.

        Args:
            device: what is driven.
            clock: "tick" or "wall".
            inverse3: what the device shows itself as.
        """
        self.device, self.clock, self.notices = device, clock, Counter[str]()
        self.inverse3, self._plane = inverse3, PLANES[inverse3.plane]
        self.skipped = self.samples = 0
        self._sessions: dict[int, Session] = {}
        self._logs: list[ExchangeLog] = []
        self._lock, self._stop = threading.RLock(), threading.Event()
        self._thread: threading.Thread | None = None

    # ---- clients

    def connect(self) -> tuple[int, str]:
        """A new client.

        Returns:
            The number of its session, and the inventory to send first.
        """
        with self._lock:
            number = len(self._logs) + 1
            session = self._sessions[number] = Session(number)
            self._logs.append(session.log)
            return number, self._frame(session, full=True)

    def leave(self, number: int) -> None:
        """A client has gone, and its force with it.

        Args:
            number: of its session.
        """
        with self._lock:
            self._sessions.pop(number, None)
            if self.clock == "tick" or not self._sessions:
                self.device.push((0.0, 0.0))

    def answer(self, number: int, data: str | bytes) -> str:
        """The frame for a message.

        Args:
            number: of the client's session.
            data: its message, text or binary, whatever it is.
        """
        message = inverse.read_message(data)
        with self._lock:
            session, device = self._sessions[number], self.device
            self._note(message)
            force = message.force_on(self.inverse3.device_id)
            session.driving, session.heard = force is not None, time.monotonic()
            session.asked = inverse.NOTHING if force is None else force
            session.profile = message.profile or session.profile
            if session.asked[self._normal]:
                self._count("force across the plane of the arm is recorded and cannot act")
            began = device.t
            applied = device.push(self._total())
            if self.clock == "tick" and number == min(self._sessions):
                device.advance()
                for s in self._sessions.values():  # a command holds for a tick
                    if s.number != number:
                        s.asked = inverse.NOTHING
            seen = device.sensed
            place, rate = seen.position, seen.velocity
            i, j = self._plane
            asked = session.asked[i], session.asked[j], session.asked[self._normal]
            row = Exchange(session.heard, began, seen.t, place, rate, asked, applied)
            session.log.add(row)
            return self._frame(session, message.full)

    @property
    def logs(self) -> list[ExchangeLog]:
        """Exchanges of each client, in the order of their connection."""
        return list(self._logs)

    def inventory(self) -> dict[str, Any]:
        """What a client is sent first, as plain data."""
        with self._lock:
            return inverse.frame_data(self._made(Session(0), full=True))

    def _note(self, message: inverse.Message) -> None:
        shown, others = self.inverse3, []
        for name in message.devices:
            if name not in (shown.device_id, shown.grip_id):
                others.append(f"a client drives {name}, this device is {shown.device_id}")
        for notice in (*message.notices, *dict.fromkeys(others)):
            self._count(notice)

    def _count(self, notice: str) -> None:
        notice = notice[:LONGEST_NOTICE]
        if notice not in self.notices and len(self.notices) >= MOST_NOTICES:
            notice = "further kinds"  # whoever sends rubbish at random fills no memory
        self.notices[notice] += 1
        if self.notices[notice] == 1:
            LOG.warning(notice)

    # ---- frames

    @property
    def _normal(self) -> int:
        """Axis of the cursor along which the arm cannot move."""
        return 3 - sum(self._plane)

    def _total(self) -> Pair:
        """Sum of the forces of all clients whose last message is not too old."""
        now = time.monotonic()
        fresh = [
            s for s in self._sessions.values() if self.clock == "tick" or now - s.heard < PATIENCE
        ]
        i, j = self._plane
        return sum(s.asked[i] for s in fresh), sum(s.asked[j] for s in fresh)

    def _lifted(self, v: Pair, rest: Vector = inverse.NOTHING) -> Vector:
        """A vector of the arm's plane as one of the cursor."""
        out = list(rest)
        for axis, value in zip(self._plane, v, strict=True):
            out[axis] += value
        return out[0], out[1], out[2]

    def _made(self, session: Session, full: bool) -> inverse.Frame:
        seen: Sensed = self.device.sensed
        cursor = inverse.Cursor(
            self._lifted(seen.position, REST),
            self._lifted(seen.velocity),
            self._lifted(self.device.force),
            session.driving,
        )
        shown = self.inverse3
        pressed = shown.buttons.at(seen.t)
        return inverse.Frame(shown.device_id, cursor, shown.grip_id, pressed, session.number, full)

    def _frame(self, session: Session, full: bool) -> str:
        return inverse.frame_text(self._made(session, full))

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
        self.device.push((0.0, 0.0))

    def _go(self) -> None:
        sample = float(self.device.scenario.Ts or self.device.scenario.dt)
        begin = time.perf_counter()
        while not self._stop.is_set() and not self.device.ended:
            with self._lock:
                late = time.perf_counter() - begin - self.device.t
                if late > LATE:
                    skip = int(late / sample)
                    begin, late = begin + skip * sample, late - skip * sample
                    self.skipped += skip
                due = min(int(late / sample), AT_ONCE)
                if due:
                    self.device.push(self._total())
                    self.device.advance(due)
                    self.samples += due
            time.sleep(0.0 if due else 0.25 * sample)
