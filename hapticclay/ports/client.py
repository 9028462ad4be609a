"""A client of the Inverse service: reads a device, real or simulated, and sends it forces.

A force is shortened to a limit, grows from nothing over a ramp, and is nothing after a sample that
did not come in time: never is the last force left on the device.
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

FIRST_FRAME = 5.0  # [s] that a service may take for its inventory
PATIENCE = 0.05  # [s] after which a sample is lost
MOST_MISSED = 40  # samples one after the other, after which the device is lost


@named
@dataclass(frozen=True)
class Limits:
    """What a client may do to the hand that holds the device.

    Attributes:
        largest_force: longer forces are shortened to this length [N], > 0, at most 100.
        ramp: time over which forces grow from nothing, at the start and after a lost sample [s],
            0 to 60.
        rate: exchanges in a second [Hz], 1 to 1e4: faster devices wait.
        patience: time after which a sample is lost [s], 1e-3 to 1.
        period: time that each exchange counts for, of a device whose clock is its messages [s],
            1e-5 to 1; None for the computer's clock.
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
        t: when the answer came, since the first one [s].
        position: of the cursor, x, y, z of the device [m].
        velocity: of the cursor [m/s].
        buttons: names of those pressed, of "a", "b", "c", "home".
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
        limits: of force and time.
        device_id: of the Inverse3 that is read.
        first: what the device measured before any force.
        log: what was exchanged.
        lost: why no more samples come; "" while they do.
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
        self._full_at = limits.ramp  # [s] when forces are whole
        self._missed = 0  # samples, one after the other
        self.log = ClientLog()
        self.first = self._sample(frame, 0.0)

    def __enter__(self) -> DeviceClient:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Takes the force away and disconnects."""
        with suppress(*self._broken):
            if not self.lost:
                self._send(NOTHING)
            self._socket.close()
        self.lost = self.lost or "closed"

    def restart_ramp(self) -> None:
        """Lets forces grow from nothing again, from now on."""
        self._full_at = self._time(time.perf_counter()) + self.limits.ramp

    def exchange(self, force: tuple[float, float, float] = NOTHING) -> DeviceSample | None:
        """Sends a force and waits for the state, at the rate of the limits.

        Args:
            force: on the cursor, x, y, z of the device [N]: shortened, and on its ramp.

        Returns:
            What the device measured; None if no answer came in time. Then the next force is
            nothing, whatever is asked, and later ones grow again.
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
        if frame is None:  # an answer without the device
            return self._miss()
        self._count += 1
        if self._missed:
            self._missed, self._full_at = 0, self._time(received) + self.limits.ramp
        sample = self._sample(frame, self._time(received))
        self.log.add(Exchanged(sent, received, sample.t, sample.position, sample.velocity, applied))
        return sample

    def _miss(self) -> None:
        """Notes a sample that is lost."""
        self._missed += 1
        self.log.missed += 1
        if self._missed >= MOST_MISSED:
            self.lost = f"{MOST_MISSED} samples were lost, one after the other"

    # ---- what is sent

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
        """A force within the limits; nothing for one that is not finite."""
        grown = 1.0
        if self.limits.ramp and (left := self._full_at - self._time(time.perf_counter())) > 0.0:
            grown = max(0.0, 1.0 - left / self.limits.ramp)
        return allowed(force, self.limits.largest_force, grown)

    def _send(self, force: Vector) -> None:
        asked = inverse.Message((inverse.Force(self.device_id, force),), (self.device_id,))
        self._socket.send(inverse.message_text(asked))
        self._waiting += 1

    # ---- what comes

    def _newest(self) -> inverse.Frame | None:
        """The answer to the last message, those to earlier ones passed over.

        Raises:
            TimeoutError: it does not come in time.
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
    """A force as the limits let it pass.

    Args:
        force: what is asked [N].
        largest: longer forces are shortened to this length [N].
        grown: share of the ramp that has passed, 0 to 1.

    Returns:
        The force [N]; nothing for one that is not finite.
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
        The client; its force is taken away at the end.

    Raises:
        ParameterError: there is no service, or no Inverse3, or websockets is not installed.
    """
    with DeviceClient(url, limits) as client:
        yield client
