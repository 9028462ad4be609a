"""Figures of runs of leaders and followers."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..simulation.pair_record import PairRecord
from .palette import BLACK, BLUE, GREY, VERMILION
from .panels import label_axes, set_title, stacked
from .style import figure_style, points, stroke


@figure_style()
def run_plot(found: PairRecord) -> Figure:
    """Plots the joint that moves most, forces of hand and contact, and energy of the link."""
    figure, (motion, force, energy) = stacked(3, 6.4)
    moved = np.abs(found.leader - found.leader[0]) + np.abs(found.follower - found.follower[0])
    j = int(moved.max(axis=0).argmax())
    for name, q, color, dash in (
        ("leader", found.leader, BLUE, "-"),
        ("follower", found.follower, VERMILION, "--"),
    ):
        motion.plot(found.t, 1e3 * (q[:, j] - q[0, j]), color=color, ls=dash, label=name)
    for name, f, color, dash in (
        ("hand on leader", found.hand, BLUE, "-"),
        ("follower on contact", found.contact, VERMILION, "--"),
    ):
        size = np.linalg.norm(f, axis=1)
        force.plot(found.t, size, color=color, ls=dash, label=name)
    energy.plot(found.t, 1e3 * found.energy, color=BLACK)
    energy.axhline(0.0, color=GREY, lw=stroke(0.8))
    unit = "mm" if found.names == ("x",) else "mrad"
    label_axes(motion, "", f"{found.names[j]} [{unit}]")
    label_axes(force, "", "force [N]")
    label_axes(energy, "time [s]", "taken energy [mJ]")
    for ax in (motion, force):
        ax.legend(fontsize=points(8))
    set_title(motion, found.kind, found.ended or ("grows" if found.grows else "decays"))
    return figure
