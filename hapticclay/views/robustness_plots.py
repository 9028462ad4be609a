"""Figures of robustness: limits as bands over hands, and the probability of instability."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from ..scene.virtual_wall import VirtualWall
from ..studies.population import Band
from ..studies.robustness import Instability, RiskMap
from .palette import BLACK, BLUE, GREY, MID_GREY, SKY_BLUE, VERMILION, WHITE
from .panels import (
    add_legend,
    cell_edges,
    label_axes,
    plain_ticks,
    set_title,
    single,
    spans_decades,
)
from .style import figure_size, figure_style, narrow, points, stroke

CONTOURS = (0.01, 0.1, 0.5)  # probabilities whose contours are drawn ...
BOUNDED = 0.1  # ... and the one whose interval is
LEAST_EVENTS = 2.0  # least expected count in a cell for its contour to be drawn
CONTOUR_STYLES = (":", "--", "-")
MOST_RATIO = 100.0  # largest ratio of limits shown in a band
MOST_PANELS = 4
PANEL_BINS = 10  # of a panel
PARAMETER_NAMES = {
    "b": "clay b [N.s/m]",
    "B": "virtual damping B [N.s/m]",
    "delay": "delay [s]",
    "Ts": "control sample Ts [s]",
    "pose.x": "pose x [m]",
    "pose.y": "pose y [m]",
    "operator.mass": "hand's mass [kg]",
    "operator.damper": "hand's damper [N.s/m]",
    "operator.spring": "hand's spring [N/m]",
    "device.damper": "physical damper b [N.s/m]",
}


@figure_style()
def band_plot(band: Band) -> Figure:
    """Plots a limit as a band over hands: 5 to 95 %, the median, and the least."""
    figure, ax = single(4.0)
    limits = band.limits[np.isfinite(band.limits) & (band.limits > 0.0)]
    least = float(limits.min()) if limits.size else 1.0
    top = min(1.5 * float(limits.max(initial=least)), MOST_RATIO * least)

    def drawn(y: np.ndarray) -> np.ndarray:  # hands without a limit lie above the figure
        return np.minimum(y, 1e6 * top)

    low, high = drawn(band.quantile(0.05)), drawn(band.quantile(0.95))
    look: Any = dict(color=SKY_BLUE, alpha=0.45, lw=0, label="5 to 95 % of hands")
    ax.fill_between(band.x, low, high, **look)
    ax.plot(band.x, drawn(band.quantile(0.5)), color=BLUE, label="median")
    ax.plot(band.x, drawn(band.least), color=VERMILION, ls="--", label="least")
    ax.plot(band.x, drawn(band.nominal), color=BLACK, ls=":", label="hand of medians")
    if spans_decades(band.x):
        ax.set_xscale("log")
    if spans_decades((least, top)):  # limits of 0 lie below it
        ax.set_yscale("log", nonpositive="clip")
        ax.set_ylim(0.5 * least, top)
    else:
        ax.set_ylim(0.0, top)
    ax.set_xlim(float(band.x.min()), float(band.x.max()))
    label_axes(ax, band.x_name, band.y_name)
    plain_ticks(ax)
    set_title(ax, f"{len(band.hands)} hands, {band.told}", "exact limit of each")
    add_legend(figure, 4)
    return figure


def instability_plot(result: Instability) -> Figure:
    """Plots the probability of instability over the grid, or over each varying parameter."""
    return _risk_plane(result) if len(result.trials.grid) == 2 else _risk_curves(result)


@figure_style()
def _risk_curves(result: Instability) -> Figure:
    charts = [result.map()] if result.trials.grid else _influences(result)
    rows, columns = math.ceil(len(charts) / 2), min(len(charts), 2)
    figure = Figure(figsize=figure_size(columns, 0.6 + 2.9 * rows))
    axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for ax, chart in zip(axes.flat, charts, strict=False):
        _risk_curve(ax, chart, _quantity(result, chart.x_name))
    for ax in axes.flat[len(charts) :]:
        ax.remove()
    for row in axes:
        row[0].set_ylabel("probability of instability")
    set_title(axes[0, 0], *_total(result))
    return figure


def _influences(result: Instability) -> list[RiskMap]:
    """Charts over the varying parameters, the most influential first."""
    spans = np.ptp(result.points, axis=0)
    names = [n for n, span in zip(result.trials.names, spans, strict=True) if span > 0.0]
    charts = [result.binned(n, bins=PANEL_BINS) for n in names]
    charts.sort(key=lambda c: -float(np.nanstd(c.probability)))
    return charts[:MOST_PANELS]


def _quantity(result: Instability, name: str) -> str:
    """A parameter with its unit; K is that of the loop or of the wall."""
    if name == "K":
        wall = isinstance(result.trials.base, VirtualWall)
        return "virtual stiffness K [N/m]" if wall else "gain K [1/kg]"
    return PARAMETER_NAMES.get(name, name)


def _risk_curve(ax: Axes, chart: RiskMap, quantity: str) -> None:
    share = chart.probability[:, 0]
    low, high = (x[:, 0] for x in chart.interval())
    look: Any = dict(ms=stroke(4.5), elinewidth=stroke(1.2), capsize=stroke(2.5))
    ax.errorbar(chart.x, share, (share - low, high - share), fmt="o", color=BLUE, **look)
    if spans_decades(chart.x):
        ax.set_xscale("log")
        plain_ticks(ax)
    elif narrow():
        ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.yaxis.set_major_formatter(PercentFormatter(1.0))
    label_axes(ax, quantity)
    ax.set_ylim(bottom=0.0)


@figure_style(axes_grid=False)
def _risk_plane(result: Instability) -> Figure:
    chart = result.map()
    names, x, y = [chart.x_name, chart.y_name], chart.x, chart.y
    share, edges = chart.probability, chart.interval()
    if names[0] == "K":  # the limit is one of K, on the vertical axis
        names, x, y, share, edges = names[::-1], y, x, share.T, tuple(e.T for e in edges)
    figure, ax = single(4.4)
    across, up = (cell_edges(v, spans_decades(v)) for v in (x, y))
    look: Any = dict(cmap="Blues", vmin=0.0, vmax=1.0, rasterized=True)
    mesh = ax.pcolormesh(across, up, share.T, **look)
    ax.set(**{f"{n}scale": "log" for n, v in (("x", x), ("y", y)) if spans_decades(v)})
    ax.set(xlim=across[[0, -1]], ylim=up[[0, -1]])
    if min(len(x), len(y)) > 1:
        each = float(np.median(chart.runs))
        for value, dash in zip(CONTOURS, CONTOUR_STYLES, strict=True):
            if value * each >= LEAST_EVENTS:
                look = dict(colors=[VERMILION], linestyles=[dash], linewidths=stroke(1.8))
                if _contour(ax, x, y, share, value, **look):
                    look = dict(color=VERMILION, ls=dash, lw=stroke(1.8))
                    ax.plot([], [], label=f"{100.0 * value:g} %", **look)
        look = dict(colors=[GREY], linewidths=stroke(0.9))
        if any([_contour(ax, x, y, edge, BOUNDED, **look) for edge in edges]):
            label = f"95 % interval of the {100.0 * BOUNDED:g} % line"
            ax.plot([], [], color=GREY, lw=stroke(0.9), label=label)
    if (line := result.boundary()) is not None:
        ax.plot(*line, color=WHITE, lw=stroke(3.4))
        ax.plot(*line, color=BLACK, lw=stroke(1.6), label="exact, middle hand")
    label_axes(ax, *(_quantity(result, name) for name in names))
    plain_ticks(ax)
    bar = figure.colorbar(mesh, ax=ax, pad=0.02, format=PercentFormatter(1.0))
    bar.set_label("probability of instability")
    bar.outline.set_edgecolor(MID_GREY)  # type: ignore[union-attr]
    set_title(ax, *_total(result))
    add_legend(figure, fontsize=points(8.5))
    return figure


def _contour(
    ax: Axes, x: np.ndarray, y: np.ndarray, share: np.ndarray, value: float, **look: Any
) -> bool:
    """Draws the contour of a probability; returns whether the map crosses it."""
    crosses = bool(np.nanmin(share) < value < np.nanmax(share))
    if crosses:
        ax.contour(x, y, share.T, levels=[value], **look)
    return crosses


def _total(result: Instability) -> list[str]:
    """Phrases of the title."""
    total = result.total
    over = "mean of the grid" if result.trials.grid else "total"
    share = f"{over} {100.0 * total.probability:.3g} %"
    interval = f"95 % interval {100.0 * total.low:.3g} to {100.0 * total.high:.3g} %"
    return [f"{total.runs} runs", share, interval]
