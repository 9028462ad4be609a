"""Types shared by a service and its protocols: the identity of the device, and its clients."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Protocol

from ..arguments import part
from ..errors import Bound, ParameterError, Real
from .buttons import ButtonScript
from .commands import IDLE, Command, Joints
from .driven_arm import LARGEST_FORCE, Device
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
        plane: "xy" or "xz", plane of the cursor in which the two-link arm moves; an arm from a file
            moves along the axes of its world.
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
    largest_force: Annotated[Real, Bound(0.0, 1e3, "N", above=True)] = LARGEST_FORCE
    protocol: Literal["inverse", "rosbridge"] = "inverse"
    origins: Any = ()  # texts, checked below

    def __post_init__(self):
        object.__setattr__(self, "origins", origins_of(self.origins))
        for name in ("device_id", "grip_id"):
            if not ID.fullmatch(getattr(self, name)):
                bound = "must be 1 to 16 hexadecimal digits, as 04EA"
                raise ParameterError(name, getattr(self, name), bound)


PLAIN = Inverse3()


@dataclass
class Session:
    """A connected client."""

    number: int  # 1 for the first client, and so on
    command: Command = IDLE  # the newest
    heard: float = -math.inf  # [s] when the last command arrived
    log: ExchangeLog = field(default_factory=ExchangeLog)
    profile: str = ""  # name that the client gave itself
    memory: Any = None  # state that the protocol keeps


class Host(Protocol):
    """The service as a protocol sees it."""

    device: Device
    clock: str  # "tick" or "wall"
    inverse3: Inverse3

    @property
    def pressed(self) -> frozenset[str]:
        """Names of the buttons that are pressed."""
        ...

    def cursor(self, mode: str = "idle") -> Cursor:
        """The newest measurement, in the frame of the device."""
        ...

    @property
    def joints(self) -> Joints:
        """The joints, as newly measured."""
        ...

    def apply(self, session: Session, command: Command) -> None:
        """Applies a client's command."""

    def count(self, notice: str) -> None:
        """Counts what was dropped from a message."""


class WireProtocol(Protocol):
    """A protocol: reads messages from a client and writes messages to it."""

    name: str
    pushes: bool  # whether the service pushes states to clients

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
