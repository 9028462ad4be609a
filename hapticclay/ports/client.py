"""A client of the Inverse service: reads a device, real or simulated, and sends it forces.

Each force is limited in length and rate of change, and rises from zero over a ramp, at the start
and after each gap. When a sample is late, or positions are frozen, the client sends zero force, so
the device never holds an outdated one.
"""

from __future__ import annotations

import os
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, NamedTuple

from ..arguments import checked, named
from ..errors import ParameterError, needing
from . import inverse
from .client_log import ClientLog, Exchanged
from .commands import NOTHING, Vector
from .inbox import Inbox
from .limits import PLAIN, ForceLimiter, Limits

FIRST_FRAME = 5.0  # [s] timeout for the inventory of a service
CLOSING = 1.0  # [s] timeout for the closing handshake, and for a message that is not read
MOST_MISSED = 40  # consecutive lost samples after which the device counts as lost


class DeviceSample(NamedTuple):
    """What a device measured.

    Attributes:
        t: time of arrival, counted from the first answer [s].
        position: position of the cursor, x, y, z of the device [m].
        velocity: velocity of the cursor [m/s].
        buttons: names of the pressed buttons, from "a", "b", "c", "home".
    """

    t: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    buttons: frozenset[str]


@named
class DeviceClient:
    """A connection to an Inverse service, one exchange at a time.

    Attributes:
        url: of the service.
        limits: limits of force and time.
        device_id: id of the Inverse3 that the client reads.
        first: the measurement before any force was sent.
        log: the exchanges.
        lost: why the samples stopped; "" while they arrive.
    """

    def __init__(self, url: str, limits: Limits = PLAIN):
        """Connects, and waits for the devices of the service.

        Args:
            url: of the service, as ws://127.0.0.1:10001.
            limits: of force and time.

        Raises:
            ParameterError: there is no service, or no Inverse3, or websockets is not installed.
        """
        if not isinstance(url, str):
            bound = "must be the address of a service, such as ws://127.0.0.1:10001"
            raise ParameterError("url", url, bound)
        with needing("a device", "websockets", "device"):
            from websockets.exceptions import WebSocketException
            from websockets.sync.client import connect
        self.url, self.limits, self.lost = url, limits, ""
        self._broken: Any = (WebSocketException, OSError, EOFError)
        with ExitStack() as stack:
            try:
                self._socket = connect(
                    url,
                    compression=None,
                    open_timeout=FIRST_FRAME,
                    ping_interval=None,  # not every device answers pings; each exchange is a check
                    close_timeout=CLOSING,
                )
                stack.callback(self._socket.close)
                frame = inverse.read_frame(self._socket.recv(timeout=FIRST_FRAME))
            except (*self._broken, TimeoutError, ValueError) as error:
                why = str(error) or type(error).__name__
                raise ParameterError("device", url, f"must be an Inverse service ({why})") from None
            if frame is None:
                raise ParameterError("device", url, "must have an Inverse3")
            stack.pop_all()
        _bound_sending(self._socket.socket)
        self.device_id = frame.device_id
        self._begin = self._due = time.perf_counter()
        self._count = 0
        self._missed = 0  # consecutive samples
        self._force = ForceLimiter(limits)
        self.log = ClientLog()
        self.first = self._sample(frame, 0.0)
        self._inbox = Inbox(self._socket, self._broken)

    def __enter__(self) -> DeviceClient:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Sends zero force and disconnects."""
        with suppress(*self._broken):
            if not self.lost:
                self._send(NOTHING)
        with suppress(*self._broken):
            self._socket.close()
        self._inbox.join(CLOSING)
        self.lost = self.lost or "closed"

    def restart_ramp(self) -> None:
        """Restarts the ramp: forces rise from zero again."""
        self._force.restart(self._time(time.perf_counter()))

    def exchange(self, force: tuple[float, float, float] = NOTHING) -> DeviceSample | None:
        """Sends a force and waits for the answer, at the rate set in the limits.

        Of several frames that came meanwhile, the newest is taken; `log.skipped` counts the others.

        Args:
            force: force on the cursor, x, y, z of the device [N], before the limits; one that is
                not finite counts as zero.

        Returns:
            The measurement; None if no answer came in time. In that case the next force is
            zero, whatever the request, and the ramp restarts.
        """
        if self.lost:
            return None
        self._wait()
        sent = time.perf_counter()
        applied = self._force.apply(force, self._time(sent), lost=self._missed > 0)
        self._inbox.sending()
        try:
            self._send(applied)
        except self._broken as error:
            self.lost = str(error) or type(error).__name__
            return None
        answer = self._inbox.answer(self.limits.patience)
        self.log.skipped, self.log.withheld = self._inbox.skipped, self._force.withheld
        if self._inbox.ended:
            self.lost = self._inbox.ended
            return None
        if answer is None:
            return self._miss()
        self._count += 1
        t = self._time(answer.received)
        if self._missed:
            self._missed = 0
            self._force.restart(t)
        sample = self._sample(answer.frame, t)
        self._force.see(sample.position, t)
        place, rate = sample.position, sample.velocity
        self.log.add(Exchanged(sent, answer.received, t, place, rate, applied))
        return sample

    def _miss(self) -> None:
        """Records a lost sample."""
        self._missed += 1
        self.log.missed += 1
        if self._missed >= MOST_MISSED:
            self.lost = f"{MOST_MISSED} samples were lost, one after the other"

    # ---- sending

    def _wait(self) -> None:
        """Waits until the next exchange is due."""
        if self.limits.period is not None:
            return
        self._due = max(self._due + 1.0 / self.limits.rate, time.perf_counter() - 1e-3)
        while (left := self._due - time.perf_counter()) > 0.0:
            time.sleep(left)

    def _time(self, now: float) -> float:
        """Time of an exchange [s]."""
        period = self.limits.period
        return now - self._begin if period is None else self._count * period

    def _send(self, force: Vector) -> None:
        asked = inverse.Message((inverse.Force(self.device_id, force),), (self.device_id,))
        self._socket.send(inverse.message_text(asked))

    def _sample(self, frame: inverse.Frame, t: float) -> DeviceSample:
        return DeviceSample(t, frame.cursor.position, frame.cursor.velocity, frame.buttons)


def _bound_sending(connected: socket.socket) -> None:
    """Ends the connection to a device that reads no messages, where sending would wait forever."""
    if os.name == "posix":
        timeout = struct.pack("@ll", round(CLOSING), 0)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, timeout)


@checked
@contextmanager
def connect(url: str, limits: Limits = PLAIN) -> Iterator[DeviceClient]:
    """Connects to a device, real or simulated, while the `with` block runs.

        with hapticclay.ports.connect("ws://127.0.0.1:10001") as device:
            sample = device.exchange((0.0, 0.0, 0.0))
            device.log.save("device.csv")

    Args:
        url: of an Inverse service.
        limits: of force and time.

    Yields:
        The client; at the end it sends zero force.

    Raises:
        ParameterError: there is no service, or no Inverse3, or websockets is not installed.
    """
    with DeviceClient(url, limits) as client:
        yield client
