"""Figures of several controllers, or of several bare devices, superimposed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..model.constants import AXES
from ..studies.comparison import Compared, Comparison
from ..theory import stability_margins, wall_limits
from ..theory.gain_limits import gain_limit
from ..theory.loops import TIMING
from . import figure as shown
from .style import (
    BLACK,
    CURVE_STYLES,
    WHITE,
    add_legend,
    figure_size,
    figure_style,
    plain_ticks,
    stroke,
    unit_text,
)
from .wall_plots import regions_plot

CLAY_DAMPINGS = np.geomspace(1.0, 3000.0, 61)  # of the line of gain limits [N.s/m]
BAND = 2.0 * math.pi * np.geomspace(0.1, 100.0, 400)  # [rad/s]


def compare_figures(found: Comparison) -> dict[str, tuple[str, shown.Figure]]:
    """Returns the figures of a comparison by name, each with a title."""
    if found[0].loop is None:
        plots: dict[str, tuple[str, Callable[[Comparison], Figure]]] = {
            "zwidth": ("Walls that are stable, by runs and exact", wall_region_plot),
            "passivity": ("Damping to spare over frequency", spare_plot),
            "impedance": ("Impedance that the hand feels", impedance_overlay),
            "parts": ("Effective stiffness, damping and mass", parts_overlay),
            "push": (f"After a push of {1e3 * 0.01:g} mm/s", push_plot),
        }
    else:
        plots = {
            "velocity": ("Velocity over position", velocity_overlay),
            "stability": ("Gain limit over the damping of the clay", gain_overlay),
            "passivity": ("Damping to spare over frequency", spare_plot),
            "impedance": ("Impedance that the hand feels", impedance_overlay),
            "parts": ("Effective stiffness, damping and mass", parts_overlay),
            "transparency": ("Share of the clay in the hand's force", transparency_overlay),
        }
    return {
        name: (title, shown.Figure(partial(plot, found))) for name, (title, plot) in plots.items()
    }


def main_overlay(found: Comparison) -> Figure:
    """Plots the main difference between the files: stable walls, or velocity over position."""
    return velocity_overlay(found) if found[0].loop else wall_region_plot(found)


def _overlay(
    found: Comparison, curve: Callable[[Compared], tuple[Any, Any]], **axes: Any
) -> Figure:
    """One curve per file, each in its own style."""
    with figure_style():
        figure = Figure(figsize=figure_size(1, 3.6))
        ax = figure.add_subplot()
        for x, look in _looks(found):
            ax.plot(*curve(x), label=x.name, **look)
        ax.set(**axes)
        for axis in (ax.xaxis, ax.yaxis):
            if axis.get_scale() == "log":
                plain_ticks(axis)
        add_legend(figure, ax, 3)
    return figure


def _looks(found: Comparison) -> Iterator[tuple[Compared, dict[str, Any]]]:
    for x, (color, dash) in zip(found, CURVE_STYLES, strict=False):
        yield x, dict(color=color, ls=dash)


def _zero(figure: Figure) -> Figure:
    figure.axes[0].axhline(0.0, color=BLACK, lw=stroke(0.8), zorder=1)
    return figure


def velocity_overlay(found: Comparison) -> Figure:
    """Plots velocity over position of each run."""
    i = AXES.index(found[0].loop.axis if found[0].loop else "x")
    labels = dict(xlabel=f"position {AXES[i]} [cm]", ylabel=f"velocity v$_{AXES[i]}$ [m/s]")
    return _overlay(found, lambda x: (100.0 * x.record.p[:, i], x.record.v[:, i]), **labels)


def gain_overlay(found: Comparison) -> Figure:
    """Plots the gain limit over b, with the sampling of each file, and marks its b and K."""

    def limits(x: Compared) -> tuple[np.ndarray, np.ndarray]:
        assert x.loop is not None
        K = np.array([gain_limit(replace(x.loop, b=float(b))) for b in CLAY_DAMPINGS])
        return CLAY_DAMPINGS, np.where((K > 0.0) & np.isfinite(K), K, np.nan)

    labels = dict(xlabel=unit_text("damping of the clay b [N.s/m]"), ylabel="gain K [1/kg]")
    figure = _overlay(found, limits, xscale="log", yscale="log", **labels)
    with figure_style():
        for x, look in _looks(found):
            if x.loop and x.loop.b and x.loop.gain:
                mark: Any = dict(ms=stroke(7.0), mfc=WHITE, mec=look["color"], mew=stroke(1.4))
                figure.axes[0].plot(x.loop.b, x.loop.gain, "o", **mark)
    return figure


def _shown_band(x: Compared) -> np.ndarray:
    """Frequencies [rad/s]; for a wall below half of its sampling frequency."""
    return BAND[BAND < 0.95 * 2.0 * math.pi * x.top]


def spare_plot(found: Comparison) -> Figure:
    """Plots the excess damping: passivity index of a sampled wall, Re Z of an arm."""

    def spare(x: Compared) -> tuple[np.ndarray, np.ndarray]:
        if x.loop is None:
            edge = math.pi / x.wall.Ts
            omega = np.geomspace(1e-3 * edge, edge * (1.0 - 1e-9), 400)
            return omega / (2.0 * math.pi), wall_limits.passivity_index(x.wall, omega)
        omega = _shown_band(x)
        return omega / (2.0 * math.pi), x.impedance(omega).damping

    labels = dict(xlabel="frequency [Hz]", ylabel=unit_text("damping to spare [N.s/m]"))
    return _zero(_overlay(found, spare, xscale="log", **labels))


def impedance_overlay(found: Comparison) -> Figure:
    """Plots the magnitude of the impedance fh/v over frequency."""

    def size(x: Compared) -> tuple[np.ndarray, np.ndarray]:
        omega = _shown_band(x)
        return omega / (2.0 * math.pi), np.abs(x.impedance(omega).Z)

    labels = dict(xlabel="frequency [Hz]", ylabel=unit_text("|f$_h$/v| [N.s/m]"))
    return _overlay(found, size, xscale="log", yscale="log", **labels)


def parts_overlay(found: Comparison) -> Figure:
    """Plots effective stiffness, damping and mass over frequency; empty panels are omitted."""
    panels = {"stiffness": "[N/m]", "damping": "[N.s/m]", "mass": "[kg]"}
    curves = [(look, _shown_band(x), x) for x, look in _looks(found)]
    known = [(look, omega, x.impedance(omega), x.name) for look, omega, x in curves]
    panels = {
        p: u
        for p, u in panels.items()
        if any(np.isfinite(getattr(z, p)).any() for *_, z, _ in known)
    }
    with figure_style():
        figure = Figure(figsize=figure_size(1, 1.0 + 1.7 * len(panels)))
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (part, unit) in zip(axes, panels.items(), strict=True):
            for look, omega, Z, name in known:
                ax.plot(omega / (2.0 * math.pi), getattr(Z, part), label=name, **look)
            ax.axhline(0.0, color=BLACK, lw=stroke(0.8), zorder=1)
            ax.set(xscale="log", ylabel=unit_text(f"{part} {unit}"))
        axes[-1].set_xlabel("frequency [Hz]")
        plain_ticks(axes[-1].xaxis)
        figure.align_ylabels(list(axes))
        add_legend(figure, axes[0], 3)
    return figure


def transparency_overlay(found: Comparison) -> Figure:
    """Plots |fe/fh| over frequency, in continuous time."""

    def share(x: Compared) -> tuple[np.ndarray, np.ndarray]:
        assert x.loop is not None
        loop = replace(x.loop, **TIMING)
        return BAND / (2.0 * math.pi), np.abs(stability_margins.transparency(loop, BAND))

    labels = dict(xlabel="frequency [Hz]", ylabel="|f$_e$/f$_h$|")
    figure = _overlay(found, share, xscale="log", **labels)
    figure.axes[0].axhline(1.0, color=BLACK, lw=stroke(0.8), zorder=1)
    return figure


def wall_region_plot(found: Comparison) -> Figure:
    """Plots the walls that each device renders stably, by runs and by theory, and its own wall."""
    regions = [replace(x.region, name=x.name) for x in found if x.region]
    return regions_plot(regions, [x.wall for x in found])


def push_plot(found: Comparison) -> Figure:
    """Plots position over time after a push."""
    labels = dict(xlabel="time [s]", ylabel="position x [mm]")
    return _zero(_overlay(found, lambda x: (x.record.t, 1e3 * x.record.p[:, 0]), **labels))
