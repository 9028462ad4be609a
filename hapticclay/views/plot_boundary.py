"""The picture of a map of stability."""

from __future__ import annotations

import math
from typing import Any

import matplotlib
import numpy as np
from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..model.scenario import Operator
from ..studies.stability_map import Map
from .run_plots import BLACK, BLUE, GREEN, ORANGE, STYLE

PINK, YELLOW = "#CC79A7", "#E69F00"  # Okabe and Ito
LINES = ((BLUE, "-"), (ORANGE, "--"), (GREEN, "-."), (PINK, (0, (1, 1))), (YELLOW, (0, (5, 1, 1, 1, 1, 1))))
DOTS: Any = (dict(marker="o", mfc=BLACK), dict(marker="D", mfc="white"))
RUNS: Any = {  # what a run did: marker
    "stable": dict(marker="o", mfc="none"),
    "limit cycle": dict(marker="s", mfc="none"),
    "diverges": dict(marker="x"),
}
CELL = "#666666"
SCALE = {"delay-damping": (1e3, "[s]", "[ms]"), "gain-pose": (1e2, "[m]", "[cm]")}  # of the x axis


def boundaries(chart: Map) -> Figure:
    """Analytic boundaries as lines, those from runs as dots; what each cell's run did, ringed where theory errs."""
    factor, unit, shown = SCALE.get(chart.kind, (1.0, "", ""))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 6.0))
        ax = figure.add_subplot()
        ax.set_yscale("log")
        if chart.kind != "gain-pose":
            ax.set_xscale("log")
        low, high = _span(chart)
        for (name, (x, y)), (color, style) in zip(chart.lines.items(), LINES, strict=False):
            if x[0] == x[-1]:  # upright: it does not end where the cells do
                ax.axvline(factor * x[0], color=color, ls=style, label=name)
            else:
                ax.plot(factor * np.array(x), _finite(y), color=color, ls=style, label=name)
        for name, look in RUNS.items():
            mine = [c for c in chart.cells if c.simulated == name]
            if mine:
                x, y = [factor * c.x for c in mine], [c.y for c in mine]
                ax.plot(x, y, ls="none", color=CELL, ms=6, mew=1.2, label=f"a run: {name}", **look)
        wrong = [c for c in chart.cells if c.cause]
        if wrong:
            x, y = [factor * c.x for c in wrong], [c.y for c in wrong]
            label = "unlike continuous time, no delay, nominal pose"
            ax.plot(x, y, ls="none", marker="o", mfc="none", color=ORANGE, ms=13, mew=1.5, label=label)
        for (name, (x, y)), dot in zip(chart.found.items(), DOTS, strict=False):
            ax.plot(factor * np.array(x), _finite(y), color=BLACK, ls="none", ms=7, zorder=5, label=_run(name), **dot)
        beyond = [factor * a for x, y in chart.found.values() for a, b in zip(x, y, strict=True) if b > high]
        if beyond:
            at: Any = dict(transform=ax.get_xaxis_transform(), clip_on=False, zorder=5)
            ax.plot(beyond, [1.0] * len(beyond), "^", color=BLACK, ms=8, label="runs: stable up to here", **at)
        ax.set_ylim(low, high)
        _ticks(ax, chart)
        ax.set_xlabel(_units(chart.x_name.replace(unit, shown) if unit else chart.x_name))
        ax.set_ylabel(_units(chart.y_name))
        figure.legend(loc="outside upper center", ncols=2, fontsize=9)
        ax.set_title(_title(chart), fontsize=10, loc="left", color="#444444", pad=10.0)
    return figure


def _span(chart: Map) -> tuple[float, float]:
    """What the y axis shows: every cell, the lines about them, and boundaries found not far beyond."""
    cells = [c.y for c in chart.cells]
    top = 3.0 * max(cells)
    found = [y for _, v in chart.found.values() for y in v if math.isfinite(y) and 0.0 < y < top]
    high = 1.3 * max(cells + found)
    lines = [y for _, v in chart.lines.values() for y in v if 0.0 < y < high]
    return 0.7 * min(cells + found + lines), high


def _ticks(ax: Axes, chart: Map) -> None:
    """Labels a reader can interpolate between: 1, 2, 5 on a short log axis, powers of ten on a long one."""
    for side in (ax.yaxis,) if chart.kind == "gain-pose" else (ax.xaxis, ax.yaxis):
        low, high = ax.get_xlim() if side is ax.xaxis else ax.get_ylim()
        decades = math.log10(high / low)
        subs = (1.0, 2.0, 3.0, 5.0, 7.0) if decades < 1.2 else (1.0, 2.0, 5.0) if decades < 3.0 else (1.0,)
        side.set_major_locator(ticker.LogLocator(subs=subs))
        side.set_major_formatter(ticker.FormatStrFormatter("%g"))
        side.set_minor_formatter(ticker.NullFormatter())


def _units(text: str) -> str:
    return text.replace("N.s/m", "N$\\cdot$s/m")


def _finite(y: list[float]) -> np.ndarray:
    a = np.array(y, dtype=float)
    return np.where(np.isfinite(a) & (a > 0.0), a, np.nan)


def _run(name: str) -> str:
    return name.replace("runs", "boundary found by runs")


def _title(chart: Map) -> str:
    s = chart.loop
    kept = [f"{s.axis} axis"]
    if chart.kind != "gain-damping":
        kept.append(f"K = {s.K:g} 1/kg" if chart.kind == "delay-damping" else f"b = {s.b:g} N$\\cdot$s/m")
    kept.append("no hand" if s.operator is None else "nominal hand" if s.operator == Operator() else "given hand")
    kept.append(f"Ts = {1e3 * s.Ts:g} ms" if s.Ts else "continuous time")
    if s.delay and chart.kind != "delay-damping":
        kept.append(f"{1e3 * s.delay:g} ms late")
    if chart.kind != "gain-pose":
        kept.append("shaping" if s.shaping else "no shaping")
    return ", ".join(kept) + "; stable below the lines"
