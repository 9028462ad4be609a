"""A session in a browser, for people without a desktop: viser's scene, sliders and plots."""

from __future__ import annotations

import html
import math
import secrets
import socket
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import ParameterError, integer
from ..model.scenario import AXES, L1, L2
from ..stepping import scene
from .gate import LOCAL, PASS, Gate
from .player import Player
from .session import Session
from .stage import Stage, cut_axes, hardest

FRAME = 1.0 / 30.0  # [s] between two looks of the browser
CUT_EVERY, PLOT_EVERY = 0.2, 0.5  # [s] between two states of the clay, and of the plots
POINTS = 400  # of a plot
TITLE = "hapticclay"
SKY, GROUND = (236, 240, 245), (214, 220, 228)  # behind the scene, above and below
RED, GREEN, AMBER = "#c92a2a", "#0d6b52", "#b86b00"  # behind the verdict
INK = {("hand", 0): "#009E73", ("clay", 0): "#0072B2", ("hand", 1): "#E69F00", ("clay", 1): "#D55E00"}
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
            raise ParameterError("web", "viser", "is not installed: pip install 'hapticclay[web]'") from None
        self.session = session
        port, local = integer("port", port, 0, 65535), host in LOCAL
        self.console = rich.get_console()
        self.quiet, self.console.quiet = self.console.quiet, True  # viser's boxes name the port behind the gate
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
        add, ground = self.server.scene, scene.GROUND
        camera = self.server.initial_camera
        camera.position, camera.look_at, camera.fov = (0.21, -0.66, 0.64), (0.18, 0.15, -0.04), 0.60
        add.set_background_image(np.linspace(SKY, GROUND, 64).astype(np.uint8)[:, None].repeat(64, axis=1), "png")
        add.set_up_direction("+z")
        add.configure_default_lights(enabled=False)
        add.add_light_ambient("/daylight", color=(255, 255, 255), intensity=0.5)
        add.add_light_directional(
            "/lamp", color=(255, 250, 240), intensity=1.2, position=(-0.4, 0.6, 1.1), cast_shadow=True
        )
        add.world_axes.visible = False
        add.add_box("/table", (205, 211, 216), (0.92, 0.88, 0.02), position=(0.22, 0.12, ground - 0.012))
        add.add_grid("/grid", 0.92, 0.88, plane="xy", cell_size=0.1, section_size=0.1, cell_color=(180, 188, 196),
                     section_color=(180, 188, 196), position=(0.22, 0.12, ground - 0.001))  # fmt: skip
        add.add_cylinder("/foot", 0.06, 0.03, DARK, position=(0.0, 0.0, ground + 0.015))
        add.add_cylinder("/shoulder", 0.042, 0.052, STEEL, position=(0.0, 0.0, -0.004))
        along = (math.cos(math.pi / 4), 0.0, math.sin(math.pi / 4), 0.0)  # a cylinder that lies along x
        self.link1 = add.add_frame("/link1", show_axes=False)
        add.add_cylinder("/link1/bar", 0.017, L1, DARK, wxyz=along, position=(0.5 * L1, 0.0, 0.0))
        self.link2 = add.add_frame("/link2", show_axes=False)
        add.add_cylinder("/link2/bar", 0.012, L2, BLUE, wxyz=along, position=(0.5 * L2, 0.0, 0.0))
        add.add_cylinder("/link2/elbow", 0.026, 0.048, STEEL)
        tip = ground + scene.THICKNESS - self.session.tool.depth
        add.add_cylinder("/link2/tool", 0.5 * self.session.tool.width, -tip, STEEL, position=(L2, 0.0, 0.5 * tip))
        add.add_cylinder("/link2/handle", 0.008, 0.045, DARK, position=(L2, 0.0, 0.022))
        add.add_icosphere("/link2/knob", 0.016, ORANGE, position=(L2, 0.0, 0.052))
        self.clay: Any = None
        if self.stage.field >= 0:
            grid = self.stage.removal
            x, y = grid.x + self.session.scenario.origin[0], grid.y + self.session.scenario.origin[1]
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
        height = np.pad(self.stage.removal.heights(scene.THICKNESS), 1)
        return np.column_stack((self.plan, height.ravel() + scene.GROUND)).astype(np.float32)

    def _controls(self, uplot: Any) -> None:
        gui, s = self.server.gui, self.session.scenario
        gui.configure_theme(control_layout="fixed", control_width="medium", show_logo=False, show_share_button=False)
        self.verdict, self.status = gui.add_html(""), gui.add_markdown("")
        self.run = gui.add_button("Pause")
        reset = gui.add_button("Reset")
        self.keep = gui.add_checkbox("Record", True)
        self.hold = gui.add_checkbox("Hand holds", False, hint="The hand pulls to the arrows' centre; drag it.")
        top = hardest(self.session.given)
        self.b = gui.add_slider("Clay b [N.s/m]", 0.0, max(3.0 * top, 1.0), 1.0, top, disabled=not top)
        self.gain = gui.add_slider("Gain K", 0.1, 5.0, 0.05, min(max(s.gain[0], 0.1), 5.0))
        self.force = gui.add_slider("Force [N]", 0.0, 5.0, 0.1, 0.0)
        nothing = (np.array([0.0, 1.0]), np.zeros(2))
        form: Any = {"mode": 1, "scales": {"x": uplot.Scale(time=False)}, "aspect": 2.0, "padding": (12, 4, 0, 0)}
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
            slider.value = slider.max if slider.value > slider.max else slider.min  # a change that comes here again

    def _gain(self) -> None:
        first = self.session.given.gain
        self.session.change(gain=(self.gain.value, self.gain.value * first[1] / (first[0] or 1.0)))

    def _press(self) -> None:
        fx, fy = self.session.given.force
        size = math.hypot(fx, fy)
        self.session.push(
            (self.force.value * fx / size, self.force.value * fy / size) if size else (self.force.value, 0.0)
        )

    def _hold(self) -> None:
        if self.hold.value:
            x, y, _ = self.target.position
            self.session.pull((x - self.session.scenario.origin[0], y - self.session.scenario.origin[1]))
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
            clock, ended, paused, verdict = session.clock, session.ended, session.paused, session.verdict()
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
            if self.clay and now - self.cut > CUT_EVERY and (self.stage.stale or self.cut == -math.inf):
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
        (np.column_stack((a, a + 1, a + len(x))), np.column_stack((a + 1, a + len(x) + 1, a + len(x))))
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
