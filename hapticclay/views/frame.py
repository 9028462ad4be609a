"""The state of a session in a frame, and who listens to it."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol


class Listener(Protocol):
    """Takes each slice of a session or a replay, as a `UdpStream` does."""

    def send(self, play: Any) -> None:
        """Takes a slice.

        Args:
            play: the session or replay that has played it.
        """


class Partner(Protocol):
    """A device beside a session, whose slices follow its samples.

    Attributes:
        span: real time between two slices [s].
    """

    span: float

    def exchange(self) -> None:
        """Talks to the device, and may wait for it; other threads may use the session meanwhile."""

    def lead(self, play: Any) -> None:
        """Tells the session what the device did, before a slice.

        Args:
            play: the session.
        """

    def follow(self, play: Any) -> None:
        """Takes what the device is to be told, after a slice.

        Args:
            play: the session.
        """


class Frame(NamedTuple):
    """State at the end of a slice, for plots that run along.

    Attributes:
        t: time [s].
        p: position of the handle [m], (2,).
        v: velocity of the handle [m/s], (2,).
        fe: force of the clay [N], (2,).
        fh: force of the hand [N], (2,).
        held: whether clay that yields holds the handle still, along x and along y.
    """

    t: float
    p: tuple[float, float]
    v: tuple[float, float]
    fe: tuple[float, float]
    fh: tuple[float, float]
    held: tuple[bool, bool] = (False, False)
