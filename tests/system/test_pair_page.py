"""The page of a pair in a real headless browser, and the command that serves it."""

import contextlib
import re
import signal
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from websockets.sync.client import connect
from websockets.typing import Subprotocol

import hapticclay as hc
from hapticclay.live.pair_session import PairSession
from tests.system.test_page import CHROMIUM, FLAGS, answer, press
from tests.waiting import PATIENCE, until

viser = pytest.importorskip("viser", reason="pip install 'hapticclay[web]'")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")

PAIR = """
Ts = "2 ms"
[leader]
mass = 0.5
damper = 1.0
[law]
Kp = [400.0]
Kd = [20.0]
[link]
delay = "4 ms"
"""


@contextlib.contextmanager
def shown(pair):
    from hapticclay.views.pair_page import PairPage

    page, done = PairPage(PairSession(pair), port=0), threading.Event()
    thread = threading.Thread(target=page.serve, args=(done.is_set,))
    thread.start()
    try:
        yield page
    finally:
        done.set()
        thread.join(timeout=PATIENCE)
        assert not thread.is_alive()


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "pair.toml"
    path.write_text(PAIR)
    return path


@pytest.mark.skipif(not CHROMIUM, reason="needs chromium (apt-get install chromium)")
def test_sliders_restart_the_pair_with_a_later_link(file):
    playwright = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    troubles = []
    with shown(hc.Pair.load(file)) as page, playwright.sync_playwright() as p:
        page.session.paused = True  # Chromium has the processor until the sliders are there
        browser = p.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        tab = browser.new_page(viewport={"width": 720, "height": 400})
        tab.set_default_timeout(1e3 * PATIENCE)
        tab.on("pageerror", lambda e: troubles.append(str(e)))
        tab.goto(page.url)
        slider = tab.locator("[role=slider]").nth(0)
        slider.wait_for()
        press(slider, "ArrowRight", 2)  # half a sample each
        until(lambda: page.session.pair.link.delay == pytest.approx(6e-3))
        until(lambda: "link 6 ms" in page.verdict.content)
        playwright.expect(tab.get_by_text("delay left")).to_be_visible()
        browser.close()
    assert troubles == []


def drag(page, away):
    """What viser does while a person drags the arrows."""
    page._dragged(None)
    page.target.position = tuple(page._start + away)
    page._dragged(None)


def test_the_hand_pulls_where_the_arrows_are(file):
    with shown(hc.Pair.load(file)) as page:
        drag(page, [0.05, 0.0, 0.0])
        until(lambda: page.session.run.newest and page.session.run.newest[1][0] > 0.02)
        until(lambda: "delay left" in page.status.content)
        page._reset(None)
        assert page.session.point is None and not page.hold.value


def test_a_change_of_gains_leaves_uneven_delays_as_the_file_has_them(file):
    """1.3 ms in milliseconds and back is no longer 1.3 ms, which would count as moved."""
    pair = replace(hc.Pair.load(file), link=hc.Link(delay=(1.3e-3, 0.5e-3)), Ts=1e-3)
    with shown(pair) as page:
        page.gain.value = 1.5
        until(lambda: page.session.gain == 1.5)
        assert page.session.pair.link.delays == (1.3e-3, 0.5e-3)
        page.delay.value = 2.0
        until(lambda: page.session.pair.link.delays == (2e-3, 2e-3))


def test_a_drag_that_begins_while_the_page_is_drawn_is_kept(file):
    with shown(hc.Pair.load(file)) as page:
        draw, drawn = page._pose, threading.Event()

        def drag_first(i, figure):
            if not drawn.is_set():
                drag(page, [0.05, 0.0, 0.0])
                drawn.set()
            draw(i, figure)

        page._pose = drag_first
        assert drawn.wait(90.0)
        until(lambda: page.session.run.newest and page.session.run.newest[1][0] > 0.02)
        assert page.target.position[0] == pytest.approx(page._start[0] + 0.05)


@pytest.mark.parametrize("name", ["planar_2r", "five_bar", "leader_7"])
def test_arms_stand_where_the_film_has_them(name):
    arm = hc.MjcfArm(name)
    n = len(arm.names)
    pair = hc.Pair(arm, arm, hc.JointPD((20.0,) * n, (0.5,) * n), follower_clay=hc.Contact(B=5.0))
    with shown(pair) as page:
        for i, parts in enumerate(page._parts):
            handle = arm.handle() + page._shift[i]
            until(lambda h=handle, p=parts: np.allclose(p["knob"][0].position, h, atol=0.02))


def test_a_wall_stands_and_an_object_moves_with_the_handle(file):
    wall = hc.Contact(500.0, unilateral=True, start=0.02)
    pair = replace(hc.Pair.load(file), follower_clay=wall, leader_clay=hc.Contact(mass=0.2))
    with shown(pair) as page:
        assert page._touched[0] is not None and page._touched[1] is None
        drag(page, [0.05, 0.0, 0.0])
        until(lambda: page._touched[0].position[0] > 0.02)


def test_ctrl_c_ends_it_and_the_record_is_there(file, tmp_path):
    code = "import sys; from hapticclay.cli import app; sys.exit(app.main(sys.argv[1:]))"
    words = ["pair", str(file), "--view", "--port", "0", "--out", "o"]
    with subprocess.Popen(
        [sys.executable, "-c", code, *words], cwd=tmp_path, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as p:  # fmt: skip
        try:
            said = p.stdout.readline()
            assert said.startswith("open http://")
            port = int(re.search(r":(\d+)", said)[1])
            assert answer(port)[0] == 200
            speak = [Subprotocol(f"viser-v{viser.__version__}")]
            with connect(f"ws://127.0.0.1:{port}", subprotocols=speak, max_size=None) as tab:
                for _ in range(4):  # the page, and what has changed since: it runs
                    assert tab.recv(timeout=PATIENCE)
            p.send_signal(signal.SIGINT)
            out, err = p.communicate(timeout=PATIENCE)
        finally:
            p.kill()
    assert p.returncode == 0 and err == "" and "written to o" in out
    assert {x.name for x in (tmp_path / "o").iterdir()} == {"pair_run.json", "pair_run.png"}
