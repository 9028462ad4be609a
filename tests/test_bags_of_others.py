"""Bags and MCAP files of several publishers, kinds and clocks: all that can be read is read."""

import json

import numpy as np
import pytest

import hapticclay as hc

pytest.importorskip("rosbags")
pytest.importorskip("mcap")

N, START = 200, 1_700_000_000_000_000_000
JOINTS, NUMBER = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64"
I = np.arange(N)  # noqa: E741
Q, U = np.column_stack((np.sin(0.018 * I), np.cos(0.01 * I))), np.cos(0.018 * I)


@pytest.fixture(scope="module")
def store():
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def joints(store, ns, names, place, effort=()):
    t = store.types
    time = t["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    return t[JOINTS](
        header=t["std_msgs/msg/Header"](stamp=time, frame_id=""),
        name=list(names),
        position=np.array(place, float),
        velocity=np.array([]),
        effort=np.array(effort, float),
    )


def bag(path, store, messages):
    from rosbags.rosbag2 import Writer

    with Writer(path, version=9) as writer:
        ways = {}
        for topic, kind, at, message in sorted(messages, key=lambda x: x[2]):
            if topic not in ways:
                ways[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(ways[topic], at, store.serialize_cdr(message, kind))
    return path


def of_arm(store, clock=START, without=()):
    return [
        ("/joint_states", JOINTS, START + 2_000_000 * i, joints(
            store, clock + 2_000_000 * i, ("j1", "j2"), Q[i], () if i in without else (U[i], 0.5)
        ))
        for i in range(N)
    ]  # fmt: skip


def test_two_publishers_of_a_topic_are_told_apart(store, tmp_path):
    """Joints of an arm at 500 Hz, of its gripper at 125 Hz."""
    fingers = [
        ("/joint_states", JOINTS, START + 8_000_000 * i + 700_000, joints(
            store, START + 8_000_000 * i + 700_000, ("finger",), (0.02 * i,)
        ))
        for i in range(N // 4)
    ]  # fmt: skip
    log = hc.Log.read(bag(tmp_path / "a", store, of_arm(store) + fingers))
    assert hc.studies.log_report(log).headline().endswith("200 rows, 0.398 s at 500 Hz")
    for k, name in enumerate(("j1", "j2")):
        np.testing.assert_array_equal(log.values(f"position.{name}"), Q[:, k])
    np.testing.assert_array_equal(log.values("effort.j1"), U)
    t, finger = log.values("stamp"), log.values("position.finger", holes=True)
    there = (t > 0.0007) & (t < 0.3927)
    np.testing.assert_array_equal(np.isfinite(finger), there)
    np.testing.assert_allclose(finger[there], 2.5 * (t[there] - 0.0007), atol=1e-6)
    assert "has 2 publishers: /joint_states, /joint_states#2" in log.table.notes[0]
    assert hc.Log.read(tmp_path / "a", table="/joint_states#2").rows == N // 4


@pytest.mark.parametrize("without", [(0,), (0, 1, 2), (7, 199)])
def test_messages_that_lack_a_field_have_missing_cells(store, tmp_path, without):
    log = hc.Log.read(bag(tmp_path / "a", store, of_arm(store, without=without)))
    assert log.rows == N
    effort = log.values("effort.j1", holes=True)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(effort)), without)
    remarks = dict(zip(log.names, hc.studies.log_report(log).table["remarks"], strict=True))
    assert remarks["effort.j1"] == f"{len(without)} missing"


@pytest.mark.parametrize("start", [10, 3 * START, 5_000_000_000_000])
def test_stamps_of_a_simulated_clock_are_from_their_own_start(store, tmp_path, start):
    commands = [
        ("/command", NUMBER, START + 2_000_000 * i + 100_000, store.types[NUMBER](data=float(i)))
        for i in range(N)
    ]
    start = start // 10**9 * 10**9 + 2_000_000_000  # whole seconds, in 32 bits
    start = min(start, 2_000_000_000 * 10**9)
    log = hc.Log.read(bag(tmp_path / "a", store, of_arm(store, start) + commands))
    np.testing.assert_allclose(log.values("stamp"), 2e-3 * I, atol=1e-12)
    # by the times of reception, 0.1 ms after those of the joints
    command = log.values("/command.data", holes=True)
    np.testing.assert_allclose(command[1:], I[1:] - 0.05, atol=1e-6)
    assert "another clock" in log.table.notes[0]


def mcap(path, channels, messages):
    """A file of channels (topic, encoding, schema's name, its encoding, its text)."""
    from mcap.writer import Writer

    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        ids = {}
        for topic, encoding, kind, form, text in channels:
            schema = writer.register_schema(kind, form, text) if kind else 0
            ids[topic] = writer.register_channel(topic, encoding, schema)
        for topic, at, data in messages:
            writer.add_message(ids[topic], at, data, at)
        writer.finish()
    return path


def arm_and(store, topic, *kind):
    """Channels and messages of an arm in JSON and CDR, beside a topic that cannot be read."""
    text = store.generate_msgdef(JOINTS, ros_version=2)[0].encode()
    channels = [
        ("/wrench", "json", "", "", b""),
        ("/joint_states", "cdr", JOINTS, "ros2msg", text),
        (topic, *kind),
    ]
    messages = []
    for i, (_, _, at, message) in enumerate(of_arm(store)):
        messages += [
            ("/wrench", at, json.dumps({"force": {"x": 0.1 * (i % 7)}}).encode()),
            ("/joint_states", at, bytes(store.serialize_cdr(message, JOINTS))),
            (topic, at, b"\0\1\0\0" + bytes(8)),
        ]
    return channels, messages


@pytest.mark.parametrize(
    "kind, why",
    [
        (("protobuf", "x.Pose", "protobuf", b""), "protobuf"),
        (("", "", "", b""), "without an encoding"),
        (("cdr", "pkg/srv/Event", "ros2msg", b"MSG: a\nMSG: a\nint64 a\n"), "cannot be parsed"),
        (("cdr", "pkg/msg/A", "ros2msg", b"pkg/Unknown x\n"), "cannot be read"),
        (("flatbuffer", "F", "flatbuffer", b"\1\2"), "flatbuffer"),
    ],
)
def test_one_topic_that_cannot_be_read_does_not_refuse_the_others(store, tmp_path, kind, why):
    log = hc.Log.read(mcap(tmp_path / "a.mcap", *arm_and(store, "/other", *kind)))
    assert log.rows == N
    np.testing.assert_array_equal(log.values("/joint_states.position.j2"), Q[:, 1])
    np.testing.assert_allclose(log.values("/wrench.force.x"), 0.1 * (I % 7))
    notes = [x for x in log.table.notes if "/other" in x]
    assert len(notes) == 1 and why in notes[0]
    for topic, rows in (("/wrench", N), ("/joint_states", N)):
        assert hc.Log.read(tmp_path / "a.mcap", table=topic).rows == rows
    with pytest.raises(hc.ParameterError, match="must be one of /wrench, /joint_states"):
        hc.Log.read(tmp_path / "a.mcap", table="/other")


def test_a_file_of_which_nothing_can_be_read_says_what_it_holds(tmp_path):
    channels = [("/pose", "protobuf", "x.Pose", "protobuf", b"")]
    path = mcap(tmp_path / "a.mcap", channels, [("/pose", i, b"\x08\x01") for i in range(5)])
    with pytest.raises(hc.ParameterError, match="numbers, of JSON or ROS; /pose: protobuf"):
        hc.Log.read(path)


def test_messages_that_are_damaged_are_counted(store, tmp_path):
    channels, messages = arm_and(store, "/other", "json", "", "", b"")
    messages = [(t, at, b"{" if t == "/wrench" and at % 50 == 0 and at < START + 10**7 else x)
                for t, at, x in messages]  # fmt: skip
    log = hc.Log.read(mcap(tmp_path / "a.mcap", channels, messages))
    assert any("topic /wrench: 5 of 200 messages cannot be read" in x for x in log.table.notes)
    assert log.rows == N
