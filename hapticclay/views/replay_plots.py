"""Figure of a run beside the recording that drove it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..model.constants import AXES
from ..studies.replay import Replayed
from .palette import BLACK, BLUE, VERMILION
from .panels import add_legend, label_axes, set_title, stacked
from .style import figure_style, stroke

COLORS = BLUE, VERMILION  # of x and y


@figure_style()
def replay_plot(found: Replayed) -> Figure:
    """Plots position and force of the hand over time, recorded (black) and in the run."""
    figure, axes = stacked(2, 4.6)
    moves = [i for i in range(2) if _moves(found, i)]
    for ax, run, recorded, scale, label in (
        (axes[0], found.p, found.recorded_p, 1e3, "position [mm]"),
        (axes[1], found.f, found.recorded_f, 1.0, "force of the hand [N]"),
    ):
        for i in moves:
            if recorded is not None:
                name = "recorded" if i == moves[0] else "_"
                ax.plot(found.t, scale * recorded[:, i], color=BLACK, lw=stroke(1.0), label=name)
            look = {"color": COLORS[i], "lw": stroke(1.6), "ls": "--"}
            ax.plot(found.t, scale * run[:, i], label=f"run, {AXES[i]}", **look)
        label_axes(ax, "", label)
    label_axes(axes[1], "time [s]")
    set_title(axes[0], found.name, f"driven by its {found.drive}", found.status)
    add_legend(figure)
    return figure


def _moves(found: Replayed, i: int) -> bool:
    """Whether anything was recorded on an axis."""
    recorded = [x for x in (found.recorded_p, found.recorded_f) if x is not None]
    return any(np.ptp(x[:, i]) > 0.0 for x in recorded if len(x)) or i == 0
