"""Who may talk to the device: programs of this machine, no pages but those that were named."""

import json
import socket
import urllib.error
import urllib.request

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from hapticclay.ports import Inverse3, serve
from tests.ports.conftest import SCENE, tick
from tests.waiting import PATIENCE

UPGRADE = (
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)


def status(port, *fields, target="/", host="127.0.0.1"):
    """The status of an answer to a request with these fields."""
    with socket.create_connection((host, port), timeout=PATIENCE) as s:
        lines = f"GET {target} HTTP/1.1", *fields, "", ""
        s.sendall("\r\n".join(lines).encode("latin-1"))
        words = s.makefile("rb").readline().split()
    return int(words[1]) if words else 0


REFUSALS = (400, 403, 0)


@pytest.mark.parametrize("protocol", ["inverse", "rosbridge"])
def test_a_program_gets_in_and_a_page_does_not(protocol):
    """A browser sends Origin with each WebSocket, and as Host the name that the page was given."""
    with serve(SCENE, inverse3=Inverse3(protocol=protocol)) as server:
        port = server.port
        for name in (f"127.0.0.1:{port}", f"localhost:{port}", f"[::1]:{port}", "localhost:9000"):
            assert status(port, f"Host: {name}", *UPGRADE) == 101, name
        own = f"Host: 127.0.0.1:{port}"
        foreign = ["http://evil.example", "https://evil.example", "null", "file://", ""]
        foreign += [f"http://127.0.0.1:{port}.evil.example", f"http://localhost:{port}"]
        foreign += ["http://127.0.0.1:8000", "http://localhost:8000", "http://["]
        for origin in foreign:
            assert status(port, own, f"Origin: {origin}", *UPGRADE) in REFUSALS, origin
        names = ["evil.example", f"evil.example:{port}", "127.0.0.1.evil.example", "192.0.2.7"]
        for name in [*names, "", "["]:  # DNS rebinding: the page has the name of its own server
            page = f"Origin: http://{name}"
            assert status(port, f"Host: {name}", page, *UPGRADE) in REFUSALS, name
            assert status(port, f"Host: {name}", *UPGRADE) in REFUSALS, name
            assert status(port, f"Host: {name}", target="/devices") in REFUSALS, name
        assert status(port, *UPGRADE) in REFUSALS
        assert status(port, own, own, *UPGRADE) in REFUSALS
        assert status(port, own, target="//[") in REFUSALS
        assert server.service.device.t == 0.0


def test_a_page_that_drives_nothing():
    """What a browser on this machine would send for a foreign page, with a library's client."""
    with serve(SCENE) as server:
        with pytest.raises(InvalidStatus, match="403"):
            connect(server.url, origin="http://evil.example")
        assert server.service.device.t == 0.0
        (notice,) = server.service.notices
        assert "evil.example" in notice and "--origin" in notice


def test_a_page_that_was_named_gets_in():
    pages = "http://localhost:8000", "https://Lab.example/"
    with serve(SCENE, inverse3=Inverse3(origins=pages)) as server:
        for origin in ("http://localhost:8000", "https://lab.example"):
            with connect(server.url, origin=origin) as c:
                c.recv()
                c.send(tick(x=1.0))
                assert json.loads(c.recv())["inverse3"]
        for origin in ("http://localhost:8001", "https://localhost:8000", "https://lab.example:1"):
            with pytest.raises(InvalidStatus, match="403"):
                connect(server.url, origin=origin)


def test_other_machines_need_the_token_and_pages_stay_out():
    with serve(SCENE, host="0.0.0.0") as server:
        port, token = server.port, server.url.partition("?")[2]
        assert len(token) > 20
        for name in (f"127.0.0.1:{port}", f"192.0.2.7:{port}", f"{socket.gethostname()}:{port}"):
            assert status(port, f"Host: {name}", *UPGRADE, target=f"/?{token}") == 101, name
            for wrong in ("/", "/?token=", "/?token=guess", "/?token=%ff%00"):
                assert status(port, f"Host: {name}", *UPGRADE, target=wrong) == 403
        own = f"Host: 127.0.0.1:{port}"
        for more in ((own, "Origin: http://evil.example"), ("Host: evil.example",)):
            assert status(port, *more, *UPGRADE, target=f"/?{token}") == 403
        url = f"http://127.0.0.1:{port}/devices"
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(url)
        with refused.value as answer:
            assert json.loads(answer.read())["ok"] is False
