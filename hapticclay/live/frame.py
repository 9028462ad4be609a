"""The state of a session in a frame, and its listeners."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol


class Listener(Protocol):
    """Receives each slice of a session or a replay, as a `UdpStream` does."""

    def send(self, play: Any) -> None:
        """Receives a slice."""


class Partner(Protocol):
    """A device coupled to a session, whose slices follow its samples.

    Attributes:
        span: real time between two slices [s].
    """

    span: float

    def exchange(self) -> None:
        """Talks to the device, may wait for it; other threads may use the session meanwhile."""

    def lead(self, play: Any) -> None:
        """Passes the state of the device to the session before a slice."""

    def follow(self, play: Any) -> None:
        """Stores the state for the device after a slice."""


class Frame(NamedTuple):
    """State at the end of a slice, for live plots.

    Attributes:
        t: time [s].
        p: position of the handle [m], (2,).
        v: velocity of the handle [m/s], (2,).
        fe: force of the clay [N], (2,).
        fh: force of the hand [N], (2,).
        held: whether yielding clay holds the handle, along x and along y.
    """

    t: float
    p: tuple[float, float]
    v: tuple[float, float]
    fe: tuple[float, float]
    fh: tuple[float, float]
    held: tuple[bool, bool] = (False, False)
