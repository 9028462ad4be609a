"""A session in a browser: viser's scene, sliders and plots, for people without a desktop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..kernel.engine import mujoco
from ..live.frame import Frame
from ..live.session import Session
from ..live.status import banner, status
from ..model.constants import AXES
from .captions import unit_text
from .live_page import PLOT_TIME, LivePage, banner_html
from .palette import (
    CLAY_DEEP,
    FORCE_COLORS,
    cutting_force,
    rgb_bytes,
)
from .stage import ARROW_WIDTH, GROUND, THICKNESS, Stage, hardest, plotted_axes, room_scale

CLAY_TIME = 0.2  # [s] between two updates of the clay
PLOT_POINTS = 400
MOST_FORCE = 5.0  # [N] of the slider, or twice what cuts harder clay


class Page(LivePage):
    """The page of a session, served until `close`; `url` has the token that it may need."""

    def __init__(self, session: Session, host: str = "127.0.0.1", port: int = 8080):
        """Begins to serve the page."""
        super().__init__(session, host, port)
        import viser

        self.session = session
        self.stage = Stage(session.scenario, session.tool)
        self._shown = 1  # frames that have cut the clay
        self._clay_time = self._plot_time = -math.inf  # of their last updates [s]
        self._scene()
        self._controls(viser.uplot)

    def _scene(self) -> None:
        add, size = self.server.scene, room_scale(self.session.scenario.planar_arm)
        camera = self.server.initial_camera
        camera.position = (0.21 * size, -0.66 * size, 0.64 * size)
        camera.look_at, camera.fov = (0.18 * size, 0.15 * size, -0.04), 0.60
        self._light()
        table = self.stage.model.geom("table")
        width, depth, _ = 2.0 * table.size
        self._table(table.pos, width, depth, 0.1)
        self._draw_arm()
        self._clay: Any = None
        if self.stage.field >= 0:
            grid, origin = self.stage.removal, self.session.scenario.origin
            self._plan, faces = _clay_sheet(grid.x + origin[0], grid.y + origin[1])
            look: Any = dict(color=rgb_bytes(CLAY_DEEP), flat_shading=True, side="front")
            look.update(cast_shadow=False, receive_shadow=0.45)  # self-shadowing gives stripes
            self._clay = add.add_mesh_simple("/clay", self._vertices(), faces, **look)
        self._arrow: Any = None
        if self.session.scenario.clay and self.session.scenario.clay.holding:
            look = dict(shaft_radius=0.5 * ARROW_WIDTH, head_radius=1.2 * ARROW_WIDTH)
            look.update(head_length=3.0 * ARROW_WIDTH, visible=False)
            self._arrow = add.add_arrows("/force", np.zeros((1, 2, 3)), (0, 0, 0), **look)
        in_plane: Any = dict(active_axes=(True, True, False), disable_rotations=True)
        self.target = add.add_transform_controls("/hand", scale=0.12, **in_plane)
        self.target.on_update(self._dragged)

    def _draw_arm(self) -> None:
        """Adds foot, links and tool: the round geoms of the stage, in a frame for each body."""
        add, model = self.server.scene, self.stage.model
        self._bodies: dict[str, Any] = {}
        for i, kind in enumerate(map(mujoco.mjtGeom, model.geom_type)):
            body, name = model.body(model.geom_bodyid[i]).name, kind.name.removeprefix("mjGEOM_")
            if body == "target" or name not in ("SPHERE", "CYLINDER", "CAPSULE"):
                continue
            if body not in self._bodies:
                self._bodies[body] = add.add_frame(f"/{body}", show_axes=False)
            color = tuple(
                (255 * model.mat_rgba[model.geom_matid[i], :3]).round().astype(int).tolist()
            )
            (radius, half, _), place = model.geom_size[i], dict(position=model.geom_pos[i])
            if name == "SPHERE":
                add.add_icosphere(f"/{body}/{i}", radius, color, **place)
            else:
                place["wxyz"] = model.geom_quat[i]
                add.add_cylinder(f"/{body}/{i}", radius, 2.0 * half, color, **place)

    def _vertices(self) -> np.ndarray:
        """Corners of the clay's mesh [m], shape (n, 3): its surface, closed down to the table."""
        height = np.pad(self.stage.removal.heights(THICKNESS), 1)
        return np.column_stack((self._plan, height.ravel() + GROUND)).astype(np.float32)

    def _controls(self, uplot: Any) -> None:
        gui, session = self.server.gui, self.session
        look: Any = dict(show_logo=False, show_share_button=False)
        gui.configure_theme(control_layout="fixed", control_width="medium", **look)
        self.verdict, self.status = gui.add_html(""), gui.add_markdown("")
        self.run = gui.add_button("Pause")
        reset = gui.add_button("Reset")
        self.keep = gui.add_checkbox("Record", True)
        hint = "The hand pulls towards the arrows; drag them."
        self.hold = gui.add_checkbox("Hand holds", False, hint=hint)
        top, gain, name, step = hardest(session.given), session.gain[0], "Clay b [N·s/m]", 1.0
        clay, most = session.given.clay, MOST_FORCE
        if clay and not clay.viscous:
            top, name, step = 1.0, "Clay strength [times]", 0.05
            most = max(most, float(math.ceil(min(2.0 * cutting_force(clay), 1e3))))
        limit = max(3.0 * top, 1.0)
        self.b = gui.add_slider(name, 0.0, limit, step, top, disabled=not top)
        self.gain = gui.add_slider("Gain K", 0.1, 5.0, 0.05, min(max(gain, 0.1), 5.0))
        self.force = gui.add_slider("Force [N]", 0.0, most, 0.1, 0.0)
        self._plots(uplot)
        self.run.on_click(self._toggle)
        reset.on_click(self._reset)
        acts = (
            (self.b, lambda: session.change(b=self.b.value / (top or 1.0))),
            (self.gain, self._change_gain),
            (self.force, self._press),
        )
        for slider, act in acts:
            slider.on_update(lambda _, slider=slider, act=act: self._slid(slider, act))
        self.keep.on_update(
            lambda _: self._locked(lambda: setattr(session, "recording", self.keep.value))
        )
        self.hold.on_update(lambda _: self._locked(self._hold))

    def _plots(self, uplot: Any) -> None:
        zero = np.zeros(2)
        form: Any = dict(mode=1, aspect=2.0, padding=(12, 4, 0, 0))
        form["scales"] = {"x": uplot.Scale(time=False)}

        def line(label: str, *key: Any) -> Any:
            return uplot.Series(label=label, stroke=FORCE_COLORS[key], width=2)

        self._velocities = {}
        for i in plotted_axes(self.session.scenario):
            a = AXES[i]
            labels = uplot.Series(label=f"position {a} [cm]"), line(f"v{a} [cm/s]", "clay", i)
            self._velocities[i] = self.server.gui.add_uplot(
                (np.array([0.0, 1.0]), zero), labels, title=f"velocity along {a}", **form
            )
        whose = [(who, i) for i in self._velocities for who in ("hand", "clay")]
        labels = [line(f"{who} {AXES[i]} [N]", who, i) for who, i in whose]
        self._forces = self.server.gui.add_uplot(
            (np.array([0.0, 1.0]), *(zero for _ in whose)),
            (uplot.Series(label="t [s]"), *labels),
            title="force over time",
            **form,
        )

    def _change_gain(self) -> None:
        first = self.session.given.gain
        K = self.gain.value
        self.session.change(gain=(K, K * first[1] / (first[0] or 1.0)))

    def _press(self) -> None:
        """Presses along the scenario's force, or along x if there is none."""
        fx, fy = self.session.given.force[:2]
        size = math.hypot(fx, fy)
        along = (fx / size, fy / size) if size else (1.0, 0.0)
        self.session.push((self.force.value * along[0], self.force.value * along[1]))

    def _hold(self) -> None:
        (x, y, _), origin = self.target.position, self.session.scenario.origin
        self.session.pull((x - origin[0], y - origin[1]) if self.hold.value else None)

    def _reset(self, _: Any) -> None:
        with self.player.lock:
            self.session.restart()
            self._press()
            self.stage.restore()
            self._shown, self._clay_time = 1, -math.inf
            self.run.label, self.hold.value = "Pause", False

    def _refresh(self, now: float) -> None:
        session = self.session
        with self.player.lock:
            frames = session.frames
            new, self._shown = frames[self._shown :], len(frames)
            frame, q = frames[-1], session.angles
            plots_due = now - self._plot_time > PLOT_TIME
            plotted = frames[:: max(1, len(frames) // PLOT_POINTS)] if plots_due else []
            verdict = self._banner() if plots_due else ""
            text = self._status() if plots_due else ""
            self.stage.carve([f.p for f in new])
        with self.server.atomic():
            self.stage.pose(q)
            for name, body in self._bodies.items():
                place = self.stage.data.body(name)
                body.position, body.wxyz = place.xpos, place.xquat
            if self._arrow:
                self._point_arrow(frame)
            x, y = np.add(frame.p, session.scenario.origin).tolist()
            self._follow((x, y, 0.052))
            changed = self.stage.stale or self._clay_time == -math.inf
            if self._clay and changed and now - self._clay_time > CLAY_TIME:
                self.stage.stale, self._clay_time = False, now
                self._clay.vertices = self._vertices()
        if plots_due:
            self._plot_time = now
            t, p, v, fe, fh, _ = (np.array(x) for x in zip(*plotted, strict=True))
            for i, plot in self._velocities.items():
                plot.data = _by_position(100.0 * p[:, i], 100.0 * v[:, i])
            self._forces.data = (t, *(f[:, i] for i in self._velocities for f in (fh, fe)))
            removed = f"removed {1e6 * self.stage.removal.volume:.2f} cm\u00b3"
            self.status.content, self.verdict.content = f"{text}  \n{removed}", verdict

    def _point_arrow(self, frame: Frame) -> None:
        """Shows the force of yielding clay."""
        stage = self.stage
        stage.push(frame.fe, all(frame.held))
        if stage.arrow is not None:
            points = np.stack((stage.arrow.begin, stage.arrow.end))[None]
            self._arrow.points = points.astype(np.float32)
            self._arrow.colors = np.array(rgb_bytes(stage.arrow.color), dtype=np.uint8)
        self._arrow.visible = stage.arrow is not None

    def _status(self) -> str:
        line = status(self.session)
        clay = unit_text(line["clay"])
        return f"**{line['state']}** {line['time']}  \n{clay}, hand {line['fh']}"

    def _banner(self) -> str:
        text, unstable = banner(self.session, "press Reset to start again")
        return banner_html(text, unstable)


def _clay_sheet(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a grid in the plane, shape (n, 2), and its faces; the rim is double, for walls."""
    x, y = (np.concatenate((a[:1], a, a[-1:])) for a in (x, y))
    plan = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    a = (np.arange(len(y) - 1)[:, None] * len(x) + np.arange(len(x) - 1)).ravel()
    b, c, d = a + 1, a + len(x), a + len(x) + 1
    faces = np.concatenate((np.column_stack((a, b, c)), np.column_stack((b, d, c))))
    return plan, faces.astype(np.uint32)


def _by_position(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The curve as a function of x, as uPlot requires; of repeated passes the last."""
    grid = np.linspace(x.min(), max(x.max(), x.min() + 0.1), PLOT_POINTS)
    out = np.zeros(PLOT_POINTS)
    for k in range(len(x) - 1):
        (a, ya), (b, yb) = sorted(((x[k], y[k]), (x[k + 1], y[k + 1])))
        i, j = np.searchsorted(grid, (a, b))
        out[i : j + 1] = np.interp(grid[i : j + 1], (a, b), (ya, yb))
    return grid, out
