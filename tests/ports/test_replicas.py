"""The loops of public clients, written anew: what they read, in their order, text or binary.

Each reads the fields that the program reads, by index where the program indexes.
"""

import json

import pytest
from websockets.sync.client import connect

import hapticclay as hc
from hapticclay.ports import ButtonScript, Inverse3, Trajectory, serve
from tests.waiting import PATIENCE

SCENE = hc.Scenario(operator=hc.Operator(0.25, 2.0, 60.0), force=(0.0, 0.0))
HAND = Trajectory.to((0.03, 0.0))
PRESSED = ButtonScript((0.0,), (frozenset({"a"}),))


@pytest.fixture
def url():
    shown = Inverse3(device_id="05DA", buttons=PRESSED)
    with serve(SCENE, period=0.005, hand=HAND, inverse3=shown) as server:
        yield server.url


def isaac_lab(url, steps):
    """Receives first; ids of the first message alone; force in "values"; Python's websockets."""
    seen, force, device_id, first = [], (0.0, 0.0, 0.0), None, True
    with connect(url, ping_interval=None) as ws:
        for _ in range(steps):
            data = json.loads(ws.recv(timeout=PATIENCE))
            inverse3 = data.get("inverse3", [])
            grips = data.get("wireless_verse_grip", [])
            if first:
                device_id = inverse3[0].get("device_id") if inverse3 else None
                first = False
            position = inverse3[0]["state"].get("cursor_position", {}) if inverse3 else {}
            assert position and grips and "state" in grips[0], "it counts as not connected"
            state = grips[0]["state"]
            turned = state.get("orientation", {})
            buttons = {name: state.get("buttons", {}).get(name, False) for name in ("a", "b", "c")}
            quaternion = [turned.get(k, 0.0) for k in ("x", "y", "z", "w")]
            seen.append(([position.get(k, 0.0) for k in "xyz"], quaternion, buttons))
            if device_id:
                values = dict(zip("xyz", force, strict=True))
                command = {"set_cursor_force": {"values": values}}
                ws.send(json.dumps({"inverse3": [{"device_id": device_id, "commands": command}]}))
            force = (-1.0, 0.0, 0.0)
    return seen


def test_isaac_lab(url):
    seen = isaac_lab(url, 60)
    assert seen[0][0] == [0.08, -0.15, 0.14] and seen[-1][0][0] != 0.08
    assert seen[-1][1] == [0.0, 0.0, 0.0, 1.0]
    assert seen[-1][2] == {"a": True, "b": False, "c": False}


def test_isaac_teleop(url):
    """Integers for a zero force, button_0 to button_3, handedness of the first frame alone."""
    with connect(url) as ws:
        hands = []
        for k in range(10):
            device = json.loads(ws.recv())["inverse3"][0]
            if k == 0:
                assert device["config"]["handedness"] in ("left", "right")
            state = device["state"]
            hands.append([state["cursor_position"]["x"], state["cursor_velocity"]["x"]])
            zero = {"set_cursor_force": {"values": {"x": 0, "y": 0, "z": 0}}}
            name = device["device_id"]
            ws.send(json.dumps({"inverse3": [{"device_id": name, "commands": zero}]}))
        pressed = json.loads(ws.recv())["wireless_verse_grip"][0]["state"]["buttons"]
    assert [pressed[f"button_{i}"] for i in range(4)] == [True, False, False, False]
    assert hands[-1][0] > hands[0][0] and hands[-1][1] > 0.0  # the hand pulls it along


def test_sofa(url):
    """Session first; two entries for one device; velocity and every wired grip are required."""
    with connect(url) as ws:
        ws.recv()
        ws.send(json.dumps({"session": {"force_render_full_state": {}}}))
        name = json.loads(ws.recv())["inverse3"][0]["device_id"]
        for _ in range(5):
            push = {"set_cursor_force": {"values": {"x": 2.0, "y": 0.0, "z": 0.0}}}
            entries = [
                {"device_id": name, "commands": {"probe_position": {}}},
                {"device_id": name, "commands": push},
            ]
            ws.send(json.dumps({"inverse3": entries}))
            frame = json.loads(ws.recv())
            for grip in frame["verse_grip"]:
                assert grip["state"]["orientation"] and "button" in grip["state"]
            state = frame["inverse3"][0]["state"]
            assert set(state["cursor_velocity"]) == {"x", "y", "z"}
    assert state["current_cursor_force"]["x"] == 2.0


def test_saw_haply_service(url):
    """Hexadecimal serial, calibrated, text frames alone; sends without waiting for an answer."""
    with connect(url) as ws:
        frame = ws.recv()
        assert isinstance(frame, str)
        device = json.loads(frame)["inverse3"][0]
        assert int(device["device_id"], 16) == 0x05DA and device["status"]["calibrated"] is True
        for _ in range(20):
            push = {"set_cursor_force": {"values": {"x": 1.0, "y": 0.0, "z": 0.0}}}
            ws.send(json.dumps({"inverse3": [{"device_id": "05DA", "commands": push}]}))
        answers = [json.loads(ws.recv(timeout=PATIENCE)) for _ in range(20)]
    xs = [a["inverse3"][0]["state"]["cursor_position"]["x"] for a in answers]
    assert xs == sorted(xs) and len(set(xs)) == 20


def test_ros2_driver(url):
    """Binary frames, two messages under way, reads port and battery."""
    with connect(url) as ws:
        first = json.loads(ws.recv())
        assert first["inverse3"][0]["config"]["port"]
        assert first["wireless_verse_grip"][0]["state"]["battery_level"] > 0.0
        full = {"session": {"force_render_full_state": {"device_types": ["inverse3"]}}}
        probe = {"inverse3": [{"device_id": "05DA", "commands": {"probe_position": {}}}]}
        ws.send(json.dumps(full).encode())
        ws.send(json.dumps(probe).encode())
        for _ in range(10):
            ws.send(json.dumps(probe).encode())
            frame = json.loads(ws.recv(timeout=PATIENCE))
            assert frame["inverse3"][0]["state"]["cursor_position"]["x"] >= 0.08


def test_tutorial_and_examples_of_haply(url):
    """Sends first, so it stays a frame behind; strict indices; a fixed id; binary frames."""
    with connect(url) as ws:
        xs, push = [], {"x": 0.0, "y": 0.0, "z": 0.0}
        for _ in range(10):
            command = {"set_cursor_force": {"values": push}}
            message = {"inverse3": [{"device_id": "05DA", "commands": command}]}
            ws.send(json.dumps(message).encode())
            frame = json.loads(ws.recv())
            assert frame["inverse3"], "it would leave here"
            position = frame["inverse3"][0]["state"]["cursor_position"]
            assert frame["wireless_verse_grip"][0]["state"]["buttons"]["a"] is True
            xs.append(position["x"])
    assert xs[0] == 0.08 and xs[2] > 0.08


def test_one_read_of_8192_bytes_takes_a_frame(url):
    """As the Unity client reads: every array is there, and a frame fits."""
    with connect(url) as ws:
        frame = ws.recv()
        assert len(frame.encode()) < 8192
        tree = json.loads(frame)
    for kind in ("inverse3", "minverse", "verse_grip", "wireless_verse_grip", "custom_verse_grip"):
        for entry in tree[kind]:
            assert entry["device_id"]


def test_an_empty_command_keeps_alive(url):
    """As the Rust crate does."""
    with connect(url) as ws:
        ws.recv()
        ws.send(json.dumps({"inverse3": [{"device_id": "05DA", "commands": {}}]}))
        state = json.loads(ws.recv())["inverse3"][0]["state"]
    assert state["control_mode"] == "idle"
