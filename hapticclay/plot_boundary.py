"""The picture of a map of stability."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib import ticker
from matplotlib.figure import Figure

from .maps import Map
from .params import Operator
from .plot import BLACK, BLUE, GREEN, ORANGE, STYLE

PINK, YELLOW = "#CC79A7", "#E69F00"  # Okabe and Ito
LINES = ((BLUE, "-"), (ORANGE, "--"), (GREEN, "-."), (PINK, ":"), (YELLOW, (0, (1, 1))))
DOTS: Any = (dict(marker="o", mfc=BLACK), dict(marker="D", mfc="white"))
RUNS: Any = {  # what a run did: marker and colour
    "stable": dict(marker="o", color="#AAAAAA"),
    "limit cycle": dict(marker="s", color="#777777"),
    "diverges": dict(marker="x", color="#777777"),
}
SCALE = {"delay-damping": (1e3, "[s]", "[ms]"), "gain-pose": (1e2, "[m]", "[cm]")}  # of the x axis


def boundaries(chart: Map) -> Figure:
    """Analytic boundaries as lines, those from runs as dots; what each cell's run did, ringed where theory errs."""
    factor, unit, shown = SCALE.get(chart.kind, (1.0, "", ""))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 5.6))
        ax = figure.add_subplot()
        ax.set_yscale("log")
        if chart.kind != "gain-pose":
            ax.set_xscale("log")
        for (name, (x, y)), (color, style) in zip(chart.lines.items(), LINES, strict=False):
            ax.plot(factor * np.array(x), _finite(y), color=color, ls=style, label=name)
        for (name, (x, y)), dot in zip(chart.found.items(), DOTS, strict=False):
            ax.plot(factor * np.array(x), _finite(y), color=BLACK, ls="none", ms=6, zorder=5, label=_run(name), **dot)
        for name, look in RUNS.items():
            mine = [c for c in chart.cells if c.simulated == name]
            if mine:
                x, y = [factor * c.x for c in mine], [c.y for c in mine]
                ax.plot(x, y, ls="none", mfc="none", ms=5, label=f"a run: {name}", **look)
        wrong = [c for c in chart.cells if c.cause]
        if wrong:
            x, y = [factor * c.x for c in wrong], [c.y for c in wrong]
            label = "not as in continuous time at the nominal pose"
            ax.plot(x, y, ls="none", marker="o", mfc="none", color=ORANGE, ms=12, mew=1.2, label=label)
        ys = [c.y for c in chart.cells]
        top = 1.5 * max(ys)
        ys += [y for _, v in chart.lines.values() for y in v if 0.0 < y < top]
        ax.set_ylim(0.7 * min(ys), top)
        ax.yaxis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
        for side in (ax.xaxis, ax.yaxis):
            side.set_major_formatter(ticker.FormatStrFormatter("%g"))
            side.set_minor_formatter(ticker.NullFormatter())
        ax.set_xlabel(chart.x_name.replace(unit, shown) if unit else chart.x_name)
        ax.set_ylabel(chart.y_name)
        figure.legend(loc="outside upper center", ncols=2, fontsize=8)
        ax.set_title(_title(chart), fontsize=9, loc="left", color="#555555")
    return figure


def _finite(y: list[float]) -> np.ndarray:
    a = np.array(y, dtype=float)
    return np.where(np.isfinite(a) & (a > 0.0), a, np.nan)


def _run(name: str) -> str:
    return name.replace("runs", "boundary found by runs")


def _title(chart: Map) -> str:
    s = chart.loop
    kept = [f"{s.axis} axis"]
    if chart.kind != "gain-damping":
        kept.append(f"K = {s.K:g}" if chart.kind == "delay-damping" else f"b = {s.b:g} N.s/m")
    kept.append("no hand" if s.operator is None else "nominal hand" if s.operator == Operator() else "given hand")
    kept.append(f"Ts = {1e3 * s.Ts:g} ms" if s.Ts else "continuous")
    if s.delay and chart.kind != "delay-damping":
        kept.append(f"{1e3 * s.delay:g} ms late")
    if chart.kind != "gain-pose":
        kept.append("shaping" if s.shaping else "no shaping")
    return ", ".join(kept) + "; stable below"
