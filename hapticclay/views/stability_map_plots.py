"""Figures of maps: of stability, and of behaviour in clay that yields."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from ..studies.stability_map import StabilityMap
from ..studies.yield_map import YieldMap
from .captions import loop_parts
from .palette import BLACK, GREY, LIGHT_GREY, UNSTABLE, VERMILION, WHITE
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
PUSH_MARKS: Any = {
    "sticks": dict(marker="_", color=BLACK, mew=2.0),
    "limit cycle": dict(marker="o", mec=WHITE, mew=1.2),
    "grows": dict(marker="^", color=BLACK),
}
PUSH_NAMES = {"sticks": "sticks", "limit cycle": "buzzes (colour: its speed)", "grows": "grows"}


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


@figure_style()
def yield_map_plot(chart: YieldMap) -> Figure:
    """Plots the outcome of a push over yield force and gain.

    Colours show the speed of the limit cycle, by theory and, in the dots, by runs.
    """
    push, low, high = chart.loop.push, *(f(c.Fy for c in chart.cells) for f in (min, max))
    bottom, top = 0.9 * min(c.K for c in chart.cells), chart.K[-1]
    Fy, K = np.geomspace(low / 1.3, 1.3 * high, 240), np.geomspace(bottom, top, 240)
    speed = np.array(chart.speed)
    cycles = np.isfinite(speed)
    critical = np.exp(np.interp(K, chart.K, np.log(np.maximum(chart.critical, 1e-12))))
    each = np.full(len(K), np.nan)  # speed of the limit cycle for Fy = 1 N
    if cycles.any():
        log_speed = np.interp(K, np.array(chart.K)[cycles], np.log(speed[cycles]))
        each = np.where((K >= chart.least) & (K < chart.limit), np.exp(log_speed), np.nan)
    goes = push >= np.outer(np.where(K < chart.least, np.inf, critical), Fy)
    cycle = 1e3 * np.where(goes, np.outer(each, Fy), np.nan)
    grows = goes & (K >= chart.limit)[:, None]
    figure, ax = single(5.6, 7.4)
    ax.set(xscale="log", yscale="log", xlim=(Fy[0], Fy[-1]), ylim=(bottom, top))
    speeds = cycle[np.isfinite(cycle)]
    colors = LogNorm(speeds.min(), min(speeds.max(), 1e4)) if len(speeds) else LogNorm(1.0, 10.0)
    shaded = ax.pcolormesh(Fy, K, cycle, norm=colors, cmap="cividis", rasterized=True)
    ax.contourf(Fy, K, grows, levels=(0.5, 1.5), colors="none", hatches=["///"])
    edge = np.where(K < chart.least, np.nan, push / critical)
    ax.plot(edge, K, color=BLACK, label="theory: edge of sticking")
    for K_limit, dash, name in (
        (chart.least, "--", "no limit cycle below"),
        (chart.limit, "-.", "unstable in flowing clay above"),
    ):
        if K_limit < top:
            ax.axhline(K_limit, color=VERMILION, ls=dash, label=f"theory: {name}")
    for c in sorted(chart.cells, key=lambda c: list(PUSH_MARKS).index(c.simulated)):
        look: Any = dict(ls="none", ms=stroke(8), label=f"a run: {PUSH_NAMES[c.simulated]}")
        if c.simulated == "limit cycle":
            look["mfc"] = shaded.cmap(colors(1e3 * c.speed))
        ax.plot(c.Fy, c.K, **look, **PUSH_MARKS[c.simulated])
    wrong = [(c.Fy, c.K) for c in chart.cells if c.simulated != c.expected]
    mark(ax, wrong, label="unlike theory", **ring())
    plain_ticks(ax)
    bar = figure.colorbar(shaded, ax=ax, format="%g")
    bar.set_label("largest speed of the limit cycle [mm/s]")
    label_axes(ax, "yield force Fy [N]", "gain K [1/kg]")
    add_legend(figure, 2, fontsize=points(9))
    axis, *parts = loop_parts(chart.loop, "axis", "b", "hand", "Ts", "shaping")
    notes = "hatched: grows; white: sticks"
    set_title(ax, f"{axis}, push of {1e3 * push:g} mm/s", *parts[:-1], f"{parts[-1]}; {notes}")
    return figure


def _map_span(chart: StabilityMap) -> tuple[float, float]:
    """Limits of y that contain every cell, the lines among them, and boundaries found nearby."""
    cells = [c.y for c in chart.cells]
    top = 3.0 * max(cells)
    found = [y for _, v in chart.found.values() for y in v if math.isfinite(y) and 0.0 < y < top]
    high = 1.3 * max(cells + found)
    lines = [y for _, v in chart.lines.values() for y in v if 0.0 < y < high]
    return 0.7 * min(cells + found + lines), high
