"""A session in MuJoCo's own viewer: the mouse is the hand."""

from __future__ import annotations

import contextlib
import math
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

from ..errors import ParameterError
from ..model.experiments import SCENARIOS
from .session import Player, Replay, Session
from .stage import hardest
from .viewer import Rows, Sight, Writing

SPACE, BACKSPACE, RIGHT, LEFT, DOWN, UP = 32, 259, 262, 263, 264, 265  # GLFW's numbers
NAMES = {ord("1"): "constant", ord("2"): "variable", ord("3"): "free"}
FACTOR = 1.25  # by which a key changes K or b
WRITE_EVERY = 0.1  # [s]
WAIT = 0.05  # for the window, between two looks at whether to go on [s]
INSTEAD = "use --web for a browser, or hapticclay video for a film"
LIVE = (
    ("Ctrl + right drag", "pull the handle"),
    ("space", "pause"),
    ("backspace", "start anew"),
    ("up, down", "gain K"),
    ("left, right", "clay b"),
    ("1, 2, 3", "constant, variable, free"),
    ("R", "record on, off"),
    ("H", "this help"),
    ("drag, scroll", "camera"),
    ("Ctrl + Q", "close"),
)
REPLAY = tuple(
    row for row in LIVE if row[0] in ("space", "backspace", "H", "drag, scroll", "Ctrl + Q")
)


class Window:
    """The window on a session or a record, until it is closed.

    The viewer draws in another process (see `pane`) and asks, once a picture, what there is to see; when nothing asks
    any more the window is closed, however that came about.
    """

    def __init__(self, play: Session | Replay):
        self.play, self.help, self.other = (
            play,
            True,
            False,
        )  # other: another scenario is to be shown
        self.held: tuple[float, float] | None = (
            None  # where the handle was when the mouse took hold [m]
        )
        self._anew()

    def _anew(self) -> None:
        self.shown, self.written = (
            0,
            -math.inf,
        )  # frames that have been sent; when words last were [s]

    def show(self, until: Callable[[], bool] = lambda: False) -> None:
        """Shows it; returns when the window is closed, or this says so. Raises what the player died of, if it did.

        Raises:
            ParameterError: there is no display, or no OpenGL.
        """
        if sys.platform.startswith("linux") and not (
            os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        ):
            raise ParameterError("display", "", f"there is none: {INSTEAD}")
        self.other = True
        while self.other:
            self.other = False
            self._show(until)

    def _show(self, until: Callable[[], bool]) -> None:
        """Shows one scenario, until the window is closed, or another scenario is to be shown in another."""
        player = Player(self.play)
        self._anew()
        with _viewer((self.play.scenario, self.play.tool)) as (heard, say):
            try:
                while not (until() or self.other or player.error):
                    try:
                        words = heard.get(timeout=WAIT)
                    except queue.Empty:
                        continue
                    if words == 0 or (isinstance(words, int) and player.ident):
                        return  # closed, or lost
                    if not isinstance(words, tuple):
                        if player.ident:  # what was recorded is not to be lost by it
                            warnings.warn(
                                f"the window failed: {words}", RuntimeWarning, stacklevel=3
                            )
                            return
                        why = "the window cannot be opened"
                        if isinstance(words, str):
                            why = words.strip().rpartition("\n")[2].partition(": ")[2]
                        raise ParameterError(
                            "display", os.environ.get("DISPLAY", ""), f"{why}: {INSTEAD}"
                        )
                    if not player.ident:
                        player.start()
                    with player.lock:
                        sight = self.look(*words)
                    say(sight)
            finally:
                if player.ident:
                    player.stop()

    def look(self, keys: list[int], hand: tuple[float, float] | None) -> Sight:
        """Does what keys and mouse have said, while the player waits; returns what there is to see."""
        for key in keys:
            self._key(key)
        play, target = self.play, None
        if isinstance(play, Session):
            play.pull(self._mouse(hand))
            target = play.point
        frames, anew = play.frames[max(self.shown - 1, 0) :], self.shown == 0
        self.shown = len(play.frames)
        angles = (
            list(play.run.angles) if isinstance(play, Session) else play.source.q[play.n].tolist()
        )
        writing, now = None, time.perf_counter()
        if now - self.written >= WRITE_EVERY:
            self.written, writing = now, self._writing()
        return Sight(frames, anew, angles, target, writing)

    def _mouse(self, hand: tuple[float, float] | None) -> tuple[float, float] | None:
        """Where the hand pulls to [m], while the mouse drags."""
        if hand is None:
            self.held = None
            return None
        self.held = self.held or self.play.frames[-1][1]
        return self.held[0] + hand[0], self.held[1] + hand[1]

    def _key(self, key: int) -> None:
        play = self.play
        if key == SPACE:
            play.paused = not play.paused
        elif key == BACKSPACE:
            play.restart()
            self._anew()
        elif key == ord("H"):
            self.help = not self.help
        elif isinstance(play, Session):
            s = play.scenario
            if key == ord("R"):
                play.recording = not play.recording
            elif key in (UP, DOWN):
                scale = FACTOR if key == UP else 1.0 / FACTOR
                play.change(gain=(s.gain[0] * scale, s.gain[1] * scale))
            elif key in (LEFT, RIGHT):
                play.change(b=play.damping * (FACTOR if key == RIGHT else 1.0 / FACTOR))
            elif key in NAMES:
                play.start(SCENARIOS[NAMES[key]]())
                self.other = True

    def _writing(self) -> Writing:
        play = self.play
        t, fh = play.frames[-1][0], play.frames[-1][4]
        state = "paused" if play.paused else "ended" if play.ended else "replaying"
        if isinstance(play, Session) and not (play.paused or play.ended):
            state = "recording" if play.recording else "not recording"
        rows: Rows = (
            (
                "time",
                f"{t:.1f} s, {play.clock.factor:.2f} x real{', machine too slow' if play.clock.slow else ''}",
            ),
            ("state", state),
            ("K", "{:.3g}, {:.3g}".format(*play.gain)),
            ("b", "{:.4g}, {:.4g} N.s/m here; clay {:.4g}".format(*play.b, hardest(play.scenario))),
            ("fh", f"{math.hypot(*fh):.2f} N"),
        )
        keys, verdict = LIVE if isinstance(play, Session) else REPLAY, play.verdict()
        text = f"{play.ended}; backspace starts anew" if play.ended else verdict.text
        return Writing(rows, keys if self.help else (), text, verdict.unstable)


@contextlib.contextmanager
def _viewer(first: Any) -> Iterator[tuple[queue.SimpleQueue, Callable[[Any], None]]]:
    """The viewer's process, and what it says: (keys, hand); what went wrong; at last its exit status."""
    program = (
        "mjpython" if sys.platform == "darwin" else sys.executable
    )  # there the viewer needs its launcher
    process = subprocess.Popen(
        [program, "-P", "-c", f"from {__package__}.viewer import main; main()"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    source, sink = process.stdout, process.stdin
    assert source and sink
    heard: queue.SimpleQueue = queue.SimpleQueue()

    def listen() -> None:
        with contextlib.suppress(
            EOFError, OSError, pickle.UnpicklingError
        ):  # cut short in the midst of a word
            while True:
                heard.put(pickle.load(source))
        heard.put(process.wait())

    def say(words: Any) -> None:
        with contextlib.suppress(OSError):  # it is gone, and `heard` says so
            pickle.dump(words, sink)
            sink.flush()

    listener = threading.Thread(target=listen, name="listener", daemon=True)
    listener.start()
    try:
        say(first)
        yield heard, say
    finally:
        process.kill()
        process.wait()
        listener.join()
        source.close()
        with contextlib.suppress(OSError):
            sink.close()
