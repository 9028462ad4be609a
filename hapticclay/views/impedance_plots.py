"""Figures of the impedance at the hand, and of the stable renderings of a device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..studies.impedance import MeasuredImpedance
from ..studies.mbk import ArmMBK, DeviceMBK
from ..studies.wall import Subject, as_wall
from ..theory.impedance import Impedance
from ..theory.mbk import PLANES
from .captions import hand_name, loop_parts
from .palette import BLACK, BLUE, GREEN, PALE_GREY, VERMILION
from .panels import (
    add_legend,
    hollow,
    label_axes,
    level,
    mark,
    plain_ticks,
    set_title,
    side_by_side,
    single,
    spans_decades,
    stacked,
)
from .style import figure_style, narrow, points, stroke

PART_UNITS = {"stiffness": "N/m", "damping": "N.s/m", "mass": "kg"}
LETTERS = {"K": "stiffness", "B": "damping", "M": "mass"}
NAMES = {"M": "virtual mass M", "B": "virtual damper B", "K": "spring K"}


@figure_style()
def impedance_plot(found: MeasuredImpedance) -> Figure:
    """Plots effective stiffness, damping and mass over frequency, measured and computed.

    Dashed lines are the rendered values. Empty panels are omitted.
    """
    m = found.measured
    f = np.geomspace(m.frequency[0], m.frequency[-1], 400)
    computed = found.over(f)
    figure, panels = parts_panels([computed])
    for part, ax in panels.items():
        line, dots = getattr(computed, part), getattr(m, part)
        values = np.concatenate((line, dots))
        if rendered := as_wall(found.subject).rendered(part):
            look: Any = dict(color=BLACK, lw=stroke(0.8), ls=(0, (5, 3)), label="rendered")
            ax.axhline(rendered, **look)
            values = np.append(values, rendered)
        ax.plot(f, line, color=BLUE, label="computed")
        ax.plot(m.frequency, dots, label="measured", **hollow(size=5.0))
        _from_zero(ax, values)
    add_legend(figure, 3)
    set_title(figure.axes[0], *_subject_parts(found.subject))
    return figure


def parts_panels(shown: Sequence[Impedance]) -> tuple[Figure, dict[str, Axes]]:
    """Panels of effective stiffness, damping and mass over frequency, where they are not empty."""
    units = {
        part: unit
        for part, unit in PART_UNITS.items()
        if any(np.isfinite(getattr(x, part)).any() for x in shown)
    }
    figure, axes = stacked(len(units), 1.0 + 1.7 * len(units))
    for ax, (part, unit) in zip(axes, units.items(), strict=True):
        label_axes(ax, y=f"{part} [{unit}]")
    _frequency_axis(
        axes[-1], min(x.frequency[0] for x in shown), max(x.frequency[-1] for x in shown)
    )
    return figure, dict(zip(units, axes, strict=True))


@figure_style()
def effective_parts_plot(found: Impedance) -> Figure:
    """Plots effective stiffness, damping and mass over frequency."""
    figure, panels = parts_panels([found])
    for part, ax in panels.items():
        ax.plot(found.frequency, getattr(found, part), color=BLUE)
    set_title(figure.axes[0], "impedance that the hand feels")
    return figure


@figure_style()
def transparency_bode_plot(found: MeasuredImpedance) -> Figure:
    """Plots fe/fh and the impedance ratio Z/Ze over frequency, measured and computed."""
    m = found.measured
    f = np.geomspace(m.frequency[0], m.frequency[-1], 400)
    computed = found.over(f)
    curves = [("f$_e$/f$_h$", m.transparency, computed.transparency, BLUE, "-", "o")]
    if np.any(computed.rendered):
        curves.append(("Z/Z$_e$", m.ratio, computed.ratio, VERMILION, "--", "s"))
    figure, (size, phase) = stacked(2, 4.6)
    level(size, 1.0)
    level(phase)
    for name, dots, line, color, dash, marker in curves:
        look = hollow(color, marker, 5.0)
        size.plot(f, np.abs(line), color=color, ls=dash, label=f"{name}, computed")
        size.plot(m.frequency, np.abs(dots), label=f"{name}, measured", **look)
        angle = np.degrees(np.unwrap(np.angle(line)))
        near = np.interp(np.log(m.frequency), np.log(f), angle)
        phase.plot(f, angle, color=color, ls=dash)
        measured = np.degrees(np.angle(dots))
        phase.plot(m.frequency, measured + 360.0 * np.round((near - measured) / 360.0), **look)
    values = np.concatenate([[1.0], *(np.abs(x) for _, a, b, *_ in curves for x in (a, b))])
    if spans_decades(values[np.isfinite(values)]):
        size.set_yscale("log")
    else:
        _from_zero(size, values)
    size.set_ylabel("magnitude")
    phase.set_ylabel("phase [degrees]")
    _frequency_axis(phase, f[0], f[-1])
    add_legend(figure, 2 if narrow() else 4)
    set_title(size, *_subject_parts(found.subject))
    return figure


@figure_style()
def mbk_plot(found: DeviceMBK) -> Figure:
    """Plots where virtual mass, damper and spring are stable over three planes, with runs."""
    figure, axes = side_by_side(3, 3.4 if narrow() else 3.6)
    for ax, (plane, region) in zip(axes, found.regions.items(), strict=True):
        across, up = PLANES[plane]
        high = np.where(np.isfinite(region.high), region.high, np.nan)
        log = plane == "mass-stiffness"
        low = np.maximum(region.low, 1e-9) if log else region.low
        ax.fill_between(region.x, low, high, color=BLUE, alpha=0.15, lw=0.0, label="stable")
        ax.plot(region.x, high, color=BLUE, label="exact border")
        if up == "B":
            ax.plot(region.x, low, color=BLUE)
        runs = [(b.x, b.y) for b in found.found[plane]]
        mark(ax, runs, label="border by runs", **hollow(VERMILION, size=5.0))
        label_axes(ax, *(f"{NAMES[x]} [{PART_UNITS[LETTERS[x]]}]" for x in (across, up)))
        if log:
            ax.set(yscale="log", ylim=(2e-4 * np.nanmax(high), 2.0 * np.nanmax(high)))
            plain_ticks(ax)
        elif up == "K":
            ax.set_ylim(0.0, None)
        if across == "M":
            ax.axvline(0.0, color=BLACK, lw=stroke(0.8))
        third = ({*LETTERS} - {across, up}).pop()
        fixed = f"{third} = {getattr(region.wall, third):g} {PART_UNITS[LETTERS[third]]}"
        set_title(ax, fixed, panel=True)
    add_legend(figure, 3)
    return figure


@figure_style()
def dynamic_range_plot(found: DeviceMBK) -> Figure:
    """Plots |Z| of the free device and of its stiffest stable wall over frequency."""
    r, w = found.range, found.range.stiffest
    f = r.omega / (2.0 * math.pi)
    figure, ax = single(3.6)
    ax.fill_between(f, r.free, r.most, color=PALE_GREY, lw=0.0)
    stiffest = f"stiffest wall, K = {1e-3 * w.K:.3g} kN/m, B = {w.B:.3g} N.s/m"
    ax.plot(f, r.most, color=VERMILION, ls="--", label=stiffest)
    ax.plot(f, r.free, color=BLUE, label="free device")
    ax.plot(f, r.least, color=GREEN, ls="-.", label="least stable virtual mass")
    ax.set_yscale("log")
    label_axes(ax, y="|Z| [N.s/m]")
    _frequency_axis(ax, f[0], f[-1])
    i = len(f) // 2
    look: Any = dict(ha="center", va="center", fontsize=points(9.0), color=BLACK)
    ax.text(f[i], math.sqrt(r.free[i] * r.most[i]), f"range {r.mean:.0f} dB in the mean", **look)
    add_legend(figure, 1)
    return figure


@figure_style()
def least_mass_plot(found: ArmMBK) -> Figure:
    """Plots the least virtual mass that the arm renders over its damper, with runs."""
    loop = found.loop
    timed = loop.Ts is not None or loop.delay > 0.0
    every = "worst hand tried of the box" if timed else "every hand of the box, exact"
    figure, ax = single(4.0)
    absent = []
    for (M, B), color, dash, name in (
        (found.worst, VERMILION, "--", every),
        (found.nominal, BLUE, "-", f"{hand_name(loop.operator)}, exact"),
    ):
        exists = np.isfinite(M) & (M > 0.0)
        if np.any(exists):
            ax.plot(B[exists], M[exists], color=color, ls=dash, label=name)
        else:
            absent.append(f"{name.partition(',')[0]}: every mass is stable")
    runs = [(r.x, r.y) for r in found.found]
    mark(ax, runs, label="border by runs", **hollow(size=5.0))
    ax.set(xscale="log", yscale="log")
    label_axes(ax, "virtual damper B [N.s/m]", "least virtual mass M [kg]")
    plain_ticks(ax)
    for text in absent:  # in the legend, without a mark
        ax.plot([], [], ls="none", label=text)
    add_legend(figure, 1 if narrow() else 3)
    parts = loop_parts(loop, "axis", "Ts")
    set_title(ax, f"arm, {parts[0]}", *parts[1:], "stable above and to the right")
    return figure


def _subject_parts(subject: Subject) -> list[str]:
    """Phrases that describe a wall or a loop in a title."""
    return as_wall(subject).felt_phrases(hand_name(subject.operator))


def _from_zero(ax: Axes, y: np.ndarray) -> None:
    """A linear scale that begins at 0, or shows it."""
    if np.nanmin(y) >= 0.0:
        ax.set_ylim(0.0, 1.1 * np.nanmax(y[np.isfinite(y)]))
    else:
        level(ax)


def _frequency_axis(ax: Axes, low: float, high: float) -> None:
    ax.set(xscale="log", xlabel="frequency [Hz]", xlim=(low / 1.05, high * 1.05))
    plain_ticks(ax)
