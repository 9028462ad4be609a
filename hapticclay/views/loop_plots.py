"""The figure of a loop report: the wall of a client and the stable walls of its loop."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from ..ports.report import LoopReport
from .style import (
    BLACK,
    BLUE,
    SKY_BLUE,
    VERMILION,
    add_legend,
    figure_size,
    figure_style,
    set_title,
    stroke,
    unit_text,
)

ROOM = 3.0  # of the K axis, over the larger of wall and limit at its B
INSIDE_ALPHA = 0.22


def loop_plot(report: LoopReport) -> Figure:
    """Plots the stable walls for a client's period, delay and hand, and the wall it rendered."""
    with figure_style():
        figure = Figure(figsize=figure_size(1, 5.0))
        ax = figure.add_subplot()
        B, K = np.array(report.line_B), np.array(report.line_K)
        told = not math.isnan(report.K)
        right, top = _window(report)
        if told:
            line = np.minimum(K, 10.0 * top)  # no limit is infinite
            ax.fill_between(B, line, color=SKY_BLUE, alpha=INSIDE_ALPHA, lw=0)
            ax.plot(B, line, color=BLUE, label="limit of this loop")
        if told:
            color = VERMILION if report.verdict == "buzzes" else BLACK
            label = f"rendered: {report.verdict}"
            ax.plot([report.B], [report.K], "o", color=color, ms=stroke(9), label=label, zorder=5)
            ax.plot([report.B] * 2, [0.0, report.K], ":", color=color, lw=stroke(1.2))
        ax.set(
            xlabel=unit_text("virtual damping B [N.s/m]"),
            ylabel=unit_text("virtual stiffness K [N/m]"),
            xlim=(-0.04 * right, right),
            ylim=(0.0, top),
        )
        if told:
            add_legend(figure, ax, 2)
        set_title(ax, *_parts(report, told))
    return figure


def _window(report: LoopReport) -> tuple[float, float]:
    """Upper limits of B and K in the figure, from the wall and the line near it."""
    if math.isnan(report.K):
        return 1.0, 1.0
    limit = report.limit if math.isfinite(report.limit) else 0.0
    top = ROOM * max(report.K, limit)
    beyond = [b for b, k in zip(report.line_B, report.line_K, strict=True) if k > top]
    right = min(beyond, default=report.line_B[-1])
    return max(right, 1.2 * report.B), top


def _parts(report: LoopReport, told: bool) -> list[str]:
    """Phrases of the title."""
    if not told:
        return [report.note]
    late = f"{report.delay / report.period:.2g} samples late"
    return [f"{1.0 / report.period:.4g} Hz", late, f"limit at this B {report.limit:.4g} N/m"]
