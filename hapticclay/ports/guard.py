"""Who may connect to a server of this package: names of this machine, own pages, a token."""

from __future__ import annotations

import contextlib
import errno
import hmac
import socket
from dataclasses import dataclass
from http import HTTPStatus
from ipaddress import ip_address
from typing import Any
from urllib.parse import parse_qs, urlsplit

from ..errors import ParameterError, integer

LOCAL = ("127.0.0.1", "localhost", "::1")
REFUSED = "open the address printed at the start; other names and pages are refused"
NO_TOKEN = "the address lacks the token that was printed at the start"


@dataclass(frozen=True)
class Guard:
    """Admits requests that name this machine and come from no foreign page.

    A foreign page can make a browser send requests to this server, under our name or under its own
    (DNS rebinding), but it cannot forge the Host and Origin headers. Programs send no Origin. Where
    other machines can connect, a token is required as well.
    """

    host: str  # address that the server listens on
    token: str  # "" for none
    origins: tuple[str, ...] = ()  # admitted pages of other servers, as http://localhost:8000

    def refusal(self, connection: Any, request: Any) -> Any:
        """Judges a request."""
        if why := self.reason(request):
            return connection.respond(HTTPStatus.FORBIDDEN, f"hapticclay: {why}\n")
        return None

    def reason(self, request: Any) -> str:
        """Why a request is refused; "" for one that is admitted, by the token in its address."""
        if not self.is_own(request):
            return REFUSED
        return "" if self.has_token(request) else NO_TOKEN

    def is_own(self, request: Any) -> bool:
        """Whether Host is a name of this machine, and Origin, if sent, the same or admitted."""
        try:
            hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
            if len(hosts) != 1 or not all(self._admits(x, hosts[0]) for x in origins):
                return False
            name = urlsplit(f"//{hosts[0]}").hostname or ""
            urlsplit(request.path)
        except ValueError:  # not an address
            return False
        if name in LOCAL or not self.token:
            return name in LOCAL
        with contextlib.suppress(ValueError):
            return bool(ip_address(name))  # a number is not a name that a foreign page could own
        return name in (self.host.lower(), socket.gethostname().lower())

    def has_token(self, request: Any) -> bool:
        """Whether the address of a request holds the token, or none is required."""
        query = parse_qs(urlsplit(request.path).query)
        return not self.token or self.matches(query.get("token", [""])[0], self.token)

    def _admits(self, origin: str, host: str) -> bool:
        return urlsplit(origin).netloc.lower() == host.lower() or origin.lower() in self.origins

    @staticmethod
    def matches(given: str, expected: str) -> bool:
        """Compares secrets in a time that does not depend on them."""
        return hmac.compare_digest(given.encode(errors="replace"), expected.encode())


def origins_of(given: object) -> tuple[str, ...]:
    """Checked origins of pages, in lower case."""
    if not isinstance(given, tuple):
        raise ParameterError("origins", given, "must be a tuple of texts")
    for origin in given:
        try:
            parts = urlsplit(origin)
            plain = parts._replace(scheme="", netloc="").geturl() in ("", "/") and parts.port != 0
            is_page = parts.scheme in ("http", "https") and bool(parts.hostname) and plain
        except (ValueError, AttributeError, TypeError):
            is_page = False
        if not is_page:
            bound = "must be scheme, host and port of a page, as http://localhost:8000"
            raise ParameterError("origins", origin, bound)
    return tuple(origin.lower().rstrip("/") for origin in given)


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens."""
    port = integer("port", port, 0, 65_535)
    if not isinstance(host, str):
        raise ParameterError("host", host, "must be an address of this machine, as 127.0.0.1")
    try:
        found = socket.getaddrinfo(host or "0.0.0.0", port, type=socket.SOCK_STREAM)
        family, *_, address = min(found, key=lambda x: x[0] != socket.AF_INET)
        return socket.create_server(address[:2], family=family)
    except (OSError, ValueError, OverflowError) as error:  # ValueError: no name at all, as a..b
        raise _not_available(host, port, error) from None


def _not_available(host: str, port: int, error: Exception) -> ParameterError:
    why = getattr(error, "strerror", None) or "not a name of a machine"
    why = why.partition(" (while")[0].lower()
    wrong_host = not isinstance(error, OSError) or isinstance(error, socket.gaierror)
    if wrong_host or error.errno == errno.EADDRNOTAVAIL:  # type: ignore[union-attr]
        bound = f"must be an address of this machine, as 127.0.0.1 ({why})"
        return ParameterError("host", host, bound)
    bound = f"cannot listen on {host} ({why}): try --port 0 for any free port"
    return ParameterError("port", port, bound)


def url_host(host: str) -> str:
    """The host of an address: for "all addresses" the address of this machine for others."""
    if host in ("", "0.0.0.0", "::"):
        try:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
                s.connect(("192.0.2.1", 9))  # selects a route without sending anything
                host = s.getsockname()[0]
        except OSError:
            host = socket.gethostname()
    return f"[{host}]" if ":" in host else host
