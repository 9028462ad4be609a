"""Sessions beside a device: an arm that programs drive, and a hand that is a device."""

import dataclasses
import json
import math
from contextlib import contextmanager

import numpy as np
import pytest
from websockets.sync.client import connect

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.cli.view import ViewCommand
from hapticclay.errors import ParameterError
from hapticclay.live.clock import FRAME_TIME
from hapticclay.live.device_sessions import SERVED_SPAN, DeviceSession, LiveDevice, ServedSession
from hapticclay.live.player import Player
from hapticclay.model.constants import NOMINAL
from hapticclay.ports import Coupled, DeviceClient, Limits, Trajectory, serve
from hapticclay.ports.coupled import DeviceHand
from hapticclay.ports.driven_arm import Drive
from hapticclay.ports.server import DeviceServer
from hapticclay.ports.service import Service
from hapticclay.views.window import Window
from tests.waiting import until

HAND = hc.Scenario(operator=hc.Operator(0.25, 2.0, 300.0), force=(0.0, 0.0))
FREE = hc.free()


def tick(x=0.0):
    force = {"set_cursor_force": {"values": {"x": x, "y": 0.0, "z": 0.0}}}
    return json.dumps({"inverse3": [{"device_id": "04EA", "commands": force}]})


# ---- an arm that programs drive ------------------------------------------------------------------


def test_a_force_moves_the_arm_of_a_session_as_the_equation_of_motion_says():
    """A mass, damper and spring under a constant force; x and y do not couple at this pose.

    The pose changes by less than 1 % of a link in 40 ms, and with it the mobility.
    """
    scene = hc.Scenario(force=(0.0, 0.0), origin=NOMINAL, length=None)
    session = ServedSession(scene, stiffness=10.0)
    session.pull((0.0, 0.0))
    session.arm.drive(Drive(force=(1.0, 0.0)))
    while session.t < 0.04:
        session.advance(SERVED_SPAN)
    m, k = 1.0 / scene.arm.nominal_mobility[0] + 0.25, 60.0
    decay = math.sqrt(10.0) / m  # half of 2 sqrt(10) N.s/m, over m
    w, t = math.sqrt(k / m - decay**2), session.t
    swing = math.exp(-decay * t) * (math.cos(w * t) + decay / w * math.sin(w * t))
    assert session.handle()[0][0] == pytest.approx((1.0 - swing) / k, rel=0.01)


def test_frames_are_kept_as_often_as_pictures_need_them():
    session = ServedSession(FREE)
    for _ in range(200):
        session.advance(SERVED_SPAN)
    assert len(session.frames) == pytest.approx(0.4 / FRAME_TIME, abs=4)
    assert min(np.diff([f.t for f in session.frames])) >= FRAME_TIME - 1e-9


@contextmanager
def played(session):
    """The session in real time, behind a server."""
    session.service = Service(LiveDevice(session), clock="wall")
    player = Player(session)
    with DeviceServer(session.service) as server:
        player.start()
        try:
            yield server, player
        finally:
            player.stop()


def test_programs_drive_the_arm_while_the_mouse_is_the_hand(tmp_path):
    session = ServedSession(FREE, stiffness=10.0)
    with played(session) as (server, player), connect(server.url) as socket:
        first = json.loads(socket.recv())["inverse3"][0]["state"]["cursor_position"]

        def pushed():
            socket.send(tick(2.0))
            state = json.loads(socket.recv())["inverse3"][0]["state"]
            is_away = state["cursor_position"]["x"] >= first["x"] + 1e-3
            return is_away and state["current_cursor_force"]["x"] == 2.0

        until(pushed, pause=0.0)
        with player.lock:
            sight = Window(session).look([], (0.0, 0.03))  # the mouse pulls along y
            assert sight.writing.verdict.startswith("1 program drives the arm")
        until(lambda: session.arm.force == (0.0, 0.0))  # the watchdog
        y = session.handle()[0][1]

        def pulled():
            with player.lock:
                session.pull((0.0, 0.2))
            return session.handle()[0][1] >= y + 1e-4

        until(pulled)
        with player.lock:
            session.restart()
        socket.send("{}")
        assert json.loads(socket.recv())["inverse3"]
    record = session.record()
    assert record.scenario.controller is None and record.scenario.control == "sampled"
    assert hc.Record.load(record.save(tmp_path)).p.shape == record.p.shape


def test_the_clay_acts_beside_the_program():
    """Pushed by one force, the handle is slower in clay."""
    went = []
    for scene in (FREE, hc.constant_cut(b=90.0)):
        session = ServedSession(dataclasses.replace(scene, start=(0.08, 0.0)))
        session.arm.drive(Drive(force=(5.0, 0.0)))
        start = session.handle()[0][0]
        while session.t < 0.2:
            session.advance(SERVED_SPAN)
        went.append(session.handle()[0][0] - start)
    assert 0.0 < went[1] < 0.5 * went[0]


def test_keys_change_the_clay_of_a_served_arm_and_choose_another_scene():
    session = ServedSession(hc.constant_cut(b=90.0), stiffness=10.0)
    window = Window(session)
    session.pull((0.12, 0.0))
    for key in (262, 265, ord("2")):  # right, up, the variable cut
        session.arm.drive(Drive(force=(2.0, 0.0)))
        for _ in range(20):
            session.advance(SERVED_SPAN)
        before = session.damping
        window.look([key], (0.1, 0.0))
        assert session.damping == (1.25 * before if key == 262 else before if key == 265 else 1.0)
        session.advance(SERVED_SPAN)
        assert not session.ended
    assert session.given.name == "variable" and session.arm.force == (0.0, 0.0)


def test_accurate_scenes_are_refused():
    with pytest.raises(ParameterError, match="session"):
        ServedSession(dataclasses.replace(FREE, integrator="accurate"))


# ---- a hand that is a device ---------------------------------------------------------------------

PERIOD = 0.01
LIMITS = Limits(period=PERIOD, largest_force=10.0, ramp=0.2, patience=1.0)


@pytest.fixture
def device_hand():
    """A simulated device whose hand follows a line."""
    hand = Trajectory((0.0, 2.0), ((0.0, 0.0), (0.14, 0.0)))
    with (
        serve(HAND, period=PERIOD, hand=hand) as server,
        DeviceClient(server.url, LIMITS) as client,
    ):
        yield DeviceHand(client, Coupled(), (0.0, 0.0)), server


def slices(session, n):
    """What a player does, by the clock of the device."""
    for _ in range(n):
        session.partner.exchange()
        session.partner.before_slice(session)
        session.advance(PERIOD)
        session.partner.after_slice(session)


def test_the_device_pulls_the_handle_through_the_clay_and_feels_it(device_hand):
    hand, server = device_hand
    session = DeviceSession(hc.constant_cut(b=30.0), hand)
    slices(session, 140)
    record = session.record()
    inside = record.b[:, 0] > 0.0
    assert inside.any() and record.p[-1, 0] > 0.07
    rows = server.exchanges[0]
    assert rows.asked[-1, 0] < -0.5 and np.abs(rows.asked[:51]).max() == 0.0
    # what the device feels is the clay, and the damper 10/K of the compensator
    v = record.v[-1, 0]
    assert -rows.asked[-1, 0] == pytest.approx((30.0 + 10.0) * v, rel=0.1)
    notes = record.notes["device"]
    assert notes["exchanges"] > 140 and notes["coupling_K"] == 300.0
    place = np.array([r.position[0] for r in hand.client.log.rows])
    assert record.extra["target"][-1, 0] == pytest.approx(place[-1] - place[51], abs=2e-3)


def test_a_paused_session_gives_the_device_no_force(device_hand):
    hand, server = device_hand
    session = DeviceSession(hc.constant_cut(b=30.0), hand)
    slices(session, 60)
    for _ in range(3):  # a player that does not advance
        session.partner.exchange()
    asked = server.exchanges[0].asked
    assert abs(asked[-3, 0]) > 0.0  # of the last slice
    assert np.all(asked[-2:] == 0.0)
    slices(session, 12)  # goes on: from nothing, over the ramp of 0.2 s
    after = np.abs(server.exchanges[0].asked[len(asked) :, 0])
    assert np.all(after[:2] == 0.0) and np.all(after <= 0.05 * np.arange(12) * 10.0 + 1e-12)
    assert after[-1] > 0.0


def test_a_restart_begins_where_the_device_is_and_forces_rise_from_nothing(device_hand):
    """The device is 3 cm on by then, where 300 N/m would pull with 9 N at once."""
    hand, server = device_hand
    session = DeviceSession(FREE, hand)
    slices(session, 60)
    assert hand.place[0] > 0.03
    session.restart()
    before = len(server.exchanges[0])
    slices(session, 12)
    after = np.abs(server.exchanges[0].asked[before + 1 :, 0])  # the first is of the old run
    assert np.all(after <= 0.05 * np.arange(1, 12) * 10.0 + 1e-12) and after[0] < 0.1
    place = [row.position[0] for row in hand.client.log.rows[before:]]
    assert hand.place[0] == pytest.approx(place[-1] - place[0], abs=1e-12)


def test_a_lost_device_lets_go(device_hand):
    hand, server = device_hand
    session = DeviceSession(FREE, hand)
    slices(session, 20)
    assert session.point is not None
    server.close()
    slices(session, 3)
    assert session.point is None and hand.client.lost
    assert session.run.pull.damper_force == (0.0, 0.0)


def test_a_player_paces_itself_by_the_device():
    limits = Limits(rate=200.0, patience=1.0)
    with serve(HAND, clock="wall") as server, DeviceClient(server.url, limits) as client:
        session = DeviceSession(FREE, DeviceHand(client, Coupled(), (0.0, 0.0)))
        before = len(client.log)
        player = Player(session)
        player.start()
        until(lambda: len(client.log) >= before + 40)
        player.stop()
        assert client.log.timing().rate < 201.0


# ---- the command ---------------------------------------------------------------------------------


def test_view_serves_the_arm_and_reports_the_loop(tmp_path, monkeypatch, capsys):
    def play(command, session):
        (port,) = [int(x) for x in session_port(capsys)]
        player = Player(session)
        player.start()
        with connect(f"ws://127.0.0.1:{port}") as socket:
            socket.recv()
            for _ in range(30):
                socket.send(tick(0.5))
                socket.recv()
        player.stop()

    def session_port(capsys):
        text = capsys.readouterr().out
        return [text.rpartition(":")[2].strip()]

    monkeypatch.setattr(ViewCommand, "_play", play)
    words = ["view", "free", "--device-server", "--device-port", "0", "--no-plots"]
    assert app.main([*words, "--out", str(tmp_path)]) == 0
    assert "30 messages" in capsys.readouterr().out
    assert {"exchanges.csv", "loop.json", "record.npz"} <= {f.name for f in tmp_path.iterdir()}


def test_view_takes_a_device_as_the_hand(tmp_path, monkeypatch, capsys):
    def play(command, session):
        player = Player(session)
        player.start()
        until(lambda: session.t >= 0.3)
        player.stop()

    monkeypatch.setattr(ViewCommand, "_play", play)
    with serve(HAND, clock="wall") as server:
        words = ["view", "free", "--device", server.url, "--device-rate", "250", "--no-plots"]
        assert app.main([*words, "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "device 04EA is the hand" in out and "exchanges at" in out
    head = (tmp_path / "device.csv").read_text().splitlines()[0]
    assert head == "t_s,x_m,y_m,z_m,fx_N,fy_N,fz_N"
    assert hc.Record.load(tmp_path).notes["device"]["rate_hz"] > 0.0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--device", "ws://127.0.0.1:9"], "must be an Inverse service"),
        (["--device", "ws://127.0.0.1:9", "--coupling", "900", "0.1"], "must be K Ts/2"),
        (["--device", "ws://127.0.0.1:9", "--device-server"], "cannot be served beside it"),
        (["--device-server", "--device-port", "70000"], "port"),
    ],
)
def test_bad_devices_are_refused(words, told, capsys):
    assert app.main(["view", "free", *words, "--no-plots"]) == 2
    assert told in capsys.readouterr().err
