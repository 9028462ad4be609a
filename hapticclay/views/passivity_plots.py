"""Figures of passivity: over frequency, over time, and over K, Ts and delay."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..studies.passivity_runs import EnergyOverTime, IndexOverFrequency, PassiveRegion
from .palette import BLUE, GREY, VERMILION
from .panels import (
    MARKS,
    add_legend,
    curve_look,
    hollow,
    label_axes,
    level,
    mark,
    plain_ticks,
    positive,
    set_title,
    single,
    stacked,
)
from .style import figure_style

HERTZ = 2.0 * np.pi
ROOM = 0.15  # least share of the height of the passive half plane
BELOW_ZERO = 0.03  # share of the height shown below 0 where no curve is active


@figure_style()
def index_plot(found: IndexOverFrequency) -> Figure:
    """Plots the excess damping over frequency, theory as lines and runs as marks."""
    figure, ax = single(4.2)
    f = found.omega / HERTZ
    if found.index is not None:
        ax.plot(f, found.index, color=BLUE, label="index (Colgate, Schenkel 1997)")
    worst = zip(found.worst_omega / HERTZ, found.worst, strict=True)
    mark(ax, worst, label="runs: worst path of a hand", **hollow(BLUE))
    ax.plot(f, found.damping, color=VERMILION, ls="--", label="Re Z")
    sines = zip(found.measured_omega / HERTZ, found.measured, strict=True)
    mark(ax, sines, label="runs: sines, mean power / mean v^2", **hollow(VERMILION, "s"))
    ax.set(xscale="log", xlim=(f[0], f[-1] * 1.05))
    label_axes(ax, "frequency [Hz]", "damping to spare [N.s/m]")
    _shade_active(ax)
    plain_ticks(ax)
    add_legend(figure, 2)
    verdict = "passive" if found.margin >= 0.0 else "not passive"
    set_title(ax, found.name, f"least {found.margin:.4g}: {verdict}")
    return figure


def _shade_active(ax: Axes) -> None:
    """Shades the half plane in which a hand can draw energy."""
    (low, high), lowest = ax.get_ylim(), min(np.nanmin(line.get_ydata()) for line in ax.lines)
    level(ax)
    if lowest >= 0.0:
        ax.set_ylim(-BELOW_ZERO * high, high)
    else:
        ax.set_ylim(low, max(high, -ROOM * low))
        ax.axhspan(low, 0.0, color=GREY, alpha=0.15, lw=0, zorder=0, label="active")


@figure_style()
def port_energy_plot(found: EnergyOverTime) -> Figure:
    """Plots the energy absorbed by rendered clay, and the velocity, of both runs."""
    looks = ((VERMILION, "-", "without controller"), (BLUE, "--", "with controller"))
    records = (found.without, found.controlled)
    figure, (top, low) = stacked(2, 5.0)
    size = max(float(np.abs(e).max(initial=0.0)) for e in found.observed)
    factor, unit = (1e3, "mJ") if size < 1.0 else (1.0, "J")
    for record, energy, (color, dash, name) in zip(records, found.observed, looks, strict=True):
        i = int(np.argmax(np.abs(record.v).max(axis=0, initial=0.0)))
        top.plot(1e3 * record.t, factor * energy, color=color, ls=dash, label=name)
        low.plot(1e3 * record.t, 1e3 * record.v[:, i], color=color, ls=dash)
    level(top)
    top.set_ylabel(f"energy that the\nclay has taken [{unit}]")
    low.set(xlabel="time [ms]", ylabel="velocity [mm/s]")
    add_legend(figure, 2)
    s = found.without.scenario
    least = factor * float(found.observed[0].min(initial=0.0))
    taken = f"draws {-least:.3g} {unit} without" if least < 0.0 else "takes energy"
    clay = f"b = {s.clay.largest:g} N.s/m" if s.clay else "no clay"
    set_title(top, clay, f"Ts = {1e3 * (s.Ts or s.dt):g} ms", taken)
    return figure


@figure_style()
def region_plot(found: PassiveRegion) -> Figure:
    """Plots the largest passive stiffness over the control sample, a line per delay, with runs."""
    figure, ax = single(4.2)
    ax.set(xscale="log", yscale="log")
    for i, (delay, limits) in enumerate(zip(found.delays, found.limits, strict=True)):
        look, label = curve_look(i), f"delay {delay:g} Ts" if delay else "no delay"
        ax.plot(1e3 * found.Ts, positive(limits), label=label, **look)
        runs = hollow(look["color"], MARKS[i % len(MARKS)], 6.5)
        ax.plot(1e3 * found.run_Ts, positive(found.found[i]), **runs)
    ax.set(xlabel="control sample Ts [ms]", ylabel="largest passive stiffness K [N/m]")
    ax.set_xlim(1e3 * found.Ts[0], 1e3 * found.Ts[-1])
    plain_ticks(ax)
    add_legend(figure, 4)
    wall = [f"b = {found.wall.device.damper:g} N.s/m", f"B = {found.wall.B:g} N.s/m"]
    set_title(ax, *wall, "lines: Colgate, Schenkel 1997; marks: runs")
    return figure
