"""Plots that run along with a film: the axes drawn once, the curves inked onto them as time goes on."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from .params import AXES
from .plot import BLUE, CLAY, GREEN, GREY, ORANGE, STYLE
from .record import Record

DPI = 100
PEN = 1.1  # half the width of a line [pixels]
STRIDE = 0.5  # between two dabs of the pen [pixels]


class Running:
    """Velocity and fe/v against position, and the operator's force against time, one above the other.

    Attributes:
        image: as it is now, shape (height, width, 3) of bytes.
    """

    def __init__(self, record: Record, width: int, height: int):
        r, s = record, record.scenario
        self.axis = "y" if float(np.ptp(r.p[:, 1])) > 1.2 * float(np.ptp(r.p[:, 0])) else "x"
        i = AXES.index(self.axis)
        x, v = 100.0 * r.p[:, i], r.v[:, i]
        ratio, top = r.ratio(r.fe)[:, i], max(float(r.b[:, i].max(initial=0.0)), 1.0)
        ratio = np.clip(ratio, -top, 2.0 * top)  # 0/0 as a run begins or turns
        with matplotlib.rc_context({**STYLE, "font.size": 7.5, "lines.linewidth": 1.0}):
            figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
            panels: Any = figure.subplots(3, 1)
            _frame(panels[0], x, v, f"position {self.axis} [cm]", f"velocity v$_{self.axis}$ [m/s]")
            _frame(panels[1], x, np.array([0.0, 1.25 * top]), f"position {self.axis} [cm]", "f$_e$/v [N$\\cdot$s/m]")
            force = r.fh[:, i]
            usual = np.percentile(np.concatenate((force, r.fe[:, i])), (1.0, 99.0))  # not the spike at a border
            _frame(panels[2], r.t, np.append(1.15 * usual, 0.0), "time [s]", "force [N]")
            for ax in panels[:2]:
                _clay(ax, r, i)
            b = np.unique(r.b[:, i])
            for value in b[b > 0.0] if len(b) <= 4 else ():
                panels[1].axhline(value, color=ORANGE, ls="--", lw=0.9)
                panels[1].annotate("b", (1.0, value), (-2, 2), xycoords=("axes fraction", "data"),
                                   textcoords="offset points", color=ORANGE, ha="right")  # fmt: skip
            title = "operator f$_h$, clay f$_e$"
            panels[2].set_title(title, fontsize=7.5, color=GREY, pad=2, loc="left")
            panels[0].set_title(s.name, fontsize=7.5, color=GREY, pad=2, loc="left")
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            self.image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        curves: Any = (
            (panels[0], x, v, BLUE), (panels[1], x, ratio, BLUE),
            (panels[2], r.t, force, GREEN), (panels[2], r.t, r.fe[:, i], BLUE),
        )  # fmt: skip
        self._pens = [_Pen(self.image, ax, *data) for ax, *data in curves]

    def upto(self, n: int) -> np.ndarray:
        """The image with the first n samples on it; n must not fall from call to call."""
        for pen in self._pens:
            pen.draw(n)
        return self.image


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
