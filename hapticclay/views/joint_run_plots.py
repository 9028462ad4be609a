"""Figure of runs of an arm at its gains and beside their limit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..studies.joint_runs import JointRuns
from .palette import BLUE, VERMILION
from .panels import add_legend, level, set_title
from .style import figure_size, figure_style, stroke

LATE = 0.5  # share of a run, at its end, in which the expected envelope meets it


@figure_style()
def joint_runs_plot(found: JointRuns) -> Figure:
    """Plots the motion of each run, between the envelopes that the exact map expects."""
    count = len(found.factor)
    figure = Figure(figsize=figure_size(1, 0.8 + 1.7 * count))
    panels = figure.subplots(count, 1, squeeze=False)[:, 0]
    for i, ax in enumerate(panels):
        t, x = found.times[i], 1e3 * found.motion[i]
        ax.plot(t, x, color=BLUE, lw=stroke(0.9), label="run")
        envelope = _envelope(t, x, float(found.expected[i]), float(found.expected_frequency[i]))
        dash: Any = dict(color=VERMILION, ls="--", lw=stroke(1.1))
        ax.plot(t, envelope, label="envelope by theory", **dash)
        ax.plot(t, -envelope, **dash)
        most = 1.15 * float(np.abs(x).max(initial=1e-12))
        ax.set(ylabel=f"{found.joint[i]} [mrad]", ylim=(-most, most))
        level(ax)
        rates = f"{found.growth[i]:.4g} 1/s, by theory {found.expected[i]:.4g}"
        set_title(ax, f"all Kp times {found.factor[i]:.4g}: growth {rates}", panel=True)
    panels[-1].set_xlabel("time [s]")
    figure.align_ylabels(panels)
    add_legend(figure)
    return figure


def _envelope(t: np.ndarray, x: np.ndarray, rate: float, frequency: float) -> np.ndarray:
    """An exponential of a rate through the largest swing of the late part."""
    shape = np.exp(rate * (t - t[-1]))
    late = t >= LATE * t[-1]
    if frequency > 0.0 and math.isfinite(rate):
        late = t >= min(LATE * t[-1], t[-1] - 1.0 / frequency)
    return shape * float((np.abs(x[late]) / shape[late]).max())
