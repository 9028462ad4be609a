"""The thread that plays a session."""

from __future__ import annotations

import threading
import time

from .frame import Partner
from .replay import Replay
from .session import Session


class Player(threading.Thread):
    """A thread that advances a session or a replay in real time.

    Other threads hold `lock` while they read or change the session; `error` is what ended the
    thread, or None.
    """

    def __init__(self, play: Session | Replay):
        """Prepares the thread; call `start` to play."""
        super().__init__(name="player", daemon=True)
        self.play = play
        self.lock = threading.RLock()  # a change of the page's controls calls back immediately
        self.error: Exception | None = None
        self._stop_now = threading.Event()

    def run(self) -> None:
        """Plays until `stop`."""
        at = time.perf_counter()
        try:
            while not self._stop_now.is_set():
                partner = self.play.partner
                partner.exchange()
                with self.lock:
                    self._slice(partner)
                at = max(at + partner.span, time.perf_counter())
                self._stop_now.wait(max(at - time.perf_counter(), 0.0005))
        except Exception as error:  # raised again by stop()
            self.error = error

    def _slice(self, partner: Partner) -> None:
        """Advances to the time that is due."""
        play = self.play
        if play.paused or play.ended:
            play.clock.rest()
            return
        partner.before_slice(play)
        play.advance(play.clock.due(time.perf_counter()))
        partner.after_slice(play)
        if play.stream is not None:
            play.stream.send(play)

    def stop(self) -> None:
        """Ends the thread; raises the error that ended it before, if any."""
        self._stop_now.set()
        self.join()
        if self.error is not None:
            raise self.error
