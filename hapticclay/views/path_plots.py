"""The path of the handle over a map of the clay, and over clay that stays cut."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..model.clay import Clay
from ..simulation.record import Record
from .captions import clay_text, scenario_parts
from .palette import CLAY_ALPHA, CLAY_DEEP, CLAY_PALE, GREY, WHITE, clay_color, clay_share
from .panels import add_legend, draw_path, map_axes, set_title
from .run_axes import MOST_BORDERS
from .style import figure_style, map_size, points, stroke

BEYOND = 1e5  # [cm or mm], past every path
PICTURE_SIZE = 400  # pixels of a picture of other clay, along x and along y


@figure_style()
def path_plot(record: Record) -> Figure:
    """Plots the path of the handle over a map of the clay (Figs. 7, 9)."""
    p = 100.0 * record.p
    low, high = p.min(axis=0), p.max(axis=0)
    margin = 0.08 * max(float((high - low).max()), 0.1)
    breadth, depth = high - low + 1.0
    low, high = low - margin, high + margin
    figure = Figure(figsize=map_size(6.4, 1.0, depth / breadth))
    ax = figure.add_subplot()
    across, up = figure.get_figwidth() - stroke(0.9), figure.get_figheight() - stroke(1.3)
    room = (high - low)[1] * across / up
    wider = max(0.0, 0.5 * (room - (high - low)[0]))  # axes as wide as the title over them
    low[0], high[0] = low[0] - wider, high[0] + wider
    if record.scenario.clay:
        clay_map(ax, record.scenario.clay, low, high)
    draw_path(ax, p, "handle")
    map_axes(ax, low, high)
    add_legend(figure)
    set_title(ax, *scenario_parts(record.scenario))
    return figure


def clay_map(ax: Axes, clay: Clay, low: np.ndarray, high: np.ndarray, scale: float = 100.0) -> None:
    """Shades each region of the clay and labels its resistance; `scale` units are a metre."""
    for block in clay.blocks:
        (x0, x1), (y0, y1) = block.x, block.y
        _shade(ax, scale * x0, scale * x1, scale * y0, scale * y1, 1.0)
    edges = [sorted({-BEYOND, BEYOND, *(scale * x for x in e)}) for e in clay.edges]
    if "place" in clay.varies or max(map(len, edges)) > MOST_BORDERS:
        _clay_image(ax, clay, low, high, scale)
        return
    for (x0, x1), (y0, y1) in itertools.product(*map(itertools.pairwise, edges)):
        middle = 0.5 * (x0 + x1) / scale, 0.5 * (y0 + y1) / scale
        share = float(clay_share(clay, *middle))
        if not share:
            continue
        _shade(ax, x0, x1, y0, y1, share)
        right, bottom = min(x1, high[0]), max(y0, low[1])
        visible = np.array((right - max(x0, low[0]), min(y1, high[1]) - bottom)) / (high - low)
        if visible[0] > 0.12 and visible[1] > 0.08:
            place = np.array((right, bottom)) + (-0.01, 0.01) * (high - low)
            text: Any = dict(ha="right", va="bottom", fontsize=points(8), color=GREY)
            name = "\n".join(clay_text(x.text()) for x in clay.here(middle))
            ax.text(place[0], place[1], name, **text)


def _shade(ax: Axes, x0: float, x1: float, y0: float, y1: float, share: float) -> None:
    look: Any = dict(color=clay_color(share), alpha=CLAY_ALPHA, lw=0)
    ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, **look))


def _clay_image(ax: Axes, clay: Clay, low: np.ndarray, high: np.ndarray, scale: float) -> None:
    """Shades clay of many cells with an image."""
    x, y = (np.linspace(low[i], high[i], PICTURE_SIZE + 1) for i in (0, 1))
    middle = 0.5 * (x[1:] + x[:-1]) / scale, 0.5 * (y[1:] + y[:-1]) / scale
    share = clay_share(clay, middle[0], middle[1][:, None])
    colors = np.concatenate((clay_color(share), CLAY_ALPHA * (share > 0.0)[..., None]), axis=2)
    ax.imshow(colors, extent=(x[0], x[-1], y[0], y[-1]), origin="lower", zorder=0)


@figure_style()
def ground_plot(record: Record) -> Figure:
    """Plots the remaining clay after a run, and the path of the tool."""
    ground, p, block = record.ground, 100.0 * record.p, ground_of(record)
    assert ground is not None
    x, y = (100.0 * e for e in block.edges)
    corners = np.array(((x[0], y[0]), (x[-1], y[-1])))
    low = np.minimum(corners[0], p.min(axis=0)) - 0.3
    high = np.maximum(corners[1], p.max(axis=0)) + 0.3
    breadth, depth = (high - low).tolist()
    figure = Figure(figsize=map_size(4.7, 1.2, depth / breadth))
    ax = figure.add_subplot()
    colors = LinearSegmentedColormap.from_list("clay", [WHITE, CLAY_PALE, CLAY_DEEP])
    look: Any = dict(cmap=colors, vmin=0.0, vmax=1e3 * block.highest or 1.0, rasterized=True)
    image = ax.pcolormesh(x, y, 1e3 * ground.T, **look)
    draw_path(ax, p, "path of the tool", 1.0)
    edge: Any = dict(fill=False, color=GREY, lw=stroke(0.6))
    ax.add_patch(Rectangle(tuple(corners[0]), *(corners[1] - corners[0]), **edge))
    bar = ax.inset_axes((1.03, 0.0, 0.03, 1.0))
    bar.grid(False)
    figure.colorbar(image, cax=bar, label="clay left [mm]")
    map_axes(ax, low, high)
    add_legend(figure)
    set_title(ax, *scenario_parts(record.scenario))
    return figure


def ground_of(record: Record) -> Any:
    """The cells cut in a run: see `Clay.ground`."""
    clay = record.scenario.clay
    assert clay is not None
    return clay.ground
