"""A session in MuJoCo's viewer, with the mouse as the hand."""

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
from ..live.player import Player
from ..live.replay import Replay
from ..live.session import Session
from ..live.status import banner, status
from ..scene.experiments import SCENARIOS
from .viewer import Rows, Sight, Writing

SPACE, BACKSPACE, RIGHT, LEFT, DOWN, UP = 32, 259, 262, 263, 264, 265  # GLFW's numbers
EXPERIMENT_KEYS = {ord("1"): "constant", ord("2"): "variable", ord("3"): "free"}
KEY_FACTOR = 1.25  # on K or b, a keystroke
WRITE_TIME = 0.1  # [s] between two updates of the texts
POLL_TIME = 0.05  # [s] between two checks whether to continue
INSTEAD = "use --web for a browser, or hapticclay video for a film"
LIVE_KEYS = (
    ("Ctrl + right drag", "pull the handle"),
    ("space", "pause"),
    ("backspace", "restart"),
    ("up, down", "gain K"),
    ("left, right", "clay b, Fy"),
    ("1, 2, 3", "constant, variable, free"),
    ("R", "record on, off"),
    ("H", "this help"),
    ("drag, scroll", "camera"),
    ("Ctrl + Q", "close"),
)
BOTH = ("space", "backspace", "H", "drag, scroll", "Ctrl + Q")
REPLAY_KEYS = tuple(row for row in LIVE_KEYS if row[0] in BOTH)


class Window:
    """The window on a session or a record, until it is closed.

    The viewer draws in another process (see `viewer`) and requests the content for each picture.
    When requests stop, the window counts as closed.
    """

    def __init__(self, play: Session | Replay):
        """Prepares the window; call `show` to open it."""
        self.play, self.help = play, True  # whether the keys are listed
        self.other = False  # whether a key has chosen another scenario
        self.held: tuple[float, float] | None = None  # the handle when the mouse grabbed it [m]
        self._anew()

    def _anew(self) -> None:
        self.shown, self.written = 0, -math.inf  # frames sent, time of the last texts [s]

    def show(self, until: Callable[[], bool] | None = None) -> None:
        """Shows the window until it is closed; raises the error that ended the player, if any."""
        screens = (os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
        if sys.platform.startswith("linux") and not any(screens):
            raise ParameterError("display", "", f"no display: {INSTEAD}")
        self.other = True
        while self.other:
            self.other = False
            self._show(until)

    def _show(self, until: Callable[[], bool] | None) -> None:
        """Shows one scenario until the window is closed or a key chooses another."""
        player = Player(self.play)
        self._anew()
        with _viewer((self.play.scenario, self.play.tool)) as (answers, send):
            try:
                while not ((until and until()) or self.other or player.error):
                    try:
                        message = answers.get(timeout=POLL_TIME)
                    except queue.Empty:
                        continue
                    if message == 0 or (isinstance(message, int) and player.ident):
                        return  # closed, or lost
                    if not isinstance(message, tuple):
                        if player.ident:  # keep what was recorded
                            text = f"the window failed: {message}"
                            warnings.warn(text, RuntimeWarning, stacklevel=3)
                            return
                        why = "the window cannot be opened"
                        if isinstance(message, str):
                            why = message.strip().rpartition("\n")[2].partition(": ")[2]
                        display = os.environ.get("DISPLAY", "")
                        raise ParameterError("display", display, f"{why}: {INSTEAD}")
                    if not player.ident:
                        player.start()
                    with player.lock:
                        sight = self.look(*message)
                    send(sight)
            finally:
                if player.ident:
                    player.stop()

    def look(self, keys: list[int], hand: tuple[float, float] | None) -> Sight:
        """Handles keys and mouse and returns the content; the caller holds the player's lock."""
        for key in keys:
            self._key(key)
        play = self.play
        if isinstance(play, Session):
            play.pull(self._mouse(hand))
        target = play.point
        frames, anew = play.frames[max(self.shown - 1, 0) :], self.shown == 0
        self.shown = len(play.frames)
        writing, now = None, time.perf_counter()
        if now - self.written >= WRITE_TIME:
            self.written, writing = now, self._writing()
        return Sight(frames, anew, play.angles, target, writing)

    def _mouse(self, hand: tuple[float, float] | None) -> tuple[float, float] | None:
        """Target point of the hand [m] while the mouse drags."""
        if hand is None:
            self.held = None
            return None
        self.held = self.held or self.play.frames[-1].p
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
            x, y = play.gain
            scale = KEY_FACTOR if key in (UP, RIGHT) else 1.0 / KEY_FACTOR
            if key == ord("R"):
                play.recording = not play.recording
            elif key in (UP, DOWN, LEFT, RIGHT):
                with contextlib.suppress(ParameterError):  # at its bound a number stays as it is
                    if key in (UP, DOWN):
                        play.change(gain=(x * scale, y * scale))
                    else:
                        play.change(b=play.damping * scale)
            elif key in EXPERIMENT_KEYS:
                play.start(SCENARIOS[EXPERIMENT_KEYS[key]]())
                self.other = True

    def _writing(self) -> Writing:
        keys = LIVE_KEYS if isinstance(self.play, Session) else REPLAY_KEYS
        rows: Rows = tuple(status(self.play).items())
        return Writing(
            rows, keys if self.help else (), *banner(self.play, "press backspace to restart")
        )


@contextlib.contextmanager
def _viewer(first: Any) -> Iterator[tuple[queue.SimpleQueue, Callable[[Any], None]]]:
    """Starts the viewer's process; yields what it sends and a way to answer.

    It sends (keys, hand) for each picture, or the text of an error, and finally its exit status.
    """
    program = "mjpython" if sys.platform == "darwin" else sys.executable  # macOS needs a launcher
    process = subprocess.Popen(
        [program, "-P", "-c", f"from {__package__}.viewer import run_viewer; run_viewer()"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    source, sink = process.stdout, process.stdin
    assert source and sink
    answers: queue.SimpleQueue = queue.SimpleQueue()

    def listen() -> None:
        incomplete = EOFError, OSError, pickle.UnpicklingError
        with contextlib.suppress(*incomplete):
            while True:
                answers.put(pickle.load(source))
        answers.put(process.wait())

    def send(message: Any) -> None:
        with contextlib.suppress(OSError):  # it has ended, as `answers` shows
            pickle.dump(message, sink)
            sink.flush()

    listener = threading.Thread(target=listen, name="listener", daemon=True)
    listener.start()
    try:
        send(first)
        yield answers, send
    finally:
        process.kill()
        process.wait()
        listener.join()
        source.close()
        with contextlib.suppress(OSError):
            sink.close()
