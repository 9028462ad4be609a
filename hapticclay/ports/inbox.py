"""The newest frame of a device, whether it answers each message or streams on its own."""

from __future__ import annotations

import threading
import time
from typing import Any, NamedTuple

from . import inverse


class Arrival(NamedTuple):
    """A frame that a device sent."""

    frame: inverse.Frame
    received: float  # [s] on the computer's clock


class Inbox:
    """Reads a connection in a thread of its own and keeps only the newest frame.

    Frames that are not taken do not queue up, in memory or in the connection, so the one that is
    taken is as new as the device allows. `skipped` counts the others, with those that did not hold
    the device; `ended` is why the connection ended, "" while it is open.
    """

    def __init__(self, socket: Any, broken: tuple[type[BaseException], ...]):
        self.skipped, self.ended = 0, ""
        self._socket, self._broken = socket, broken
        self._changed = threading.Condition()
        self._newest: Arrival | None = None
        self._arrived = 0  # frames so far
        self._owed = 0  # answers to earlier messages that have not come
        self._mark = 0  # frames that had come when the newest message was sent
        self._thread = threading.Thread(target=self._read, name="device frames", daemon=True)
        self._thread.start()

    def sending(self) -> None:
        """Forgets frames that came before the message that is about to be sent."""
        with self._changed:
            self._owed = max(0, self._owed - (self._arrived - self._mark))
            self._mark = self._arrived
            self._take()

    def answer(self, patience: float) -> Arrival | None:
        """The newest frame, once the device has answered the message.

        Answers hold nothing that relates them to messages. So answers that are owed to earlier
        messages are awaited as well, or each later one would be taken for the one before it. They
        are given up if they do not come within this wait.
        """
        end = time.perf_counter() + patience
        with self._changed:
            wanted = self._owed + 1
            while not self.ended and self._arrived - self._mark < wanted:
                if not self._changed.wait(max(0.0, end - time.perf_counter())):
                    break
            arrived, self._mark = self._arrived - self._mark, self._arrived
            self._owed = 0 if arrived else wanted
            found = self._take()
            self.skipped -= found is not None
            return found

    def join(self, timeout: float) -> None:
        """Waits for the end of the thread, after the connection was closed."""
        self._thread.join(timeout)

    def _take(self) -> Arrival | None:
        found, self._newest = self._newest, None
        return found

    def _read(self) -> None:
        ended = "the connection was closed"
        try:
            for data in self._socket:
                frame, now = inverse.read_frame(data), time.perf_counter()
                with self._changed:
                    self._arrived += 1
                    self.skipped += 1  # until it is taken
                    if frame is not None:
                        self._newest = Arrival(frame, now)
                    self._changed.notify_all()
        except self._broken as error:
            ended = str(error) or type(error).__name__
        with self._changed:
            self.ended = ended
            self._changed.notify_all()
