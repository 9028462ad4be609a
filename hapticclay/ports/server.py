"""The service on a WebSocket, compatible with programs for a real Inverse3."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
import socket
import threading
from collections.abc import Iterator
from http import HTTPStatus
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

from ..arguments import checked
from ..errors import Bound, Real, needing
from ..files import versions
from ..scene.scenario import Scenario
from ..simulation.record import Record
from .device import SimulatedDevice, Trajectory
from .exchanges import Exchanges
from .guard import LOCAL, REFUSED, Guard, listening, url_host
from .inverse import LARGEST_MESSAGE
from .service import Service
from .sessions import PLAIN, Inverse3

Clock = Literal["wall", "tick"]
PUSH_PERIOD = 0.002  # [s] between two states pushed to a client
EVERY = 10  # samples by the wall clock for one that is kept: 0.14 GB an hour at 0.36 ms
LONGEST_QUEUE = 16  # longest queue of unanswered messages of a client


@checked
class DeviceServer:
    """A service that runs in its own thread.

    Attributes:
        service: sessions and clock.
        url: URL for WebSocket clients.
        port: port on which it listens.
    """

    def __init__(self, service: Service, host: str = "127.0.0.1", port: int = 0):
        """Starts to listen.

        Args:
            service: service that answers the clients.
            host: address to listen on; addresses other than this machine's need a token.
            port: port to listen on; 0 for a free one.

        Raises:
            ParameterError: port or address is not available, or websockets is not installed.
        """
        with needing("a device server", "websockets", "device"):
            import websockets  # noqa: F401
        self.service = service
        listens = listening(host, port)
        token = "" if host in LOCAL else secrets.token_urlsafe(16)
        self._guard = Guard(host, token, service.inverse3.origins)
        self._loop = asyncio.new_event_loop()
        self._done = asyncio.Event()
        self._failed: BaseException | None = None
        ready = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(listens, ready), name="device server", daemon=True
        )
        self.port = listens.getsockname()[1]
        self._thread.start()
        ready.wait()
        if self._failed is not None:
            self._thread.join()
            raise self._failed
        query = f"/?token={token}" if token else ""
        self.url = f"ws://{url_host(host)}:{self.port}{query}"
        service.start()

    def __enter__(self) -> DeviceServer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes all connections and stops the clock."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._done.set)
            self._thread.join()
        self.service.stop()

    def record(self) -> Record:
        """Stops the device and returns its record so far.

        Raises:
            RuntimeError: the device has not run.
        """
        self.close()
        return self.service.device.record()

    @property
    def exchanges(self) -> list[Exchanges]:
        """Exchanges of each client with the device, in the order of connection."""
        return [log.exchanges() for log in self.service.logs]

    # ---- the thread

    def _run(self, listens: socket.socket, ready: threading.Event) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve(listens, ready))
        except Exception as error:  # noqa: BLE001  # raised where the server was started
            self._failed = error
        finally:
            listens.close()
            ready.set()
            self._loop.close()

    async def _serve(self, listens: socket.socket, ready: threading.Event) -> None:
        from websockets.asyncio.server import serve as listen

        quiet = logging.getLogger("hapticclay.ports.websockets")
        quiet.setLevel(logging.CRITICAL)  # a malformed request causes no traceback
        async with listen(
            self._talk,
            sock=listens,
            compression=None,
            ping_interval=None,
            max_size=LARGEST_MESSAGE,
            max_queue=LONGEST_QUEUE,
            server_header=None,
            close_timeout=1.0,
            process_request=self._http,
            logger=quiet,
        ):
            ready.set()
            await self._done.wait()

    async def _talk(self, connection: Any) -> None:
        """Serves a client until it disconnects."""
        from websockets.exceptions import ConnectionClosed

        connected = connection.transport.get_extra_info("socket")
        with contextlib.suppress(OSError, AttributeError):
            connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        number, texts = self.service.connect()
        pushing = None
        try:
            for text in texts:
                await connection.send(text)
            if self.service.protocol.pushes:
                pushing = asyncio.create_task(self._push(connection, number))
            async for data in connection:
                for text in self.service.answer(number, data):
                    await connection.send(text)
                await asyncio.sleep(0.0)  # lets other clients run, however many messages wait
        except ConnectionClosed:
            pass
        finally:
            if pushing is not None:
                pushing.cancel()
            self.service.leave(number)

    async def _push(self, connection: Any, number: int) -> None:
        """Pushes states to a client until it disconnects."""
        from websockets.exceptions import ConnectionClosed

        with contextlib.suppress(ConnectionClosed):
            while True:
                for text in self.service.due(number):
                    await connection.send(text)
                await asyncio.sleep(PUSH_PERIOD)

    def _http(self, connection: Any, request: Any) -> Any:
        """Answers plain GET requests; None passes a WebSocket on."""
        if why := self._guard.reason(request):
            self.service.count(_refused(request, why))
            return _envelope(connection, HTTPStatus.FORBIDDEN, why)
        where = urlsplit(request.path)
        if "websocket" in request.headers.get("Upgrade", "").lower():
            return None
        if where.path == "/version":
            return _envelope(connection, HTTPStatus.OK, data=_version())
        if where.path == "/devices":
            return _envelope(connection, HTTPStatus.OK, data=self.service.inventory())
        return _envelope(connection, HTTPStatus.NOT_FOUND, f"no route {where.path}")


def _refused(request: Any, why: str) -> str:
    """A notice of a refused request."""
    pages = request.headers.get_all("Origin")
    if pages and why == REFUSED:
        return f"a page of {pages[0]} was refused; --origin admits pages"
    return f"a request was refused: {why}"


def _version() -> dict[str, str]:
    number = versions()["hapticclay"]
    names = "build_time", "git_branch", "git_describe", "git_hash", "git_tag"
    out = dict.fromkeys(names, "")
    return out | {"project_name": "hapticclay", "project_version": number}


def _envelope(connection: Any, status: HTTPStatus, error: str = "", data: Any = None) -> Any:
    body = {"ok": False, "error": error} if error else {"ok": True, "data": data}
    response = connection.respond(status, json.dumps(body) + "\n")
    del response.headers["Content-Type"]
    response.headers["Content-Type"] = "application/json"
    return response


def every_of(clock: Clock) -> int:
    """How many samples there are for one that a record keeps."""
    return 1 if clock == "tick" else EVERY


@checked
@contextlib.contextmanager
def serve(
    scenario: Scenario,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    clock: Clock = "tick",
    period: Annotated[Real | None, Bound(1e-5, 1.0, "s")] = None,
    hand: Trajectory | None = None,
    clay: bool = False,
    inverse3: Inverse3 = PLAIN,
) -> Iterator[DeviceServer]:
    """Serves the arm of a scenario as a device while the `with` block runs.

        with hapticclay.ports.serve(scenario, period=0.005) as server:
            run_my_program(server.url)
            record = server.record()

    Args:
        scenario: arm, hand, hardware and step are used; compensator, servo and controller are not.
        host: address to listen on; addresses other than this machine's need a token, part of `url`.
        port: port to listen on; 0 for a free one.
        clock: "tick": each message of the first client advances the device by a period, so that a
            test repeats exactly; "wall": the device runs in real time, and the record keeps every
            10th sample.
        period: between two messages with the clock "tick" [s], 1e-5 to 1; None for the control
            sample.
        hand: target of the hand over time; None for the muscle force of the scenario.
        clay: whether the clay of the scenario acts.
        inverse3: identity and protocol of the simulated device.

    Yields:
        The server.

    Raises:
        ParameterError: a value is out of its bounds, the address is none of this machine, the port
            is taken, or websockets is not installed.
    """
    most = inverse3.largest_force
    device = SimulatedDevice(
        scenario, period=period, hand=hand, clay=clay, largest_force=most, every=every_of(clock)
    )
    service = Service(device, clock=clock, inverse3=inverse3)
    with DeviceServer(service, host, port) as server:
        yield server
