"""Clients that vanish, send rubbish or do not read: the arm goes limp, the others go on."""

import contextlib
import json
import math
import random
import socket
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed

from benchmarks import device_faults
from hapticclay.ports import Inverse3, serve
from hapticclay.ports.device import SimulatedDevice
from hapticclay.ports.rows import CHUNK, Rows
from hapticclay.ports.server import DeviceServer
from hapticclay.ports.service import MOST_LOGS, Service
from tests.ports.conftest import SCENE, Client, tick
from tests.waiting import PATIENCE, until


def limp(server):
    return until(lambda: server.service.device.force == (0.0, 0.0))


def test_a_client_that_is_killed_leaves_no_force(served):
    server, client = served(clock="wall")
    c, other = client(), client()
    c.send(tick(x=3.0))
    c.socket.socket.shutdown(socket.SHUT_RDWR)  # no closing handshake
    assert limp(server)
    assert other.send("{}")["inverse3"]


def test_a_client_that_is_killed_leaves_no_force_to_the_tick_clock(served):
    server, client = served(period=0.005)
    c = client()
    c.send(tick(x=3.0))
    c.socket.socket.shutdown(socket.SHUT_RDWR)
    assert limp(server)


def test_rubbish_of_all_kinds(served):
    server, client = served(period=0.005)
    random.seed(1)
    c = client()
    for size in range(0, 2000, 40):
        assert c.send(random.randbytes(size))["inverse3"]
    for raw in (b"\x00" * 100, b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01" + random.randbytes(80)):
        with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as s:
            s.sendall(raw)
    assert c.send("{}")["inverse3"]
    assert len(server.service.notices) <= 101


def test_kinds_of_notices_have_an_end(served):
    server, client = served(period=0.005)
    c = client()
    for i in range(150):
        c.send('{"key%d": 1}' % i)  # noqa: UP031
    assert len(server.service.notices) == 101
    assert server.service.notices["further kinds"] == 50


def test_half_open_sockets_and_a_slow_reader_stop_nobody(served):
    server, client = served(period=0.005)
    halves = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(20)]
    slow, c = client(), client()

    def flood():
        with contextlib.suppress(ConnectionClosed, OSError):
            for _ in range(3000):
                slow.socket.send(tick())

    thread = threading.Thread(target=flood, daemon=True)
    thread.start()
    try:
        assert all(c.send("{}")["inverse3"] for _ in range(20))
    finally:
        slow.socket.socket.shutdown(socket.SHUT_RDWR)
        for s in halves:
            s.close()
        thread.join(timeout=PATIENCE)


def test_many_clients_at_once(served):
    server, client = served(clock="wall")
    clients = [client() for _ in range(50)]
    answers = [c.send(tick(x=0.1)) for c in clients for _ in range(2)]
    assert len(answers) == 100 and sum(len(x) for x in server.exchanges) == 100


def test_a_message_of_10_MB_ends_its_client_and_no_other(served):
    server, client = served(clock="wall")
    c, other = client(), client()
    with pytest.raises((ConnectionClosed, OSError)):
        c.socket.send(b" " * 10_000_000)
        c.socket.recv(timeout=PATIENCE)
    assert other.send("{}")["inverse3"] and server.service.clients <= 2


def test_a_round_of_faults():
    """The quick version of benchmarks/device_faults.py, which goes on for a minute."""
    with serve(device_faults.SCENE, clock="wall") as server:
        found = device_faults.round_of_faults(server, 10, 500)
        assert server.service.device.ended == ""
        t = server.record().t
    # an hour of samples would take a gigabyte
    np.testing.assert_allclose(np.diff(t)[:-1], 10 * device_faults.SCENE.dt, rtol=1e-9)
    assert found["answers"] == 5
    # 50 ms, and what a busy computer takes for its turns
    assert max(found["limp_s"].values()) < 1.0


def test_clients_that_come_and_go_fill_no_memory():
    service = Service(SimulatedDevice(SCENE, period=0.005), clock="tick")
    stays, _ = service.connect()
    service.answer(stays, tick(x=1.0))
    for _ in range(MOST_LOGS + 50):
        number, _ = service.connect()
        service.leave(number)
    assert len(service.logs) == MOST_LOGS and service.logs[0].count == 1


def test_the_newest_rows_are_kept():
    rows = Rows(2, most=10)
    for k in range(3 * CHUNK + 5):
        rows.add((k, -k))
    table = rows.table()
    assert len(rows) == len(table) == 10 and rows.count == 3 * CHUNK + 5
    assert table[-1].tolist() == [3 * CHUNK + 4, -3 * CHUNK - 4] and table[0, 0] == 3 * CHUNK - 5
    assert Rows(2).table().shape == (0, 2)


def test_a_server_that_closes_ends_its_clients(served):
    server, client = served(clock="wall")
    c = client()
    server.close()
    with pytest.raises(ConnectionClosed):
        c.send("{}")
    assert not server.service.device.force[0]


# ---- numbers beyond all bounds -------------------------------------------------------------------

NUMBERS = st.sampled_from(
    ["1.7e308", "-1.7e308", "1e400", "NaN", "-Infinity", "1" + 400 * "0", "1e7", "999999", "-9e2"]
) | st.floats().map(repr)
INVERSE = ("set_cursor_force", "set_cursor_position", "set_angular_torques")
ROS = ("servo_cf", "servo_cp", "phantom/force_feedback")


def inverse_text(command, numbers):
    """A message of the Inverse service with two entries, whose forces add up."""
    x, y, z = numbers
    body = '{"values":{"x":%s,"y":%s,"z":%s,"a0":%s,"a1":%s}}' % (x, y, z, x, y)  # noqa: UP031
    entry = f'{{"device_id":"04EA","commands":{{"{command}":{body}}}}}'
    return f'{{"inverse3":[{entry},{entry}]}}'


def ros_text(topic, numbers):
    """A message of rosbridge."""
    v = '{"x":%s,"y":%s,"z":%s}' % numbers  # noqa: UP031
    msg = f'{{"wrench":{{"force":{v}}},"pose":{{"position":{v}}},"force":{v}}}'
    return f'{{"op":"publish","topic":"/a/{topic}","throttle_rate":{numbers[0]},"msg":{msg}}}'


@pytest.mark.parametrize(("protocol", "words"), [("inverse", INVERSE), ("rosbridge", ROS)])
@settings(max_examples=8, deadline=None)
@given(data=st.data())
def test_no_number_of_a_message_ends_the_device(protocol, words, data):
    """Two clients: whatever one commands, the device goes on and the other reads numbers."""
    shown = Inverse3(protocol=protocol)
    service = Service(SimulatedDevice(SCENE, period=0.005), clock="tick", inverse3=shown)
    wild, other = (service.connect()[0] for _ in range(2))
    write = inverse_text if protocol == "inverse" else ros_text
    if protocol == "rosbridge":
        for topic in ("measured_cp", "measured_cv", "measured_js", "phantom/state"):
            service.answer(other, json.dumps({"op": "subscribe", "topic": f"/{topic}"}))
    for _ in range(3):
        numbers = data.draw(st.tuples(NUMBERS, NUMBERS, NUMBERS))
        text = write(data.draw(st.sampled_from(words)), numbers)
        seen = service.answer(wild, text) + service.answer(other, "{}") + service.due(other)
        for answer in seen:
            json.loads(answer, parse_constant=lambda name: pytest.fail(f"{name} was sent"))
        device = service.device
        assert not device.ended and math.hypot(*device.force) <= 10.0 * (1 + 1e-12)
        assert math.hypot(*device.torques) < 10.0 * 3.0 * (SCENE.arm.l1 + SCENE.arm.l2)
    assert service.device.t > 0.0 and math.isfinite(sum(service.device.sensed.position))


def test_what_is_beyond_a_bound_is_counted(served):
    server, client = served(period=0.005)
    c = client()
    for command in INVERSE:
        c.send(inverse_text(command, ("1e300", "0", "0")))
    found = dict(server.service.notices)
    assert found == {
        "force is beyond 1e+06 N": 1,
        "position is beyond 1000 m": 1,
        "torque is beyond 1e+06 N.m": 1,
    }


def test_torques_are_limited_to_those_of_the_largest_force(served):
    """The lever of a force is the stretched arm at most; the ratio of the joints stays."""
    _, client = served(period=0.005, inverse3=Inverse3(largest_force=2.0))
    c = client()
    body = {"torques": {"a0": 300.0, "a1": -60.0}}
    entry = {"device_id": "04EA", "commands": {"set_angular_torques": body}}
    torques = c.state(json.dumps({"inverse3": [entry]}))["current_angular_torques"]
    l1, l2 = SCENE.arm.l1, SCENE.arm.l2
    expected = min(2.0 * (l1 + l2), 2.0 * l2 * 5.0)
    assert torques["a0"] == pytest.approx(expected, rel=1e-12)
    assert torques["a1"] == pytest.approx(-0.2 * expected, rel=1e-12)


# ---- texts that a client makes the service keep --------------------------------------------------


def test_no_client_fills_the_memory_with_ids():
    """Ids, topics, types, profiles of any length, and subscriptions of any number: all bounded."""
    shown = Inverse3(protocol="rosbridge")
    service = Service(SimulatedDevice(SCENE, period=0.005), clock="tick", inverse3=shown)
    number, _ = service.connect()
    long, kept = 60_000 * "x", 0
    before = memory_of(service)
    for k in range(550):
        names = [f"id {k}", 10**300 + k, k / 7]
        for name in names if k > 20 else [*names, f"{k}{long}", [long]]:
            words = {"op": "subscribe", "id": name, "topic": "/a/measured_cp"}
            (answer, *_) = service.answer(number, json.dumps(words))
            kept += json.loads(answer)["op"] == "publish"
        if k < 5:
            for key in ("op", "topic", "type", "compression"):
                words = {"op": "subscribe", "topic": "/a/measured_cp", key: long}
                (answer,) = service.answer(number, json.dumps(words))
                assert json.loads(answer)["level"] == "error" and len(answer) < 500
    assert kept == 500 and memory_of(service) - before < 500_000
    inverse = Service(SimulatedDevice(SCENE, period=0.005), clock="tick")
    number, _ = inverse.connect()
    before = memory_of(inverse)
    for k in range(100):
        name = f"{k}{long[:15_000]}"
        session = {"configure": {"profile": {"name": name}}, name: 1}
        entry = {"device_id": name, name: 1, "commands": {name: 1}}
        inverse.answer(number, json.dumps({"session": session, "inverse3": [entry]}))
    assert memory_of(inverse) - before < 500_000


def memory_of(service):
    """Characters of all that a service holds for its clients."""
    return len(repr((service.notices, [vars(s) for s in service._sessions.values()])))


def test_a_notice_holds_no_control_characters(served, caplog):
    server, client = served(period=0.005)
    client().send(json.dumps({"\x1b[2J\ud800\nnext line": 1}))
    (notice,) = server.service.notices
    assert notice.isprintable() and "next line" in notice
    assert all(r.getMessage().isprintable() for r in caplog.records)


class Failing(SimulatedDevice):
    """A device whose simulation fails at its third advance, as one in clay of a faulty law."""

    count = 0

    def advance(self, samples=None):
        self.count += 1
        if self.count >= 3:
            raise FloatingPointError("the law divides by nothing")
        super().advance(samples)


@pytest.mark.parametrize("clock", ["tick", "wall"])
def test_a_simulation_that_fails_ends_the_device_and_says_why(clock, caplog):
    """Clients get its last state, as of a device that has ended; its record stays."""
    device = Failing(SCENE)
    with DeviceServer(Service(device, clock=clock)) as server:
        client = Client(server.url)
        until(lambda: client.send(tick(x=1.0)) and server.service.ended, pause=0.0)
        assert server.service.ended == "FloatingPointError: the law divides by nothing"
        last = device.t
        assert client.send(tick(x=1.0))["inverse3"] and device.t == last > 0.0
        client.socket.close()
        assert server.record().t[-1] <= last
    assert [x.levelname for x in caplog.records] == ["ERROR"]
