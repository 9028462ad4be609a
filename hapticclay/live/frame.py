"""The state of a session in a frame, who listens to it, and what sets its pace."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from .clock import FRAME_TIME


class Listener(Protocol):
    """Receives each slice of a session or a replay, as a `UdpStream` does."""

    def send(self, play: Any) -> None:
        """Receives a slice."""


class Partner:
    """Sets the pace of slices; a device coupled to a session exchanges its samples here."""

    def __init__(self, span: float = FRAME_TIME):
        """Takes the real time between two slices [s]."""
        self.span = span

    def exchange(self) -> None:
        """Talks to the device, may wait for it; other threads may use the session meanwhile."""

    def before_slice(self, play: Any) -> None:
        """Passes the state of the device to the session."""

    def after_slice(self, play: Any) -> None:
        """Stores the state of the session for the device."""


class Frame(NamedTuple):
    """State at the end of a slice, for live plots: x and y of each quantity."""

    t: float  # [s]
    p: tuple[float, float]  # position of the handle [m]
    v: tuple[float, float]  # velocity of the handle [m/s]
    fe: tuple[float, float]  # force of the clay [N]
    fh: tuple[float, float]  # force of the hand [N]
    held: tuple[bool, bool] = (False, False)  # whether yielding clay holds the handle
