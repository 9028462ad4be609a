"""The page in a real headless browser, and the guard that keeps other pages and machines out."""

import contextlib
import http.client
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.live.session import Session
from hapticclay.model import constants
from hapticclay.views.page import Page
from tests.waiting import PATIENCE, until

viser = pytest.importorskip("viser", reason="pip install 'hapticclay[web]'")
CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
FLAGS = [
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
pytestmark = pytest.mark.filterwarnings(
    "ignore::DeprecationWarning", "ignore::ResourceWarning"
)  # of websockets


@pytest.fixture
def page():
    made, done = (
        Page(Session(hc.constant_cut(start=(0.048, 0.0), dt=1e-3), stiffness=10.0), port=0),
        threading.Event(),
    )
    thread = threading.Thread(target=made.serve, args=(done.is_set,))
    thread.start()
    yield made
    done.set()
    thread.join(timeout=PATIENCE)
    assert not thread.is_alive()


def press(slider, key, times):
    """Presses a key again once its last effect is drawn: before, it acts on the old value."""
    from playwright.sync_api import expect

    for _ in range(times):
        shown = slider.get_attribute("aria-valuenow")
        slider.press(key)
        expect(slider).not_to_have_attribute("aria-valuenow", shown, timeout=1e3 * PATIENCE)


@pytest.mark.skipif(not CHROMIUM, reason="needs chromium (apt-get install chromium)")
def test_page_loads_and_its_sliders_change_the_simulation(page, tmp_path, capfd):
    playwright = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    troubles = []
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        tab = browser.new_page(viewport={"width": 720, "height": 400})
        tab.set_default_timeout(1e3 * PATIENCE)  # software drawing, about a picture a second
        tab.on("console", lambda m: troubles.append(m.text) if m.type == "error" else None)
        tab.on("pageerror", lambda e: troubles.append(str(e)))
        tab.goto(page.url)
        playwright.expect(tab).to_have_title("hapticclay")
        sliders = tab.locator("[role=slider]")
        sliders.nth(2).wait_for()

        press(sliders.nth(2), "ArrowRight", 2)
        # the page sends at most 20 values a second, of all sliders together: the last
        until(lambda: page.session.run.pull.force[0] > 0.19)
        press(sliders.nth(0), "ArrowLeft", 1)
        until(lambda: page.session.frames[-1][1][0] > 0.053 and page.b.value < 89.5)
        picture = tab.screenshot(path=tmp_path / "page.png")
        before = page.session.scenario.clay.x.values[1]
        number = tab.locator("input[type=text], input[type=number]").nth(0)
        number.fill("-5")
        number.press("Enter")
        until(lambda: not page.session.scenario.clay.x.values[1])
        browser.close()
    assert troubles == []
    assert page.session.scenario.clay.x.values[1] == page.b.value == 0.0  # as far down as it goes
    assert capfd.readouterr().err == ""
    assert page.session.run.pull.force == pytest.approx((0.2, 0.0))
    assert before == pytest.approx(89.0)
    assert page.session.frames[-1][1][0] > 0.053  # the force moved the handle into the clay

    import imageio.v3 as iio

    image = iio.imread(picture)[..., :3].astype(int)
    clay = (image[..., 0] - image[..., 2] > 60) & (image[..., 0] > image[..., 1])
    assert clay[:, :400].sum() > 500  # clay and knob are in the picture
    record = page.session.record()
    inside = (record.b[:, 0] > 0.0) & (abs(record.v[:, 0]) > 1e-3)
    assert record.ratio(record.fe)[inside, 0] == pytest.approx(record.b[inside, 0], rel=0.01)


@pytest.mark.parametrize(
    "typed,taken", [(-5.0, 0.0), (1e9, 270.0), (float("nan"), 0.0), (45.0, 45.0)]
)
def test_number_typed_beside_a_slider_stays_in_its_range(page, typed, taken):
    page.b.value = typed
    assert page.b.value == taken and page.session.scenario.clay.x.values[1] == pytest.approx(taken)


@pytest.mark.parametrize("scenario", [hc.constant_cut, hc.variable_cut, hc.free, hc.stability_test])
@pytest.mark.parametrize("width,height", [(580, 600), (960, 800), (1600, 1000)])
def test_first_view_holds_arm_and_clay(scenario, width, height):
    """Projects by a pinhole camera; the controls leave 580 x 600 of a page of 900 x 600."""
    from hapticclay.views import stage

    page = Page(Session(scenario()), port=0)
    try:
        camera, s, grid = page.server.initial_camera, page.session.scenario, page.stage.removal
        place, at = np.array(camera.position), np.array(camera.look_at)
        turn = np.linspace(0.0, 2.0 * np.pi, 60)
        ring = np.column_stack((np.cos(turn), np.sin(turn), np.zeros(60)))
        shoulder = [0.06 * ring + (0.0, 0.0, stage.GROUND), 0.042 * ring + (0.0, 0.0, 0.022)]
        x, y = np.add(s.start, s.origin)
        hand = np.array([(x, y, 0.07), (x + 0.12, y, 0.052), (x, y + 0.12, 0.052)])
        q = page.session.run.q[0]
        elbow = 0.026 * ring + (constants.L1 * np.cos(q), constants.L1 * np.sin(q), 0.024)
        corners = [
            (cx + s.origin[0], cy + s.origin[1], stage.GROUND + cz)
            for cx in grid.x[[0, -1]] for cy in grid.y[[0, -1]] for cz in (0.0, stage.THICKNESS)
        ]  # fmt: skip
        ahead = (at - place) / np.linalg.norm(at - place)
        right = np.cross(ahead, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(ahead, (0.0, 0.0, 1.0)))
        away = np.vstack([*shoulder, elbow, hand, *([corners] if s.clay else [])]) - place
        half = np.tan(0.5 * camera.fov) * (away @ ahead)
        assert np.abs(away @ right / half).max() < 0.97 * width / height
        assert np.abs(away @ np.cross(right, ahead) / half).max() < 0.97
    finally:
        page.close()


def test_page_says_what_the_monitor_says(page):
    page.gain.value = 3.0
    until(lambda: "no limit of K here" in page.verdict.content)
    assert (
        "stable" in page.verdict.content
    )  # in free space, where no gain is too much for this hand
    onset = hc.Outcome("diverged", 1.0, 1, "y", "growing <oscillation>")
    with page.player.lock:
        page.session.run.watch.onset, page.session._last_swing = onset, page.session.t + 1e3
    until(lambda: "UNSTABLE" in page.verdict.content)
    assert "UNSTABLE since 1.0 s: growing &lt;oscillation&gt; of y" in page.verdict.content


def test_page_listens_on_this_machine_alone(page):
    assert page.url == f"http://127.0.0.1:{page.port}"
    assert page.server.get_port() == page.port
    with pytest.raises(ConnectionRefusedError):  # 127.0.0.2: open on all addresses only
        socket.create_connection(("127.0.0.2", page.port), timeout=PATIENCE)


def asked(port, *lines):
    """First line of the answer to a request of these lines."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as s:
        s.sendall("\r\n".join((*lines, "", "")).encode("latin-1"))
        return s.makefile("rb").readline().decode().strip()


UPGRADE = (
    "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)  # fmt: skip


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_no_other_name_and_no_other_page_gets_in(host):
    """Host holds the name that the browser was given, Origin the page it shows."""
    page = Page(Session(hc.constant_cut()), host=host, port=0)
    port = page.port
    own, cookie = f"127.0.0.1:{port}", [f"Cookie: hapticclay={page.guard.token}"]

    def ask(*fields, target="/"):
        return asked(port, f"GET {target} HTTP/1.1", *fields, *cookie)

    try:
        for good in (
            own,
            f"localhost:{port}",
            "localhost:9000",
            f"[::1]:{port}",
        ):  # 9000: ssh -L 9000:...
            assert ask(f"Host: {good}") == "HTTP/1.1 200 OK"
            assert ask(f"Host: {good}", f"Origin: http://{good}", *UPGRADE).startswith(
                "HTTP/1.1 101 "
            )
        for bad in (
            "evil.example",
            f"evil.example:{port}",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "",
            "[",
        ):
            for more in (
                (),
                (f"Origin: http://{bad}", *UPGRADE),
                (f"Origin: http://{own}", *UPGRADE),
            ):
                assert ask(f"Host: {bad}", *more) in (
                    "HTTP/1.1 403 Forbidden",
                    "HTTP/1.1 400 Bad Request",
                ), bad
        assert ask() == ask(f"Host: {own}", "Host: evil.example") == "HTTP/1.1 403 Forbidden"
        foreign = ["http://evil.example", "null", "file://", f"http://{own}.evil.example"]
        foreign += ["http://127.0.0.1", f"http://127.0.0.1:{port + 1}", f"http://localhost:{port}"]
        for origin in foreign:
            for more in ((), UPGRADE):
                assert (
                    ask(f"Host: {own}", f"Origin: {origin}", *more) == "HTTP/1.1 403 Forbidden"
                ), origin
        if host == "0.0.0.0":
            assert (
                ask(f"Host: {socket.gethostname()}:{port}")
                == ask(f"Host: 192.0.2.7:{port}")
                == "HTTP/1.1 200 OK"
            )
        else:
            assert ask(f"Host: 192.0.2.7:{port}") == "HTTP/1.1 403 Forbidden"
    finally:
        page.close()


def test_a_socket_is_no_way_around_the_guard(page):
    """viser listens on the guarded port alone; whoever else connects learns and changes nothing."""
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    assert page.server.get_port() == page.port
    speak: dict = {"subprotocols": [Subprotocol(f"viser-v{viser.__version__}")]}
    with connect(f"ws://127.0.0.1:{page.port}", **speak) as s:
        assert s.recv(timeout=PATIENCE)
    with pytest.raises(InvalidStatus, match="403"):
        connect(f"ws://127.0.0.1:{page.port}", origin="http://evil.example", **speak)
    guarded = Page(Session(hc.constant_cut()), host="0.0.0.0", port=0)
    cookie = {"Cookie": f"hapticclay={guarded.guard.token}"}
    try:
        for headers in ({}, {"Cookie": "hapticclay=guess"}, {"Cookie": "hapticclay="}):
            with pytest.raises(InvalidStatus, match="403"):
                connect(f"ws://127.0.0.1:{guarded.port}", additional_headers=headers, **speak)
        with connect(f"ws://127.0.0.1:{guarded.port}", additional_headers=cookie, **speak) as s:
            assert s.recv(timeout=PATIENCE)
    finally:
        guarded.close()


def test_a_viser_that_cannot_be_guarded_is_refused(monkeypatch):
    """A server that does not start through websockets' `serve` finds the port taken."""
    monkeypatch.setattr("hapticclay.views.live_page._guarded", lambda *_: contextlib.nullcontext())
    with pytest.raises(RuntimeError, match="cannot be guarded"):
        Page(Session(hc.constant_cut()), port=0)


def answer(port, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response.status, response.headers, body


def test_other_machines_need_the_token():
    page = Page(Session(hc.constant_cut()), host="0.0.0.0", port=0)
    try:
        port, token = page.port, page.url.partition("token=")[2]
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
        assert headers["X-Frame-Options"] == "DENY"
    finally:
        page.close()


def test_address_is_one_that_others_can_open():
    from hapticclay.ports.guard import url_host

    assert (url_host("127.0.0.1"), url_host("::1"), url_host("box.example")) == (
        "127.0.0.1",
        "[::1]",
        "box.example",
    )
    assert url_host("0.0.0.0") not in ("0.0.0.0", "")


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_taken_or_impossible_port_is_refused(host):
    with (
        socket.create_server((host, 0)) as s,
        pytest.raises(hc.ParameterError, match="cannot listen on"),
    ):
        Page(Session(hc.constant_cut()), host=host, port=s.getsockname()[1])
    with pytest.raises(hc.ParameterError, match="port = 99999: must be a whole number"):
        Page(Session(hc.constant_cut()), host=host, port=99999)


def test_reset_while_the_hand_holds_goes_on(page):
    """The reset unticks the box, which calls the session from the thread that holds the lock."""
    page.hold.value = True
    assert page.session.point is not None
    thread = threading.Thread(target=page._reset, args=(None,), daemon=True)
    thread.start()
    thread.join(timeout=PATIENCE)
    assert not thread.is_alive() and page.session.point is None and not page.hold.value


def test_player_that_dies_leaves_no_server(monkeypatch):
    page = Page(Session(hc.constant_cut()), port=0)
    monkeypatch.setattr(page.session, "advance", lambda s: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        page.serve()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", page.server.get_port()), timeout=PATIENCE)


@contextlib.contextmanager
def started(folder, *args, before="pass"):
    """`hapticclay view --web` as a person starts it."""
    code = f"import sys; {before}; from hapticclay.cli import app; sys.exit(app.main(sys.argv[1:]))"
    words = [
        sys.executable,
        "-c",
        code,
        "view",
        "constant",
        "--web",
        "--no-plots",
        "--out",
        "o",
        *args,
    ]
    with subprocess.Popen(
        words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as p:
        try:
            yield p
        finally:
            p.kill()


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_ctrl_c_ends_it_and_the_record_is_there(tmp_path, host):
    with started(tmp_path, "--host", host, "--port", "0") as p:
        said = p.stdout.readline()
        assert said.startswith("open http://") and ("?token=" in said) == (
            host == "0.0.0.0"
        )  # nothing else before
        assert answer(int(re.search(r":(\d+)", said)[1]))[0] in (200, 403)
        p.send_signal(signal.SIGINT)
        out, err = p.communicate(timeout=PATIENCE)
    assert p.returncode == 0 and "written to o" in out and "viser" not in out
    assert err.count("\n") == (host == "0.0.0.0") and ("warning" in err) == (host == "0.0.0.0")
    assert hc.Record.load(tmp_path / "o").outcome.code == "finished"


def test_missing_viser_is_one_line_that_says_what_to_install(tmp_path):
    with started(tmp_path, before="sys.modules['viser'] = None") as p:
        out, err = p.communicate(timeout=PATIENCE)
    assert (
        (p.returncode, out) == (2, "")
        and err.count("\n") == 1
        and "pip install 'hapticclay[web]'" in err
    )
    assert list(tmp_path.iterdir()) == []


def test_guard_survives_noise(caplog, capfd):
    """Whatever is not a request for the page gets no page, and leaves no trace in the log."""
    page = Page(Session(hc.constant_cut()), host="0.0.0.0", port=0)
    refused = ("HTTP/1.1 403 Forbidden", "HTTP/1.1 400 Bad Request", "")
    own = f"Host: 127.0.0.1:{page.port}"
    try:
        for noise in (b"\r\n\r\n", b"\xff" * 100 + b"\r\n\r\n", b"GET\r\n\r\n", b"x" * 100_000):
            with socket.create_connection(("127.0.0.1", page.port), timeout=PATIENCE) as s:
                s.sendall(noise)
        lines = ("GET http://[ HTTP/1.1", "GET //[ HTTP/1.1", "GET http://127.0.0.1/ HTTP/1.1")
        lines += ("POST / HTTP/1.1", "GET", "", "GET * HTTP/1.1", "GET /?token=%ff%00\xe9 HTTP/1.1")
        for line in lines:
            assert asked(page.port, line, own) in refused, line
        many = [f"X-{k}: 1" for k in range(200)]
        assert asked(page.port, "GET / HTTP/1.1", own, *many) in refused
        assert answer(page.port)[0] == 403
    finally:
        page.close()
    assert caplog.records == [] and capfd.readouterr().err == ""
