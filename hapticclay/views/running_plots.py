"""Plots that grow with a run, in a film."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..model.constants import AXES
from ..simulation.record import Record
from .flow_plots import flows_met, law_curve
from .run_axes import held_spans, is_viscous, shades
from .style import (
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    along_motion,
    figure_style,
    shade_clay,
    shade_held,
    stroke,
)

FILM_DPI = 100
LEAST_PANEL = (120, 100)  # width and height [pixels] that the numbers of a running plot need
ROOMY_PANEL = (180, 110)  # ... and the names of its axes


class Panel(NamedTuple):
    """A running plot.

    Attributes:
        x: of its curves, shape (n,); NaN where they break.
        y_range: least range of the y axis.
        labels: labels of x and y, drawn where there is room.
        title: where there is room for labels.
        short: title used without labels.
        curves: (y, colour) of each curve.
    """

    x: np.ndarray
    y_range: np.ndarray
    labels: tuple[str, str]
    title: str
    short: str
    curves: tuple[tuple[np.ndarray, str], ...]


def plots_fit(width: int, height: int) -> bool:
    """Whether running plots fit into a picture of this size."""
    return width >= LEAST_PANEL[0] and height >= LEAST_PANEL[1]


class RunningPlots:
    """The plots of a run as they grow with it: velocity and fe/v over position, force over time.

    The axes are drawn once; each image restores them and draws the curves (matplotlib's blitting).
    """

    def __init__(self, record: Record, width: int, height: int):
        """Draws the axes."""
        figure, curves = running_figure(record, width, height)
        self._canvas: Any = figure.canvas
        self._axes = self._canvas.copy_from_bbox(figure.bbox)
        self._curves = []
        for ax, x, y, color in curves:
            known = np.flatnonzero(np.isfinite(y))
            with figure_style():
                (line,) = ax.plot([], [], color=color, lw=stroke(1.4))
            self._curves.append((line, known, x[known], y[known]))

    def draw(self, n: int) -> np.ndarray:
        """Draws the first samples of the run."""
        self._canvas.restore_region(self._axes)
        for line, known, x, y in self._curves:
            end = int(np.searchsorted(known, n))
            with figure_style():
                line.set_data(x[:end], y[:end])
                line.axes.draw_artist(line)
        return np.asarray(self._canvas.buffer_rgba())[..., :3]


def running_figure(
    record: Record, width: int, height: int
) -> tuple[Figure, list[tuple[Axes, np.ndarray, np.ndarray, str]]]:
    """Draws the axes of the running plots."""
    count = max(1, min(3, height // LEAST_PANEL[1]))
    roomy = width >= ROOMY_PANEL[0] and height >= ROOMY_PANEL[1] * count
    i = int(np.ptp(record.p[:, 1]) > 1.2 * np.ptp(record.p[:, 0]))
    plans = _running_panels(record, i, roomy)[:count]
    with figure_style(font_size=7.5, lines_linewidth=1.0):
        figure = Figure(figsize=(width / FILM_DPI, height / FILM_DPI), dpi=FILM_DPI)
        panels: Any = figure.subplots(count, 1, squeeze=False)[:, 0]
        for ax, plan in zip(panels, plans, strict=True):
            ax.set(xlim=_limits(plan.x), ylim=_limits(plan.y_range))
            ax.set_xlabel(plan.labels[0], labelpad=1)
            ax.set_ylabel(plan.labels[1] if roomy else "", labelpad=2)
            title = plan.title if roomy else plan.short
            ax.set_title(title, fontsize=7.5, color=GREY, pad=2, loc="left")
        viscous = is_viscous(record.scenario)
        for ax in panels[: 2 if viscous else 1]:
            shade_clay(ax, *shades(record, AXES[i]))
        for ax in panels[1:2]:
            _running_laws(ax, record, i)
        for ax in panels[2:]:
            shade_held(ax, held_spans(record, AXES[i]))
        b = np.unique(record.b[:, i])
        for value in b[b > 0.0] if len(b) <= 4 and len(panels) > 1 and viscous else ():
            panels[1].axhline(value, color=VERMILION, ls="--", lw=stroke(0.9))
            at: Any = dict(xycoords=("axes fraction", "data"), textcoords="offset points")
            panels[1].annotate("b", (1.0, value), (-2, 2), color=VERMILION, ha="right", **at)
        canvas = FigureCanvasAgg(figure)
        figure.draw_without_rendering()  # fixes the ticks and the space that they need
        canvas.draw()
    both = zip(panels, plans, strict=True)
    return figure, [(ax, plan.x, y, color) for ax, plan in both for y, color in plan.curves]


def _running_panels(r: Record, i: int, roomy: bool) -> tuple[Panel, ...]:
    axis = AXES[i]
    x, v, fe, fh = 100.0 * r.p[:, i], r.v[:, i], r.fe[:, i], r.fh[:, i]
    top = max(float(r.b[:, i].max(initial=0.0)), 1.0)
    ratio = np.clip(r.ratio(r.fe)[:, i], -top, 2.0 * top)  # 0/0 as a run begins or turns
    usual = np.percentile(np.concatenate((fh, fe)), (1.0, 99.0))  # not the spike at a border
    where, when = (f"position {axis} [cm]", "time [s]") if roomy else (f"{axis} [cm]", "t [s]")
    speed, share = f"v$_{axis}$ [m/s]", "f$_e$/v [N$\\cdot$s/m]"
    force_curves = ((fh, GREEN), (fe, BLUE))
    second = Panel(x, np.array((0.0, 1.25 * top)), (where, share), "", share, ((ratio, BLUE),))
    told = "clay f$_e$ [N]"
    clay = r.scenario.clay
    if clay and not clay.of_velocity:
        second = Panel(x, np.append(fe, 0.0), (where, told), "", told, ((fe, BLUE),))
    elif clay and not clay.viscous:
        u, along = _over_velocity(r, i)
        over = speed
        if clay.along_motion:
            over = "v along the motion [m/s]" if roomy else "v [m/s]"
        second = Panel(u, np.append(along, 0.0), (over, told), "", told, ((along, BLUE),))
    return (
        Panel(x, v, (where, f"velocity {speed}"), r.scenario.name, speed, ((v, BLUE),)),
        second,
        Panel(
            r.t,
            np.append(1.15 * usual, 0.0),
            (when, "force [N]"),
            f"operator f$_h$, clay f$_e${'; shaded: held still' if r.stops else ''}",
            "f$_h$, f$_e$ [N]",
            force_curves,
        ),
    )


def _over_velocity(r: Record, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and force of the clay, along the motion if it resists along it; NaN in free air."""
    clay = r.scenario.clay
    assert clay is not None
    v, fe = along_motion(r.v, r.fe, i) if clay.along_motion else (r.v[:, i], r.fe[:, i])
    law = clay.laws[i]
    return np.where(law.some[law.index(*r.p.T)], v, np.nan), fe


def _running_laws(ax: Axes, r: Record, i: int) -> None:
    """Draws the laws of yielding clay over the velocity, if they apply to one axis alone."""
    clay = r.scenario.clay
    if (
        clay is None
        or clay.viscous
        or not clay.of_velocity
        or clay.varies
        or clay.angle
        or (clay.along_motion and not np.array_equal(r.b[:, 0], r.b[:, 1]))
        or len(flows_met(r, i)) > 4
    ):
        return
    v, fe = _over_velocity(r, i)
    for flow, where in flows_met(r, i).items():
        back = fe[where].min() < -0.01 * flow.Fy
        x, y = law_curve(flow, min(float(v[where].min()), 0.0), float(v[where].max()), back)
        ax.plot(x, y, color=VERMILION, ls="--", lw=stroke(0.9))


def _limits(values: np.ndarray) -> tuple[float, float]:
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    span = max(high - low, 1e-6)
    return low - 0.04 * span, high + 0.06 * span
