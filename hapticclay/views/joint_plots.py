"""Figures of what the joints of an arm carry."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..theory.joint_gains import JointLimits
from ..theory.joint_poses import OverPoses
from ..theory.joint_walls import WallLimit
from .style import BLACK, BLUE, VERMILION, figure_size, figure_style, set_title, stroke, unit_text

DECADES = 1.0  # that an axis shows beyond the present gains where a gain has no limit
ELEVATION, AZIMUTH = 22.0, -58.0  # [deg] of the view of a workspace


def limits_plot(found: JointLimits) -> Figure:
    """Plots the stable interval of each joint's gains, and the present ones in it."""
    n = len(found.names)
    with figure_style():
        figure = Figure(figsize=figure_size(2, 1.4 + 0.32 * n))
        stiff, damped = figure.subplots(1, 2, sharey=True)
        _intervals(stiff, found.stiffness, found.Kp, "Kp [N.m/rad]")
        _intervals(damped, found.damping, found.Kd, "Kd [N.m.s/rad]")
        for i, (high, buzz) in enumerate(zip(found.Kp[:, 1], found.Kp_buzz, strict=True)):
            if math.isfinite(buzz):
                stiff.annotate(
                    f"{buzz:.3g} Hz", (high, i), (4, 0), textcoords="offset points", va="center"
                )
        stiff.set_yticks(range(n), found.names)
        stiff.invert_yaxis()
        set_title(stiff, "stable gains (bars), present gains (dots)")
    return figure


def _intervals(ax: Axes, present: np.ndarray, limits: np.ndarray, label: str) -> None:
    """A bar from the least to the largest gain of each joint, a dot at the present one."""
    finite = np.concatenate([present[present > 0.0], limits[np.isfinite(limits) & (limits > 0.0)]])
    low = finite.min(initial=1.0) * 10.0**-DECADES
    high = finite.max(initial=1.0) * 10.0**DECADES
    for i, (a, b) in enumerate(np.clip(limits, low, high).tolist()):
        ax.barh(i, b - a, left=a, height=0.5, color=BLUE, alpha=0.35)
    inside = (limits[:, 0] <= present) & (present < limits[:, 1])
    ax.scatter(
        present, range(len(present)), color=[BLACK if x else VERMILION for x in inside], zorder=3
    )
    ax.set(xscale="log", xlim=(low, high), xlabel=unit_text(label))


def wall_plot(found: WallLimit) -> Figure:
    """Plots the largest stiffness over the damping of the wall."""
    with figure_style():
        figure = Figure(figsize=figure_size(1, 3.2))
        ax = figure.subplots()
        ax.plot(found.line_B, found.line_K, color=BLUE)
        ax.plot(found.B, found.K, "o", color=BLACK)
        ax.set(xlabel=unit_text("wall damping B [N.s/m]"), ylabel=unit_text("largest K [N/m]"))
        ax.set_ylim(0.0)
        set_title(ax, f"walls along {found.axis} that the arm renders")
    return figure


def poses_plot(found: OverPoses) -> Figure:
    """Plots the largest factor of all gains where the handle is, the worst pose marked."""
    with figure_style(axes_grid=False):
        figure = Figure(figsize=figure_size(2, 4.2))
        space = figure.add_subplot(1, 2, 1, projection="3d")
        points = space.scatter(*found.p.T, c=found.scale, cmap="viridis")
        space.scatter(*found.p[found.worst], s=90, facecolors="none", edgecolors=VERMILION)
        space.view_init(ELEVATION, AZIMUTH)
        space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
        figure.colorbar(points, ax=space, shrink=0.6, label="largest factor of all Kp")
        share = figure.add_subplot(1, 2, 2)
        share.hist(found.scale[np.isfinite(found.scale)], bins=24, color=BLUE, alpha=0.6)
        share.axvline(1.0, color=VERMILION, lw=stroke(1.2))
        share.set(xlabel="largest factor of all Kp", ylabel="poses")
        set_title(share, f"{len(found.q)} poses; the worst is circled")
    return figure
