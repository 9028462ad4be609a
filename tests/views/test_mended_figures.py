"""Figures that once hid, crowded or invented something."""

from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.studies.chart import Chart, curve
from hapticclay.studies.identification import identify
from hapticclay.views.chart_plots import chart_plot
from hapticclay.views.identification_plots import identification_plot
from hapticclay.views.motion import along_motion
from hapticclay.views.panels import set_title
from hapticclay.views.run_plots import maneuver_plot
from hapticclay.views.style import styled


@pytest.fixture(scope="module")
def identified():
    return identify("x", "G", realisations=1, periods=2, lines=12, period=2.5, band=(0.5, 10.0))


def _labels(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_printed_curve_stands_beside_the_arm_and_beside_data_only_when_asked(identified):
    data = replace(identified, scenario=None, source="a file")
    assert "printed" in _labels(identification_plot([identified]))
    assert "printed" not in _labels(identification_plot([data]))
    assert "Eq." not in identification_plot([data]).axes[0].get_title(loc="left")
    assert "printed" in _labels(identification_plot([data], paper=True))


def test_lines_below_a_coherence_of_one_half_are_not_drawn(identified):
    poor = identified.coherence.copy()
    poor[[2, 5]] = 0.4
    figure = identification_plot([replace(identified, coherence=poor)])
    for ax in figure.axes[:2]:
        (bars,) = ax.containers
        assert len(bars[0].get_xdata()) == len(poor) - 2
    assert len(figure.axes[2].lines[0].get_xdata()) == len(poor)  # which says why


def test_print_has_no_title_row_but_names_of_panels():
    from matplotlib.figure import Figure

    for style, shown in (("screen", "a"), ("print", ""), ("print-wide", "")):
        with styled(style):
            ax, panel = Figure().subplots(1, 2)
            set_title(ax, "a")
            set_title(panel, "b", panel=True)
        assert ax.get_title(loc="left") == shown and panel.get_title(loc="left") == "b"


def test_the_least_mass_of_a_loop_that_has_none_is_told():
    loop = hc.studies.PushedLoop("x", b=0.0, operator=hc.Operator())
    found = hc.walls.arm_mbk(loop, columns=1, points=3, samples=2)
    none = np.full(3, np.inf), np.ones(3)
    figure = replace(found, nominal=none, worst=none, found=()).plot()
    assert [x.partition(": ")[2] for x in _labels(figure)] == ["every mass is stable"] * 2


def test_forces_in_clay_that_resists_along_the_motion_are_drawn_along_it():
    law = hc.Profile((), (20.0,), Fy=(1.0,))
    scene = hc.Scenario(
        clay=hc.Clay(law, law, isotropic=True),
        force=(4.0, 3.0),
        t_max=0.05,
        length=None,
        stop_when_unstable=False,
    )
    record = hc.simulate(scene, engine="python")
    ax = maneuver_plot([record]).axes[0]
    drawn = {line.get_label(): line.get_ydata() for line in ax.lines}
    expected = along_motion(record.v, record.fe, 0)[1]
    assert np.array_equal(drawn["clay, f$_e$"], expected)
    assert np.abs(expected - record.fe[:, 0]).max() > 0.1 and "motion" in ax.get_ylabel()


def test_a_chart_draws_theory_as_lines_and_runs_as_marks():
    x = [1.0, 10.0, 100.0]
    chart = Chart("n", "t", "c", "x [Hz]", "y [N.s/m]", (
        curve("theory", x, [1.0, 2.0, 3.0]), curve("", x, [1.0, 2.0, 3.0], "dashed"),
        curve("runs", x, [1.1, 2.0, 2.9], "marks")), "x")  # fmt: skip
    figure = chart_plot(chart)
    line, rule, marks = figure.axes[0].lines
    assert _labels(figure) == ["theory", "runs"] and figure.axes[0].get_xscale() == "log"
    assert line.get_linestyle() == "-" and marks.get_linestyle() == "None"
    assert line.get_color() == rule.get_color() == marks.get_color()
    assert list(chart.tables()["runs"]) == ["x [Hz]", "y [N.s/m]"]
