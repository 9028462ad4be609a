"""Figures of several controllers, or of several bare devices, superimposed."""

from __future__ import annotations

import math
from collections.abc import Callable
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
from .impedance_plots import parts_panels
from .palette import BLACK
from .panels import add_legend, curve_look, hollow, label_axes, level, plain_ticks, positive, single
from .style import figure_style, stroke
from .wall_plots import regions_plot

CLAY_DAMPINGS = np.geomspace(1.0, 3000.0, 61)  # of the line of gain limits [N.s/m]
FREQUENCY = "frequency [Hz]"
BAND = 2.0 * math.pi * np.geomspace(0.1, 100.0, 400)  # [rad/s]


def compare_figures(found: Comparison) -> dict[str, tuple[str, shown.Figure]]:
    """Returns the figures of a comparison by name, each with a title."""
    plots: dict[str, tuple[str, Callable[[Comparison], Figure]]] = {
        "passivity": ("Damping to spare over frequency", spare_plot),
        "impedance": ("Impedance that the hand feels", impedance_overlay),
        "parts": ("Effective stiffness, damping and mass", parts_overlay),
    }
    if found[0].loop is None:
        first = {"zwidth": ("Walls that are stable, by runs and exact", wall_region_plot)}
        last = {"push": (f"After a push of {1e3 * 0.01:g} mm/s", push_plot)}
    else:
        first = {
            "velocity": ("Velocity over position", velocity_overlay),
            "stability": ("Gain limit over the damping of the clay", gain_overlay),
        }
        if found[0].replayed and found[0].replayed.recorded_p is not None:
            first = {"recording": ("Beside the recorded motion", recording_overlay), **first}
        last = {"transparency": ("Share of the clay in the hand's force", transparency_overlay)}
    return {
        name: (title, shown.Figure(partial(plot, found)))
        for name, (title, plot) in (first | plots | last).items()
    }


def main_overlay(found: Comparison) -> Figure:
    """Plots the main difference between the files: stable walls, or velocity over position."""
    return velocity_overlay(found) if found[0].loop else wall_region_plot(found)


@figure_style()
def _overlay(
    found: Comparison, curve: Callable[[Compared], tuple[Any, Any]], x: str, y: str, log: str = ""
) -> Figure:
    """One curve per file, each in its own style."""
    figure, ax = single(3.6)
    for i, file in enumerate(found):
        ax.plot(*curve(file), label=file.name, **curve_look(i))
    label_axes(ax, x, y)
    ax.set(**{f"{name}scale": "log" for name in log})
    plain_ticks(ax)
    add_legend(figure, 3)
    return figure


def velocity_overlay(found: Comparison) -> Figure:
    """Plots velocity over position of each run."""
    axis = found[0].loop.axis if found[0].loop else "x"
    i = AXES.index(axis)

    def velocity(file: Compared) -> tuple[np.ndarray, np.ndarray]:
        return 100.0 * file.record.p[:, i], file.record.v[:, i]

    return _overlay(found, velocity, f"position {axis} [cm]", f"velocity v$_{axis}$ [m/s]")


@figure_style()
def recording_overlay(found: Comparison) -> Figure:
    """Plots the motion of each run over time, and the recorded one."""
    axis = found[0].loop.axis if found[0].loop else "x"
    i = AXES.index(axis)

    def motion(file: Compared) -> tuple[np.ndarray, np.ndarray]:
        assert file.replayed is not None
        return file.replayed.t, 1e3 * file.replayed.p[:, i]

    figure = _overlay(found, motion, "time [s]", f"position {axis} [mm]")
    longest = max((x.replayed for x in found if x.replayed), key=lambda x: len(x.t))
    if longest.recorded_p is not None:
        look = {"color": BLACK, "lw": stroke(0.8), "zorder": 3}
        figure.axes[0].plot(longest.t, 1e3 * longest.recorded_p[:, i], label="recorded", **look)
    figure.legends[0].remove()
    add_legend(figure, 3)
    return figure


@figure_style()
def gain_overlay(found: Comparison) -> Figure:
    """Plots the gain limit over b, with the sampling of each file, and marks its b and K."""

    def limits(file: Compared) -> tuple[np.ndarray, np.ndarray]:
        assert file.loop is not None
        K = [gain_limit(replace(file.loop, b=float(b))) for b in CLAY_DAMPINGS]
        return CLAY_DAMPINGS, positive(K)

    figure = _overlay(found, limits, "damping of the clay b [N.s/m]", "gain K [1/kg]", "xy")
    for i, file in enumerate(found):
        if file.loop and file.loop.b and file.loop.gain:
            look = hollow(curve_look(i)["color"], size=7.0)
            figure.axes[0].plot(file.loop.b, file.loop.gain, **look)
    return figure


def _shown_band(file: Compared) -> np.ndarray:
    """Frequencies [rad/s]; for a wall below half of its sampling frequency."""
    return BAND[BAND < 0.95 * 2.0 * math.pi * file.top]


@figure_style()
def spare_plot(found: Comparison) -> Figure:
    """Plots the excess damping: passivity index of a sampled wall, Re Z of an arm."""

    def spare(file: Compared) -> tuple[np.ndarray, np.ndarray]:
        if file.loop is None:
            edge = math.pi / file.wall.Ts
            omega = np.geomspace(1e-3 * edge, edge * (1.0 - 1e-9), 400)
            return omega / (2.0 * math.pi), wall_limits.passivity_index(file.wall, omega)
        omega = _shown_band(file)
        return omega / (2.0 * math.pi), file.impedance(omega).damping

    figure = _overlay(found, spare, FREQUENCY, "damping to spare [N.s/m]", "x")
    level(figure.axes[0])
    return figure


def impedance_overlay(found: Comparison) -> Figure:
    """Plots the magnitude of the impedance fh/v over frequency."""

    def size(file: Compared) -> tuple[np.ndarray, np.ndarray]:
        omega = _shown_band(file)
        return omega / (2.0 * math.pi), np.abs(file.impedance(omega).Z)

    return _overlay(found, size, FREQUENCY, "|f$_h$/v| [N.s/m]", "xy")


@figure_style()
def parts_overlay(found: Comparison) -> Figure:
    """Plots effective stiffness, damping and mass over frequency; empty panels are omitted."""
    computed = [file.impedance(_shown_band(file)) for file in found]
    figure, panels = parts_panels(computed)
    for part, ax in panels.items():
        for i, (file, Z) in enumerate(zip(found, computed, strict=True)):
            ax.plot(Z.frequency, getattr(Z, part), label=file.name, **curve_look(i))
        level(ax)
    add_legend(figure, 3)
    return figure


@figure_style()
def transparency_overlay(found: Comparison) -> Figure:
    """Plots |fe/fh| over frequency, in continuous time."""

    def share(file: Compared) -> tuple[np.ndarray, np.ndarray]:
        assert file.loop is not None
        loop = replace(file.loop, **TIMING)
        return BAND / (2.0 * math.pi), np.abs(stability_margins.transparency(loop, BAND))

    figure = _overlay(found, share, FREQUENCY, "|f$_e$/f$_h$|", "x")
    level(figure.axes[0], 1.0)
    return figure


def wall_region_plot(found: Comparison) -> Figure:
    """Plots the walls that each device renders stably, by runs and by theory, and its own wall."""
    regions = [replace(x.region, name=x.name) for x in found if x.region]
    return regions_plot(regions, [x.wall for x in found])


@figure_style()
def push_plot(found: Comparison) -> Figure:
    """Plots position over time after a push."""
    figure = _overlay(
        found, lambda x: (x.record.t, 1e3 * x.record.p[:, 0]), "time [s]", "position x [mm]"
    )
    level(figure.axes[0])
    return figure
