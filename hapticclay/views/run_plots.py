"""Figures of one run: the files that `hapticclay run` writes, and the plots that grow in a film."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
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
from ..model.flow import Flow
from ..model.groove import Groove
from ..model.signals import Multisine
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..theory import linear_loop
from . import figure as shown
from .style import (
    BLACK,
    BLUE,
    CLAY_ALPHA,
    CLAY_DEEP,
    CLAY_PALE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SHADED,
    SKY_BLUE,
    VERMILION,
    WHITE,
    add_legend,
    along_motion,
    clay_color,
    clay_share,
    figure_size,
    figure_style,
    map_size,
    panel_grid,
    points,
    set_title,
    shade_clay,
    shade_held,
    stroke,
)

BEYOND = 1e4  # [cm], past every path
MOST_BORDERS = 20  # of clay that is drawn region by region
PICTURE_SIZE = 400  # pixels of a picture of other clay, along x and along y
SHADES = 100  # of smooth clay along a path
MOST_TITLED = 8  # that a title lists
MOST_DOTS = 20_000  # of a kind in a plot
HELD_LOOK: Any = dict(color=ORANGE, ls="", marker="_", ms=9, mew=0.8)
FLOW_COLORS = (BLUE, GREEN, PURPLE, SKY_BLUE)  # of the regions of clay that yields
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
            if s.clay and not s.clay.viscous:
                _expected_speeds(ax, record, name)
                _mark_held(ax, record, i, v)
            elif built_in and s.operators[i] is None and s.muscle is None and not s.rotated:
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
        figure = Figure(figsize=map_size(6.4, 1.0, depth / breadth))
        ax = figure.add_subplot()
        across, up = figure.get_figwidth() - stroke(0.9), figure.get_figheight() - stroke(1.3)
        room = (high - low)[1] * across / up
        wider = max(0.0, 0.5 * (room - (high - low)[0]))  # axes as wide as the title over them
        low[0], high[0] = low[0] - wider, high[0] + wider
        if record.scenario.clay:
            _clay_map(ax, record.scenario.clay, low, high)
        ax.plot(p[:, 0], p[:, 1], color=BLUE, label="handle")
        ax.plot(*p[0], "o", color=BLUE, ms=stroke(5), label="start")
        ax.plot(*p[-1], "s", color=BLUE, ms=stroke(5), label="end")
        ax.set(xlabel="position x [cm]", ylabel="position y [cm]", aspect="equal")
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ax.grid(False)
        add_legend(figure, ax)
        set_title(ax, *_scenario_parts(record.scenario))
    return figure


def _clay_map(ax: Axes, clay: Clay, low: np.ndarray, high: np.ndarray) -> None:
    """Shades each region of the clay and names what it resists with."""
    for block in clay.blocks:
        (x0, x1), (y0, y1) = block.x, block.y
        size = 100.0 * (x1 - x0), 100.0 * (y1 - y0)
        look: Any = dict(color=clay_color(1.0), alpha=CLAY_ALPHA, lw=0)
        ax.add_patch(Rectangle((100.0 * x0, 100.0 * y0), *size, **look))
    edges = [sorted({-BEYOND, BEYOND, *(100.0 * x for x in e)}) for e in clay.edges]
    if clay.smooth or max(map(len, edges)) > MOST_BORDERS:
        _clay_image(ax, clay, low, high)
        return
    for x0, x1 in zip(edges[0], edges[0][1:], strict=False):
        for y0, y1 in zip(edges[1], edges[1][1:], strict=False):
            middle = 0.005 * (x0 + x1), 0.005 * (y0 + y1)
            share = float(clay_share(clay, *middle))
            if not share:
                continue
            shade: Any = dict(color=clay_color(share), alpha=CLAY_ALPHA, lw=0)
            ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, **shade))
            right, bottom = min(x1, high[0]), max(y0, low[1])
            shown = np.array((right - max(x0, low[0]), min(y1, high[1]) - bottom)) / (high - low)
            if shown[0] > 0.12 and shown[1] > 0.08:
                place = np.array((right, bottom)) + (-0.01, 0.01) * (high - low)
                text: Any = dict(ha="right", va="bottom", fontsize=points(8), color=GREY)
                told = "\n".join(in_math(x.text()) for x in clay.here(middle))
                ax.text(place[0], place[1], told, **text)


def _clay_image(ax: Axes, clay: Clay, low: np.ndarray, high: np.ndarray) -> None:
    """Shades clay of many cells by a picture of it [cm]."""
    x, y = (np.linspace(low[i], high[i], PICTURE_SIZE + 1) for i in (0, 1))
    middle = 0.005 * (x[1:] + x[:-1]), 0.005 * (y[1:] + y[:-1])
    share = clay_share(clay, middle[0], middle[1][:, None])
    colors = np.concatenate((clay_color(share), CLAY_ALPHA * (share > 0.0)[..., None]), axis=2)
    ax.imshow(colors, extent=(x[0], x[-1], y[0], y[-1]), origin="lower", zorder=0)


def maneuver_plot(records: Sequence[Record], axis: str = "x", over: str = "time") -> Figure:
    """Plots the operator's force during a maneuver, a panel for each run (Fig. 11).

    In clay also the force of the clay, and the time for which clay that yields held the handle.

    Args:
        records: the runs.
        axis: "x" or "y".
        over: "time" or "position".
    """
    i = AXES.index(axis)
    with figure_style():
        figure = Figure(figsize=figure_size(1, 0.8 + 2.3 * len(records)))
        panels = figure.subplots(len(records), 1, sharex=over == "time", squeeze=False)[:, 0]
        for ax, r in zip(panels, records, strict=True):
            where = r.t if over == "time" else 100.0 * r.p[:, i]
            hand = BLUE
            if r.scenario.clay is not None:
                hand = GREEN
                ax.plot(where, r.fe[:, i], color=BLUE, lw=stroke(0.9), label="clay, f$_e$")
            if r.stops:
                if over == "time":
                    shade_held(ax, _held_spans(r, axis))
                else:
                    _mark_held(ax, r, i, r.fe[:, i])
            ax.plot(where, r.fh[:, i], color=hand, lw=stroke(0.9), label="operator, f$_h$")
            if r.scenario.muscle is not None:
                muscle = r.scenario.muscle
                pieces = np.array_split(r.t, len(r.t) // 4096 + 1)  # it takes (n, lines) of memory
                uh = r.scenario.force[i] + np.concatenate([muscle(t)[:, i] for t in pieces])
                ax.plot(where, uh, color=VERMILION, lw=stroke(1.1), ls="--", label="muscle, u$_h$")
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
        figure = Figure(figsize=figure_size(1, 3.6))
        ax = figure.add_subplot()
        for (name, r), (color, style) in zip(records.items(), looks, strict=False):
            ax.plot(100.0 * r.p[:, i], 1000.0 * r.v[:, i], color=color, ls=style, label=name)
        ax.set(xlabel=f"position {axis} [cm]", ylabel=f"velocity v$_{axis}$ [mm/s]")
        add_legend(figure, ax)
    return figure


def ground_plot(record: Record) -> Figure:
    """Plots what a run has left of clay that stays cut, and the path of the tool.

    Args:
        record: the run, in a groove.
    """
    from matplotlib.colors import LinearSegmentedColormap

    ground, p, block = record.ground, 100.0 * record.p, _groove(record)
    assert ground is not None
    x, y = (100.0 * e for e in block.edges)
    corners = np.array(((x[0], y[0]), (x[-1], y[-1])))
    low = np.minimum(corners[0], p.min(axis=0)) - 0.3
    high = np.maximum(corners[1], p.max(axis=0)) + 0.3
    depth, breadth = (high - low)[::-1].tolist()
    colors = LinearSegmentedColormap.from_list("clay", [WHITE, CLAY_PALE, CLAY_DEEP])
    with figure_style():
        figure = Figure(figsize=map_size(4.7, 1.2, depth / breadth))
        ax = figure.add_subplot()
        top = 1e3 * block.highest or 1.0
        look: Any = dict(cmap=colors, vmin=0.0, vmax=top, rasterized=True)
        image = ax.pcolormesh(x, y, 1e3 * ground.T, **look)
        ax.plot(p[:, 0], p[:, 1], color=BLUE, lw=stroke(1.0), label="path of the tool")
        ax.plot(*p[0], "o", color=BLUE, ms=stroke(5), label="start")
        ax.plot(*p[-1], "s", color=BLUE, ms=stroke(5), label="end")
        edge: Any = dict(fill=False, color=GREY, lw=stroke(0.6))
        ax.add_patch(Rectangle(tuple(corners[0]), *(corners[1] - corners[0]), **edge))
        bar = ax.inset_axes((1.03, 0.0, 0.03, 1.0))
        bar.grid(False)
        figure.colorbar(image, cax=bar, label="clay left [mm]")
        ax.set(xlabel="position x [cm]", ylabel="position y [cm]", aspect="equal")
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ax.grid(False)
        add_legend(figure, ax)
        set_title(ax, *_scenario_parts(record.scenario))
    return figure


def force_velocity_plot(record: Record) -> Figure:
    """Plots the force of clay that yields over the velocity, beside the law of each region.

    Clay that resists along the motion has one panel: force and speed along the motion, negative
    where the handle goes back. Otherwise each axis on which it yields has one, of the clay's own
    axes where they are rotated. b v is left out of forces and laws where b is not one number a
    region.

    Args:
        record: the run, in clay that yields somewhere.
    """
    clay, main = record.scenario.clay, AXES.index(main_axis(record.scenario))
    assert clay is not None
    c, s = math.cos(clay.angle), math.sin(clay.angle)
    own = np.array(((c, -s), (s, c)))  # columns: the clay's axes
    v, fe, held = record.v @ own, record.fe @ own, record.held()
    across = clay.isotropic and not np.array_equal(record.b[:, 0], record.b[:, 1])
    whole = not (clay.grows or clay.smooth or across)
    if not whole:
        fe = fe - record.b * v
    if clay.isotropic:
        named = "velocity along the motion [m/s]"
        panels: dict[str, Any] = {named: (main, *along_motion(v, fe, main), held.all(axis=1))}
    else:
        names = [f"velocity v$_{a}$ [m/s]" for a in AXES]
        if clay.angle:
            names = [f"velocity along its {a} axis [m/s]" for a in ("first", "second")]
        panels = {names[i]: (i, v[:, i], fe[:, i], held[:, i]) for i in (main, 1 - main)}
        some = {n: x for n, x in panels.items() if clay.laws[x[0]].yields and x[1].any()}
        panels = some or dict([next(iter(panels.items()))])
    met = {name: _flows_met(record, x[0], whole) for name, x in panels.items()}
    shown = list(dict.fromkeys(flow for flows in met.values() for flow in flows))
    colors = dict(zip(shown, FLOW_COLORS, strict=False))
    with figure_style():
        rows, columns = panel_grid(len(panels))
        figure = Figure(figsize=figure_size(columns, 4.4 * rows))
        several = figure.subplots(rows, columns, squeeze=False).ravel()
        for flow, color in colors.items():
            told = ", ".join(in_math(x.text()) for x in flow.words)
            label = f"measured, {told}"
            several[0].plot([], [], ".", color=color, ms=stroke(9), label=label)
        if any(held[:, x[0]].any() for x in panels.values()):
            several[0].plot([], [], **HELD_LOOK, label="held still")
        for ax, (name, (_, *measured)) in zip(several, panels.items(), strict=True):
            flows = {flow: where for flow, where in met[name].items() if flow in colors}
            _forces_over_velocity(ax, flows, colors, *measured)
            ax.set_xlabel(name)
            ax.set_ylabel("force of the clay [N]" if whole else "force of the clay less b v [N]")
        add_legend(figure, several[0], ncols=2)
        set_title(several[0], *_scenario_parts(record.scenario))
    return figure


def _flows_met(record: Record, i: int, whole: bool = True) -> dict[Flow, np.ndarray]:
    """Samples in each flow of an axis that yields, those with the most samples first."""
    clay = record.scenario.clay
    assert clay is not None
    b = record.b[:, i] if whole else np.zeros(len(record.t))
    rows = np.stack((*clay.laws[i].flows_at(*record.p.T), b), axis=-1)
    some = np.flatnonzero((rows[:, 0] > 0.0) | (rows[:, 1] > 0.0))
    kinds, which = np.unique(rows[some], axis=0, return_inverse=True)
    met = {Flow(*x): some[which.ravel() == k] for k, x in enumerate(kinds.tolist())}
    return dict(sorted(met.items(), key=lambda x: -len(x[1])))


def _forces_over_velocity(
    ax: Axes,
    met: dict[Flow, np.ndarray],
    colors: Mapping[Flow, str],
    v: np.ndarray,
    force: np.ndarray,
    held: np.ndarray,
) -> None:
    """Draws measured forces, those of a handle that is held, and the laws."""
    for flow, where in met.items():
        some = _spread(where[~held[where]], MOST_DOTS)
        ax.plot(v[some], force[some], ".", color=colors[flow], ms=stroke(6), mew=0)
    some = _spread(np.flatnonzero(held), MOST_DOTS)
    ax.plot(v[some], force[some], **HELD_LOOK)
    label = "law of the clay"
    for flow, where in met.items():
        back = force[where].min() < -0.01 * flow.Fy
        x, y = _law_curve(flow, min(float(v[where].min()), 0.0), float(v[where].max()), back)
        ax.plot(x, y, color=VERMILION, ls="--", lw=stroke(1.3), label=label)
        label = "_"


def _law_curve(flow: Flow, low: float, high: float, back: bool) -> tuple[np.ndarray, np.ndarray]:
    """Velocities and forces of a law, and at rest the forces that it can hold."""
    share = np.linspace(0.0, 1.0, 200)[1:] ** 3  # close together where |v|^n bends
    up = share * high if high > 0.0 else np.zeros(0)
    down = share[::-1] * low if low < 0.0 else np.zeros(0)
    least = -flow.Fy if back or low < 0.0 else 0.0
    x = np.concatenate((down, (0.0, 0.0), up))
    return x, np.concatenate((flow.force(down), (least, flow.Fy), flow.force(up)))


def _spread(where: np.ndarray, most: int) -> np.ndarray:
    """At most so many of some indices, evenly."""
    return where[:: -(-len(where) // most) or 1]


def in_math(text: str) -> str:
    """A text on clay, its letters and units as formulas; the consistency K is not the gain.

    Args:
        text: such as "Fy = 2 N".
    """
    for plain, formula in _FORMULAS.items():
        text = text.replace(plain, formula)
    return text


_FORMULAS = {
    "Fy =": "F$_y$ =",
    "K =": "K$_c$ =",
    "k1 =": "k$_1$ =",
    "N.s/m": "N$\\cdot$s/m",
    "(m/s)^n": "(m/s)$^n$",
}


def _expected_speeds(ax: Axes, record: Record, axis: str) -> None:
    """Draws the expected steady speed over each stretch of the path in clay that yields."""
    i, label = AXES.index(axis), "expected, steady"
    pieces = record.stretches(axis)
    for piece in pieces if len(pieces) <= MOST_BORDERS else pieces[:3]:
        speed, x = record.expected_speed(axis, piece), 100.0 * record.p[piece, i]
        if speed is not None and math.isfinite(speed):
            look: Any = dict(color=VERMILION, ls="--", lw=stroke(1.4), label=label)
            ax.plot([x.min(), x.max()], [speed] * 2, **look)
            label = "_"


def _mark_held(ax: Axes, record: Record, i: int, y: np.ndarray) -> None:
    """Marks where clay that yields held the handle, on a curve over the position."""
    some = _spread(np.flatnonzero(record.held()[:, i]), MOST_DOTS)
    if len(some):
        look: Any = dict(color=ORANGE, ms=stroke(5), mew=0, zorder=4, label="held still")
        ax.plot(100.0 * record.p[some, i], y[some], "o", **look)


def _held_spans(record: Record, axis: str) -> list[tuple[float, float]]:
    """Times at which clay that yields held an axis, (begin, end) [s]."""
    end = float(record.t[-1])
    stops = [x for x in record.stops if axis in x.axis]
    return [(x.start, end if x.end is None else x.end) for x in stops]


def _viscous(s: Scenario) -> bool:
    return s.clay is None or s.clay.viscous


def _groove(record: Record) -> Groove:
    clay = record.scenario.clay
    assert clay is not None and clay.groove is not None
    return clay.groove


def _clay_along_both_axes(s: Scenario) -> bool:
    return s.clay is not None and s.clay.along == AXES[0] + AXES[1]


def main_axis(s: Scenario) -> str:
    """The axis along which the operator pushes most.

    Args:
        s: the scenario.
    """
    size = s.force
    if isinstance(s.muscle, Multisine):
        size = s.muscle.rms
    elif s.muscle is not None:
        x, y = np.abs(s.muscle(np.linspace(0.0, s.t_max, 501)) + s.force).max(axis=0)
        size = float(x), float(y)
    return "y" if abs(size[1]) > abs(size[0]) else "x"


def shown_axes(s: Scenario) -> str:
    """The axes whose velocity is drawn: "xy" where the clay changes along both, or the main one.

    Args:
        s: the scenario.
    """
    return "xy" if _clay_along_both_axes(s) else main_axis(s)


def _velocity(record: Record) -> Figure | None:
    s = record.scenario
    if s.muscle is not None and s.clay is None:
        return None
    return velocity_plot(record, shown_axes(s))


def _force(record: Record) -> Figure | None:
    s = record.scenario
    if s.muscle is not None or not _viscous(s):
        return maneuver_plot([record], main_axis(s))
    return None if _clay_along_both_axes(s) else force_ratio_plot(record, main_axis(s))


def _path(record: Record) -> Figure | None:
    """Where the handle may leave the line of one experiment: driven, or in clay of an image."""
    s = record.scenario
    if s.clay is None or record.ground is not None:  # which shows the path
        return None
    image = any(not isinstance(law, Profile) for law in s.clay.laws)
    return path_plot(record) if s.driven or image or _clay_along_both_axes(s) else None


def _force_position(record: Record) -> Figure | None:
    s = record.scenario
    some = s.muscle is not None or record.ground is not None
    return maneuver_plot([record], main_axis(s), "position") if some else None


def _force_velocity(record: Record) -> Figure | None:
    clay = record.scenario.clay
    told = clay is not None and clay.of_velocity and not clay.viscous
    return force_velocity_plot(record) if told and len(record.t) else None


def _ground(record: Record) -> Figure | None:
    return ground_plot(record) if record.ground is not None and len(record.t) else None


FIGURES: dict[str, Callable[[Record], Figure | None]] = {
    "velocity": _velocity,
    "force": _force,
    "path": _path,
    "force_position": _force_position,
    "force_velocity": _force_velocity,
    "ground": _ground,
}
"""File name of each figure of a run, and the function that draws it or returns None where the
figure does not apply. To add a plot to `hapticclay run`, add an entry."""


FIGURE_COLUMNS = {  # of a record, of which each figure shows some; other figures: all
    "velocity": ("p", "v"),
    "force": ("p", "v", "fh", "fe", "b"),
    "path": ("p",),
    "force_position": ("p", "fh", "fe"),
    "force_velocity": ("v", "fe"),
    "ground": ("p",),
}
COLUMN_UNITS = {"p": "m", "v": "m/s", "fh": "N", "fe": "N", "b": "N.s/m"}


def record_figures(record: Record) -> dict[str, shown.Figure]:
    """Returns every figure of FIGURES, to be drawn in any style; some may not apply to the run.

    Args:
        record: the run.
    """
    return {
        name: shown.Figure(
            functools.partial(draw, record), functools.partial(run_tables, record, name)
        )
        for name, draw in FIGURES.items()
    }


def run_tables(record: Record, name: str) -> dict[str, dict[str, Any]]:
    """Returns the numbers that a figure of FIGURES shows.

    Args:
        record: the run.
        name: of the figure.
    """
    samples: dict[str, Any] = {"time [s]": record.t}
    for part in FIGURE_COLUMNS.get(name, tuple(COLUMN_UNITS)):
        for i, axis in enumerate(AXES):
            word = axis if part == "p" else f"{part}_{axis}"
            samples[f"{word} [{COLUMN_UNITS[part]}]"] = getattr(record, part)[:, i]
    out = {"samples": samples}
    if name == "velocity":
        rows = [(axis, r[axis]) for axis in AXES for r in record.regions(axis)]
        out["stretches"] = {
            "axis": [axis for axis, _ in rows],
            "from [m]": [r["from_m"] for _, r in rows],
            "to [m]": [r["to_m"] for _, r in rows],
            "steady speed [m/s]": [r["steady_speed"] for _, r in rows],
            "expected speed [m/s]": [r["expected_speed"] for _, r in rows],
        }
    if name == "ground" and record.ground is not None:
        x, y = (0.5 * (e[1:] + e[:-1]) for e in _groove(record).edges)
        i, j = (a.ravel() for a in np.indices(record.ground.shape))
        out["cells"] = {"x [m]": x[i], "y [m]": y[j], "left [m]": record.ground.ravel()}
    return out


def figure_files(folder: Path) -> set[Path]:
    """Lists the files that figures of FIGURES, in any format, and their numbers have in a folder.

    Args:
        folder: of a record.
    """
    ends = [f".{kind}" for kind in (*shown.FORMATS, "csv")] + ["-stretches.csv", "-cells.csv"]
    return {path for name in FIGURES for end in ends if (path := folder / f"{name}{end}").exists()}


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
    rows, columns = panel_grid(len(axes))
    figure = Figure(figsize=figure_size(columns, 3.6 * rows))
    panels = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for name, ax in zip(axes, panels, strict=True):
        x = 100.0 * record.p[:, AXES.index(name)]
        low, high = float(x.min()), float(x.max())
        margin = 0.02 * ((high - low) or 1.0)
        shade_clay(ax, *_shades(record, name))
        ax.set(xlabel=f"position {name} [cm]", xlim=(low - margin, high + margin))
    return figure, panels


def _shades(record: Record, axis: str) -> tuple[list[float], list[float]]:
    """Borders [m] and force of a slow cut [N] along an axis; of a grid, as the path met them."""
    clay, i = record.scenario.clay, AXES.index(axis)
    if clay is None:
        return [], []
    law, spans = clay.laws[i], [getattr(block, axis) for block in clay.blocks]
    if spans and not law.some.any():
        return list(spans[0]), [0.0, 1.0, 0.0]
    if isinstance(law, Profile):
        seen = law.along == axis
        return list(law.edges) * seen, law.forces(*SHADED).ravel().tolist() * seen
    x, first = np.unique(record.p[:, i], return_index=True)
    if isinstance(law, Smooth) and len(x) > SHADES:
        near = np.searchsorted(x, np.linspace(x[0], x[-1], SHADES))
        x, first = x[near], first[near]
    x_met, y_met = record.p[first].T
    force = law.forces_at(x_met, y_met, *SHADED)
    change = np.flatnonzero(np.diff(force))
    return (0.5 * (x[change] + x[change + 1])).tolist(), force[[*change, -1]].tolist()


def _steps(ax: Axes, record: Record, i: int, law: Any, **look: Any) -> None:
    """Draws law(b) over each stretch of the path that had one b."""
    pieces = record.stretches(AXES[i])
    if len(pieces) > 20:  # an unstable run that chatters over a border
        pieces = pieces[:3]
    for piece in pieces:
        x, b = 100.0 * record.p[piece, i], record.b[piece, i]
        constant = np.ptp(b) == 0.0
        x, y = ([x.min(), x.max()], [law(float(b[0]))] * 2) if constant else (x, law(b))
        ax.plot(x, y, lw=stroke(1.4), zorder=3, **look)
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
        out += [in_math(x.text(MOST_TITLED)) for x in s.clay.words]
    printed = {"arm": PAPER, "servo": SERVO, "compensator": (PRINTED, PRINTED)}
    own = {"arm": s.arm, "servo": s.servo, "compensator": s.compensators}
    out += [f"another {name}" for name, part in own.items() if part != printed[name]]
    return out + ["T$_h$ in the loop"] * any(s.operators) + ["inertia shaped"] * s.inertia_shaping


def _finish(figure: Figure, panels: list[Axes], record: Record) -> None:
    add_legend(figure, panels[0])
    set_title(panels[0], *_scenario_parts(record.scenario))


class Panel(NamedTuple):
    """A running plot.

    Attributes:
        x: of its curves, shape (n,); NaN where they break.
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
            known = np.flatnonzero(np.isfinite(y))
            (line,) = ax.plot([], [], color=color, lw=stroke(1.4))
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
        viscous = _viscous(record.scenario)
        for ax in panels[: 2 if viscous else 1]:
            shade_clay(ax, *_shades(record, AXES[i]))
        for ax in panels[1:2]:
            _running_laws(ax, record, i)
        for ax in panels[2:]:
            shade_held(ax, _held_spans(record, AXES[i]))
        b = np.unique(record.b[:, i])
        for value in b[b > 0.0] if len(b) <= 4 and len(panels) > 1 and viscous else ():
            panels[1].axhline(value, color=VERMILION, ls="--", lw=stroke(0.9))
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
    second = Panel(x, np.array((0.0, 1.25 * top)), (where, share), "", share, ((ratio, BLUE),))
    told = "clay f$_e$ [N]"
    clay = r.scenario.clay
    if clay and not clay.of_velocity:
        second = Panel(x, np.append(fe, 0.0), (where, told), "", told, ((fe, BLUE),))
    elif clay and not clay.viscous:
        u, along = _over_velocity(r, i)
        over = speed
        if clay.isotropic:
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
    """Velocity and force of the clay, along the motion if it resists so; NaN in free air."""
    clay = r.scenario.clay
    assert clay is not None
    v, fe = along_motion(r.v, r.fe, i) if clay.isotropic else (r.v[:, i], r.fe[:, i])
    law = clay.laws[i]
    return np.where(law.some[law.index(*r.p.T)], v, np.nan), fe


def _running_laws(ax: Axes, r: Record, i: int) -> None:
    """Draws the laws of clay that yields over the velocity, where they hold for an axis alone."""
    clay = r.scenario.clay
    if (
        clay is None
        or clay.viscous
        or not clay.of_velocity
        or clay.grows
        or clay.smooth
        or clay.angle
        or (clay.isotropic and not np.array_equal(r.b[:, 0], r.b[:, 1]))
        or len(_flows_met(r, i)) > 4
    ):
        return
    v, fe = _over_velocity(r, i)
    for flow, where in _flows_met(r, i).items():
        back = fe[where].min() < -0.01 * flow.Fy
        x, y = _law_curve(flow, min(float(v[where].min()), 0.0), float(v[where].max()), back)
        ax.plot(x, y, color=VERMILION, ls="--", lw=stroke(0.9))


def _limits(values: np.ndarray) -> tuple[float, float]:
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    span = max(high - low, 1e-6)
    return low - 0.04 * span, high + 0.06 * span
