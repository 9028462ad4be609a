"""Figures of tables of sweeps."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch, Rectangle
from matplotlib.path import Path

from ..errors import ParameterError, choice
from ..model.constants import AXES
from ..studies.sweep_rows import column_note
from .style import (
    BLACK,
    BLUE,
    GREEN,
    LIGHT_GREY,
    MID_GREY,
    ORANGE,
    PALE_GREY,
    PURPLE,
    SKY_BLUE,
    UNSTABLE,
    VERMILION,
    WHITE,
    YELLOW,
    add_legend,
    figure_size,
    figure_style,
    map_edges,
    set_title,
)

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
HATCHES = {"x": UNSTABLE["hatch"], "y": "///"}  # where the linear loop of an axis is unstable
RINGS = {"x": 3.0, "y": 5.0}  # ... around a point, area over that of the point
MISSING = {  # why a run has no value: style of its cell and of its point
    "refused": dict(color=BLACK, hatch="", marker="X"),
    "no clay reached": dict(color=PALE_GREY, hatch="////", marker="x"),
    "border not reached": dict(color=PALE_GREY, hatch="////", marker="x"),
    "no steady speed": dict(color=PALE_GREY, hatch="....", marker="+"),
    "no figure": dict(color=WHITE, hatch="xxxx", marker="1"),
}


def swept_parameters(table: Any) -> list[str]:
    """Lists the parameters of a sweep: the columns between the number of the run and its status."""
    names = table.column_names
    return names[1 : names.index("status")]


def missing_reasons(table: Any, value: str) -> list[str]:
    """Why each run has no value in a column: a key of MISSING, or "" for a run with a value.

    fe/v and the speed are properties of clay: runs that reached no clay are left out of their maps
    if any other run did.
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
    """Maps one column over two parameters: its mean over all others, or the worst status."""
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
        handles += show(ax, data, unstable_runs(table, value))
        if not worst and np.isfinite(z).any():
            figure.colorbar(image, ax=ax, label=_column_label(value))
        if handles:
            add_legend(figure, None, 4, handles=handles)
        for values, scale in ((gx, ax.set_xscale), (gy, ax.set_yscale)):
            if values[0] > 0.0 and _logarithmic(values):
                scale("log")
        ax.set(xlabel=_column_label(x), ylabel=_column_label(y))
        ax.grid(False)
        set_title(ax, value.replace("_", " "), f"{len(z)} runs", panel=True)
    return figure


def sweep_tables(
    table: Any, value: str = "status", x: str | None = None, y: str | None = None
) -> dict[str, dict[str, list]]:
    """Returns the numbers of a map of a sweep: its runs with both parameters and the column."""
    names = swept_parameters(table)
    x = x or names[0]
    y = y or next(n for n in names if n != x)
    columns = {_column_label(name): table[name].to_pylist() for name in (x, y, value)}
    return {"runs": columns | {"why none": missing_reasons(table, value)}}


class Mapped(NamedTuple):
    """Runs of a sweep to be mapped, one entry per run.

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


def unstable_runs(table: Any, value: str = "status") -> dict[str, np.ndarray]:
    """Whether the linear loop of an axis is unstable in each run: gain limit over K below 1.

    A column of one axis, such as speed_x, is told about that axis alone; others about both.
    """
    out = {}
    for axis in [a for a in AXES if value.endswith(f"_{a}")] or AXES:
        name = f"gain_margin_{axis}"
        if name in table.column_names:
            out[axis] = np.array(table[name], dtype=float) < 1.0
    return {axis: below for axis, below in out.items() if below.any()}


def _unstable_style(axis: str) -> dict[str, Any]:
    return UNSTABLE | {"hatch": HATCHES[axis], "label": f"gain margin of {axis} < 1"}


def _hatch_unstable(ax: Axes, data: Mapped, unstable: dict[str, np.ndarray]) -> list[Any]:
    """Hatches cells that hold an unstable run, each axis in its way; returns legend patches."""
    gx, gy = np.unique(data.x), np.unique(data.y)
    ex, ey = _cell_edges(gx), _cell_edges(gy)
    for axis, below in unstable.items():
        cells = _cell_values(data._replace(z=below.astype(float), worst=True), gx, gy)
        for row, column in np.argwhere(cells == 1.0).tolist():
            corner = (ex[column], ey[row])
            size = ex[column + 1] - ex[column], ey[row + 1] - ey[row]
            ax.add_patch(Rectangle(corner, *size, **_unstable_style(axis)))
    return [Patch(**_unstable_style(axis)) for axis in unstable]


def _ring_unstable(ax: Axes, data: Mapped, unstable: dict[str, np.ndarray]) -> list[Any]:
    """Rings points of unstable runs, each axis in its size; returns rings for the legend."""
    return [
        ax.scatter(
            data.x[below],
            data.y[below],
            s=RINGS[axis] * _point_size(data),
            facecolors="none",
            edgecolors=BLACK,
            linewidths=0.8,
            linestyles="-" if axis == AXES[0] else ":",
            label=_unstable_style(axis)["label"],
        )
        for axis, below in unstable.items()
    ]


def _point_size(data: Mapped) -> float:
    return max(4.0, 4000.0 / len(data.z))


def _draw_points(ax: Axes, data: Mapped, look: dict[str, Any]) -> tuple[Any, list[Any]]:
    """Draws runs off a grid as points; returns as _draw_grid."""
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
    unit = column_note(name)[0]
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
