"""Plots of a record, for paper and screen."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.textpath import TextPath

from ..model.constants import AXES, C_POLE
from ..model.scenario import Scenario
from ..model.signals import Signal
from ..simulation.record import Record
from ..theory import linear_loop
from .style import BLACK, BLUE, CLAY, GREEN, GREY, ORANGE, STYLE

TITLE = 9.0  # size of a title's type [points]
MARGIN = 0.9  # of a figure's width that its title has not: what stands left of the axes, and a little [inch]


def velocity_position(record: Record, axis: str = "x") -> Figure:
    """Velocity against position, the expected steady speeds beside it (Fig. 8, top; Fig. 10).

    Args:
        record: what to draw. axis: "x", "y", or "xy" for one panel each.
    """
    with matplotlib.rc_context(STYLE):
        figure, panels = _axes(record, axis)
        s = record.scenario
        for name, ax in zip(axis, panels, strict=True):
            i = AXES.index(name)
            ax.plot(100.0 * record.p[:, i], record.v[:, i], color=BLUE, label="measured")
            if s.operator is None and s.muscle is None:
                law = functools.partial(linear_loop.steady_speed, s.gain[i], s.force[i])
                _steps(ax, record, i, law, ORANGE, "expected, K f/(10 + K b)")
            ax.set_ylabel(f"velocity v$_{name}$ [m/s]")
            _limits(ax, record.v[:, i])
        _finish(figure, panels, record)
    return figure


def force_velocity(record: Record, axis: str = "x") -> Figure:
    """fe/v and fh/v against position along one axis, b and 10/K + b beside them (Fig. 8, bottom).

    Args:
        record: what to draw. axis: "x" or "y".
    """
    i = AXES.index(axis)
    with matplotlib.rc_context(STYLE):
        figure, panels = _axes(record, axis)
        ax = panels[0]
        x = 100.0 * record.p[:, i]
        ax.plot(x, record.ratio(record.fh)[:, i], color=GREEN, label="operator, f$_h$/v")
        ax.plot(x, record.ratio(record.fe)[:, i], color=BLUE, label="clay, f$_e$/v")
        own = C_POLE / record.scenario.gain[i] if record.scenario.gain[i] else 0.0
        if record.scenario.operator is None and record.scenario.muscle is None:
            _steps(ax, record, i, lambda b: own + b, BLACK, "10/K + b", ":")
        _steps(ax, record, i, lambda b: b, ORANGE, "b")
        ax.set_ylabel("force / velocity [N$\\cdot$s/m]")
        top = own + float(np.max(record.b[:, i], initial=0.0))
        ax.set_ylim(-0.04 * top, 1.35 * top)
        _finish(figure, panels, record)
    return figure


def path(record: Record) -> Figure:
    """The way of the handle over the clay (Figs. 7, 9)."""
    with matplotlib.rc_context(STYLE):
        p = 100.0 * record.p
        low, high = p.min(axis=0), p.max(axis=0)
        shape = float((high - low + 1.0)[1] / (high - low + 1.0)[0])
        figure = Figure(figsize=(6.4, min(max(6.4 * shape, 1.0) + 1.3, 6.4)))
        ax = figure.add_subplot()
        margin = 0.08 * max(float((high - low).max()), 0.1)
        low, high = low - margin, high + margin
        room = (high - low)[1] * (figure.get_figwidth() - MARGIN) / (figure.get_figheight() - 1.3)
        wider = max(
            0.0, 0.5 * (room - (high - low)[0])
        )  # the axes are as wide as the figure, and so is their title
        low[0], high[0] = low[0] - wider, high[0] + wider
        _clay_map(figure, ax, record, low, high)
        ax.plot(p[:, 0], p[:, 1], color=BLUE, label="handle")
        ax.plot(*p[0], "o", color=BLUE, ms=5, label="start")
        ax.plot(*p[-1], "s", color=BLUE, ms=5, label="end")
        ax.set(
            xlabel="position x [cm]",
            ylabel="position y [cm]",
            xlim=(low[0], high[0]),
            ylim=(low[1], high[1]),
        )
        ax.set_aspect("equal")
        ax.grid(False)
        figure.legend(loc="outside upper center", ncols=4)
        _title(figure, ax, _parts(record.scenario))
    return figure


def _clay_map(figure: Figure, ax: Axes, record: Record, low: Any, high: Any) -> None:
    """Colours the regions by the damping along x and y, as it is when the handle enters them [N.s/m]."""
    clay = record.scenario.clay
    if clay is None:
        return
    wide = [[-1e4], [1e4]]
    edges = [
        sorted(
            {100.0 * e for f in (clay.x, clay.y) if f.along == a for e in f.edges}
            | {wide[0][0], wide[1][0]}
        )
        for a in AXES
    ]
    top = max(max(f.values) for f in (clay.x, clay.y)) or 1.0
    for x0, x1 in zip(edges[0], edges[0][1:], strict=False):
        for y0, y1 in zip(edges[1], edges[1][1:], strict=False):
            at = {"x": 0.5 * (x0 + x1) / 100.0, "y": 0.5 * (y0 + y1) / 100.0}
            b = [f.values[int(np.searchsorted(f.edges, at[f.along]))] for f in (clay.x, clay.y)]
            ax.fill_between(
                [x0, x1],
                y0,
                y1,
                color=CLAY,
                alpha=0.15 + 0.85 * max(b) / top if max(b) else 0.0,
                lw=0,
            )
            left, right = max(x0, low[0]), min(x1, high[0])
            bottom, up = max(y0, low[1]), min(y1, high[1])
            if (
                right - left > 0.12 * (high[0] - low[0])
                and up - bottom > 0.08 * (high[1] - low[1])
                and max(b)
            ):
                ax.text(
                    right - 0.01 * (high[0] - low[0]), bottom + 0.01 * (high[1] - low[1]),
                    f"b = ({b[0]:g}, {b[1]:g})", ha="right", va="bottom", fontsize=8, color=GREY,
                )  # fmt: skip


def force_maneuver(records: Sequence[Record], axis: str = "x", against: str = "time") -> Figure:
    """The operator's force during a maneuver, one panel a record (Fig. 11).

    Args:
        records: what to draw. axis: "x" or "y". against: "time" or "position".
    """
    i = AXES.index(axis)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 0.8 + 2.3 * len(records)))
        panels = figure.subplots(len(records), 1, sharex=against == "time", squeeze=False)[:, 0]
        for ax, r in zip(panels, records, strict=True):
            where = r.t if against == "time" else 100.0 * r.p[:, i]
            ax.plot(where, r.fh[:, i], color=BLUE, lw=0.9, label="operator, f$_h$")
            if r.scenario.muscle is not None:
                muscle = Signal(
                    r.scenario.muscle
                )  # in pieces: of n samples it would hold n times its lines at once
                uh = np.concatenate(
                    [muscle(t)[:, i] for t in np.array_split(r.t, len(r.t) // 4096 + 1)]
                )
                ax.plot(
                    where,
                    r.scenario.force[i] + uh,
                    color=ORANGE,
                    lw=1.1,
                    ls="--",
                    label="muscle, u$_h$",
                )
            ax.set_ylabel(f"force along {axis} [N]")
            _title(figure, ax, [*_parts(r.scenario), r.outcome.code])
            if against != "time":
                ax.set_xlabel(f"position {axis} [cm]")
        panels[-1].set_xlabel("time [s]" if against == "time" else f"position {axis} [cm]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=5)
    return figure


def readings(records: dict[str, Record], axis: str = "x") -> Figure:
    """Velocity against position of several runs of one path, by name."""
    i = AXES.index(axis)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 3.6))
        ax = figure.add_subplot()
        for (name, r), color, style in zip(
            records.items(), (BLACK, GREEN, BLUE, ORANGE), ("-", "--", "-", "-."), strict=False
        ):
            ax.plot(100.0 * r.p[:, i], 1000.0 * r.v[:, i], color=color, ls=style, label=name)
        ax.set(xlabel=f"position {axis} [cm]", ylabel=f"velocity v$_{axis}$ [mm/s]")
        figure.legend(loc="outside upper center", ncols=5)
    return figure


def figures(record: Record) -> dict[str, Figure]:
    """The figures that say what there is to say of a run, by name of the file."""
    s = record.scenario
    if s.muscle is not None:
        axis = AXES[int(np.argmax(s.muscle.rms))]
        return {
            "force": force_maneuver([record], axis),
            "force_position": force_maneuver([record], axis, "position"),
        }
    if s.clay is not None and s.clay.x.along != s.clay.y.along:
        return {"velocity": velocity_position(record, "xy"), "path": path(record)}
    axis = "y" if abs(s.force[1]) > abs(s.force[0]) else "x"
    return {"velocity": velocity_position(record, axis), "force": force_velocity(record, axis)}


def _axes(record: Record, axes: str) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(6.4 if len(axes) == 1 else 9.6, 3.6))
    panels = list(figure.subplots(1, len(axes), squeeze=False)[0])
    clay = record.scenario.clay
    for name, ax in zip(axes, panels, strict=True):
        profile = (clay.x, clay.y)[AXES.index(name)] if clay else None
        ax.set_xlabel(f"position {name} [cm]")
        if profile and profile.along == name:
            edges = (-np.inf, *profile.edges, np.inf)
            top = max(profile.values)
            label = "clay"
            for low, high, b in zip(edges, edges[1:], profile.values, strict=False):
                if b > 0.0:
                    low, high = max(low, -1.0), min(high, 1.0)
                    ax.axvspan(
                        100.0 * low,
                        100.0 * high,
                        color=CLAY,
                        alpha=0.6 * b / top,
                        lw=0,
                        label=label,
                    )
                    label = "_"
    return figure, panels


def _steps(
    ax: Axes, record: Record, i: int, law: Any, color: str, label: str, style: str = "--"
) -> None:
    """The value of law(b) over the stretch of path that had each b."""
    pieces = record.stretches(AXES[i])
    if len(pieces) > 20:  # an unstable run that chatters over a border
        pieces = pieces[:3]
    for piece in pieces:
        x, b = 100.0 * record.p[piece, i], record.b[piece, i]
        if b[0] == b[-1]:
            y = law(float(b[0]))
            ax.plot(
                [x.min(), x.max()], [y, y], color=color, ls=style, lw=1.4, label=label, zorder=3
            )
        else:
            ax.plot(x, law(b), color=color, ls=style, lw=1.4, label=label, zorder=3)
        label = "_"


def _limits(ax: Axes, v: np.ndarray) -> None:
    low, high = min(0.0, float(v.min())), max(0.0, float(v.max()))
    span = (high - low) or 1.0
    ax.set_ylim(low - 0.04 * span, high + 0.12 * span)


def _parts(s: Scenario) -> list[str]:
    """What a title says of a scenario."""

    def pair(x: tuple[float, float]) -> str:
        return f"({x[0]:.3g}, {x[1]:.3g})"

    out = [f"{s.name}: K = {pair(s.gain)}"]
    if s.muscle is None:
        out.append(f"u$_h$ = {pair(s.force)} N")
    if s.clay:
        values = list(dict.fromkeys(v for f in (s.clay.x, s.clay.y) for v in f.values if v))
        out.append(f"b = {', '.join(f'{v:g}' for v in values) or '0'} N$\\cdot$s/m")
        out += [f"growing {g:g} a second" for f in (s.clay.x, s.clay.y) for g in f.growth if g][:1]
    return out + ["T$_h$ in the loop"] * bool(s.operator) + ["inertia shaped"] * s.shaping


def _title(figure: Figure, ax: Axes, parts: list[str]) -> None:
    """Puts a title over the axes, in as many lines as keep it within the figure."""
    room = 72.0 * (figure.get_figwidth() - MARGIN)
    lines = [parts[0]]
    for part in parts[1:]:
        more = f"{lines[-1]}, {part}"
        if TextPath((0.0, 0.0), more, size=TITLE).get_extents().width <= room:
            lines[-1] = more
        else:
            lines[-1] += ","
            lines.append(part)
    ax.set_title("\n".join(lines), fontsize=TITLE, loc="left", color=GREY)


def _finish(figure: Figure, panels: list[Axes], record: Record) -> None:
    for ax in panels:
        x = 100.0 * record.p[:, AXES.index(ax.get_xlabel().split()[1])]
        low, high = float(x.min()), float(x.max())
        margin = 0.02 * ((high - low) or 1.0)
        ax.set_xlim(low - margin, high + margin)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5)
    _title(figure, panels[0], _parts(record.scenario))
