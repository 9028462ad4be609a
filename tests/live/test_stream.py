"""A session over UDP, received on this machine."""

import contextlib
import dataclasses
import json
import math
import socket
import subprocess
import sys

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app, view
from hapticclay.errors import ParameterError
from hapticclay.live.clock import FRAME_TIME
from hapticclay.live.player import Player
from hapticclay.live.replay import Replay
from hapticclay.live.session import Session
from hapticclay.live.stream import UdpStream


@pytest.fixture
def receiver():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        s.settimeout(10.0)
        yield s


def address(receiver):
    return f"127.0.0.1:{receiver.getsockname()[1]}"


def heard(receiver, count):
    return [json.loads(receiver.recv(65536), parse_constant=pytest.fail) for _ in range(count)]


def test_a_played_session_is_heard(receiver):
    """By a Player, which both window and page use: valid JSON of all fields, times increase."""
    session = Session(hc.constant_cut(), stiffness=10.0)
    session.pull((0.05, 0.0))
    with view.streaming(session, address(receiver)):
        player = Player(session)
        player.start()
        try:
            got = heard(receiver, 20)
        finally:
            player.stop()
    assert all(b["timestamp"] > a["timestamp"] for a, b in zip(got, got[1:], strict=False))
    frames = {frame.t: frame for frame in session.frames}
    for sample in got:
        assert set(sample) == {
            *("timestamp", "t", "p", "v", "fh", "fe", "b", "gain", "held", "target"),
        }
        frame = frames[sample["t"]]
        for name in ("p", "v", "fh", "fe"):
            assert sample[name] == dict(zip("xy", getattr(frame, name), strict=True))
        assert sample["gain"] == {"x": 1.0, "y": 0.5} and sample["held"] == {"x": 0, "y": 0}
        assert sample["target"] == {"x": pytest.approx(0.05), "y": 0.0}


def test_a_replay_is_heard(receiver):
    record = hc.simulate(hc.constant_cut(t_max=0.3))
    replay = Replay(record)
    with view.streaming(replay, address(receiver)):
        player = Player(replay)
        player.start()
        try:
            got = heard(receiver, 5)
        finally:
            player.stop()
    for sample in got:
        k = int(np.flatnonzero(record.t == sample["t"])[0])
        assert sample["p"] == dict(zip("xy", record.p[k].tolist(), strict=True))
        assert "target" not in sample


def test_time_goes_on_over_a_restart(receiver):
    session, stream = Session(hc.free()), UdpStream(address(receiver))
    with contextlib.closing(stream):
        for restarts in range(3):
            if restarts:
                session.restart()
            for _ in range(3):
                stream.send(session)
                stream.send(session)  # nothing new: not sent
                session.advance(FRAME_TIME)
    got = heard(receiver, 9)
    assert got[0]["timestamp"] == got[0]["t"] == 0.0
    stamps = [x["timestamp"] for x in got]
    assert all(b > a for a, b in zip(stamps, stamps[1:], strict=False))
    assert got[3]["t"] == got[0]["t"] < got[2]["t"]


def test_clay_that_holds_is_told(receiver):
    clay = hc.slab(hc.Flow(Fy=50.0, b=20.0), -0.01, 0.1)
    session = Session(dataclasses.replace(hc.constant_cut(), clay=clay))
    session.pull((0.05, 0.0))
    stream = UdpStream(address(receiver))
    with contextlib.closing(stream):
        session.advance(FRAME_TIME)
        stream.send(session)
    assert heard(receiver, 1)[0]["held"]["x"] == 1


def test_a_number_that_is_not_finite_is_null(receiver):
    session, stream = Session(hc.free()), UdpStream(address(receiver))
    session.frames[-1] = session.frames[-1]._replace(v=(math.nan, -math.inf))
    with contextlib.closing(stream):
        stream.send(session)
    assert heard(receiver, 1)[0]["v"] == {"x": None, "y": None}


def test_nobody_listening_neither_blocks_nor_fails():
    """A port that nobody holds answers with an error, which a later send would raise."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    session, stream = Session(hc.free()), UdpStream(f"localhost:{port}")
    with contextlib.closing(stream):
        for _ in range(300):
            session.advance(FRAME_TIME)
            stream.send(session)
        assert not stream._socket.getblocking()
    session.advance(FRAME_TIME)
    stream.send(session)  # closed: dropped as well


@pytest.mark.parametrize(
    "text",
    ["", "localhost", ":9870", "localhost:", "localhost:x", "localhost:0", "h:65536", "h:-1"],
)
def test_bad_addresses_are_refused(text):
    with pytest.raises(ParameterError, match="stream = .*HOST:PORT, as in localhost:9870"):
        UdpStream(text)


def test_no_such_host_is_refused():
    with pytest.raises(ParameterError, match="stream = .*must name a host"):
        UdpStream("no such host.invalid:9870")


def test_view_refuses_before_it_opens_anything(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert app.main(["view", "constant", "--stream", "here"]) == 2
    assert "stream = 'here': must be HOST:PORT" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_loaded_unless_asked():
    code = (
        "import sys; import hapticclay as hc; from hapticclay.cli import view;"
        "from hapticclay.live.session import Session; s = Session(hc.free());\n"
        "with view.streaming(s, None): s.advance(0.1)\n"
        "assert s.stream is None; print('hapticclay.live.stream' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout == "False\n"
