"""Figures of what the joints of an arm carry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..arms.joint_units import of_joints
from ..theory.fed_friction import FrictionCycle
from ..theory.joint_gains import JointLimits
from ..theory.joint_poses import OverPoses
from ..theory.joint_walls import WallLimit
from .palette import BLACK, BLUE, LIGHT_GREY, VERMILION
from .panels import curve_look, hollow, label_axes, level, set_title, single
from .style import figure_size, figure_style, points, stroke

DECADES = 1.0  # that an axis shows beyond the gains, where one has no limit
ELEVATION, AZIMUTH = 22.0, -58.0  # [deg] of the view of a workspace
SPREAD = 1e-3  # share by which a histogram exceeds its values, which may all be one
PER_JOINT = 0.32  # [inch] of height


@figure_style()
def limits_plot(found: JointLimits) -> Figure:
    """Plots the stable interval of each joint's gains, and the present ones in it."""
    n = len(found.names)
    figure = Figure(figsize=figure_size(2, 1.4 + PER_JOINT * n))
    stiff, damped = figure.subplots(1, 2, sharey=True)
    _intervals(stiff, found.stiffness, found.Kp, of_joints("Kp [N.m/rad]", found.turning))
    _intervals(damped, found.damping, found.Kd, of_joints("Kd [N.m.s/rad]", found.turning))
    for i, (high, buzz) in enumerate(zip(found.Kp[:, 1], found.Kp_buzz, strict=True)):
        if math.isfinite(buzz):
            text = f" {buzz:.3g} Hz"
            stiff.text(high, i, text, va="center", fontsize=points(8.0))
    stiff.set_yticks(range(n), found.names)
    stiff.invert_yaxis()
    set_title(stiff, "stable gains (bars), present gains (dots), frequency beyond them")
    return figure


def _intervals(ax: Axes, present: np.ndarray, limits: np.ndarray, label: str) -> None:
    """A bar from the least to the largest gain of each joint, a dot at the present one."""
    finite = np.concatenate([present[present > 0.0], limits[np.isfinite(limits) & (limits > 0.0)]])
    low = finite.min(initial=1e3) * 10.0**-DECADES
    high = finite.max(initial=1e-3) * 10.0**DECADES
    for i, (a, b) in enumerate(np.clip(limits, low, high).tolist()):
        ax.barh(i, b - a, left=a, height=0.5, color=BLUE, alpha=0.35)
    inside = (limits[:, 0] <= present) & (present < limits[:, 1])
    colors = [BLACK if x else VERMILION for x in inside]
    ax.scatter(np.maximum(present, low), range(len(present)), color=colors, zorder=3)
    ax.set(xscale="log", xlim=(low, high))
    label_axes(ax, label)


@figure_style()
def wall_plot(found: WallLimit) -> Figure:
    """Plots the largest stiffness over the damping of the wall."""
    figure, ax = single(3.2)
    ax.plot(found.line_B, found.line_K, color=BLUE)
    ax.plot(found.B, found.K, "o", color=BLACK)
    ax.set_ylim(0.0)
    label_axes(ax, "wall damping B [N.s/m]", "largest stable K [N/m]")
    set_title(ax, f"walls along {found.axis} at the handle", "the dot is the wall asked for")
    return figure


@figure_style()
def friction_plot(found: FrictionCycle) -> Figure:
    """Plots how motion of each joint grows or decays over its largest rate; cycles are dots."""
    figure, ax = single(3.2)
    growth = found.line_growth
    known = growth[np.isfinite(growth)]
    most = known.max(initial=0.0) or np.abs(known).max(initial=1.0)
    for j, name in enumerate(found.names):
        if np.isfinite(growth[j]).any():
            ax.plot(found.line_rate[j], growth[j], **curve_look(j), label=name)
    rates = 2.0 * math.pi * found.first_frequency * found.first_amplitude
    rates = np.where(np.isnan(rates), found.rate, rates)  # of a drift
    for kind, rate in zip(found.kind, rates, strict=True):
        face: dict[str, Any] = {} if kind == "threshold" else {"mfc": BLACK}
        ax.plot(rate, 0.0, **(hollow(BLACK, size=5.0) | face))
    level(ax)
    ends = found.line_rate.min(), found.line_rate.max()
    ax.set(xscale="log", xlim=ends, ylim=(-1.5 * most, 1.2 * most))
    label = of_joints("largest rate of the joint [rad/s]", found.turning)
    label_axes(ax, label, "growth [1/s]")
    if ax.get_legend_handles_labels()[0]:
        ax.legend()
    set_title(
        ax, "motion under friction fed forward", "full dots: what it tends to; open: thresholds"
    )
    return figure


@figure_style(axes_grid=False)
def poses_plot(found: OverPoses) -> Figure:
    """Plots the largest factor of all gains where the handle is, the worst pose marked.

    Poses without one are grey; if there is none anywhere, the radius takes its place.
    """
    values, label = found.scale, "largest factor of all Kp"
    if not np.isfinite(values).any():
        values, label = found.radius, "radius: below 1 the loop is stable"
    known = np.isfinite(values)
    figure = Figure(figsize=figure_size(2, 4.0))
    left, right = figure.add_gridspec(1, 2, width_ratios=(1.3, 1.0))
    space = figure.add_subplot(left, projection="3d")
    if not known.all():
        space.scatter(*found.p[~known].T, color=LIGHT_GREY)
    marks = space.scatter(*found.p[known].T, c=values[known], cmap="viridis")  # type: ignore[misc]
    space.scatter(*found.p[found.worst], s=90, facecolors="none", edgecolors=VERMILION)
    space.view_init(ELEVATION, AZIMUTH)
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    for axis in (space.xaxis, space.yaxis, space.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    figure.colorbar(marks, ax=space, shrink=0.6, pad=0.16, label=label)
    share = figure.add_subplot(right)
    ends = values[known].min() * (1.0 - SPREAD), values[known].max() * (1.0 + SPREAD)
    share.hist(values[known], bins=24, range=ends, color=BLUE, alpha=0.6)
    share.axvline(1.0, color=VERMILION, lw=stroke(1.2))
    share.set(xlabel=label, ylabel="poses")
    set_title(share, f"{len(found.q)} poses", "the worst is circled")
    return figure
