"""Types shared by a service and its protocols: the device, its identity, and its clients."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Protocol

from ..arguments import part
from ..errors import Bound, ParameterError
from ..scene.scenario import Scenario
from .buttons import ButtonScript
from .commands import IDLE, Command, Pair
from .driven_arm import LARGEST_FORCE, Drive, Sensed
from .exchanges import ExchangeLog
from .guard import origins_of
from .inverse import Cursor

ID = re.compile("[0-9A-F]{1,16}")
PORTS = {"inverse": 10_001, "rosbridge": 9090}  # default port of each protocol


@part()
class Inverse3:
    """Identity of the simulated device.

    Attributes:
        device_id: id of the Inverse3, 1 to 16 hexadecimal digits.
        grip_id: id of the grip, 1 to 16 hexadecimal digits.
        plane: "xy" or "xz", plane of the cursor in which the arm moves.
        buttons: pressed buttons of the grip over time.
        largest_force: longer forces are shortened to this length [N], > 0, at most 1e3.
        protocol: "inverse" for the Haply Inverse service, or "rosbridge" for ROS topics as JSON.
        origins: addresses of web pages that may drive the device, as ("http://localhost:8000",).
            Others are refused, for a browser would let any page connect to this machine.
    """

    device_id: str = "04EA"
    grip_id: str = "F00D"
    plane: Literal["xy", "xz"] = "xy"
    buttons: ButtonScript = ButtonScript()
    largest_force: Annotated[float, Bound(0.0, 1e3, "N", above=True)] = LARGEST_FORCE
    protocol: Literal["inverse", "rosbridge"] = "inverse"
    origins: Any = ()  # texts, checked below

    def __post_init__(self):
        object.__setattr__(self, "origins", origins_of(self.origins))
        for name in ("device_id", "grip_id"):
            if not ID.fullmatch(getattr(self, name)):
                bound = "must be 1 to 16 hexadecimal digits, as 04EA"
                raise ParameterError(name, getattr(self, name), bound)


PLAIN = Inverse3()


class Device(Protocol):
    """The device of a service: a `SimulatedDevice`, or the arm of a session with a viewer.

    Attributes:
        paced: whether anything but the clock of the service advances the device.
    """

    paced: bool

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


@dataclass
class Session:
    """A connected client.

    Attributes:
        number: 1 for the first client, and so on.
        command: newest command.
        heard: when the last command arrived [s].
        log: exchanges.
        profile: name that the client gave itself.
        memory: state that the protocol keeps.
    """

    number: int
    command: Command = IDLE
    heard: float = -math.inf
    log: ExchangeLog = field(default_factory=ExchangeLog)
    profile: str = ""
    memory: Any = None


class Host(Protocol):
    """The service as a protocol sees it.

    Attributes:
        device: the driven device.
        clock: "tick" or "wall".
        inverse3: identity of the simulated device.
    """

    device: Device
    clock: str
    inverse3: Inverse3

    @property
    def pressed(self) -> frozenset[str]:
        """Names of the buttons that are pressed."""
        ...

    def cursor(self, mode: str = "idle") -> Cursor:
        """The newest measurement, in the frame of the device."""
        ...

    def apply(self, session: Session, command: Command) -> None:
        """Applies a client's command."""

    def count(self, notice: str) -> None:
        """Counts what was dropped from a message."""


class WireProtocol(Protocol):
    """A protocol: reads messages from a client and writes messages to it.

    Attributes:
        name: name of the protocol.
        pushes: whether the service pushes states to clients.
    """

    name: str
    pushes: bool

    def greet(self, service: Host, session: Session) -> list[str]:
        """The first message to a client."""
        ...

    def answer(self, service: Host, session: Session, data: str | bytes) -> list[str]:
        """The answer to a message of a client."""
        ...

    def due(self, service: Host, session: Session) -> list[str]:
        """Messages to push to a client."""
        ...

    def inventory(self, service: Host) -> dict[str, Any]:
        """The available devices or topics, as plain data."""
        ...
