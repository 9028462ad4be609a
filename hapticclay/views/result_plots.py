"""Figures of results of theory."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..theory.design import Design
from ..theory.impedance import Impedance
from .impedance_plots import parts_panels
from .palette import BLUE
from .panels import label_axes, level, set_title, stacked
from .style import figure_style

DESIGN_OMEGA = np.geomspace(0.1, 1000.0, 500)  # [rad/s]


@figure_style()
def effective_parts_plot(found: Impedance) -> Figure:
    """Plots effective stiffness, damping and mass over frequency."""
    figure, panels = parts_panels([found])
    for part, ax in panels.items():
        ax.plot(found.frequency, getattr(found, part), color=BLUE)
    set_title(figure.axes[0], "impedance that the hand feels")
    return figure


@figure_style()
def design_plot(design: Design) -> Figure:
    """Plots magnitude and phase of the compensator K C."""
    s, c = 1j * DESIGN_OMEGA, design.compensator
    response = design.K * np.polyval(c.num, s) / np.polyval(c.den, s)
    figure, (top, low) = stacked(2, 4.4)
    top.loglog(DESIGN_OMEGA, np.abs(response), color=BLUE)
    low.semilogx(DESIGN_OMEGA, np.degrees(np.unwrap(np.angle(response))), color=BLUE)
    level(low, -180.0)
    label_axes(top, y="magnitude of K C [m/N]")
    label_axes(low, "frequency [rad/s]", "phase [degrees]")
    set_title(top, design.headline())
    return figure
