"""Joints and handle of a run over time, and the path of the handle of an arm from a file."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..arms.joint_units import of_joints
from ..scene.joint_numbers import references, torque_limits, turning
from ..simulation.record import Record
from .captions import scenario_parts
from .palette import BLUE, GREEN, ORANGE, VERMILION
from .panels import add_legend, draw_path, label_axes, level, set_title
from .path_plots import clay_map
from .run_axes import spread
from .style import figure_size, figure_style, map_size, stroke

ROW = 1.05  # [inch] of height of a joint
SHOWN_LIMIT = 4.0  # times the largest torque up to which its limit is shown
FLAT = 1e-9  # spans below this are drawn as rest
MARGIN = 0.08  # of a path, around it
SHORT = 0.01  # [m] paths below this are shown in mm


@figure_style()
def joints_plot(record: Record) -> Figure:
    """Plots position, rate and torque of each joint over time.

    Dashed: the positions to which the law pulls; red: torque limits, if the torques come near them.
    """
    s, n = record.scenario, len(record.scenario.joints)
    figure = Figure(figsize=figure_size(2, 1.1 + ROW * n))
    grid = figure.subplots(n, 3, sharex=True, squeeze=False)
    pulled, limits = references(s), torque_limits(s)
    shown = spread(np.arange(len(record.t)))
    t = record.t[shown]
    for j, name in enumerate(s.joints):
        q, rate, torque = grid[j]
        for ax, values in ((q, record.q), (rate, record.qd), (torque, record.tau)):
            ax.plot(t, values[shown, j], color=BLUE, lw=stroke(1.1), label="run")
            ax.yaxis.set_major_locator(MaxNLocator(3))
        if pulled is not None:
            dash: Any = dict(color=VERMILION, ls="--", lw=stroke(1.0), label="reference")
            q.axhline(pulled[j], **dash)
        if limits[j] <= SHOWN_LIMIT * np.abs(record.tau[:, j]).max(initial=0.0):
            for side in (-limits[j], limits[j]):
                torque.axhline(side, color=ORANGE, ls=":", label="torque limit")
        level(rate)
        _widened(q, record.q[:, j])
        q.set_ylabel(name)
    for ax, title in zip(grid[0], ("position [rad]", "rate [rad/s]", "torque [N·m]"), strict=True):
        set_title(ax, of_joints(title, turning(s)), panel=True)
    for ax in grid[-1]:
        ax.set_xlabel("time [s]")
    figure.align_ylabels(grid[:, 0])
    add_legend(figure)
    return figure


def _widened(ax: Axes, values: np.ndarray) -> None:
    """Keeps the axis of a joint at rest from showing its rounding."""
    low, high = ax.get_ylim()
    if high - low < FLAT:
        middle = float(values.mean())
        ax.set_ylim(middle - 1e-3, middle + 1e-3)


@figure_style()
def handle_plot(record: Record) -> Figure:
    """Plots position, velocity and forces of the handle over time, a column for each axis."""
    axes = record.scenario.axes
    figure = Figure(figsize=figure_size(2, 5.4))
    grid = figure.subplots(3, len(axes), sharex=True, sharey="row", squeeze=False)
    shown = spread(np.arange(len(record.t)))
    t = record.t[shown]
    unit, scale = length_unit(np.ptp(record.p, axis=0).max(initial=0.0))
    for i, name in enumerate(axes):
        p, v, force = grid[:, i]
        p.plot(t, scale * record.p[shown, i], color=BLUE)
        v.plot(t, record.v[shown, i], color=BLUE)
        force.plot(t, record.fh[shown, i], color=GREEN, label="operator, f$_h$")
        if record.scenario.clay is not None:
            force.plot(t, record.fe[shown, i], color=BLUE, label="clay, f$_e$")
        force.set_xlabel("time [s]")
        for ax in (p, v, force):
            level(ax)
        set_title(p, f"{name} axis", panel=True)
    for ax, label in zip(
        grid[:, 0], (f"position [{unit}]", "velocity [m/s]", "force [N]"), strict=True
    ):
        ax.set_ylabel(label)
    figure.align_ylabels(grid[:, 0])
    add_legend(figure)
    return figure


def length_unit(span: float) -> tuple[str, float]:
    """Unit in which motion of a span [m] is shown, and how many of it a metre has."""
    return ("mm", 1e3) if span < SHORT else ("cm", 1e2)


@figure_style()
def arm_path_plot(record: Record) -> Figure:
    """Plots the path of the handle from above and, if it moves along three axes, from the side."""
    s, axes = record.scenario, record.scenario.axes
    views = [(0, 1), (0, 2)][: len(axes) - 1]
    low, high = record.p.min(axis=0), record.p.max(axis=0)
    half = (0.5 + MARGIN) * max(float((high - low).max()), 1e-6)
    middle = 0.5 * (low + high)
    unit, scale = length_unit(2.0 * half)
    wide = figure_size(2, 1.0)
    size = map_size(6.4, 1.0, 1.0) if len(views) == 1 else (wide[0], 0.42 * wide[0] + 0.6 * wide[1])
    figure = Figure(figsize=size)
    panels = figure.subplots(1, len(views), squeeze=False)[0]
    for ax, (i, j) in zip(panels, views, strict=True):
        corners = [scale * (middle[[i, j]] + sign * half) for sign in (-1.0, 1.0)]
        if s.clay and j == 1:
            clay_map(ax, s.clay, corners[0], corners[1], scale)
        draw_path(ax, scale * record.p[:, [i, j]], "handle")
        label_axes(ax, f"position {axes[i]} [{unit}]", f"position {axes[j]} [{unit}]")
        ax.set(aspect="equal", xlim=(corners[0][0], corners[1][0]))
        ax.set_ylim(corners[0][1], corners[1][1])
    add_legend(figure)
    set_title(panels[0], *scenario_parts(s))
    return figure
