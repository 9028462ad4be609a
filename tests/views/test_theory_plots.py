"""What the plots show is what the analysis says."""

import math

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.views import theory_plots as plots


def texts(figure):
    return [t.get_text() for ax in figure.axes for t in ax.texts]


def test_bode_marks_the_margins():
    figure = plots.bode("x", 1.0, 90.0)
    m = hc.margins("x", 1.0, 90.0)
    assert f"gain margin {m.gain[1]:.3g}" in texts(figure)
    assert f"phase margin {math.degrees(m.phase):.3g}\u00b0" in texts(figure)
    top, low = figure.axes
    bar = next(line for line in top.lines if line.get_linewidth() == 3.0)
    assert bar.get_xdata()[0] == pytest.approx(m.gain_omega[1]) and bar.get_ydata()[
        0
    ] == pytest.approx(1 / m.gain[1])
    curve = top.lines[0]
    assert np.interp(m.gain_omega[1], curve.get_xdata(), curve.get_ydata()) == pytest.approx(
        1 / m.gain[1], rel=1e-4
    )
    assert "rad/s" in low.get_xlabel() and "degrees" in low.get_ylabel()


def test_bode_of_an_unstable_loop_says_so():
    figure = plots.bode("y", 1.0, 90.0, at="force")
    assert "unstable" in figure.axes[0].get_title(loc="left") and not texts(figure)


def test_nyquist_shows_one_curve_for_each_gain():
    figure = plots.nyquist("x", 90.0, (1.0, 6.0))
    labels = [
        line.get_label() for line in figure.axes[0].lines if not line.get_label().startswith("_")
    ]
    assert [x.split(":")[0] for x in labels] == [
        "K = 1",
        "K = 6",
    ] and "2 poles on the right" in labels[1]
    m = hc.margins("x", 1.0, 90.0)
    points = [line for line in figure.axes[0].lines if line.get_marker() in ("o", "s")]
    assert points[0].get_xdata()[0] == pytest.approx(-1 / m.gain[1])
    assert math.hypot(points[1].get_xdata()[0], points[1].get_ydata()[0]) == pytest.approx(1.0)


def test_small_gain_shades_where_it_fails():
    figure = plots.small_gain("x", 1.0, 50.0, operator=hc.Operator())
    spans = [p for p in figure.axes[0].patches if p.get_label() == "fails"]
    assert spans[0].get_x() + spans[0].get_width() == pytest.approx(
        hc.small_gain("x", 1.0, 50.0, hc.Operator()).fails[0][1]
    )
    left, right = (line.get_ydata() for line in figure.axes[0].lines)
    w = figure.axes[0].lines[0].get_xdata()
    assert np.all((left >= right) == (w <= spans[0].get_width() + spans[0].get_x()))
    assert "m/N" in figure.axes[0].get_ylabel()
    assert not [
        p for p in plots.small_gain("y", 0.1, 90.0).axes[0].patches if p.get_label() == "fails"
    ]


def test_transparency_is_drawn_for_each_design():
    figure = plots.transparency(
        "x",
        90.0,
        [("as printed", 1.0, hc.Compensator()), ("lead", 0.5, hc.Compensator(40.0, 20.0))],
    )
    curve = next(line for line in figure.axes[0].lines if line.get_label() == "as printed")
    assert curve.get_ydata()[0] == pytest.approx(0.9, rel=1e-3)  # K b/(10 + K b)
