"""Plays in real time, beside whatever is shown: a session that a person takes part in, or a record."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Iterator

import numpy as np

from ..simulation.record import Record
from ..studies.removal import TOOL, Tool
from .session import FRAME, Clock, Session
from .verdict import Verdict, limits, verdict


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

    @property
    def gain(self) -> tuple[float, float]:
        """K now."""
        x, y = self.source.extra["gain"][self.n].tolist() if "gain" in self.source.extra else self.scenario.gain
        return x, y

    @property
    def b(self) -> tuple[float, float]:
        """Damping of the clay where the handle is [N.s/m]."""
        x, y = self.source.b[self.n].tolist()
        return x, y

    def verdict(self) -> Verdict:
        """As of a session; what the monitor found is the outcome of the record."""
        r, n, s = self.source, self.n, self.scenario
        found = r.outcome.code in ("diverged", "limit cycle") and r.t[n] >= r.outcome.time
        limit = limits(self.b, s.operator) if s.control == "continuous" else None
        return verdict(self.gain, limit, r.outcome if found else None, True)

    def _frame(self, n: int) -> tuple:
        r = self.source
        return (float(r.t[n]), *(tuple(x[n].tolist()) for x in (r.p, r.v, r.fe, r.fh)))


@contextlib.contextmanager
def stoppable() -> Iterator[threading.Event]:
    """An event that Ctrl-C sets, in place of an exception in the midst of anything; a second Ctrl-C is one."""
    stop, before = threading.Event(), signal.getsignal(signal.SIGINT)

    def heard(*_) -> None:
        stop.set()
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, heard)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


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
