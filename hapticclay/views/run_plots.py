"""Figures of one run: the files that `hapticclay run` writes, and the plots that grow in a film."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..model.arm import PAPER
from ..model.clay import Clay, Profile, Smooth
from ..model.compensator import PRINTED
from ..model.constants import AXES
from ..model.controller import SERVO
from ..model.scenario import Scenario
from ..model.signals import Multisine
from ..simulation.record import Record
from ..theory import linear_loop
from .style import (
    BLACK,
    BLUE,
    CLAY_ALPHA,
    GREEN,
    GREY,
    VERMILION,
    add_legend,
    clay_color,
    figure_style,
    set_title,
    shade_clay,
)

BEYOND = 1e4  # [cm], past every path
MOST_BORDERS = 20  # of clay that is drawn region by region
PICTURE_SIZE = 400  # pixels of a picture of other clay, along x and along y
SHADES = 100  # of smooth clay along a path
MOST_TITLED = 8  # that a title lists
FILM_DPI = 100
LEAST_PANEL = (120, 100)  # width and height [pixels] that the numbers of a running plot need
ROOMY_PANEL = (180, 110)  # ... and the names of its axes


def velocity_plot(record: Record, axis: str = "x") -> Figure:
    """Plots velocity over position, and the expected steady speeds (Fig. 8, top; Fig. 10).

    Args:
        record: the run.
        axis: "x" or "y"; "xy" for a panel each.
    """
    s = record.scenario
    with figure_style():
        figure, panels = _position_axes(record, axis)
        for name, ax in zip(axis, panels, strict=True):
            i = AXES.index(name)
            v = record.v[:, i]
            ax.plot(100.0 * record.p[:, i], v, color=BLUE, label="measured")
            built_in = s.controller is None
            if built_in and s.operators[i] is None and s.muscle is None and not s.turned:
                c, servo = s.compensators[i], s.servo[i]
                law = functools.partial(
                    linear_loop.steady_speed, s.gain[i], s.force[i], compensator=c, servo=servo
                )
                printed = c == PRINTED and servo.numbers[0] == 1.0
                told = "expected, K f/(10 + K b)" if printed else "expected"
                _steps(ax, record, i, law, color=VERMILION, ls="--", label=told)
            ax.set_ylabel(f"velocity v$_{name}$ [m/s]")
            low, high = min(0.0, float(v.min())), max(0.0, float(v.max()))
            span = (high - low) or 1.0
            ax.set_ylim(low - 0.04 * span, high + 0.12 * span)
        _finish(figure, panels, record)
    return figure


def force_ratio_plot(record: Record, axis: str = "x") -> Figure:
    """Plots fe/v and fh/v over position, with b and 10/K + b (Fig. 8, bottom).

    In steady motion the printed compensator resists as a damper of 10/K, another one as a damper
    of 1/(K c), c the limit of s C G/K as s goes to 0; without an integrator there is no such line.

    Args:
        record: the run.
        axis: "x" or "y".
    """
    i, s = AXES.index(axis), record.scenario
    with figure_style():
        figure, panels = _position_axes(record, axis)
        ax = panels[0]
        x = 100.0 * record.p[:, i]
        ax.plot(x, record.ratio(record.fh)[:, i], color=GREEN, label="operator, f$_h$/v")
        ax.plot(x, record.ratio(record.fe)[:, i], color=BLUE, label="clay, f$_e$/v")
        shown = _compensator_damper(s, i)
        own = shown / s.gain[i] if shown else 0.0
        if shown and s.operators[i] is None and s.muscle is None:
            told = f"{shown:.3g}/K + b"
            _steps(ax, record, i, lambda b: own + b, color=BLACK, ls=":", label=told)
        _steps(ax, record, i, lambda b: b, color=VERMILION, ls="--", label="b")
        ax.set_ylabel("force / velocity [N$\\cdot$s/m]")
        top = own + float(np.max(record.b[:, i], initial=0.0)) or 1.0
        ax.set_ylim(-0.04 * top, 1.35 * top)
        _finish(figure, panels, record)
    return figure


def _compensator_damper(scenario: Scenario, i: int) -> float:
    """K times the damper that hand and compensator end up with; 0 if there is none."""
    if not scenario.gain[i] or scenario.controller is not None:
        return 0.0
    num, den = (p.coef for p in linear_loop.reduced(scenario.compensators[i]).fraction)
    if den[0] != 0.0 or len(den) < 2:  # no integrator: the handle comes to rest
        return 0.0
    return float(den[1] / (num[0] * scenario.servo[i].numbers[0]))


def path_plot(record: Record) -> Figure:
    """Plots the path of the handle over a map of the clay (Figs. 7, 9).

    Args:
        record: the run.
    """
    p = 100.0 * record.p
    low, high = p.min(axis=0), p.max(axis=0)
    margin = 0.08 * max(float((high - low).max()), 0.1)
    breadth, depth = high - low + 1.0
    low, high = low - margin, high + margin
    with figure_style():
        figure = Figure(figsize=(6.4, min(max(6.4 * depth / breadth, 1.0) + 1.3, 6.4)))
        ax = figure.add_subplot()
        room = (high - low)[1] * 5.5 / (figure.get_figheight() - 1.3)
        wider = max(0.0, 0.5 * (room - (high - low)[0]))  # axes as wide as the title over them
        low[0], high[0] = low[0] - wider, high[0] + wider
        if record.scenario.clay:
            _clay_map(ax, record.scenario.clay, low, high)
        ax.plot(p[:, 0], p[:, 1], color=BLUE, label="handle")
        ax.plot(*p[0], "o", color=BLUE, ms=5, label="start")
        ax.plot(*p[-1], "s", color=BLUE, ms=5, label="end")
        ax.set(xlabel="position x [cm]", ylabel="position y [cm]", aspect="equal")
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ax.grid(False)
        add_legend(figure, ax)
        set_title(ax, *_scenario_parts(record.scenario))
    return figure


def _clay_map(ax: Axes, clay: Clay, low: np.ndarray, high: np.ndarray) -> None:
    """Shades each region of the clay and names its damping along x and y on entry [N.s/m]."""
    edges = [sorted({-BEYOND, BEYOND, *(100.0 * x for x in e)}) for e in clay.edges]
    if clay.smooth or max(map(len, edges)) > MOST_BORDERS:
        _clay_image(ax, clay, low, high)
        return
    for x0, x1 in zip(edges[0], edges[0][1:], strict=False):
        for y0, y1 in zip(edges[1], edges[1][1:], strict=False):
            b = clay.at(0.005 * (x0 + x1), 0.005 * (y0 + y1)).tolist()
            if not max(b):
                continue
            shade: Any = dict(color=clay_color(max(b) / clay.largest), alpha=CLAY_ALPHA, lw=0)
            ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, **shade))
            right, bottom = min(x1, high[0]), max(y0, low[1])
            shown = np.array((right - max(x0, low[0]), min(y1, high[1]) - bottom)) / (high - low)
            if shown[0] > 0.12 and shown[1] > 0.08:
                place = np.array((right, bottom)) + (-0.01, 0.01) * (high - low)
                text: Any = dict(ha="right", va="bottom", fontsize=8, color=GREY)
                ax.text(place[0], place[1], f"b = ({b[0]:g}, {b[1]:g})", **text)


def _clay_image(ax: Axes, clay: Clay, low: np.ndarray, high: np.ndarray) -> None:
    """Shades clay of many cells by a picture of it [cm]."""
    x, y = (np.linspace(low[i], high[i], PICTURE_SIZE + 1) for i in (0, 1))
    middle = 0.005 * (x[1:] + x[:-1]), 0.005 * (y[1:] + y[:-1])
    share = clay.at(middle[0], middle[1][:, None]).max(axis=0) / (clay.largest or 1.0)
    colors = np.concatenate((clay_color(share), CLAY_ALPHA * (share > 0.0)[..., None]), axis=2)
    ax.imshow(colors, extent=(x[0], x[-1], y[0], y[-1]), origin="lower", zorder=0)


def maneuver_plot(records: Sequence[Record], axis: str = "x", over: str = "time") -> Figure:
    """Plots the operator's force during a maneuver, a panel for each run (Fig. 11).

    Args:
        records: the runs.
        axis: "x" or "y".
        over: "time" or "position".
    """
    i = AXES.index(axis)
    with figure_style():
        figure = Figure(figsize=(6.4, 0.8 + 2.3 * len(records)))
        panels = figure.subplots(len(records), 1, sharex=over == "time", squeeze=False)[:, 0]
        for ax, r in zip(panels, records, strict=True):
            where = r.t if over == "time" else 100.0 * r.p[:, i]
            ax.plot(where, r.fh[:, i], color=BLUE, lw=0.9, label="operator, f$_h$")
            if r.scenario.muscle is not None:
                muscle = r.scenario.muscle
                pieces = np.array_split(r.t, len(r.t) // 4096 + 1)  # it takes (n, lines) of memory
                uh = r.scenario.force[i] + np.concatenate([muscle(t)[:, i] for t in pieces])
                ax.plot(where, uh, color=VERMILION, lw=1.1, ls="--", label="muscle, u$_h$")
            ax.set_ylabel(f"force along {axis} [N]")
            set_title(ax, *_scenario_parts(r.scenario), r.outcome.code)
            if over != "time" or ax is panels[-1]:
                ax.set_xlabel("time [s]" if over == "time" else f"position {axis} [cm]")
        add_legend(figure, panels[0])
    return figure


def readings_plot(records: dict[str, Record], axis: str = "x") -> Figure:
    """Plots velocity over position of several runs along one path.

    Args:
        records: the runs by name, four at most.
        axis: "x" or "y".
    """
    i = AXES.index(axis)
    looks = ((BLACK, "-"), (GREEN, "--"), (BLUE, "-"), (VERMILION, "-."))
    with figure_style():
        figure = Figure(figsize=(6.4, 3.6))
        ax = figure.add_subplot()
        for (name, r), (color, style) in zip(records.items(), looks, strict=False):
            ax.plot(100.0 * r.p[:, i], 1000.0 * r.v[:, i], color=color, ls=style, label=name)
        ax.set(xlabel=f"position {axis} [cm]", ylabel=f"velocity v$_{axis}$ [mm/s]")
        add_legend(figure, ax)
    return figure


def _clay_along_both_axes(s: Scenario) -> bool:
    return s.clay is not None and s.clay.along == AXES[0] + AXES[1]


def _main_axis(s: Scenario) -> str:
    size = s.force
    if isinstance(s.muscle, Multisine):
        size = s.muscle.rms
    elif s.muscle is not None:
        x, y = np.abs(s.muscle(np.linspace(0.0, s.t_max, 501)) + s.force).max(axis=0)
        size = float(x), float(y)
    return "y" if abs(size[1]) > abs(size[0]) else "x"


def _velocity(record: Record) -> Figure | None:
    s = record.scenario
    if s.muscle is not None:
        return None
    return velocity_plot(record, "xy" if _clay_along_both_axes(s) else _main_axis(s))


def _force(record: Record) -> Figure | None:
    s = record.scenario
    if s.muscle is not None:
        return maneuver_plot([record], _main_axis(s))
    return None if _clay_along_both_axes(s) else force_ratio_plot(record, _main_axis(s))


def _path(record: Record) -> Figure | None:
    s = record.scenario
    return path_plot(record) if s.muscle is None and _clay_along_both_axes(s) else None


def _force_position(record: Record) -> Figure | None:
    s = record.scenario
    return maneuver_plot([record], _main_axis(s), "position") if s.muscle is not None else None


FIGURES: dict[str, Callable[[Record], Figure | None]] = {
    "velocity": _velocity,
    "force": _force,
    "path": _path,
    "force_position": _force_position,
}
"""File name of each figure of a run, and the function that draws it or returns None where the
figure does not apply. To add a plot to `hapticclay run`, add an entry."""


def figures(record: Record) -> dict[str, Figure]:
    """Draws the figures of FIGURES that apply to a run.

    Args:
        record: the run.

    Returns:
        Figures by file name.
    """
    drawn = {name: draw(record) for name, draw in FIGURES.items()}
    return {name: figure for name, figure in drawn.items() if figure is not None}


def _position_axes(record: Record, axes: str) -> tuple[Figure, list[Axes]]:
    """A panel over the position along each axis, the clay shaded."""
    figure = Figure(figsize=(6.4 if len(axes) == 1 else 9.6, 3.6))
    panels = list(figure.subplots(1, len(axes), squeeze=False)[0])
    for name, ax in zip(axes, panels, strict=True):
        x = 100.0 * record.p[:, AXES.index(name)]
        low, high = float(x.min()), float(x.max())
        margin = 0.02 * ((high - low) or 1.0)
        shade_clay(ax, _profile(record, name), name)
        ax.set(xlabel=f"position {name} [cm]", xlim=(low - margin, high + margin))
    return figure, panels


def _profile(record: Record, axis: str) -> Profile | None:
    """The clay of an axis; of a grid or smooth clay, what the path met along that axis."""
    clay, i = record.scenario.clay, AXES.index(axis)
    law = getattr(clay, axis) if clay else None
    if law is None or isinstance(law, Profile):
        return law
    x, first = np.unique(record.p[:, i], return_index=True)
    if isinstance(law, Smooth) and len(x) > SHADES:
        near = np.searchsorted(x, np.linspace(x[0], x[-1], SHADES))
        x, first = x[near], first[near]
    b = record.b[first, i]
    change = np.flatnonzero(np.diff(b))
    edges = 0.5 * (x[change] + x[change + 1])
    along = "x" if i == 0 else "y"
    return Profile(tuple(edges.tolist()), (*b[change].tolist(), float(b[-1])), along)


def _steps(ax: Axes, record: Record, i: int, law: Any, **look: Any) -> None:
    """Draws law(b) over each stretch of the path that had one b."""
    pieces = record.stretches(AXES[i])
    if len(pieces) > 20:  # an unstable run that chatters over a border
        pieces = pieces[:3]
    for piece in pieces:
        x, b = 100.0 * record.p[piece, i], record.b[piece, i]
        constant = np.ptp(b) == 0.0
        x, y = ([x.min(), x.max()], [law(float(b[0]))] * 2) if constant else (x, law(b))
        ax.plot(x, y, lw=1.4, zorder=3, **look)
        look["label"] = "_"


def _scenario_parts(s: Scenario) -> list[str]:
    """Phrases that describe a scenario in a title."""

    def pair(x: tuple[float, float]) -> str:
        return f"({x[0]:.3g}, {x[1]:.3g})"

    how = f"K = {pair(s.gain)}" if s.controller is None else "a controller of one's own"
    out = [f"{s.name}: {how}"]
    if s.muscle is None:
        out.append(f"u$_h$ = {pair(s.force)} N")
    if s.clay:
        values = [v for f in s.clay.laws for v in dict.fromkeys(f.damping.ravel().tolist()) if v]
        values = list(dict.fromkeys(values))
        told = ", ".join(f"{v:g}" for v in values) or "0"
        if len(values) > MOST_TITLED:
            told = f"{min(values):g} to {max(values):g}"
        out.append(f"b = {told} N$\\cdot$s/m")
        rates = [g for f in s.clay.laws for g in f.rates.ravel().tolist() if g]
        out += [f"growing {g:g} a second" for g in rates][:1]
        out += [f"turned by {math.degrees(s.clay.angle):.3g} degrees"] * bool(s.clay.angle)
    printed = {"arm": PAPER, "servo": SERVO, "compensator": (PRINTED, PRINTED)}
    own = {"arm": s.arm, "servo": s.servo, "compensator": s.compensators}
    out += [f"another {name}" for name, part in own.items() if part != printed[name]]
    return out + ["T$_h$ in the loop"] * any(s.operators) + ["inertia shaped"] * s.shaping


def _finish(figure: Figure, panels: list[Axes], record: Record) -> None:
    add_legend(figure, panels[0])
    set_title(panels[0], *_scenario_parts(record.scenario))


class Panel(NamedTuple):
    """A running plot.

    Attributes:
        x: of its curves, shape (n,).
        y_range: values that the y axis must hold.
        labels: of x and y, drawn where there is room.
        title: where there is room for labels.
        short: title without labels.
        curves: (y, colour) of each curve.
    """

    x: np.ndarray
    y_range: np.ndarray
    labels: tuple[str, str]
    title: str
    short: str
    curves: tuple[tuple[np.ndarray, str], ...]


def plots_fit(width: int, height: int) -> bool:
    """Tells whether running plots fit into a picture of this size.

    Args:
        width: of the picture [pixels].
        height: of the picture [pixels].
    """
    return width >= LEAST_PANEL[0] and height >= LEAST_PANEL[1]


class RunningPlots:
    """The plots of a run as they grow with it: velocity and fe/v over position, force over time.

    The axes are drawn once; each image restores them and draws the curves (matplotlib's blitting).
    """

    def __init__(self, record: Record, width: int, height: int):
        """Draws the axes.

        Args:
            record: the run.
            width: of the image [pixels].
            height: of the image [pixels]; the panels that fit are shown, three at most.
        """
        figure, curves = running_figure(record, width, height)
        self._canvas: Any = figure.canvas
        self._axes = self._canvas.copy_from_bbox(figure.bbox)
        self._curves = []
        for ax, x, y, color in curves:
            known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
            (line,) = ax.plot([], [], color=color, lw=1.4)
            self._curves.append((line, known, x[known], y[known]))

    def draw(self, n: int) -> np.ndarray:
        """Draws the first samples of the run.

        Args:
            n: number of samples.

        Returns:
            The image, shape (height, width, 3) of bytes; the next call overwrites it.
        """
        self._canvas.restore_region(self._axes)
        for line, known, x, y in self._curves:
            end = int(np.searchsorted(known, n))
            line.set_data(x[:end], y[:end])
            line.axes.draw_artist(line)
        return np.asarray(self._canvas.buffer_rgba())[..., :3]


def running_figure(
    record: Record, width: int, height: int
) -> tuple[Figure, list[tuple[Axes, np.ndarray, np.ndarray, str]]]:
    """Draws the axes of the running plots.

    Args:
        record: the run.
        width: of the picture [pixels].
        height: of the picture [pixels].

    Returns:
        The figure, and (axes, x, y, colour) of each curve to be drawn on it.
    """
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
        for ax in panels[:2]:
            shade_clay(ax, _profile(record, AXES[i]), AXES[i])
        b = np.unique(record.b[:, i])
        for value in b[b > 0.0] if len(b) <= 4 and len(panels) > 1 else ():
            panels[1].axhline(value, color=VERMILION, ls="--", lw=0.9)
            at: Any = dict(xycoords=("axes fraction", "data"), textcoords="offset points")
            panels[1].annotate("b", (1.0, value), (-2, 2), color=VERMILION, ha="right", **at)
        canvas = FigureCanvasAgg(figure)
        figure.draw_without_rendering()  # settles the ticks, and so the room that they take
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
    return (
        Panel(x, v, (where, f"velocity {speed}"), r.scenario.name, speed, ((v, BLUE),)),
        Panel(x, np.array((0.0, 1.25 * top)), (where, share), "", share, ((ratio, BLUE),)),
        Panel(
            r.t,
            np.append(1.15 * usual, 0.0),
            (when, "force [N]"),
            "operator f$_h$, clay f$_e$",
            "f$_h$, f$_e$ [N]",
            force_curves,
        ),
    )


def _limits(values: np.ndarray) -> tuple[float, float]:
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    span = max(high - low, 1e-6)
    return low - 0.04 * span, high + 0.06 * span
