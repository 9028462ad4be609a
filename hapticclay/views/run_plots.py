"""Velocity and force of a run over position and time."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ..model.compensator import PRINTED
from ..model.constants import AXES
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..theory import linear_loop
from .captions import finish, scenario_parts
from .run_axes import expected_speeds, held_spans, mark_held, position_axes, steps_of_law
from .style import (
    BLACK,
    BLUE,
    GREEN,
    VERMILION,
    add_legend,
    along_motion,
    figure_size,
    figure_style,
    set_title,
    shade_held,
    stroke,
)


def velocity_plot(record: Record, axis: str = "x") -> Figure:
    """Plots velocity over position, and the expected steady speeds (Fig. 8, top; Fig. 10)."""
    s = record.scenario
    with figure_style():
        figure, panels = position_axes(record, axis)
        for name, ax in zip(axis, panels, strict=True):
            i = AXES.index(name)
            v = record.v[:, i]
            ax.plot(100.0 * record.p[:, i], v, color=BLUE, label="measured")
            built_in = s.controller is None
            if s.clay and not s.clay.viscous:
                expected_speeds(ax, record, name)
                mark_held(ax, record, i, v)
            elif built_in and s.operators[i] is None and s.muscle is None and not s.rotated:
                c, servo = s.compensators[i], s.servo[i]
                law = functools.partial(
                    linear_loop.steady_speed, s.gain[i], s.force[i], compensator=c, servo=servo
                )
                printed = c == PRINTED and servo.numbers[0] == 1.0
                told = "expected, K f/(10 + K b)" if printed else "expected"
                steps_of_law(ax, record, i, law, color=VERMILION, ls="--", label=told)
            ax.set_ylabel(f"velocity v$_{name}$ [m/s]")
            low, high = min(0.0, float(v.min())), max(0.0, float(v.max()))
            span = (high - low) or 1.0
            ax.set_ylim(low - 0.04 * span, high + 0.12 * span)
        finish(figure, panels, record)
    return figure


def force_ratio_plot(record: Record, axis: str = "x") -> Figure:
    """Plots fe/v and fh/v over position, with b and 10/K + b (Fig. 8, bottom).

    In steady motion the printed compensator acts as a damper of 10/K, any other as a damper of 1/(K
    c), c the limit of s C G/K as s goes to 0. Without an integrator this line is omitted.
    """
    i, s = AXES.index(axis), record.scenario
    with figure_style():
        figure, panels = position_axes(record, axis)
        ax = panels[0]
        x = 100.0 * record.p[:, i]
        ax.plot(x, record.ratio(record.fh)[:, i], color=GREEN, label="operator, f$_h$/v")
        ax.plot(x, record.ratio(record.fe)[:, i], color=BLUE, label="clay, f$_e$/v")
        shown = _compensator_damper(s, i)
        own = shown / s.gain[i] if shown else 0.0
        if shown and s.operators[i] is None and s.muscle is None:
            told = f"{shown:.3g}/K + b"
            steps_of_law(ax, record, i, lambda b: own + b, color=BLACK, ls=":", label=told)
        steps_of_law(ax, record, i, lambda b: b, color=VERMILION, ls="--", label="b")
        ax.set_ylabel("force / velocity [N$\\cdot$s/m]")
        top = own + float(np.max(record.b[:, i], initial=0.0)) or 1.0
        ax.set_ylim(-0.04 * top, 1.35 * top)
        finish(figure, panels, record)
    return figure


def _compensator_damper(scenario: Scenario, i: int) -> float:
    """K times the steady damper of hand and compensator; 0 if there is none."""
    if not scenario.gain[i] or scenario.controller is not None:
        return 0.0
    num, den = (p.coef for p in linear_loop.reduced(scenario.compensators[i]).fraction)
    if den[0] != 0.0 or len(den) < 2:  # no integrator: the handle comes to rest
        return 0.0
    return float(den[1] / (num[0] * scenario.servo[i].numbers[0]))


def maneuver_plot(records: Sequence[Record], axis: str = "x", over: str = "time") -> Figure:
    """Plots the operator's force during a maneuver, a panel for each run (Fig. 11).

    In clay it also shows the force of the clay, and the times at which yielding clay held the
    handle. In clay that resists along the motion the forces are those along the motion.
    """
    i = AXES.index(axis)
    with figure_style():
        figure = Figure(figsize=figure_size(1, 0.8 + 2.3 * len(records)))
        panels = figure.subplots(len(records), 1, sharex=over == "time", squeeze=False)[:, 0]
        for ax, r in zip(panels, records, strict=True):
            where = r.t if over == "time" else 100.0 * r.p[:, i]
            clay = r.scenario.clay
            turned = clay is not None and clay.along_motion
            part = functools.partial(_along, r, i, turned)
            hand = BLUE
            if clay is not None:
                hand = GREEN
                ax.plot(where, part(r.fe), color=BLUE, lw=stroke(0.9), label="clay, f$_e$")
            if r.stops:
                if over == "time":
                    shade_held(ax, held_spans(r, axis))
                else:
                    mark_held(ax, r, i, part(r.fe))
            ax.plot(where, part(r.fh), color=hand, lw=stroke(0.9), label="operator, f$_h$")
            if r.scenario.muscle is not None:
                muscle = r.scenario.muscle
                pieces = np.array_split(r.t, len(r.t) // 4096 + 1)  # it takes (n, lines) of memory
                uh = np.array(r.scenario.force) + np.concatenate([muscle(t) for t in pieces])
                ax.plot(
                    where, part(uh), color=VERMILION, lw=stroke(1.1), ls="--", label="muscle, u$_h$"
                )
            ax.set_ylabel("force along the motion [N]" if turned else f"force along {axis} [N]")
            set_title(ax, *scenario_parts(r.scenario), r.outcome.code, panel=len(records) > 1)
            if over != "time" or ax is panels[-1]:
                ax.set_xlabel("time [s]" if over == "time" else f"position {axis} [cm]")
        add_legend(figure, panels[0])
    return figure


def _along(record: Record, i: int, turned: bool, force: np.ndarray) -> np.ndarray:
    """The force along the motion if the clay resists along it, else along an axis [N]."""
    return along_motion(record.v, force, i)[1] if turned else force[:, i]


def readings_plot(records: dict[str, Record], axis: str = "x") -> Figure:
    """Plots velocity over position of several runs along one path."""
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
