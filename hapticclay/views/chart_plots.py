"""Figures of charts: theory as lines, runs as marks."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..studies.chart import Chart, curve
from ..studies.labs import Lab
from ..studies.staircase import StaircaseRun
from .palette import BLACK
from .panels import MARKS, add_legend, curve_look, hollow, label_axes, plain_ticks, single
from .style import figure_style, stroke


@figure_style()
def chart_plot(chart: Chart) -> Figure:
    """Plots a chart.

    Curves of the kind "line" cycle through the colours of the style. Marks have the colour of the
    preceding line, as runs match their theory, and are black without one.
    """
    figure, ax = single(4.4)
    color, lines, marks = BLACK, 0, 0
    for c in chart.curves:
        look: dict[str, Any] = dict(color=color)
        if c.kind == "marks":
            look |= hollow(color, MARKS[marks % len(MARKS)], 6.5, mew=stroke(1.4), clip_on=False)
            marks += 1
        elif c.kind == "dashed" and not c.name:
            look |= dict(ls="--", lw=stroke(1.0))
        else:
            color = curve_look(lines)["color"]
            look = dict(color=color, ls="--" if c.kind == "dashed" else "-")
            look |= dict(drawstyle="steps-post") if c.kind == "steps" else {}
            lines += 1
        ax.plot(c.x, c.y, label=c.name or "_", **look)
    ax.set(**{f"{name}scale": "log" for name in chart.log})
    plain_ticks(ax)
    if "y" not in chart.log and all((c.y >= 0.0).all() for c in chart.curves):
        ax.set_ylim(bottom=0.0)
    label_axes(ax, chart.x, chart.y)
    add_legend(figure, 3)
    return figure


def lab_plot(found: Lab) -> Figure:
    """Plots the first chart of a lab."""
    return chart_plot(found.charts[0])


def staircase_plot(found: StaircaseRun) -> Figure:
    """Plots the levels of a staircase over its trials, the turns marked."""
    trials, at = np.arange(len(found.levels)), found.turns[found.staircase.skipped :]
    ends, mean = trials[[0, -1]], [found.estimate] * 2
    curves = (
        curve(found.staircase.words, trials, found.levels, "steps"),
        curve("turns that count", at, found.levels[at], "marks"),
        curve("their mean", ends, mean, "dashed"),
    )
    return chart_plot(Chart("staircase", "", "", "trial", "difference", curves))
