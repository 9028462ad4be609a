"""Figures of passivity: over frequency, over time, and over K, Ts and delay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..studies.passivity_runs import EnergyOverTime, IndexOverFrequency, PassiveRegion
from .style import (
    BLACK,
    BLUE,
    CURVE_STYLES,
    GREY,
    VERMILION,
    WHITE,
    add_legend,
    figure_size,
    figure_style,
    plain_ticks,
    set_title,
    stroke,
    unit_text,
)

HERTZ = 2.0 * np.pi
ACTIVE_LABEL = "active"
ACTIVE_ROOM = 0.15  # least share of the height of a labelled half plane
BELOW_ZERO = 0.03  # share of the height shown below 0 where no curve is active
REGION_MARKS = ("o", "s", "^", "D", "v")


def index_plot(found: IndexOverFrequency) -> Figure:
    """Plots the excess damping over frequency, theory as lines and runs as marks."""
    with figure_style():
        figure = Figure(figsize=figure_size(1, 4.2))
        ax = figure.add_subplot()
        ax.set_xscale("log")
        mark: Any = dict(ls="none", ms=stroke(6.0), mfc=WHITE, mew=stroke(1.2), zorder=4)
        if found.index is not None:
            label = "index (Colgate, Schenkel 1997)"
            ax.plot(found.omega / HERTZ, found.index, color=BLUE, label=label)
        if len(found.worst):
            label = "runs: worst path of a hand"
            ax.plot(found.worst_omega / HERTZ, found.worst, "o", mec=BLUE, label=label, **mark)
        ax.plot(found.omega / HERTZ, found.damping, color=VERMILION, ls="--", label="Re Z")
        if len(found.measured):
            label = "runs: sines, mean power / mean v$^2$"
            ax.plot(
                found.measured_omega / HERTZ,
                found.measured,
                "s",
                mec=VERMILION,
                label=label,
                **mark,
            )
        ax.set(xlabel="frequency [Hz]", ylabel=unit_text("damping to spare [N.s/m]"))
        ax.set_xlim(found.omega[0] / HERTZ, found.omega[-1] / HERTZ * 1.05)
        _shade_active(ax)
        plain_ticks(ax.xaxis)
        add_legend(figure, ax, 2)
        verdict = "passive" if found.margin >= 0.0 else "not passive"
        set_title(ax, unit_text(found.name), f"least {found.margin:.4g}: {verdict}")
    return figure


def _shade_active(ax: Axes) -> None:
    """Shades the half plane in which a hand can draw energy, labelled in the emptier corner."""
    points = np.concatenate([line.get_xydata() for line in ax.lines])
    points = points[np.isfinite(points).all(axis=1)]
    least = float(points[:, 1].min(initial=0.0))
    low, high = ax.get_ylim()
    if least >= 0.0:
        low = -BELOW_ZERO * high
    high = max(high, -ACTIVE_ROOM * low)
    ax.axhline(0.0, color=BLACK, lw=stroke(0.8))
    ax.set_ylim(low, high)
    if least >= 0.0:
        return
    ax.axhspan(low, 0.0, color=GREY, alpha=0.15, lw=0, zorder=0)
    if -low < ACTIVE_ROOM * (high - low):
        return
    shares = ax.transAxes.inverted().transform(ax.transData.transform(points))
    corners = [(x, y) for y in (0.05, -low / (high - low) - 0.05) for x in (0.08, 0.92)]
    x, y = max(corners, key=lambda c: np.hypot(*(shares - c).T).min())
    side: Any = "left" if x < 0.5 else "right"
    up: Any = "bottom" if y == corners[0][1] else "top"
    where = (0.02 if side == "left" else 0.98, y - 0.02 if up == "bottom" else y + 0.02)
    ax.text(*where, ACTIVE_LABEL, transform=ax.transAxes, ha=side, va=up, color=GREY)


def port_energy_plot(found: EnergyOverTime) -> Figure:
    """Plots the energy absorbed by rendered clay, and the velocity, of both runs."""
    looks = ((VERMILION, "-", "without controller"), (BLUE, "--", "with controller"))
    records = (found.without, found.controlled)
    with figure_style():
        figure = Figure(figsize=figure_size(1, 5.0))
        top, low = figure.subplots(2, 1, sharex=True)
        size = max(float(np.abs(e).max(initial=0.0)) for e in found.observed)
        factor, unit = (1e3, "mJ") if size < 1.0 else (1.0, "J")
        for record, energy, (color, dash, name) in zip(records, found.observed, looks, strict=True):
            i = int(np.argmax(np.abs(record.v).max(axis=0, initial=0.0)))
            time = 1e3 * record.t
            top.plot(time, factor * energy, color=color, ls=dash, label=name)
            low.plot(time, 1e3 * record.v[:, i], color=color, ls=dash)
        top.axhline(0.0, color=BLACK, lw=stroke(0.8))
        top.set_ylabel(f"energy that the\nclay has taken [{unit}]")
        low.set(xlabel="time [ms]", ylabel="velocity [mm/s]")
        figure.align_ylabels([top, low])
        add_legend(figure, top, 2)
        s = found.without.scenario
        least = factor * float(found.observed[0].min(initial=0.0))
        taken = f"draws {-least:.3g} {unit} without" if least < 0.0 else "takes energy"
        clay = f"b = {s.clay.largest:g} N$\\cdot$s/m" if s.clay else "no clay"
        set_title(top, clay, f"Ts = {1e3 * (s.Ts or s.dt):g} ms", taken)
    return figure


def region_plot(found: PassiveRegion) -> Figure:
    """Plots the largest passive stiffness over the control sample, a line per delay, with runs."""
    with figure_style():
        figure = Figure(figsize=figure_size(1, 4.2))
        ax = figure.add_subplot()
        ax.set(xscale="log", yscale="log")
        for i, (delay, limits) in enumerate(zip(found.delays, found.limits, strict=True)):
            color, dash = CURVE_STYLES[i % len(CURVE_STYLES)]
            label = "no delay" if not delay else f"delay {delay:g} Ts"
            ax.plot(1e3 * found.Ts, _where_passive(limits), color=color, ls=dash, label=label)
            mark: Any = dict(mec=color, mfc=WHITE, ls="none", ms=stroke(6.5), mew=stroke(1.3))
            mark["marker"] = REGION_MARKS[i % len(REGION_MARKS)]
            ax.plot(1e3 * found.run_Ts, _where_passive(found.found[i]), zorder=4, **mark)
        ax.set(xlabel="control sample Ts [ms]", ylabel="largest passive stiffness K [N/m]")
        ax.set_xlim(1e3 * found.Ts[0], 1e3 * found.Ts[-1])
        for axis in (ax.xaxis, ax.yaxis):
            plain_ticks(axis)
        add_legend(figure, ax, 4)
        w = found.wall
        told = [unit_text(f"b = {w.device.damper:g} N.s/m"), unit_text(f"B = {w.B:g} N.s/m")]
        set_title(ax, *told, "lines: Colgate, Schenkel 1997; marks: runs")
    return figure


def _where_passive(K: Sequence[float] | np.ndarray) -> np.ndarray:
    K = np.asarray(K, dtype=float)
    return np.where(np.isfinite(K) & (K > 0.0), K, np.nan)
