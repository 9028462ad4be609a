"""Figure of a map of an operator's behaviour in yielding clay."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from ..studies.yield_map import YieldMap
from .style import (
    BLACK,
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

PUSH_MARKS: Any = {
    "sticks": dict(marker="_", color=BLACK, mew=2.0),
    "limit cycle": dict(marker="o", mec=WHITE, mew=1.2),
    "grows": dict(marker="^", color=BLACK),
}
PUSH_NAMES = {"sticks": "sticks", "limit cycle": "buzzes (colour: its speed)", "grows": "grows"}


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
    with figure_style():
        figure = Figure(figsize=figure_size(1, 5.6, 7.4))
        ax = figure.add_subplot()
        ax.set(xscale="log", yscale="log", xlim=(Fy[0], Fy[-1]), ylim=(bottom, top))
        known = cycle[np.isfinite(cycle)]
        colors = LogNorm(known.min(), min(known.max(), 1e4)) if len(known) else LogNorm(1.0, 10.0)
        shaded = ax.pcolormesh(Fy, K, cycle, norm=colors, cmap="cividis", rasterized=True)
        ax.contourf(Fy, K, grows, levels=(0.5, 1.5), colors="none", hatches=["///"])
        edge = np.where(K < chart.least, np.nan, push / critical)
        ax.plot(edge, K, color=BLACK, label=unit_text("theory: edge of sticking"))
        for level, style, name in (
            (chart.least, "--", "no limit cycle below"),
            (chart.limit, "-.", "unstable in flowing clay above"),
        ):
            if level < top:
                ax.axhline(level, color=VERMILION, ls=style, label=f"theory: {name}")
        for name, look in PUSH_MARKS.items():
            mine = [c for c in chart.cells if c.simulated == name]
            for i, c in enumerate(mine):
                own = dict(look)
                if name == "limit cycle":
                    own["mfc"] = shaded.cmap(colors(1e3 * c.speed))
                label = f"a run: {PUSH_NAMES[name]}" if i == 0 else None
                ax.plot(c.Fy, c.K, ls="none", ms=stroke(8), label=label, **own)
        if wrong := [c for c in chart.cells if c.simulated != c.expected]:
            look: Any = dict(
                marker="o", mfc="none", color=VERMILION, ms=stroke(14), mew=stroke(1.5), ls="none"
            )
            ax.plot([c.Fy for c in wrong], [c.K for c in wrong], label="unlike theory", **look)
        ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7)))
        for side in (ax.xaxis, ax.yaxis):
            side.set_major_formatter(FormatStrFormatter("%g"))
            side.set_minor_formatter(NullFormatter())
        bar = figure.colorbar(shaded, ax=ax, format="%g")
        bar.set_label(unit_text("largest speed of the limit cycle [mm/s]"))
        ax.set(xlabel=unit_text("yield force Fy [N]"), ylabel=unit_text("gain K [1/kg]"))
        add_legend(figure, ax, 2, fontsize=points(9))
        s = chart.loop
        parts = [f"{s.axis} axis, push of {1e3 * push:g} mm/s", unit_text(f"b = {s.b:g} N.s/m")]
        parts += [
            hand_name(s.operator),
            "continuous time",
            "inertia_shaping" if s.inertia_shaping else "no shaping",
        ]
        set_title(ax, *parts[:-1], parts[-1] + "; hatched: grows; white: sticks")
    return figure
