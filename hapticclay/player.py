"""Plays in real time, beside whatever is shown: a session that a person takes part in, or a record."""

from __future__ import annotations

import threading
import time

import numpy as np

from .record import Record
from .removal import TOOL, Tool
from .session import FRAME, Clock, Session


class Replay:
    """A record, played as the session it may have been; the attributes are those of Session."""

    def __init__(self, record: Record, tool: Tool = TOOL):
        self.source, self.scenario = record, record.scenario
        self.tool = Tool(**record.notes["tool"]) if "tool" in record.notes else tool
        self.restart()

    def restart(self) -> None:
        """Plays from the beginning."""
        self.paused, self.clock, self.t, self.n = False, Clock(), 0.0, 0
        self.frames: list[tuple] = [self._frame(0)]

    @property
    def ended(self) -> str:
        """How the record ended, once it has."""
        return self.source.status if self.n >= len(self.source.t) - 1 else ""

    def advance(self, seconds: float) -> np.ndarray:
        """Goes on by so much simulated time, but not while paused."""
        if self.paused or self.ended:
            return np.empty((0, 2))
        self.t += seconds
        before = self.n
        self.n = int(np.searchsorted(self.source.t, self.t, "right").clip(1, len(self.source.t))) - 1
        self.frames.append(self._frame(self.n))
        return self.source.p[before : self.n + 1]

    def _frame(self, n: int) -> tuple:
        r = self.source
        return (float(r.t[n]), *(tuple(x[n].tolist()) for x in (r.p, r.v, r.fe, r.fh)))


class Player(threading.Thread):
    """Plays until `stop`. Whoever reads or changes what is played holds the lock.

    Attributes:
        error: what went wrong, None if nothing did.
    """

    def __init__(self, play: Session | Replay):
        super().__init__(name="player", daemon=True)
        self.play, self.lock = play, threading.RLock()  # what changes a page is told of the change at once
        self.error: Exception | None = None
        self._stop_now = threading.Event()

    def run(self) -> None:
        at = time.perf_counter()
        try:
            while not self._stop_now.is_set():
                with self.lock:
                    play = self.play
                    if play.paused or play.ended:
                        play.clock.rest()
                    else:
                        play.advance(play.clock.due(time.perf_counter()))
                at = max(at + FRAME, time.perf_counter())
                self._stop_now.wait(max(at - time.perf_counter(), 0.0005))
        except Exception as error:  # shown by whoever joins
            self.error = error

    def stop(self) -> None:
        """Ends the thread; raises what it died of, if it did."""
        self._stop_now.set()
        self.join()
        if self.error is not None:
            raise self.error
