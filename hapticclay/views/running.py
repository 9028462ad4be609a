"""Plots that run along with a film: the axes drawn once, the curves inked onto them as time goes on."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from ..model.scenario import AXES
from ..simulation.record import Record
from .run_plots import BLUE, CLAY, GREEN, GREY, ORANGE, STYLE

DPI = 100
PEN = 1.1  # half the width of a line [pixels]
STRIDE = 0.5  # between two dabs of the pen [pixels]


LEAST = (120, 100)  # width and height of one panel [pixels]: less has no room for its numbers
ROOMY = (180, 110)  # width and height of a panel from which axes are named in words [pixels]


def fits(width: int, height: int) -> bool:
    """Whether there is room for plots in so many pixels."""
    return width >= LEAST[0] and height >= LEAST[1]


class Running:
    """Velocity and fe/v against position, and the operator's force against time, one above the other.

    The first of these that there is room for.

    Attributes:
        image: as it is now, shape (height, width, 3) of bytes.
    """

    def __init__(self, record: Record, width: int, height: int):
        figure, curves = draw(record, width, height)
        canvas: Any = figure.canvas
        self.image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        self._pens = [_Pen(self.image, *curve) for curve in curves]

    def upto(self, n: int) -> np.ndarray:
        """The image with the first n samples on it; n must not fall from call to call."""
        for pen in self._pens:
            pen.draw(n)
        return self.image


def draw(record: Record, width: int, height: int) -> tuple[Figure, list[tuple[Axes, np.ndarray, np.ndarray, str]]]:
    """The plots before anything runs on them, and the curves that will: axes, x, y, colour."""
    r, count = record, max(1, min(3, height // LEAST[1]))
    roomy = width >= ROOMY[0] and height >= ROOMY[1] * count
    axis = "y" if float(np.ptp(r.p[:, 1])) > 1.2 * float(np.ptp(r.p[:, 0])) else "x"
    i = AXES.index(axis)
    x, v, force = 100.0 * r.p[:, i], r.v[:, i], r.fh[:, i]
    ratio, top = r.ratio(r.fe)[:, i], max(float(r.b[:, i].max(initial=0.0)), 1.0)
    ratio = np.clip(ratio, -top, 2.0 * top)  # 0/0 as a run begins or turns
    usual = np.percentile(np.concatenate((force, r.fe[:, i])), (1.0, 99.0))  # not the spike at a border
    where, when = (f"position {axis} [cm]", "time [s]") if roomy else (f"{axis} [cm]", "t [s]")
    speed, ratio_name = f"v$_{axis}$ [m/s]", "f$_e$/v [N$\\cdot$s/m]"
    plans: Any = (  # x, y to be seen, names of x and y, title where there is room, title where there is not; curves
        (x, v, where, f"velocity {speed}", record.scenario.name, speed, ((v, BLUE),)),
        (x, np.array([0.0, 1.25 * top]), where, ratio_name, "", ratio_name, ((ratio, BLUE),)),
        (r.t, np.append(1.15 * usual, 0.0), when, "force [N]", "operator f$_h$, clay f$_e$", "f$_h$, f$_e$ [N]",
         ((force, GREEN), (r.fe[:, i], BLUE))),
    )[:count]  # fmt: skip
    with matplotlib.rc_context({**STYLE, "font.size": 7.5, "lines.linewidth": 1.0}):
        figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        panels: Any = figure.subplots(count, 1, squeeze=False)[:, 0]
        for ax, (across, up, xlabel, ylabel, title, short, _) in zip(panels, plans, strict=True):
            _frame(ax, across, up, xlabel, ylabel if roomy else "")
            ax.set_title(title if roomy else short, fontsize=7.5, color=GREY, pad=2, loc="left")
        for ax in panels[:2]:
            _clay(ax, r, i)
        b = np.unique(r.b[:, i])
        for value in b[b > 0.0] if len(b) <= 4 and len(panels) > 1 else ():
            panels[1].axhline(value, color=ORANGE, ls="--", lw=0.9)
            panels[1].annotate("b", (1.0, value), (-2, 2), xycoords=("axes fraction", "data"),
                               textcoords="offset points", color=ORANGE, ha="right")  # fmt: skip
        canvas = FigureCanvasAgg(figure)
        figure.draw_without_rendering()  # which settles the ticks, and so what room they take
        canvas.draw()
    curves = [(ax, plan[0], y, color) for ax, plan in zip(panels, plans, strict=True) for y, color in plan[-1]]
    return figure, curves


class _Pen:
    """Inks one curve onto an image; what is drawn already is not drawn again."""

    def __init__(self, image: np.ndarray, ax: Axes, x: np.ndarray, y: np.ndarray, color: str):
        self.image, self.done = image, 0
        self.paper = image.astype(np.float32)
        self.color = np.array(to_rgb(color), dtype=np.float32) * 255.0
        self.ink = np.zeros(image.shape[:2], dtype=np.float32)
        known = np.isfinite(x) & np.isfinite(y)
        self.index = np.flatnonzero(known)
        self.at = ax.transData.transform(np.column_stack((x[known], y[known])))
        self.at[:, 1] = image.shape[0] - self.at[:, 1]
        self.at -= 0.5  # centres of pixels
        x0, y0, x1, y1 = np.rint(ax.bbox.extents).astype(int)
        self.low, self.high = (x0, image.shape[0] - y1), (x1, image.shape[0] - y0)
        self.at = np.clip(self.at, np.array(self.low) - 9, np.array(self.high) + 9)  # a spike leaves the panel soon

    def draw(self, n: int) -> None:
        end = int(np.searchsorted(self.index, n))
        if end <= self.done:
            return
        begin = max(self.done - 1, 0)
        self.done = end
        points = _dabs(self.at[begin:end])
        whole = np.rint(points).astype(int)
        low = np.clip(whole.min(axis=0) - 2, self.low, self.high)
        high = np.clip(whole.max(axis=0) + 3, self.low, self.high)
        for dx in range(-2, 3):
            for dy in range(-2, 3):
                px, py = whole[:, 0] + dx, whole[:, 1] + dy
                inside = (px >= low[0]) & (px < high[0]) & (py >= low[1]) & (py < high[1])
                away = np.hypot(px - points[:, 0], py - points[:, 1])
                dab = np.clip(PEN + 0.5 - away, 0.0, 1.0)[inside].astype(np.float32)
                np.maximum.at(self.ink, (py[inside], px[inside]), dab)
        window = np.s_[low[1] : high[1], low[0] : high[0]]
        ink, paper = self.ink[window][..., None], self.image[window].astype(np.float32)
        paper = np.where(ink > 0.0, self.paper[window] + ink * (self.color - self.paper[window]), paper)
        self.image[window] = paper.astype(np.uint8)


def _dabs(points: np.ndarray) -> np.ndarray:
    """Points along a polyline, no more than a stride apart."""
    way = np.concatenate(((0.0,), np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    at = np.append(np.arange(0.0, way[-1], STRIDE), way[-1])
    return np.column_stack([np.interp(at, way, points[:, i]) for i in (0, 1)])


def _frame(ax: Axes, x: np.ndarray, y: np.ndarray, xlabel: str, ylabel: str) -> None:
    for values, put, least in ((x, ax.set_xlim, 1e-6), (y, ax.set_ylim, 1e-6)):
        values = values[np.isfinite(values)]
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        span = max(high - low, least)
        put(low - 0.04 * span, high + 0.06 * span)
    ax.set_xlabel(xlabel, labelpad=1)
    ax.set_ylabel(ylabel, labelpad=2)


def _clay(ax: Axes, record: Record, i: int) -> None:
    """Shades where there is clay along this coordinate."""
    clay = record.scenario.clay
    profile = (clay.x, clay.y)[i] if clay else None
    if profile and profile.along == AXES[i] and max(profile.values):
        edges = (-10.0, *profile.edges, 10.0)
        for low, high, b in zip(edges, edges[1:], profile.values, strict=False):
            ax.axvspan(100.0 * low, 100.0 * high, color=CLAY, alpha=0.6 * b / max(profile.values), lw=0)
