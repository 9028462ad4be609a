"""Plots of the linear loop: Bode, Nyquist, the paper's small-gain condition, transparency."""

from __future__ import annotations

import math
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.polynomial import Polynomial

from ..errors import choice
from ..model import controller
from ..model.constants import AXES
from ..model.operator import Operator
from ..theory import linear_loop, margins
from ..theory.design import DESIGN_BAND
from .style import BLACK, BLUE, GREEN, ORANGE, STYLE

PINK, SKY = "#CC79A7", "#56B4E9"  # Okabe and Ito
CURVES = ((BLUE, "-"), (ORANGE, "--"), (GREEN, "-."), (PINK, ":"), (SKY, "-"))
FAILS = "#F3D9C6"
AT = {"force": "at the net force", "compensator": "at the compensator"}


def bode(
    axis: str,
    K: float,
    b: float,
    *,
    operator: Operator | None = None,
    at: str = "compensator",
    compensator: controller.Compensator = controller.PRINTED,
    omega: tuple[float, float] = (0.1, 1000.0),
) -> Figure:
    """Magnitude and phase of the loop, its gain and phase margins marked.

    Args:
        axis, K, b, operator, at, compensator: as in `stability.loop`. omega: range shown [rad/s].
    """
    kw: Any = dict(operator=operator, at=at, compensator=compensator)
    n, d = margins.open_loop(axis, K, b, **kw)
    m = margins.margins(axis, K, b, **kw)
    w = np.geomspace(*omega, 2000)
    L = _response(n, d, w)
    phase = np.degrees(np.unwrap(np.angle(L)))
    phase -= 360.0 * round((phase[0] + 90.0) / 360.0)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 5.2))
        top, low = figure.subplots(2, 1, sharex=True)
        top.loglog(w, np.abs(L), color=BLUE)
        top.axhline(1.0, color=BLACK, lw=0.8)
        low.semilogx(w, phase, color=BLUE)
        low.axhline(-180.0, color=BLACK, lw=0.8)
        if m.stable and math.isfinite(m.gain[1]):
            at_ = m.gain_omega[1]
            top.plot(
                [at_, at_], [1.0 / m.gain[1], 1.0], color=ORANGE, lw=3.0, solid_capstyle="butt"
            )
            _note(top, at_, 1.0 / math.sqrt(m.gain[1]), f"gain margin {m.gain[1]:.3g}", ORANGE)
            low.plot(at_, np.interp(at_, w, phase), "o", color=ORANGE, ms=5)
        if m.stable and math.isfinite(m.phase):
            at_ = m.phase_omega
            here = float(np.interp(at_, w, phase))
            far = -180.0 + 360.0 * round((here + 180.0) / 360.0)
            low.plot([at_, at_], [far, here], color=GREEN, lw=3.0, solid_capstyle="butt")
            _note(
                low,
                at_,
                0.5 * (far + here),
                f"phase margin {math.degrees(m.phase):.3g}\u00b0",
                GREEN,
                "right",
            )
            top.plot(at_, 1.0, "o", color=GREEN, ms=5)
        top.set_ylabel("magnitude of L")
        low.set_ylabel("phase of L [degrees]")
        low.set_yticks(np.arange(45.0 * math.floor(phase.min() / 45.0), phase.max() + 45.0, 45.0))
        low.set_xlabel("angular frequency [rad/s]")
        low.set_xlim(*omega)
        state = "" if m.stable else " (unstable)"
        _title(top, f"{_name(axis, b, operator)}, K = {K:g}{state}; broken {AT[at]}")
    return figure


def nyquist(
    axis: str,
    b: float,
    gains: tuple[float, ...] = (1.0,),
    *,
    operator: Operator | None = None,
    at: str = "compensator",
) -> Figure:
    """Nyquist curves for some gains, with the unit circle, -1, and the margins of each.

    Args:
        axis, b, operator, at: as in `stability.loop`. gains: K of each curve, 5 at most.
    """
    kw: Any = dict(operator=operator, at=at)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(5.6, 5.8))
        ax = figure.add_subplot()
        turn = np.linspace(0.0, 2.0 * np.pi, 361)
        ax.plot(np.cos(turn), np.sin(turn), color="#999999", lw=0.9, ls=(0, (4, 3)))
        for K, (color, style) in zip(gains, CURVES, strict=False):
            found = margins.nyquist(axis, K, b, **kw)
            m = margins.margins(axis, K, b, **kw)
            if m.stable:
                gain = f"\u00d7{m.gain[1]:.3g}" if math.isfinite(m.gain[1]) else "any gain"
                label = f"K = {K:g}: {gain}, {math.degrees(m.phase):.3g}\u00b0"
            else:
                label = f"K = {K:g}: unstable, {found.Z} poles on the right"
            ax.plot(found.L.real, found.L.imag, color=color, ls=style, label=label)
            _arrow(ax, found.L, color)
            if m.stable and math.isfinite(m.gain[1]):
                ax.plot(-1.0 / m.gain[1], 0.0, "o", color=color, ms=4.5, zorder=4)
            if m.stable and math.isfinite(m.phase):
                z = _response(*margins.open_loop(axis, K, b, **kw), np.array([m.phase_omega]))[0]
                ax.plot(z.real, z.imag, "s", color=color, ms=4.5, zorder=4)
        ax.plot(-1.0, 0.0, "+", color=BLACK, ms=12, mew=2.0, zorder=5)
        ax.annotate("-1", (-1.0, 0.0), (5.0, -13.0), textcoords="offset points", fontsize=9)
        ax.set_aspect("equal")
        ax.set_xlim(-2.6, 1.6)
        ax.set_ylim(-2.3, 1.5)
        ax.set_xlabel("real part of L")
        ax.set_ylabel("imaginary part of L")
        title = "margins of gain (circle) and phase (square); arrows: rising frequency"
        figure.legend(loc="outside upper center", ncols=2, title=title, title_fontsize=9)
        _title(ax, f"{_name(axis, b, operator)}; broken {AT[at]}")
    return figure


def small_gain(
    axis: str,
    K: float,
    b: float,
    *,
    operator: Operator | None = None,
    omega: tuple[float, float] = (0.1, 1000.0),
) -> Figure:
    """Both sides of the paper's condition (Eq. 13), the frequencies where it fails shaded.

    Args:
        axis, b, K, operator: as in `stability.small_gain`. omega: range shown [rad/s].
    """
    kw: Any = dict(operator=operator)
    verdict = margins.small_gain(axis, K, b, **kw)
    good = margins.coupled_stability(axis, K, b, **kw)
    n, d = margins.open_loop(axis, K, b, at="compensator", **kw)
    w = np.geomspace(*omega, 2000)
    passive, blank = linear_loop.device_admittance(axis, 0.0)
    e = linear_loop.device_admittance(axis, K)[0] - passive
    left = np.abs(_response(e, blank, w))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 3.8))
        ax = figure.add_subplot()
        label = "fails"
        for low, high in verdict.fails:
            ax.axvspan(
                max(low, omega[0]), min(high, omega[1]), color=FAILS, lw=0, label=label, zorder=0
            )
            label = "_"
        ax.loglog(w, left, color=BLUE, label="|G C|")
        right = left / np.abs(_response(n, d, w))
        ax.loglog(w, right, color=ORANGE, ls="--", label="|1/(T$_e$ + T$_h$) + S$_h$|")
        ax.set_xlim(*omega)
        ax.set_xlabel("angular frequency [rad/s]")
        ax.set_ylabel("handle over force [m/N]")
        figure.legend(loc="outside upper center", ncols=3)
        said = "holds" if verdict else "fails"
        _title(
            ax,
            f"{_name(axis, b, operator)}, K = {K:g}: (13) {said}, "
            f"the loop is {'' if good else 'un'}stable",
        )
    return figure


def transparency(
    axis: str,
    b: float,
    designs: list[tuple[str, float, controller.Compensator]],
    *,
    omega: tuple[float, float] = (0.1, 300.0),
    band: tuple[float, float] = DESIGN_BAND,
) -> Figure:
    """How much of the hand's force is the clay's, |fe/fh| (Eq. 7), for some compensators.

    Args:
        axis: "x" or "y". b: clay [N.s/m]. designs: (label, K, shape) of each, 5 at most.
        omega: range shown [rad/s]. band: the one that `transparency_error` looks at [rad/s].
    """
    choice("axis", axis, AXES)
    w = np.geomspace(*omega, 1000)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 3.8))
        ax = figure.add_subplot()
        ax.axvspan(*band, color="#EEEEEE", lw=0, zorder=0)
        ax.axhline(1.0, color=BLACK, lw=0.8)
        for (label, K, c), (color, style) in zip(designs, CURVES, strict=False):
            share = np.abs(margins.transparency(axis, K, b, w, compensator=c))
            ax.semilogx(w, share, color=color, ls=style, label=label)
        ax.annotate(
            "ideal",
            (omega[1], 1.0),
            (-4.0, 3.0),
            textcoords="offset points",
            ha="right",
            fontsize=9,
        )
        ax.set_xlim(*omega)
        ax.set_ylim(bottom=0.0)
        ax.set_xlabel("angular frequency [rad/s], band of the error in grey")
        ax.set_ylabel("|f$_e$/f$_h$|")
        figure.legend(loc="outside upper center", ncols=2)
        _title(ax, f"{axis} axis, b = {b:g} N$\\cdot$s/m")
    return figure


def _response(n: Polynomial, d: Polynomial, omega: np.ndarray) -> np.ndarray:
    return n(1j * omega) / d(1j * omega)


def _name(axis: str, b: float, operator: Operator | None) -> str:
    nominal = operator == Operator()
    hand = "nominal hand" if nominal else "given hand" if operator else "no hand"
    return f"{axis} axis, b = {b:g} N$\\cdot$s/m, {hand}"


def _title(ax: Axes, text: str) -> None:
    ax.set_title(text, fontsize=9, loc="left", color="#555555")


def _note(ax: Axes, x: float, y: float, text: str, color: str, side: str = "left") -> None:
    at = (8.0 if side == "left" else -8.0, 0.0)
    ax.annotate(
        text, (x, y), at, textcoords="offset points", ha=side, va="center", color=color, fontsize=9
    )


def _arrow(ax: Axes, L: np.ndarray, color: str) -> None:
    """An arrow along the curve where it passes 1.3 from the origin, or half way."""
    near = np.flatnonzero((np.abs(L[:-1]) >= 1.3) & (np.abs(L[1:]) < 1.3))
    i = int(near[-1]) if len(near) else len(L) // 2
    a, b = L[i], L[i + 1]
    arrow = dict(arrowstyle="-|>", color=color, mutation_scale=14)
    ax.annotate("", (b.real, b.imag), (a.real, a.imag), arrowprops=arrow)
