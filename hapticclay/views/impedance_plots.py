"""Figures of the impedance at the hand, and of the stable renderings of a device."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..studies.impedance import MeasuredImpedance
from ..studies.mbk import ArmMBK, Border, DeviceMBK
from ..studies.wall import Subject, as_wall
from ..theory.mbk import PLANES
from .style import (
    BLACK,
    BLUE,
    GREEN,
    LOG_SPAN,
    MID_GREY,
    PALE_GREY,
    VERMILION,
    add_legend,
    figure_size,
    figure_style,
    hand_name,
    narrow,
    plain_ticks,
    points,
    set_title,
    stroke,
    unit_text,
)

FINE = 400  # points of a computed line
FREQUENCY = "frequency [Hz]"
PART_LABELS = {"M": "virtual mass M [kg]", "B": "virtual damper B [N.s/m]", "K": "spring K [N/m]"}


def impedance_plot(found: MeasuredImpedance) -> Figure:
    """Plots effective stiffness, damping and mass over frequency, measured and computed.

    Thin lines are the rendered values. Empty panels are omitted.
    """
    m = found.measured
    fine = np.geomspace(m.frequency[0], m.frequency[-1], FINE)
    line = found.over(fine)
    panels = [
        ("stiffness", "stiffness [N/m]", m.stiffness, line.stiffness),
        ("damping", "damping [N.s/m]", m.damping, line.damping),
        ("mass", "mass [kg]", m.mass, line.mass),
    ]
    shown = [x for x in panels if np.any(np.isfinite(x[3]))]
    with figure_style():
        figure = Figure(figsize=figure_size(1, 1.0 + 1.7 * len(shown)))
        axes = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (name, label, dots, curve) in zip(axes, shown, strict=True):
            value = as_wall(found.subject).rendered(name)
            if value:
                look: Any = dict(color=BLACK, lw=stroke(0.8), ls=(0, (5, 3)), label="rendered")
                ax.axhline(value, **look)
            ax.plot(fine, curve, color=BLUE, label="computed")
            ax.plot(m.frequency, dots, label="measured", **_dots())
            _scale(ax, np.concatenate((curve, dots)), value, log=False)
            ax.set(xscale="log", ylabel=unit_text(label))
        _frequency_axis(axes[-1], fine)
        figure.align_ylabels(list(axes))
        labelled = max(axes, key=lambda ax: len(ax.get_legend_handles_labels()[1]))
        add_legend(figure, labelled, 3)
        set_title(axes[0], *_subject_name(found.subject))
    return figure


def transparency_bode_plot(found: MeasuredImpedance) -> Figure:
    """Plots fe/fh and the impedance ratio Z/Ze over frequency, measured and computed."""
    m = found.measured
    fine = np.geomspace(m.frequency[0], m.frequency[-1], FINE)
    line = found.over(fine)
    curves = [("f$_e$/f$_h$", m.transparency, line.transparency, BLUE, "-", "o")]
    if np.any(line.rendered):
        curves.append(("Z/Z$_e$", m.ratio, line.ratio, VERMILION, "--", "s"))
    with figure_style():
        figure = Figure(figsize=figure_size(1, 4.6))
        size, phase = figure.subplots(2, 1, sharex=True)
        size.axhline(1.0, color=BLACK, lw=stroke(0.8))
        phase.axhline(0.0, color=BLACK, lw=stroke(0.8))
        for name, dots, curve, color, style, mark in curves:
            size.plot(fine, np.abs(curve), color=color, ls=style, label=f"{name}, computed")
            look = _dots(color, mark)
            size.plot(m.frequency, np.abs(dots), label=f"{name}, measured", **look)
            angle = np.degrees(np.unwrap(np.angle(curve)))
            turned = np.interp(np.log(m.frequency), np.log(fine), angle)
            own = np.degrees(np.angle(dots))
            own += 360.0 * np.round((turned - own) / 360.0)
            phase.plot(fine, angle, color=color, ls=style)
            phase.plot(m.frequency, own, **look)
        _scale(size, np.concatenate([np.abs(x) for _, a, b, *_ in curves for x in (a, b)]), 1.0)
        size.set(xscale="log", ylabel="magnitude")
        phase.set(ylabel="phase [degrees]")
        _frequency_axis(phase, fine)
        figure.align_ylabels([size, phase])
        add_legend(figure, size, 4 if not narrow() else 2)
        set_title(size, *_subject_name(found.subject))
    return figure


def mbk_plot(found: DeviceMBK) -> Figure:
    """Plots where virtual mass, damper and spring are stable over three planes, with runs."""
    with figure_style():
        rows, columns = (3, 1) if narrow() else (1, 3)
        figure = Figure(figsize=figure_size(2, 10.2 if narrow() else 3.6))
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for ax, (plane, region) in zip(axes, found.regions.items(), strict=True):
            across, up = PLANES[plane]
            high = np.where(np.isfinite(region.high), region.high, np.nan)
            log = plane == "mass-stiffness"
            low = np.maximum(region.low, 1e-9) if log else region.low
            ax.fill_between(region.x, low, high, color=BLUE, alpha=0.15, lw=0.0, label="stable")
            ax.plot(region.x, high, color=BLUE, label="exact border")
            if up == "B":
                ax.plot(region.x, low, color=BLUE)
            _border_dots(ax, found.found[plane])
            ax.set(xlabel=unit_text(PART_LABELS[across]), ylabel=unit_text(PART_LABELS[up]))
            if log:
                ax.set(yscale="log", ylim=(2e-4 * np.nanmax(high), 2.0 * np.nanmax(high)))
                plain_ticks(ax.yaxis)
            elif up == "K":
                ax.set_ylim(0.0, None)
            if across == "M":
                ax.axvline(0.0, color=BLACK, lw=stroke(0.8))
            third = ({"K", "B", "M"} - {across, up}).pop()
            unit = {"K": "N/m", "B": "N.s/m", "M": "kg"}[third]
            kept = getattr(region.wall, third)
            ax.set_title(unit_text(f"{third} = {kept:g} {unit}"), loc="left", fontsize=points(9.0))
        add_legend(figure, axes[0], 3)
    return figure


def dynamic_range_plot(found: DeviceMBK) -> Figure:
    """Plots |Z| of the free device and of its stiffest stable wall over frequency."""
    r = found.range
    f = r.omega / (2.0 * math.pi)
    with figure_style():
        figure = Figure(figsize=figure_size(1, 3.6))
        ax = figure.add_subplot()
        ax.fill_between(f, r.free, r.most, color=PALE_GREY, lw=0.0)
        w = r.stiffest
        text = f"stiffest wall, K = {1e-3 * w.K:.3g} kN/m, B = {w.B:.3g} N.s/m"
        ax.plot(f, r.most, color=VERMILION, ls="--", label=unit_text(text))
        ax.plot(f, r.free, color=BLUE, label="free device")
        ax.plot(f, r.least, color=GREEN, ls="-.", label="least stable virtual mass")
        ax.set(xscale="log", yscale="log", ylabel=unit_text("|Z| [N.s/m]"))
        plain_ticks(ax.yaxis)
        _frequency_axis(ax, f)
        i = len(f) // 2
        middle = math.sqrt(r.free[i] * r.most[i])
        look: Any = dict(ha="center", va="center", fontsize=points(9.0), color=BLACK)
        ax.text(f[i], middle, f"range {r.mean:.0f} dB in the mean", **look)
        add_legend(figure, ax, 1)
    return figure


def least_mass_plot(found: ArmMBK) -> Figure:
    """Plots the least virtual mass that the arm renders over its damper, with runs."""
    loop = found.loop
    timed = loop.Ts is not None or loop.delay > 0.0
    every = "worst hand tried of the box" if timed else "every hand of the box, exact"
    with figure_style():
        figure = Figure(figsize=figure_size(1, 4.0))
        ax = figure.add_subplot()
        absent = []
        for (M, B), color, style, name in (
            (found.worst, VERMILION, "--", every),
            (found.nominal, BLUE, "-", f"{hand_name(loop.operator)}, exact"),
        ):
            there = np.isfinite(M) & (M > 0.0)
            if np.any(there):
                ax.plot(B[there], M[there], color=color, ls=style, label=name)
            else:
                absent.append(f"{name.partition(',')[0]}: every mass is stable")
        if found.found:
            x, y = [r.x for r in found.found], [r.y for r in found.found]
            ax.plot(x, y, label="border by runs", **_dots(BLUE))
        ax.set(xscale="log", yscale="log")
        ax.set(xlabel=unit_text("virtual damper B [N.s/m]"), ylabel="least virtual mass M [kg]")
        for side in (ax.xaxis, ax.yaxis):
            plain_ticks(side)
        for text in absent:  # in the legend, without a mark
            ax.plot([], [], ls="none", label=text)
        add_legend(figure, ax, 3 if not narrow() else 1)
        how = "continuous time" if loop.Ts is None else f"sampled every {1e3 * loop.Ts:g} ms"
        set_title(ax, f"arm, {loop.axis} axis", how, "stable above and to the right")
    return figure


def _subject_name(subject: Subject) -> tuple[str, ...]:
    words = as_wall(subject).felt_phrases(hand_name(subject.operator))
    return tuple(unit_text(x) for x in words)


def _dots(color: str = BLUE, mark: str = "o") -> Any:
    return dict(
        ls="", marker=mark, ms=stroke(5.0), mfc="white", mec=color, mew=stroke(1.2), zorder=3
    )


def _border_dots(ax: Axes, borders: tuple[Border, ...]) -> None:
    if borders:
        x, y = [b.x for b in borders], [b.y for b in borders]
        ax.plot(x, y, label="border by runs", **_dots(VERMILION))


def _scale(ax: Axes, y: np.ndarray, also: float | None, log: bool = True) -> None:
    """A linear scale with zero, or logarithmic if log is True and positive values span much."""
    some = y[np.isfinite(y)]
    some = np.append(some, also) if also is not None else some
    if log and some.min() > 0.0 and some.max() / some.min() > LOG_SPAN:
        ax.set_yscale("log")
    elif some.min() >= 0.0:
        ax.set_ylim(0.0, 1.1 * some.max())
    else:
        ax.axhline(0.0, color=MID_GREY, lw=stroke(0.6))


def _frequency_axis(ax: Axes, f: np.ndarray) -> None:
    from matplotlib.ticker import NullFormatter, StrMethodFormatter

    ax.set(xlabel=FREQUENCY, xlim=(f[0] / 1.05, f[-1] * 1.05))
    ax.set_xticks([x for x in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100) if f[0] <= x <= f[-1]])
    ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
