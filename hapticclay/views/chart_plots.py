"""Figures of charts: theory as lines, runs as marks."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..studies.chart import Chart, curve
from ..studies.labs import Lab
from ..studies.staircase import StaircaseRun
from .style import (
    BLACK,
    CURVE_STYLES,
    add_legend,
    figure_size,
    figure_style,
    plain_ticks,
    stroke,
    unit_text,
)

MARKS = "osD^vPX"


def chart_plot(chart: Chart) -> Figure:
    """Plots a chart.

    Curves of the kind "line" cycle through the colours of the style. Marks have the colour of the
    preceding line, as runs match their theory, and are black without one.
    """
    with figure_style():
        figure = Figure(figsize=figure_size(1, 4.4))
        ax = figure.add_subplot()
        color, lines, marks = BLACK, 0, 0
        for c in chart.curves:
            look: Any = {}
            if c.kind == "marks":
                look = dict(ls="none", marker=MARKS[marks % len(MARKS)], mfc="none", zorder=4)
                look |= dict(ms=stroke(6.5), mew=stroke(1.4), clip_on=False)
                marks += 1
            elif c.kind == "dashed" and not c.name:
                look = dict(ls="--", lw=stroke(1.0))
            else:
                color = CURVE_STYLES[lines % len(CURVE_STYLES)][0]
                look = dict(ls="--" if c.kind == "dashed" else "-")
                look |= dict(drawstyle="steps-post") if c.kind == "steps" else {}
                lines += 1
            ax.plot(c.x, c.y, color=color, label=unit_text(c.name) or "_", **look)
        for axis, name in ((ax.xaxis, "x"), (ax.yaxis, "y")):
            if name in chart.log:
                getattr(ax, f"set_{name}scale")("log")
                plain_ticks(axis)
        if "y" not in chart.log and all((c.y >= 0.0).all() for c in chart.curves):
            ax.set_ylim(bottom=0.0)
        ax.set(xlabel=unit_text(chart.x), ylabel=unit_text(chart.y))
        add_legend(figure, ax, 3)
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
