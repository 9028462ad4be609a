"""What the plots of a run show is what the record holds."""

import dataclasses
import functools

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.views import captions, path_plots, run_figures, run_plots
from tests.hunt import HUNTS


@pytest.fixture(scope="module")
def run():
    return hc.simulate(hc.constant_cut(dt=2e-3))


def lines(figure):
    return {line.get_label(): line for line in figure.axes[0].lines}


def test_velocity_plot_shows_measured_and_expected(run):
    figure = run_plots.velocity_plot(run)
    found = lines(figure)
    np.testing.assert_array_equal(found["measured"].get_xdata(), 100 * run.p[:, 0])
    np.testing.assert_array_equal(found["measured"].get_ydata(), run.v[:, 0])
    expected = [line for line in figure.axes[0].lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[0] for line in expected] == pytest.approx([0.1, 0.01, 0.1])
    assert "cm" in figure.axes[0].get_xlabel() and "m/s" in figure.axes[0].get_ylabel()
    spans = [p for p in figure.axes[0].patches if p.get_label() == "clay"]
    assert spans[0].get_x() == pytest.approx(5.0) and spans[0].get_width() == pytest.approx(10.0)


def test_force_plot_shows_b_beside_the_ratios(run):
    figure = run_plots.force_ratio_plot(run)
    labels = [t for t in lines(figure) if not t.startswith("_")]
    assert labels == ["operator, f$_h$/v", "clay, f$_e$/v", "10/K + b", "b"]
    b = [line for line in figure.axes[0].lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[0] for line in b] == [0.0, 90.0, 0.0]


@pytest.mark.parametrize("scenario", [
    hc.free(t_max=0.5), hc.constant_cut(gain=(1.0, 1.0), dt=1e-3), hc.constant_cut(t_max=1e-5),
    hc.free(force=(0.0, 0.0), t_max=0.1),
    hc.constant_cut(operator=hc.Operator(), t_max=1.0, dt=1e-3),
], ids=["free", "unstable", "two samples", "at rest", "hand"])  # fmt: skip
@pytest.mark.layout
def test_any_record_can_be_drawn(scenario, tmp_path):
    record = hc.simulate(scenario)
    for draw in (run_plots.velocity_plot, run_plots.force_ratio_plot):
        hc.Figure(lambda draw=draw: draw(record, "x")).save(tmp_path / "p.png")
        assert (tmp_path / "p.png").stat().st_size > 5000
        other = draw(record, "y")
        other.set_layout_engine("none")  # the same room as that of x
        other.draw_without_rendering()


LONG = dict(operator=hc.Operator(), inertia_shaping=True, gain=(1.234, 0.5678), t_max=3.0,
            dt=1e-3)  # fmt: skip


SCENARIOS = {
    "variable": hc.variable_cut(t_max=4.0, dt=1e-3),
    "long": hc.variable_cut(**LONG),
    "long constant": hc.constant_cut(**LONG, force=(1.234, -0.5678)),
    "long free": hc.free(**LONG),
    "driven": hc.stability_test(25.0, inertia_shaping=True, t_max=3.0, dt=1e-3),
    "short": hc.constant_cut(t_max=0.1),
    "unstable": hc.constant_cut(gain=(1.0, 1.0), dt=1e-3),
    "other parts": hc.with_fields(
        hc.constant_cut(**LONG),
        {"arm.l1": 0.3, "servo.x.S.damping": 50.0, "compensator.den.1": 8.0},
    ),
}


@functools.cache
def ran(name):
    return hc.simulate(SCENARIOS[name])


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.layout
def test_no_title_is_clipped_or_runs_into_the_legend(name):
    scenario, record = SCENARIOS[name], ran(name)
    drawn = run_figures.figures(record)
    if HUNTS or name in ("variable", "long", "other parts"):  # its title is that of the others
        drawn["map"] = path_plots.path_plot(record)
    for name, figure in drawn.items():
        figure.draw_without_rendering()
        (legend,) = figure.legends
        key, whole = legend.get_window_extent(), figure.bbox
        for ax in figure.axes:
            said = ax.get_title(loc="left")
            for text in ax.findobj(
                lambda x, said=said: isinstance(x, Text) and said and x.get_text() == said
            ):
                box = text.get_window_extent()
                assert whole.x0 <= box.x0 and box.x1 <= whole.x1 and box.y1 <= whole.y1, (
                    name,
                    said,
                )
                assert not box.overlaps(key), (name, said)
        assert figure.axes[0].get_title(loc="left").startswith(scenario.name)


def test_a_title_names_the_parts_that_are_not_the_papers():
    record = ran("other parts")
    for figure in run_figures.figures(record).values():
        said = " ".join(figure.axes[0].get_title(loc="left").split())
        assert "another arm, another servo, another compensator" in said
    own = captions.scenario_parts(SCENARIOS["long"])
    assert not any("another" in x for x in own)


def test_a_plot_is_one_entry_of_the_registry(tmp_path, monkeypatch):
    """`hapticclay run` writes it, and a later run in the same folder without plots removes it."""

    def power(record):
        figure = Figure()
        figure.add_subplot().plot(record.t, (record.fh * record.v).sum(axis=1))
        return figure

    monkeypatch.setitem(run_figures.FIGURES, "power", run_figures.RunFigure(power, ("v", "fh")))
    args = ["run", "constant", "--t-max", "0.1", "--out", str(tmp_path)]
    assert app.main(args) == 0
    plots = {"velocity.png", "force.png", "power.png"}
    files = {"record.npz", "scenario.toml", "summary.json"}
    assert {path.name for path in tmp_path.iterdir()} == plots | files
    assert app.main([*args, "--no-plots"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == files


def test_a_figure_that_does_not_apply_is_not_drawn(run, monkeypatch):
    assert set(run_figures.figures(run)) == {"velocity", "force"}
    monkeypatch.setitem(run_figures.FIGURES, "velocity", run_figures.RunFigure(lambda _: None, ()))
    assert set(run_figures.figures(run)) == {"force"}


OTHER = {  # compensator, static gain of G, and what C adds to the clay, f = (c/K + b) v
    "as printed": (hc.Compensator(), 1.0, 10.0),
    "lead": (hc.Compensator((0.5, 2.0), (1.0, 12.0, 0.0)), 1.0, 6.0),
    "gain of G": (hc.Compensator(), 1.25, 8.0),
    "cancelled s": (hc.Compensator((2.0, 0.0), (1.0, 12.0, 0.0, 0.0)), 1.0, 6.0),
    "no integrator": (hc.Compensator((1.0,), (1.0, 12.0)), 1.0, None),
    "two integrators": (hc.Compensator((1.0, 9.0), (1.0, 0.0, 0.0)), 1.0, None),
}


@pytest.mark.parametrize("name", OTHER)
def test_force_plot_shows_the_damper_of_any_compensator(name):
    c, ratio, damper = OTHER[name]
    G = hc.SecondOrder(ratio * 800.0, 45.0, 800.0)
    servo = tuple(hc.Servo(G, axis.S) for axis in hc.Scenario().servo)
    scenario = dataclasses.replace(
        hc.constant_cut(t_max=2.0, dt=1e-3, start=(0.045, 0.0)),
        gain=(1.0, 0.0),
        compensator=c,
        servo=servo,
    )
    record = hc.simulate(scenario)
    figure = run_plots.force_ratio_plot(record)
    sums = [line for line in figure.axes[0].lines if line.get_linestyle() == ":"]
    (label,) = (x for x in lines(run_plots.velocity_plot(record)) if x.startswith("expected"))
    assert (label == "expected, K f/(10 + K b)") == (name == "as printed")
    if damper is None:
        assert sums == []
        return
    assert f"{damper:g}/K + b" in lines(figure)
    expected = [damper, damper + 90.0]
    assert [line.get_ydata()[0] for line in sums][:2] == pytest.approx(expected, rel=1e-12)
    # and so the run goes, once it is in steady motion in the clay
    assert record.b[-1, 0] == 90.0
    assert record.ratio(record.fh)[-1, 0] == pytest.approx(expected[1], rel=0.02)
    still = run_plots.force_ratio_plot(record, "y")  # K = 0: no compensator
    assert not [line for line in still.axes[0].lines if line.get_linestyle() == ":"]


def test_plots_of_a_controller_of_ones_own_expect_nothing_of_the_papers():
    law = hc.Controller(lambda t, q, qd, fh, state, params: ((0.2, 0.0), state))
    scenario = hc.constant_cut(control="sampled", t_max=0.5)
    record = hc.simulate(dataclasses.replace(scenario, controller=law))
    for plot in (run_plots.velocity_plot, run_plots.force_ratio_plot):
        figure = plot(record)
        assert not [name for name in lines(figure) if "expected" in name or "/K" in name]
        told = " ".join(text.get_text() for text in figure.findobj(Text))
        assert "K =" not in told and "own controller" in told


def test_a_driven_run_in_clay_keeps_its_figures():
    clay = hc.slab(90.0, 0.02, 0.1)
    push = hc.Multisine((1.0, 0.5), 0.5, 8.0, 2.0)
    s = dataclasses.replace(hc.free(), clay=clay, muscle=push, t_max=0.5, length=None)
    driven = run_figures.figures(hc.simulate(s))
    assert {"velocity", "force", "path", "force_position"} <= set(driven)
    assert any("clay" in x.get_label() for x in driven["force"].axes[0].get_lines())
    away = run_figures.figures(hc.simulate(dataclasses.replace(s, clay=None)))
    assert "path" not in away and "velocity" not in away
    still = dataclasses.replace(s, muscle=None, clay=hc.Clay(hc.Grid((), (), ((9.0,),)), clay.y))
    assert "path" in run_figures.figures(hc.simulate(still))
