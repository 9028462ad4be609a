"""Figures of tables of sweeps."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from ..errors import ParameterError, choice
from ..model.constants import AXES
from ..studies.sweep_rows import column_note
from .palette import (
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
)
from .panels import add_legend, cell_edges, label_axes, plain_ticks, set_title, single
from .style import figure_style

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


def mapped_names(table: Any, x: str | None, y: str | None) -> tuple[str, str]:
    """The parameters of a map: the first two that vary, unless others are given."""
    names = swept_parameters(table)
    if len(names) < 2:
        raise ParameterError("map", ", ".join(names), "needs two parameters that vary")
    x = x or names[0]
    y = y or next(n for n in names if n != x)
    return choice("parameter", x, names), choice("parameter", y, names)


@figure_style()
def sweep_plot(
    table: Any, value: str = "status", x: str | None = None, y: str | None = None
) -> Figure:
    """Maps one column over two parameters: its mean over all others, or the worst status."""
    x, y = mapped_names(table, x, y)
    numbers = [n for n in table.column_names if n == "status" or str(table[n].type) != "string"]
    choice("column", value, numbers)
    outcomes, raw = list(OUTCOME_COLORS), table[value].to_pylist()
    look: dict[str, Any] = dict(cmap="cividis")
    if value == "status":
        raw = [outcomes.index(s) for s in raw]
        colors = ListedColormap(list(OUTCOME_COLORS.values()))
        look = dict(cmap=colors, vmin=-0.5, vmax=len(outcomes) - 0.5)
    reasons = np.array(missing_reasons(table, value))
    z = np.where(reasons == "", np.array(raw, dtype=float), np.nan)
    runs = Mapped(np.array(table[x]), np.array(table[y]))
    figure, ax = single(4.6)
    draw = _draw_grid if runs.on_grid else _draw_points
    image, handles = draw(ax, runs, z, reasons, unstable_runs(table, value), look)
    if value == "status":
        met = [k for i, k in enumerate(outcomes) if i in raw]
        handles = [Patch(facecolor=OUTCOME_COLORS[k], label=k) for k in met] + handles
    elif np.isfinite(z).any():
        figure.colorbar(image, ax=ax, label=_column_label(value))
    if handles:
        add_legend(figure, 4, handles)
    logarithmic = {f"{n}scale": "log" for n, v in (("x", runs.x), ("y", runs.y)) if _spread_log(v)}
    ax.set(**logarithmic)
    plain_ticks(ax)
    label_axes(ax, _column_label(x), _column_label(y))
    ax.grid(False)
    set_title(ax, value.replace("_", " "), f"{len(z)} runs", panel=True)
    return figure


def sweep_tables(
    table: Any, value: str = "status", x: str | None = None, y: str | None = None
) -> dict[str, dict[str, list]]:
    """Returns the numbers of a map of a sweep: its runs with both parameters and the column."""
    names = (*mapped_names(table, x, y), value)
    columns = {_column_label(name): table[name].to_pylist() for name in names}
    return {"runs": columns | {"why none": missing_reasons(table, value)}}


class Mapped(NamedTuple):
    """The two parameters of the runs of a map, each of shape (n,)."""

    x: np.ndarray
    y: np.ndarray

    @property
    def on_grid(self) -> bool:
        """Whether the runs fill the cells of a grid, or lie anywhere."""
        return len(np.unique(self.x)) * len(np.unique(self.y)) <= 4 * len(self.x)

    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Borders of the cells along x and along y."""
        x, y = (cell_edges(np.unique(v), _spread_log(v)) for v in self)
        return x, y

    def cells(self, z: np.ndarray, largest: bool) -> np.ndarray:
        """Mean or largest value in each cell, shape (ny, nx); NaN in a cell without values."""
        (gx, i), (gy, j) = (np.unique(v, return_inverse=True) for v in self)
        known = np.isfinite(z)
        place = j[known], i[known]
        out = np.full((len(gy), len(gx)), -np.inf if largest else 0.0)
        if largest:
            np.maximum.at(out, place, z[known])
            return np.where(np.isfinite(out), out, np.nan)
        count = np.zeros_like(out)
        np.add.at(out, place, z[known])
        np.add.at(count, place, 1.0)
        return np.divide(out, count, out=np.full_like(out, np.nan), where=count > 0)


def _draw_grid(
    ax: Axes,
    runs: Mapped,
    z: np.ndarray,
    reasons: np.ndarray,
    unstable: dict[str, np.ndarray],
    look: dict[str, Any],
) -> tuple[Any, list[Any]]:
    """Colours cells, and covers those without value or with unstable runs; image and handles."""
    worst = "vmin" in look
    edges, shown = runs.edges(), runs.cells(z, worst)
    image = ax.pcolormesh(*edges, shown, rasterized=True, **look)
    kinds = list(MISSING)
    kind = np.array([kinds.index(r) if r else -1.0 for r in reasons], dtype=float)
    empty = np.where(np.isnan(shown), runs.cells(kind, True), -1.0)
    covers = []
    for k, (name, m) in enumerate(MISSING.items()):
        style: Any = dict(facecolor=m["color"], hatch=m["hatch"], edgecolor=MID_GREY, linewidth=0.0)
        covers.append((empty == k, style | {"label": name}))
    for axis, below in unstable.items():
        covers.append((runs.cells(below.astype(float), True) == 1.0, _unstable_look(axis)))
    handles = []
    for cells, style in covers:
        j, i = np.nonzero(cells)
        if len(i):
            square = ((0, 0), (1, 0), (1, 1), (0, 1))
            corners = np.stack([(edges[0][i + u], edges[1][j + v]) for u, v in square])
            outline = Path.make_compound_path_from_polys(corners.transpose(2, 0, 1))
            ax.add_patch(PathPatch(outline, **style))
            handles.append(Patch(**style))
    return image, handles


def _draw_points(
    ax: Axes,
    runs: Mapped,
    z: np.ndarray,
    reasons: np.ndarray,
    unstable: dict[str, np.ndarray],
    look: dict[str, Any],
) -> tuple[Any, list[Any]]:
    """Draws runs off a grid as points, and rings those that are unstable; as _draw_grid."""
    size, known = max(4.0, 4000.0 / len(z)), np.isfinite(z)
    image = ax.scatter(runs.x[known], runs.y[known], c=z[known], s=size, **look)
    handles = []
    for name, kind in MISSING.items():
        if (reasons == name).any():
            color = OUTCOME_COLORS.get(name, MID_GREY)
            mark: Any = dict(marker=kind["marker"], color=color, s=size, linewidths=0.8, label=name)
            at = reasons == name
            handles.append(ax.scatter(runs.x[at], runs.y[at], **mark))
    for axis, below in unstable.items():
        ring: Any = dict(s=RINGS[axis] * size, facecolors="none", edgecolors=BLACK, linewidths=0.8)
        ring |= dict(linestyles="-" if axis == "x" else ":", label=_unstable_look(axis)["label"])
        handles.append(ax.scatter(runs.x[below], runs.y[below], **ring))
    return image, handles


def unstable_runs(table: Any, value: str = "status") -> dict[str, np.ndarray]:
    """Whether the linear loop of an axis is unstable in each run: gain limit over K below 1.

    A column of one axis, such as speed_x, is judged along that axis alone; others along both.
    """
    out = {}
    for axis in [a for a in AXES if value.endswith(f"_{a}")] or AXES:
        name = f"gain_margin_{axis}"
        if name in table.column_names:
            out[axis] = np.array(table[name], dtype=float) < 1.0
    return {axis: below for axis, below in out.items() if below.any()}


def _unstable_look(axis: str) -> dict[str, Any]:
    return UNSTABLE | {"hatch": HATCHES[axis], "label": f"gain margin of {axis} < 1"}


def _column_label(name: str) -> str:
    unit = column_note(name)[0]
    return name.replace("_", " ") + (f" [{unit}]" if unit else "")


def _spread_log(values: np.ndarray) -> bool:
    """Whether values are spaced more evenly by factors than by differences."""
    values = np.unique(values)
    if len(values) < 3 or values[0] <= 0.0:
        return False
    ratios, differences = np.std(np.diff(np.log(values))), np.std(np.diff(values))
    return bool(ratios * np.ptp(values) < differences * np.ptp(np.log(values)))
