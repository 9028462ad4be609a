"""Figure of error against run time."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..studies.accuracy_ladder import CLEAR, SAMPLED, Ladder
from .palette import BLACK, BLUE, GREY, PALE_GREY, VERMILION
from .panels import add_legend, mark, ring, set_title, side_by_side
from .style import figure_style, points, stroke

SERIES_LOOKS: dict[str, Any] = {  # curve, and where its steps are written
    "fast": (dict(color=BLUE, marker="o", ls="-"), dict(xytext=(7, 5), ha="left")),
    "accurate": (dict(color=VERMILION, marker="s", ls="-"), dict(xytext=(-7, -12), ha="right")),
    SAMPLED: (dict(color=GREY, marker="^", ls=":"), dict(xytext=(7, 5), ha="left")),
}
ERROR_AXES = {"s": "error of the border times [s]", "m": "error of the position [m]"}


@figure_style()
def accuracy_plot(ladder: Ladder) -> Figure:
    """Plots error against run time: one panel per unit, one curve per method, one mark per step.

    Rings mark the cheapest setting for an error. In the grey band the error of the reference hides
    that of a setting.
    """
    units = ladder.units()
    count = max(len(units), 1)
    figure, axes = side_by_side(count, 4.6, 4.4 * count + 0.6)
    for ax, unit in zip(axes, units, strict=False):
        _accuracy_panel(ax, ladder, unit)
    if units:
        add_legend(figure, 5 if len(units) > 1 else 2)
    simulated = f"{ladder.simulated:.4g} s simulated"
    engine, steps = f"engine {ladder.engine}", "steps written beside the marks"
    set_title(axes[0], ladder.scenario.name, simulated, engine, steps)
    return figure


def _accuracy_panel(ax: Axes, ladder: Ladder, unit: str) -> None:
    ax.set(xscale="log", yscale="log", xlabel="run time [s]", ylabel=ERROR_AXES[unit])
    marks = [(x, e) for x in ladder.settings if (e := ladder.shown(x, unit)) and x.wall]
    for name, (look, side) in SERIES_LOOKS.items():
        series = [(x.wall, e, x.dt) for x, e in marks if x.series == name]
        if not series:
            continue
        walls, errors, steps = zip(*series, strict=True)
        ax.plot(walls, errors, ms=stroke(5), lw=stroke(1.4), label=name, zorder=3, **look)
        for i in {0, len(series) - 1}:
            text: Any = dict(fontsize=points(8), color=look["color"], textcoords="offset points")
            ax.annotate(_step(steps[i]), (walls[i], errors[i]), **text, **side)
    cheapest = ladder.cheapest(unit).values()
    best = [(x.wall, e) for x, e in marks if x in cheapest]
    mark(ax, best, label="cheapest for an error", **ring(BLACK, 11.0))
    ax.margins(x=0.15, y=0.1)
    (first, last), (low, high) = ax.get_xlim(), ax.get_ylim()
    ax.set_xlim(first, 2.5 * last)  # space for the label of the last step
    if left := ladder.left[unit]:
        low = min(low, 0.3 * left)
        ax.axhspan(low, CLEAR * left, color=PALE_GREY, lw=0, label="hidden by the reference")
    ax.set_ylim(low, high)


def _step(dt: float) -> str:
    """A step in words: 20 ms, 0.36 ms, 5 us."""
    return f"{1e3 * dt:.3g} ms" if dt >= 1e-5 else f"{1e6 * dt:.3g} us"
