"""Figure of the drift of gains over the workspace."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from matplotlib.patheffects import withStroke

from ..model.constants import AXES, L1, L2, ORIGIN, PATH_LENGTH
from ..studies.identification import NOMINAL_POSE, endpoint_mobility, printed_form
from ..studies.workspace import DRIFT_BLOCKS, Drift
from .palette import BLACK, MID_GREY, VERMILION, WHITE
from .panels import add_legend, set_title
from .style import figure_size, figure_style, narrow, points, stroke

MOBILITY_POINTS = 81  # along the y side of the map on which the contours of W are drawn


@figure_style(axes_grid=False)
def workspace_plot(drift: Drift) -> Figure:
    """Plots the gain of Sh over the workspace: fitted in cells, bare mobility as contours."""
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
            set_title(ax, f"gain of S$_{AXES[i]}$, {title}", panel=True)
        bar = figure.colorbar(mesh, ax=row, pad=0.01, aspect=16)
        bar.set_label("gain [1/kg] (line: printed)")
        bar.ax.axhline(printed_form("S", AXES[i])[0], color=VERMILION, lw=stroke(2.0))
        for ax in row if narrow() else row[:1]:
            ax.set_ylabel("world y [m]")
    for ax in axes[1, 1:] if narrow() else axes[1]:
        ax.set_xlabel("world x [m]")
    add_legend(figure)
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
