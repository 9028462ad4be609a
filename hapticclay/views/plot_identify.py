"""Figures of an identification: Bode diagrams like Figs. 4 to 6, and maps over the workspace."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator, NullFormatter

from ..model.scenario import AXES, L1, L2, ORIGIN, PATH_LENGTH
from ..studies.estimation import printed, response, value
from ..studies.identification import NOMINAL, Identified, mobility
from ..studies.workspace import BLOCKS, Drift
from .run_plots import BLACK, BLUE, ORANGE, STYLE

FIGURES = {"G": "fig4", "S": "fig5", "Th": "fig6"}  # of the paper
EQUATIONS = {"Gx": "Eq. 15", "Gy": "Eq. 16", "Sx": "Eq. 17", "Sy": "Eq. 18", "Thx": "Eq. 19", "Thy": "Eq. 19"}
SYMBOLS = {"G": "G", "S": "S", "Th": "T$_h$"}
SCALES = {"G": "dB re 1 m/m", "S": "dB re 1 m/N", "Th": "dB re 1 N/m"}
GREY = "#888888"
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
        for ax, label in zip(axes[:, 0], (f"magnitude [{SCALES[what]}]", "phase [deg]", "coherence"), strict=True):
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
    known, fitted = (response(what, x, fine) for x in (printed(what, result.axis), result.values))
    share = result.deviation / np.abs(result.response)
    error = 1.96 * np.array((20.0 / np.log(10.0) * share, np.degrees(share)))
    for ax, part, e in ((magnitude, _decibel, error[0]), (phase, _degrees, error[1])):
        ax.plot(fine, part(known), color=ORANGE, lw=2.2, label="printed")
        ax.plot(fine, part(fitted), color=BLACK, ls=":", lw=1.2, label="fitted to the points")
        marks: Any = dict(fmt="o", ms=4.0, mfc="white", mew=1.2, color=BLUE, elinewidth=1.0, zorder=3)
        ax.errorbar(f, part(result.response), e, label="simulated arm, with 95 % bars", **marks)
    coherence.plot(f, result.coherence, "o", ms=3.0, color=BLUE)
    low = min(0.9, float(result.coherence.min()))
    coherence.set_ylim(low - 0.1 * (1.0 - low), 1.0 + 0.2 * (1.0 - low))
    coherence.set_xscale("log")
    coherence.set_xlabel("frequency [Hz]")
    coherence.xaxis.set_major_formatter("{x:g}")
    coherence.xaxis.set_minor_formatter(NullFormatter())
    phase.yaxis.set_major_locator(MultipleLocator(45.0))
    magnitude.set_title(f"{SYMBOLS[what]}, {result.axis} axis ({EQUATIONS[block]})", fontsize=10, loc="left")
    text = "\n".join(f"{c.name} {value(c)} {_unit(c.unit)}" for c in result.coefficients)
    where: Any = dict(y=0.95, va="top") if what == "Th" else dict(y=0.06, va="bottom")
    magnitude.text(0.04, s=text, transform=magnitude.transAxes, fontsize=8, color="#444444", **where)


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
            top = max(float(drift.mobility[:, i].max()), float(drift.coefficients[:, :, 1, i, 0].max()))
            mesh: Any = None
            for k, ax in enumerate(row):
                mesh = _cells(ax, drift, drift.coefficients[:, k, BLOCKS.index("S"), i, 0], 1.02 * top)
                if k == 0:
                    _contours(ax, i, top)
                _surroundings(ax)
                title = ("without inertia shaping", "with inertia shaping")[k]
                ax.set_title(f"gain of S$_{AXES[i]}$, {title}", fontsize=10, loc="left")
            bar = figure.colorbar(mesh, ax=row, pad=0.01, aspect=16)
            bar.set_label("gain [1/kg] (line: printed)")
            bar.ax.axhline(printed("S", AXES[i])[0], color=ORANGE, lw=2.0)
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
        np.rint((drift.y - y[0]) / drift.spacing).astype(int), np.rint((drift.x - x[0]) / drift.spacing).astype(int)
    ] = values
    edges = (np.append(z - half, z[-1] + half) for z in (x, y))
    return ax.pcolormesh(*edges, grid, cmap="cividis", vmin=0.0, vmax=top, rasterized=True)


def _contours(ax: Axes, i: int, top: float) -> None:
    x, y = np.linspace(-L1 - L2, L1 + L2, 2 * POSES - 1), np.linspace(0.0, L1 + L2, POSES)
    w = np.full((len(y), len(x)), np.nan)
    for n, m in np.ndindex(w.shape):
        if abs(L2 - L1) < np.hypot(x[m], y[n]) < L1 + L2:
            w[n, m] = mobility(float(x[m]), float(y[n]))[i]
    lines = ax.contour(x, y, w, np.arange(0.1, top, 0.2), colors=BLACK, linewidths=0.8)
    lines.set_path_effects([withStroke(linewidth=2.4, foreground="white")])
    for text in ax.clabel(lines, fmt="%.1f", fontsize=7):
        text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    ax.plot([], [], color=BLACK, lw=0.8, label="W of the bare arm [1/kg]")


def _surroundings(ax: Axes) -> None:
    for n, r in enumerate((L1 + L2, abs(L2 - L1))):
        ax.add_patch(Arc((0.0, 0.0), 2.0 * r, 2.0 * r, theta1=0.0, theta2=180.0, color=GREY, lw=2.0))
        ax.plot([], [], color=GREY, lw=2.0, label="_" if n else "limits of the reach")
    ax.plot(0.0, 0.0, "^", color=GREY, ms=7, clip_on=False, label="shoulder")
    ax.plot((ORIGIN[0], ORIGIN[0] + PATH_LENGTH), (ORIGIN[1], ORIGIN[1]), color=ORANGE, label="default path")
    ax.plot(*NOMINAL, "o", mfc="none", mec=ORANGE, mew=2.0, ms=9, label="nominal pose")
    ax.set_aspect("equal")
    ax.set_xlim(-0.62, 0.62)
    ax.set_ylim(-0.02, 0.62)
