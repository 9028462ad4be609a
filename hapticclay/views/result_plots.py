"""Figures of results of theory."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..theory.design import Design
from ..theory.impedance import Impedance
from .style import BLACK, BLUE, figure_size, figure_style, set_title, stroke, unit_text

DESIGN_OMEGA = np.geomspace(0.1, 1000.0, 500)  # [rad/s]


def effective_parts_plot(found: Impedance) -> Figure:
    """Plots effective stiffness, damping and mass over frequency."""
    panels = [
        (label, y)
        for label, y in (
            ("stiffness [N/m]", found.stiffness),
            ("damping [N.s/m]", found.damping),
            ("mass [kg]", found.mass),
        )
        if np.isfinite(y).any()
    ]
    with figure_style():
        figure = Figure(figsize=figure_size(1, 1.0 + 1.7 * len(panels)))
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (label, y) in zip(axes, panels, strict=True):
            ax.semilogx(found.frequency, y, color=BLUE)
            ax.set_ylabel(unit_text(label))
        axes[-1].set_xlabel(unit_text("frequency [Hz]"))
        figure.align_ylabels(list(axes))
        set_title(axes[0], "impedance that the hand feels")
    return figure


def design_plot(design: Design) -> Figure:
    """Plots magnitude and phase of the compensator K C."""
    s, c = 1j * DESIGN_OMEGA, design.compensator
    response = design.K * np.polyval(c.num, s) / np.polyval(c.den, s)
    with figure_style():
        figure = Figure(figsize=figure_size(1, 4.4))
        top, low = figure.subplots(2, 1, sharex=True)
        top.loglog(DESIGN_OMEGA, np.abs(response), color=BLUE)
        low.semilogx(DESIGN_OMEGA, np.degrees(np.unwrap(np.angle(response))), color=BLUE)
        low.axhline(-180.0, color=BLACK, lw=stroke(0.8))
        top.set_ylabel(unit_text("magnitude of K C [m/N]"))
        low.set(xlabel=unit_text("frequency [rad/s]"), ylabel="phase [degrees]")
        figure.align_ylabels([top, low])
        set_title(top, design.headline())
    return figure
