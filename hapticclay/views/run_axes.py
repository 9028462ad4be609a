"""Axes over the position: the clay shaded, expected speeds, where clay held the handle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..model.cells import Profile
from ..model.constants import AXES
from ..model.signals import Multisine
from ..model.smooth import Smooth
from ..scene.scenario import Scenario
from ..simulation.record import Record
from .style import (
    ORANGE,
    SHADED,
    VERMILION,
    figure_size,
    panel_grid,
    shade_clay,
    stroke,
)

MOST_BORDERS = 20  # of clay that is drawn region by region
SHADES = 100  # of smooth clay along a path
MOST_DOTS = 20_000  # of a kind in a plot


def spread(where: np.ndarray, most: int) -> np.ndarray:
    """Evenly spaced selection of indices, at most a given number."""
    return where[:: -(-len(where) // most) or 1]


def expected_speeds(ax: Axes, record: Record, axis: str) -> None:
    """Draws the expected steady speed over each stretch of the path."""
    i, label = AXES.index(axis), "expected, steady"
    pieces = record.stretches(axis)
    for piece in pieces if len(pieces) <= MOST_BORDERS else pieces[:3]:
        speed, x = record.expected_speed(axis, piece), 100.0 * record.p[piece, i]
        if speed is not None and math.isfinite(speed):
            look: Any = dict(color=VERMILION, ls="--", lw=stroke(1.4), label=label)
            ax.plot([x.min(), x.max()], [speed] * 2, **look)
            label = "_"


def mark_held(ax: Axes, record: Record, i: int, y: np.ndarray) -> None:
    """Marks where clay held the handle, on a curve over the position."""
    some = spread(np.flatnonzero(record.held()[:, i]), MOST_DOTS)
    if len(some):
        look: Any = dict(color=ORANGE, ms=stroke(5), mew=0, zorder=4, label="held still")
        ax.plot(100.0 * record.p[some, i], y[some], "o", **look)


def held_spans(record: Record, axis: str) -> list[tuple[float, float]]:
    """Times at which clay held an axis, (begin, end) [s]."""
    end = float(record.t[-1])
    stops = [x for x in record.stops if axis in x.axis]
    return [(x.start, end if x.end is None else x.end) for x in stops]


def is_viscous(s: Scenario) -> bool:
    """Whether the clay of a scene is viscous; true without clay."""
    return s.clay is None or s.clay.viscous


def main_axis(s: Scenario) -> str:
    """The axis along which the operator pushes most."""
    size = s.force
    if isinstance(s.muscle, Multisine):
        size = s.muscle.rms
    elif s.muscle is not None:
        x, y = np.abs(s.muscle(np.linspace(0.0, s.t_max, 501)) + s.force).max(axis=0)
        size = float(x), float(y)
    return "y" if abs(size[1]) > abs(size[0]) else "x"


def position_axes(record: Record, axes: str) -> tuple[Figure, list[Axes]]:
    """A panel over the position along each axis, the clay shaded."""
    rows, columns = panel_grid(len(axes))
    figure = Figure(figsize=figure_size(columns, 3.6 * rows))
    panels = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for name, ax in zip(axes, panels, strict=True):
        x = 100.0 * record.p[:, AXES.index(name)]
        low, high = float(x.min()), float(x.max())
        margin = 0.02 * ((high - low) or 1.0)
        shade_clay(ax, *shades(record, name))
        ax.set(xlabel=f"position {name} [cm]", xlim=(low - margin, high + margin))
    return figure, panels


def shades(record: Record, axis: str) -> tuple[list[float], list[float]]:
    """Borders [m] and force of a slow cut [N] along an axis; for a grid, along the path."""
    clay, i = record.scenario.clay, AXES.index(axis)
    if clay is None:
        return [], []
    law, spans = clay.laws[i], [getattr(block, axis) for block in clay.blocks]
    if spans and not law.some.any():
        return list(spans[0]), [0.0, 1.0, 0.0]
    if isinstance(law, Profile):
        seen = law.along == axis
        return list(law.edges) * seen, law.forces(clay.kinds, *SHADED).ravel().tolist() * seen
    x, first = np.unique(record.p[:, i], return_index=True)
    if isinstance(law, Smooth) and len(x) > SHADES:
        near = np.searchsorted(x, np.linspace(x[0], x[-1], SHADES))
        x, first = x[near], first[near]
    x_met, y_met = record.p[first].T
    force = law.forces_at(clay.kinds, x_met, y_met, *SHADED)
    change = np.flatnonzero(np.diff(force))
    return (0.5 * (x[change] + x[change + 1])).tolist(), force[[*change, -1]].tolist()


def steps_of_law(ax: Axes, record: Record, i: int, law: Any, **look: Any) -> None:
    """Draws law(b) over each stretch of the path with constant b."""
    pieces = record.stretches(AXES[i])
    if len(pieces) > MOST_BORDERS:  # an unstable run that chatters over a border
        pieces = pieces[:3]
    for piece in pieces:
        x, b = 100.0 * record.p[piece, i], record.b[piece, i]
        constant = np.ptp(b) == 0.0
        x, y = ([x.min(), x.max()], [law(float(b[0]))] * 2) if constant else (x, law(b))
        ax.plot(x, y, lw=stroke(1.4), zorder=3, **look)
        look["label"] = "_"
