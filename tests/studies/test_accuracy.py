"""The ladder of one scenario, against the exact solution and against what it must be."""

import dataclasses

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.studies import accuracy_ladder
from hapticclay.views import accuracy_plots
from tests.oracles import piecewise_linear

SHAPED = hc.constant_cut(b=90.0, clay=(0.01, 0.02), length=0.03, inertia_shaping=True)


@pytest.fixture(scope="module")
def ladder():
    return accuracy_ladder.accuracy_ladder(SHAPED, quick=True)


def test_errors_are_those_against_the_exact_solution(ladder):
    """Where they are clear of the reference: to 40 %, as CLEAR says."""
    exact, _ = piecewise_linear((0.01, 0.02, 0.03), (0.0, 90.0, 0.0), 1.0, 1.0)
    checked = 0
    for x in ladder.settings:
        if x.series == accuracy_ladder.SAMPLED or not ladder.shown(x, "s"):
            continue
        r = hc.simulate(dataclasses.replace(SHAPED, dt=x.dt, integrator=x.series))
        true = np.abs(np.array([c.time for c in r.crossings]) - exact).max()
        assert x.time == pytest.approx(true, rel=0.4, abs=1e-12)
        checked += 1
    assert checked >= 7


def test_orders_are_two_and_four(ladder):
    for series, order in (("fast", 2.0), ("accurate", 4.0)):
        mine = [x for x in ladder.settings if x.series == series and ladder.shown(x, "s")]
        slope = np.polyfit(np.log([x.dt for x in mine]), np.log([x.time for x in mine]), 1)[0]
        assert slope == pytest.approx(order, abs=0.5), series


def test_the_cheapest_setting_keeps_the_error_and_none_is_cheaper(ladder):
    for unit in ("s", "m"):
        best = ladder.cheapest(unit)
        assert {1e-2, 1e-6} <= set(best)
        for asked, x in best.items():
            assert x.series != accuracy_ladder.SAMPLED and x.error(unit) <= asked
            cheaper = [y for y in ladder.settings if y.wall < x.wall]
            for y in cheaper:
                kept = y.error(unit) is not None and y.error(unit) <= asked
                assert not kept or y.series == accuracy_ladder.SAMPLED or not ladder.shown(y, unit)


def test_sampled_control_is_off_by_its_hold(ladder):
    """Of first order in Ts, and far above the method's own error."""
    held = {x.dt: x.position for x in ladder.settings if x.series == accuracy_ladder.SAMPLED}
    fast = {x.dt: x.position for x in ladder.settings if x.series == "fast"}
    assert all(held[dt] > 20.0 * fast[dt] for dt in held if dt < 0.01)


def test_a_sampled_scene_keeps_its_samples():
    changed = dict(control="sampled", dt=4e-3, length=0.02)
    s = hc.constant_cut(clay=(0.01, 0.015), inertia_shaping=True, **changed)
    found = accuracy_ladder.accuracy_ladder(s)
    assert {x.series for x in found.settings} == {"fast"}
    assert [x.dt for x in found.settings] == [4e-3, 2e-3, 1e-3]
    errors = [x.time for x in found.settings]
    assert found.scenario.Ts == 4e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)  # the physics, of second order


def test_too_stiff_clay_has_no_accurate_settings():
    changed = dict(length=0.015, t_max=0.5)
    s = hc.constant_cut(b=1e9, clay=(0.01, 0.02), inertia_shaping=True, **changed)
    found = accuracy_ladder.accuracy_ladder(s, quick=True)
    refused = [x for x in found.settings if x.wall is None]
    assert {x.series for x in refused} == {"accurate"} and "choose 'fast'" in refused[0].status
    assert found.reference.startswith("fast")


def test_without_borders_in_reach_there_are_positions_alone():
    found = accuracy_ladder.accuracy_ladder(dataclasses.replace(SHAPED, t_max=0.2), quick=True)
    assert found.units() == ["m"] and not found.notes
    assert len(accuracy_plots.accuracy_plot(found).axes) == 1


def test_an_unstable_loop_is_noted():
    found = accuracy_ladder.accuracy_ladder(
        hc.constant_cut(gain=(1.0, 1.0), inertia_shaping=True), quick=True
    )
    assert found.notes and found.left["s"] is None


def test_the_figure_has_a_curve_a_method_in_each_panel(ladder):
    figure = accuracy_plots.accuracy_plot(ladder)
    assert len(figure.axes) == 2
    for ax in figure.axes:
        names = ax.get_legend_handles_labels()[1]
        assert {"fast", "accurate", accuracy_ladder.SAMPLED} <= set(names)
        assert "[s]" in ax.get_xlabel() and ax.get_yscale() == ax.get_xscale() == "log"


def test_Ts_too_short_is_refused():
    with pytest.raises(ParameterError, match="Ts = 1e-05"):
        accuracy_ladder.accuracy_ladder(hc.constant_cut(control="sampled", dt=1e-5))
