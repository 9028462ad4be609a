"""A picture of the arm and its task from above, as an image or in a window of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .palette import BLACK, BLUE, CLAY_PALE, GREY, VERMILION
from .style import styled

SIZE, DPI = (7.2, 3.6), 100.0  # [in], pixels per inch
FRAME = 1e-3  # [s] that a window gets for its events
PATH = 600  # points of a path that are drawn


class Plan(NamedTuple):
    """Content of a picture, lengths in m."""

    joints: np.ndarray  # shoulder, elbow and handle, shape (3, 2)
    path: np.ndarray  # of the handle, shape (n, 2)
    line: np.ndarray | None  # reference line, shape (k, 2); None for none
    blocks: Sequence[tuple[float, float, float, float]]  # of clay: x, y, width, height; () for all
    radius: float  # of the tool
    close: tuple[float, float, float]  # middle of the closer view and half its side, x, y, half
    title: str  # above the closer view


class PlanPicture:
    """A picture that is redrawn repeatedly: as an image, or in a window where there is a display.

    `unseen` says why there is no window although one was asked for.
    """

    def __init__(self, window: bool):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self._pyplot, self.unseen = None, ""
        with styled("screen"):
            if window:
                self._pyplot, self._figure, self.unseen = _window()
            if self._pyplot is None:
                self._figure = Figure(figsize=SIZE, dpi=DPI)
                FigureCanvasAgg(self._figure)
            self._axes = self._figure.subplots(1, 2)

    def draw(self, plan: Plan) -> np.ndarray | None:
        """Draws; returns the picture, or None if the window shows it."""
        with styled("screen"):
            for ax, closer in zip(self._axes, (False, True), strict=True):
                ax.clear()
                _fill(ax, plan, closer)
            canvas: Any = self._figure.canvas
            canvas.draw()
        if self._pyplot is not None:
            canvas.start_event_loop(FRAME)
            return None
        return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()

    def close(self) -> None:
        """Closes the window, if any."""
        if self._pyplot is not None:
            self._pyplot.close(self._figure)
            self._pyplot = None


def _window() -> tuple[Any, Any, str]:
    """matplotlib.pyplot and a figure in a window; or None twice, and why there is none."""
    if reason := _without_windows():
        return None, None, reason
    from matplotlib import pyplot

    try:
        figure = pyplot.figure(figsize=SIZE, dpi=DPI)
    except Exception as error:  # of the window system: each backend has classes of its own
        return None, None, f"no window opens: {' '.join(str(error).split())}"
    if reason := _without_windows():  # pyplot took another backend
        pyplot.close(figure)
        return None, None, reason
    return pyplot, figure, ""


def _without_windows() -> str:
    """Why matplotlib's present backend shows no windows; "" where it does."""
    import matplotlib
    from matplotlib.backends import BackendFilter, backend_registry

    names = backend_registry.list_builtin(BackendFilter.INTERACTIVE)
    backend = matplotlib.get_backend()
    shows = backend.lower() in {x.lower() for x in names}
    return "" if shows else f"matplotlib's backend {backend!r} has no windows"


def _fill(ax: Any, plan: Plan, closer: bool) -> None:
    from matplotlib.patches import Circle, Rectangle

    unit = 1000.0 if closer else 100.0
    ax.grid(False)
    if not plan.blocks:
        ax.set_facecolor(CLAY_PALE)
    for x, y, w, h in plan.blocks:
        size = unit * w, unit * h
        ax.add_patch(Rectangle((unit * x, unit * y), *size, color=CLAY_PALE, lw=0))
    if plan.blocks:
        for point in plan.path[-PATH:]:  # the removed clay
            ax.add_patch(Circle(unit * point, unit * plan.radius, color=ax.get_facecolor(), lw=0))
    if plan.line is not None:
        ax.plot(*(unit * plan.line.T), color=BLACK, lw=1.0, ls="--", label="line")
    ax.plot(*(unit * plan.path[-PATH:].T), color=BLUE, lw=1.6, label="path")
    if closer:
        x, y, half = plan.close
        ax.set(xlim=(unit * (x - half), unit * (x + half)))
        ax.set(ylim=(unit * (y - half), unit * (y + half)), xlabel="x [mm]", ylabel="y [mm]")
        tool = Circle(unit * plan.joints[2], unit * plan.radius, fill=False, color=VERMILION)
        ax.add_patch(tool)
        ax.set_title(plan.title, fontsize=9)
    else:
        ax.plot(*(unit * plan.joints.T), color=GREY, lw=3.0, solid_capstyle="round")
        ax.plot(*(unit * plan.joints[0]), "o", color=BLACK, ms=8)
        ax.plot(*(unit * plan.joints[1:].T), "o", color=BLACK, ms=5)
        ax.set(xlim=(-40, 18), ylim=(-30, 28), xlabel="x [cm]", ylabel="y [cm]")
        ax.set_title("shoulder, elbow, handle", fontsize=9)
    ax.set_aspect("equal")
