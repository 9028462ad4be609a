"""Figure of a stability map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..studies.stability_map import StabilityMap
from .captions import loop_parts
from .palette import BLACK, GREY, LIGHT_GREY, UNSTABLE, WHITE
from .panels import (
    add_legend,
    curve_look,
    hollow,
    label_axes,
    mark,
    plain_ticks,
    positive,
    ring,
    set_title,
    single,
)
from .style import figure_style, points, stroke

X_SCALES = {  # of the x axis: factor, unit of the data, unit shown
    "delay-damping": (1e3, "[s]", "[ms]"),
    "gain-pose": (1e2, "[m]", "[cm]"),
}
CELL_MARKS: Any = {
    "stable": dict(marker="o", mfc="none"),
    "limit cycle": dict(marker="s", mfc="none"),
    "diverges": dict(marker="x"),
}
BOUNDARY_MARKS: Any = (dict(marker="o", mfc=BLACK), dict(marker="D", mfc=WHITE))


@figure_style()
def stability_map_plot(chart: StabilityMap) -> Figure:
    """Plots a map of stability.

    Lines are analytic boundaries, and dots are boundaries found by runs. A mark in each cell shows
    the outcome of its run, ringed where it contradicts the analysis. Hatching marks where the
    linear loop of these runs is unstable.
    """
    factor, unit, shown = X_SCALES.get(chart.kind, (1.0, "", ""))
    figure, ax = single(6.0, 7.4)
    ax.set(yscale="log", xscale="linear" if chart.kind == "gain-pose" else "log")
    low, high = _map_span(chart)
    for i, (name, (x, y)) in enumerate(chart.lines.items()):
        if x[0] == x[-1]:  # upright: it does not end where the cells do
            ax.axvline(factor * x[0], label=name, **curve_look(i))
        else:
            ax.plot(factor * np.array(x), positive(y), label=name, **curve_look(i))
    if chart.limit:
        x, y = chart.lines[chart.limit]
        unstable = UNSTABLE | {"edgecolor": LIGHT_GREY}  # behind marks and lines
        ax.fill_between(factor * np.array(x), np.clip(y, low, high), high, zorder=0, **unstable)
    for outcome, look in CELL_MARKS.items():
        cells = [(factor * c.x, c.y) for c in chart.cells if c.simulated == outcome]
        look = dict(color=GREY, ms=stroke(6), mew=stroke(1.2), label=f"run: {outcome}") | look
        mark(ax, cells, **look)
    wrong = [(factor * c.x, c.y) for c in chart.cells if c.cause]
    mark(ax, wrong, label="differs from the nominal continuous loop", **ring())
    for (name, (x, y)), look in zip(chart.found.items(), BOUNDARY_MARKS, strict=False):
        label = name.replace("runs", "boundary found by runs")
        look = hollow(BLACK, size=7, zorder=5, label=label) | look
        ax.plot(factor * np.array(x), positive(y), **look)
    found = [place for x, y in chart.found.values() for place in zip(x, y, strict=True)]
    look = dict(transform=ax.get_xaxis_transform(), clip_on=False, zorder=5, marker="^")
    look |= dict(color=BLACK, ms=stroke(8), label="runs: stable up to here")
    mark(ax, [(factor * x, 1.0) for x, y in found if y > high], **look)
    ax.set_ylim(low, high)
    plain_ticks(ax)
    label_axes(ax, chart.x_name.replace(unit, shown) if unit else chart.x_name, chart.y_name)
    add_legend(figure, 2, fontsize=points(9))
    shaping = "" if chart.kind == "gain-pose" else "shaping"
    quantity = {"delay-damping": "K", "gain-pose": "b"}.get(chart.kind, "")
    timing = ("Ts",) if chart.kind == "delay-damping" else ("Ts", "delay")
    parts = loop_parts(chart.loop, "axis", quantity, "hand", *timing, shaping)
    set_title(ax, *parts[:-1], parts[-1] + "; stable below the lines", pad=10.0)  # over triangles
    return figure


def _map_span(chart: StabilityMap) -> tuple[float, float]:
    """Limits of y that contain every cell, the lines among them, and boundaries found nearby."""
    cells = [c.y for c in chart.cells]
    top = 3.0 * max(cells)
    found = [y for _, v in chart.found.values() for y in v if math.isfinite(y) and 0.0 < y < top]
    high = 1.3 * max(cells + found)
    lines = [y for _, v in chart.lines.values() for y in v if 0.0 < y < high]
    return 0.7 * min(cells + found + lines), high
