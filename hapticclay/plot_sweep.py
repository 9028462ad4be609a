"""Maps of a sweep: what came of each run, over two of its parameters."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from .errors import ParameterError, choice
from .plot import BLUE, GREEN, GREY, ORANGE, STYLE

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
UNITS = {"b": "N.s/m", "force": "N", "dt": "s", "Ts": "s", "rms": "N", "growth": "N.s/m per s", "end_time": "s",
         "mass": "kg", "damper": "N.s/m", "spring": "N/m", "speed_x": "m/s", "speed_y": "m/s", "fe_over_v_x": "N.s/m",
         "fe_over_v_y": "N.s/m", "crossing1": "s", "crossing2": "s", "crossing3": "s"}  # fmt: skip


def columns(table: Any) -> list[str]:
    """The parameters of a sweep's table: what stands between the run's number and its status."""
    names = table.column_names
    return names[1 : names.index("status")]


def heat(table: Any, value: str = "status", x: str | None = None, y: str | None = None) -> Figure:
    """A map of one column over two parameters, the mean (of status the worst) over any others.

    Args:
        table: from sweep.read. value: column to show. x, y: parameters; None for the first two that vary.

    Raises:
        ParameterError: an unknown column, or fewer than two parameters.
    """
    names = columns(table)
    if len(names) < 2:
        raise ParameterError("map", ", ".join(names), "needs two parameters that vary")
    x, y = x or names[0], y or next(n for n in names if n != (x or names[0]))
    for name in (x, y):
        choice("parameter", name, names)
    choice("column", value, table.column_names)
    px, py = (np.array(table[n]) for n in (x, y))
    kinds = list(OUTCOMES)
    raw = table[value].to_pylist()
    z = np.array([kinds.index(s) for s in raw] if value == "status" else raw, dtype=float)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 4.6))
        ax = figure.add_subplot()
        gx, gy = np.unique(px), np.unique(py)
        if len(gx) * len(gy) <= 4 * len(z):
            shown = _cells(px, py, z, gx, gy, worst=value == "status")
            draw: Any = lambda **kw: ax.pcolormesh(_edges(gx), _edges(gy), shown, rasterized=True, **kw)  # noqa: E731
        else:
            draw = lambda **kw: ax.scatter(px, py, c=z, s=max(4.0, 4000.0 / len(z)), **kw)  # noqa: E731
        if value == "status":
            draw(cmap=ListedColormap(list(OUTCOMES.values())), vmin=-0.5, vmax=len(kinds) - 0.5)
            found = [k for k in kinds if k in raw]
            for k in found:
                ax.plot([], [], "s", color=OUTCOMES[k], label=k)
            figure.legend(loc="outside upper center", ncols=4)
        else:
            figure.colorbar(draw(cmap="cividis"), ax=ax, label=_label(value))
        for values, scale in ((gx, ax.set_xscale), (gy, ax.set_yscale)):
            if values[0] > 0.0 and _logarithmic(values):
                scale("log")
        ax.set(xlabel=_label(x), ylabel=_label(y))
        ax.grid(False)
        ax.set_title(f"{value.replace('_', ' ')}, {len(z)} runs", fontsize=9, loc="left", color=GREY)
    return figure


def _label(name: str) -> str:
    unit = UNITS.get(name) or UNITS.get(name.partition(".")[0]) or UNITS.get(name.partition(".")[2])
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


def _cells(px: np.ndarray, py: np.ndarray, z: np.ndarray, gx: np.ndarray, gy: np.ndarray, worst: bool) -> np.ndarray:
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
