"""The figure of a loop report: the wall of a client and the stable walls of its loop."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from ..ports.report import LoopReport
from .palette import BLACK, BLUE, SKY_BLUE, VERMILION
from .panels import add_legend, label_axes, set_title, single
from .style import figure_style, stroke

ROOM = 3.0  # of the K axis, over the larger of wall and limit at its B
INSIDE_ALPHA = 0.22


@figure_style()
def loop_plot(report: LoopReport) -> Figure:
    """Plots the stable walls for a client's period, delay and hand, and the wall it rendered."""
    figure, ax = single(5.0)
    label_axes(ax, "virtual damping B [N.s/m]", "virtual stiffness K [N/m]")
    if math.isnan(report.K):  # nothing was rendered
        ax.set(xlim=(-0.04, 1.0), ylim=(0.0, 1.0))
        set_title(ax, report.note)
        return figure
    B, K = np.array(report.line_B), np.array(report.line_K)
    top = ROOM * max(report.K, report.limit if math.isfinite(report.limit) else 0.0)
    right = max(B[K > top].min(initial=B[-1]), 1.2 * report.B)
    line = np.minimum(K, 10.0 * top)  # no limit is infinite
    ax.fill_between(B, line, color=SKY_BLUE, alpha=INSIDE_ALPHA, lw=0)
    ax.plot(B, line, color=BLUE, label="limit of this loop")
    color = VERMILION if report.verdict == "buzzes" else BLACK
    label = f"rendered: {report.verdict}"
    ax.plot([report.B], [report.K], "o", color=color, ms=stroke(9), label=label, zorder=5)
    ax.plot([report.B] * 2, [0.0, report.K], ":", color=color, lw=stroke(1.2))
    ax.set(xlim=(-0.04 * right, right), ylim=(0.0, top))
    add_legend(figure, 2)
    late = f"{report.delay / report.period:.2g} samples late"
    limit = f"limit at this B {report.limit:.4g} N/m"
    set_title(ax, f"{1.0 / report.period:.4g} Hz", late, limit)
    return figure
