"""Figure of a stability map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from ..studies.stability_map import StabilityMap
from .style import (
    BLACK,
    CURVE_STYLES,
    GREY,
    LIGHT_GREY,
    UNSTABLE,
    VERMILION,
    WHITE,
    add_legend,
    figure_size,
    figure_style,
    hand_name,
    points,
    set_title,
    stroke,
    unit_text,
)

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


def stability_map_plot(chart: StabilityMap) -> Figure:
    """Plots a map of stability.

    Lines are analytic boundaries, and dots are boundaries found by runs. A mark in each cell shows
    the outcome of its run, ringed where it contradicts the analysis. Hatching marks where the
    linear loop of these runs is unstable.
    """
    factor, unit, shown = X_SCALES.get(chart.kind, (1.0, "", ""))
    with figure_style():
        figure = Figure(figsize=figure_size(1, 6.0, 7.4))
        ax = figure.add_subplot()
        ax.set_yscale("log")
        if chart.kind != "gain-pose":
            ax.set_xscale("log")

        def mark(x: Sequence[float], y: Any, **look: Any) -> None:
            ax.plot(factor * np.array(x), y, ls="none", **look)

        low, high = _map_span(chart)
        for (name, (x, y)), (color, style) in zip(chart.lines.items(), CURVE_STYLES, strict=False):
            look: Any = dict(color=color, ls=style, label=name)
            if x[0] == x[-1]:  # upright: it does not end where the cells do
                ax.axvline(factor * x[0], **look)
            else:
                ax.plot(factor * np.array(x), _positive(y), **look)
        if chart.limit:
            x, y = chart.lines[chart.limit]
            beyond = np.clip(y, low, high)
            hatched = UNSTABLE | {"edgecolor": LIGHT_GREY}  # behind marks and lines
            ax.fill_between(factor * np.array(x), beyond, high, zorder=0, **hatched)
        for name, look in CELL_MARKS.items():
            if mine := [c for c in chart.cells if c.simulated == name]:
                look = dict(look, color=GREY, ms=stroke(6), mew=stroke(1.2), label=f"run: {name}")
                mark([c.x for c in mine], [c.y for c in mine], **look)
        if wrong := [c for c in chart.cells if c.cause]:
            look = dict(marker="o", mfc="none", color=VERMILION, ms=stroke(13), mew=stroke(1.5))
            label = "differs from the nominal continuous loop"
            mark([c.x for c in wrong], [c.y for c in wrong], label=label, **look)
        for (name, (x, y)), look in zip(chart.found.items(), BOUNDARY_MARKS, strict=False):
            label = name.replace("runs", "boundary found by runs")
            mark(x, _positive(y), color=BLACK, ms=stroke(7), zorder=5, label=label, **look)
        found = [(a, b) for x, y in chart.found.values() for a, b in zip(x, y, strict=True)]
        if beyond := [a for a, b in found if b > high]:
            look = dict(transform=ax.get_xaxis_transform(), clip_on=False, zorder=5, marker="^")
            label = "runs: stable up to here"
            mark(beyond, [1.0] * len(beyond), color=BLACK, ms=stroke(8), label=label, **look)
        ax.set_ylim(low, high)
        _log_ticks(ax, chart)
        x_name = chart.x_name.replace(unit, shown) if unit else chart.x_name
        ax.set(xlabel=unit_text(x_name), ylabel=unit_text(chart.y_name))
        add_legend(figure, ax, 2, fontsize=points(9))
        set_title(ax, *_map_parts(chart), pad=10.0)  # over the triangles
    return figure


def _map_span(chart: StabilityMap) -> tuple[float, float]:
    """Limits of y that contain every cell, the lines among them, and boundaries found nearby."""
    cells = [c.y for c in chart.cells]
    top = 3.0 * max(cells)
    found = [y for _, v in chart.found.values() for y in v if math.isfinite(y) and 0.0 < y < top]
    high = 1.3 * max(cells + found)
    lines = [y for _, v in chart.lines.values() for y in v if 0.0 < y < high]
    return 0.7 * min(cells + found + lines), high


def _log_ticks(ax: Axes, chart: StabilityMap) -> None:
    """Labels 1, 2, 5 on a short logarithmic axis, powers of ten on a long one."""
    for side in (ax.yaxis,) if chart.kind == "gain-pose" else (ax.xaxis, ax.yaxis):
        low, high = ax.get_xlim() if side is ax.xaxis else ax.get_ylim()
        decades = math.log10(high / low)
        some = (1.0, 2.0, 5.0) if decades < 3.0 else (1.0,)
        side.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7) if decades < 1.2 else some))
        side.set_major_formatter(FormatStrFormatter("%g"))
        side.set_minor_formatter(NullFormatter())


def _positive(y: Sequence[float]) -> np.ndarray:
    a = np.array(y, dtype=float)
    return np.where(np.isfinite(a) & (a > 0.0), a, np.nan)


def _map_parts(chart: StabilityMap) -> list[str]:
    """Phrases that describe the loop of a map in its title."""
    s = chart.loop
    parts = [f"{s.axis} axis"]
    if chart.kind == "delay-damping":
        parts.append(f"K = {s.K:g} 1/kg")
    elif chart.kind == "gain-pose":
        parts.append(unit_text(f"b = {s.b:g} N.s/m"))
    parts.append(hand_name(s.operator))
    parts.append(f"Ts = {1e3 * s.Ts:g} ms" if s.Ts else "continuous time")
    if s.delay and chart.kind != "delay-damping":
        parts.append(f"delay {1e3 * s.delay:g} ms")
    if chart.kind != "gain-pose":
        parts.append("inertia_shaping" if s.inertia_shaping else "no shaping")
    return [*parts[:-1], parts[-1] + "; stable below the lines"]
