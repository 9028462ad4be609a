"""The window under a real X server without a screen: a mouse drags, keys are pressed, the record tells."""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import hapticclay as hc

missing = [tool for tool in ("Xvfb", "xdotool") if not shutil.which(tool)]
pytestmark = pytest.mark.skipif(bool(missing), reason=f"needs {' and '.join(missing)} (apt-get install xvfb xdotool)")


@pytest.fixture(scope="module")
def screen():
    """The environment of a screen of its own."""
    reading, writing = os.pipe()
    x = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x800x24", "-noreset"],
        pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(writing)
    with os.fdopen(reading) as f:
        number = f.readline().strip()
    yield {**os.environ, "DISPLAY": f":{number}"}
    x.terminate()
    x.wait()


class Mouse:
    """A person at the window of one command."""

    def __init__(self, screen, folder, *args):
        self.screen = screen
        self.program = subprocess.Popen(
            [sys.executable, "-W", "error", "-m", "hapticclay", *args],
            cwd=folder, env=screen, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        for _ in range(240):
            found = subprocess.run(
                ["xdotool", "search", "--name", "MuJoCo"], env=screen, capture_output=True, text=True
            )
            if found.stdout or self.program.poll() is not None:
                break
            time.sleep(0.25)
        self.window = (
            found.stdout.split()[0] if found.stdout else pytest.fail(f"no window: {self.program.communicate()}")
        )
        time.sleep(5.0)  # for the first pictures

    def do(self, *words):
        subprocess.run(["xdotool", *map(str, words)], env=self.screen, check=True)

    def drag(self, pixels):
        self.do("mousemove", 400, 300, "keydown", "ctrl", "mousedown", 3)
        time.sleep(1.0)
        for _ in range(40):
            self.do("mousemove_relative", "--", pixels // 40, 0)
            time.sleep(0.1)

    def close(self):
        """Lets go and quits; exit status, output."""
        self.do("mouseup", 3, "keyup", "ctrl")
        time.sleep(1.0)
        self.do("key", "ctrl+q")
        out, err = self.program.communicate(timeout=120)
        return self.program.returncode, out, err


def test_mouse_cuts_through_the_clay(screen, tmp_path):
    mouse = Mouse(screen, tmp_path, "view", "--out", "o")
    mouse.drag(240)
    time.sleep(8.0)
    code, out, err = mouse.close()
    assert (code, err) == (0, ""), (out, err)
    record = hc.Record.load(tmp_path / "o")
    x = record.p[:, 0]
    assert x.max() > 0.17, out
    inside = (record.b[:, 0] > 0.0) & (np.abs(record.v[:, 0]) > 1e-3)
    np.testing.assert_allclose(record.ratio(record.fe)[inside, 0], 90.0, rtol=0.01)
    assert record.extra["removed"][-1] == pytest.approx(0.02 * 0.01 * 0.10, rel=0.01)  # the way is nearly straight
    assert sorted(os.listdir(tmp_path)) == ["o"]  # no MUJOCO_LOG.TXT
    assert sorted(os.listdir(tmp_path / "o")) == ["force.png", "record.npz", "summary.json", "velocity.png"]
    assert sum(record.notes["late_ms"]["frames"]) == record.notes["frames"] > 100


def test_keys_change_what_runs_and_switch_the_scenario(screen, tmp_path):
    mouse = Mouse(screen, tmp_path, "view", "free", "--out", "o", "--no-plots")
    mouse.do("key", "1")
    time.sleep(6.0)
    mouse.window = None
    for key in ("Up", "Right", "Right", "h"):
        mouse.do("key", key)
        time.sleep(1.0)
    code, out, err = mouse.close()
    assert (code, err) == (0, ""), (out, err)
    record = hc.Record.load(tmp_path / "o")
    assert record.scenario.name == "constant"
    assert record.scenario.gain == pytest.approx((1.25, 0.625))
    assert record.scenario.clay.x.values[1] == pytest.approx(90.0 * 1.25**2)


def test_a_record_is_replayed(screen, tmp_path):
    hc.simulate(hc.constant_cut(t_max=2.0), every=10).save(tmp_path / "r")
    code, out, err = Mouse(screen, tmp_path, "view", "r").close()
    assert (code, err) == (0, "")
    assert sorted(os.listdir(tmp_path)) == ["r"]


def test_every_key_of_the_page_does_what_it_says():
    from hapticclay.session import FRAME, Session
    from hapticclay.view import BACKSPACE, DOWN, LEFT, RIGHT, SPACE, UP, Window

    page = (Path(__file__).parents[1] / "docs" / "view.md").read_text()
    named = [k for row in re.findall(r"^\| (?!key|---)(.+?) \|.*\|$", page, re.M) for k in row.split(", ")]
    assert named == ["space", "backspace", "up", "down", "left", "right", "1", "2", "3", "R", "H"]
    session = Session(hc.constant_cut(), stiffness=10.0)
    window = Window(session)
    press = window._key
    press(SPACE)
    assert session.paused and not len(session.advance(FRAME))
    press(SPACE)
    session.pull((0.1, 0.0))
    while session.t < 3.0:
        session.advance(FRAME)
    window.stage.carve([f[1] for f in session.frames])
    assert window.stage.removal.volume > 1e-6
    for key, gain, b in ((UP, 1.25, 90.0), (RIGHT, 1.25, 112.5), (RIGHT, 1.25, 140.625), (DOWN, 1.0, 140.625),
                         (LEFT, 1.0, 112.5)):  # fmt: skip
        press(key)
        assert session.scenario.gain == pytest.approx((gain, 0.5 * gain)) and session.b[0] == pytest.approx(b)
    press(ord("R"))
    assert not session.recording
    press(BACKSPACE)
    assert (session.t, session.recorded, session.recording, window.stage.removal.volume) == (0.0, False, False, 0.0)
    assert session.scenario.clay.x.values[1] == pytest.approx(112.5)  # as it was set
    press(ord("R"))
    press(ord("H"))
    assert session.recording and not window.help
    for key, name in zip("123", ("constant", "variable", "free"), strict=True):
        press(ord(key))
        assert window.wanted == name


@pytest.mark.parametrize("low,high", [(0.0, 1.06), (-0.001, 2.06), (0.0, 0.3), (-0.4, 0.2), (0.0, 90.0), (3.0, 31.0)])
def test_axes_have_round_ticks(low, high):
    """The engine widens limits to whole numbers and divides evenly: others than whole give ticks such as 0.667."""
    from hapticclay.view import _round

    first, last, lines = _round(low, high, 1.0)
    assert first == round(first) and last == round(last) and 3 <= lines <= 9
    assert first <= low + 0.06 * (high - low) and last >= high - 0.06 * (high - low)
    assert (last - first) / (lines - 1) in (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)


def test_without_a_display_it_says_what_to_do(tmp_path):
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    out = subprocess.run(
        [sys.executable, "-m", "hapticclay", "view"], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=60
    )
    assert out.returncode == 2 and out.stderr.count("\n") == 1
    assert "--web" in out.stderr and "hapticclay video" in out.stderr
    assert os.listdir(tmp_path) == []
