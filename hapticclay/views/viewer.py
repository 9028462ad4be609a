"""MuJoCo's own viewer, in a process of its own, which `view` starts and answers.

Once its window is closed the viewer's thread, holding the interpreter, deletes the condition on which another thread
may wait in `update_hfield`: neither comes back. A display that goes away ends the process. Here that costs a picture.
"""

from __future__ import annotations

import math
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model.constants import AXES
from ..model.scenario import Scenario
from ..stepping.engine import mujoco
from ..studies.removal import Tool
from .session import FRAME
from .stage import Stage, cut_axes

Rows = tuple[tuple[str, str], ...]
SHARE = 0.32  # of the width, for the plots
BANNER = 0.05, 36  # of the height, and pixels, at least, for the verdict
ROWS = (
    0.24,
    290,
)  # of the width, and pixels, at least, that what is written beside the picture takes
WHITE, BLACK = (1.0, 1.0, 1.0), (0.1, 0.1, 0.1)
RED, GREEN, AMBER = (0.80, 0.13, 0.13), (0.05, 0.42, 0.32), (0.72, 0.42, 0.0)  # behind the verdict
COLORS = {
    "blue": (0.0, 0.45, 0.70),
    "green": (0.0, 0.62, 0.45),
    "red": (0.84, 0.37, 0.0),
    "yellow": (0.90, 0.62, 0.0),
}
INK = {"hand": ("green", "yellow"), "clay": ("blue", "red")}  # of x, y


@dataclass(frozen=True)
class Writing:
    """What is written: beside the picture, of keys, and above it (unstable or not)."""

    rows: Rows
    keys: Rows
    verdict: str
    unstable: bool


@dataclass(frozen=True)
class Sight:
    """What there is to see now.

    Attributes:
        frames: as Session.frames, from the last one that was shown on. anew: whether they begin again, the clay whole.
        angles: of the arm [rad]. target: of the hand [m], None if nobody pulls. writing: None if as it was.
    """

    frames: list[tuple]
    anew: bool
    angles: list[float]
    target: tuple[float, float] | None
    writing: Writing | None


class Pane:
    """The picture of one scenario, and the plots beside it."""

    def __init__(self, scenario: Scenario, tool: Tool):
        self.stage = Stage(scenario, tool)
        self.plots = _plots(cut_axes(scenario))
        self.frames: list[tuple] = []
        self.banner = _blank()

    def take(self, sight: Sight) -> None:
        """Takes in what there is to see; texts and plots follow when something is written."""
        if sight.anew:
            self.stage.whole()
            self.frames = []
            for plot in self.plots:
                plot.clear()
        new = sight.frames if sight.anew else sight.frames[1:]
        self.stage.carve([f[1] for f in new])
        self.frames += new
        self.stage.pose(sight.angles, sight.target)
        if words := sight.writing:
            self.rows = (*words.rows, ("removed", f"{1e6 * self.stage.removal.volume:.2f} cm3"))
            self.keys = words.keys
            self.banner.title = words.verdict
            color = (
                RED if words.unstable else GREEN if words.verdict.startswith("stable") else AMBER
            )
            self.banner.figurergba[:] = (*color, 1.0)
            for plot in self.plots:
                plot.extend(self.frames)

    def show(self, keys: Callable[[], list[int]], viewer: Any, ask: Callable[[Any], Sight]) -> None:
        """Shows what is answered when asked what the keys and the hand have done, until the process ends."""
        body = self.stage.model.body("tool").id
        with viewer.lock():
            viewer.cam.lookat[:], viewer.cam.distance = (
                (0.33, 0.19, -0.03),
                0.80,
            )  # the plots cover the right
            viewer.cam.azimuth, viewer.cam.elevation = 90.0, -55.0
            viewer.opt.sitegroup[:] = 0
            for flag in (
                "PERTOBJ",
                "PERTFORCE",
                "SELECT",
            ):  # the target is shown as a ball of our own
                viewer.opt.flags[getattr(mujoco.mjtVisFlag, f"mjVIS_{flag}")] = 0
            groups = viewer.opt.geomgroup.copy()
        grip: np.ndarray | None = None
        while True:
            begin = time.perf_counter()
            with viewer.lock():
                hand, grip = _hand(viewer, grip)
                viewer.opt.geomgroup[:] = groups  # the viewer's own meaning of 1, 2, 3
                if hand is None:
                    viewer.perturb.select, viewer.perturb.localpos[:] = body, (0.0, 0.0, 0.05)
            sight = ask((keys(), hand))
            self.take(sight)
            if self.stage.relief():
                viewer.update_hfield(self.stage.field)
            if sight.writing:
                self._write(viewer)
            viewer.sync()
            time.sleep(max(0.001, FRAME - (time.perf_counter() - begin)))

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
        banner, right = (
            max(int(BANNER[0] * room.height), BANNER[1]),
            max(int(ROWS[0] * room.width), ROWS[1]),
        )
        width, height = int(SHARE * room.width), (room.height - banner) // len(self.plots)
        figures = [
            (mujoco.MjrRect(right, room.height - banner, room.width - right, banner), self.banner)
        ]
        for i, plot in enumerate(self.plots):
            bottom = room.height - banner - (i + 1) * height
            figures.append((mujoco.MjrRect(room.width - width, bottom, width, height), plot.figure))
        viewer.set_figures(figures)


def _hand(
    viewer: Any, grip: np.ndarray | None
) -> tuple[tuple[float, float] | None, np.ndarray | None]:
    """Where the mouse has dragged to from where it took hold, (x, y) [m], None while it does not; and that place.

    The viewer moves its point in a plane through the grip, upright unless shift is held; what it gains in height
    counts as going away from the camera.
    """
    if not viewer.perturb.active & mujoco.mjtPertBit.mjPERT_TRANSLATE:
        return None, None
    at = np.array(viewer.perturb.refselpos)
    grip = at if grip is None else grip
    moved, azimuth = at - grip, math.radians(viewer.cam.azimuth)
    x, y = moved[:2] + moved[2] * np.array([math.cos(azimuth), math.sin(azimuth)])
    return (float(x), float(y)), grip


def main() -> None:
    """Reads (scenario, tool), then asks and reads a Sight for every picture; ends when nobody answers."""
    import glfw  # these need libraries of a desktop
    import mujoco.viewer

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the terminal that both share
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever the viewer prints

    def ask(words: Any) -> Any:
        try:
            pickle.dump(words, sink)
            sink.flush()
            return pickle.load(source)
        except (EOFError, OSError):
            os._exit(0)

    def fail(error: BaseException) -> None:
        ask("".join(traceback.format_exception(error)))

    class Simulate(mujoco.viewer._Simulate):
        def destroy(self) -> None:
            """The window was closed: nothing is to be deleted under the thread that may wait for it."""
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
    """Makes a window, and lets it go: where that fails the viewer ends the process, and leaves a log in the folder."""
    if not glfw.init():
        raise OSError("does not answer")
    glfw.window_hint(glfw.VISIBLE, False)
    window = glfw.create_window(64, 64, "", None, None)
    if not window:
        raise OSError("has no OpenGL, libgl1 may be missing")
    glfw.destroy_window(window)
    glfw.default_window_hints()


def _blank() -> mujoco.MjvFigure:
    """A figure with nothing in it but room for a title."""
    figure = mujoco.MjvFigure()
    mujoco.mjv_defaultFigure(figure)
    figure.flg_extend = figure.flg_legend = 0
    figure.flg_ticklabel[:] = 0
    figure.textrgb[:] = WHITE
    figure.panergba[:] = 0.0
    figure.gridsize[:] = 2
    figure.gridwidth = 0.0
    return figure


def _ratio(force: float, v: float) -> float:
    """force/v [N.s/m], NaN where the handle stands still."""
    return force / v if abs(v) > 1e-4 else math.nan


def _plots(axes: tuple[int, ...]) -> tuple[_Plot, ...]:
    """Velocity and clay against position, and forces against time, along these axes."""
    place = "position [cm]" if len(axes) > 1 else f"{''.join(AXES[i] for i in axes)} [cm]"
    each = ", ".join(f"{AXES[i]} {INK['clay'][i]}" for i in axes)
    named = f": {each}" if len(axes) > 1 else ""
    hand, clay = (f"{who} {', '.join(inks[i] for i in axes)}" for who, inks in INK.items())
    velocities, dampings, forces = [], [], []
    for i in axes:
        ink = INK["clay"][i]
        velocities.append(_Line(ink, lambda f, i=i: (100 * f[1][i], 100 * f[2][i])))
        dampings.append(_Line(ink, lambda f, i=i: (100 * f[1][i], _ratio(f[3][i], f[2][i]))))
        forces.append(_Line(INK["hand"][i], lambda f, i=i: (f[0], f[4][i])))
        forces.append(_Line(ink, lambda f, i=i: (f[0], f[3][i])))
    return (
        _Plot(f"velocity [cm/s]{named}", place, tuple(velocities), 0.1),
        _Plot(f"clay, fe/v [N.s/m]{named}", place, tuple(dampings), 10.0),
        _Plot(f"force [N]: {hand}; {clay}", "time [s]", tuple(forces), 0.1),
    )


@dataclass(frozen=True)
class _Line:
    """A line of a plot: its colour by name, and its point in a frame of the session."""

    ink: str
    point: Callable[[tuple], tuple[float, float]]


@dataclass
class _Plot:
    """One of the engine's figures, with at most so many points as it takes. least: smallest range of y."""

    title: str
    xlabel: str
    lines: tuple[_Line, ...]
    least: float

    def __post_init__(self):
        figure = self.figure = mujoco.MjvFigure()
        mujoco.mjv_defaultFigure(figure)
        figure.title, figure.xlabel = self.title, self.xlabel
        figure.flg_extend = figure.flg_legend = 0
        figure.flg_ticklabel[:] = 1
        figure.xformat, figure.yformat = "%.3g", "%.3g"
        figure.figurergba[:] = figure.panergba[:] = (*WHITE, 1.0)
        figure.gridrgb[:] = (0.85, 0.85, 0.85)
        figure.textrgb[:] = BLACK
        figure.linewidth = 2.0
        for j, line in enumerate(self.lines):
            figure.linergb[j] = COLORS[line.ink]
        self.clear()

    def clear(self) -> None:
        self.points: list[list[tuple[float, float]]] = []
        self.seen, self.stride = 0, 1
        self.figure.linepnt[:] = 0

    def extend(self, frames: list) -> None:
        """Takes the frames that are new."""
        new = range(self.seen, len(frames))
        self.points += [
            [line.point(frames[k]) for line in self.lines] for k in new if k % self.stride == 0
        ]
        self.seen = len(frames)
        while len(self.points) >= mujoco.mjMAXLINEPNT - 1:
            self.points, self.stride = self.points[::2], 2 * self.stride
        if not self.points:
            return
        data = np.array(self.points)
        for axis, limits, least in ((0, _wide, 5.0), (1, _snapped, self.least)):
            known = data[..., axis][np.isfinite(data[..., axis])]
            low, high, lines = limits(
                float(known.min(initial=0.0)), float(known.max(initial=0.0)), least
            )
            self.figure.range[axis], self.figure.gridsize[axis] = (low, high), lines
        span = np.diff(self.figure.range[:2])[:, 0]
        for j in range(len(self.lines)):
            line = data[np.isfinite(data[:, j, 1]), j]
            way = np.cumsum(np.hypot(*(np.diff(line, axis=0, prepend=line[:1]) / span).T)) // STEP
            line = (
                line[np.flatnonzero(np.diff(way, prepend=-1.0, append=math.inf)[:-1])]
                if len(line)
                else line
            )
            self.figure.linepnt[j] = len(line)
            self.figure.linedata[j, : 2 * len(line)] = line.ravel()


STEP = 1 / 160  # of a plot's size, between two points of a line: shorter ones come out dashed
HAIR = 0.02  # of a grid step: less than the line is thick


def _wide(low: float, high: float, least: float) -> tuple[float, float, int]:
    """Limits around a range of at least that size, and the number of grid lines, all at round steps."""
    span = max(high - low, least)
    power = 10.0 ** math.floor(math.log10(span))
    step = power * next(f for f in (0.2, 0.5, 1.0, 2.0) if span <= 5.0 * f * power)
    first, last = math.floor(low / step + HAIR), math.ceil(max(high, low + least) / step - HAIR)
    return first * step, last * step, last - first + 1


def _snapped(low: float, high: float, least: float) -> tuple[float, float, int]:
    """The same for y, whose limits the engine widens to multiples of the range's power of ten.

    Returned a hair inside of such multiples, so that it widens them to these and no further.
    """
    power = 10.0 ** math.floor(math.log10(max(high - low, least)))
    while True:
        for step in (1, 2):  # powers of ten
            first = step * math.floor(low / (step * power) + HAIR)
            last = step * math.ceil(max(high, low + least) / (step * power) - HAIR)
            if last - first <= (6, 10)[step - 1]:
                hair, steps = 1e-3 * power, {1: 5, 2: 4}.get(last - first, (last - first) // step)
                return first * power + hair, last * power - hair, steps + 1
        power *= 10.0
