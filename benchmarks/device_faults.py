"""Clients that fail, against the simulated device in real time: does the arm go limp?

    python -m benchmarks.device_faults [--clients 50] [--seconds 60] [--out DIR]

Clients drive the arm and are killed, send rubbish, NaN and 10 MB, do not read, or open sockets and
say nothing, in turn and at random. Writes device_faults.json: the times from the fault to an arm
without force, answers to a client that behaves, and the memory of the server's process.
"""

from __future__ import annotations

import contextlib
import json
import random
import socket
import time
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

import hapticclay as hc
from hapticclay.ports import DeviceServer

from . import common

SCENE = hc.Scenario(operator=hc.Operator(), force=(0.0, 0.0), length=None)
LARGE = b" " * 10_000_000
GIVEN_UP = 5.0  # [s] after which an arm counts as never limp


def tick(x: float) -> str:
    """A force along x [N]."""
    force = {"set_cursor_force": {"values": {"x": x, "y": 0.0, "z": 0.0}}}
    return json.dumps({"inverse3": [{"device_id": "04EA", "commands": force}]})


def memory() -> int:
    """Resident memory of this process [kB]; 0 where the system does not tell."""
    status = Path("/proc/self/status")
    if not status.is_file():
        return 0
    rows = [x for x in status.read_text().splitlines() if x.startswith("VmRSS")]
    return int(rows[0].split()[1])


def killed(client: ClientConnection) -> None:
    """No closing handshake."""
    with contextlib.suppress(OSError):  # the server may have closed it
        client.socket.shutdown(socket.SHUT_RDWR)


def silent(client: ClientConnection) -> None:
    """It stays, and says nothing."""


def garbage(client: ClientConnection) -> None:
    """Random bytes in place of a command."""
    client.send(random.randbytes(300))


def not_a_number(client: ClientConnection) -> None:
    """A force that is NaN."""
    client.send(tick(1.0).replace("1.0", "NaN"))


def large(client: ClientConnection) -> None:
    """A message of 10 MB."""
    client.send(LARGE)


def broken(client: ClientConnection) -> None:
    """Bytes that are no frame of a WebSocket."""
    client.socket.sendall(random.randbytes(400))


FAULTS = (killed, silent, garbage, not_a_number, large, broken)


def limp_after(server: DeviceServer, fault: Any) -> float:
    """Time from a fault of the only client with a force to an arm without force [s].

    Args:
        server: of the device.
        fault: of FAULTS.
    """
    with connect(server.url, compression=None) as client:
        client.recv()
        client.send(tick(2.0))
        client.recv()
        began = time.perf_counter()
        with contextlib.suppress(ConnectionClosed, OSError):
            fault(client)
        while server.service.device.force != (0.0, 0.0):
            if time.perf_counter() - began > GIVEN_UP:
                return GIVEN_UP
            time.sleep(2e-4)
        took = time.perf_counter() - began
        killed(client)
    return took


def crowd(server: DeviceServer, clients: int) -> int:
    """Many clients at once, half of them killed; how many answers the rest got.

    Args:
        server: of the device.
        clients: how many.
    """
    with contextlib.ExitStack() as stack:
        made = [stack.enter_context(connect(server.url, compression=None)) for _ in range(clients)]
        for client in made:
            client.recv()
            client.send(tick(0.01))
        for client in made[::2]:
            killed(client)
        answers = 0
        for client in made[1::2]:
            client.recv(timeout=GIVEN_UP)
            client.send("{}")
            client.recv(timeout=GIVEN_UP)
            answers += 1
        for client in made:
            killed(client)
    return answers


def slow_reader(server: DeviceServer, messages: int) -> None:
    """Sends and never reads, until the server waits for it.

    Args:
        server: of the device.
        messages: how many to try.
    """
    with socket.create_connection(("127.0.0.1", server.port), timeout=0.2) as raw:
        raw.sendall(
            b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        text = tick(0.0).encode()
        head = bytes([0x81, 0x80 | 126]) + len(text).to_bytes(2, "big") + b"\0\0\0\0"  # mask of 0
        with contextlib.suppress(OSError):
            for _ in range(messages):
                raw.sendall(head + text)


def round_of_faults(server: DeviceServer, clients: int, messages: int) -> dict[str, Any]:
    """Each fault once, a crowd, half-open sockets and a slow reader.

    Args:
        server: of the device.
        clients: of the crowd.
        messages: of the slow reader.
    """
    halves = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(clients // 2)]
    limp = {fault.__name__: limp_after(server, fault) for fault in FAULTS}
    slow_reader(server, messages)
    answers = crowd(server, clients)
    for half in halves:
        half.close()
    return {"limp_s": limp, "answers": answers, "memory_kB": memory()}


def main(out: Path | None, clients: int = 50, seconds: float = 60.0) -> dict[str, Any]:
    """Rounds of faults for so long; write what was found if a folder is given.

    Args:
        out: the folder.
        clients: of a crowd.
        seconds: of the clock.
    """
    rounds, end = [], time.perf_counter() + seconds
    with hc.ports.serve(SCENE, clock="wall") as server:
        while not rounds or time.perf_counter() < end:
            rounds.append(round_of_faults(server, clients, 20_000))
        ended = server.service.device.ended
    worst = {f.__name__: max(r["limp_s"][f.__name__] for r in rounds) for f in FAULTS}
    found = {
        "clients": clients,
        "rounds": len(rounds),
        "answers": sum(r["answers"] for r in rounds),
        "worst_limp_s": worst,
        "memory_kB": [rounds[0]["memory_kB"], rounds[-1]["memory_kB"]],
        "ended": ended,
    }
    if out:
        common.write(out, "device_faults", found)
    return found


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=60.0)
    words = parser.parse_args()
    print(json.dumps(main(words.out, words.clients, words.seconds), indent=1))
