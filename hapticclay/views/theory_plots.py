"""Figures of the linear loop: Bode and Nyquist diagrams, inequality (13), transparency."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.polynomial import Polynomial

from ..model.compensator import Compensator
from ..theory import linear_loop, stability_margins
from ..theory.controller_loop import ControllerStability
from ..theory.design import DESIGN_BAND, Design
from ..theory.loops import Loop, of_loop
from .captions import loop_parts
from .palette import BLACK, BLUE, GREEN, MID_GREY, PALE_GREY, VERMILION
from .panels import add_legend, curve_look, level, set_title, single, stacked
from .style import figure_style, narrow, points, stroke

BREAK_NAMES = {"force": "at the net force", "compensator": "at the compensator"}
OMEGA_LABEL = "angular frequency [rad/s]"
DESIGN_OMEGA = np.geomspace(0.1, 1000.0, 500)  # [rad/s]


@of_loop("K", "b")
@figure_style()
def bode_plot(
    loop: Loop, *, at: str = "compensator", omega: tuple[float, float] = (0.1, 1000.0)
) -> Figure:
    """Plots magnitude and phase of the loop and marks its gain and phase margins."""
    m = stability_margins.margins(loop, at=at)
    w = np.geomspace(*omega, 2000)
    L = _response(*stability_margins.open_loop(loop, at=at), w)
    phase = np.degrees(np.unwrap(np.angle(L)))
    phase -= 360.0 * round((phase[0] + 90.0) / 360.0)
    bar: Any = dict(lw=stroke(3.0), solid_capstyle="butt")
    figure, (top, low) = stacked(2, 5.2)
    top.loglog(w, np.abs(L), color=BLUE)
    level(top, 1.0)
    low.semilogx(w, phase, color=BLUE)
    level(low, -180.0)
    if m.stable and math.isfinite(m.gain[1]):
        where, height = m.gain_omega[1], 1.0 / m.gain[1]
        top.plot([where, where], [height, 1.0], color=VERMILION, **bar)
        _note(top, where, math.sqrt(height), f"gain margin {m.gain[1]:.3g}", VERMILION)
        low.plot(where, np.interp(where, w, phase), "o", color=VERMILION, ms=stroke(5))
    if m.stable and math.isfinite(m.phase):
        where, here = m.phase_omega, float(np.interp(m.phase_omega, w, phase))
        far = -180.0 + 360.0 * round((here + 180.0) / 360.0)
        low.plot([where, where], [far, here], color=GREEN, **bar)
        text = f"phase margin {math.degrees(m.phase):.3g}\u00b0"
        _note(low, where, 0.5 * (far + here), text, GREEN, "right")
        top.plot(where, 1.0, "o", color=GREEN, ms=stroke(5))
    top.set_ylabel("magnitude of L")
    low.set(xlabel=OMEGA_LABEL, ylabel="phase of L [degrees]", xlim=omega)
    low.set_yticks(np.arange(45.0 * math.floor(phase.min() / 45.0), phase.max() + 45.0, 45.0))
    state = "" if m.stable else " (unstable)"
    set_title(top, *_loop(loop), f"K = {loop.gain:g}{state}; broken {BREAK_NAMES[at]}")
    return figure


@of_loop("b", "gains")
@figure_style()
def nyquist_plot(
    loop: Loop, gains: tuple[float, ...] = (1.0,), *, at: str = "compensator"
) -> Figure:
    """Plots Nyquist curves with the unit circle, the point -1 and the margins of each."""
    height = (4.5 if narrow() else 5.7) + 0.2 * len(gains)  # for the legend
    figure, ax = single(height, 5.6)
    columns, turn = 2, np.linspace(0.0, 2.0 * np.pi, 361)
    ax.plot(np.cos(turn), np.sin(turn), color=MID_GREY, lw=stroke(0.9), ls=(0, (4, 3)))
    for i, K in enumerate(gains):
        look = curve_look(i)
        color = look["color"]
        found = stability_margins.nyquist(loop, K=K, at=at)
        m = stability_margins.margins(loop, K=K, at=at)
        if m.stable:
            gain = f"\u00d7{m.gain[1]:.3g}" if math.isfinite(m.gain[1]) else "any gain"
            label = f"K = {K:g}: {gain}, {math.degrees(m.phase):.3g}\u00b0"
        else:
            label = f"K = {K:g}: unstable, {found.Z} poles on the right"
            columns = 1  # two such labels are wider than the figure
        ax.plot(found.L.real, found.L.imag, label=label, **look)
        _arrow(ax, found.L, color)
        if m.stable and math.isfinite(m.gain[1]):
            ax.plot(-1.0 / m.gain[1], 0.0, "o", color=color, ms=stroke(4.5), zorder=4)
        if m.stable and math.isfinite(m.phase):
            L = stability_margins.open_loop(loop, K=K, at=at)
            z = _response(*L, np.array([m.phase_omega]))[0]
            ax.plot(z.real, z.imag, "s", color=color, ms=stroke(4.5), zorder=4)
    ax.plot(-1.0, 0.0, "+", color=BLACK, ms=stroke(12), mew=stroke(2.0), zorder=5)
    ax.annotate("-1", (-1.0, 0.0), (5.0, -13.0), textcoords="offset points", fontsize=points(9))
    ax.set(xlabel="real part of L", ylabel="imaginary part of L", aspect="equal")
    ax.set(xlim=(-2.6, 1.6), ylim=(-2.3, 1.5))
    title = "margins of gain (circle) and phase (square); arrows: rising frequency"
    add_legend(figure, columns, title=title, title_fontsize=points(9))
    *parts, hand = _loop(loop)
    set_title(ax, *parts, f"{hand}; broken {BREAK_NAMES[at]}")
    return figure


@of_loop("K", "b")
@figure_style()
def small_gain_plot(loop: Loop, *, omega: tuple[float, float] = (0.1, 1000.0)) -> Figure:
    """Plots both sides of inequality (13) and shades the frequencies at which it fails."""
    verdict = stability_margins.small_gain(loop)
    stable = stability_margins.coupled_stability(loop)
    w = np.geomspace(*omega, 2000)
    passive, d = linear_loop.device_admittance(replace(loop, K=0.0))
    active = linear_loop.device_admittance(loop)[0] - passive
    left = np.abs(_response(active, d, w))
    right = left / np.abs(_response(*stability_margins.open_loop(loop, at="compensator"), w))
    figure, ax = single(3.8)
    for low, high in verdict.fails:
        span = max(low, omega[0]), min(high, omega[1])
        ax.axvspan(*span, color=VERMILION, alpha=0.2, lw=0, label="fails")
    ax.loglog(w, left, color=BLUE, label="|G C|")
    ax.loglog(w, right, color=VERMILION, ls="--", label="|1/(T$_e$ + T$_h$) + S$_h$|")
    ax.set(xlabel=OMEGA_LABEL, ylabel="handle over force [m/N]", xlim=omega)
    add_legend(figure, 3)
    outcome = f"K = {loop.gain:g}: (13) {'holds' if verdict else 'fails'}"
    set_title(ax, *_loop(loop), outcome, f"the loop is {'' if stable else 'un'}stable")
    return figure


@of_loop("b", "designs")
@figure_style()
def transparency_plot(
    loop: Loop,
    designs: list[tuple[str, float, Compensator]],
    *,
    omega: tuple[float, float] = (0.1, 300.0),
    band: tuple[float, float] = DESIGN_BAND,
) -> Figure:
    """Plots the clay's share of the hand's force, |fe/fh| (Eq. 7), for some compensators."""
    w = np.geomspace(*omega, 1000)
    figure, ax = single(3.8)
    ax.axvspan(*band, color=PALE_GREY, lw=0, zorder=0)
    level(ax, 1.0)
    for i, (label, K, shape) in enumerate(designs):
        share = np.abs(stability_margins.transparency(replace(loop, compensator=shape, K=K), w))
        ax.semilogx(w, share, label=label, **curve_look(i))
    _note(ax, omega[1], 1.0, "ideal", BLACK, "right", 8.0)
    ax.set(xlabel=f"{OMEGA_LABEL}; grey: band of the error", ylabel="|f$_e$/f$_h$|")
    ax.set(xlim=omega, ylim=(0.0, None))
    add_legend(figure, 2)
    set_title(ax, *loop_parts(loop, "axis", "b"))
    return figure


@figure_style()
def growth_plot(found: ControllerStability) -> Figure:
    """Plots the growth rate of the least damped mode over the gain, with the stable band."""
    figure, ax = single(3.6)
    ax.plot(found.gains, found.rates, color=BLUE)
    level(ax)
    ends = np.clip((found.low, found.high), found.gains[0], found.gains[-1])
    ax.axvspan(*ends.tolist(), color=PALE_GREY, lw=0, zorder=0, label="stable")
    rate = float(np.interp(found.gain, found.gains, found.rates))
    ax.plot(found.gain, rate, "o", color=VERMILION, ms=stroke(5), label="own gain")
    ax.set(xscale="log", xlabel="gain", ylabel="growth rate of oscillation [1/s]")
    if (least := float(found.rates.min())) < 0.0:
        ax.set_ylim(1.3 * least, -1.3 * least)
    add_legend(figure, 2)
    set_title(ax, "controller of one's own", f"Ts = {1e3 * found.Ts:g} ms")
    return figure


@figure_style()
def design_plot(design: Design) -> Figure:
    """Plots magnitude and phase of the compensator K C."""
    s, c = 1j * DESIGN_OMEGA, design.compensator
    response = design.K * np.polyval(c.num, s) / np.polyval(c.den, s)
    figure, (top, low) = stacked(2, 4.4)
    top.loglog(DESIGN_OMEGA, np.abs(response), color=BLUE)
    low.semilogx(DESIGN_OMEGA, np.degrees(np.unwrap(np.angle(response))), color=BLUE)
    level(low, -180.0)
    top.set_ylabel("magnitude of K C [m/N]")
    low.set(xlabel=OMEGA_LABEL, ylabel="phase of K C [degrees]")
    set_title(top, design.headline())
    return figure


def _response(n: Polynomial, d: Polynomial, omega: np.ndarray) -> np.ndarray:
    return n(1j * omega) / d(1j * omega)


def _loop(loop: Loop) -> list[str]:
    return loop_parts(loop, "axis", "b", "hand")


def _note(
    ax: Axes, x: float, y: float, text: str, color: str, side: str = "left", up: float = 0.0
) -> None:
    """Writes beside a point, on one side of it and shifted up [points]."""
    look: Any = dict(ha=side, va="center", color=color, fontsize=points(9))
    offset = 8.0 if side == "left" else -8.0, up
    ax.annotate(text, (x, y), offset, textcoords="offset points", **look)


def _arrow(ax: Axes, L: np.ndarray, color: str) -> None:
    """An arrow along the curve at a distance of 1.3 from the origin, or half way."""
    near = np.flatnonzero((np.abs(L[:-1]) >= 1.3) & (np.abs(L[1:]) < 1.3))
    i = int(near[-1]) if len(near) else len(L) // 2
    a, b = L[i], L[i + 1]
    arrow = dict(arrowstyle="-|>", color=color, mutation_scale=14)
    ax.annotate("", (b.real, b.imag), (a.real, a.imag), arrowprops=arrow)
