"""A gate before a server that listens on this machine alone: who comes must mean this page, and may need a token."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import http.client
import io
import secrets
import threading
from collections.abc import Callable
from ipaddress import ip_address
from socket import gethostname
from urllib.parse import parse_qs, urlsplit

from ..errors import ParameterError

LOCAL = ("127.0.0.1", "localhost", "::1")
COOKIE = "hapticclay"
PASS = "X-Hapticclay-Pass"  # header by which the server behind knows whom the gate has let in
HEAD = 65536  # longest head of a request [bytes]
PATIENCE = 10.0  # for it, and for a page from behind [s]


class Gate:
    """Lets in who asks for this machine by a name of its own, and from no page but its own.

    A stranger's page can make the browser of whoever looks at it come here, under our name or (DNS rebinding) under
    the page's; it cannot make it lie about either in Host and Origin. Where other machines can come there is a token
    as well: in the first address (?token=), afterwards in a cookie, which the browser shows by itself.

    Attributes:
        port: where it listens. secret: what PASS says.

    Raises:
        ParameterError: the address cannot be listened on.
    """

    def __init__(self, host: str, port: int, inner: int, token: str = "", edit: Callable[[bytes], bytes] = bytes):
        """Listens.

        Args:
            host, port: address to listen on; port 0 for any. inner: port of the server on this machine.
            token: "" for none. edit: changes the page on its way.
        """
        self.host, self.inner, self.token, self.edit = host, inner, token, edit
        self.secret = secrets.token_urlsafe(16)
        self._loop = asyncio.new_event_loop()
        self._tasks: set[asyncio.Task] = set()
        try:
            self._server = self._loop.run_until_complete(asyncio.start_server(self._meet, host, port, limit=HEAD))
        except OSError as error:
            self._loop.close()
            why = error.strerror.lower() if error.strerror else str(error)
            raise ParameterError("port", port, f"{host} cannot be listened on ({why}): try --port 0, for any") from None
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
            target, fields, refusal = self._judge(head)
            if refusal:
                writer.write(refusal)
            elif fields.get("Upgrade", "").lower() == "websocket":
                await self._pass(head[:-2] + f"{PASS}: {self.secret}\r\n\r\n".encode(), reader, writer)
            else:
                writer.write(await asyncio.wait_for(self._fetch(target), PATIENCE))
            await writer.drain()
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, asyncio.CancelledError, TimeoutError):
            pass  # whoever it was has gone, or never was a browser
        finally:
            self._tasks.discard(task)
            writer.close()

    def _judge(self, head: bytes) -> tuple[str, http.client.HTTPMessage, bytes]:
        """Target and header fields of a request, and what to answer instead of letting it in; b"" to let it in."""
        line, _, rest = head.partition(b"\r\n")
        method, target, *_ = (*line.decode("latin-1").split(" "), "", "")
        fields = http.client.HTTPMessage()
        try:
            fields = http.client.parse_headers(io.BytesIO(rest))
            hosts, origins = fields.get_all("Host", []), fields.get_all("Origin", [])
            own = len(hosts) == 1 and self._ours(urlsplit(f"//{hosts[0]}").hostname or "")
            own = own and all(urlsplit(o).netloc.lower() == hosts[0].lower() for o in origins)
            query = parse_qs(urlsplit(target).query)
            understood = method == "GET" and target.startswith("/")
        except (ValueError, http.client.HTTPException):
            understood, own, query = False, False, {}
        if not understood:
            return target, fields, _answer("400 Bad Request", b"hapticclay: not a request for a page\n")
        if not own:
            text = b"hapticclay: asked for under another name, or by another page: open the address printed at start\n"
            return target, fields, _answer("403 Forbidden", text)
        cookies = [c.strip().partition("=") for c in fields.get("Cookie", "").split(";")]
        if not self.token or any(name == COOKIE and self._right(value) for name, _, value in cookies):
            return target, fields, b""
        if self._right(query.get("token", [""])[0]):
            cookie = f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            return target, fields, _answer("303 See Other", b"", f"Location: /\r\nSet-Cookie: {cookie}\r\n")
        text = b"hapticclay: the address lacks the token that was printed at start\n"
        return target, fields, _answer("403 Forbidden", text)

    def _ours(self, name: str) -> bool:
        """Whether this is a name of the machine: on other addresses than its own, also any number, which is no name."""
        if name in LOCAL or not self.token:
            return name in LOCAL
        with contextlib.suppress(ValueError):
            return bool(ip_address(name))
        return name in (self.host.lower(), gethostname().lower())

    def _right(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self.token.encode())

    async def _fetch(self, target: str) -> bytes:
        """The page behind, as an answer of our own."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.inner)
        try:
            writer.write(f"GET {target} HTTP/1.1\r\nHost: 127.0.0.1:{self.inner}\r\n\r\n".encode("latin-1"))
            head, _, body = (await reader.read(-1)).partition(b"\r\n\r\n")
        finally:
            writer.close()
        line, _, rest = head.partition(b"\r\n")
        kind = http.client.parse_headers(io.BytesIO(rest)).get("Content-Type", "text/plain")
        return _answer(line.decode("latin-1").partition(" ")[2] or "502 Bad Gateway", self.edit(body), kind=kind)

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


def _answer(status: str, body: bytes, more: str = "", kind: str = "text/plain") -> bytes:
    head = f"HTTP/1.1 {status}\r\n{more}Content-Type: {kind}\r\nContent-Length: {len(body)}\r\n"
    return f"{head}X-Frame-Options: DENY\r\nConnection: close\r\n\r\n".encode("latin-1") + body


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
