"""record.plot: which figure is drawn, and energy over time beside the run's own balance."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.views import path_plots, record_plots, run_figures, run_plots
from hapticclay.views.record_plots import RecordPlots


@pytest.fixture(scope="module")
def cut():
    return hc.simulate(hc.constant_cut(dt=1e-3))


@pytest.fixture(scope="module")
def maneuver():
    return hc.simulate(hc.stability_test(t_max=1.0, dt=1e-3))


def curve(figure, k=0):
    return figure.axes[0].lines[k].get_xydata()


def test_each_figure_is_that_of_run_plots(cut, maneuver):
    assert isinstance(cut.plot, RecordPlots)
    same = (
        (cut.plot.velocity(), run_plots.velocity_plot(cut)),
        (cut.plot.velocity("y"), run_plots.velocity_plot(cut, "y")),
        (cut.plot.force(), run_plots.force_ratio_plot(cut)),
        (cut.plot.force("y"), run_plots.force_ratio_plot(cut, "y")),
        (cut.plot.force(over="position"), run_plots.maneuver_plot([cut], over="position")),
        (cut.plot.path(), path_plots.path_plot(cut)),
        (cut.plot(), run_plots.velocity_plot(cut)),
        (maneuver.plot(), run_plots.maneuver_plot([maneuver])),
        (maneuver.plot.force(), run_plots.maneuver_plot([maneuver])),
    )
    for ours, theirs in same:
        assert [ax.get_ylabel() for ax in ours.axes] == [ax.get_ylabel() for ax in theirs.axes]
        np.testing.assert_array_equal(curve(ours), curve(theirs))
    assert set(cut.plot.all()) == set(run_figures.figures(cut))
    assert len(hc.simulate(hc.variable_cut(t_max=0.1)).plot.velocity().axes) == 2


def test_notebooks_show_a_picture(cut):
    figure = cut.plot.velocity()
    first = figure._repr_png_()
    assert first.startswith(b"\x89PNG")
    figure.axes[0].set_title("another")
    assert figure._repr_png_() != first


@pytest.mark.parametrize(
    "scenario",
    [
        hc.constant_cut(),
        hc.variable_cut(t_max=3.0),
        hc.stability_test(t_max=2.0),
        hc.constant_cut(operator=hc.Operator(), t_max=2.0, force=(2.0, 0.0)),
        dataclasses.replace(
            hc.constant_cut(t_max=2.0, force=(8.0, 0.0)), clay=hc.slab(hc.Flow(Fy=5.0, b=20.0))
        ),
    ],
    ids=["constant", "variable", "stability", "hand", "yields"],
)
def test_energies_end_where_the_run_has_added_them_up(scenario):
    """The run adds up exactly; trapezoids over samples of 0.36 ms are off at each hit, by one step
    at the power of the hit: 2 % of what went through."""
    record = hc.simulate(scenario)
    found, total = record_plots.energies(record), record_plots._added_up(record)
    assert set(total) == {"hand", "motors", "clay"}
    for name, value in total.items():
        assert found[name][-1] == pytest.approx(value, abs=0.02 * record.energy["throughput"]), name
    gained = found["kinetic"][-1] - found["kinetic"][0]
    assert gained == pytest.approx(record.energy["kinetic"], abs=1e-9 + 1e-6 * abs(gained))
    balance = found["hand"] + found["motors"] - found["clay"] - found["kinetic"]
    assert np.ptp(balance) < 0.04 * record.energy["throughput"]
    assert all(len(x) == len(record.t) and x[0] == 0.0 for x in found.values() if x is not None)


@pytest.mark.layout
def test_energy_plot_shows_measured_and_added_up(cut):
    figure = cut.plot.energy()
    (ax,) = figure.axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", "energy [J]")
    labels = [x.get_text() for x in figure.legends[0].get_texts()]
    assert labels[-1] == "added up by the run" and len(labels) == 5
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()  # the legend is not clipped
    assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1
    without = dataclasses.replace(cut, energy={}).plot.energy()
    assert len(without.legends[0].get_texts()) == 4


def test_bad_input_is_refused(cut):
    empty = dataclasses.replace(
        cut, **{n: getattr(cut, n)[:0] for n in ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau")}
    )
    for draw in (empty.plot, *(getattr(empty.plot, n) for n in ("velocity", "path", "energy"))):
        with pytest.raises(ParameterError, match="holds no samples"):
            draw()
    with pytest.raises(ParameterError, match="axis = 'z'"):
        cut.plot.velocity("z")
    with pytest.raises(ParameterError, match="axis = 'xy'"):
        cut.plot.force("xy")
    with pytest.raises(ParameterError, match="over = 'tiem'.*did you mean 'time'"):
        cut.plot.force(over="tiem")


def test_matplotlib_is_loaded_by_the_plot_alone():
    code = (
        "import sys, hapticclay as hc; r = hc.simulate(hc.constant_cut(t_max=0.01));"
        "print('matplotlib' in sys.modules); r.plot; print('matplotlib.figure' in sys.modules);"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["False", "True", "False"]
