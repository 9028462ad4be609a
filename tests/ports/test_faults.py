"""Clients that vanish, send rubbish or do not read: the arm goes limp, the others go on."""

import contextlib
import random
import socket
import threading
import time

import pytest
from websockets.exceptions import ConnectionClosed

from benchmarks import device_faults
from hapticclay.ports import serve
from hapticclay.ports.device import SimulatedDevice
from hapticclay.ports.rows import CHUNK, Rows
from hapticclay.ports.service import MOST_LOGS, Service
from tests.ports.conftest import SCENE, tick


def limp(server, within=5.0):
    end = time.monotonic() + within
    while server.service.device.force != (0.0, 0.0) and time.monotonic() < end:
        time.sleep(0.005)
    return server.service.device.force == (0.0, 0.0)


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
        with socket.create_connection(("127.0.0.1", server.port), timeout=5.0) as s:
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
        thread.join(timeout=10.0)


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
        c.socket.recv(timeout=5.0)
    assert other.send("{}")["inverse3"] and server.service.clients <= 2


def test_a_round_of_faults():
    """The quick version of benchmarks/device_faults.py, which goes on for a minute."""
    with serve(device_faults.SCENE, clock="wall") as server:
        found = device_faults.round_of_faults(server, 10, 500)
        assert server.service.device.ended == ""
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
