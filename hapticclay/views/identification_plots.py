"""Figures of identified responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from ..model.constants import AXES
from ..studies import identification
from ..studies.identification import Identified
from ..studies.identified_blocks import IdentifiedBlocks
from .captions import unit_text
from .palette import BLACK, BLUE, GREY, VERMILION
from .panels import add_legend, hollow, plain_ticks, set_title
from .style import figure_size, figure_style, panel_grid, points, stroke


class PlottedBlock(NamedTuple):
    """Labels of an identified block."""

    symbol: str  # in titles
    equations: tuple[str, str]  # of the paper, on x and y


BLOCKS = {
    "G": PlottedBlock("G", ("Eq. 15", "Eq. 16")),
    "S": PlottedBlock("S", ("Eq. 17", "Eq. 18")),
    "Th": PlottedBlock("T$_h$", ("Eq. 19", "Eq. 19")),
}
HEIGHTS = (2.2, 2.0, 0.8)  # of magnitude, phase and coherence


@figure_style()
def identification_plot(results: Sequence[Identified], paper: bool | None = None) -> Figure:
    """Plots magnitude, phase and coherence of one block.

    The response is left out where its coherence is below 0.5.
    """
    rows, columns = panel_grid(len(results))
    figure = Figure(figsize=figure_size(2, 5.4 * rows, max(1.2 + 3.6 * len(results), 6.0)))
    look: Any = dict(sharex=True, squeeze=False)
    axes: Any = figure.subplots(3 * rows, columns, height_ratios=HEIGHTS * rows, **look)
    axes = axes.reshape(rows, 3, columns).transpose(1, 0, 2).reshape(3, -1)
    for row in axes:
        for ax in row[1:]:
            ax.sharey(row[0])
            ax.tick_params(labelleft=rows > 1)
    for column, result in zip(axes.T, results, strict=True):
        _response_column(column, result, paper)
    labels = f"magnitude [dB re 1 {results[0].response_unit}]", "phase [deg]", "coherence"
    labelled = axes if rows > 1 else axes[:, :1]
    for row, label in zip(labelled, labels, strict=True):
        for ax in row:
            ax.set_ylabel(label)
    low = min(0.9, *(float(r.coherence.min()) for r in results))
    axes[2, 0].set_ylim(low - 0.1 * (1.0 - low), 1.0 + 0.2 * (1.0 - low))
    figure.align_ylabels(labelled.ravel())
    add_legend(figure, 3)
    return figure


def blocks_plot(found: IdentifiedBlocks) -> Figure:
    """As `identification_plot` of one block on its axes."""
    return identification_plot(found.results, found.paper)


def identified_plot(result: Identified) -> Figure:
    """As `identification_plot` of one axis."""
    return identification_plot([result])


def _response_column(axes: Sequence[Axes], result: Identified, paper: bool | None) -> None:
    magnitude, phase, coherence = axes
    what, f = result.what, result.frequency
    line = np.geomspace(f[0] / 1.15, f[-1] * 1.15, 400)
    printed = identification.printed_form(what, result.axis)
    theory, fitted = (identification.response(what, x, line) for x in (printed, result.values))
    clear = result.coherence >= identification.COHERENT
    measured = result.response[clear]
    share = result.deviation[clear] / np.abs(measured)
    beside = result.scenario is not None if paper is None else paper
    error = 1.96 * np.array((20.0 / np.log(10.0) * share, np.degrees(share)))
    marks = hollow(BLUE, "o", 4.0, color=BLUE, elinewidth=stroke(1.0), zorder=3)
    label = f"{'simulated arm' if result.scenario else 'measured'}, with 95 % bars"
    for ax, part, e in ((magnitude, _decibel, error[0]), (phase, _degrees, error[1])):
        if beside:
            ax.plot(line, part(theory), color=VERMILION, lw=stroke(2.2), label="printed")
        look: Any = dict(color=BLACK, ls=":", lw=stroke(1.2), label="fitted to the points")
        ax.plot(line, part(fitted), **look)
        ax.errorbar(f[clear], part(measured), e, label=label, **marks)
    coherence.plot(f, result.coherence, "o", ms=stroke(3.0), color=BLUE)
    coherence.set(xscale="log", xlabel="frequency [Hz]")
    plain_ticks(coherence)
    phase.yaxis.set_major_locator(MultipleLocator(45.0))
    set_title(magnitude, *_title(result, beside), panel=True)
    values = [
        f"{c.name} {identification.format_coefficient(c)} {c.unit}" for c in result.coefficients
    ]
    corner: Any = dict(y=0.95, va="top") if what == "Th" else dict(y=0.06, va="bottom")
    corner |= dict(transform=magnitude.transAxes, fontsize=points(8), color=GREY)
    magnitude.text(0.04, s=unit_text("\n".join(values)), **corner)


def _title(result: Identified, beside: bool) -> list[str]:
    """Block, axis and equation; of measured columns the file, which no axis of the arm is in."""
    block = BLOCKS[result.what]
    equation = f" ({block.equations[AXES.index(result.axis)]})" if beside else ""
    if result.scenario is not None:
        return [f"{block.symbol}, {result.axis} axis{equation}"]
    where = f", {result.axis} axis{equation}" if beside else ""
    return [f"{block.symbol}{where}", result.source.replace("$", r"\$")]


def _decibel(H: np.ndarray) -> np.ndarray:
    return 20.0 * np.log10(np.abs(H))


def _degrees(H: np.ndarray) -> np.ndarray:
    return np.degrees(np.unwrap(np.angle(H)))
