"""Figure of a log: its columns over time, and the steps between its stamps."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..display import one_line
from ..studies.log_report import LogReport
from .palette import BLUE, MID_GREY
from .panels import label_axes, set_title, stacked
from .style import figure_style, points, stroke

MOST = 7  # columns that are drawn
DRAWN = 20_000  # rows that are drawn of a longer log


@figure_style()
def log_plot(report: LogReport) -> Figure:
    """Plots the columns of a log over time, and the steps between its stamps below."""
    shown = list(report.columns)[:MOST]
    stamps = report.stamps
    t = np.arange(report.rows) if stamps is None else stamps.t
    figure, axes = stacked(max(len(shown), 1) + (stamps is not None), 1.0 + 1.15 * len(shown))
    every = max(len(t) // DRAWN, 1)
    for ax, name in zip(axes, shown, strict=False):
        ax.plot(t[::every], report.columns[name][::every], color=BLUE, lw=stroke(0.9))
        label_axes(ax, "", one_line(name, 24))
        ax.yaxis.label.set_size(points(8.0))
    if stamps is not None and len(t) > 1:
        look = {"color": MID_GREY, "ls": "none", "marker": "o", "ms": stroke(1.2)}
        axes[-1].plot(t[1:], 1e3 * stamps.steps, rasterized=True, **look)
        steps, usual = 1e3 * stamps.steps, 1e3 * stamps.step
        ahead = 1.2 * usual if usual > 0.0 else 0.0  # NaN where time never goes ahead
        low, high = min(0.0, 1.1 * steps.min()), max(ahead, 1.1 * steps.max())
        axes[-1].set_ylim(low, high if high > low else 1.0)
        label_axes(axes[-1], "", "step [ms]")
        axes[-1].yaxis.label.set_size(points(8.0))
    label_axes(axes[-1], "row" if stamps is None else "time [s]")
    left = len(report.columns) - len(shown)
    set_title(axes[0], report.headline(), f"{left} more columns" if left else "")
    figure.align_ylabels(axes)
    return figure
