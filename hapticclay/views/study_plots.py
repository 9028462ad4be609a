"""Figures of studies: identification, maps of stability, sweeps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Patch, PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator, NullFormatter

from ..errors import ParameterError, choice
from ..model.constants import AXES, L1, L2, ORIGIN, PATH_LENGTH
from ..model.operator import Operator
from ..studies.identification import (
    NOMINAL_POSE,
    Identified,
    endpoint_mobility,
    format_coefficient,
    printed_form,
    response,
)
from ..studies.stability_map import StabilityMap
from ..studies.workspace import DRIFT_BLOCKS, Drift
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, STYLE

PINK, YELLOW = "#CC79A7", "#E69F00"  # Okabe and Ito
LINES = (
    (BLUE, "-"),
    (ORANGE, "--"),
    (GREEN, "-."),
    (PINK, (0, (1, 1))),
    (YELLOW, (0, (5, 1, 1, 1, 1, 1))),
)
DOTS: Any = (dict(marker="o", mfc=BLACK), dict(marker="D", mfc="white"))
RUNS: Any = {  # what a run did: marker
    "stable": dict(marker="o", mfc="none"),
    "limit cycle": dict(marker="s", mfc="none"),
    "diverges": dict(marker="x"),
}
CELL = "#666666"
SCALE = {"delay-damping": (1e3, "[s]", "[ms]"), "gain-pose": (1e2, "[m]", "[cm]")}  # of the x axis


def boundaries(chart: StabilityMap) -> Figure:
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
            ax.plot(
                x, y, ls="none", marker="o", mfc="none", color=ORANGE, ms=13, mew=1.5, label=label
            )
        for (name, (x, y)), dot in zip(chart.found.items(), DOTS, strict=False):
            ax.plot(
                factor * np.array(x),
                _finite(y),
                color=BLACK,
                ls="none",
                ms=7,
                zorder=5,
                label=_run(name),
                **dot,
            )
        beyond = [
            factor * a
            for x, y in chart.found.values()
            for a, b in zip(x, y, strict=True)
            if b > high
        ]
        if beyond:
            at: Any = dict(transform=ax.get_xaxis_transform(), clip_on=False, zorder=5)
            ax.plot(
                beyond,
                [1.0] * len(beyond),
                "^",
                color=BLACK,
                ms=8,
                label="runs: stable up to here",
                **at,
            )
        ax.set_ylim(low, high)
        _ticks(ax, chart)
        ax.set_xlabel(_units(chart.x_name.replace(unit, shown) if unit else chart.x_name))
        ax.set_ylabel(_units(chart.y_name))
        figure.legend(loc="outside upper center", ncols=2, fontsize=9)
        ax.set_title(_title(chart), fontsize=10, loc="left", color="#444444", pad=10.0)
    return figure


def _span(chart: StabilityMap) -> tuple[float, float]:
    """What the y axis shows: every cell, the lines about them, and boundaries found not far beyond."""
    cells = [c.y for c in chart.cells]
    top = 3.0 * max(cells)
    found = [y for _, v in chart.found.values() for y in v if math.isfinite(y) and 0.0 < y < top]
    high = 1.3 * max(cells + found)
    lines = [y for _, v in chart.lines.values() for y in v if 0.0 < y < high]
    return 0.7 * min(cells + found + lines), high


def _ticks(ax: Axes, chart: StabilityMap) -> None:
    """Labels a reader can interpolate between: 1, 2, 5 on a short log axis, powers of ten on a long one."""
    for side in (ax.yaxis,) if chart.kind == "gain-pose" else (ax.xaxis, ax.yaxis):
        low, high = ax.get_xlim() if side is ax.xaxis else ax.get_ylim()
        decades = math.log10(high / low)
        subs = (
            (1.0, 2.0, 3.0, 5.0, 7.0)
            if decades < 1.2
            else (1.0, 2.0, 5.0)
            if decades < 3.0
            else (1.0,)
        )
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


def _title(chart: StabilityMap) -> str:
    s = chart.loop
    kept = [f"{s.axis} axis"]
    if chart.kind != "gain-damping":
        kept.append(
            f"K = {s.K:g} 1/kg" if chart.kind == "delay-damping" else f"b = {s.b:g} N$\\cdot$s/m"
        )
    kept.append(
        "no hand"
        if s.operator is None
        else "nominal hand"
        if s.operator == Operator()
        else "given hand"
    )
    kept.append(f"Ts = {1e3 * s.Ts:g} ms" if s.Ts else "continuous time")
    if s.delay and chart.kind != "delay-damping":
        kept.append(f"{1e3 * s.delay:g} ms late")
    if chart.kind != "gain-pose":
        kept.append("shaping" if s.shaping else "no shaping")
    return ", ".join(kept) + "; stable below the lines"


FIGURES = {"G": "fig4", "S": "fig5", "Th": "fig6"}  # of the paper
EQUATIONS = {
    "Gx": "Eq. 15",
    "Gy": "Eq. 16",
    "Sx": "Eq. 17",
    "Sy": "Eq. 18",
    "Thx": "Eq. 19",
    "Thy": "Eq. 19",
}
SYMBOLS = {"G": "G", "S": "S", "Th": "T$_h$"}
SCALES = {"G": "dB re 1 m/m", "S": "dB re 1 m/N", "Th": "dB re 1 N/m"}
ARM = "#888888"
POSES = 81  # points along each side on which the contours of W are drawn


def bode(results: Sequence[Identified]) -> Figure:
    """Magnitude, phase and coherence of one block, an axis a column, the printed equation beside the points.

    Args:
        results: of one block, one or both axes.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(max(1.2 + 3.6 * len(results), 6.0), 5.4))
        axes: Any = figure.subplots(
            3, len(results), sharex=True, sharey="row", squeeze=False, height_ratios=(2.2, 2.0, 0.8)
        )
        for column, result in zip(axes.T, results, strict=True):
            _column(column, result)
        what = results[0].what
        for ax, label in zip(
            axes[:, 0], (f"magnitude [{SCALES[what]}]", "phase [deg]", "coherence"), strict=True
        ):
            ax.set_ylabel(label)
        figure.align_ylabels(axes[:, 0])
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _column(axes: Sequence[Axes], result: Identified) -> None:
    magnitude, phase, coherence = axes
    what, f = result.what, result.frequency
    fine = np.geomspace(f[0] / 1.15, f[-1] * 1.15, 400)
    block = f"{what}{result.axis}"
    known, fitted = (
        response(what, x, fine) for x in (printed_form(what, result.axis), result.values)
    )
    share = result.deviation / np.abs(result.response)
    error = 1.96 * np.array((20.0 / np.log(10.0) * share, np.degrees(share)))
    for ax, part, e in ((magnitude, _decibel, error[0]), (phase, _degrees, error[1])):
        ax.plot(fine, part(known), color=ORANGE, lw=2.2, label="printed")
        ax.plot(fine, part(fitted), color=BLACK, ls=":", lw=1.2, label="fitted to the points")
        marks: Any = dict(
            fmt="o", ms=4.0, mfc="white", mew=1.2, color=BLUE, elinewidth=1.0, zorder=3
        )
        ax.errorbar(f, part(result.response), e, label="simulated arm, with 95 % bars", **marks)
    coherence.plot(f, result.coherence, "o", ms=3.0, color=BLUE)
    low = min(0.9, float(result.coherence.min()))
    coherence.set_ylim(low - 0.1 * (1.0 - low), 1.0 + 0.2 * (1.0 - low))
    coherence.set_xscale("log")
    coherence.set_xlabel("frequency [Hz]")
    coherence.xaxis.set_major_formatter("{x:g}")
    coherence.xaxis.set_minor_formatter(NullFormatter())
    phase.yaxis.set_major_locator(MultipleLocator(45.0))
    magnitude.set_title(
        f"{SYMBOLS[what]}, {result.axis} axis ({EQUATIONS[block]})", fontsize=10, loc="left"
    )
    text = "\n".join(
        f"{c.name} {format_coefficient(c)} {_unit(c.unit)}" for c in result.coefficients
    )
    where: Any = dict(y=0.95, va="top") if what == "Th" else dict(y=0.06, va="bottom")
    magnitude.text(
        0.04, s=text, transform=magnitude.transAxes, fontsize=8, color="#444444", **where
    )


def _unit(unit: str) -> str:
    return unit.replace("^2", "$^2$").replace(".", "$\\cdot$")


def _decibel(H: np.ndarray) -> np.ndarray:
    return 20.0 * np.log10(np.abs(H))


def _degrees(H: np.ndarray) -> np.ndarray:
    return np.degrees(np.unwrap(np.angle(H)))


def workspace(drift: Drift) -> Figure:
    """The gain of Sh over the workspace, fitted (cells) beside the mobility of the bare arm (contours).

    Args:
        drift: from drift_map. An axis a row; without and with inertia shaping.
    """
    with matplotlib.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(9.4, 5.6))
        axes: Any = figure.subplots(2, 2, sharex=True, sharey=True)
        for i, row in enumerate(axes):
            top = max(
                float(drift.mobility[:, i].max()), float(drift.coefficients[:, :, 1, i, 0].max())
            )
            mesh: Any = None
            for k, ax in enumerate(row):
                mesh = _cells(
                    ax, drift, drift.coefficients[:, k, DRIFT_BLOCKS.index("S"), i, 0], 1.02 * top
                )
                if k == 0:
                    _contours(ax, i, top)
                _surroundings(ax)
                title = ("without inertia shaping", "with inertia shaping")[k]
                ax.set_title(f"gain of S$_{AXES[i]}$, {title}", fontsize=10, loc="left")
            bar = figure.colorbar(mesh, ax=row, pad=0.01, aspect=16)
            bar.set_label("gain [1/kg] (line: printed)")
            bar.ax.axhline(printed_form("S", AXES[i])[0], color=ORANGE, lw=2.0)
            row[0].set_ylabel("world y [m]")
        for ax in axes[1]:
            ax.set_xlabel("world x [m]")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=5)
    return figure


def _cells(ax: Axes, drift: Drift, values: np.ndarray, top: float) -> Any:
    """Colours a square for each pose."""
    half = 0.5 * drift.spacing
    x, y = (np.arange(z.min(), z.max() + half, drift.spacing) for z in (drift.x, drift.y))
    grid = np.full((len(y), len(x)), np.nan)
    grid[
        np.rint((drift.y - y[0]) / drift.spacing).astype(int),
        np.rint((drift.x - x[0]) / drift.spacing).astype(int),
    ] = values
    edges = (np.append(z - half, z[-1] + half) for z in (x, y))
    return ax.pcolormesh(*edges, grid, cmap="cividis", vmin=0.0, vmax=top, rasterized=True)


def _contours(ax: Axes, i: int, top: float) -> None:
    x, y = np.linspace(-L1 - L2, L1 + L2, 2 * POSES - 1), np.linspace(0.0, L1 + L2, POSES)
    w = np.full((len(y), len(x)), np.nan)
    for n, m in np.ndindex(w.shape):
        if abs(L2 - L1) < np.hypot(x[m], y[n]) < L1 + L2:
            w[n, m] = endpoint_mobility(float(x[m]), float(y[n]))[i]
    lines = ax.contour(x, y, w, np.arange(0.1, top, 0.2), colors=BLACK, linewidths=0.8)
    lines.set_path_effects([withStroke(linewidth=2.4, foreground="white")])
    for text in ax.clabel(lines, fmt="%.1f", fontsize=7):
        text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    ax.plot([], [], color=BLACK, lw=0.8, label="W of the bare arm [1/kg]")


def _surroundings(ax: Axes) -> None:
    for n, r in enumerate((L1 + L2, abs(L2 - L1))):
        ax.add_patch(Arc((0.0, 0.0), 2.0 * r, 2.0 * r, theta1=0.0, theta2=180.0, color=ARM, lw=2.0))
        ax.plot([], [], color=ARM, lw=2.0, label="_" if n else "limits of the reach")
    ax.plot(0.0, 0.0, "^", color=ARM, ms=7, clip_on=False, label="shoulder")
    ax.plot(
        (ORIGIN[0], ORIGIN[0] + PATH_LENGTH),
        (ORIGIN[1], ORIGIN[1]),
        color=ORANGE,
        label="default path",
    )
    ax.plot(*NOMINAL_POSE, "o", mfc="none", mec=ORANGE, mew=2.0, ms=9, label="nominal pose")
    ax.set_aspect("equal")
    ax.set_xlim(-0.62, 0.62)
    ax.set_ylim(-0.02, 0.62)


OUTCOMES = {  # Okabe and Ito, light to dark by how bad it is
    "finished": BLUE,
    "time limit": "#56B4E9",
    "stalled": "#BBBBBB",
    "saturated": "#F0E442",
    "limit cycle": "#E69F00",
    "diverged": ORANGE,
    "out of reach": "#CC79A7",
    "singular": GREEN,
    "refused": "#222222",
}
HATCH = "#888888"
ABSENT = {  # why a run has no figure: how its cell looks, and its point
    "refused": dict(color=OUTCOMES["refused"], hatch="", marker="X"),
    "no clay reached": dict(color="#E4E4E4", hatch="////", marker="x"),
    "border not reached": dict(color="#E4E4E4", hatch="////", marker="x"),
    "no steady speed": dict(color="#F4F4F4", hatch="....", marker="+"),
    "no figure": dict(color="white", hatch="xxxx", marker="1"),
}
UNITS = {"b": "N.s/m", "border": "m", "clay": "m", "crossing": "s", "damper": "N.s/m", "dt": "s", "end_time": "s",
         "energy_residual": "of what went through", "fe_over_v": "N.s/m", "force": "N", "gain": "1/kg",
         "gain_margin": "factor on K", "growth": "N.s/m per s", "length": "m", "mass": "kg", "origin": "m", "rms": "N",
         "speed": "m/s", "spring": "N/m", "start": "m", "t_max": "s", "torque_limit": "N.m", "Ts": "s",
         "wall_time": "s"}  # fmt: skip


def columns(table: Any) -> list[str]:
    """The parameters of a sweep's table: what stands between the run's number and its status."""
    names = table.column_names
    return names[1 : names.index("status")]


def absent(table: Any, value: str) -> list[str]:
    """Why each run has no figure in a column: one of ABSENT, or "" where it has one.

    fe/v and the speed are of clay: a run that reached none has no part in a map of them, if any other did.
    """
    status, figures = table["status"].to_pylist(), table[value].to_pylist()
    if value == "status":
        return [""] * len(status)
    stem, _, axis = value.rpartition("_")
    b = table[f"b_{axis}"].to_pylist() if stem in ("fe_over_v", "speed") else []
    free = [x == 0.0 and (stem == "fe_over_v" or any(y > 0.0 for y in b)) for x in b] or [
        False
    ] * len(status)
    rest = (
        "border not reached"
        if value.startswith("crossing")
        else "no steady speed"
        if b
        else "no figure"
    )
    return [
        s if s == "refused" else "no clay reached" if f else "" if math.isfinite(x) else rest
        for s, f, x in zip(status, free, figures, strict=True)
    ]


def heat(table: Any, value: str = "status", x: str | None = None, y: str | None = None) -> Figure:
    """A map of one column over two parameters, the mean (of status the worst) over any others.

    Args:
        table: from sweep.read_sweep. value: column to show, of numbers or "status". x, y: parameters; None for the first two
            that vary.

    Raises:
        ParameterError: an unknown column, or fewer than two parameters.
    """
    names = columns(table)
    if len(names) < 2:
        raise ParameterError("map", ", ".join(names), "needs two parameters that vary")
    x, y = x or names[0], y or next(n for n in names if n != (x or names[0]))
    for name in (x, y):
        choice("parameter", name, names)
    choice(
        "column",
        value,
        [n for n in table.column_names if n == "status" or str(table[n].type) != "string"],
    )
    px, py = (np.array(table[n]) for n in (x, y))
    kinds = list(OUTCOMES)
    raw = table[value].to_pylist()
    z = np.array([kinds.index(s) for s in raw] if value == "status" else raw, dtype=float)
    reasons = absent(table, value)
    why = np.array([list(ABSENT).index(r) if r else -1 for r in reasons], dtype=float)
    z[why >= 0.0] = np.nan
    gx, gy = np.unique(px), np.unique(py)
    how: dict[str, Any] = dict(cmap="cividis")
    if value == "status":
        how = dict(cmap=ListedColormap(list(OUTCOMES.values())), vmin=-0.5, vmax=len(kinds) - 0.5)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 4.6))
        ax = figure.add_subplot()
        draw = _mesh if len(gx) * len(gy) <= 4 * len(z) else _points
        image, handles = draw(ax, px, py, z, why, value == "status", how)
        if value == "status":
            handles = [Patch(facecolor=OUTCOMES[k], label=k) for k in kinds if k in raw]
        elif np.isfinite(z).any():
            figure.colorbar(image, ax=ax, label=_label(value))
        if handles:
            figure.legend(handles=handles, loc="outside upper center", ncols=4)
        for values, scale in ((gx, ax.set_xscale), (gy, ax.set_yscale)):
            if values[0] > 0.0 and _logarithmic(values):
                scale("log")
        ax.set(xlabel=_label(x), ylabel=_label(y))
        ax.grid(False)
        ax.set_title(
            f"{value.replace('_', ' ')}, {len(z)} runs", fontsize=9, loc="left", color=GREY
        )
    return figure


def _mesh(ax: Axes, px, py, z, why, worst: bool, how: dict[str, Any]) -> tuple[Any, list[Any]]:
    """Colours the cells of a grid; gives the image, and what its legend needs: a patch for each kind without figure."""
    gx, gy = np.unique(px), np.unique(py)
    ex, ey = _edges(gx), _edges(gy)
    shown = _sweep_cells(px, py, z, gx, gy, worst)
    image = ax.pcolormesh(ex, ey, shown, rasterized=True, **how)
    kind = np.where(np.isnan(shown), _sweep_cells(px, py, why, gx, gy, True), -1.0)
    handles = []
    for k, (name, look) in enumerate(ABSENT.items()):
        j, i = np.nonzero(kind == k)
        if len(i):
            corners = np.stack(
                [(ex[i + u], ey[j + v]) for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))]
            )
            style: Any = dict(
                facecolor=look["color"], hatch=look["hatch"], edgecolor=HATCH, linewidth=0.0
            )
            ax.add_patch(
                PathPatch(Path.make_compound_path_from_polys(corners.transpose(2, 0, 1)), **style)
            )
            handles.append(Patch(label=name, **style))
    return image, handles


def _points(ax: Axes, px, py, z, why, worst: bool, how: dict[str, Any]) -> tuple[Any, list[Any]]:
    """As _mesh, of runs that lie anywhere."""
    size, good = max(4.0, 4000.0 / len(z)), np.isfinite(z)
    handles = []
    for k, (name, look) in enumerate(ABSENT.items()):
        at = why == k
        if at.any():
            marks: Any = dict(
                marker=look["marker"],
                color=OUTCOMES.get(name, HATCH),
                s=size,
                linewidths=0.8,
                label=name,
            )
            handles.append(ax.scatter(px[at], py[at], **marks))
    return ax.scatter(px[good], py[good], c=z[good], s=size, **how), handles


def _label(name: str) -> str:
    stem = name.rstrip("123").removesuffix("_x").removesuffix("_y")
    unit = next((UNITS[part] for part in (stem, *name.split(".")) if part in UNITS), "")
    return name.replace("_", " ") + (f" [{unit}]" if unit else "")


def _logarithmic(values: np.ndarray) -> bool:
    """Whether values are spaced more evenly by factors than by differences."""
    if len(values) < 3 or values[0] <= 0.0:
        return False
    return bool(
        np.std(np.diff(np.log(values))) * np.ptp(values)
        < np.std(np.diff(values)) * np.ptp(np.log(values))
    )


def _edges(values: np.ndarray) -> np.ndarray:
    """Borders of the cells around values, in the scale in which they are even."""
    if len(values) == 1:
        return values[0] + np.array([-0.5, 0.5]) * (abs(values[0]) or 1.0) * 0.1
    log = _logarithmic(values)
    v = np.log(values) if log else values
    middle = 0.5 * (v[1:] + v[:-1])
    out = np.concatenate(([v[0] - (middle[0] - v[0])], middle, [v[-1] + (v[-1] - middle[-1])]))
    return np.exp(out) if log else out


def _sweep_cells(
    px: np.ndarray, py: np.ndarray, z: np.ndarray, gx: np.ndarray, gy: np.ndarray, worst: bool
) -> np.ndarray:
    """z over the grid, shape (len(gy), len(gx)); NaN where there is no run."""
    i, j = np.searchsorted(gx, px), np.searchsorted(gy, py)
    out = np.full((len(gy), len(gx)), -np.inf if worst else 0.0)
    if worst:
        np.maximum.at(out, (j, i), z)
        return np.where(np.isfinite(out), out, np.nan)
    count = np.zeros_like(out)
    good = np.isfinite(z)
    np.add.at(out, (j[good], i[good]), z[good])
    np.add.at(count, (j[good], i[good]), 1.0)
    return np.divide(out, count, out=np.full_like(out, np.nan), where=count > 0)
