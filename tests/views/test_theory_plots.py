"""What the plots show is what the analysis says."""

import math

import numpy as np
import pytest
from matplotlib.text import Text

import hapticclay as hc
from hapticclay.views import theory_plots as plots

HAND = hc.Operator()
LEAD = hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))


def texts(figure):
    return [t.get_text() for ax in figure.axes for t in ax.texts]


def test_bode_marks_the_margins():
    figure = plots.bode_plot("x", 1.0, 90.0, operator=HAND)
    m = hc.theory.margins("x", 1.0, 90.0, operator=HAND)
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
    figure = plots.bode_plot("y", 1.0, 90.0, operator=HAND, at="force")
    assert "unstable" in figure.axes[0].get_title(loc="left") and not texts(figure)


def test_nyquist_shows_one_curve_for_each_gain():
    figure = plots.nyquist_plot("x", 90.0, (1.0, 6.0), operator=HAND)
    labels = [
        line.get_label() for line in figure.axes[0].lines if not line.get_label().startswith("_")
    ]
    assert [x.split(":")[0] for x in labels] == [
        "K = 1",
        "K = 6",
    ] and "2 poles on the right" in labels[1]
    m = hc.theory.margins("x", 1.0, 90.0, operator=HAND)
    points = [line for line in figure.axes[0].lines if line.get_marker() in ("o", "s")]
    assert points[0].get_xdata()[0] == pytest.approx(-1 / m.gain[1])
    assert math.hypot(points[1].get_xdata()[0], points[1].get_ydata()[0]) == pytest.approx(1.0)


def test_small_gain_shades_where_it_fails():
    figure = plots.small_gain_plot("x", 1.0, 50.0, operator=HAND)
    spans = [p for p in figure.axes[0].patches if p.get_label() == "fails"]
    assert spans[0].get_x() + spans[0].get_width() == pytest.approx(
        hc.theory.small_gain("x", 1.0, 50.0, operator=HAND).fails[0][1]
    )
    left, right = (line.get_ydata() for line in figure.axes[0].lines)
    w = figure.axes[0].lines[0].get_xdata()
    assert np.all((left >= right) == (w <= spans[0].get_width() + spans[0].get_x()))
    assert "m/N" in figure.axes[0].get_ylabel()
    assert not [
        p for p in plots.small_gain_plot("y", 0.1, 90.0).axes[0].patches if p.get_label() == "fails"
    ]


def test_transparency_is_drawn_for_each_design():
    figure = plots.transparency_plot(
        "x",
        90.0,
        [("as printed", 1.0, hc.Compensator()), ("lead", 0.5, LEAD)],
    )
    curve = next(line for line in figure.axes[0].lines if line.get_label() == "as printed")
    assert curve.get_ydata()[0] == pytest.approx(0.9, rel=1e-3)  # K b/(10 + K b)


@pytest.mark.parametrize(
    "gains", [(1.0,), (1.0, 25.0), (0.5, 1.0, 2.0), (1.0, 6.0, 12.0, 25.0, 50.0)], ids=str
)
@pytest.mark.layout
def test_nyquist_legend_stays_within_the_figure(gains):
    figure = plots.nyquist_plot("x", 50.0, gains, operator=HAND)
    figure.draw_without_rendering()
    box, whole = figure.legends[0].get_window_extent(), figure.bbox
    assert whole.x0 <= box.x0 and box.x1 <= whole.x1 and box.y1 <= whole.y1
    ax = figure.axes[0]
    assert ax.xaxis.label.get_window_extent().y0 >= 1.0
    (title,) = ax.findobj(lambda x: isinstance(x, Text) and "broken at" in x.get_text())
    assert not title.get_window_extent().overlaps(box)
