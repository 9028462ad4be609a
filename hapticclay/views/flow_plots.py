"""Force over velocity in yielding clay."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..model.constants import AXES
from ..model.flow import Flow
from ..simulation.record import Record
from .captions import clay_text, scenario_parts
from .motion import along_motion
from .palette import BLUE, GREEN, ORANGE, PURPLE, SKY_BLUE, VERMILION
from .panels import add_legend, set_title, side_by_side
from .run_axes import main_axis, spread
from .style import figure_style, stroke

HELD_LOOK: Any = dict(color=ORANGE, ls="", marker="_", ms=9, mew=0.8)
FLOW_COLORS = (BLUE, GREEN, PURPLE, SKY_BLUE)  # of the regions of clay that yields


@figure_style()
def force_velocity_plot(record: Record) -> Figure:
    """Plots the force of clay that yields over the velocity, with the law of each region.

    Clay that resists along the motion has one panel: force and speed along the motion, negative
    where the handle moves back. Otherwise each axis with a yield force has a panel; rotated clay
    uses its own axes. The term b v is omitted from forces and laws where b is not constant in a
    region.
    """
    clay, main = record.scenario.clay, AXES.index(main_axis(record.scenario))
    assert clay is not None
    c, s = math.cos(clay.angle), math.sin(clay.angle)
    axes = np.array(((c, -s), (s, c)))  # columns: the clay's axes
    v, fe, held = record.v @ axes, record.fe @ axes, record.held()
    across = clay.along_motion and not np.array_equal(record.b[:, 0], record.b[:, 1])
    whole = not (clay.varies or across)
    if not whole:
        fe = fe - record.b * v
    if clay.along_motion:
        named = "velocity along the motion [m/s]"
        panels: dict[str, Any] = {named: (main, *along_motion(v, fe, main), held.all(axis=1))}
    else:
        names = [f"velocity v$_{a}$ [m/s]" for a in AXES]
        if clay.angle:
            names = [f"velocity along its {a} axis [m/s]" for a in ("first", "second")]
        panels = {names[i]: (i, v[:, i], fe[:, i], held[:, i]) for i in (main, 1 - main)}
        resisting = {n: x for n, x in panels.items() if clay.resists_otherwise(x[0]) and x[1].any()}
        panels = resisting or dict([next(iter(panels.items()))])
    met = {name: flows_met(record, x[0], whole) for name, x in panels.items()}
    flows = dict.fromkeys(flow for found in met.values() for flow in found)
    colors = dict(zip(flows, FLOW_COLORS, strict=False))
    figure, axes = side_by_side(len(panels), 4.4)
    for flow, color in colors.items():
        label = f"measured, {', '.join(clay_text(x.text()) for x in flow.words)}"
        axes[0].plot([], [], ".", color=color, ms=stroke(9), label=label)
    if any(held[:, x[0]].any() for x in panels.values()):
        axes[0].plot([], [], **HELD_LOOK, label="held still")
    for ax, (name, (_, *measured)) in zip(axes, panels.items(), strict=True):
        drawn = {flow: where for flow, where in met[name].items() if flow in colors}
        _forces_over_velocity(ax, drawn, colors, *measured)
        ax.set_xlabel(name)
        ax.set_ylabel("force of the clay [N]" if whole else "force of the clay less b v [N]")
    add_legend(figure, 2)
    set_title(axes[0], *scenario_parts(record.scenario))
    return figure


def flows_met(record: Record, i: int, whole: bool = True) -> dict[Flow, np.ndarray]:
    """Samples in each flow of a yielding axis, ordered by decreasing number of samples."""
    clay = record.scenario.clay
    assert clay is not None
    b = record.b[:, i] if whole else np.zeros(len(record.t))
    rows = np.stack((*clay.laws[i].flows_at(*record.p.T), b), axis=-1)
    yielding = np.flatnonzero((rows[:, 0] > 0.0) | (rows[:, 1] > 0.0))
    kinds, which = np.unique(rows[yielding], axis=0, return_inverse=True)
    met = {Flow(*x): yielding[which.ravel() == k] for k, x in enumerate(kinds.tolist())}
    return dict(sorted(met.items(), key=lambda x: -len(x[1])))


def _forces_over_velocity(
    ax: Axes,
    met: dict[Flow, np.ndarray],
    colors: Mapping[Flow, str],
    v: np.ndarray,
    force: np.ndarray,
    held: np.ndarray,
) -> None:
    """Draws measured forces, forces on a held handle, and the laws."""
    for flow, where in met.items():
        some = spread(where[~held[where]])
        ax.plot(v[some], force[some], ".", color=colors[flow], ms=stroke(6), mew=0)
    some = spread(np.flatnonzero(held))
    ax.plot(v[some], force[some], **HELD_LOOK)
    draw_laws(ax, met, v, force, 1.3)


def draw_laws(
    ax: Axes, met: dict[Flow, np.ndarray], v: np.ndarray, force: np.ndarray, width: float
) -> None:
    """Draws the law of each flow over the velocities at which a run met it."""
    for flow, where in met.items():
        back = force[where].min() < -0.01 * flow.Fy
        x, y = law_curve(flow, min(float(v[where].min()), 0.0), float(v[where].max()), back)
        ax.plot(x, y, color=VERMILION, ls="--", lw=stroke(width), label="law of the clay")


def law_curve(flow: Flow, low: float, high: float, back: bool) -> tuple[np.ndarray, np.ndarray]:
    """Velocities [m/s] and forces [N] of a law, including the range of holding force at rest."""
    share = np.linspace(0.0, 1.0, 200)[1:] ** 3  # dense where |v|^n is curved
    up = share * high if high > 0.0 else np.zeros(0)
    down = share[::-1] * low if low < 0.0 else np.zeros(0)
    least = -flow.Fy if back or low < 0.0 else 0.0
    x = np.concatenate((down, (0.0, 0.0), up))
    return x, np.concatenate((flow.force(down), (least, flow.Fy), flow.force(up)))
