"""Streams a running session as JSON over UDP, in the format of PlotJuggler."""

from __future__ import annotations

import contextlib
import json
import math
import socket
from typing import TYPE_CHECKING, Any

from ..errors import ParameterError
from ..model.constants import AXES
from .clock import FRAME_TIME

if TYPE_CHECKING:
    from .frame import Frame
    from .replay import Replay
    from .session import Session

ADDRESS_FORM = "must be HOST:PORT, as in localhost:9870"


class UdpStream:
    """Sends the present state of a session, one datagram per call, without waiting.

    A datagram is one JSON object: timestamp [s], which continues over restarts; t, the time of the
    session [s]; p [m], v [m/s], fh, fe [N], b [N.s/m] and gain [1/kg], each with x and y; held, 1
    where yielding clay holds the handle; target [m] while the hand pulls. null replaces a number
    that is not finite. Datagrams without a receiver are lost. An address is HOST:PORT or
    [HOST]:PORT.
    """

    def __init__(self, address: str):
        host, _, port = address.rpartition(":")
        if not host or not port.isdecimal() or not 0 < int(port) < 65536:
            raise ParameterError("stream", address, ADDRESS_FORM)
        try:  # once, because a name server may be slow
            found = socket.getaddrinfo(host.strip("[]"), int(port), type=socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ParameterError("stream", address, f"must name a host ({reason})") from None
        family, kind, protocol, _, self._to = found[0]
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)
        self._before, self._last = 0.0, -FRAME_TIME  # time up to a restart; of this run [s]
        self._frames: list[Frame] = []

    def send(self, play: Session | Replay) -> None:
        """Sends the last frame if it is new; drops it if the system would block."""
        frame = play.frames[-1]
        if play.frames is not self._frames:  # it started or restarted
            self._frames, self._before = play.frames, self._before + self._last + FRAME_TIME
        elif frame.t == self._last:
            return
        self._last = frame.t
        values: dict[str, Any] = {"timestamp": self._before + frame.t, "t": frame.t}
        for name in ("p", "v", "fh", "fe"):
            values[name] = _by_axis(getattr(frame, name))
        values |= {"b": _by_axis(play.b), "gain": _by_axis(play.gain)}
        values["held"] = dict(zip(AXES, map(int, frame.held), strict=True))
        if play.point is not None:
            values["target"] = _by_axis(play.point)
        with contextlib.suppress(OSError):  # a full buffer, a network that is down
            self._socket.sendto(json.dumps(values).encode(), self._to)

    def close(self) -> None:
        self._socket.close()


def _by_axis(pair: tuple[float, float]) -> dict[str, float | None]:
    return {a: x if math.isfinite(x) else None for a, x in zip(AXES, pair, strict=True)}
