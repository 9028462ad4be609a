"""Figure of a map of an operator's behaviour in yielding clay."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from ..studies.yield_map import YieldMap
from .captions import loop_parts
from .palette import BLACK, VERMILION, WHITE
from .panels import add_legend, label_axes, mark, plain_ticks, ring, set_title, single
from .style import figure_style, points, stroke

PUSH_MARKS: Any = {
    "sticks": dict(marker="_", color=BLACK, mew=2.0),
    "limit cycle": dict(marker="o", mec=WHITE, mew=1.2),
    "grows": dict(marker="^", color=BLACK),
}
PUSH_NAMES = {"sticks": "sticks", "limit cycle": "buzzes (colour: its speed)", "grows": "grows"}


@figure_style()
def yield_map_plot(chart: YieldMap) -> Figure:
    """Plots the outcome of a push over yield force and gain.

    Colours show the speed of the limit cycle, by theory and, in the dots, by runs.
    """
    push, low, high = chart.loop.push, *(f(c.Fy for c in chart.cells) for f in (min, max))
    bottom, top = 0.9 * min(c.K for c in chart.cells), chart.K[-1]
    Fy, K = np.geomspace(low / 1.3, 1.3 * high, 240), np.geomspace(bottom, top, 240)
    speed = np.array(chart.speed)
    some = np.isfinite(speed)
    critical = np.exp(np.interp(K, chart.K, np.log(np.maximum(chart.critical, 1e-12))))
    each = np.where(
        (K >= chart.least) & (K < chart.limit) & np.any(some),
        np.exp(np.interp(K, np.array(chart.K)[some], np.log(speed[some]))) if some.any() else 1.0,
        np.nan,
    )
    goes = push >= np.outer(np.where(K < chart.least, np.inf, critical), Fy)
    cycle = 1e3 * np.where(goes, np.outer(each, Fy), np.nan)
    grows = goes & (K >= chart.limit)[:, None]
    figure, ax = single(5.6, 7.4)
    ax.set(xscale="log", yscale="log", xlim=(Fy[0], Fy[-1]), ylim=(bottom, top))
    known = cycle[np.isfinite(cycle)]
    colors = LogNorm(known.min(), min(known.max(), 1e4)) if len(known) else LogNorm(1.0, 10.0)
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
        look = dict(ls="none", ms=stroke(8), label=f"a run: {PUSH_NAMES[c.simulated]}")
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
