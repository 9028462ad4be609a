"""Figures of robustness: limits as bands over hands, and the probability of instability."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from ..studies.population import Band
from ..studies.robustness import Instability, RiskMap
from .style import (
    BLACK,
    BLUE,
    GREY,
    LOG_SPAN,
    MID_GREY,
    SKY_BLUE,
    VERMILION,
    WHITE,
    add_legend,
    figure_size,
    figure_style,
    map_edges,
    narrow,
    points,
    set_title,
    stroke,
    unit_text,
)

CONTOURS = (0.01, 0.1, 0.5)  # probabilities whose contours are drawn ...
BOUNDED = 0.1  # ... and the one whose interval is
LEAST_EVENTS = 2.0  # least expected count in a cell for its contour to be drawn
CONTOUR_STYLES = (":", "--", "-")
MOST_RATIO = 100.0  # largest ratio of limits shown in a band
MOST_PANELS = 4
PANEL_BINS = 10  # of a panel
PARAMETER_NAMES = {
    "K": "gain K",
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


def band_plot(band: Band) -> Figure:
    """Plots a limit as a band over hands: 5 to 95 %, the median, and the least."""
    with figure_style():
        figure = Figure(figsize=figure_size(1, 4.0))
        ax = figure.subplots()
        seen = band.limits[np.isfinite(band.limits) & (band.limits > 0.0)]
        least = float(seen.min()) if seen.size else 1.0
        top = min(1.5 * float(seen.max(initial=least)), MOST_RATIO * least)

        def drawn(y: np.ndarray) -> np.ndarray:  # hands without a limit lie above the figure
            return np.minimum(y, 1e6 * top)

        low, high = drawn(band.quantile(0.05)), drawn(band.quantile(0.95))
        ax.fill_between(
            band.x, low, high, color=SKY_BLUE, alpha=0.45, lw=0, label="5 to 95 % of hands"
        )
        ax.plot(band.x, drawn(band.quantile(0.5)), color=BLUE, label="median")
        ax.plot(band.x, drawn(band.least), color=VERMILION, ls="--", label="least")
        ax.plot(band.x, drawn(band.nominal), color=BLACK, ls=":", label="hand of medians")
        if _spans_decades(band.x):
            ax.set_xscale("log")
        if top > LOG_SPAN * least:  # limits of 0 lie below it
            ax.set_yscale("log", nonpositive="clip")
            ax.set_ylim(0.5 * least, top)
        else:
            ax.set_ylim(0.0, top)
        ax.set(xlabel=unit_text(band.x_name), ylabel=unit_text(band.y_name))
        ax.set_xlim(float(band.x.min()), float(band.x.max()))
        set_title(ax, f"{len(band.hands)} hands, {band.told}", "exact limit of each")
        add_legend(figure, ax, ncols=4)
    return figure


def instability_plot(result: Instability) -> Figure:
    """Plots the probability of instability over the grid, or over each varying parameter."""
    grid = list(result.trials.grid.values())
    if len(grid) == 2:
        return _risk_plane(result)
    charts = [result.map()] if grid else _panels(result)
    with figure_style():
        count = len(charts)
        rows, columns = math.ceil(count / 2), min(count, 2)
        figure = Figure(figsize=figure_size(columns, 0.6 + 2.9 * rows))
        axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
        for ax, chart in zip(axes.flat, charts, strict=False):
            _risk_curve(ax, chart)
        for ax in axes.flat[count:]:
            ax.remove()
        for row in axes:
            row[0].set_ylabel("probability of instability")
        set_title(axes[0, 0], *_title(result))
    return figure


def _panels(result: Instability) -> list[RiskMap]:
    """Charts over the varying parameters, the most influential first."""
    varied = [
        n
        for n in result.trials.names
        if np.ptp(result.points[:, result.trials.names.index(n)]) > 0.0
    ]
    charts = [result.binned(n, bins=PANEL_BINS) for n in varied]
    charts.sort(key=lambda c: -float(np.nanstd(c.probability)))
    return charts[:MOST_PANELS]


def _risk_curve(ax: Axes, chart: RiskMap) -> None:
    share = chart.probability[:, 0]
    low, high = (x[:, 0] for x in chart.interval())
    ax.errorbar(
        chart.x, share, (share - low, high - share), fmt="o", color=BLUE, ms=stroke(4.5),
        elinewidth=stroke(1.2), capsize=stroke(2.5),
    )  # fmt: skip
    if _spans_decades(chart.x):
        ax.set_xscale("log")
    elif narrow():
        ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.yaxis.set_major_formatter(PercentFormatter(1.0))
    ax.set_xlabel(_name(chart.x_name))
    ax.set_ylim(bottom=0.0)


def _risk_plane(result: Instability) -> Figure:
    chart = result.map()
    x_name, y_name = chart.x_name, chart.y_name
    x, y, share = chart.x, chart.y, chart.probability
    low, high = chart.interval()
    turned = x_name == "K"  # the limit is one of K, on the vertical axis
    if turned:
        x_name, y_name, x, y = y_name, x_name, y, x
        share, low, high = share.T, low.T, high.T
    with figure_style(axes_grid=False):
        figure = Figure(figsize=figure_size(1, 4.4))
        ax = figure.subplots()
        mesh = ax.pcolormesh(
            _cell_borders(x), _cell_borders(y), share.T, cmap="Blues", vmin=0.0, vmax=1.0,
            rasterized=True,
        )  # fmt: skip
        for name, values in (("x", x), ("y", y)):
            if _spans_decades(values):
                getattr(ax, f"set_{name}scale")("log")
        handles: list[Any] = []
        if min(len(x), len(y)) > 1:
            each = float(np.median(chart.runs))
            for level, style in zip(CONTOURS, CONTOUR_STYLES, strict=True):
                if level * each < LEAST_EVENTS:
                    continue
                look: Any = dict(levels=[level], colors=[VERMILION], linestyles=[style])
                if np.nanmin(share) < level < np.nanmax(share):
                    ax.contour(x, y, share.T, linewidths=stroke(1.8), **look)
                    (line,) = ax.plot([], [], color=VERMILION, ls=style, lw=stroke(1.8))
                    handles.append((line, f"{100.0 * level:g} %"))
            found = [e for e in (low, high) if np.nanmin(e) < BOUNDED < np.nanmax(e)]
            for edge in found:
                ax.contour(x, y, edge.T, levels=[BOUNDED], colors=[GREY], linewidths=stroke(0.9))
            if found:
                (line,) = ax.plot([], [], color=GREY, lw=stroke(0.9))
                handles.append((line, f"95 % interval of the {100.0 * BOUNDED:g} % line"))
        line = result.boundary()
        if line is not None:
            (drawn,) = ax.plot(*line, color=WHITE, lw=stroke(3.4))
            (drawn,) = ax.plot(*line, color=BLACK, lw=stroke(1.6))
            handles.append((drawn, "exact, middle hand"))
        ax.set(xlabel=_name(x_name), ylabel=_name(y_name))
        ax.set_xlim(*_cell_borders(x)[[0, -1]])
        ax.set_ylim(*_cell_borders(y)[[0, -1]])
        bar = figure.colorbar(mesh, ax=ax, pad=0.02, format=PercentFormatter(1.0))
        bar.set_label("probability of instability")
        bar.outline.set_edgecolor(MID_GREY)  # type: ignore[union-attr]
        set_title(ax, *_title(result))
        add_legend(
            figure, None, ncols=5, handles=[h for h, _ in handles], labels=[t for _, t in handles],
            fontsize=points(8.5),
        )  # fmt: skip
    return figure


def _title(result: Instability) -> list[str]:
    total = result.total
    over = "mean of the grid" if result.trials.grid else "total"
    share = f"{over} {100.0 * total.probability:.3g} %"
    interval = f"95 % interval {100.0 * total.low:.3g} to {100.0 * total.high:.3g} %"
    return [f"{total.runs} runs", share, interval]


def _name(name: str) -> str:
    return unit_text(PARAMETER_NAMES.get(name, name))


def _spans_decades(values: np.ndarray) -> bool:
    return bool(len(values) > 1 and values.min() > 0.0 and values.max() > LOG_SPAN * values.min())


def _cell_borders(values: np.ndarray) -> np.ndarray:
    """Borders half way between the values, on the scale of the axis."""
    if len(values) == 1:
        return values[0] + np.array([-0.5, 0.5])
    return map_edges(values, _spans_decades(values))
