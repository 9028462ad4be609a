"""A session in a window: the mouse is the hand."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from .experiments import SCENARIOS
from .params import AXES
from .player import Player, Replay
from .screen import Screen
from .session import FRAME, Session
from .stage import Stage, cut_axes, hardest

Color = tuple[float, float, float]
SPACE, BACKSPACE, RIGHT, LEFT, DOWN, UP = 32, 259, 262, 263, 264, 265  # GLFW's numbers
NAMES = {ord("1"): "constant", ord("2"): "variable", ord("3"): "free"}
FACTOR = 1.25  # by which a key changes K or b
PLOT_EVERY = 0.1  # [s]
SHARE = 0.68  # of the width, for the picture; the plots have the rest
WHITE, BLACK = (1.0, 1.0, 1.0), (0.1, 0.1, 0.1)
RED, GREEN, AMBER = (0.80, 0.13, 0.13), (0.05, 0.42, 0.32), (0.72, 0.42, 0.0)  # behind the verdict
LIVE = (
    ("Ctrl + drag", "pull the handle"),
    ("space", "pause"),
    ("backspace", "start anew"),
    ("up, down", "gain K"),
    ("left, right", "clay b"),
    ("1, 2, 3", "constant, variable, free"),
    ("R", "record on, off"),
    ("H", "this help"),
    ("drag, scroll", "camera"),
    ("Ctrl + Q", "close"),
)
REPLAY = tuple(row for row in LIVE if row[0] in ("space", "backspace", "H", "drag, scroll", "Ctrl + Q"))


class Window:
    """The window on a session or a record, until it is closed."""

    def __init__(self, play: Session | Replay):
        self.play, self.help = play, True
        self.held: tuple[float, float] | None = None  # where the handle was when the mouse took hold [m]
        self._begin()

    def _begin(self) -> None:
        """Takes up the scenario that is played."""
        self.stage = Stage(self.play.scenario, self.play.tool)
        self.plots = _plots(cut_axes(self.play.scenario))
        self._anew()

    def _anew(self) -> None:
        self.stage.whole()
        self.stage.pose(_angles(self.play))
        self.shown, self.drawn = 1, -1.0  # frames that the clay is cut by; when the rows were last written [s]
        for plot in self.plots:
            plot.clear()

    def show(self, until: Callable[[], bool] = lambda: False) -> None:
        """Shows it; returns when the window is closed, or this says so. Raises what the player died of, if it did.

        Raises:
            ParameterError: there is no display, or no OpenGL.
        """
        screen, player = Screen("hapticclay"), Player(self.play)
        try:
            camera = screen.camera
            camera.lookat[:], camera.distance = (0.23, 0.13, -0.03), 0.86
            camera.azimuth, camera.elevation = 90.0, -55.0
            player.start()
            shown: Stage | None = None
            while not screen.closed and not until() and player.error is None:
                begin = time.perf_counter()
                stage = self.stage
                if stage is not shown:
                    screen.show(stage.model, stage.data)
                    shown = stage
                screen.poll()
                with player.lock:
                    self._look(screen)
                if stage is self.stage:  # and not of another scenario by now
                    if stage.relief():
                        screen.upload(stage.field)
                    screen.draw(SHARE, self._paint)
                time.sleep(max(0.001, FRAME - (time.perf_counter() - begin)))
        finally:
            screen.close()
            if player.ident:
                player.stop()

    def _look(self, screen: Screen) -> None:
        """Hands on what keys and mouse have done, and takes what came of it, while the player waits."""
        while screen.keys:
            self._key(screen.keys.pop(0))
        play, target = self.play, None
        if isinstance(play, Session):
            play.pull(self._mouse(screen.hand))
            target = play.point
        frames = play.frames[self.shown - 1 :]
        self.stage.carve([f[1] for f in frames[1:]])
        self.shown += len(frames) - 1
        self.stage.pose(_angles(play), target)
        self._read()

    def _mouse(self, hand: tuple[float, float] | None) -> tuple[float, float] | None:
        """Where the hand pulls to [m], while the mouse drags."""
        if hand is None:
            self.held = None
            return None
        self.held = self.held or self.play.frames[-1][1]
        return self.held[0] + hand[0], self.held[1] + hand[1]

    def _key(self, key: int) -> None:
        play = self.play
        if key == SPACE:
            play.paused = not play.paused
        elif key == BACKSPACE:
            play.restart()
            self._anew()
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
                play.start(SCENARIOS[NAMES[key]]())
                self._begin()

    def _read(self) -> None:
        """Reads what is written beside the picture."""
        play = self.play
        t, fh = play.frames[-1][0], play.frames[-1][4]
        if abs(t - self.drawn) < PLOT_EVERY and not (play.paused or play.ended):
            return
        self.drawn = t
        state = "paused" if play.paused else "ended" if play.ended else "replaying"
        if isinstance(play, Session) and not (play.paused or play.ended):
            state = "recording" if play.recording else "not recording"
        self.rows = (
            ("time", f"{t:.1f} s, {play.clock.factor:.2f} x real{', machine too slow' if play.clock.slow else ''}"),
            ("state", state),
            ("K", "{:.3g}, {:.3g}".format(*play.gain)),
            ("b", "{:.4g}, {:.4g} N.s/m here; clay {:.4g}".format(*play.b, hardest(play.scenario))),
            ("fh", f"{math.hypot(*fh):.2f} N"),
            ("removed", f"{1e6 * self.stage.removal.volume:.2f} cm3"),
        )
        self.verdict = play.verdict()
        for plot in self.plots:
            plot.extend(play.frames)

    def _paint(self, view: Any, rest: Any, context: Any) -> None:
        """Draws what is written over the picture, and the plots beside it."""
        row = round(1.8 * context.charHeight)
        text = f"{self.play.ended}; backspace starts anew" if self.play.ended else self.verdict.text
        color = RED if self.verdict.unstable else GREEN if text.startswith("stable") else AMBER
        _label(text, mujoco.MjrRect(0, view.height - row, view.width, row), color, WHITE, context)
        below = mujoco.MjrRect(0, 0, view.width, view.height - row)
        keys = LIVE if isinstance(self.play, Session) else REPLAY
        for place, rows in (("TOPLEFT", self.rows), ("BOTTOMRIGHT", keys if self.help else ())):
            if rows:
                columns = ("\n".join(column) for column in zip(*rows, strict=True))
                grid = getattr(mujoco.mjtGridPos, f"mjGRID_{place}")
                mujoco.mjr_overlay(mujoco.mjtFont.mjFONT_NORMAL, grid, below, *columns, context)
        mujoco.mjr_rectangle(rest, *WHITE, 1.0)
        for i, plot in enumerate(self.plots):
            height = rest.height // len(self.plots)
            right, top = rest.left + rest.width, rest.height - i * height
            for line in reversed(plot.lines if len(plot.lines) > 1 else ()):
                width = sum(int(context.charWidth[ord(c)]) for c in line.name) + row
                right -= width
                _label(line.name, mujoco.MjrRect(right, top - row, width, row), WHITE, line.color, context)
            _label(plot.title, mujoco.MjrRect(rest.left, top - row, right - rest.left, row), WHITE, BLACK, context)
            at = mujoco.MjrRect(rest.left, top - height, rest.width, height - row)
            mujoco.mjr_figure(at, plot.figure, context)


def _label(text: str, at: Any, back: Color, ink: Color, context: Any) -> None:
    mujoco.mjr_label(at, mujoco.mjtFont.mjFONT_NORMAL, text, *back, 1.0, *ink, context)


def _angles(play: Session | Replay) -> list[float]:
    return list(play.run.angles) if isinstance(play, Session) else play.source.q[play.n].tolist()


def _ratio(force: float, v: float) -> float:
    """force/v [N.s/m], NaN where the handle stands still."""
    return force / v if abs(v) > 1e-4 else math.nan


def _plots(axes: tuple[int, ...]) -> tuple[_Plot, ...]:
    """Velocity and clay against position, and forces against time, along these axes."""
    blue, green, red, yellow = (0.0, 0.45, 0.70), (0.0, 0.62, 0.45), (0.84, 0.37, 0.0), (0.90, 0.62, 0.0)
    ink = dict(zip((("v", 0), ("v", 1), ("h", 0), ("h", 1)), (blue, red, green, yellow), strict=True))
    place = "position [cm]" if len(axes) > 1 else f"{''.join(AXES[i] for i in axes)} [cm]"
    velocity, clay, force = [], [], []
    for i in axes:
        a = AXES[i]
        velocity.append(_Line(a, ink["v", i], lambda f, i=i: (100 * f[1][i], 100 * f[2][i])))
        clay.append(_Line(a, ink["v", i], lambda f, i=i: (100 * f[1][i], _ratio(f[3][i], f[2][i]))))
        force.append(_Line(f"hand {a}", ink["h", i], lambda f, i=i: (f[0], f[4][i])))
        force.append(_Line(f"clay {a}", ink["v", i], lambda f, i=i: (f[0], f[3][i])))
    return (
        _Plot("velocity [cm/s]", place, tuple(velocity), 0.1),
        _Plot("clay, fe/v [N.s/m]", place, tuple(clay), 10.0),
        _Plot("force [N]", "time [s]", tuple(force), 0.1),
    )


@dataclass(frozen=True)
class _Line:
    """A line of a plot: its point in a frame of the session."""

    name: str
    color: Color
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
        figure.xlabel = self.xlabel
        figure.flg_extend = figure.flg_legend = 0
        figure.flg_ticklabel[:] = 1
        figure.xformat, figure.yformat = "%.3g", "%.3g"
        figure.figurergba[:] = figure.panergba[:] = (*WHITE, 1.0)
        figure.gridrgb[:] = (0.85, 0.85, 0.85)
        figure.textrgb[:] = BLACK
        figure.linewidth = 2.0
        for j, line in enumerate(self.lines):
            figure.linergb[j] = line.color
        self.clear()

    def clear(self) -> None:
        self.points: list[list[tuple[float, float]]] = []
        self.seen, self.stride = 0, 1
        self.figure.linepnt[:] = 0

    def extend(self, frames: list) -> None:
        """Takes the frames that are new."""
        new = range(self.seen, len(frames))
        self.points += [[line.point(frames[k]) for line in self.lines] for k in new if k % self.stride == 0]
        self.seen = len(frames)
        while len(self.points) >= mujoco.mjMAXLINEPNT - 1:
            self.points, self.stride = self.points[::2], 2 * self.stride
        if not self.points:
            return
        data = np.array(self.points)
        for axis, limits, least in ((0, _wide, 5.0), (1, _snapped, self.least)):
            known = data[..., axis][np.isfinite(data[..., axis])]
            low, high, lines = limits(float(known.min(initial=0.0)), float(known.max(initial=0.0)), least)
            self.figure.range[axis], self.figure.gridsize[axis] = (low, high), lines
        span = np.diff(self.figure.range[:2])[:, 0]
        for j in range(len(self.lines)):
            line = data[np.isfinite(data[:, j, 1]), j]
            way = np.cumsum(np.hypot(*(np.diff(line, axis=0, prepend=line[:1]) / span).T)) // STEP
            line = line[np.flatnonzero(np.diff(way, prepend=-1.0, append=math.inf)[:-1])] if len(line) else line
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
