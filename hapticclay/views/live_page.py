"""A page in a browser that shows what is played, behind a guard; viser serves it."""

from __future__ import annotations

import contextlib
import html
import logging
import secrets
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

import numpy as np

from ..errors import needing
from ..live.player import Player
from ..ports.guard import LOCAL, REFUSED, Guard, listening, url_host
from .palette import GRID, SKY, TABLE, rgb_bytes, verdict_color

REFRESH_TIME = 1.0 / 30.0  # [s] between two updates of the scene
PLOT_TIME = 0.5  # [s] between two updates of the plots
TAB_TITLE = "hapticclay"
BANNER_STYLE = (
    "color:white;padding:0.4em 0.6em;margin:0 0.7em 0.5em;border-radius:4px;font-size:0.85em"
)


class LivePage:
    """A page of what a player plays, served until `close`; `url` has the token that it may need.

    `session` is what is played, `run` the button that pauses it, `hold` the tick by which the hand
    pulls the handle to a point, `target` the arrows at that point.
    """

    session: Any
    run: Any
    hold: Any
    target: Any

    def __init__(self, play: Any, host: str, port: int):
        """Begins to serve an empty page."""
        with needing("the page", "viser", "web"):
            import rich
            import viser
        self.player = Player(play)
        self.guard = PageGuard(host, "" if host in LOCAL else secrets.token_urlsafe(16))
        listens = listening(host, port)
        self.port = listens.getsockname()[1]
        self._console = rich.get_console()
        self._quiet, self._console.quiet = self._console.quiet, True  # viser would print its own
        with _guarded(listens, self.guard):
            self.server = viser.ViserServer(LOCAL[0], self.port, label=TAB_TITLE, verbose=False)
        if self.server.get_port() != self.port:  # it listens elsewhere, unguarded
            listens.close()
            self._stop()
            raise RuntimeError(f"viser {viser.__version__} cannot be guarded")
        token = f"/?token={self.guard.token}" if self.guard.token else ""
        self.url = f"http://{url_host(host)}:{self.port}{token}"

    def serve(self, until: Callable[[], bool] | None = None) -> None:
        """Plays in real time until interrupted."""
        self.player.start()
        try:
            while (until is None or not until()) and self.player.error is None:
                begin = time.perf_counter()
                self._refresh(begin)
                time.sleep(max(0.002, REFRESH_TIME - (time.perf_counter() - begin)))
        finally:
            self.close()

    def close(self) -> None:
        """Stops the player and the server; raises the error that ended the player, if any."""
        try:
            if self.player.ident:
                self.player.stop()
        finally:
            self._stop()

    def _stop(self) -> None:
        self.server.stop()
        self._console.quiet = self._quiet

    def _refresh(self, now: float) -> None:
        """Shows the present state."""
        raise NotImplementedError

    def _hold(self) -> None:
        """Pulls to the point that is shown, or lets go, as the tick says."""
        raise NotImplementedError

    def _dragged(self, _: Any) -> None:
        self.hold.value = True  # acts like a tick by hand, the first time
        self._locked(self._hold)

    def _follow(self, handle: Any) -> None:
        """Moves the arrows with the handle, unless a drag has begun since it was there."""
        with self.player.lock:
            if self.session.point is None:
                self.target.position = tuple(handle)

    def _toggle(self, _: Any) -> None:
        with self.player.lock:
            self.session.paused = not self.session.paused
            self.run.label = "Start" if self.session.paused else "Pause"

    def _locked(self, act: Callable[[], None]) -> None:
        with self.player.lock:
            act()

    def _slid(self, slider: Any, act: Callable[[], None]) -> None:
        """Handles a slider; a number typed out of its range is clipped to the range."""
        if slider.min <= slider.value <= slider.max:
            self._locked(act)
        else:  # an update that triggers this callback again
            slider.value = slider.max if slider.value > slider.max else slider.min

    def _light(self) -> None:
        """Sky and lamps."""
        add = self.server.scene
        sky = np.linspace(rgb_bytes(SKY[0]), rgb_bytes(SKY[1]), 64).astype(np.uint8)
        add.set_background_image(sky[:, None].repeat(64, axis=1), "png")
        add.set_up_direction("+z")
        add.configure_default_lights(enabled=False)
        add.add_light_ambient("/daylight", color=(255, 255, 255), intensity=0.5)
        lamp: Any = dict(color=(255, 250, 240), intensity=1.2, cast_shadow=True)
        add.add_light_directional("/lamp", position=(-0.4, 0.6, 1.1), **lamp)
        add.world_axes.visible = False

    def _table(self, middle: Any, width: float, depth: float, cell: float) -> None:
        """The table, whose top is 2 mm below the middle that is given, with a grid of cells."""
        (x, y, z), add = middle, self.server.scene
        add.add_box("/table", rgb_bytes(TABLE), (width, depth, 0.02), position=(x, y, z - 0.012))
        lines: Any = dict(cell_size=cell, section_size=cell, plane="xy", position=(x, y, z - 0.001))
        lines.update(cell_color=rgb_bytes(GRID), section_color=rgb_bytes(GRID))
        add.add_grid("/grid", width, depth, **lines)


def banner_html(text: str, unstable: bool) -> str:
    """A verdict on its colour."""
    style = f"background:{verdict_color(text, unstable)};{BANNER_STYLE}"
    return f'<div style="{style}">{html.escape(text)}</div>'


COOKIE = "hapticclay"


@dataclass(frozen=True)
class PageGuard(Guard):
    """A guard for a browser: the token is first in the address (?token=), then in a cookie.

    Attributes:
        host: address that the page listens on.
        token: token required in each request; "" for none.
        origins: pages of other servers that are admitted.
    """

    def refusal(self, connection: Any, request: Any) -> Any:
        """As Guard.refusal; a token in the address is answered with the cookie."""
        why = self.reason(request)
        if why == REFUSED or not self.token:
            return super().refusal(connection, request)
        cookies = "; ".join(request.headers.get_all("Cookie")).split("; ")
        if any(self.matches(c, f"{COOKIE}={self.token}") for c in cookies):
            return None
        if why:
            return super().refusal(connection, request)
        response = connection.respond(HTTPStatus.SEE_OTHER, "")
        response.headers["Location"] = "/"
        response.headers["Set-Cookie"] = f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
        return response


@contextlib.contextmanager
def _guarded(listens: socket.socket, guard: PageGuard) -> Iterator[None]:
    """Makes the server that viser starts meanwhile listen on a socket, behind a guard.

    viser has no setting for either. If a later viser starts its server differently, it finds the
    port taken and listens elsewhere, which Page refuses.
    """
    from websockets.asyncio import server

    serve = server.serve
    quiet = logging.Logger("page")
    quiet.addHandler(logging.NullHandler())  # do not log requests that are not HTTP

    def guarded(handler: Any, host: str, port: int, *, process_request: Any, **options: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            is_page = request.path.partition("?")[0] in ("/", "/index.html")
            if is_page and "Accept-Encoding" in request.headers:
                del request.headers["Accept-Encoding"]  # so that its title can be changed
            refusal = guard.refusal(connection, request)
            response = refusal or process_request(connection, request)
            if response is not None:
                response.headers["X-Frame-Options"] = "DENY"
            if is_page and response is not None and not refusal:
                title = f"<title>{TAB_TITLE}</title>".encode()
                response.body = response.body.replace(b"<title>Viser</title>", title, 1)
                del response.headers["Content-Length"]
                response.headers["Content-Length"] = str(len(response.body))
            return response

        options.update(sock=listens, process_request=answer, logger=quiet)
        return serve(handler, **options)

    server.serve = guarded
    try:
        yield
    finally:
        server.serve = serve
