"""A gate before a server that listens on this machine alone: who comes from elsewhere must show a token."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import threading
from urllib.parse import parse_qs, urlsplit

from .errors import ParameterError

COOKIE = "hapticclay"
HEAD = 65536  # longest head of a request [bytes]
PATIENCE = 10.0  # for it [s]


class Gate:
    """Passes connections on whose first request has the token, in its address (?token=) or in a cookie.

    The page is asked for with the address; it gets the cookie, which the browser then shows by itself.

    Raises:
        ParameterError: the address cannot be listened on.
    """

    def __init__(self, host: str, port: int, inner: int, token: str):
        self.host, self.port, self.inner, self.token = host, port, inner, token
        self._loop = asyncio.new_event_loop()
        self._tasks: set[asyncio.Task] = set()
        try:
            self._server = self._loop.run_until_complete(asyncio.start_server(self._meet, host, port, limit=HEAD))
        except OSError as error:
            self._loop.close()
            raise ParameterError("host", f"{host}:{port}", f"cannot be listened on ({error.strerror})") from None
        self.port = self._server.sockets[0].getsockname()[1]
        self._thread = threading.Thread(target=self._loop.run_forever, name="gate", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends all connections and stops listening."""
        asyncio.run_coroutine_threadsafe(self._close(), self._loop).result(timeout=10.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _close(self) -> None:
        self._server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        try:
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), PATIENCE)
            answer = self._judge(head.decode("latin-1"))
            if answer:
                writer.write(answer.encode("latin-1"))
                await writer.drain()
            else:
                await self._pass(head, reader, writer)
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, asyncio.CancelledError, TimeoutError):
            pass  # whoever it was has gone, or never was a browser
        finally:
            self._tasks.discard(task)
            writer.close()

    def _judge(self, head: str) -> str:
        """What to answer to a request; "" to let it in."""
        request, *lines = head.split("\r\n")
        target = (request.split(" ") + ["", ""])[1]
        fields = {k.strip().lower(): v.strip() for k, _, v in (line.partition(":") for line in lines)}
        cookies = [c.strip() for c in fields.get("cookie", "").split(";")]
        if any(self._right(c[len(COOKIE) + 1 :]) for c in cookies if c.startswith(f"{COOKIE}=")):
            return ""
        if self._right(parse_qs(urlsplit(target).query).get("token", [""])[0]):
            cookie = f"Set-Cookie: {COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            return (
                f"HTTP/1.1 303 See Other\r\nLocation: /\r\n{cookie}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
            )
        text = "hapticclay: the address lacks the token that was printed at start\n"
        return (
            "HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain\r\n"
            f"Content-Length: {len(text)}\r\nConnection: close\r\n\r\n{text}"
        )

    def _right(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self.token.encode())

    async def _pass(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", self.inner)
        try:
            inner_writer.write(head)
            ways = [asyncio.create_task(_copy(*x)) for x in ((reader, inner_writer), (inner_reader, writer))]
            try:
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        finally:
            inner_writer.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
