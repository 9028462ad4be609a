"""Axes over the position: the clay shaded, expected values, where clay held the handle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
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
from .palette import CLAY_ALPHA, ORANGE, SHADED, clay_color
from .panels import side_by_side
from .style import stroke

MOST_BORDERS = 20  # of clay that is drawn region by region
MOST_SHADES = 100  # of smooth clay along a path
MOST_DOTS = 20_000  # of a kind in a plot


def spread(where: np.ndarray, most: int = MOST_DOTS) -> np.ndarray:
    """Evenly spaced selection of indices, at most a given number."""
    return where[:: -(-len(where) // most) or 1]


def is_viscous(s: Scenario) -> bool:
    """Whether the clay of a scene is viscous; true without clay."""
    return s.clay is None or s.clay.viscous


def main_axis(s: Scenario) -> str:
    """The axis along which the operator pushes most."""
    size = np.abs(s.force)
    if isinstance(s.muscle, Multisine):
        size = np.abs(s.muscle.rms)
    elif s.muscle is not None:
        size = np.abs(s.muscle(np.linspace(0.0, s.t_max, 501)) + s.force).max(axis=0)
    return "y" if size[1] > size[0] else "x"


def position_axes(record: Record, axes: str) -> tuple[Figure, list[Axes]]:
    """A panel over the position along each axis, the clay shaded."""
    figure, panels = side_by_side(len(axes), 3.6)
    for name, ax in zip(axes, panels, strict=True):
        x = 100.0 * record.p[:, AXES.index(name)]
        low, high = float(x.min()), float(x.max())
        margin = 0.02 * ((high - low) or 1.0)
        shade_clay(ax, *shades(record, name))
        ax.set(xlabel=f"position {name} [cm]", xlim=(low - margin, high + margin))
    return figure, panels


def draw_stretches(
    ax: Axes, record: Record, i: int, expected: Callable[[np.ndarray], Any], **look: Any
) -> None:
    """Draws the value expected of each stretch of the path, if there is one."""
    pieces = record.stretches(AXES[i])
    if len(pieces) > MOST_BORDERS:  # an unstable run that chatters over a border
        pieces = pieces[:3]
    for piece in pieces:
        x, y = 100.0 * record.p[piece, i], expected(piece)
        if y is None or not np.isfinite(y).any():
            continue
        if np.ptp(y) == 0.0:
            x, y = [x.min(), x.max()], [np.max(y)] * 2
        ax.plot(x, y, lw=stroke(1.4), zorder=3, **look)


def mark_held(ax: Axes, record: Record, i: int, y: np.ndarray) -> None:
    """Marks where clay held the handle, on a curve over the position."""
    held = spread(np.flatnonzero(record.held()[:, i]))
    if len(held):
        look: Any = dict(color=ORANGE, ms=stroke(5), mew=0, zorder=4, label="held still")
        ax.plot(100.0 * record.p[held, i], y[held], "o", **look)


def held_spans(record: Record, axis: str) -> list[tuple[float, float]]:
    """Times at which clay held an axis, (begin, end) [s]."""
    end = float(record.t[-1])
    stops = [x for x in record.stops if axis in x.axis]
    return [(x.start, end if x.end is None else x.end) for x in stops]


def shade_clay(ax: Axes, edges: Sequence[float], forces: Sequence[float]) -> None:
    """Shades the intervals of the x axis with clay, darker where it is harder to cut."""
    for (low, high), force in zip(pairwise((-1.0, *edges, 1.0)), forces, strict=False):
        if force > 0.0:
            look: Any = dict(color=clay_color(force / max(forces)), alpha=CLAY_ALPHA, lw=0)
            ax.axvspan(100.0 * low, 100.0 * high, label="clay", **look)


def shades(record: Record, axis: str) -> tuple[list[float], list[float]]:
    """Borders [m] and force of a slow cut [N] along an axis; for a grid, along the path."""
    clay, i = record.scenario.clay, AXES.index(axis)
    if clay is None:
        return [], []
    law, spans = clay.laws[i], [getattr(block, axis) for block in clay.blocks]
    if spans and not law.some.any():
        return list(spans[0]), [0.0, 1.0, 0.0]
    if isinstance(law, Profile):
        varies = law.along == axis
        return list(law.edges) * varies, law.forces(clay.kinds, *SHADED).ravel().tolist() * varies
    x, first = np.unique(record.p[:, i], return_index=True)
    if isinstance(law, Smooth) and len(x) > MOST_SHADES:
        near = np.searchsorted(x, np.linspace(x[0], x[-1], MOST_SHADES))
        x, first = x[near], first[near]
    x_met, y_met = record.p[first].T
    force = law.forces_at(clay.kinds, x_met, y_met, *SHADED)
    change = np.flatnonzero(np.diff(force))
    return (0.5 * (x[change] + x[change + 1])).tolist(), force[[*change, -1]].tolist()
