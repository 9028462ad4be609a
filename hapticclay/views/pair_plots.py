"""Figures of leaders and followers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arms.joint_units import of_joints
from ..theory.held_words import FREE
from ..theory.pair_boxes import PairHands
from ..theory.pair_maps import PairComparison, PairMap
from ..theory.pair_onset import LATEST
from ..theory.pair_ports import PairTransparency
from ..theory.pair_verdict import PairLimits
from .palette import BLACK, BLUE, CURVE_STYLES, MID_GREY, PALE_GREY, VERMILION
from .panels import add_legend, label_axes, plain_ticks, set_title, side_by_side, single
from .style import figure_size, figure_style, points, stroke

BEYOND = f"> {LATEST:g} s"  # the largest delay that is looked for
SAFE = (-1.2, 3.2)  # of the criterion that is shown
PER_JOINT = 0.3  # [inch] of height


@figure_style()
def limits_plot(found: PairLimits) -> Figure:
    """Plots what the other arm's torque is late by, and the friction that may be fed forward."""
    n = len(found.names)
    figure = Figure(figsize=figure_size(2, 1.8 + PER_JOINT * n))
    late, friction = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    _budget(late, found)
    finite = np.where(np.isfinite(found.slope), found.slope, 0.0)
    friction.barh(range(n), finite, height=0.5, color=BLUE, alpha=0.35)
    friction.set_axisbelow(True)
    over = found.law_slope > found.slope
    colors = [VERMILION if x else BLACK for x in over]
    if found.law_slope.any():
        friction.scatter(found.law_slope, range(n), color=colors, zorder=3)
    friction.set_yticks(range(n), found.names)
    friction.invert_yaxis()
    friction.set_xlim(0.0)
    label = of_joints("slope of the friction fed forward [N.m.s/rad]", found.turning)
    label_axes(friction, label)
    set_title(friction, "stable slope (bars), the law's (dots)", panel=True)
    return figure


def _budget(ax: Axes, found: PairLimits) -> None:
    """A bar of causes, and the largest delay of the link behind what is not the link's."""
    at = 0.0
    own = sum(x for cause, x in found.budget.items() if cause in ("hold (Ts/2)", "computation"))
    for (cause, seconds), (color, _) in zip(found.budget.items(), CURVE_STYLES, strict=False):
        ax.barh(0, 1e3 * seconds, left=1e3 * at, height=0.4, color=color, alpha=0.6, label=cause)
        at += seconds
    if math.isfinite(found.delay) and found.delay > 0.0:
        edge = 1e3 * (found.delay + own)
        ax.axvline(edge, color=VERMILION, lw=stroke(1.5), ls="--", label="unstable beyond")
    ax.set(ylim=(-0.6, 1.2), yticks=[])
    ax.set_axisbelow(True)
    ax.set_xlim(0.0)
    label_axes(ax, "lateness, one way [ms]")
    ax.legend(loc="upper left", fontsize=points(8), ncols=2)
    set_title(ax, "stable" if found.stable else "unstable", found.mode, panel=True)


@figure_style()
def map_plot(found: PairMap) -> Figure:
    """Plots the largest delay over the factor of all gains, unstable cells hatched."""
    figure, ax = single(4.2, 6.4)
    late = 1e3 * found.delays
    shown = np.minimum(1e3 * found.limits, 10.0 * late[-1])
    ax.fill_between(found.gains, shown, 10.0 * late[-1], color=PALE_GREY, zorder=0)
    ax.plot(found.gains, shown, color=BLUE, label="largest delay")
    gain, delay = np.meshgrid(found.gains, late, indexing="ij")
    look: Any = dict(ls="none", color=MID_GREY, ms=stroke(3.5), mew=stroke(0.8))
    for name, marker, cells in (
        ("unstable", "x", found.unstable > 0),
        ("stable", ".", found.unstable == 0),
    ):
        ax.plot(gain[cells], delay[cells], marker, label=name, **look)
    if found.present <= found.delays[-1]:
        ax.plot(1.0, 1e3 * found.present, "o", color=BLACK, label="the pair")
    ax.set(xscale="log", xlim=(found.gains[0], found.gains[-1]), ylim=(0.0, late[-1]))
    plain_ticks(ax)
    label_axes(ax, "factor of all Kp", "one-way delay of the link [ms]")
    add_legend(figure, 2, fontsize=points(9))
    set_title(ax, found.kind)
    return figure


@figure_style()
def comparison_plot(found: PairComparison) -> Figure:
    """Plots the largest delay of each architecture."""
    figure, ax = single(2.6)
    ax.set_axisbelow(True)
    finite = [1e3 * x.delay for x in found.limits if x and math.isfinite(x.delay)]
    top = 1.4 * max([*finite, 1.0])
    for i, limits in enumerate(found.limits):
        if limits is None:
            ax.text(0.01 * top, i, "refused", va="center", fontsize=points(9))
            continue
        delay = 1e3 * limits.delay
        ax.barh(i, min(delay, top), height=0.5, color=BLUE, alpha=0.6)
        text = BEYOND if math.isinf(delay) else f"{delay:.3g}"
        ax.text(min(delay, 0.9 * top), i, f" {text}", va="center", fontsize=points(9))
    present = next(x.present for x in found.limits if x is not None)
    ax.axvline(1e3 * present, color=BLACK, ls="--", lw=stroke(1.2))
    ax.set_yticks(range(len(found.kinds)), found.kinds)
    ax.invert_yaxis()
    ax.set_xlim(0.0, top)
    label_axes(ax, "largest one-way delay [ms]")
    free = any(x.startswith(FREE) for x in found.assumed)
    set_title(ax, "the dashed line is the link's delay", f"{FREE}: forces close no loop" * free)
    return figure


@figure_style()
def transparency_plot(found: PairTransparency) -> Figure:
    """Plots impedances felt, and how motion and force are followed, over frequency."""
    figure, (felt, follows, safe) = side_by_side(3, 3.4)
    curves = [("free motion", found.free), ("rigid wall", found.rigid)]
    if np.abs(found.contact).any():
        curves += [("in the contact", found.felt), ("the contact itself", found.contact)]
    for (name, curve), (color, dash) in zip(curves, CURVE_STYLES, strict=False):
        felt.plot(found.frequency, np.abs(curve), color=color, ls=dash, label=name)
    for name, curve, (color, dash) in zip(
        ("motion, free", "force, on a rigid wall"),
        (found.motion, found.force),
        CURVE_STYLES,
        strict=False,
    ):
        follows.plot(found.frequency, np.abs(curve), color=color, ls=dash, label=name)
    safe.plot(found.frequency, found.criterion, color=BLUE)
    safe.axhline(1.0, color=VERMILION, ls="--", lw=stroke(1.2))
    felt.set(xscale="log", yscale="log")
    follows.set(xscale="log", yscale="log")
    safe.set(xscale="log", ylim=SAFE)
    label_axes(felt, "frequency [Hz]", "impedance felt [N.s/m]")
    label_axes(follows, "frequency [Hz]", "follower over leader")
    label_axes(safe, "frequency [Hz]", "Llewellyn's criterion")
    for ax in (felt, follows):
        ax.legend(fontsize=points(8))
    set_title(felt, f"{found.kind}, along {found.axis}")
    set_title(safe, "absolutely stable: above 1", panel=True)
    return figure


@figure_style()
def hands_plot(found: PairHands) -> Figure:
    """Plots the largest delay over the mass of the hand, each member a dot."""
    figure, ax = single(3.6)
    finite = np.isfinite(found.delay)
    top = 1.2 * max(1e3 * found.delay[finite].max(initial=1.0), 1e3 * found.present)
    late = np.where(finite, 1e3 * found.delay, top)
    for name, color, which in (
        ("stable", BLUE, found.stable),
        ("unstable", VERMILION, ~found.stable),
    ):
        if which.any():
            ax.plot(found.hands[which, 0], late[which], ".", color=color, label=name)
    if not finite.all():
        ax.plot(found.hands[~finite, 0], late[~finite], "^", color=BLUE, label=BEYOND)
    ax.axhline(1e3 * found.present, color=BLACK, ls="--", lw=stroke(1.2), label="the link")
    ax.set_ylim(0.0, 1.05 * top)
    label_axes(ax, "mass of the hand [kg]", "largest one-way delay [ms]")
    add_legend(figure, 4, fontsize=points(9))
    set_title(ax, found.kind, "the worst hand counts")
    return figure
