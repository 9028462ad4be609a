"""Plots of a record, for paper and screen."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import lti
from .params import AXES, C_POLE
from .record import Record

BLUE, ORANGE, GREEN, BLACK = "#0072B2", "#D55E00", "#009E73", "#222222"  # Okabe and Ito, safe for all eyes
CLAY = "#E8C9A8"
STYLE: Any = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}


def velocity_position(record: Record, axis: str = "x") -> Figure:
    """Velocity against position along one axis, the expected steady speeds beside it (Fig. 8, top).

    Args:
        record: what to draw. axis: "x" or "y".
    """
    i = AXES.index(axis)
    with matplotlib.rc_context(STYLE):
        figure, ax = _axes(record, i)
        ax.plot(100.0 * record.p[:, i], record.v[:, i], color=BLUE, label="measured")
        s = record.scenario
        if s.operator is None:
            _steps(
                ax, record, i, lambda b: lti.steady_speed(s.gain[i], s.force[i], b), ORANGE, "expected, K f/(10 + K b)"
            )
        ax.set_ylabel(f"velocity v$_{axis}$ [m/s]")
        _limits(ax, record.v[:, i])
        _finish(figure, ax, record)
    return figure


def force_velocity(record: Record, axis: str = "x") -> Figure:
    """fe/v and fh/v against position along one axis, b and 10/K + b beside them (Fig. 8, bottom).

    Args:
        record: what to draw. axis: "x" or "y".
    """
    i = AXES.index(axis)
    with matplotlib.rc_context(STYLE):
        figure, ax = _axes(record, i)
        x = 100.0 * record.p[:, i]
        ax.plot(x, record.ratio(record.fh)[:, i], color=GREEN, label="operator, f$_h$/v")
        ax.plot(x, record.ratio(record.fe)[:, i], color=BLUE, label="clay, f$_e$/v")
        own = C_POLE / record.scenario.gain[i] if record.scenario.gain[i] else 0.0
        if record.scenario.operator is None:
            _steps(ax, record, i, lambda b: own + b, BLACK, "10/K + b", ":")
        _steps(ax, record, i, lambda b: b, ORANGE, "b")
        ax.set_ylabel("force / velocity [N$\\cdot$s/m]")
        top = own + float(np.max(record.b[:, i], initial=0.0))
        ax.set_ylim(-0.04 * top, 1.35 * top)
        _finish(figure, ax, record)
    return figure


def _axes(record: Record, i: int) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(6.4, 3.6))
    ax = figure.add_subplot()
    clay = record.scenario.clay
    profile = (clay.x, clay.y)[i] if clay else None
    ax.set_xlabel(f"position {AXES[i]} [cm]")
    if profile and profile.along == AXES[i]:
        edges = (-np.inf, *profile.edges, np.inf)
        label = "clay"
        for low, high, b in zip(edges, edges[1:], profile.values, strict=False):
            if b > 0.0:
                low, high = max(low, -1.0), min(high, 1.0)
                ax.axvspan(100.0 * low, 100.0 * high, color=CLAY, alpha=0.6, lw=0, label=label)
                label = "_"
    return figure, ax


def _steps(ax: Axes, record: Record, i: int, law: Any, color: str, label: str, style: str = "--") -> None:
    """The value of law(b) over the stretch of path that had each b."""
    change = np.flatnonzero(np.diff(record.b[:, i])) + 1
    pieces = np.split(np.arange(len(record.t)), change)
    if len(pieces) > 20:  # an unstable run that chatters over a border
        pieces = pieces[:3]
    for piece in pieces:
        x = 100.0 * record.p[piece, i]
        y = law(float(record.b[piece[0], i]))
        ax.plot([x.min(), x.max()], [y, y], color=color, ls=style, lw=1.4, label=label, zorder=3)
        label = "_"


def _limits(ax: Axes, v: np.ndarray) -> None:
    low, high = min(0.0, float(v.min())), max(0.0, float(v.max()))
    span = (high - low) or 1.0
    ax.set_ylim(low - 0.04 * span, high + 0.12 * span)


def _finish(figure: Figure, ax: Axes, record: Record) -> None:
    x = 100.0 * record.p[:, AXES.index("x")]
    if "x" in ax.get_xlabel():
        low, high = float(x.min()), float(x.max())
        margin = 0.02 * ((high - low) or 1.0)
        ax.set_xlim(low - margin, high + margin)
    figure.legend(loc="outside upper center", ncols=5)
    s = record.scenario
    name = f"{s.name}: K = ({s.gain[0]:g}, {s.gain[1]:g}), u$_h$ = ({s.force[0]:g}, {s.force[1]:g}) N"
    if s.clay:
        name += f", b = {max(s.clay.x.values):g} N$\\cdot$s/m"
    name += (", T$_h$ in the loop" if s.operator else "") + (", inertia shaped" if s.shaping else "")
    ax.set_title(name, fontsize=9, loc="left", color="#555555")
