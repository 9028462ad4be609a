"""Figure of a measured pair: its error, and that of the pair that was identified."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..studies.pair_identification import IdentifiedPair
from .palette import BLUE, VERMILION
from .panels import add_legend, label_axes, level, set_title, single
from .style import figure_style, stroke


@figure_style()
def pair_plot(found: IdentifiedPair) -> Figure:
    """Plots leader less follower over time, measured and simulated."""
    figure, ax = single(3.2)
    t = found.t - found.t[0]
    ax.plot(t, 1e3 * found.error, color=BLUE, lw=stroke(1.2), label="measured")
    if len(found.simulated):
        look = {"color": VERMILION, "lw": stroke(1.2), "ls": "--"}
        label = "simulated behind the measured leader"
        ax.plot(t, 1e3 * found.simulated, label=label, **look)
    level(ax)
    ax.set_xlim(0.0, float(np.max(t)))
    label_axes(ax, "time [s]", "leader less follower [mrad]")
    set_title(ax, found.name, found.architecture)
    add_legend(figure)
    return figure
