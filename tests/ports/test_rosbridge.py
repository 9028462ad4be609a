"""Rosbridge: messages as roslibpy sends them, topics of CRTK and of the drivers of a Touch."""

import json
import math
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.sync.client import connect

from hapticclay.ports import ButtonScript, Inverse3, Trajectory, loop_report, serve
from hapticclay.ports.rosbridge import (
    PUBLISHED,
    TAKEN,
    command_of,
    kind_of,
    read_operation,
    ros_message,
    ros_time,
)
from hapticclay.ports.service import REST, Service
from tests.ports.conftest import SCENE
from tests.ports.test_inverse import JSON
from tests.waiting import PATIENCE, until

PERIOD = 0.005
SHOWN = Inverse3(protocol="rosbridge", buttons=ButtonScript((0.0,), (frozenset({"a"}),)))


class RosClient:
    """Sends what roslibpy's Topic and Service send, key for key."""

    def __init__(self, url):
        self.socket, self.count = connect(url, compression=None), 0

    def send(self, op, name, **more):
        self.count += 1
        body = {"op": op, "id": f"{op}:{name}:{self.count}", **more}
        self.socket.send(json.dumps(body))
        return body["id"]

    def subscribe(self, topic, kind, throttle=0):
        more = {"compression": "none", "throttle_rate": throttle, "queue_length": 0}
        return self.send("subscribe", topic, type=kind, topic=topic, **more)

    def advertise(self, topic, kind):
        self.send("advertise", topic, type=kind, topic=topic, latch=False, queue_size=100)

    def publish(self, topic, msg):
        self.send("publish", topic, topic=topic, msg=msg, latch=False)

    def call(self, name, **args):
        self.send("call_service", name, service=name, args=args)
        return self.receive()

    def receive(self):
        return json.loads(self.socket.recv(timeout=PATIENCE))

    def wrench(self, x=0.0, y=0.0, z=0.0, topic="/arm/body/servo_cf"):
        force = {"x": x, "y": y, "z": z}
        self.publish(topic, {"wrench": {"force": force, "torque": {"x": 0.0, "y": 0.0, "z": 0.0}}})


@pytest.fixture
def ros():
    with serve(SCENE, period=PERIOD, inverse3=SHOWN) as server:
        client = RosClient(server.url)
        yield server, client
        client.socket.close()


@pytest.mark.parametrize("form", ["geometry_msgs/PoseStamped", "geometry_msgs/msg/PoseStamped"])
def test_a_crtk_client_pushes_and_sees_it_move(ros, form):
    server, client = ros
    client.subscribe("/arm/measured_cp", form)
    first = client.receive()
    assert first["op"] == "publish" and first["topic"] == "/arm/measured_cp"
    pose = first["msg"]["pose"]
    assert list(pose["position"].values()) == list(REST) and pose["orientation"]["w"] == 1.0
    client.advertise("/arm/body/servo_cf", "geometry_msgs/WrenchStamped")
    xs = []
    for _ in range(8):
        client.wrench(x=1.0)
        msg = client.receive()["msg"]
        xs.append(msg["pose"]["position"]["x"])
    assert xs == sorted(xs) and xs[-1] > REST[0] and len(set(xs)) == 8
    stamp = msg["header"]["stamp"]
    assert stamp["secs"] == stamp["sec"] == 0 and stamp["nsecs"] == stamp["nanosec"] > 3e7
    assert server.service.device.force == (1.0, 0.0)


def test_the_same_force_gives_the_run_of_the_inverse_protocol(ros):
    """One machinery: the record does not depend on the protocol."""
    server, client = ros
    for _ in range(10):
        client.wrench(x=1.0, y=-0.5)
    assert client.call("/rosapi/get_time")["result"] is True  # so all of them have arrived
    record = server.record()
    with serve(SCENE, period=PERIOD) as other, connect(other.url) as socket:
        socket.recv()
        force = {"set_cursor_force": {"vector": {"x": 1.0, "y": -0.5}}}
        for _ in range(10):
            entry = {"device_id": "04EA", "commands": force}
            socket.send(json.dumps({"inverse3": [entry]}))
            socket.recv()
        again = other.record()
    assert record.p.tolist() == again.p.tolist() and len(record.t) > 100


def test_a_driver_of_a_touch(ros):
    """Millimetres in the state, metres in the pose; the topics may have a namespace."""
    _, client = ros
    client.subscribe("/omni/phantom/pose", "geometry_msgs/PoseStamped")
    client.subscribe("/phantom/state", "omni_msgs/OmniState")
    client.subscribe("/phantom/button", "omni_msgs/OmniButtonEvent")
    client.subscribe("/phantom/joint_states", "sensor_msgs/JointState")
    seen = {}
    while len(seen) < 4:
        found = client.receive()
        seen[found["topic"]] = found["msg"]
    state, pose = seen["/phantom/state"], seen["/omni/phantom/pose"]["pose"]
    assert (
        state["pose"]["position"]["y"] == pytest.approx(-150.0) and pose["position"]["y"] == -0.15
    )
    assert state["locked"] is False and set(state["velocity"]) == {"x", "y", "z"}
    assert seen["/phantom/button"] == {"grey_button": 1, "white_button": 0}
    assert len(seen["/phantom/joint_states"]["position"]) == 2
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    feedback = {"force": {"x": 2.0, "y": 0.0, "z": 0.0}, "position": zero}
    client.publish("/phantom/force_feedback", feedback)
    moved = [client.receive() for _ in range(3)]
    assert {x["topic"] for x in moved} == set(seen) - {"/phantom/button"}  # which did not change


def test_velocity_is_the_rate_of_the_place(ros):
    """Differences of place over a period against the mean velocity, to the acceleration's share."""
    _, client = ros
    client.subscribe("/arm/measured_cp", "geometry_msgs/PoseStamped")
    client.subscribe("/arm/measured_cv", "geometry_msgs/TwistStamped")
    for _ in range(2):
        client.receive()
    x, v = [], []
    for _ in range(20):
        client.wrench(x=1.0)
        x.append(client.receive()["msg"]["pose"]["position"]["x"])
        v.append(client.receive()["msg"]["twist"]["linear"]["x"])
    change = (x[-1] - x[-2]) / PERIOD
    assert change == pytest.approx(0.5 * (v[-1] + v[-2]), rel=1e-3)


def test_unsubscribe_by_id_and_by_topic(ros):
    _, client = ros
    first = client.subscribe("/arm/measured_cp", "geometry_msgs/PoseStamped")
    client.subscribe("/arm/measured_cp", "geometry_msgs/PoseStamped")
    for _ in range(2):
        client.receive()
    client.socket.send(json.dumps({"op": "unsubscribe", "id": first, "topic": "/arm/measured_cp"}))
    client.wrench(x=1.0)
    assert client.receive()["topic"] == "/arm/measured_cp"
    client.socket.send(json.dumps({"op": "unsubscribe", "topic": "/arm/measured_cp"}))
    client.wrench(x=1.0)
    assert client.call("/rosapi/topics")["op"] == "service_response"


def test_a_throttled_topic_comes_less_often(ros):
    _, client = ros
    client.subscribe("/arm/measured_cp", "geometry_msgs/PoseStamped", throttle=20)
    client.receive()
    for _ in range(16):  # 80 ms
        client.wrench(x=0.5)
    client.call("/rosapi/topics")  # not in order, but behind them all
    stamps = []
    while True:
        try:
            found = json.loads(client.socket.recv(timeout=0.1))
        except TimeoutError:
            break
        if found["op"] == "publish":
            stamps.append(found["msg"]["header"]["stamp"]["nsecs"])
    assert 1 <= len(stamps) <= 4


def test_services_and_status(ros):
    server, client = ros
    topics = client.call("/rosapi/topics")
    assert topics["result"] is True and "/measured_cp" in topics["values"]["topics"]
    assert topics["id"] == "call_service:/rosapi/topics:1"
    kind = client.call("/rosapi/topic_type", topic="/arm/body/servo_cf")["values"]["type"]
    assert kind == "geometry_msgs/WrenchStamped"
    missing = client.call("/turtle1/teleport")
    assert missing["result"] is False and "does not exist" in missing["values"]
    client.subscribe("/arm/measured_cp", "std_msgs/String")
    wrong = client.receive()
    assert wrong["op"] == "status" and wrong["level"] == "error" and "is of type" in wrong["msg"]
    client.subscribe("/chatter", "std_msgs/String")  # a warning, which only some want
    client.socket.send(json.dumps({"op": "set_status_level", "level": "warning"}))
    client.subscribe("/chatter", "std_msgs/String")
    assert client.receive()["level"] == "warning"
    assert server.service.notices["nothing is published on /chatter"] == 2


@pytest.mark.parametrize("value", ["NaN", "Infinity", "true", '"2"', "null"])
def test_a_force_that_is_no_number_is_none(ros, value):
    server, client = ros
    msg = '{"op":"publish","topic":"/a/servo_cf","msg":{"wrench":{"force":{"x":%s}}}}' % value  # noqa: UP031
    client.socket.send(msg)
    assert client.receive()["level"] == "error"
    assert server.service.device.force == (0.0, 0.0) and server.service.device.t > 0.0


def test_rubbish_is_answered_with_an_error(ros):
    _, client = ros
    for data in (
        "x",
        "[]",
        "{}",
        '{"op":1}',
        '{"op":"fly"}',
        '{"op":"publish","topic":7}',
        b"\xff",
    ):
        client.socket.send(data)
        assert client.receive()["level"] == "error"


@given(st.binary(max_size=60) | st.text(max_size=60) | JSON.map(json.dumps))
def test_rubbish_is_read_without_an_error(data):
    operation = read_operation(data)
    assert operation.error or operation.op is not None
    for kind in TAKEN:
        command, _ = command_of(kind, operation.msg)
        vector = command.force or command.target
        assert vector is None or all(map(math.isfinite, vector))


OPERATION = st.fixed_dictionaries(
    {"op": st.sampled_from(["subscribe", "unsubscribe", "advertise", "publish", "call_service"])},
    optional={
        "id": JSON,
        "topic": st.sampled_from(["/arm/measured_cp", "/servo_cf", "/phantom/state"]) | JSON,
        "type": st.sampled_from(["geometry_msgs/PoseStamped"]) | JSON,
        "msg": JSON,
        "throttle_rate": JSON,
        "compression": JSON,
        "args": JSON,
        "service": JSON,
    },
)


@given(st.lists(OPERATION, max_size=4))
def test_operations_of_all_kinds_raise_nothing(operations):
    service = Service(Still(), clock="tick", inverse3=SHOWN)
    number, _ = service.connect()
    for operation in operations:
        for text in service.answer(number, json.dumps(operation)):
            json.loads(text)


class Still:
    """A device that does not move."""

    paced, force, torques, ended, t = False, (0.0, 0.0), (0.0, 0.0), "", 0.0
    scenario = SCENE

    def __init__(self):
        from hapticclay.ports.driven_arm import Sensed

        self.sensed = Sensed(0.0, (0.0, 0.0), (0.0, 0.0))

    def drive(self, drive):
        return drive.force

    def advance(self, samples=None):
        pass


@pytest.mark.parametrize("kind", PUBLISHED)
def test_messages_are_finite_json_with_a_stamp(kind):
    service = Service(Still(), clock="tick", inverse3=SHOWN)
    msg = ros_message(kind, service.cursor(), service.joints, frozenset(), 1.25)
    json.dumps(msg, allow_nan=False)
    assert kind == "phantom/button" or msg["header"]["stamp"]["nsecs"] == 250_000_000


def test_names_and_times():
    assert kind_of("/PSM1/body/servo_cf", TAKEN) == "body/servo_cf"
    assert kind_of("measured_cp", PUBLISHED) == "measured_cp"
    assert kind_of("/arm/not_measured_cp", PUBLISHED) == ""
    assert ros_time(-0.25) == {"secs": -1, "nsecs": 750_000_000, "sec": -1, "nanosec": 750_000_000}


def test_a_place_is_held(ros):
    server, client = ros
    pose = {"pose": {"position": {"x": 0.09, "y": -0.15, "z": 0.14}}}
    client.publish("/arm/servo_cp", pose)
    client.call("/rosapi/topics")
    assert server.service.device.force[0] > 0.0
    client.send("unadvertise", "/arm/servo_cp", topic="/arm/servo_cp")
    client.call("/rosapi/topics")
    assert server.exchanges[0].applied[0, 0] > 0.0


def test_states_come_by_themselves_in_real_time():
    """With the clock "wall" a subscriber that sends nothing sees the hand pull the handle."""
    hand = Trajectory.to((0.03, 0.0))
    with serve(SCENE, clock="wall", hand=hand, inverse3=SHOWN) as server:
        client = RosClient(server.url)
        begin = time.time()
        client.subscribe("/arm/measured_cp", "geometry_msgs/PoseStamped", throttle=10)
        found = [client.receive()["msg"] for _ in range(8)]
        client.socket.close()
    xs = [m["pose"]["position"]["x"] for m in found]
    assert xs == sorted(xs) and xs[-1] > xs[0]
    t = [m["header"]["stamp"]["secs"] + 1e-9 * m["header"]["stamp"]["nsecs"] for m in found]
    assert min(b - a for a, b in zip(t[:-1], t[1:], strict=True)) >= 0.01 - 1e-6
    assert abs(t[0] - begin) < 60.0  # of this computer's epoch, not of the run


def test_a_subscriber_renders_a_wall_and_the_report_tells_it():
    hand = Trajectory.to((0.05, 0.0))
    with serve(SCENE, period=PERIOD, hand=hand, inverse3=SHOWN) as server:
        client = RosClient(server.url)
        client.subscribe("/arm/measured_cp", "geometry_msgs/PoseStamped")
        for _ in range(150):
            x = client.receive()["msg"]["pose"]["position"]["x"]
            client.wrench(x=-300.0 * max(0.0, x - 0.085))
        client.receive()
        client.socket.close()
        report = loop_report(server.exchanges[0], SCENE)
    assert pytest.approx(300.0, rel=1e-3) == report.K
    assert report.verdict == "holds"


def test_a_silent_client_lets_the_arm_go():
    with serve(SCENE, clock="wall", inverse3=SHOWN) as server:
        client = RosClient(server.url)

        def pushed():
            client.wrench(x=2.0)
            return server.service.device.force == (2.0, 0.0)

        until(pushed, pause=0.001)
        until(lambda: server.service.device.force == (0.0, 0.0))
        client.socket.close()


PRESSES = ButtonScript((0.0, 0.012, 0.1), (frozenset(), frozenset({"a"}), frozenset()))


def test_a_press_reaches_each_subscriber_of_buttons_however_throttled():
    """The button goes down at 12 ms; the second topic is served each 50 ms at most."""
    shown = Inverse3(protocol="rosbridge", buttons=PRESSES)
    with serve(SCENE, period=PERIOD, inverse3=shown) as server:
        client = RosClient(server.url)
        client.subscribe("/phantom/button", "omni_msgs/OmniButtonEvent")
        client.subscribe("/left/phantom/button", "omni_msgs/OmniButtonEvent", throttle=50)
        for _ in range(30):  # 150 ms
            client.wrench()
        seen = {"/phantom/button": [], "/left/phantom/button": []}
        while min(map(len, seen.values())) < 3:
            message = client.receive()
            if message["op"] == "publish":
                seen[message["topic"]].append(message["msg"]["grey_button"])
        with pytest.raises(TimeoutError):
            client.socket.recv(timeout=0.1)
        client.socket.close()
    assert list(seen.values()) == [[0, 1, 0], [0, 1, 0]]
