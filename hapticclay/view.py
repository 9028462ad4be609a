"""A session in MuJoCo's own viewer: the mouse is the hand."""

from __future__ import annotations

import math
import queue
import threading
import time
from dataclasses import dataclass
from typing import Any

import mujoco
import mujoco.viewer
import numpy as np

from .errors import ParameterError
from .params import AXES
from .player import Player, Replay
from .session import FRAME, Session
from .stage import Stage, along, hardest

SPACE, BACKSPACE, RIGHT, LEFT, DOWN, UP = 32, 259, 262, 263, 264, 265  # GLFW's numbers
NAMES = {ord("1"): "constant", ord("2"): "variable", ord("3"): "free"}
FACTOR = 1.25  # by which a key changes K or b
PLOT_EVERY = 0.1  # [s]
HELP = (
    ("Ctrl + right drag", "pull the handle"),
    ("space", "pause"),
    ("backspace", "start anew"),
    ("up, down", "gain K"),
    ("left, right", "clay b"),
    ("1, 2, 3", "constant, variable, free"),
    ("R", "record on, off"),
    ("H", "this help"),
    ("drag, scroll", "camera"),
)


class Window:
    """The viewer's window on one scenario, until it is closed or another scenario is asked for.

    Attributes:
        wanted: name of that other scenario, "" when the window was closed.
    """

    def __init__(self, play: Session | Replay):
        self.play, self.wanted = play, ""
        self.stage = Stage(play.scenario, play.tool)
        self.stage.pose(_angles(play))
        self.stage.relief()
        self.keys: queue.SimpleQueue[int] = queue.SimpleQueue()
        self.help, self.shown = True, 1  # frames that the clay is cut by
        self.plots = [_Plot(*x) for x in _plots(play)]
        self.grip: np.ndarray | None = None  # where the mouse took hold, world [m]
        self.drawn = -1.0

    def show(self) -> None:
        """Shows it; returns when the window is closed, everything that it started gone."""
        player, before = Player(self.play), set(threading.enumerate())
        model, data = self.stage.model, self.stage.data
        try:
            viewer = mujoco.viewer.launch_passive(
                model, data, key_callback=self.keys.put, show_left_ui=False, show_right_ui=False
            )
        except Exception as error:  # GLFW's own, of no one kind
            raise ParameterError("display", str(error), "the window cannot be opened: try --web") from None
        try:
            with viewer.lock():
                viewer.cam.lookat[:] = (0.33, 0.19, -0.03)  # the plots cover the right
                viewer.cam.distance, viewer.cam.azimuth, viewer.cam.elevation = 0.80, 90.0, -55.0
                viewer.opt.sitegroup[:] = 0
                for flag in ("PERTOBJ", "PERTFORCE", "SELECT"):  # the target is shown as a ball of our own
                    viewer.opt.flags[getattr(mujoco.mjtVisFlag, f"mjVIS_{flag}")] = 0
            player.start()
            self._loop(viewer, player)
        finally:
            viewer.close()
            for thread in set(threading.enumerate()) - before - {player}:
                thread.join(timeout=10.0)
            if player.ident:
                player.stop()

    def _loop(self, viewer: Any, player: Player) -> None:
        body = self.stage.model.body("tool").id
        while viewer.is_running() and not self.wanted and player.error is None:
            begin = time.perf_counter()
            with player.lock:
                while not self.keys.empty():
                    self._key(self.keys.get())
                if self.wanted:
                    break
                if isinstance(self.play, Session):
                    self.play.pull(self._mouse(viewer))
                target = self.play.point if isinstance(self.play, Session) else None
                frames, angles = self.play.frames[self.shown - 1 :], _angles(self.play)
            self.stage.carve([f[1] for f in frames[1:]])
            self.shown += len(frames) - 1
            self.stage.pose(angles, target)
            if self.stage.relief():
                viewer.update_hfield(self.stage.field)
            if not viewer.perturb.active:
                viewer.perturb.select = body
                viewer.perturb.localpos[:] = (0.0, 0.0, 0.05)
            self._overlay(viewer)
            viewer.sync()
            time.sleep(max(0.001, FRAME - (time.perf_counter() - begin)))

    def _mouse(self, viewer: Any) -> tuple[float, float] | None:
        """Where the hand pulls to [m], while the mouse drags.

        The viewer moves its point in a plane through the grip, upright unless shift is held; what it gains in
        height counts as going away from the camera.
        """
        perturb = viewer.perturb
        if not perturb.active:
            self.grip = None
            return None
        at = np.array(perturb.refselpos)
        if self.grip is None:
            self.grip = at.copy()
            self.held = np.array(self.play.frames[-1][1])
        moved = at - self.grip
        azimuth = math.radians(viewer.cam.azimuth)
        x, y = self.held + moved[:2] + moved[2] * np.array([math.cos(azimuth), math.sin(azimuth)])
        return float(x), float(y)

    def _key(self, key: int) -> None:
        play = self.play
        if key == SPACE:
            play.paused = not play.paused
        elif key == BACKSPACE:
            play.restart()
            self.stage.whole()
            self.shown, self.drawn = 1, -1.0
            for plot in self.plots:
                plot.clear()
        elif key == ord("H"):
            self.help = not self.help
        elif isinstance(play, Session):
            s = play.scenario
            if key == ord("R"):
                play.recording = not play.recording
            elif key in (UP, DOWN):
                scale = FACTOR if key == UP else 1.0 / FACTOR
                play.change(gain=(s.gain[0] * scale, s.gain[1] * scale))
            elif key in (LEFT, RIGHT):
                play.change(b=play.damping * (FACTOR if key == RIGHT else 1.0 / FACTOR))
            elif key in NAMES:
                self.wanted = NAMES[key]

    def _overlay(self, viewer: Any) -> None:
        play = self.play
        t, p, v, fe, fh = play.frames[-1]
        if abs(t - self.drawn) < PLOT_EVERY and not (play.paused or play.ended):
            return
        self.drawn = t
        state = "paused" if play.paused else "ended" if play.ended else "recording"
        if isinstance(play, Session) and not play.recording:
            state = "not recording"
        s = play.scenario
        b = play.b if isinstance(play, Session) else _ratio(fe, v)
        rows = [
            ("time", f"{t:.1f} s, {play.clock.factor:.2f} x real{', machine too slow' if play.clock.slow else ''}"),
            ("state", play.ended or state),
            ("K", f"{s.gain[0]:.3g}, {s.gain[1]:.3g}"),
            ("b", f"{b[0]:.4g} N.s/m; clay {hardest(s):.4g}"),
            ("fh", f"{math.hypot(*fh):.2f} N"),
            ("removed", f"{1e6 * self.stage.removal.volume:.2f} cm3"),
        ]
        font = mujoco.mjtFontScale.mjFONTSCALE_100
        top, bottom = mujoco.mjtGridPos.mjGRID_TOPLEFT, mujoco.mjtGridPos.mjGRID_BOTTOMLEFT
        texts = [(font, top, *("\n".join(column) for column in zip(*rows, strict=True)))]
        if self.help:
            texts.append((font, bottom, *("\n".join(column) for column in zip(*HELP, strict=True))))
        viewer.set_texts(texts)
        room = viewer.viewport
        if room is not None and room.width > 400:
            width, height = int(0.32 * room.width), room.height // 3
            for plot in self.plots:
                plot.extend(play.frames)
            viewer.set_figures([
                (mujoco.MjrRect(room.width - width, room.height - (i + 1) * height, width, height), plot.figure)
                for i, plot in enumerate(self.plots)
            ])  # fmt: skip


def _angles(play: Session | Replay) -> list[float]:
    return list(play.run.angles) if isinstance(play, Session) else play.source.q[play.n].tolist()


def _ratio(force: tuple[float, float], v: tuple[float, float]) -> tuple[float, float]:
    """force/v on each axis [N.s/m], 0 where the handle stands still."""
    x, y = (f / u if abs(u) > 1e-4 else 0.0 for f, u in zip(force, v, strict=True))
    return x, y


def _plots(play: Session | Replay) -> list[tuple]:
    """Title, label of x, colours and points (x, y...) of a frame, for each plot."""
    blue, green = (0.0, 0.45, 0.70), (0.0, 0.62, 0.45)
    i = along(play.scenario)
    a = AXES[i]
    return [
        (f"velocity along {a} [cm/s]", f"{a} [cm]", (blue,), lambda f: (100 * f[1][i], 100 * f[2][i])),
        ("clay, fe/v [N.s/m]", f"{a} [cm]", (blue,), lambda f: (100 * f[1][i], _ratio(f[3], f[2])[i])),
        ("force of hand (green), of clay (blue) [N]", "time [s]", (green, blue), lambda f: (f[0], f[4][i], f[3][i])),
    ]


@dataclass
class _Plot:
    """One of the viewer's figures, with at most so many points as it takes."""

    title: str
    xlabel: str
    colors: tuple[tuple[float, float, float], ...]
    point: Any

    def __post_init__(self):
        figure = self.figure = mujoco.MjvFigure()
        mujoco.mjv_defaultFigure(figure)
        figure.title, figure.xlabel = self.title, self.xlabel
        figure.flg_extend = figure.flg_legend = 0
        figure.flg_ticklabel[:] = 1
        figure.xformat, figure.yformat = "%.3g", "%.3g"
        figure.figurergba[:] = (1.0, 1.0, 1.0, 0.88)
        figure.panergba[:] = (1.0, 1.0, 1.0, 1.0)
        figure.gridrgb[:] = (0.85, 0.85, 0.85)
        figure.textrgb[:] = (0.1, 0.1, 0.1)
        figure.linewidth = 2.0
        for j, color in enumerate(self.colors):
            figure.linergb[j] = color
        self.clear()

    def clear(self) -> None:
        self.points: list[tuple[float, ...]] = []
        self.seen, self.stride = 0, 1
        self.figure.linepnt[:] = 0

    def extend(self, frames: list) -> None:
        """Takes the frames that are new."""
        new = range(self.seen, len(frames))
        self.points += [self.point(frames[k]) for k in new if k % self.stride == 0]
        self.seen = len(frames)
        while len(self.points) >= mujoco.mjMAXLINEPNT - 1:
            self.points, self.stride = self.points[::2], 2 * self.stride
        if not self.points:
            return
        data = np.array(self.points)
        n = len(data)
        for j in range(len(self.colors)):
            self.figure.linepnt[j] = n
            self.figure.linedata[j, 0 : 2 * n : 2] = data[:, 0]
            self.figure.linedata[j, 1 : 2 * n : 2] = data[:, 1 + j]
        for axis, values, least in ((0, data[:, 0], 5.0), (1, data[:, 1:], 1.0)):
            low, high, lines = _round(float(values.min()), float(values.max()), least)
            self.figure.range[axis], self.figure.gridsize[axis] = (low, high), lines


def _round(low: float, high: float, least: float) -> tuple[float, float, int]:
    """Whole limits, as the engine makes them in any case, around a range of at least that size, at least 1.

    Returns:
        (low, high, number of grid lines), the lines at round steps.
    """
    high = max(high, low + least)
    step = 10.0 ** math.floor(math.log10(high - low))
    step *= next(f for f in (0.2, 0.5, 1.0, 2.0) if (high - low) / (f * step) <= 5.0)
    whole = max(step, 1.0)
    first, last = (n * whole for n in (math.floor(low / whole + 0.05), math.ceil(high / whole - 0.05)))
    if step < 1.0:
        step = 0.2 if last - first <= 1.0 else 0.5
    return first, last, round((last - first) / step) + 1
