"""MuJoCo's viewer in a separate process, which `window` starts and answers.

When its window is closed, the viewer's thread, which holds the interpreter, deletes the condition
on which another thread may wait in `update_hfield`: both threads hang. A lost display ends the
process. In a separate process either costs a picture, not the session.
"""

from __future__ import annotations

import functools
import math
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..kernel.engine import mujoco
from ..live.clock import FRAME_TIME
from ..live.frame import Frame
from ..model.clay import Clay
from ..model.constants import AXES
from ..scene.scenario import Scenario
from ..studies.removal import Tool
from .motion import resolved
from .palette import BLACK, COLOR_NAMES, FORCE_COLORS, PALE_GREY, WHITE, rgb, verdict_color
from .stage import Stage, plotted_axes, room_scale

Rows = tuple[tuple[str, str], ...]
PLOTS_WIDTH = 0.32  # of the window's
BANNER_HEIGHT = 0.05, 36  # of the window's, and at least [pixels]
TEXT_WIDTH = 0.24, 290  # of the window's, and at least [pixels]


class Writing(NamedTuple):
    """Texts of the window."""

    rows: Rows  # name and value of each line beside the picture
    keys: Rows  # key and effect of each line of help; empty for no help
    verdict: str  # on the loop, above the picture
    unstable: bool  # whether the arm swings with growing amplitude


class Sight(NamedTuple):
    """The next content of the window."""

    frames: list[Frame]  # of the session since the last one shown
    anew: bool  # whether they restart, with uncut clay
    angles: list[float]  # of the arm [rad]
    target: tuple[float, float] | None  # target point of the hand [m]; None if it does not pull
    writing: Writing | None  # None to keep the old texts


class Pane:
    """The picture of one scenario and the plots beside it."""

    def __init__(self, scenario: Scenario, tool: Tool):
        """Prepares the picture."""
        self.stage = Stage(scenario, tool)
        self.plots = _plots(plotted_axes(scenario), scenario.clay)
        self.frames: list[Frame] = []
        self.banner = _banner()
        self.rows: Rows = ()
        self.keys: Rows = ()

    def take(self, sight: Sight) -> None:
        """Updates the content; texts and plots change when there are new texts."""
        if sight.anew:
            self.stage.restore()
            self.frames = []
            for plot in self.plots:
                plot.clear()
        new = sight.frames if sight.anew else sight.frames[1:]
        self.stage.carve([f.p for f in new])
        self.frames += new
        self.stage.pose(sight.angles, sight.target)
        if self.frames:
            self.stage.push(self.frames[-1].fe, all(self.frames[-1].held))
        if words := sight.writing:
            self.rows = (*words.rows, ("removed", f"{1e6 * self.stage.removal.volume:.2f} cm3"))
            self.keys = words.keys
            self.banner.title = words.verdict
            color = verdict_color(words.verdict, words.unstable)
            self.banner.figurergba[:] = (*rgb(color), 1.0)
            for plot in self.plots:
                plot.extend(self.frames)

    def show(self, keys: Callable[[], list[int]], viewer: Any, ask: Callable[[Any], Sight]) -> None:
        """Shows answers until the process ends."""
        body = self.stage.model.body("tool").id
        with viewer.lock():
            scale = room_scale(
                self.stage.scenario.planar_arm
            )  # texts cover the left, plots the right
            viewer.cam.lookat[:] = (0.252 * scale, 0.17 * scale, -0.03)
            viewer.cam.distance, viewer.cam.azimuth, viewer.cam.elevation = (
                1.05 * scale,
                90.0,
                -55.0,
            )
            viewer.opt.sitegroup[:] = 0
            for flag in ("PERTOBJ", "PERTFORCE", "SELECT"):  # our own ball shows the target
                viewer.opt.flags[getattr(mujoco.mjtVisFlag, f"mjVIS_{flag}")] = 0
            groups = viewer.opt.geomgroup.copy()
        grip: np.ndarray | None = None
        while True:
            begin = time.perf_counter()
            with viewer.lock():
                hand, grip = _mouse_displacement(viewer, grip)
                viewer.opt.geomgroup[:] = groups  # undo the viewer's own 1, 2, 3
                if hand is None:
                    viewer.perturb.select, viewer.perturb.localpos[:] = body, (0.0, 0.0, 0.05)
            sight = ask((keys(), hand))
            self.take(sight)
            if self.stage.relief():
                viewer.update_hfield(self.stage.field)
            if sight.writing:
                self._write(viewer)
            with viewer.lock():
                viewer.user_scn.ngeom = 0
                self.stage.draw_arrow(viewer.user_scn)
            viewer.sync()
            time.sleep(max(0.001, FRAME_TIME - (time.perf_counter() - begin)))

    def _write(self, viewer: Any) -> None:
        font, room = mujoco.mjtFontScale.mjFONTSCALE_100, viewer.viewport
        texts = []
        for place, rows in (("TOPLEFT", self.rows), ("BOTTOMLEFT", self.keys)):
            if rows:
                columns = ("\n".join(column) for column in zip(*rows, strict=True))
                texts.append((font, getattr(mujoco.mjtGridPos, f"mjGRID_{place}"), *columns))
        viewer.set_texts(texts)
        if room is None or room.width <= 400:
            return
        banner = max(int(BANNER_HEIGHT[0] * room.height), BANNER_HEIGHT[1])
        left = max(int(TEXT_WIDTH[0] * room.width), TEXT_WIDTH[1])
        width, height = int(PLOTS_WIDTH * room.width), (room.height - banner) // len(self.plots)
        top = mujoco.MjrRect(left, room.height - banner, room.width - left, banner)
        figures = [(top, self.banner)]
        for i, plot in enumerate(self.plots):
            bottom = room.height - banner - (i + 1) * height
            figures.append((mujoco.MjrRect(room.width - width, bottom, width, height), plot.figure))
        viewer.set_figures(figures)


def _mouse_displacement(viewer: Any, grip: np.ndarray | None) -> tuple[Any, np.ndarray | None]:
    """Displacement of the mouse since it grabbed (x, y) [m], None if it does not grab; and grip.

    The viewer moves its point in a plane through the grip, upright unless shift is held: height
    counts as distance from the camera.
    """
    if not viewer.perturb.active & mujoco.mjtPertBit.mjPERT_TRANSLATE:
        return None, None
    at = np.array(viewer.perturb.refselpos)
    grip = at if grip is None else grip
    moved, azimuth = at - grip, math.radians(viewer.cam.azimuth)
    x, y = moved[:2] + moved[2] * np.array([math.cos(azimuth), math.sin(azimuth)])
    return (float(x), float(y)), grip


def run_viewer() -> None:
    """Runs the viewer's process.

    Reads (scenario, tool); then, for every picture, sends (keys, hand) and reads a Sight. Ends when
    there is no answer.
    """
    import glfw  # glfw and the viewer need the libraries of a desktop
    import mujoco.viewer

    for name in ("SIGINT", "SIGHUP"):  # the session handles signals of the shared terminal
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of the viewer

    def ask(message: Any) -> Any:
        try:
            pickle.dump(message, sink)
            sink.flush()
            return pickle.load(source)
        except (EOFError, OSError):
            os._exit(0)

    def fail(error: BaseException) -> None:
        ask("".join(traceback.format_exception(error)))

    class Simulate(mujoco.viewer._Simulate):
        def destroy(self) -> None:
            """Ends the process with the window, before objects are deleted that a thread awaits."""
            os._exit(0)

    mujoco.viewer._Simulate = Simulate
    threading.excepthook = lambda args: fail(args.exc_value or args.exc_type())
    try:
        _probe(glfw)
        pane = Pane(*pickle.load(source))
        pressed: list[int] = []

        def keys() -> list[int]:
            count = len(pressed)
            taken, pressed[:count] = pressed[:count], []
            return taken

        viewer = mujoco.viewer.launch_passive(
            pane.stage.model,
            pane.stage.data,
            key_callback=pressed.append,
            show_left_ui=False,
            show_right_ui=False,
        )
        pane.show(keys, viewer, ask)
    except Exception as error:
        fail(error)


def _probe(glfw: Any) -> None:
    """Opens and closes a window: where that fails the viewer would end the process."""
    if not glfw.init():
        raise OSError("does not answer")
    glfw.window_hint(glfw.VISIBLE, False)
    window = glfw.create_window(64, 64, "", None, None)
    if not window:
        raise OSError("has no OpenGL, libgl1 may be missing")
    glfw.destroy_window(window)
    glfw.default_window_hints()


def _banner() -> mujoco.MjvFigure:
    """An empty figure whose title is the verdict."""
    figure = mujoco.MjvFigure()
    mujoco.mjv_defaultFigure(figure)
    figure.flg_extend = figure.flg_legend = 0
    figure.flg_ticklabel[:] = 0
    figure.textrgb[:] = rgb(WHITE)
    figure.panergba[:] = 0.0
    figure.gridsize[:] = 2
    figure.gridwidth = 0.0
    return figure


Point = Callable[[Frame, int], tuple[float, float]]  # x and y of a curve at a frame, of an axis


def _ratio_point(f: Frame, i: int) -> tuple[float, float]:
    """Position [cm] and fe/v [N.s/m], NaN where the handle is at rest."""
    return 100.0 * f.p[i], f.fe[i] / f.v[i] if abs(f.v[i]) > 1e-4 else math.nan


def _law_point(f: Frame, i: int, clay: Clay) -> tuple[float, float]:
    """Velocity [cm/s] and force of the clay, along the motion if it resists so; NaN in air."""
    (v,), (fe,) = resolved(clay, np.array([f.v]), np.array([f.fe]), i)
    return (100.0 * float(v), float(fe)) if any(f.fe) else (math.nan, math.nan)


def _plots(axes: tuple[int, ...], clay: Clay | None = None) -> tuple[LivePlot, ...]:
    """Velocity over position, the clay's law, and forces over time, along these axes.

    The law of viscous clay is shown as fe/v over position. Otherwise fe is shown, over velocity
    where velocity determines it; in clay that resists along the motion, along the motion.
    """
    hands, clays = ({i: FORCE_COLORS[who, i] for i in axes} for who in ("hand", "clay"))

    def curves(colors: dict[int, str], point: Point) -> list[tuple[str, Any]]:
        return [(color, lambda f, i=i: point(f, i)) for i, color in colors.items()]

    place, named = f"{AXES[axes[0]]} [cm]", ""
    if len(axes) > 1:
        place = "position [cm]"
        named = ": " + ", ".join(f"{AXES[i]} {COLOR_NAMES[clays[i]]}" for i in axes)
    if clay is None or clay.viscous:
        ratios = curves(clays, _ratio_point)
        law = LivePlot(f"clay, fe/v [N.s/m]{named}", place, ratios, 10.0)
    elif not clay.of_velocity:
        forces = curves(clays, lambda f, i: (100.0 * f.p[i], f.fe[i]))
        law = LivePlot(f"clay, fe [N]{named}", place, forces, 0.1)
    else:
        one = dict(list(clays.items())[:1]) if clay.along_motion else clays
        along = " along the motion" if clay.along_motion else named
        points = curves(one, functools.partial(_law_point, clay=clay))
        law = LivePlot(f"clay, fe [N]{along}", "velocity [cm/s]", points, 0.1)
    velocities = curves(clays, lambda f, i: (100.0 * f.p[i], 100.0 * f.v[i]))
    both = curves(hands, lambda f, i: (f.t, f.fh[i])) + curves(clays, lambda f, i: (f.t, f.fe[i]))
    whose = "; ".join(
        f"{who} {', '.join(COLOR_NAMES[color] for color in colors.values())}"
        for who, colors in (("hand", hands), ("clay", clays))
    )
    return (
        LivePlot(f"velocity [cm/s]{named}", place, velocities, 0.1),
        law,
        LivePlot(f"force [N]: {whose}", "time [s]", both, 0.1),
    )


class LivePlot:
    """A plot that grows with the session, drawn by the engine up to its number of points."""

    def __init__(self, title: str, xlabel: str, curves: list[tuple[str, Any]], least: float):
        """Takes the colour of each curve and its x and y at a frame, and a least range of y."""
        self.curves, self.least = curves, least
        figure = self.figure = mujoco.MjvFigure()
        mujoco.mjv_defaultFigure(figure)
        figure.title, figure.xlabel = title, xlabel
        figure.flg_extend = figure.flg_legend = 0
        figure.flg_ticklabel[:] = 1
        figure.xformat, figure.yformat = "%.3g", "%.3g"
        figure.figurergba[:] = figure.panergba[:] = (*rgb(WHITE), 1.0)
        figure.gridrgb[:] = rgb(PALE_GREY)
        figure.textrgb[:] = rgb(BLACK)
        figure.linewidth = 2.0
        for j, (color, _) in enumerate(curves):
            figure.linergb[j] = rgb(color)
        self.clear()

    def clear(self) -> None:
        """Forgets all points."""
        self.points: list[list[tuple[float, float]]] = []
        self.frames_read, self.stride = 0, 1
        self.figure.linepnt[:] = 0

    def extend(self, frames: list[Frame]) -> None:
        """Adds the new frames."""
        new = (frames[k] for k in range(self.frames_read, len(frames)) if k % self.stride == 0)
        self.points += [[point(frame) for _, point in self.curves] for frame in new]
        self.frames_read = len(frames)
        while len(self.points) >= mujoco.mjMAXLINEPNT - 1:
            self.points, self.stride = self.points[::2], 2 * self.stride
        if not self.points:
            return
        data = np.array(self.points)
        for axis, limits, least in ((0, _wide, 5.0), (1, _snapped, self.least)):
            known = data[..., axis][np.isfinite(data[..., axis])]
            ends = float(known.min(initial=0.0)), float(known.max(initial=0.0))
            low, high, lines = limits(*ends, least)
            self.figure.range[axis], self.figure.gridsize[axis] = (low, high), lines
        span = np.diff(self.figure.range[:2])[:, 0]
        for j in range(len(self.curves)):
            curve = data[np.isfinite(data[:, j, 1]), j]
            if len(curve):
                steps = np.hypot(*(np.diff(curve, axis=0, prepend=curve[:1]) / span).T)
                way = np.cumsum(steps) // LINE_STEP
                curve = curve[np.diff(way, prepend=-1.0) != 0.0]
            self.figure.linepnt[j] = len(curve)
            self.figure.linedata[j, : 2 * len(curve)] = curve.ravel()


LINE_STEP = 1 / 160  # of a plot's size, between points of a curve: shorter steps look dashed
HAIR = 0.02  # of a grid step: less than the width of a line


def _wide(low: float, high: float, least: float) -> tuple[float, float, int]:
    """Round limits around a range, and the number of grid lines; the range has a least size."""
    span = max(high - low, least)
    power = 10.0 ** math.floor(math.log10(span))
    step = power * next(f for f in (0.2, 0.5, 1.0, 2.0) if span <= 5.0 * f * power)
    first, last = math.floor(low / step + HAIR), math.ceil(max(high, low + least) / step - HAIR)
    return first * step, last * step, last - first + 1


def _snapped(low: float, high: float, least: float) -> tuple[float, float, int]:
    """As _wide for y, whose limits the engine widens to multiples of the range's power of ten.

    The returned limits lie slightly inside such multiples, so that it widens them to these.
    """
    power = 10.0 ** math.floor(math.log10(max(high - low, least)))
    while True:
        for step in (1, 2):  # of the power of ten
            first = step * math.floor(low / (step * power) + HAIR)
            last = step * math.ceil(max(high, low + least) / (step * power) - HAIR)
            if last - first <= (6, 10)[step - 1]:
                hair, steps = 1e-3 * power, {1: 5, 2: 4}.get(last - first, (last - first) // step)
                return first * power + hair, last * power - hair, steps + 1
        power *= 10.0
