"""Figure of a fitted law of resistance: force against velocity, and residuals."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..studies.fitting import Fitted
from .captions import clay_text
from .palette import BLACK, BLUE, MID_GREY, VERMILION
from .panels import level, set_title
from .style import figure_size, figure_style, narrow, points, stroke

DOTS_SHOWN = 6000  # of a panel
BINS = 24  # of speeds, in which residuals are averaged
LEAST_IN_BIN = 5
LEAST_RESIDUAL = 1e-3  # least range of a panel of residuals, as a share of the largest force
LAGS = 60  # of the autocorrelation
DOTS: Any = dict(mew=0.0, color=BLUE, alpha=0.45, zorder=2.2, rasterized=True)


@figure_style()
def fit_plot(fitted: Fitted) -> Figure:
    """Plots force against velocity with the law, and residuals over velocity, time and lag."""
    drawn = np.unique(np.linspace(0, len(fitted.v) - 1, DOTS_SHOWN).astype(int))
    t, v, f, residuals = (x[drawn] for x in (fitted.t, fitted.v, fitted.f, fitted.residuals))
    figure = Figure(figsize=figure_size(2, 10.2 if narrow() else 5.6))
    if narrow():
        axes = figure.subplot_mosaic("A;B;C;D", height_ratios=(2.2, 1.0, 1.0, 1.0))
    else:
        axes = figure.subplot_mosaic("AB;AC;AD", width_ratios=(1.25, 1.0))
    law, *small = (axes[k] for k in "ABCD")
    law.plot(v, f, "o", label="data", ms=stroke(1.6), **DOTS)
    _fitted_curve(law, fitted)
    law.set(xlabel="velocity [m/s]", ylabel="resisting force [N]")
    law.locator_params(axis="x", nbins=6)
    law.legend(loc="lower right", markerscale=3.0)
    values = [f"{p.name} = {_interval(p.value, p.low, p.high)} {p.unit}" for p in fitted.parameters]
    corner: Any = dict(transform=law.transAxes, va="top", fontsize=points(9), color=BLACK)
    law.text(0.03, 0.97, clay_text("\n".join(values)), **corner)
    chosen = next(c for c in fitted.candidates if c.law == fitted.law)
    name = f"{fitted.law.removesuffix(' law')} law"
    set_title(law, name, f"Akaike weight {chosen.weight:.2f}")
    least = LEAST_RESIDUAL * float(np.max(np.abs(f), initial=1e-6))
    top = 1.05 * float(np.max(np.abs(residuals), initial=least))
    for ax, x, label in zip(small, (v, t), ("velocity [m/s]", "time [s]"), strict=False):
        ax.plot(x, residuals, "o", ms=stroke(1.6), **DOTS)
        level(ax)
        ax.set(xlabel=label, ylabel="residual [N]", ylim=(-top, 1.5 * top))  # room for the legend
    _binned(small[0], fitted)
    small[0].legend(loc="upper right", fontsize=points(8))
    _autocorrelation(small[2], fitted)
    figure.align_ylabels(small)
    return figure


def _fitted_curve(ax: Axes, fitted: Fitted) -> None:
    """The law on both sides of rest over the range of the data, and its band."""
    for way in (-1.0, 1.0):
        speeds = np.abs(fitted.v[fitted.v * way > 0.0])
        if not len(speeds):
            continue
        v = way * np.geomspace(speeds.min(), speeds.max(), 300)
        force, half = fitted.flow.force(v), fitted.band(v)
        first = way == np.sign(fitted.v[0])
        ax.plot(v, force, color=VERMILION, zorder=4, label="law" if first else "_")
        look: Any = dict(color=BLACK, alpha=0.3, lw=0, zorder=3)
        band = f"{100 * fitted.level:g} % band" if first else "_"
        ax.fill_between(v, force - half, force + half, label=band, **look)


def _interval(value: float, low: float, high: float) -> str:
    """A value with its interval, rounded to the precision of the interval."""
    width = max(high - low, 1e-6 * abs(value), 1e-300)
    digits = int(np.clip(1 - np.floor(np.log10(width)), 0, 9))
    return f"{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _binned(ax: Axes, fitted: Fitted) -> None:
    """Mean residual of samples of similar velocity, with its 95 % bars."""
    v, left = fitted.v, fitted.residuals
    edges = np.quantile(v, np.linspace(0.0, 1.0, BINS + 1))
    place = np.clip(np.searchsorted(edges, v, "right") - 1, 0, BINS - 1)
    count = np.bincount(place, minlength=BINS)
    good = count >= LEAST_IN_BIN
    mean_v, mean = (np.bincount(place, x, BINS)[good] / count[good] for x in (v, left))
    bar = 1.96 * fitted.force_noise * np.sqrt(fitted.correlation / count[good])
    look: Any = dict(fmt="s", ms=stroke(3.0), color=VERMILION, elinewidth=stroke(1.0), zorder=3)
    ax.errorbar(mean_v, mean, bar, label="means, 95 %", **look)


def _autocorrelation(ax: Axes, fitted: Fitted) -> None:
    x = fitted.residuals - np.mean(fitted.residuals)
    count = min(LAGS, len(x) // 4)
    power = float(x @ x) or 1.0
    rho = [float(x[k:] @ x[: len(x) - k]) / power for k in range(1, count + 1)]
    ax.axhspan(-1.96 / np.sqrt(len(x)), 1.96 / np.sqrt(len(x)), color=MID_GREY, alpha=0.3, lw=0)
    level(ax)
    ax.vlines(np.arange(1, count + 1), 0.0, rho, color=BLUE, lw=stroke(1.4))
    ax.set(xlabel="lag [samples]; grey: white noise", ylabel="autocorrelation")
    ax.set(xlim=(0, count + 1), ylim=(1.15 * min(-0.1, *rho), 1.15 * max(0.1, *rho)))
