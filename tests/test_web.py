"""The page in a real headless browser, and the gate that guards it from other machines."""

import contextlib
import http.client
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

import hapticclay as hc
from hapticclay.gate import Gate
from hapticclay.session import Session

viser = pytest.importorskip("viser", reason="pip install 'hapticclay[web]'")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")  # of websockets


@pytest.fixture
def page():
    from hapticclay.web import Page

    made, done = Page(Session(hc.constant_cut(), stiffness=10.0, every=10), port=0), threading.Event()
    thread = threading.Thread(target=made.serve, args=(done.is_set,))
    thread.start()
    yield made
    done.set()
    thread.join(timeout=30.0)
    assert not thread.is_alive()


def press(slider, key, times):
    """One after the other: a key that comes before the last one is drawn starts from the value before it."""
    from playwright.sync_api import expect

    for _ in range(times):
        shown = slider.get_attribute("aria-valuenow")
        slider.press(key)
        expect(slider).not_to_have_attribute("aria-valuenow", shown, timeout=30_000)


@pytest.mark.skipif(not CHROMIUM, reason="needs chromium (apt-get install chromium)")
def test_page_loads_and_its_sliders_change_the_simulation(page, tmp_path):
    playwright = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    troubles = []
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        tab = browser.new_page(viewport={"width": 900, "height": 600})
        tab.set_default_timeout(150_000)  # software drawing, about a picture a second
        tab.on("console", lambda m: troubles.append(m.text) if m.type == "error" else None)
        tab.on("pageerror", lambda e: troubles.append(str(e)))
        tab.goto(page.url)
        sliders = tab.locator("[role=slider]")
        sliders.nth(2).wait_for()
        press(sliders.nth(2), "ArrowRight", 15)
        tab.wait_for_timeout(2000)  # the page sends at most 20 values a second, of all sliders together: the last
        press(sliders.nth(0), "ArrowLeft", 10)
        deadline = time.monotonic() + 90.0
        while time.monotonic() < deadline and page.session.frames[-1][1][0] < 0.06:
            tab.wait_for_timeout(500)
        picture = tab.screenshot(path=tmp_path / "page.png")
        browser.close()
    assert troubles == []
    assert page.session.run.muscle.force == pytest.approx((1.5, 0.0))
    assert page.session.scenario.clay.x.values[1] == pytest.approx(80.0)
    assert page.session.frames[-1][1][0] > 0.06  # the force moved the handle into the clay

    import imageio.v3 as iio

    image = iio.imread(picture)[..., :3].astype(int)
    clay = (image[..., 0] - image[..., 2] > 60) & (image[..., 0] > image[..., 1])
    assert clay[:, :600].sum() > 500  # clay and knob are in the picture
    record = page.session.record()
    inside = (record.b[:, 0] > 0.0) & (abs(record.v[:, 0]) > 1e-3)
    assert record.ratio(record.fe)[inside, 0] == pytest.approx(record.b[inside, 0], rel=0.01)


def test_page_listens_on_this_machine_alone(page):
    port = page.server.get_port()
    assert page.url == f"http://127.0.0.1:{port}" and page.gate is None
    elsewhere = "127.0.0.2"  # another address of this machine: open only to who listens on all of them
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((elsewhere, port), timeout=5.0)


def answer(port, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10.0)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response.status, response.headers, body


def test_other_machines_need_the_token():
    from hapticclay.web import Page

    page = Page(Session(hc.constant_cut()), host="0.0.0.0", port=0)
    try:
        port, token = page.gate.port, page.url.partition("token=")[2]
        assert len(token) >= 20
        assert answer(port)[0] == 403
        assert answer(port, "/?token=wrong")[0] == 403
        assert answer(port, Cookie="hapticclay=wrong")[0] == 403
        assert answer(port, Upgrade="websocket", Connection="Upgrade")[0] == 403
        status, headers, _ = answer(port, f"/?token={token}")
        assert status == 303 and headers["Location"] == "/"
        cookie = headers["Set-Cookie"].partition(";")[0]
        status, _, body = answer(port, Cookie=cookie)
        assert status == 200 and b"<html" in body.lower()
        inner = page.server.get_port()
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", inner), timeout=5.0)
    finally:
        page.close()


def test_address_is_one_that_others_can_open():
    from hapticclay.web import _name

    assert (_name("127.0.0.1"), _name("::1"), _name("box.example")) == ("127.0.0.1", "[::1]", "box.example")
    assert _name("0.0.0.0") not in ("0.0.0.0", "")


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_taken_or_impossible_port_is_refused(host):
    from hapticclay.web import Page

    with socket.create_server((host, 0)) as s, pytest.raises(hc.ParameterError, match="cannot be listened on"):
        Page(Session(hc.constant_cut()), host=host, port=s.getsockname()[1])
    with pytest.raises(hc.ParameterError, match="port = 99999: must be a whole number"):
        Page(Session(hc.constant_cut()), host=host, port=99999)


def test_reset_while_the_hand_holds_goes_on(page):
    """The box is unticked by the reset, which is told to the session at once, by the thread that holds the lock."""
    page.hold.value = True
    assert page.session.point is not None
    thread = threading.Thread(target=page._reset, args=(None,), daemon=True)
    thread.start()
    thread.join(timeout=10.0)
    assert not thread.is_alive() and page.session.point is None and not page.hold.value


def test_player_that_dies_leaves_no_server(monkeypatch):
    from hapticclay.web import Page

    page = Page(Session(hc.constant_cut()), port=0)
    monkeypatch.setattr(page.session, "advance", lambda s: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        page.serve()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", page.server.get_port()), timeout=5.0)


@contextlib.contextmanager
def started(folder, *args, before="pass"):
    """`hapticclay view --web` as a person starts it."""
    code = f"import sys; {before}; from hapticclay import cli; sys.exit(cli.main(sys.argv[1:]))"
    words = [sys.executable, "-c", code, "view", "constant", "--web", "--no-plots", "--out", "o", *args]
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as p:
        try:
            yield p
        finally:
            p.kill()


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_ctrl_c_ends_it_and_the_record_is_there(tmp_path, host):
    with started(tmp_path, "--host", host, "--port", "0") as p:
        said = p.stdout.readline()
        assert said.startswith("open http://") and ("?token=" in said) == (host == "0.0.0.0")  # nothing else before
        time.sleep(2.0)
        p.send_signal(signal.SIGINT)
        out, err = p.communicate(timeout=60)
    assert p.returncode == 0 and "written to o" in out and "viser" not in out
    assert err.count("\n") == (host == "0.0.0.0") and ("warning" in err) == (host == "0.0.0.0")
    assert hc.Record.load(tmp_path / "o").outcome.code == "finished"


def test_missing_viser_is_one_line_that_says_what_to_install(tmp_path):
    with started(tmp_path, before="sys.modules['viser'] = None") as p:
        out, err = p.communicate(timeout=60)
    assert (p.returncode, out) == (2, "") and err.count("\n") == 1 and "pip install 'hapticclay[web]'" in err
    assert list(tmp_path.iterdir()) == []


def test_gate_survives_noise():
    gate = Gate("127.0.0.1", 0, 9, "secret")
    try:
        for noise in (b"\r\n\r\n", b"\xff" * 100 + b"\r\n\r\n", b"GET\r\n\r\n", b"x" * 100_000):
            with socket.create_connection(("127.0.0.1", gate.port), timeout=5.0) as s:
                s.sendall(noise)
        assert answer(gate.port)[0] == 403
    finally:
        gate.close()


def test_taken_address_is_refused():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        s.listen()
        with pytest.raises(hc.ParameterError, match="cannot be listened on"):
            Gate("127.0.0.1", s.getsockname()[1], 9, "secret")
