"""Figures of several controllers, or of several bare devices, over one another."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..model.constants import AXES
from ..model.virtual_wall import VirtualWall
from ..studies.comparison import Compared
from ..theory import margins, wall_limits
from ..theory.gain_limit import gain_limit
from ..theory.impedance import loop_impedance
from ..theory.linear_loop import TIMING
from . import figure as shown
from .style import (
    BLACK,
    CURVE_STYLES,
    WHITE,
    add_legend,
    figure_size,
    figure_style,
    stroke,
    unit_text,
)

CLAY_DAMPINGS = np.geomspace(1.0, 3000.0, 61)  # of the line of gain limits [N.s/m]
BAND = 2.0 * math.pi * np.geomspace(0.1, 100.0, 400)  # [rad/s]
WALL_DAMPINGS = 61  # of the plane of K and B


def compare_figures(found: Sequence[Compared]) -> dict[str, tuple[str, shown.Figure]]:
    """Returns the figures of a comparison by name, each with a title.

    Args:
        found: from `compare_files`, all of one kind.
    """
    if isinstance(found[0].subject, VirtualWall):
        plots: dict[str, tuple[str, Callable[[Sequence[Compared]], Figure]]] = {
            "zwidth": ("Largest stable stiffness over virtual damping", wall_region_plot),
            "passivity": ("Damping to spare over frequency", partial(spare_plot)),
            "impedance": ("Impedance that the hand feels", impedance_overlay),
            "push": (f"After a push of {1e3 * 0.01:g} mm/s", push_plot),
        }
    else:
        plots = {
            "velocity": ("Velocity over position", velocity_overlay),
            "stability": ("Gain limit over the damping of the clay", gain_overlay),
            "passivity": ("Damping to spare over frequency", partial(spare_plot)),
            "impedance": ("Impedance that the hand feels", impedance_overlay),
            "transparency": ("Share of the clay in the hand's force", transparency_overlay),
        }
    return {
        name: (title, shown.Figure(partial(plot, found))) for name, (title, plot) in plots.items()
    }


def _overlay(
    found: Sequence[Compared], curve: Callable[[Compared], tuple[Any, Any]], **axes: Any
) -> Figure:
    """One curve a file, each in a look of its own."""
    with figure_style():
        figure = Figure(figsize=figure_size(1, 3.6))
        ax = figure.add_subplot()
        for x, look in _looks(found):
            ax.plot(*curve(x), label=x.name, **look)
        ax.set(**axes)
        add_legend(figure, ax, 3)
    return figure


def _looks(found: Sequence[Compared]) -> Iterator[tuple[Compared, dict[str, Any]]]:
    for x, (color, dash) in zip(found, CURVE_STYLES, strict=False):
        yield x, dict(color=color, ls=dash)


def _zero(figure: Figure) -> Figure:
    figure.axes[0].axhline(0.0, color=BLACK, lw=stroke(0.8), zorder=1)
    return figure


def velocity_overlay(found: Sequence[Compared]) -> Figure:
    """Plots velocity over position of each run.

    Args:
        found: scenarios.
    """
    i = AXES.index(found[0].loop.axis if found[0].loop else "x")
    labels = dict(xlabel=f"position {AXES[i]} [cm]", ylabel=f"velocity v$_{AXES[i]}$ [m/s]")
    return _overlay(found, lambda x: (100.0 * x.record.p[:, i], x.record.v[:, i]), **labels)


def gain_overlay(found: Sequence[Compared]) -> Figure:
    """Plots the gain limit over b, with the sampling of each file; a mark at its own b and K.

    Args:
        found: scenarios.
    """

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


def _felt_by_hand(x: Compared) -> tuple[np.ndarray, np.ndarray]:
    """Frequency [rad/s] and fh/v [N.s/m] without the hand; of a controller in continuous time."""
    if isinstance(x.subject, VirtualWall):
        omega = BAND[BAND < 0.95 * math.pi / x.subject.Ts]
        return omega, wall_limits.wall_impedance(replace(x.subject, operator=None), omega)
    assert x.loop is not None
    return BAND, loop_impedance(replace(x.loop, operator=None, **TIMING), BAND)


def spare_plot(found: Sequence[Compared]) -> Figure:
    """Plots the damping to spare: the index of a sampled wall, Re Z of an arm.

    Args:
        found: all of one kind.
    """

    def spare(x: Compared) -> tuple[np.ndarray, np.ndarray]:
        if isinstance(x.subject, VirtualWall):
            edge = math.pi / x.subject.Ts
            omega = np.geomspace(1e-3 * edge, edge * (1.0 - 1e-9), 400)
            return omega / (2.0 * math.pi), wall_limits.passivity_index(x.subject, omega)
        omega, Z = _felt_by_hand(x)
        return omega / (2.0 * math.pi), Z.real

    labels = dict(xlabel="frequency [Hz]", ylabel=unit_text("damping to spare [N.s/m]"))
    return _zero(_overlay(found, spare, xscale="log", **labels))


def impedance_overlay(found: Sequence[Compared]) -> Figure:
    """Plots the size of the impedance fh/v over frequency.

    Args:
        found: all of one kind.
    """

    def size(x: Compared) -> tuple[np.ndarray, np.ndarray]:
        omega, Z = _felt_by_hand(x)
        return omega / (2.0 * math.pi), np.abs(Z)

    labels = dict(xlabel="frequency [Hz]", ylabel=unit_text("|f$_h$/v| [N.s/m]"))
    return _overlay(found, size, xscale="log", yscale="log", **labels)


def transparency_overlay(found: Sequence[Compared]) -> Figure:
    """Plots |fe/fh| over frequency, in continuous time.

    Args:
        found: scenarios.
    """

    def share(x: Compared) -> tuple[np.ndarray, np.ndarray]:
        assert x.loop is not None
        loop = replace(x.loop, **TIMING)
        return BAND / (2.0 * math.pi), np.abs(margins.transparency(loop, BAND))

    labels = dict(xlabel="frequency [Hz]", ylabel="|f$_e$/f$_h$|")
    figure = _overlay(found, share, xscale="log", **labels)
    figure.axes[0].axhline(1.0, color=BLACK, lw=stroke(0.8), zorder=1)
    return figure


def wall_region_plot(found: Sequence[Compared]) -> Figure:
    """Plots the largest stable K over B, exact, and a mark at the wall of each file.

    Args:
        found: walls.
    """
    walls = [x.subject for x in found if isinstance(x.subject, VirtualWall)]
    most = max(2.0 * (w.device.mass + w.hand.mass) / w.Ts for w in walls)
    B = np.linspace(0.0, most, WALL_DAMPINGS)

    def band(x: Compared) -> tuple[np.ndarray, np.ndarray]:
        high = [wall_limits.stiffness_band(replace(x.subject, B=float(b)))[1] for b in B]  # type: ignore[arg-type]
        return B, np.array(high)

    labels = dict(xlabel=unit_text("virtual damping B [N.s/m]"), ylabel="stiffness K [N/m]")
    figure = _overlay(found, band, **labels)
    ax: Axes = figure.axes[0]
    with figure_style():
        for wall, (color, _) in zip(walls, CURVE_STYLES, strict=False):
            mark: Any = dict(ms=stroke(7.0), mfc=WHITE, mec=color, mew=stroke(1.4))
            ax.plot(wall.B, wall.K, "o", clip_on=False, zorder=5, **mark)
    last = max((float(b) for x in found for b, K in zip(*band(x), strict=True) if K), default=most)
    ax.set(xlim=(0.0, 1.1 * last or most), ylim=(0.0, None))
    return figure


def push_plot(found: Sequence[Compared]) -> Figure:
    """Plots position over time after a push.

    Args:
        found: walls.
    """
    labels = dict(xlabel="time [s]", ylabel="position x [mm]")
    return _zero(_overlay(found, lambda x: (x.record.t, 1e3 * x.record.p[:, 0]), **labels))
