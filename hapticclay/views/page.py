"""A session in a browser, for people without a desktop: viser's scene, sliders and plots."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import html
import http.client
import io
import math
import secrets
import socket
import threading
import time
from collections.abc import Callable
from ipaddress import ip_address
from socket import gethostname
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from ..errors import ParameterError, integer
from ..model.constants import AXES, L1, L2
from . import stage
from .session import Player, Session
from .stage import Stage, cut_axes, hardest

FRAME = 1.0 / 30.0  # [s] between two looks of the browser
CUT_EVERY, PLOT_EVERY = 0.2, 0.5  # [s] between two states of the clay, and of the plots
POINTS = 400  # of a plot
TITLE = "hapticclay"
SKY, GROUND = (236, 240, 245), (214, 220, 228)  # behind the scene, above and below
RED, GREEN, AMBER = "#c92a2a", "#0d6b52", "#b86b00"  # behind the verdict
INK = {
    ("hand", 0): "#009E73",
    ("clay", 0): "#0072B2",
    ("hand", 1): "#E69F00",
    ("clay", 1): "#D55E00",
}
DARK, STEEL, BLUE, ORANGE = (56, 64, 74), (178, 186, 196), (15, 110, 173), (230, 107, 13)


class Page:
    """The session's page, served until `close`.

    Attributes:
        url: where it is, with the token if it needs one.
    """

    def __init__(self, session: Session, host: str = "127.0.0.1", port: int = 8080):
        """Serves it.

        Args:
            session: to be played. host: address to listen on; other than this machine's own, a token guards it.
            port: 0 for any.

        Raises:
            ParameterError: viser is missing, or the address cannot be listened on.
        """
        try:
            import rich
            import viser
        except ImportError:
            raise ParameterError(
                "web", "viser", "is not installed: pip install 'hapticclay[web]'"
            ) from None
        self.session = session
        port, local = integer("port", port, 0, 65535), host in LOCAL
        self.console = rich.get_console()
        self.quiet, self.console.quiet = (
            self.console.quiet,
            True,
        )  # viser's boxes name the port behind the gate
        with socket.create_server((LOCAL[0], 0)) as free:
            behind = free.getsockname()[1]
        self.server = viser.ViserServer(host=LOCAL[0], port=behind, verbose=False, label=TITLE)
        token = "" if local else secrets.token_urlsafe(16)
        try:
            self.gate = Gate(host, port, self.server.get_port(), token, _titled)
        except ParameterError:
            self._stop()
            raise
        self.server._websock_server.on_client_connect(self._admit)
        self.url = f"http://{_name(host)}:{self.gate.port}" + (f"/?token={token}" if token else "")
        self.player = Player(session)
        self.stage = Stage(session.scenario, session.tool)
        self.shown = 1  # frames that the clay is cut by
        self.cut = self.plotted = -math.inf  # when, in real time [s]
        self._scene()
        self._controls(viser.uplot)

    def serve(self, until: Callable[[], bool] | None = None) -> None:
        """Plays in real time until interrupted, or until this says so."""
        self.player.start()
        try:
            while (until is None or not until()) and self.player.error is None:
                begin = time.perf_counter()
                self._refresh(begin)
                time.sleep(max(0.002, FRAME - (time.perf_counter() - begin)))
        finally:
            self.close()

    def close(self) -> None:
        """Stops playing and serving; raises what the player died of, if it did."""
        try:
            if self.player.ident:
                self.player.stop()
        finally:
            self.gate.close()
            self._stop()

    def _stop(self) -> None:
        self.server.stop()
        self.console.quiet = self.quiet

    async def _admit(self, client: Any) -> None:
        """Sends whoever has come past the gate away, before they are told or have said anything."""
        connection = self.server._websock_server._live_connections[client.client_id]
        request = connection.request
        if request is None or request.headers.get_all(PASS) != [self.gate.secret]:
            await connection.close(1008, "not through the gate")

    def _scene(self) -> None:
        add, ground = self.server.scene, stage.GROUND
        camera = self.server.initial_camera
        camera.position, camera.look_at, camera.fov = (0.21, -0.66, 0.64), (0.18, 0.15, -0.04), 0.60
        add.set_background_image(
            np.linspace(SKY, GROUND, 64).astype(np.uint8)[:, None].repeat(64, axis=1), "png"
        )
        add.set_up_direction("+z")
        add.configure_default_lights(enabled=False)
        add.add_light_ambient("/daylight", color=(255, 255, 255), intensity=0.5)
        add.add_light_directional(
            "/lamp",
            color=(255, 250, 240),
            intensity=1.2,
            position=(-0.4, 0.6, 1.1),
            cast_shadow=True,
        )
        add.world_axes.visible = False
        add.add_box(
            "/table", (205, 211, 216), (0.92, 0.88, 0.02), position=(0.22, 0.12, ground - 0.012)
        )
        add.add_grid("/grid", 0.92, 0.88, plane="xy", cell_size=0.1, section_size=0.1, cell_color=(180, 188, 196),
                     section_color=(180, 188, 196), position=(0.22, 0.12, ground - 0.001))  # fmt: skip
        add.add_cylinder("/foot", 0.06, 0.03, DARK, position=(0.0, 0.0, ground + 0.015))
        add.add_cylinder("/shoulder", 0.042, 0.052, STEEL, position=(0.0, 0.0, -0.004))
        along = (
            math.cos(math.pi / 4),
            0.0,
            math.sin(math.pi / 4),
            0.0,
        )  # a cylinder that lies along x
        self.link1 = add.add_frame("/link1", show_axes=False)
        add.add_cylinder("/link1/bar", 0.017, L1, DARK, wxyz=along, position=(0.5 * L1, 0.0, 0.0))
        self.link2 = add.add_frame("/link2", show_axes=False)
        add.add_cylinder("/link2/bar", 0.012, L2, BLUE, wxyz=along, position=(0.5 * L2, 0.0, 0.0))
        add.add_cylinder("/link2/elbow", 0.026, 0.048, STEEL)
        tip = ground + stage.THICKNESS - self.session.tool.depth
        add.add_cylinder(
            "/link2/tool", 0.5 * self.session.tool.width, -tip, STEEL, position=(L2, 0.0, 0.5 * tip)
        )
        add.add_cylinder("/link2/handle", 0.008, 0.045, DARK, position=(L2, 0.0, 0.022))
        add.add_icosphere("/link2/knob", 0.016, ORANGE, position=(L2, 0.0, 0.052))
        self.clay: Any = None
        if self.stage.field >= 0:
            grid = self.stage.removal
            x, y = (
                grid.x + self.session.scenario.origin[0],
                grid.y + self.session.scenario.origin[1],
            )
            self.plan, faces = _sheet(x, y)
            self.clay = add.add_mesh_simple(
                "/clay", self._vertices(), faces, color=(186, 100, 62), flat_shading=True, side="front",
                cast_shadow=False, receive_shadow=0.45,  # on itself it would be all stripes
            )  # fmt: skip
        self.target = add.add_transform_controls(
            "/hand", scale=0.12, active_axes=(True, True, False), disable_rotations=True
        )  # fmt: skip
        self.target.on_update(self._dragged)

    def _vertices(self) -> np.ndarray:
        """Corners of the clay's mesh [m], shape (n, 3): its surface, closed down to the table at the rim."""
        height = np.pad(self.stage.removal.heights(stage.THICKNESS), 1)
        return np.column_stack((self.plan, height.ravel() + stage.GROUND)).astype(np.float32)

    def _controls(self, uplot: Any) -> None:
        gui, s = self.server.gui, self.session.scenario
        gui.configure_theme(
            control_layout="fixed", control_width="medium", show_logo=False, show_share_button=False
        )
        self.verdict, self.status = gui.add_html(""), gui.add_markdown("")
        self.run = gui.add_button("Pause")
        reset = gui.add_button("Reset")
        self.keep = gui.add_checkbox("Record", True)
        self.hold = gui.add_checkbox(
            "Hand holds", False, hint="The hand pulls to the arrows' centre; drag it."
        )
        top = hardest(self.session.given)
        self.b = gui.add_slider(
            "Clay b [N.s/m]", 0.0, max(3.0 * top, 1.0), 1.0, top, disabled=not top
        )
        self.gain = gui.add_slider("Gain K", 0.1, 5.0, 0.05, min(max(s.gain[0], 0.1), 5.0))
        self.force = gui.add_slider("Force [N]", 0.0, 5.0, 0.1, 0.0)
        nothing = (np.array([0.0, 1.0]), np.zeros(2))
        form: Any = {
            "mode": 1,
            "scales": {"x": uplot.Scale(time=False)},
            "aspect": 2.0,
            "padding": (12, 4, 0, 0),
        }
        self.velocities = {
            i: gui.add_uplot(
                nothing,
                (uplot.Series(label=f"position {AXES[i]} [cm]"),
                 uplot.Series(label=f"v{AXES[i]} [cm/s]", stroke=INK["clay", i], width=2)),
                title=f"velocity along {AXES[i]}", **form,
            )
            for i in cut_axes(s)
        }  # fmt: skip
        lines = [(who, i) for i in self.velocities for who in ("hand", "clay")]
        self.forces = gui.add_uplot(
            (nothing[0], *(np.zeros(2) for _ in lines)),
            (uplot.Series(label="t [s]"),
             *(uplot.Series(label=f"{who} {AXES[i]} [N]", stroke=INK[who, i], width=2) for who, i in lines)),
            title="force against time", **form,
        )  # fmt: skip
        self.run.on_click(self._toggle)
        reset.on_click(self._reset)
        for slider, act in (
            (self.b, lambda: self.session.change(b=self.b.value / (top or 1.0))), (self.gain, self._gain),
            (self.force, self._press),
        ):  # fmt: skip
            slider.on_update(lambda _, slider=slider, act=act: self._slid(slider, act))
        for box, act in (
            (self.keep, lambda: setattr(self.session, "recording", self.keep.value)), (self.hold, self._hold)
        ):  # fmt: skip
            box.on_update(lambda _, act=act: self._locked(act))

    def _locked(self, act: Callable[[], None]) -> None:
        with self.player.lock:
            act()

    def _slid(self, slider: Any, act: Callable[[], None]) -> None:
        """Acts on a slider; a number typed beside it that is out of its range becomes the end of the range."""
        if slider.min <= slider.value <= slider.max:
            self._locked(act)
        else:
            slider.value = (
                slider.max if slider.value > slider.max else slider.min
            )  # a change that comes here again

    def _gain(self) -> None:
        first = self.session.given.gain
        self.session.change(gain=(self.gain.value, self.gain.value * first[1] / (first[0] or 1.0)))

    def _press(self) -> None:
        fx, fy = self.session.given.force
        size = math.hypot(fx, fy)
        self.session.push(
            (self.force.value * fx / size, self.force.value * fy / size)
            if size
            else (self.force.value, 0.0)
        )

    def _hold(self) -> None:
        if self.hold.value:
            x, y, _ = self.target.position
            self.session.pull(
                (x - self.session.scenario.origin[0], y - self.session.scenario.origin[1])
            )
        else:
            self.session.pull(None)

    def _dragged(self, _: Any) -> None:
        self.hold.value = True  # itself a change that is acted upon, but only the first
        self._locked(self._hold)

    def _toggle(self, _: Any) -> None:
        with self.player.lock:
            self.session.paused = not self.session.paused
            self.run.label = "Start" if self.session.paused else "Pause"

    def _reset(self, _: Any) -> None:
        with self.player.lock:
            self.session.restart()
            self._press()
            self.stage.whole()
            self.shown, self.cut = 1, -math.inf
            self.run.label, self.hold.value = "Pause", False

    def _refresh(self, now: float) -> None:
        session = self.session
        with self.player.lock:
            frames, first = session.frames, self.shown
            new = [f[1] for f in frames[first:]]
            self.shown = len(frames)
            frame, point, q = frames[-1], session.point, list(session.run.angles)
            clock, ended, paused, verdict = (
                session.clock,
                session.ended,
                session.paused,
                session.verdict(),
            )
            every = max(1, len(frames) // POINTS)
            some = frames[::every] if now - self.plotted > PLOT_EVERY else []
            self.stage.carve(new)
        with self.server.atomic():
            self.link1.wxyz = _about_z(q[0])
            self.link2.wxyz, self.link2.position = (
                _about_z(q[0] + q[1]),
                (L1 * math.cos(q[0]), L1 * math.sin(q[0]), 0.0),
            )
            if point is None:
                x, y = (a + b for a, b in zip(frame[1], session.scenario.origin, strict=True))
                self.target.position = (x, y, 0.052)
            if (
                self.clay
                and now - self.cut > CUT_EVERY
                and (self.stage.stale or self.cut == -math.inf)
            ):
                self.stage.stale, self.cut = False, now
                self.clay.vertices = self._vertices()
        if some:
            self.plotted = now
            t, p, v, fe, fh = (np.array(x) for x in zip(*some, strict=True))
            for i, plot in self.velocities.items():
                plot.data = _by_position(100.0 * p[:, i], 100.0 * v[:, i])
            self.forces.data = (t, *(f[:, i] for i in self.velocities for f in (fh, fe)))
            state = "ended" if ended else "paused" if paused else "playing"
            slow = ", this machine is too slow" if clock.slow else ""
            b = session.b
            self.status.content = (
                f"**{state}** {frame[0]:.1f} s, {clock.factor:.2f} x real{slow}  \n"
                f"b = {b[0]:.4g}, {b[1]:.4g} N.s/m here, hand {math.hypot(*frame[4]):.2f} N  \n"
                f"removed {1e6 * self.stage.removal.volume:.2f} cm³"
            )
            text = f"{ended}: reset to go on" if ended else verdict.text
            color = RED if verdict.unstable else GREEN if text.startswith("stable") else AMBER
            self.verdict.content = (
                f'<div style="background:{color};color:white;padding:0.4em 0.6em;margin:0 0.7em 0.5em;'
                f'border-radius:4px;font-size:0.85em">{html.escape(text)}</div>'
            )


def _about_z(angle: float) -> tuple[float, float, float, float]:
    return math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)


def _sheet(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A grid of corners in the plane, shape (n, 2), its rim doubled so that the edge falls steeply; and its faces."""
    x, y = (np.concatenate((a[:1], a, a[-1:])) for a in (x, y))
    plan = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    a = (np.arange(len(y) - 1)[:, None] * len(x) + np.arange(len(x) - 1)).ravel()
    faces = np.concatenate(
        (
            np.column_stack((a, a + 1, a + len(x))),
            np.column_stack((a + 1, a + len(x) + 1, a + len(x))),
        )
    )
    return plan, faces.astype(np.uint32)


def _by_position(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The curve as a function of x, which the plot wants: where the hand came by more than once, its last pass."""
    grid = np.linspace(x.min(), max(x.max(), x.min() + 0.1), POINTS)
    out = np.zeros(POINTS)
    for k in range(len(x) - 1):
        (a, ya), (b, yb) = sorted(((x[k], y[k]), (x[k + 1], y[k + 1])))
        i, j = np.searchsorted(grid, (a, b))
        out[i : j + 1] = np.interp(grid[i : j + 1], (a, b), (ya, yb))
    return grid, out


def _titled(page: bytes) -> bytes:
    """viser's page under our own title, which it has no setting for."""
    return page.replace(b"<title>Viser</title>", f"<title>{TITLE}</title>".encode(), 1)


def _name(host: str) -> str:
    """What to write in an address: of "all addresses" the one by which others know this machine."""
    if host in ("", "0.0.0.0", "::"):
        try:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
                s.connect(("192.0.2.1", 9))  # nowhere; asks for a route, sends nothing
                host = s.getsockname()[0]
        except OSError:
            host = socket.gethostname()
    return f"[{host}]" if ":" in host else host


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

    def __init__(
        self,
        host: str,
        port: int,
        inner: int,
        token: str = "",
        edit: Callable[[bytes], bytes] = bytes,
    ):
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
            self._server = self._loop.run_until_complete(
                asyncio.start_server(self._meet, host, port, limit=HEAD)
            )
        except OSError as error:
            self._loop.close()
            why = error.strerror.lower() if error.strerror else str(error)
            raise ParameterError(
                "port", port, f"{host} cannot be listened on ({why}): try --port 0, for any"
            ) from None
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
                await self._pass(
                    head[:-2] + f"{PASS}: {self.secret}\r\n\r\n".encode(), reader, writer
                )
            else:
                writer.write(await asyncio.wait_for(self._fetch(target), PATIENCE))
            await writer.drain()
        except (
            OSError,
            asyncio.IncompleteReadError,
            asyncio.LimitOverrunError,
            asyncio.CancelledError,
            TimeoutError,
        ):
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
            return (
                target,
                fields,
                _answer("400 Bad Request", b"hapticclay: not a request for a page\n"),
            )
        if not own:
            text = b"hapticclay: asked for under another name, or by another page: open the address printed at start\n"
            return target, fields, _answer("403 Forbidden", text)
        cookies = [c.strip().partition("=") for c in fields.get("Cookie", "").split(";")]
        if not self.token or any(
            name == COOKIE and self._right(value) for name, _, value in cookies
        ):
            return target, fields, b""
        if self._right(query.get("token", [""])[0]):
            cookie = f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            return (
                target,
                fields,
                _answer("303 See Other", b"", f"Location: /\r\nSet-Cookie: {cookie}\r\n"),
            )
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
            writer.write(
                f"GET {target} HTTP/1.1\r\nHost: 127.0.0.1:{self.inner}\r\n\r\n".encode("latin-1")
            )
            head, _, body = (await reader.read(-1)).partition(b"\r\n\r\n")
        finally:
            writer.close()
        line, _, rest = head.partition(b"\r\n")
        kind = http.client.parse_headers(io.BytesIO(rest)).get("Content-Type", "text/plain")
        return _answer(
            line.decode("latin-1").partition(" ")[2] or "502 Bad Gateway",
            self.edit(body),
            kind=kind,
        )

    async def _pass(
        self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", self.inner)
        try:
            inner_writer.write(head)
            ways = [
                asyncio.create_task(_copy(*x))
                for x in ((reader, inner_writer), (inner_reader, writer))
            ]
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
