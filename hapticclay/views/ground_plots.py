"""Figure of clay that stays cut, after a run."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..simulation.record import Record
from .captions import scenario_parts
from .palette import CLAY_DEEP, CLAY_PALE, GREY, WHITE
from .panels import add_legend, draw_path, map_axes, set_title
from .style import figure_style, map_size, stroke


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
