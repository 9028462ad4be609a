"""The messages of the Inverse service: what is sent, what is read, and rubbish."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.ports.commands import Command
from hapticclay.ports.inverse import (
    DEVICES,
    Cursor,
    Force,
    Frame,
    Message,
    Target,
    Torques,
    frame_data,
    frame_text,
    message_text,
    read_frame,
    read_message,
)

FINITE = st.floats(-1e6, 1e6)
VECTOR = st.tuples(FINITE, FINITE, FINITE)
PLACE = st.tuples(*[st.floats(-1e3, 1e3)] * 3)
ID = st.text("0123456789ABCDEF", min_size=4, max_size=4)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                [*DEVICES, "session", "device_id", "commands", "set_cursor_force", "values", "x"]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=20,
)
TICK = '{"inverse3":[{"device_id":"04EA","commands":{"set_cursor_force":{"%s":%s}}}]}'


@given(st.lists(st.builds(Force, ID, VECTOR), max_size=3), st.booleans(), st.text(max_size=9))
def test_a_message_is_read_as_it_was_sent(forces, full, profile):
    sent = Message(tuple(forces), tuple(f.device_id for f in forces), full, profile)
    assert read_message(message_text(sent)) == sent
    assert read_message(message_text(sent).encode()) == sent


@given(ID, PLACE, VECTOR)
def test_places_and_torques_are_read_as_they_were_sent(name, place, torques):
    both = (Target(name, place),), (Torques(name, torques),)
    sent = Message(devices=(name, name), targets=both[0], torques=both[1])
    assert read_message(message_text(sent)) == sent


@pytest.mark.parametrize(
    ("body", "command"),
    [
        (
            '"set_cursor_position":{"values":{"x":0.1,"y":0,"z":-1}}',
            Command(None, (0.1, 0.0, -1.0)),
        ),
        ('"set_cursor_position":{"position":{"x":0.1}}', Command(None, (0.1, 0.0, 0.0))),
        ('"set_cursor_position":{"position":{"x":NaN}}', Command()),  # no place is no target
        (
            '"set_angular_torques":{"torques":{"a0":1,"a1":2,"a2":3}}',
            Command(torques=(1.0, 2.0, 3.0)),
        ),
        ('"set_angular_torques":{"torques":{"a1":2}}', Command(torques=(0.0, 2.0, 0.0))),
        ('"set_angular_torques":{"torques":{"a0":"much"}}', Command(torques=(0.0, 0.0, 0.0))),
    ],
)
def test_places_and_torques_of_all_versions(body, command):
    message = read_message('{"inverse3":[{"device_id":"04EA","commands":{%s}}]}' % body)  # noqa: UP031
    assert message.command("04EA") == command
    assert message.command("05DA") == Command()


@given(ID, PLACE, PLACE, VECTOR, st.sets(st.sampled_from(["a", "b", "c", "home"])))
def test_a_frame_is_read_as_it_was_sent(name, position, velocity, force, buttons):
    joints = (1.0, -2.5, 90.0), (0.5, 3.0, -7.0), (0.1, -0.2, 0.3)
    cursor = Cursor(position, velocity, force, "torque", *joints)
    sent = Frame(name, cursor, "F00D", frozenset(buttons), 3, True)
    assert read_frame(frame_text(sent)) == sent


@given(st.binary(max_size=60) | st.text(max_size=60) | JSON.map(json.dumps))
def test_rubbish_is_read_without_an_error(data):
    message = read_message(data)
    assert all(math.isfinite(x) for f in message.forces for x in f.vector)
    assert message.forces or message.devices or message.notices or isinstance(data, str | bytes)
    found = read_frame(data)
    assert found is None or all(map(math.isfinite, found.cursor.position))


@pytest.mark.parametrize("key", ["values", "vector"])
def test_both_keys_of_a_force(key):
    message = read_message(TICK % (key, '{"x": 1, "y": -1.5}'))
    assert message == Message((Force("04EA", (1.0, -1.5, 0.0)),), ("04EA",))


@pytest.mark.parametrize("value", ["NaN", "Infinity", "true", '"1"', "null", "1" + "0" * 400])
def test_a_force_that_is_no_finite_number_is_none(value):
    message = read_message(TICK % ("values", f'{{"x": {value}}}'))
    assert message.command("04EA").force == (0.0, 0.0, 0.0)
    assert message.notices == ("force is not finite",)


def test_entries_for_one_device_add_up():
    probe = {"device_id": "04EA", "commands": {"probe_position": {}}}
    push = {"device_id": "04EA", "commands": {"set_cursor_force": {"vector": {"x": 1.0}}}}
    message = read_message(json.dumps({"inverse3": [probe, push, push]}))
    assert message.command("04EA").force == (2.0, 0.0, 0.0) and not message.notices
    assert message.command("05DA").force is None


def test_what_is_left_out_is_told_once_each():
    tree = {
        "camera": 1,
        "inverse3": [
            {"device_id": "04EA", "commands": {"fly": {}, "set_cursor_position": {}}},
            {"commands": {}},
            7,
        ],
        "session": {"noise": 1},
    }
    assert set(read_message(json.dumps(tree)).notices) == {
        "unknown key camera",
        "unknown key session.noise",
        "command fly is not simulated",
        "set_cursor_position without position",
        "inverse3 without device_id",
        "entry of inverse3 is no object",
    }
    assert read_message("[" * 100_000).notices == ("not JSON",)
    assert read_message("[]").notices == ("not an object",)


def test_a_frame_has_what_strict_clients_index():
    data = frame_data(Frame("04EA", Cursor((0.08, -0.15, 0.14)), "F00D", full=True))
    assert [k for k in DEVICES if not isinstance(data[k], list)] == []
    device, grip = data["inverse3"][0], data["wireless_verse_grip"][0]
    assert int(device["device_id"], 16) == 0x04EA and device["status"]["calibrated"] is True
    assert device["state"]["control_mode"] == device["state"]["mode"] == "idle"
    assert {"a", "b", "c", "home", "button_0", "button_3"} <= set(grip["state"]["buttons"])
    assert device["config"]["handedness"] == "right" and device["config"]["port"]
    assert len(json.dumps(data)) < 8192
    later = frame_data(Frame("04EA", Cursor((0.08, -0.15, 0.14)), "F00D"))
    assert "config" not in later["inverse3"][0] and "config" not in later["wireless_verse_grip"][0]
