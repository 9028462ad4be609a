"""A client of the Inverse service: reads a device, real or simulated, and sends it forces.

Each force is limited in length and rises from zero over a ramp. When a sample is late, the client
sends zero force, so the device never holds an outdated one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from ..arguments import named
from ..errors import Bound, ParameterError, check_fields, needing
from . import inverse
from .client_log import ClientLog, Exchanged
from .commands import NOTHING, Vector

FIRST_FRAME = 5.0  # [s] timeout for the inventory of a service
PATIENCE = 0.05  # [s] after which a sample counts as lost
MOST_MISSED = 40  # consecutive lost samples after which the device counts as lost


@named
@dataclass(frozen=True)
class Limits:
    """Limits that protect the hand that holds the device.

    Attributes:
        largest_force: longer forces are shortened to this length [N], > 0, at most 100.
        ramp: time over which forces rise from zero, at the start and after a lost sample [s],
            0 to 60.
        rate: exchanges per second [Hz], 1 to 1e4; a faster device waits.
        patience: time after which a sample counts as lost [s], 1e-3 to 1.
        period: time per exchange, for a device whose clock advances with its messages [s],
            1e-5 to 1; None to use the computer's clock.
    """

    largest_force: Annotated[float, Bound(0.0, 100.0, "N", above=True)] = 3.0
    ramp: Annotated[float, Bound(0.0, 60.0, "s")] = 1.0
    rate: Annotated[float, Bound(1.0, 1e4, "Hz")] = 1000.0
    patience: Annotated[float, Bound(1e-3, 1.0, "s")] = PATIENCE
    period: Annotated[float | None, Bound(1e-5, 1.0, "s")] = None

    def __post_init__(self):
        check_fields(self)

    @property
    def Ts(self) -> float:
        """Time between two exchanges [s]."""
        return 1.0 / self.rate if self.period is None else self.period


PLAIN = Limits()


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
        try:
            self._socket = connect(url, compression=None, open_timeout=FIRST_FRAME)
            frame = inverse.read_frame(self._socket.recv(timeout=FIRST_FRAME))
        except (*self._broken, TimeoutError, ValueError) as error:
            why = str(error) or type(error).__name__
            raise ParameterError("device", url, f"must be an Inverse service ({why})") from None
        if frame is None:
            self._socket.close()
            raise ParameterError("device", url, "must have an Inverse3")
        self.device_id = frame.device_id
        self._begin = self._due = time.perf_counter()
        self._waiting = self._count = 0
        self._full_at = limits.ramp  # [s] when the ramp is complete
        self._missed = 0  # consecutive samples
        self.log = ClientLog()
        self.first = self._sample(frame, 0.0)

    def __enter__(self) -> DeviceClient:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Sends zero force and disconnects."""
        with suppress(*self._broken):
            if not self.lost:
                self._send(NOTHING)
            self._socket.close()
        self.lost = self.lost or "closed"

    def restart_ramp(self) -> None:
        """Restarts the ramp: forces rise from zero again."""
        self._full_at = self._time(time.perf_counter()) + self.limits.ramp

    def exchange(self, force: tuple[float, float, float] = NOTHING) -> DeviceSample | None:
        """Sends a force and waits for the answer, at the rate set in the limits.

        Args:
            force: force on the cursor, x, y, z of the device [N], before limit and ramp.

        Returns:
            The measurement; None if no answer came in time. In that case the next force is
            zero, whatever the request, and the ramp restarts.
        """
        if self.lost:
            return None
        self._wait()
        applied = NOTHING if self._missed else self._allowed(force)
        sent = time.perf_counter()
        try:
            self._send(applied)
            frame = self._newest()
        except TimeoutError:
            return self._miss()
        except self._broken as error:
            self.lost = str(error) or type(error).__name__
            return None
        received = time.perf_counter()
        if frame is None:  # the answer does not contain the device
            return self._miss()
        self._count += 1
        if self._missed:
            self._missed, self._full_at = 0, self._time(received) + self.limits.ramp
        sample = self._sample(frame, self._time(received))
        self.log.add(Exchanged(sent, received, sample.t, sample.position, sample.velocity, applied))
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

    def _allowed(self, force: Vector) -> Vector:
        """The force within the limits; zero if it is not finite."""
        grown = 1.0
        if self.limits.ramp and (left := self._full_at - self._time(time.perf_counter())) > 0.0:
            grown = max(0.0, 1.0 - left / self.limits.ramp)
        return allowed(force, self.limits.largest_force, grown)

    def _send(self, force: Vector) -> None:
        asked = inverse.Message((inverse.Force(self.device_id, force),), (self.device_id,))
        self._socket.send(inverse.message_text(asked))
        self._waiting += 1

    # ---- receiving

    def _newest(self) -> inverse.Frame | None:
        """The answer to the last message; answers to earlier messages are skipped.

        Raises:
            TimeoutError: the answer does not arrive in time.
        """
        end, frame = time.perf_counter() + self.limits.patience, None
        while self._waiting:
            data = self._socket.recv(timeout=max(0.0, end - time.perf_counter()))
            self._waiting -= 1
            frame = inverse.read_frame(data)
        return frame

    def _sample(self, frame: inverse.Frame, t: float) -> DeviceSample:
        return DeviceSample(t, frame.cursor.position, frame.cursor.velocity, frame.buttons)


def allowed(force: Vector, largest: float, grown: float) -> Vector:
    """Applies the limits to a force.

    Args:
        force: requested force [N].
        largest: longer forces are shortened to this length [N].
        grown: share of the ramp that has passed, 0 to 1.

    Returns:
        The force [N]; zero if the request is not finite.
    """
    size = math.hypot(*force)
    if not math.isfinite(size) or not size:
        return NOTHING
    scale = grown * min(1.0, largest / size)
    return force[0] * scale, force[1] * scale, force[2] * scale


@named
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
