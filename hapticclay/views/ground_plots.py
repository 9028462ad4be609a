"""Figure of clay that stays cut, after a run."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..simulation.record import Record
from .captions import scenario_parts
from .style import (
    BLUE,
    CLAY_DEEP,
    CLAY_PALE,
    GREY,
    WHITE,
    add_legend,
    figure_style,
    map_size,
    set_title,
    stroke,
)


def ground_plot(record: Record) -> Figure:
    """Plots the remaining clay after a run, and the path of the tool."""
    from matplotlib.colors import LinearSegmentedColormap

    ground, p, block = record.ground, 100.0 * record.p, ground_of(record)
    assert ground is not None
    x, y = (100.0 * e for e in block.edges)
    corners = np.array(((x[0], y[0]), (x[-1], y[-1])))
    low = np.minimum(corners[0], p.min(axis=0)) - 0.3
    high = np.maximum(corners[1], p.max(axis=0)) + 0.3
    depth, breadth = (high - low)[::-1].tolist()
    colors = LinearSegmentedColormap.from_list("clay", [WHITE, CLAY_PALE, CLAY_DEEP])
    with figure_style():
        figure = Figure(figsize=map_size(4.7, 1.2, depth / breadth))
        ax = figure.add_subplot()
        top = 1e3 * block.highest or 1.0
        look: Any = dict(cmap=colors, vmin=0.0, vmax=top, rasterized=True)
        image = ax.pcolormesh(x, y, 1e3 * ground.T, **look)
        ax.plot(p[:, 0], p[:, 1], color=BLUE, lw=stroke(1.0), label="path of the tool")
        ax.plot(*p[0], "o", color=BLUE, ms=stroke(5), label="start")
        ax.plot(*p[-1], "s", color=BLUE, ms=stroke(5), label="end")
        edge: Any = dict(fill=False, color=GREY, lw=stroke(0.6))
        ax.add_patch(Rectangle(tuple(corners[0]), *(corners[1] - corners[0]), **edge))
        bar = ax.inset_axes((1.03, 0.0, 0.03, 1.0))
        bar.grid(False)
        figure.colorbar(image, cax=bar, label="clay left [mm]")
        ax.set(xlabel="position x [cm]", ylabel="position y [cm]", aspect="equal")
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ax.grid(False)
        add_legend(figure, ax)
        set_title(ax, *scenario_parts(record.scenario))
    return figure


def ground_of(record: Record) -> Any:
    """The cells cut in a run: see `Clay.ground`."""
    clay = record.scenario.clay
    assert clay is not None
    return clay.ground
