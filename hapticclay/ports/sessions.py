"""What a service and its protocols share: the device, what it shows itself as, and its clients."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Protocol

from ..arguments import named
from ..errors import Bound, ParameterError, check_fields
from ..scene.scenario import Scenario
from .buttons import ButtonScript
from .commands import IDLE, Command, Pair
from .driven_arm import LARGEST_FORCE, Drive, Sensed
from .exchanges import ExchangeLog
from .inverse import Cursor

ID = re.compile("[0-9A-F]{1,16}")
PORTS = {"inverse": 10_001, "rosbridge": 9090}  # where clients look for each protocol


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
        """Torques that act on the joints beside that force [N.m]."""
        ...

    @property
    def ended(self) -> str:
        """Why the device no longer moves; "" while it does."""
        ...

    @property
    def scenario(self) -> Scenario:
        """What is simulated."""
        ...

    def drive(self, drive: Drive) -> Pair:
        """Changes what the motors do from the next control sample on.

        Args:
            drive: in the plane of the arm.
        """
        ...

    def advance(self, samples: int | None = None) -> None:
        """Moves on.

        Args:
            samples: control samples; None for a period.
        """


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


class Host(Protocol):
    """What a protocol sees of the service.

    Attributes:
        device: what is driven.
        clock: "tick" or "wall".
        inverse3: what the device shows itself as.
    """

    device: Device
    clock: str
    inverse3: Inverse3

    @property
    def pressed(self) -> frozenset[str]:
        """Names of the buttons that are pressed."""
        ...

    def cursor(self, mode: str = "idle") -> Cursor:
        """The newest measurement, in the frame of the device.

        Args:
            mode: what the client that it is for drives.
        """
        ...

    def apply(self, session: Session, command: Command) -> None:
        """Takes a client's command.

        Args:
            session: of the client.
            command: what it asks.
        """

    def count(self, notice: str) -> None:
        """Counts what was left out of a message.

        Args:
            notice: what, and why.
        """


class WireProtocol(Protocol):
    """A protocol: reads what a client sends, and writes what it is sent.

    Attributes:
        name: of the protocol.
        pushes: whether clients are sent states that they have not asked for.
    """

    name: str
    pushes: bool

    def greet(self, service: Host, session: Session) -> list[str]:
        """What a client is sent first.

        Args:
            service: that it talks to.
            session: of the client.
        """
        ...

    def answer(self, service: Host, session: Session, data: str | bytes) -> list[str]:
        """What a client is sent for a message.

        Args:
            service: that it talks to.
            session: of the client.
            data: its message, text or binary, whatever it is.
        """
        ...

    def due(self, service: Host, session: Session) -> list[str]:
        """What a client is sent that it has not asked for.

        Args:
            service: that it talks to.
            session: of the client.
        """
        ...

    def inventory(self, service: Host) -> dict[str, Any]:
        """What there is, as plain data.

        Args:
            service: that is asked.
        """
        ...
