"""Plots that grow with a run, in a film."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..arms.joint_units import of_joints
from ..model.constants import AXES
from ..scene.joint_numbers import turning
from ..simulation.pair_record import PairRecord
from ..simulation.record import Record
from .flow_plots import draw_laws, flows_met
from .motion import SMALL, most_moved, pair_unit, resolved
from .palette import BLUE, GREEN, GREY, VERMILION
from .panels import shade_held
from .run_axes import held_spans, is_viscous, shade_clay, shades
from .style import figure_style, stroke

FILM_DPI = 100
TEXT_SIZE = 7.5  # [points]
LEAST_PANEL = (120, 100)  # width and height [pixels] that the numbers of a running plot need
ROOMY_PANEL = (180, 110)  # ... and the names of its axes
MOST_JOINTS = 3  # shown of an arm from a file
LEGEND_WIDTH = 230  # [pixels] from which a legend fits beside the title


class Panel(NamedTuple):
    """A running plot, with names that fit its size."""

    x: np.ndarray  # of its curves; NaN where they break
    y_range: np.ndarray  # values that the y axis spans
    labels: tuple[str, str]  # of x and y
    title: str
    curves: tuple[tuple[np.ndarray, str, str], ...]  # y, colour, name in the legend


def plots_fit(width: int, height: int) -> bool:
    """Whether running plots fit into a picture of this size."""
    return width >= LEAST_PANEL[0] and height >= LEAST_PANEL[1]


class RunningPlots:
    """The plots of a run as they grow with it: velocity and fe/v over position, force over time.

    The axes are drawn once; each image restores them and draws the curves (matplotlib's blitting).
    """

    def __init__(self, record: Record | PairRecord, width: int, height: int):
        """Draws the axes."""
        figure, curves = running_figure(record, width, height)
        self._canvas: Any = figure.canvas
        self._axes = self._canvas.copy_from_bbox(figure.bbox)
        self._curves = []
        for ax, x, y, color in curves:
            finite = np.flatnonzero(np.isfinite(y))
            with figure_style():
                (line,) = ax.plot([], [], color=color, lw=stroke(1.4))
            self._curves.append((line, finite, x[finite], y[finite]))

    @figure_style()
    def draw(self, n: int) -> np.ndarray:
        """Draws the first samples of the run."""
        self._canvas.restore_region(self._axes)
        for line, finite, x, y in self._curves:
            end = int(np.searchsorted(finite, n))
            line.set_data(x[:end], y[:end])
            line.axes.draw_artist(line)
        return np.asarray(self._canvas.buffer_rgba())[..., :3]


@figure_style(font_size=TEXT_SIZE, lines_linewidth=1.0)
def running_figure(
    record: Record | PairRecord, width: int, height: int
) -> tuple[Figure, list[tuple[Axes, np.ndarray, np.ndarray, str]]]:
    """Draws the axes of the running plots, with a legend where there is room for it."""
    count = max(1, min(3, height // LEAST_PANEL[1]))
    roomy = width >= ROOMY_PANEL[0] and height >= ROOMY_PANEL[1] * count
    plans = _plans(record, roomy)[:count]
    figure = Figure(figsize=(width / FILM_DPI, height / FILM_DPI), dpi=FILM_DPI)
    panels: Any = figure.subplots(count, 1, squeeze=False)[:, 0]
    for ax, plan in zip(panels, plans, strict=True):
        ax.set(xlim=_limits(plan.x), ylim=_limits(plan.y_range))
        ax.set_xlabel(plan.labels[0], labelpad=1)
        ax.set_ylabel(plan.labels[1], labelpad=2)
        ax.set_title(plan.title, fontsize=TEXT_SIZE, color=GREY, pad=2, loc="left")
        for _, color, name in plan.curves:
            ax.plot([], [], color=color, lw=stroke(1.4), label=name)
    if isinstance(record, Record):
        _draw_clay(panels, record)
    for ax in panels if width >= LEGEND_WIDTH else ():
        entries = dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
        place: Any = dict(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
        place |= dict(borderpad=0.15, handlelength=1.3, columnspacing=1.0, handletextpad=0.5)
        if entries:
            ax.legend(entries.values(), entries, ncols=len(entries), fontsize=TEXT_SIZE, **place)
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()  # fixes the ticks and the space that they need
    canvas.draw()
    both = zip(panels, plans, strict=True)
    return figure, [(ax, plan.x, y, color) for ax, plan in both for y, color, _ in plan.curves]


def _plans(record: Record | PairRecord, roomy: bool) -> tuple[Panel, ...]:
    if isinstance(record, PairRecord):
        return _pair_panels(record)
    if not record.scenario.is_closed_form:
        return _joint_panels(record)
    return _running_panels(record, _main_axis(record), roomy)


def _main_axis(record: Record) -> int:
    """The axis along which the handle moves most."""
    return int(np.ptp(record.p[:, 1]) > 1.2 * np.ptp(record.p[:, 0]))


def _draw_clay(panels: Any, record: Record) -> None:
    """Shades clay and the times at which it held the handle; draws its law."""
    i, closed_form = _main_axis(record), record.scenario.is_closed_form
    for ax in panels[: (2 if is_viscous(record.scenario) else 1) * closed_form]:
        shade_clay(ax, *shades(record, AXES[i]))
    for ax in panels[1 : 1 + closed_form]:
        _running_laws(ax, record, i)
    for ax in panels[2:]:
        shade_held(ax, held_spans(record, AXES[i]))


def _pair_panels(r: PairRecord) -> tuple[Panel, ...]:
    """The joint that moves most, forces of hand and contact, and energy taken, over time."""
    j, turned = most_moved(r)
    unit, scale = pair_unit(r.unit, turned)
    forces = [np.linalg.norm(f, axis=1) for f in (r.hand, r.contact)]
    ports = [1e3 * x for x in r.port_energy.T]

    def panel(name: str, values: Any, labels: Any) -> Panel:
        curves = tuple(zip(values, (BLUE, VERMILION), labels, strict=True))
        return Panel(r.t, np.concatenate(values), ("time [s]", name), "", curves)

    ends = "leader", "follower"
    return (
        panel(f"{r.names[j]} [{unit}]", [scale * x for x in turned], ends),
        panel("force [N]", forces, ("hand", "contact")),
        panel("energy taken [mJ]", ports, ("at leader", "at follower")),
    )


def _running_panels(r: Record, i: int, roomy: bool) -> tuple[Panel, ...]:
    axis, clay = AXES[i], r.scenario.clay
    x, v, fe, fh = 100.0 * r.p[:, i], r.v[:, i], r.fe[:, i], r.fh[:, i]

    def panel(x: Any, y_range: Any, over: str, name: str, title: str, *curves: Any) -> Panel:
        """Where there is no room, the title names the y axis."""
        labels = (over, name) if roomy else (over.replace("position ", "").replace("time", "t"), "")
        return Panel(x, y_range, labels, title if roomy else name, curves)

    where = f"position {axis} [cm]"
    if is_viscous(r.scenario):
        top = max(float(r.b[:, i].max(initial=0.0)), 1.0)
        ratio = np.clip(r.ratio(r.fe)[:, i], -top, 2.0 * top)  # 0/0 as a run begins or turns
        share = np.array((0.0, 1.25 * top))
        second = panel(x, share, where, "f$_e$/v [N·s/m]", "", (ratio, BLUE, "f$_e$/v"))
    elif clay is not None and clay.of_velocity:
        u, force = _over_velocity(r, i)
        over = "v along the motion [m/s]" if clay.along_motion else f"v$_{axis}$ [m/s]"
        over = over if roomy else over.replace(" along the motion", "")
        second = panel(u, np.append(force, 0.0), over, "clay f$_e$ [N]", "", (force, BLUE, "f$_e$"))
    else:
        second = panel(x, np.append(fe, 0.0), where, "clay f$_e$ [N]", "", (fe, BLUE, "f$_e$"))
    usual = np.percentile(np.concatenate((fh, fe)), (1.0, 99.0))  # not the spike at a border
    hand, by_clay = ("operator f$_h$", "clay f$_e$") if roomy else ("f$_h$", "f$_e$")
    forces = (fh, GREEN, hand), (fe, BLUE, by_clay)
    name = f"v$_{axis}$ [m/s]"
    return (
        panel(x, v, where, name, r.scenario.name, (v, BLUE, f"v$_{axis}$")),
        second,
        panel(r.t, np.append(1.15 * usual, 0.0), "time [s]", "force [N]", "", *forces),
    )


def _joint_panels(r: Record) -> tuple[Panel, ...]:
    """Joints that move most, their rates, and the handle, over time."""
    moved = np.ptp(r.q, axis=0)
    most = sorted(np.argsort(-moved)[:MOST_JOINTS].tolist())
    names, colors = r.scenario.joints, (BLUE, VERMILION, GREEN)
    unit, scale = ("mrad", 1e3) if moved.max(initial=0.0) < SMALL else ("rad", 1.0)
    near, per = ("mm", 1e3) if np.ptp(r.p, axis=0).max(initial=0.0) < SMALL else ("cm", 1e2)

    def panel(name: str, title: str, values: Any, labels: Any) -> Panel:
        curves = tuple(zip(values, colors, labels, strict=False))
        return Panel(r.t, np.concatenate(values), ("time [s]", name), title, curves)

    turned = [scale * (r.q[:, j] - r.q[0, j]) for j in most]
    labels, kinds = [names[j] for j in most], [turning(r.scenario)[j] for j in most]
    return (
        panel(of_joints(f"joints [{unit}]", kinds), "", turned, labels),
        panel(of_joints("rates [rad/s]", kinds), "", [r.qd[:, j] for j in most], labels),
        panel(f"handle [{near}]", "", [*(per * r.p.T)], r.scenario.axes),
    )


def _over_velocity(r: Record, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and force of the clay, along the motion if it resists along it; NaN in free air."""
    clay = r.scenario.clay
    assert clay is not None
    (v, fe), law = resolved(clay, r.v, r.fe, i), clay.laws[i]
    return np.where(law.some[law.index(*r.p.T)], v, np.nan), fe


def _running_laws(ax: Axes, r: Record, i: int) -> None:
    """Draws b of viscous clay, or the laws of yielding clay over the velocity, if they are few."""
    clay, b = r.scenario.clay, np.unique(r.b[:, i])
    if clay is None:
        return
    if clay.viscous:
        for value in b[b > 0.0] if len(b) <= 4 else ():
            ax.axhline(value, color=VERMILION, ls="--", lw=stroke(0.9), label="b")
    elif (
        clay.of_velocity
        and not (clay.varies or clay.angle)
        and not (clay.along_motion and not np.array_equal(r.b[:, 0], r.b[:, 1]))
        and len(met := flows_met(r, i)) <= 4
    ):
        draw_laws(ax, met, *_over_velocity(r, i), 0.9)


def _limits(values: np.ndarray) -> tuple[float, float]:
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    span = max(high - low, 1e-6)
    return low - 0.04 * span, high + 0.06 * span
