"""Maps of a sweep: what came of each run, over two of its parameters."""

from __future__ import annotations

import math
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from ..errors import ParameterError, choice
from .run_plots import BLUE, GREEN, GREY, ORANGE, STYLE

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
    free = [x == 0.0 and (stem == "fe_over_v" or any(y > 0.0 for y in b)) for x in b] or [False] * len(status)
    rest = "border not reached" if value.startswith("crossing") else "no steady speed" if b else "no figure"
    return [
        s if s == "refused" else "no clay reached" if f else "" if math.isfinite(x) else rest
        for s, f, x in zip(status, free, figures, strict=True)
    ]


def heat(table: Any, value: str = "status", x: str | None = None, y: str | None = None) -> Figure:
    """A map of one column over two parameters, the mean (of status the worst) over any others.

    Args:
        table: from sweep.read. value: column to show, of numbers or "status". x, y: parameters; None for the first two
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
    choice("column", value, [n for n in table.column_names if n == "status" or str(table[n].type) != "string"])
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
        ax.set_title(f"{value.replace('_', ' ')}, {len(z)} runs", fontsize=9, loc="left", color=GREY)
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
            corners = np.stack([(ex[i + u], ey[j + v]) for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))])
            style: Any = dict(facecolor=look["color"], hatch=look["hatch"], edgecolor=HATCH, linewidth=0.0)
            ax.add_patch(PathPatch(Path.make_compound_path_from_polys(corners.transpose(2, 0, 1)), **style))
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
                marker=look["marker"], color=OUTCOMES.get(name, HATCH), s=size, linewidths=0.8, label=name
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
    return bool(np.std(np.diff(np.log(values))) * np.ptp(values) < np.std(np.diff(values)) * np.ptp(np.log(values)))


def _edges(values: np.ndarray) -> np.ndarray:
    """Borders of the cells around values, in the scale in which they are even."""
    if len(values) == 1:
        return values[0] + np.array([-0.5, 0.5]) * (abs(values[0]) or 1.0) * 0.1
    log = _logarithmic(values)
    v = np.log(values) if log else values
    middle = 0.5 * (v[1:] + v[:-1])
    out = np.concatenate(([v[0] - (middle[0] - v[0])], middle, [v[-1] + (v[-1] - middle[-1])]))
    return np.exp(out) if log else out


def _sweep_cells(px: np.ndarray, py: np.ndarray, z: np.ndarray, gx: np.ndarray, gy: np.ndarray, worst: bool) -> np.ndarray:
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
