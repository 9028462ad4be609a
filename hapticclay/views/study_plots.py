"""Figures of studies: maps of stability, identified responses, the workspace, sweeps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Patch, PathPatch, Rectangle
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FormatStrFormatter, LogLocator, MultipleLocator, NullFormatter

from ..errors import ParameterError, choice
from ..model.constants import AXES, L1, L2, ORIGIN, PATH_LENGTH
from ..studies.accuracy import CLEAR, SAMPLED, Ladder
from ..studies.identification import (
    NOMINAL_POSE,
    Identified,
    endpoint_mobility,
    format_coefficient,
    printed_form,
    response,
)
from ..studies.stability_map import StabilityMap
from ..studies.sweep import column_told
from ..studies.workspace import DRIFT_BLOCKS, Drift
from ..studies.yield_map import YieldMap
from .style import (
    BLACK,
    BLUE,
    CURVE_STYLES,
    GREEN,
    GREY,
    LIGHT_GREY,
    MID_GREY,
    ORANGE,
    PALE_GREY,
    PURPLE,
    SKY_BLUE,
    VERMILION,
    WHITE,
    YELLOW,
    add_legend,
    figure_size,
    figure_style,
    hand_name,
    map_edges,
    narrow,
    panel_grid,
    points,
    set_title,
    stroke,
    unit_text,
)

# Maps of stability

X_SCALES = {  # of the x axis: factor, unit of the data, unit shown
    "delay-damping": (1e3, "[s]", "[ms]"),
    "gain-pose": (1e2, "[m]", "[cm]"),
}
CELL_MARKS: Any = {
    "stable": dict(marker="o", mfc="none"),
    "limit cycle": dict(marker="s", mfc="none"),
    "diverges": dict(marker="x"),
}
UNSTABLE: Any = dict(  # where the linear loop of a run is unstable
    facecolor="none", hatch="\\\\\\", linewidth=0.0, edgecolor=BLACK, label="gain margin < 1"
)
BOUNDARY_MARKS: Any = (dict(marker="o", mfc=BLACK), dict(marker="D", mfc=WHITE))


def stability_map_plot(chart: StabilityMap) -> Figure:
    """Plots a map of stability.

    Lines are analytic boundaries, dots are boundaries found by runs, and a mark in each cell shows
    the outcome of its run, ringed where it contradicts the analysis. The linear loop of these runs
    is unstable where it is hatched.

    Args:
        chart: from `stability_map`.
    """
    factor, unit, shown = X_SCALES.get(chart.kind, (1.0, "", ""))
    with figure_style():
        figure = Figure(figsize=figure_size(1, 6.0, 7.4))
        ax = figure.add_subplot()
        ax.set_yscale("log")
        if chart.kind != "gain-pose":
            ax.set_xscale("log")

        def mark(x: Sequence[float], y: Any, **look: Any) -> None:
            ax.plot(factor * np.array(x), y, ls="none", **look)

        low, high = _map_span(chart)
        for (name, (x, y)), (color, style) in zip(chart.lines.items(), CURVE_STYLES, strict=False):
            look: Any = dict(color=color, ls=style, label=name)
            if x[0] == x[-1]:  # upright: it does not end where the cells do
                ax.axvline(factor * x[0], **look)
            else:
                ax.plot(factor * np.array(x), _positive(y), **look)
        if chart.limit:
            x, y = chart.lines[chart.limit]
            beyond = np.clip(y, low, high)
            ax.fill_between(factor * np.array(x), beyond, high, zorder=0, **UNSTABLE)
        for name, look in CELL_MARKS.items():
            if mine := [c for c in chart.cells if c.simulated == name]:
                look = dict(look, color=GREY, ms=stroke(6), mew=stroke(1.2), label=f"a run: {name}")
                mark([c.x for c in mine], [c.y for c in mine], **look)
        if wrong := [c for c in chart.cells if c.cause]:
            look = dict(marker="o", mfc="none", color=VERMILION, ms=stroke(13), mew=stroke(1.5))
            label = "unlike continuous time, no delay, nominal pose"
            mark([c.x for c in wrong], [c.y for c in wrong], label=label, **look)
        for (name, (x, y)), look in zip(chart.found.items(), BOUNDARY_MARKS, strict=False):
            label = name.replace("runs", "boundary found by runs")
            mark(x, _positive(y), color=BLACK, ms=stroke(7), zorder=5, label=label, **look)
        found = [(a, b) for x, y in chart.found.values() for a, b in zip(x, y, strict=True)]
        if beyond := [a for a, b in found if b > high]:
            look = dict(transform=ax.get_xaxis_transform(), clip_on=False, zorder=5, marker="^")
            label = "runs: stable up to here"
            mark(beyond, [1.0] * len(beyond), color=BLACK, ms=stroke(8), label=label, **look)
        ax.set_ylim(low, high)
        _log_ticks(ax, chart)
        x_name = chart.x_name.replace(unit, shown) if unit else chart.x_name
        ax.set(xlabel=unit_text(x_name), ylabel=unit_text(chart.y_name))
        add_legend(figure, ax, 2, fontsize=points(9))
        set_title(ax, *_map_parts(chart), pad=10.0)  # over the triangles
    return figure


def _map_span(chart: StabilityMap) -> tuple[float, float]:
    """Limits of y that hold every cell, the lines among them, and boundaries found nearby."""
    cells = [c.y for c in chart.cells]
    top = 3.0 * max(cells)
    found = [y for _, v in chart.found.values() for y in v if math.isfinite(y) and 0.0 < y < top]
    high = 1.3 * max(cells + found)
    lines = [y for _, v in chart.lines.values() for y in v if 0.0 < y < high]
    return 0.7 * min(cells + found + lines), high


def _log_ticks(ax: Axes, chart: StabilityMap) -> None:
    """Labels 1, 2, 5 on a short logarithmic axis, powers of ten on a long one."""
    for side in (ax.yaxis,) if chart.kind == "gain-pose" else (ax.xaxis, ax.yaxis):
        low, high = ax.get_xlim() if side is ax.xaxis else ax.get_ylim()
        decades = math.log10(high / low)
        some = (1.0, 2.0, 5.0) if decades < 3.0 else (1.0,)
        side.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7) if decades < 1.2 else some))
        side.set_major_formatter(FormatStrFormatter("%g"))
        side.set_minor_formatter(NullFormatter())


def _positive(y: Sequence[float]) -> np.ndarray:
    a = np.array(y, dtype=float)
    return np.where(np.isfinite(a) & (a > 0.0), a, np.nan)


def _map_parts(chart: StabilityMap) -> list[str]:
    """Phrases that describe the loop of a map in its title."""
    s = chart.loop
    parts = [f"{s.axis} axis"]
    if chart.kind == "delay-damping":
        parts.append(f"K = {s.K:g} 1/kg")
    elif chart.kind == "gain-pose":
        parts.append(unit_text(f"b = {s.b:g} N.s/m"))
    parts.append(hand_name(s.operator))
    parts.append(f"Ts = {1e3 * s.Ts:g} ms" if s.Ts else "continuous time")
    if s.delay and chart.kind != "delay-damping":
        parts.append(f"delay {1e3 * s.delay:g} ms")
    if chart.kind != "gain-pose":
        parts.append("inertia_shaping" if s.inertia_shaping else "no shaping")
    return [*parts[:-1], parts[-1] + "; stable below the lines"]


# The map of yield force and gain

PUSH_MARKS: Any = {
    "sticks": dict(marker="_", color=BLACK, mew=2.0),
    "limit cycle": dict(marker="o", mec=WHITE, mew=1.2),
    "grows": dict(marker="^", color=BLACK),
}
PUSH_NAMES = {"sticks": "sticks", "limit cycle": "buzzes (colour: its speed)", "grows": "grows"}


def yield_map_plot(chart: YieldMap) -> Figure:
    """Plots what a push ends in, over yield force and gain.

    Colours are the speed of the limit cycle by theory, and, in the dots, in runs.

    Args:
        chart: from `yield_map`.
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


# Identification


class PlottedBlock(NamedTuple):
    """How an identified block is presented.

    Attributes:
        figure: file name, after the figure of the paper.
        symbol: in titles.
        unit: of its magnitude.
        equations: of the paper, on x and y.
    """

    figure: str
    symbol: str
    unit: str
    equations: tuple[str, str]


BLOCKS = {
    "G": PlottedBlock("fig4", "G", "dB re 1 m/m", ("Eq. 15", "Eq. 16")),
    "S": PlottedBlock("fig5", "S", "dB re 1 m/N", ("Eq. 17", "Eq. 18")),
    "Th": PlottedBlock("fig6", "T$_h$", "dB re 1 N/m", ("Eq. 19", "Eq. 19")),
}


HEIGHTS = (2.2, 2.0, 0.8)  # of magnitude, phase and coherence


def identification_plot(results: Sequence[Identified]) -> Figure:
    """Plots magnitude, phase and coherence of one block with its printed equation.

    Args:
        results: of one block, on one axis or both; a column each.
    """
    rows, columns = panel_grid(len(results))
    with figure_style():
        figure = Figure(figsize=figure_size(2, 5.4 * rows, max(1.2 + 3.6 * len(results), 6.0)))
        look: Any = dict(sharex=True, squeeze=False)
        axes: Any = figure.subplots(3 * rows, columns, height_ratios=HEIGHTS * rows, **look)
        axes = axes.reshape(rows, 3, columns).transpose(1, 0, 2).reshape(3, -1)
        for row in axes:
            for ax in row[1:]:
                ax.sharey(row[0])
                ax.tick_params(labelleft=rows > 1)
        for column, result in zip(axes.T, results, strict=True):
            _response_column(column, result)
        labels = f"magnitude [{BLOCKS[results[0].what].unit}]", "phase [deg]", "coherence"
        named = axes if rows > 1 else axes[:, :1]
        for row, label in zip(named, labels, strict=True):
            for ax in row:
                ax.set_ylabel(label)
        low = min(0.9, *(float(r.coherence.min()) for r in results))
        axes[2, 0].set_ylim(low - 0.1 * (1.0 - low), 1.0 + 0.2 * (1.0 - low))
        figure.align_ylabels(named.ravel())
        add_legend(figure, axes[0, 0], 3)
    return figure


def identified_plot(result: Identified) -> Figure:
    """As `identification_plot` of one axis.

    Args:
        result: from `identify` or `identify_data`.
    """
    return identification_plot([result])


def _response_column(axes: Sequence[Axes], result: Identified) -> None:
    magnitude, phase, coherence = axes
    what, f = result.what, result.frequency
    fine = np.geomspace(f[0] / 1.15, f[-1] * 1.15, 400)
    known, fitted = (
        response(what, x, fine) for x in (printed_form(what, result.axis), result.values)
    )
    share = result.deviation / np.abs(result.response)
    error = 1.96 * np.array((20.0 / np.log(10.0) * share, np.degrees(share)))
    marks: Any = dict(
        fmt="o",
        ms=stroke(4.0),
        mfc=WHITE,
        mew=stroke(1.2),
        color=BLUE,
        elinewidth=stroke(1.0),
        zorder=3,
    )
    label = f"{'simulated arm' if result.scenario else 'measured'}, with 95 % bars"
    for ax, part, e in ((magnitude, _decibel, error[0]), (phase, _degrees, error[1])):
        ax.plot(fine, part(known), color=VERMILION, lw=stroke(2.2), label="printed")
        ax.plot(
            fine, part(fitted), color=BLACK, ls=":", lw=stroke(1.2), label="fitted to the points"
        )
        ax.errorbar(f, part(result.response), e, label=label, **marks)
    coherence.plot(f, result.coherence, "o", ms=stroke(3.0), color=BLUE)
    coherence.set_xscale("log")
    coherence.set_xlabel("frequency [Hz]")
    coherence.xaxis.set_major_formatter("{x:g}")
    coherence.xaxis.set_minor_formatter(NullFormatter())
    phase.yaxis.set_major_locator(MultipleLocator(45.0))
    block = BLOCKS[what]
    equation = block.equations[AXES.index(result.axis)]
    set_title(magnitude, f"{block.symbol}, {result.axis} axis ({equation})")
    text = "\n".join(
        unit_text(f"{c.name} {format_coefficient(c)} {c.unit}") for c in result.coefficients
    )
    where: Any = dict(y=0.95, va="top") if what == "Th" else dict(y=0.06, va="bottom")
    magnitude.text(
        0.04, s=text, transform=magnitude.transAxes, fontsize=points(8), color=GREY, **where
    )


def _decibel(H: np.ndarray) -> np.ndarray:
    return 20.0 * np.log10(np.abs(H))


def _degrees(H: np.ndarray) -> np.ndarray:
    return np.degrees(np.unwrap(np.angle(H)))


# The workspace

MOBILITY_POINTS = 81  # along the y side of the map on which the contours of W are drawn


def workspace_plot(drift: Drift) -> Figure:
    """Plots the gain of Sh over the workspace: fitted (cells), mobility of the bare arm (contours).

    Args:
        drift: from `drift_map`; a row for each axis, without and with inertia shaping.
    """
    with figure_style(axes_grid=False):
        figure = Figure(figsize=figure_size(2, 9.6 if narrow() else 5.6, 9.4))
        shape = (4, 1) if narrow() else (2, 2)
        axes: Any = figure.subplots(*shape, sharex=True, sharey=True).reshape(2, 2)
        for i, row in enumerate(axes):
            fitted = drift.coefficients[:, :, DRIFT_BLOCKS.index("S"), i, 0]
            top = max(float(drift.mobility[:, i].max()), float(fitted.max()))
            mesh: Any = None
            for k, ax in enumerate(row):
                mesh = _pose_cells(ax, drift, fitted[:, k], 1.02 * top)
                if k == 0:
                    _mobility_contours(ax, i, top)
                _workspace_frame(ax)
                title = ("without inertia shaping", "with inertia shaping")[k]
                set_title(ax, f"gain of S$_{AXES[i]}$, {title}")
            bar = figure.colorbar(mesh, ax=row, pad=0.01, aspect=16)
            bar.set_label("gain [1/kg] (line: printed)")
            bar.ax.axhline(printed_form("S", AXES[i])[0], color=VERMILION, lw=stroke(2.0))
            for ax in row if narrow() else row[:1]:
                ax.set_ylabel("world y [m]")
        for ax in axes[1, 1:] if narrow() else axes[1]:
            ax.set_xlabel("world x [m]")
        add_legend(figure, axes[0, 0])
    return figure


def _pose_cells(ax: Axes, drift: Drift, values: np.ndarray, top: float) -> Any:
    """Colours a square for each pose."""
    half = 0.5 * drift.spacing
    x, y = (np.arange(z.min(), z.max() + half, drift.spacing) for z in (drift.x, drift.y))
    i, j = (
        np.rint((z - at[0]) / drift.spacing).astype(int) for z, at in ((drift.x, x), (drift.y, y))
    )
    grid = np.full((len(y), len(x)), np.nan)
    grid[j, i] = values
    edges = (np.append(z - half, z[-1] + half) for z in (x, y))
    return ax.pcolormesh(*edges, grid, cmap="cividis", vmin=0.0, vmax=top, rasterized=True)


def _mobility_contours(ax: Axes, i: int, top: float) -> None:
    reach = L1 + L2
    x = np.linspace(-reach, reach, 2 * MOBILITY_POINTS - 1)
    y = np.linspace(0.0, reach, MOBILITY_POINTS)
    w = np.full((len(y), len(x)), np.nan)
    for n, m in np.ndindex(w.shape):
        if abs(L2 - L1) < np.hypot(x[m], y[n]) < reach:
            w[n, m] = endpoint_mobility(float(x[m]), float(y[n]))[i]
    lines = ax.contour(x, y, w, np.arange(0.1, top, 0.2), colors=BLACK, linewidths=0.8)
    lines.set_path_effects([withStroke(linewidth=2.4, foreground=WHITE)])
    for text in ax.clabel(lines, fmt="%.1f", fontsize=points(7)):
        text.set_path_effects([withStroke(linewidth=2.0, foreground=WHITE)])
    ax.plot([], [], color=BLACK, lw=stroke(0.8), label="W of the bare arm [1/kg]")


def _workspace_frame(ax: Axes) -> None:
    """Draws the limits of the reach, the shoulder, the default path and the nominal pose."""
    for r in (L1 + L2, abs(L2 - L1)):
        size = 2.0 * r, 2.0 * r
        ax.add_patch(Arc((0.0, 0.0), *size, theta2=180.0, color=MID_GREY, lw=stroke(2.0)))
    ax.plot([], [], color=MID_GREY, lw=stroke(2.0), label="limits of the reach")
    ax.plot(0.0, 0.0, "^", color=MID_GREY, ms=stroke(7), clip_on=False, label="shoulder")
    x, y = ORIGIN
    ax.plot((x, x + PATH_LENGTH), (y, y), color=VERMILION, label="default path")
    pose: Any = dict(mfc="none", mec=VERMILION, mew=stroke(2.0), ms=stroke(9))
    ax.plot(*NOMINAL_POSE, "o", label="nominal pose", **pose)
    ax.set(aspect="equal", xlim=(-0.62, 0.62), ylim=(-0.02, 0.62))


# Sweeps

OUTCOME_COLORS = {  # from good to bad
    "finished": BLUE,
    "time limit": SKY_BLUE,
    "stalled": LIGHT_GREY,
    "saturated": YELLOW,
    "limit cycle": ORANGE,
    "diverged": VERMILION,
    "out of reach": PURPLE,
    "singular": GREEN,
    "unresolved": MID_GREY,
    "refused": BLACK,
}
MISSING = {  # why a run has no figure: look of its cell and of its point
    "refused": dict(color=BLACK, hatch="", marker="X"),
    "no clay reached": dict(color=PALE_GREY, hatch="////", marker="x"),
    "border not reached": dict(color=PALE_GREY, hatch="////", marker="x"),
    "no steady speed": dict(color=PALE_GREY, hatch="....", marker="+"),
    "no figure": dict(color=WHITE, hatch="xxxx", marker="1"),
}


def swept_parameters(table: Any) -> list[str]:
    """Lists the parameters of a sweep: the columns between the number of the run and its status.

    Args:
        table: from `read_sweep`.
    """
    names = table.column_names
    return names[1 : names.index("status")]


def missing_reasons(table: Any, value: str) -> list[str]:
    """Says why each run has no figure in a column: a key of MISSING, or "" for a run with a figure.

    fe/v and the speed belong to clay: a run that reached no clay has no part in a map of them if
    any other run did.

    Args:
        table: from `read_sweep`.
        value: name of the column.
    """
    status, figures = table["status"].to_pylist(), table[value].to_pylist()
    if value == "status":
        return [""] * len(status)
    stem, _, axis = value.rpartition("_")
    b = table[f"b_{axis}"].to_pylist() if stem in ("fe_over_v", "speed") else []
    free = [x == 0.0 and (stem == "fe_over_v" or any(y > 0.0 for y in b)) for x in b]
    other = "no steady speed" if b else "no figure"
    if value.startswith("crossing"):
        other = "border not reached"

    def reason(outcome: str, in_free_space: bool, figure: float) -> str:
        if outcome == "refused":
            return outcome
        return "no clay reached" if in_free_space else "" if math.isfinite(figure) else other

    return list(map(reason, status, free or [False] * len(status), figures))


def sweep_plot(
    table: Any, value: str = "status", x: str | None = None, y: str | None = None
) -> Figure:
    """Maps one column over two parameters: its mean over all others, of the status the worst.

    Args:
        table: from `read_sweep`.
        value: column to show, of numbers or "status".
        x: parameter along x; None for the first that varies.
        y: parameter along y; None for the next.

    Raises:
        ParameterError: an unknown column, or fewer than two parameters.
    """
    names = swept_parameters(table)
    if len(names) < 2:
        raise ParameterError("map", ", ".join(names), "needs two parameters that vary")
    x, y = x or names[0], y or next(n for n in names if n != (x or names[0]))
    for name in (x, y):
        choice("parameter", name, names)
    numbers = [n for n in table.column_names if n == "status" or str(table[n].type) != "string"]
    choice("column", value, numbers)
    kinds, worst = list(OUTCOME_COLORS), value == "status"
    raw = table[value].to_pylist()
    z = np.array([kinds.index(s) for s in raw] if worst else raw, dtype=float)
    kind = np.array(
        [list(MISSING).index(r) if r else -1 for r in missing_reasons(table, value)], dtype=float
    )
    z[kind >= 0.0] = np.nan
    data = Mapped(np.array(table[x]), np.array(table[y]), z, kind, worst)
    gx, gy = np.unique(data.x), np.unique(data.y)
    look: dict[str, Any] = dict(cmap="cividis")
    if worst:
        colors = ListedColormap(list(OUTCOME_COLORS.values()))
        look = dict(cmap=colors, vmin=-0.5, vmax=len(kinds) - 0.5)
    with figure_style():
        figure = Figure(figsize=figure_size(1, 4.6))
        ax = figure.add_subplot()
        draw = _draw_grid if len(gx) * len(gy) <= 4 * len(z) else _draw_points
        image, handles = draw(ax, data, look)
        if worst:
            handles = [Patch(facecolor=OUTCOME_COLORS[k], label=k) for k in kinds if k in raw]
        show = _hatch_unstable if draw is _draw_grid else _ring_unstable
        handles += show(ax, data, least_margins(table))
        if not worst and np.isfinite(z).any():
            figure.colorbar(image, ax=ax, label=_column_label(value))
        if handles:
            add_legend(figure, None, 4, handles=handles)
        for values, scale in ((gx, ax.set_xscale), (gy, ax.set_yscale)):
            if values[0] > 0.0 and _logarithmic(values):
                scale("log")
        ax.set(xlabel=_column_label(x), ylabel=_column_label(y))
        ax.grid(False)
        set_title(ax, value.replace("_", " "), f"{len(z)} runs")
    return figure


def sweep_tables(
    table: Any, value: str = "status", x: str | None = None, y: str | None = None
) -> dict[str, dict[str, list]]:
    """Returns what a map of a sweep shows: its runs with both parameters and the column.

    Args:
        table: from `read_sweep`.
        value: column shown.
        x: as in `sweep_plot`.
        y: as in `sweep_plot`.
    """
    names = swept_parameters(table)
    x = x or names[0]
    y = y or next(n for n in names if n != x)
    columns = {_column_label(name): table[name].to_pylist() for name in (x, y, value)}
    return {"runs": columns | {"why none": missing_reasons(table, value)}}


class Mapped(NamedTuple):
    """Runs of a sweep to be mapped, an entry a run.

    Attributes:
        x: parameter along x, shape (n,).
        y: parameter along y, shape (n,).
        z: figure to show, NaN for none, shape (n,).
        kind: index into MISSING of a run without figure, -1 with one, shape (n,).
        worst: whether a cell shows the largest of its runs in place of their mean.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    kind: np.ndarray
    worst: bool


def _draw_grid(ax: Axes, data: Mapped, look: dict[str, Any]) -> tuple[Any, list[Any]]:
    """Colours the cells of a grid; returns the image and a patch for each kind without figure."""
    gx, gy = np.unique(data.x), np.unique(data.y)
    ex, ey = _cell_edges(gx), _cell_edges(gy)
    shown = _cell_values(data, gx, gy)
    image = ax.pcolormesh(ex, ey, shown, rasterized=True, **look)
    kinds = _cell_values(data._replace(z=data.kind, worst=True), gx, gy)
    kinds = np.where(np.isnan(shown), kinds, -1.0)
    handles = []
    for k, (name, kind) in enumerate(MISSING.items()):
        j, i = np.nonzero(kinds == k)
        if len(i):
            square = ((0, 0), (1, 0), (1, 1), (0, 1))
            corners = np.stack([(ex[i + u], ey[j + v]) for u, v in square])
            style: Any = dict(facecolor=kind["color"], hatch=kind["hatch"], linewidth=0.0)
            style["edgecolor"] = MID_GREY
            cells = Path.make_compound_path_from_polys(corners.transpose(2, 0, 1))
            ax.add_patch(PathPatch(cells, **style))
            handles.append(Patch(label=name, **style))
    return image, handles


def least_margins(table: Any) -> np.ndarray:
    """Gain limit of the linear loop over K, the lesser of both axes, of each run; NaN for none.

    Args:
        table: from `read_sweep`.
    """
    names = [n for n in table.column_names if n.startswith("gain_margin_")]
    if not names:
        return np.full(table.num_rows, np.nan)
    return np.fmin.reduce([np.array(table[n], dtype=float) for n in names])


def _hatch_unstable(ax: Axes, data: Mapped, margins: np.ndarray) -> list[Any]:
    """Hatches cells that hold a run whose margin is below 1; returns a patch for the legend."""
    gx, gy = np.unique(data.x), np.unique(data.y)
    below = _cell_values(data._replace(z=np.where(margins < 1.0, 1.0, 0.0), worst=True), gx, gy)
    j, i = np.nonzero(below == 1.0)
    if not len(i):
        return []
    ex, ey = _cell_edges(gx), _cell_edges(gy)
    for column, row in zip(i.tolist(), j.tolist(), strict=True):
        corner = (ex[column], ey[row])
        size = ex[column + 1] - ex[column], ey[row + 1] - ey[row]
        ax.add_patch(Rectangle(corner, *size, **UNSTABLE))
    return [Patch(**UNSTABLE)]


def _ring_unstable(ax: Axes, data: Mapped, margins: np.ndarray) -> list[Any]:
    """Rings points whose margin is below 1; returns a ring for the legend."""
    below = margins < 1.0
    if not below.any():
        return []
    style: Any = dict(facecolors="none", edgecolors=BLACK, linewidths=0.8, label=UNSTABLE["label"])
    return [ax.scatter(data.x[below], data.y[below], s=3.0 * _point_size(data), **style)]


def _point_size(data: Mapped) -> float:
    return max(4.0, 4000.0 / len(data.z))


def _draw_points(ax: Axes, data: Mapped, look: dict[str, Any]) -> tuple[Any, list[Any]]:
    """Draws runs that lie anywhere as points; returns as _draw_grid."""
    size, good = _point_size(data), np.isfinite(data.z)
    handles = []
    for k, (name, kind) in enumerate(MISSING.items()):
        at = data.kind == k
        if at.any():
            style: Any = dict(marker=kind["marker"], color=OUTCOME_COLORS.get(name, MID_GREY))
            style.update(s=size, linewidths=0.8, label=name)
            handles.append(ax.scatter(data.x[at], data.y[at], **style))
    points = ax.scatter(data.x[good], data.y[good], c=data.z[good], s=size, **look)
    return points, handles


def _column_label(name: str) -> str:
    unit = column_told(name)[0]
    return name.replace("_", " ") + (f" [{unit}]" if unit else "")


def _logarithmic(values: np.ndarray) -> bool:
    """Whether values are spaced more evenly by factors than by differences."""
    if len(values) < 3 or values[0] <= 0.0:
        return False
    ratios, differences = np.std(np.diff(np.log(values))), np.std(np.diff(values))
    return bool(ratios * np.ptp(values) < differences * np.ptp(np.log(values)))


def _cell_edges(values: np.ndarray) -> np.ndarray:
    """Borders of the cells around values, in the scale in which they are even."""
    if len(values) == 1:
        return values[0] + np.array([-0.5, 0.5]) * (abs(values[0]) or 1.0) * 0.1
    return map_edges(values, _logarithmic(values))


def _cell_values(data: Mapped, gx: np.ndarray, gy: np.ndarray) -> np.ndarray:
    """Mean or largest z in each cell, shape (len(gy), len(gx)); NaN in a cell without runs."""
    i, j = np.searchsorted(gx, data.x), np.searchsorted(gy, data.y)
    out = np.full((len(gy), len(gx)), -np.inf if data.worst else 0.0)
    if data.worst:
        np.maximum.at(out, (j, i), data.z)
        return np.where(np.isfinite(out), out, np.nan)
    count = np.zeros_like(out)
    good = np.isfinite(data.z)
    np.add.at(out, (j[good], i[good]), data.z[good])
    np.add.at(count, (j[good], i[good]), 1.0)
    return np.divide(out, count, out=np.full_like(out, np.nan), where=count > 0)


# Error against run time

SERIES_LOOKS: dict[str, Any] = {  # curve, and where its steps are written
    "fast": (dict(color=BLUE, marker="o", ls="-"), dict(xytext=(7, 5), ha="left")),
    "accurate": (dict(color=VERMILION, marker="s", ls="-"), dict(xytext=(-7, -12), ha="right")),
    SAMPLED: (dict(color=GREY, marker="^", ls=":"), dict(xytext=(7, 5), ha="left")),
}
ERROR_AXES = {"s": "error of the border times [s]", "m": "error of the position [m]"}


def accuracy_plot(ladder: Ladder) -> Figure:
    """Plots error against run time, a panel a unit, a curve a method, a mark a step.

    Rings mark settings that are the cheapest for an error; in the grey band, the error of the
    reference hides that of a setting.

    Args:
        ladder: from `accuracy_ladder`.
    """
    units = ladder.units()
    with figure_style():
        count = max(len(units), 1)
        rows, columns = panel_grid(count)
        figure = Figure(figsize=figure_size(count, 4.6 * rows, 4.4 * count + 0.6))
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for ax, unit in zip(axes, units, strict=False):
            _accuracy_panel(ax, ladder, unit)
        if units:
            add_legend(figure, axes[-1], 5 if len(units) > 1 else 2)
        parts = [ladder.scenario.name, f"{ladder.simulated:.4g} s simulated"]
        set_title(axes[0], *parts, f"engine {ladder.engine}", "steps written beside the marks")
    return figure


def _accuracy_panel(ax: Axes, ladder: Ladder, unit: str) -> None:
    ax.set(xscale="log", yscale="log", xlabel="run time [s]", ylabel=ERROR_AXES[unit])
    marks = [(x, e) for x in ladder.settings if (e := ladder.shown(x, unit)) and x.wall]
    for name, (look, side) in SERIES_LOOKS.items():
        mine = [(x.wall, e, x.dt) for x, e in marks if x.series == name]
        if not mine:
            continue
        walls, errors, steps = zip(*mine, strict=True)
        ax.plot(walls, errors, ms=stroke(5), lw=stroke(1.4), label=name, zorder=3, **look)
        for i in sorted({0, len(mine) - 1}):
            at: Any = (walls[i], errors[i])
            told: Any = dict(
                side, textcoords="offset points", fontsize=points(8), color=look["color"]
            )
            ax.annotate(_step(steps[i]), at, **told)
    best = [(x.wall, e) for x, e in marks if x in ladder.cheapest(unit).values()]
    if best:
        ring: Any = dict(
            ls="none", marker="o", mfc="none", color=BLACK, ms=stroke(11), mew=stroke(1.2), zorder=4
        )
        ax.plot(*zip(*best, strict=True), label="cheapest for an error", **ring)
    ax.margins(x=0.15, y=0.1)
    (first, last), (low, high) = ax.get_xlim(), ax.get_ylim()
    ax.set_xlim(first, 2.5 * last)  # room for the last step
    if left := ladder.left[unit]:
        low = min(low, 0.3 * left)
        ax.axhspan(low, CLEAR * left, color=PALE_GREY, lw=0, label="hidden by the reference")
    ax.set_ylim(low, high)


def _step(dt: float) -> str:
    """A step in words: 20 ms, 0.36 ms, 5 us."""
    return f"{1e3 * dt:.3g} ms" if dt >= 1e-5 else f"{1e6 * dt:.3g} us"
