"""Velocity and force of a run over position and time."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..model.compensator import PRINTED
from ..model.constants import AXES
from ..simulation.record import Record
from ..theory import linear_loop
from .captions import scenario_parts
from .motion import resolved
from .palette import BLACK, BLUE, GREEN, VERMILION
from .panels import add_legend, curve_look, set_title, shade_held, single, stacked
from .run_axes import draw_stretches, held_spans, mark_held, position_axes
from .style import figure_style, stroke

EXPECTED = {"color": VERMILION, "ls": "--"}


@figure_style()
def velocity_plot(record: Record, axis: str = "x") -> Figure:
    """Plots velocity over position, and the expected steady speeds (Fig. 8, top; Fig. 10)."""
    s = record.scenario
    figure, panels = position_axes(record, axis)
    for name, ax in zip(axis, panels, strict=True):
        i = AXES.index(name)
        v = record.v[:, i]
        ax.plot(100.0 * record.p[:, i], v, color=BLUE, label="measured")
        if s.clay and not s.clay.viscous:
            steady = functools.partial(record.expected_speed, name)
            draw_stretches(ax, record, i, steady, label="expected, steady", **EXPECTED)
            mark_held(ax, record, i, v)
        elif not (s.controller or s.operators[i] or s.muscle or s.rotated):
            c, servo = s.compensators[i], s.servo[i]
            law = functools.partial(
                linear_loop.steady_speed, s.gain[i], s.force[i], compensator=c, servo=servo
            )
            printed = c == PRINTED and servo.numbers[0] == 1.0
            label = "expected, K f/(10 + K b)" if printed else "expected"
            expected = functools.partial(_from_damping, record, i, law)
            draw_stretches(ax, record, i, expected, label=label, **EXPECTED)
        ax.set_ylabel(f"velocity v$_{name}$ [m/s]")
        low, high = min(0.0, float(v.min())), max(0.0, float(v.max()))
        span = (high - low) or 1.0
        ax.set_ylim(low - 0.04 * span, high + 0.12 * span)
    add_legend(figure)
    set_title(panels[0], *scenario_parts(s))
    return figure


@figure_style()
def force_ratio_plot(record: Record, axis: str = "x") -> Figure:
    """Plots fe/v and fh/v over position, with b and 10/K + b (Fig. 8, bottom).

    In steady motion the printed compensator acts as a damper of 10/K, any other as a damper of 1/(K
    c), c the limit of s C G/K as s goes to 0. Without an integrator this line is omitted.
    """
    i, s = AXES.index(axis), record.scenario
    figure, (ax,) = position_axes(record, axis)
    x = 100.0 * record.p[:, i]
    ax.plot(x, record.ratio(record.fh)[:, i], color=GREEN, label="operator, f$_h$/v")
    ax.plot(x, record.ratio(record.fe)[:, i], color=BLUE, label="clay, f$_e$/v")
    damper = 0.0  # steady damper of compensator and hand
    if s.controller is None:
        damper = linear_loop.steady_damper(s.gain[i], s.compensators[i], s.servo[i])
    damper = damper if math.isfinite(damper) else 0.0
    if damper and s.operators[i] is None and s.muscle is None:
        total = functools.partial(_from_damping, record, i, lambda b: damper + b)
        label = f"{damper * s.gain[i]:.3g}/K + b"
        draw_stretches(ax, record, i, total, color=BLACK, ls=":", label=label)
    draw_stretches(ax, record, i, lambda piece: record.b[piece, i], label="b", **EXPECTED)
    ax.set_ylabel("force / velocity [N·s/m]")
    top = damper + float(np.max(record.b[:, i], initial=0.0)) or 1.0
    ax.set_ylim(-0.04 * top, 1.35 * top)
    add_legend(figure)
    set_title(ax, *scenario_parts(s))
    return figure


def _from_damping(record: Record, i: int, law: Callable[..., Any], piece: np.ndarray) -> Any:
    """A law of the clay's damping over a stretch of the path."""
    return law(record.b[piece, i])


@figure_style()
def maneuver_plot(records: Sequence[Record], axis: str = "x", over: str = "time") -> Figure:
    """Plots the operator's force during a maneuver, a panel for each run (Fig. 11).

    In clay it also shows the force of the clay, and the times at which yielding clay held the
    handle. In clay that resists along the motion the forces are those along the motion.
    """
    i, in_time = AXES.index(axis), over == "time"
    figure, panels = stacked(len(records), 0.8 + 2.3 * len(records), sharex=in_time)
    for ax, r in zip(panels, records, strict=True):
        s, where = r.scenario, r.t if in_time else 100.0 * r.p[:, i]

        def part(force: np.ndarray, r: Record = r) -> np.ndarray:
            return resolved(r.scenario.clay, r.v, force, i)[1]

        if s.clay is not None:
            ax.plot(where, part(r.fe), color=BLUE, lw=stroke(0.9), label="clay, f$_e$")
        if r.stops and in_time:
            shade_held(ax, held_spans(r, axis))
        elif r.stops:
            mark_held(ax, r, i, part(r.fe))
        hand = BLUE if s.clay is None else GREEN
        ax.plot(where, part(r.fh), color=hand, lw=stroke(0.9), label="operator, f$_h$")
        if s.muscle is not None:
            pieces = np.array_split(r.t, len(r.t) // 4096 + 1)  # it takes (n, lines) of memory
            uh = part(np.array(s.force) + np.concatenate([s.muscle(t) for t in pieces]))
            ax.plot(where, uh, color=VERMILION, lw=stroke(1.1), ls="--", label="muscle, u$_h$")
        turned = s.clay is not None and s.clay.along_motion
        ax.set_ylabel(f"force along {'the motion' if turned else axis} [N]")
        set_title(ax, *scenario_parts(s), r.outcome.code, panel=len(records) > 1)
        if not in_time or ax is panels[-1]:
            ax.set_xlabel("time [s]" if in_time else f"position {axis} [cm]")
    add_legend(figure)
    return figure


@figure_style()
def readings_plot(records: dict[str, Record], axis: str = "x") -> Figure:
    """Plots velocity over position of several runs along one path."""
    i = AXES.index(axis)
    figure, ax = single(3.6)
    for k, (name, r) in enumerate(records.items()):
        ax.plot(100.0 * r.p[:, i], 1000.0 * r.v[:, i], label=name, **curve_look(k))
    ax.set(xlabel=f"position {axis} [cm]", ylabel=f"velocity v$_{axis}$ [mm/s]")
    add_legend(figure)
    return figure
