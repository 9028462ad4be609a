"""The window under a real X server: a mouse drags, keys are pressed, the record tells."""

import contextlib
import ctypes
import json
import math
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.live.clock import FRAME_TIME
from hapticclay.live.replay import Replay
from hapticclay.live.session import Session
from hapticclay.views import window
from hapticclay.views.viewer import Pane
from tests.hunt import HUNTS
from tests.waiting import PATIENCE, until

missing = [tool for tool in ("Xvfb", "xdotool") if not shutil.which(tool)]
pytestmark = pytest.mark.skipif(
    bool(missing), reason=f"needs {' and '.join(missing)} (apt-get install xvfb xdotool)"
)


@contextlib.contextmanager
def x_server(*args):
    """A screen of its own; its name."""
    reading, writing = os.pipe()
    x = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writing), "-screen", "0", "320x240x24", "-noreset", *args],
        pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(writing)
    with os.fdopen(reading) as f:
        number = f.readline().strip()
    yield f":{number}"
    x.terminate()
    x.wait()


@pytest.fixture(scope="module")
def screen():
    """The environment of a screen of its own."""
    with x_server() as name:
        yield {**os.environ, "DISPLAY": name}


# `python -m hapticclay`, which also tells a file what each picture was made of
TOLD = """
import json, os, runpy
from hapticclay.views.window import Window

look, seen = Window.look, {"pictures": 0}

def told(self, keys, hand):
    sight, play = look(self, keys, hand), self.play
    if seen.get("name") != play.scenario.name:
        seen["pictures"] = 0  # of this scenario
    seen.update(
        pictures=seen["pictures"] + 1, x=play.frames[-1][1][0], held=hand is not None,
        frames=play.clock.frames, name=play.scenario.name, help=self.help, gain=play.gain[0],
        b=play.scenario.clay.x.values[1] if play.scenario.clay else 0.0,
    )
    with open(os.environ["TOLD"] + "~", "w") as f:
        json.dump(seen, f)
    os.replace(f.name, os.environ["TOLD"])
    return sight

Window.look = told
runpy.run_module("hapticclay", run_name="__main__", alter_sys=True)
"""


class Mouse:
    """A person at the window of one command, who waits for what is to be seen, not for a time."""

    def __init__(self, screen, folder, *args):
        self.screen, self.told = screen, folder.with_name(folder.name + ".told")
        self.program = subprocess.Popen(
            [sys.executable, "-W", "error", "-X", "faulthandler", "-c", TOLD, *args],
            cwd=folder,
            env={**screen, "TOLD": str(self.told)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        words = ["xdotool", "search", "--name", "MuJoCo"]

        def windows():
            return subprocess.run(words, env=screen, capture_output=True, text=True).stdout.split()

        until(lambda: windows() or self.program.poll() is not None)
        if not (shown := windows()):
            pytest.fail(f"no window: {self.program.communicate()}")
        self.window = shown[0]
        self.until(lambda now: now["pictures"] >= 5)

    def seen(self):
        """What the last picture was made of."""
        return json.loads(self.told.read_text()) if self.told.exists() else {"pictures": 0}

    def until(self, condition):
        """Wait for a picture of which this is true; fail if none comes."""
        until(lambda: condition(self.seen()), alive=lambda: self.program.poll() is None)

    def pictures(self, n):
        """Wait for n more pictures."""
        before = self.seen()["pictures"]
        self.until(lambda now: now["pictures"] >= before + n)

    def do(self, *words):
        subprocess.run(["xdotool", *map(str, words)], env=self.screen, check=True)

    def drag(self, pixels, moves=5, pictures=1):
        """Pull to the right in some moves, each seen for so many pictures."""
        self.do("mousemove", 160, 120, "keydown", "ctrl", "mousedown", 3)
        self.pictures(5)
        for _ in range(moves):
            self.do("mousemove_relative", "--", pixels // moves, 0)
            self.pictures(pictures)

    def end(self, how):
        """Closes the window and returns exit status and output."""
        if how == "Ctrl-Q":
            self.do("keydown", "ctrl", "key", "q", "keyup", "ctrl")
        elif how == "Ctrl-C":
            self.program.send_signal(signal.SIGINT)
        elif how == "message":
            ask_to_close(int(self.window), self.screen["DISPLAY"])
        else:
            self.do({"destroyed": "windowclose", "disconnected": "windowkill"}[how], self.window)
        try:
            out, err = self.program.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.program.send_signal(signal.SIGABRT)  # so that it says where it stands
            pytest.fail(f"{how}: still running: {self.program.communicate()}")
        return self.program.returncode, out, err

    def close(self):
        """Lets go and quits; exit status, output."""
        self.do("mouseup", 3, "keyup", "ctrl")
        self.pictures(3)
        return self.end("Ctrl-Q")


def ask_to_close(window, display):
    """Sends WM_DELETE_WINDOW, as a click on the window's cross does (ICCCM 4.2.8.1)."""

    class Message(ctypes.Structure):
        _fields_ = [
            ("type", ctypes.c_int),
            ("serial", ctypes.c_ulong),
            ("sent", ctypes.c_int),
            ("display", ctypes.c_void_p),
            ("window", ctypes.c_ulong),
            ("message", ctypes.c_ulong),
            ("format", ctypes.c_int),
            ("data", ctypes.c_long * 5),
            ("rest", ctypes.c_long * 12),
        ]

    x = ctypes.CDLL("libX11.so.6")
    x.XOpenDisplay.restype, x.XInternAtom.restype = ctypes.c_void_p, ctypes.c_ulong
    display = ctypes.c_void_p(x.XOpenDisplay(display.encode()))
    kind, data = (
        x.XInternAtom(display, name, 0) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW")
    )
    message = Message(33, 0, 1, display, window, kind, 32, (ctypes.c_long * 5)(data))
    x.XSendEvent(display, ctypes.c_ulong(window), 0, 0, ctypes.byref(message))
    x.XCloseDisplay(display)


CLOSINGS = ["message", "destroyed", "disconnected", "Ctrl-C"]


@pytest.mark.parametrize("how", CLOSINGS if HUNTS else CLOSINGS[2:])  # a replay's is the first
def test_closing_while_clay_is_cut_ends_it_and_the_record_is_there(screen, tmp_path, how):
    """The window closes while the button is down: 60 N/m lags by 30 s in clay of 2000 N.s/m.

    So the handle is still in the clay however late a busy machine closes the window.
    """
    mouse = Mouse(
        screen, tmp_path, "view", "--b", "2000", "--dt", "1e-3", "--out", "o", "--no-plots"
    )
    try:
        mouse.drag(100)
        mouse.until(lambda now: now["x"] > 0.055)
        code, out, err = mouse.end(how)
    finally:
        mouse.do("mouseup", 3, "keyup", "ctrl")
    assert (code, err) == (0, ""), out
    record = hc.Record.load(tmp_path / "o")
    assert record.b[-1, 0] == 2000.0 and record.v[-1, 0] > 5e-4
    assert record.extra["removed"][-1] > 5e-7
    assert record.outcome.code == "finished"


ENDS = ["message", "destroyed", "Ctrl-Q", "Ctrl-C"]


@pytest.mark.parametrize("how", ENDS if HUNTS else ENDS[:1])  # the others end a session above
def test_closing_a_replay_before_its_end_ends_it(screen, tmp_path, how):
    """It begins in the clay, so that clay is cut from the first picture on."""
    hc.simulate(hc.constant_cut(clay=(-0.05, 0.15)), every=10).save(tmp_path / "r")
    assert Mouse(screen, tmp_path, "view", "r").end(how) == (0, "", "")
    assert os.listdir(tmp_path) == ["r"]


def test_mouse_cuts_through_the_clay(screen, tmp_path):
    mouse = Mouse(screen, tmp_path, "view", "--out", "o")
    mouse.drag(96, 6)
    mouse.until(lambda now: now["x"] > 0.17 and now["frames"] > 50)
    code, out, err = mouse.close()
    assert (code, err) == (0, ""), (out, err)
    record = hc.Record.load(tmp_path / "o")
    x = record.p[:, 0]
    assert x.max() > 0.17, out
    inside = (record.b[:, 0] > 0.0) & (np.abs(record.v[:, 0]) > 1e-3)
    np.testing.assert_allclose(record.ratio(record.fe)[inside, 0], 90.0, rtol=0.01)
    way = np.linalg.norm(np.diff(record.p, axis=0), axis=1)[record.b[1:, 0] > 0.0].sum()
    # a hand that turns back cuts less than its way, but none less than the 0.1 m of the clay
    assert 0.99 * 0.10 < record.extra["removed"][-1] / (0.02 * 0.01) < 1.01 * way
    assert sorted(os.listdir(tmp_path)) == ["o"]  # no MUJOCO_LOG.TXT
    assert sorted(os.listdir(tmp_path / "o")) == [
        "force.png",
        "record.npz",
        "scenario.toml",
        "summary.json",
        "velocity.png",
    ]
    assert sum(record.notes["late_ms"]["frames"]) == record.notes["frames"] > 50


def test_keys_change_what_runs_and_switch_the_scenario(screen, tmp_path):
    mouse = Mouse(screen, tmp_path, "view", "free", "--out", "o", "--no-plots")
    mouse.do("key", "1")
    mouse.until(lambda now: now["name"] == "constant" and now["pictures"] >= 5)
    for key, what in (("Up", "gain"), ("Right", "b"), ("Right", "b"), ("h", "help")):
        before = mouse.seen()[what]
        mouse.do("key", key)
        mouse.until(lambda now, what=what, before=before: now[what] != before)
    code, out, err = mouse.close()
    assert (code, err) == (0, ""), (out, err)
    record = hc.Record.load(tmp_path / "o")
    assert record.scenario.name == "constant"
    assert record.scenario.gain == pytest.approx((1.25, 0.625))
    assert record.scenario.clay.x.values[1] == pytest.approx(90.0 * 1.25**2)


def test_every_key_of_the_page_does_what_it_says():
    from hapticclay.views.window import BACKSPACE, DOWN, LEFT, RIGHT, SPACE, UP, Window

    page = (Path(__file__).parents[2] / "docs" / "view.md").read_text()
    named = [
        k
        for row in re.findall(r"^\| (?!key|---)(.+?) \|.*\|$", page, re.M)
        for k in row.split(", ")
    ]
    assert named == ["space", "backspace", "up", "down", "left", "right", "1", "2", "3", "R", "H"]
    session = Session(hc.constant_cut(), stiffness=10.0)
    window = Window(session)
    press = window._key
    press(SPACE)
    assert session.paused and not len(session.advance(FRAME_TIME))
    press(SPACE)
    session.pull((0.1, 0.0))
    while session.t < 3.0:
        session.advance(FRAME_TIME)
    pane = Pane(session.scenario, session.tool)
    pane.take(window.look([], None))
    assert pane.stage.removal.volume > 1e-6
    keys, gains = (UP, RIGHT, RIGHT, DOWN, LEFT), (1.25, 1.25, 1.25, 1.0, 1.0)
    for key, gain, b in zip(keys, gains, (90.0, 112.5, 140.625, 140.625, 112.5), strict=True):
        press(key)
        assert session.scenario.gain == pytest.approx((gain, 0.5 * gain)) and session.b[
            0
        ] == pytest.approx(b)
    press(ord("R"))
    assert not session.recording
    press(BACKSPACE)
    pane.take(window.look([], None))
    assert (session.t, session.recorded, session.recording, pane.stage.removal.volume) == (
        0.0,
        False,
        False,
        0.0,
    )
    assert session.scenario.clay.x.values[1] == pytest.approx(112.5)  # as it was set
    press(ord("R"))
    press(ord("H"))
    assert session.recording and not window.help
    for key, name in zip("123", ("constant", "variable", "free"), strict=True):
        window.other = False
        press(ord(key))
        assert (session.scenario.name, window.other, session.t) == (name, True, 0.0)


def engine_snaps(low, high):
    """Limits of y by mjr_figure: the next multiples of the range's power of ten, in floats."""
    low, high = np.float32(low), np.float32(high)
    power = np.float32(10.0) ** np.floor(np.log10(high - low))
    return float(np.floor(low / power) * power), float(np.ceil(high / power) * power)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("scale", [1e-3, 0.01, 1.0, 30.0, 1e4])
def test_axes_hold_the_data_and_have_round_ticks(axis, scale):
    """Ticks at 1, 2 or 5 times a power of ten; no data farther outside than a line is thick."""
    from hapticclay.views.viewer import _snapped, _wide

    rng = np.random.default_rng(1)
    for a, b in rng.normal(size=(300, 2)) * scale:
        for low, high in ((min(a, b), max(a, b)), (0.0, abs(a)), (-1e-6 * abs(a), abs(b))):
            first, last, lines = (_wide if axis == "x" else _snapped)(low, high, 1e-3 * scale)
            if axis == "y":
                first, last = engine_snaps(first, last)
            step = (last - first) / (lines - 1)
            assert 3 <= lines <= 8
            mantissa = step / 10.0 ** math.floor(math.log10(step * (1.0 + 1e-5)))
            assert min(abs(mantissa - m) for m in (1.0, 2.0, 5.0, 10.0)) < 1e-4, (low, high, step)
            assert abs(first / step - round(first / step)) < 1e-3
            assert low > first - 0.02 * (last - first) and high < last + 0.02 * (last - first)
            assert last - first < 10.0 * max(high - low, 1e-3 * scale)


def picture(play):
    """What the viewer's process makes of it."""
    from hapticclay.views.window import Window

    pane = Pane(play.scenario, play.tool)
    pane.take(Window(play).look([], None))
    return pane


def test_both_axes_are_drawn_where_both_are_cut():
    """The curves hold the record to the width of a line, 1/160 of the range."""
    record = hc.simulate(hc.variable_cut(), every=10)
    replay = Replay(record)
    while not replay.ended:
        replay.advance(FRAME_TIME)
    velocity = picture(replay).plots[0]
    assert velocity.figure.title == "velocity [cm/s]: x blue, y red"
    for i in (0, 1):
        n = velocity.figure.linepnt[i]
        x, v = velocity.figure.linedata[i, : 2 * n].reshape(-1, 2).T
        assert n > 50 and x.max() == pytest.approx(100 * record.p[:, i].max(), abs=0.1)
        np.testing.assert_allclose(
            v, np.interp(x, 100 * record.p[:, i], 100 * record.v[:, i]), atol=1e-4
        )
    one = picture(Replay(hc.simulate(hc.constant_cut(t_max=0.1))))
    assert [len(plot.curves) for plot in one.plots] == [1, 1, 2]


def test_a_replay_offers_the_keys_that_act_on_it():
    from hapticclay.views.window import LIVE_KEYS, REPLAY_KEYS, Window

    record = hc.simulate(hc.constant_cut(t_max=0.5), every=10)
    replay = Replay(record)
    window = Window(replay)
    window.look([], None)
    assert {row[0] for row in LIVE_KEYS} - {row[0] for row in REPLAY_KEYS} == {
        "Ctrl + right drag", "up, down", "left, right", "1, 2, 3", "R"
    }  # fmt: skip
    before = dict(vars(replay))
    window.look([262, 263, 264, 265, *map(ord, "123R")], (0.1, 0.1))
    assert dict(vars(replay)) == before and not window.other
    assert dict(window._writing().rows)["state"] == "replaying"


def test_without_a_display_it_says_what_to_do(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert app.main(["view"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "--web" in said and "hapticclay video" in said
    assert os.listdir(tmp_path) == []


def test_a_window_that_fails_leaves_the_record(monkeypatch):
    """The viewer's process asks for 30 pictures and then says that it died."""
    answers = []

    @contextlib.contextmanager
    def viewer(first):
        heard = queue.SimpleQueue()
        heard.put(([], (0.1, 0.0)))

        def say(sight):
            answers.append(sight)
            time.sleep(FRAME_TIME)
            heard.put(([], (0.1, 0.0)) if len(answers) < 30 else "Traceback\nValueError: no ink")

        yield heard, say

    monkeypatch.setattr(window, "_viewer", viewer)
    monkeypatch.setenv("DISPLAY", ":0")
    session = Session(hc.constant_cut())
    with pytest.warns(RuntimeWarning, match="no ink"):
        window.Window(session).show()
    assert len(answers) == 30 and answers[0].anew and not answers[1].anew
    shown = [f for sight in answers for f in sight.frames[0 if sight.anew else 1 :]]
    assert shown == session.frames[: len(shown)] and len(shown) > 10  # each once, and in order
    assert session.record().p[-1, 0] > 0.0


@pytest.mark.parametrize("lack,said", [("display", "does not answer"), ("OpenGL", "libgl1")])
def test_a_display_that_does_not_answer_or_draw_is_named(lack, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with contextlib.ExitStack() as stack:
        name = ":4711" if lack == "display" else stack.enter_context(x_server("-extension", "GLX"))
        monkeypatch.setenv("DISPLAY", name)
        assert app.main(["view"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and all(part in told for part in (name, said, "--web"))
    assert os.listdir(tmp_path) == []  # no MUJOCO_LOG.TXT
