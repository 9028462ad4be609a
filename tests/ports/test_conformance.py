"""What a program for a real Inverse3 relies on."""

import json
import math
import socket
import urllib.error
import urllib.request

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.formulas.arm import inverse_kinematics, jacobian, joint_torques
from hapticclay.model.constants import NOMINAL
from hapticclay.ports import ButtonScript, Inverse3, Trajectory, serve
from hapticclay.ports.driven_arm import TARGET_STIFFNESS
from hapticclay.ports.inverse import DEVICES
from tests.ports.conftest import SCENE, tick
from tests.waiting import PATIENCE, until

PERIOD = 0.005


def x_of(state):
    return state["cursor_position"]["x"]


def test_the_inventory_is_complete_and_first(served):
    _, client = served(period=PERIOD)
    first = client().first
    assert [len(first[k]) for k in DEVICES] == [1, 0, 0, 1, 0]
    device, grip = first["inverse3"][0], first["wireless_verse_grip"][0]
    assert {"device_id", "config", "state", "status"} == set(device) == set(grip)
    assert device["device_id"] == "04EA" and grip["device_id"] == "F00D"
    assert device["state"]["cursor_position"] == {"x": 0.08, "y": -0.15, "z": 0.14}


def test_one_answer_a_message_whatever_it_is(served):
    _, client = served(period=PERIOD)
    c = client()
    sent = ["{}", "rubbish", b"\xff\xfe", "[]", tick(device_id="05DA"), tick(), tick().encode()]
    for data in sent:
        frame = c.send(data)
        assert "config" not in frame["inverse3"][0]
    with pytest.raises(TimeoutError):
        c.socket.recv(timeout=0.05)


def test_the_configuration_comes_on_request(served):
    _, client = served(period=PERIOD)
    c = client()
    asked = {"session": {"force_render_full_state": {"device_types": ["inverse3"]}}}
    assert "config" in c.send(json.dumps(asked))["inverse3"][0]
    assert "config" not in c.send("{}")["inverse3"][0]


@pytest.mark.parametrize("key", ["values", "vector"])
def test_a_force_moves_the_handle_as_the_equation_of_motion_says(served, key):
    """Against the closed solution of a mass, damper and spring under a constant force.

    At this pose x and y of the arm do not couple; in 40 ms the handle moves by less than 1 mm, so
    that the mobility changes by less than 1 %.
    """
    scene = hc.Scenario(
        operator=hc.Operator(0.25, 2.0, 60.0),
        force=(0.0, 0.0),
        origin=NOMINAL,
        length=None,
    )
    _, client = served(scene, period=PERIOD)
    c = client()
    for _ in range(8):
        state = c.state(tick(x=1.0, key=key))
    m = 1.0 / scene.arm.nominal_mobility[0] + 0.25
    t = 8 * PERIOD - PERIOD / 14  # the newest sample
    decay, w = 1.0 / m, math.sqrt(60.0 / m - 1.0 / m**2)
    swing = math.exp(-decay * t) * (math.cos(w * t) + decay / w * math.sin(w * t))
    expected = (1.0 - swing) / 60.0
    assert x_of(state) - 0.08 == pytest.approx(expected, rel=0.01)
    assert state["current_cursor_force"] == {"x": 1.0, "y": 0.0, "z": 0.0}
    assert state["control_mode"] == state["mode"] != "idle"


def command(name, body, device_id="04EA"):
    return json.dumps({"inverse3": [{"device_id": device_id, "commands": {name: body}}]})


@pytest.mark.parametrize("key", ["values", "position"])
def test_a_place_is_held_against_the_spring_of_the_hand(served, key):
    """At rest the pull K (target - x) and the spring of the hand are equal."""
    _, client = served(period=4 * PERIOD)
    c, text = client(), {"x": 0.085, "y": -0.15, "z": 0.14}
    for _ in range(150):  # 3 s: ten times as long as the slowest mode takes to fall to 1/e
        state = c.state(command("set_cursor_position", {key: text}))
    K, way = TARGET_STIFFNESS, x_of(state) - 0.08
    assert way == pytest.approx(K * 0.005 / (K + 60.0), rel=1e-4)
    assert state["current_cursor_force"]["x"] == pytest.approx(60.0 * way, rel=1e-3)
    assert state["control_mode"] == "position" and state["control_domain"] == "cartesian"


def test_a_pull_to_a_far_place_is_shortened(served):
    _, client = served(period=PERIOD, inverse3=Inverse3(largest_force=2.0))
    state = client().state(command("set_cursor_position", {"position": {"x": 5.0, "y": -0.15}}))
    assert state["current_cursor_force"]["x"] == pytest.approx(2.0, rel=1e-6)


def test_torques_move_the_joints_as_the_force_that_they_stand_for(served):
    """J' f as torques of the joints, and f itself: one motion while the pose changes little."""
    scene = hc.Scenario(operator=hc.Operator(0.25, 2.0, 60.0), force=(0.0, 0.0))
    u = jacobian(*inverse_kinematics(*scene.origin, scene.arm.links), scene.arm.links)
    a0, a1 = joint_torques(1.0, 0.0, u)
    torques = {"torques": {"a0": a0, "a1": a1, "a2": 0.0}}
    seen = []
    for text in (command("set_angular_torques", torques), tick(x=1.0)):
        _, client = served(scene, period=PERIOD)
        c = client()
        for _ in range(8):
            state = c.state(text)
        seen.append(x_of(state) - 0.08)
        if "torques" in text:
            assert state["control_domain"] == "angular"
            assert state["current_angular_torques"]["a0"] == a0
    assert seen[0] == pytest.approx(seen[1], rel=1e-3) and seen[1] > 1e-4


def test_joint_angles_are_those_of_the_place(served):
    _, client = served(period=PERIOD, hand=Trajectory.to((0.03, 0.02)))
    c = client()
    for _ in range(20):
        state = c.state("{}")
    place, links = state["cursor_position"], SCENE.arm.links
    x, y = place["x"] - 0.08 + SCENE.origin[0], place["y"] + 0.15 + SCENE.origin[1]
    expected = [math.degrees(q) for q in inverse_kinematics(x, y, links)]
    angles = state["angular_position"]
    assert [angles["a0"], angles["a1"]] == pytest.approx(expected, abs=1e-9)


def test_an_arm_that_is_stretched_ends_and_still_answers(served):
    server, client = served(period=0.05, hand=Trajectory.to((3.0, 0.0)))
    c = client()
    for _ in range(200):
        c.send(tick(x=10.0))
        if server.service.device.ended:
            break
    assert server.service.device.ended
    assert c.send("{}")["inverse3"]


def test_two_entries_for_one_device_act_both(served):
    _, client = served(period=PERIOD)
    entry = json.loads(tick(x=1.0))["inverse3"][0]
    probe = {"device_id": "04EA", "commands": {"probe_position": {}}}
    state = client().state(json.dumps({"inverse3": [probe, entry, entry]}))
    assert state["current_cursor_force"]["x"] == 2.0


def test_a_force_is_shortened_and_echoed(served):
    _, client = served(period=PERIOD, inverse3=Inverse3(largest_force=5.0))
    force = client().state(tick(x=30.0, y=-40.0))["current_cursor_force"]
    assert [force["x"], force["y"]] == pytest.approx([3.0, -4.0], rel=1e-12)


@pytest.mark.parametrize("value", ["NaN", "Infinity", "true", '"2"'])
def test_a_force_that_is_not_finite_is_none(served, value):
    server, client = served(period=PERIOD)
    state = client().state(tick(x=3.0).replace("3.0", value))
    assert state["current_cursor_force"]["x"] == 0.0
    assert server.service.notices["force is not finite"] == 1


def test_two_clients_add(served):
    server, client = served(period=PERIOD)
    first, second = client(), client()
    second.send(tick(y=1.0))  # the first one moves the clock
    assert server.service.device.t == 0.0
    force = first.state(tick(x=2.0))["current_cursor_force"]
    assert (force["x"], force["y"]) == (2.0, 1.0)
    force = first.state(tick(x=2.0))["current_cursor_force"]
    assert (force["x"], force["y"]) == (2.0, 0.0)  # a command holds for one tick


def test_the_tick_clock_gives_the_same_run_to_the_last_bit():
    def run():
        with serve(SCENE, period=PERIOD, hand=Trajectory.to((0.02, 0.01))) as server:
            from tests.ports.conftest import Client

            c, x = Client(server.url), 0.0
            for _ in range(40):
                x = x_of(c.state(tick(x=-300.0 * (x - 0.081) if x > 0.081 else 0.0)))
            c.socket.close()
            return server.record()

    a, b = run(), run()
    assert np.array_equal(a.p, b.p) and np.array_equal(a.tau, b.tau) and len(a.t) > 500


def test_the_vertical_plane_and_the_force_that_cannot_act(served):
    server, client = served(period=PERIOD, inverse3=Inverse3(plane="xz"))
    c = client()
    for _ in range(4):
        state = c.state(tick(y=5.0, z=1.0))
    assert state["cursor_position"]["y"] == -0.15 and state["cursor_position"]["z"] > 0.14
    assert state["current_cursor_force"] == {"x": 0.0, "y": 0.0, "z": 1.0}
    assert any("cannot act" in notice for notice in server.service.notices)


def test_measured_as_the_hardware_measures(served):
    scene = hc.Scenario(
        operator=hc.Operator(0.25, 2.0, 60.0),
        force=(0.0, 0.0),
        control="sampled",
        hardware=hc.Hardware(encoder=500, velocity="difference"),
    )
    _, client = served(scene, period=PERIOD)
    c = client()
    seen = {c.state(tick(x=2.0))["cursor_position"]["x"] for _ in range(20)}
    assert 1 < len(seen) < 10  # counts of about 3 mm


def test_a_script_presses_the_buttons(served, tmp_path):
    (tmp_path / "b.csv").write_text("t,a,b,c,home\n0.01,1,0,0,0\n0.02,0,0,0,1\n")
    shown = Inverse3(buttons=ButtonScript.of_file(tmp_path / "b.csv"))
    _, client = served(period=PERIOD, inverse3=shown)
    c = client()
    frames = [c.send("{}")["wireless_verse_grip"][0]["state"]["buttons"] for _ in range(6)]
    assert [f["a"] for f in frames] == [False, False, True, True, False, False]
    assert (
        [f["home"] for f in frames] == [f["button_3"] for f in frames] == [False] * 4 + [True] * 2
    )


@pytest.mark.parametrize(
    "text", ["t,a\n0,1\n", "t,a,b,c,home\n1,0,0,0,0\n0,1,0,0,0\n", "t,a,b,c,home\n", "x"]
)
def test_bad_scripts_are_refused(text, tmp_path):
    (tmp_path / "b.csv").write_text(text)
    with pytest.raises(ParameterError, match="buttons"):
        ButtonScript.of_file(tmp_path / "b.csv")


def test_a_hand_follows_a_line_and_a_recorded_trial(served, tmp_path):
    """A stiff hand far from its natural frequency: within 1 mm of where it wants to be."""
    (tmp_path / "h.csv").write_text("t,x,y\n0,0,0\n0.5,0.01,0\n1,0.01,0.005\n")
    hand = Trajectory.of_file(tmp_path / "h.csv")
    assert hand.at(0.25) == ((0.005, 0.0), (0.02, 0.0)) and hand.at(9.0)[0] == (0.01, 0.005)
    scene = hc.Scenario(operator=hc.Operator(0.2, 150.0, 4000.0), force=(0.0, 0.0))
    _, client = served(scene, period=0.02, hand=hand)
    c = client()
    places = [c.state("{}")["cursor_position"] for _ in range(50)]
    for k in (12, 24, 49):
        (x, y), _ = hand.at(0.02 * (k + 1))
        assert places[k]["x"] - 0.08 == pytest.approx(x, abs=1e-3)
        assert places[k]["y"] + 0.15 == pytest.approx(y, abs=1e-3)
    with pytest.raises(ParameterError, match="spring"), serve(hc.Scenario(), hand=hand):
        pass


def test_http_beside_the_socket(served):
    server, client = served(period=PERIOD)
    client()
    url = server.url.replace("ws:", "http:")
    with urllib.request.urlopen(url + "/version") as answer:
        assert answer.headers["Content-Type"] == "application/json"
        assert json.load(answer)["data"]["project_name"] == "hapticclay"
    with urllib.request.urlopen(url + "/devices") as answer:
        found = json.load(answer)
    assert found["ok"] and found["data"]["inverse3"][0]["device_id"] == "04EA"
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(url + "/elsewhere")
    with refused.value as answer:
        assert answer.code == 404 and json.load(answer)["ok"] is False


def test_the_handshake_and_the_frames_as_bytes(served):
    """A header below 4 kB, no compression, one unfragmented text frame below 8 kB."""
    server, _ = served(period=PERIOD)
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as raw:
        raw.sendall(
            b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n"
            b"Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
            b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Extensions: permessage-deflate\r\n\r\n"
        )
        data = b""
        while b"\r\n\r\n" not in data or len(data.partition(b"\r\n\r\n")[2]) < 4:
            data += raw.recv(8192)
        head, _, frame = data.partition(b"\r\n\r\n")
        assert b" 101 " in head and len(head) < 4096 and b"deflate" not in head
        assert frame[0] == 0x81 and frame[1] == 126  # final, text; length in two bytes
        assert int.from_bytes(frame[2:4], "big") < 8000


def test_a_message_of_more_than_64_kB_ends_the_connection(served):
    _, client = served(period=PERIOD)
    c = client()
    c.socket.send(b" " * 70_000)
    with pytest.raises(ConnectionClosed) as closed:
        c.socket.recv(timeout=PATIENCE)
    assert closed.value.rcvd.code == 1009


def test_the_watchdog_takes_a_stale_force_away(served):
    server, client = served(clock="wall")
    c = client()
    until(lambda: c.state(tick(x=2.0))["current_cursor_force"]["x"] == 2.0)
    until(lambda: server.service.device.force == (0.0, 0.0))
    assert c.send("{}")["inverse3"][0]["state"]["control_mode"] == "idle"


def test_other_machines_need_the_token():
    with serve(SCENE, host="0.0.0.0", period=PERIOD) as server:
        bare, _, token = (f"http://127.0.0.1:{server.port}", "", server.url.partition("/?")[2])
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(bare + "/version")
        with refused.value as answer:
            assert answer.code == 403
        with urllib.request.urlopen(f"{bare}/version?{token}") as answer:
            assert answer.status == 200


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"clock": "sand"}, "clock"),
        ({"period": 0.0}, "period"),
        ({"port": 70_000}, "port"),
        ({"host": "a..b"}, "host"),
        ({"host": "no.such.host.invalid"}, "host"),
        ({"host": "192.0.2.1"}, "host"),  # of another machine
        ({"host": "x\0y"}, "host"),
        ({"host": 70 * "x"}, "host"),
        ({"host": 7}, "host"),
    ],
)
def test_bad_options_are_refused(options, field):
    with pytest.raises(ParameterError) as error, serve(SCENE, **options):
        pass
    assert error.value.field == field


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("device_id", "04eg"),
        ("grip_id", ""),
        ("plane", "yz"),
        ("largest_force", -1.0),
        ("origins", ("null",)),
        ("origins", ("localhost:8000",)),
        ("origins", ("http://localhost:8000/page",)),
        ("origins", (7,)),
        ("origins", "http://localhost:8000"),
    ],
)
def test_bad_names_are_refused(field, value):
    with pytest.raises(ParameterError) as error:
        Inverse3(**{field: value})
    assert error.value.field == field


def test_a_period_that_is_no_multiple_of_the_control_sample_is_refused():
    scene = hc.Scenario(control="sampled", Ts=0.002, dt=0.001, operator=hc.Operator())
    with pytest.raises(ParameterError, match="whole multiple"), serve(scene, period=0.005):
        pass


def test_a_taken_port_is_told():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(ParameterError, match="cannot listen on"), serve(SCENE, port=port):
            pass
