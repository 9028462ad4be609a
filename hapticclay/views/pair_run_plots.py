"""Figures of runs of leaders and followers."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..simulation.pair_record import PairRecord
from .motion import most_moved, pair_unit
from .palette import BLACK, BLUE, GREY, VERMILION
from .panels import label_axes, level, set_title, stacked
from .style import figure_style, points, stroke

LOOKS = {"leader": (BLUE, "-"), "follower": (VERMILION, "--")}


@figure_style()
def run_plot(found: PairRecord) -> Figure:
    """Plots the joint that moves most, its error, forces of hand and contact, and energy taken."""
    figure, (motion, error, force, energy) = stacked(4, 7.6)
    j, turned = most_moved(found)
    unit, scale = pair_unit(found.unit, turned)
    _draw(motion, found.t, [scale * x for x in turned], LOOKS)
    near, per = pair_unit(found.unit, [found.off[:, j]])
    error.plot(found.t, per * found.off[:, j], color=BLACK)
    level(error)
    sizes = [np.linalg.norm(f, axis=1) for f in (found.hand, found.contact)]
    _draw(force, found.t, sizes, ("hand on leader", "follower on contact"))
    _draw(energy, found.t, 1e3 * found.port_energy.T, ("at leader", "at follower"))
    energy.plot(found.t, 1e3 * found.energy, color=BLACK, label="together")
    level(energy)
    _draw_bound(energy, found)
    label_axes(motion, "", f"{found.names[j]} [{unit}]")
    label_axes(error, "", f"follower off [{near}]")
    label_axes(force, "", "force [N]")
    label_axes(energy, "time [s]", "energy taken [mJ]")
    for ax in (motion, force, energy):
        ax.legend(fontsize=points(8), ncols=2 if ax is energy else 1)
    set_title(motion, found.kind, found.ended or found.trend)
    figure.align_ylabels()
    return figure


def _draw(ax: Axes, t: np.ndarray, values: object, names: object) -> None:
    for x, name, (color, dash) in zip(values, names, LOOKS.values(), strict=True):  # type: ignore
        ax.plot(t, x, color=color, ls=dash, label=name)


def _draw_bound(ax: Axes, found: PairRecord) -> None:
    """What passivity controllers keep the energy above: both reserves."""
    if found.pair is None or not found.pair.link.passivity:
        return
    least = -2e3 * found.pair.link.reserve
    ax.axhline(least, color=GREY, ls=":", lw=stroke(1.2), label="$-2 E_0$")
