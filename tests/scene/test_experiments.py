"""The experiments beside exact solutions: variable cut (Figs. 9, 10), stability test (Fig. 11)."""

import dataclasses
import functools
import inspect
import pickle

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.scene import experiments
from tests.oracles import Linear, piecewise_linear

F = np.sqrt(0.5)  # 1 N at 45 degrees, on each axis


@functools.cache
def without_growth(shaping):
    """The variable cut in clay that does not grow; to 1e-7 m with shaping, to 0.1 % without."""
    dt = 3.6e-4 if shaping else 1e-3
    return hc.simulate(hc.variable_cut("none", inertia_shaping=shaping, dt=dt))


def crossings(r, axis):
    return [c for c in r.crossings if c.axis == axis and c.border == 0.05]


@pytest.mark.parametrize(
    "axis,K,time,before,after",
    [
        (0, 1.0, 4.26391, 0.011785, 0.006428),
        (1, 0.5, 4.98811, 0.010102, 0.005893),
    ],
)
def test_variable_cut_without_growth(axis, K, time, before, after):
    exact, position = piecewise_linear((0.05, 9.0), (50.0, 100.0), K, F, axis=axis, t_max=12.0)
    assert exact[0] == pytest.approx(time, abs=5e-6)  # half the last digit
    name = "xy"[axis]
    for shaping in (True, False):
        r = without_growth(shaping)
        assert r.outcome.code == "finished"
        c = crossings(r, name)[0]
        # without shaping the axes couple through Lambda(q): both numbers within 0.1 %
        assert c.time == pytest.approx(exact[0], rel=1e-6 if shaping else 1e-3)
        speeds = [piece[name]["steady_speed"] for piece in r.regions(name)]
        assert speeds == pytest.approx([before, after], rel=1e-3)
        assert speeds == pytest.approx([K * F / (10.0 + K * b) for b in (50.0, 100.0)], rel=1e-3)
        if shaping:
            # but the last, off the grid, for which the oracle would take every sample by itself
            assert np.max(np.abs(r.p[:-1, axis] - position(r.t[:-1]))) < 1e-7


def test_each_axis_changes_by_its_own_coordinate():
    r = without_growth(False)
    for i in (0, 1):
        inside = r.p[:, i] > 0.05 + 1e-9
        assert np.all(r.b[inside, i] == 100.0)
        assert np.all(r.b[r.p[:, i] < 0.05 - 1e-9, i] == 50.0)


@pytest.mark.parametrize(
    "reading,rate", [("30/s", 30.0), ("0.15/s", 0.15), ("0.15/sample", 0.15 / 0.36e-3)]
)
def test_growth_readings(reading, rate):
    r = hc.simulate(hc.variable_cut(reading, t_max=12.0))
    c = crossings(r, "x")[0]
    late = r.t > c.time
    np.testing.assert_allclose(r.b[late, 0], 100.0 + rate * (r.t[late] - c.time), rtol=1e-12)


def test_with_growth_the_speed_falls_monotonically_and_follows_the_clay():
    r = hc.simulate(hc.variable_cut(inertia_shaping=True))
    c = crossings(r, "x")[0]
    late = np.flatnonzero(
        r.t > c.time + 2.0
    )  # the step at the border has rung down: slowest poles, -3.7 1/s
    v, b = r.v[late, 0], r.b[late, 0]
    assert np.all(np.diff(v) < 0.0)
    quasi = F / (10.0 + b)
    # b grows by 30/(10 + b) a second, the loop settles within (41.8/910 + 0.1) s or so
    lag = 30.0 / (10.0 + b) * 0.2
    assert np.all(np.abs(v / quasi - 1.0) < lag)
    assert r.v[np.searchsorted(r.t, c.time), 0] > 1.5 * v[0]


def test_as_printed_y_is_unstable():
    r = hc.simulate(hc.variable_cut(as_printed=True))
    assert (r.outcome.code, r.outcome.axis) == ("diverged", "y")
    assert Linear(1, 100.0, 1.0, F).poles().real.max() == pytest.approx(2.36, abs=5e-3)
    with pytest.raises(ParameterError, match="as_printed"):
        hc.variable_cut(as_printed=True, gain=(2.0, 0.5))


@pytest.mark.parametrize("K,settles", [(2.0, True), (3.0, True), (25.0, False)])
@pytest.mark.parametrize("seed", [0, 1])
def test_stability_test(K, settles, seed):
    r = hc.simulate(hc.stability_test(K, seed=seed, t_max=12.0))
    stable = Linear(0, 100.0, K, 0.0, (0.25, 2.0, 6.0)).poles().real.max() < 0.0
    assert stable == settles
    assert (r.outcome.code == "time limit") == settles, r.status
    irregular = hc.out_of_band_ratio(r)
    assert irregular < 0.02 if settles else irregular > 0.5
    if settles:
        # the force is the answer of the linear loop to the muscle, line by line
        assert np.max(np.abs(r.fh)) < 4.0
    else:
        assert r.outcome.code == "limit cycle" and np.max(np.abs(r.tau)) == 40.0
        assert np.sqrt(np.mean(r.fh[:, 0] ** 2)) > 5.0


def test_out_of_band_ratio_of_made_up_forces():
    r = hc.simulate(hc.stability_test(t_max=4.0))
    rng = np.random.default_rng(0)

    def of(f):
        return hc.out_of_band_ratio(dataclasses.replace(r, fh=np.column_stack((f, 0.0 * f))))

    assert of(np.sin(2 * np.pi * 1.0 * r.t)) < 1e-2
    assert of(np.sin(2 * np.pi * 20.0 * r.t)) > 0.99
    assert of(np.sin(2 * np.pi * r.t) + np.sin(2 * np.pi * 20.0 * r.t)) == pytest.approx(
        np.sqrt(0.5), rel=0.02
    )
    assert of(rng.normal(size=len(r.t))) > 0.9
    with pytest.raises(ParameterError):
        hc.out_of_band_ratio(hc.simulate(hc.free(t_max=0.1)))


@pytest.mark.parametrize(
    "kw,field",
    [
        (dict(growth="31/s"), "growth"),
        (dict(growth=-1.0), "growth"),
        (dict(b=(50.0,)), "b"),
        (dict(border=1j), "border"),
        (dict(gain=(0.0, 0.5)), "gain[x]"),
    ],
)
def test_bad_variable_cuts(kw, field):
    with pytest.raises(ParameterError) as e:
        hc.variable_cut(**kw)
    assert e.value.field == field


@pytest.mark.parametrize(
    "kw,field",
    [
        (dict(axis="z"), "axis"),
        (dict(gain=0.0), "gain"),
        (dict(rms=-1.0), "rms"),
        (dict(seed=-1), "seed"),
    ],
)
def test_bad_stability_tests(kw, field):
    with pytest.raises(ParameterError) as e:
        hc.stability_test(**kw)
    assert e.value.field == field


def test_every_experiment_has_a_factory_of_the_same_scenario():
    assert list(experiments.EXPERIMENTS) == ["constant", "variable", "stability", "free"]
    assert list(hc.SCENARIOS) == list(experiments.EXPERIMENTS)
    named = (hc.constant_cut, hc.variable_cut, hc.stability_test, hc.free)
    for kind, make, public in zip(
        experiments.EXPERIMENTS.values(), hc.SCENARIOS.values(), named, strict=True
    ):
        assert kind().scenario() == make() == public() and isinstance(make(), hc.Scenario)
        assert inspect.signature(public).parameters == inspect.signature(kind).parameters
        assert pickle.loads(pickle.dumps(public)) is public
        for name in inspect.signature(public).parameters:
            assert f"\n    {name}: " in (public.__doc__ or "")


def test_the_first_parameters_are_positional():
    assert hc.constant_cut(50.0, (2.0, 0.4), (0.5, 0.0)) == hc.constant_cut(
        b=50.0, gain=(2.0, 0.4), force=(0.5, 0.0)
    )
    assert hc.free((2.0, 0.4), (0.5, 0.0)) == hc.free(gain=(2.0, 0.4), force=(0.5, 0.0))
    assert hc.variable_cut("none", (2.0, 0.4)) == hc.variable_cut(growth="none", gain=(2.0, 0.4))
    assert hc.stability_test(2.0, 50.0, "y", 0.5, 3) == hc.stability_test(
        gain=2.0, b=50.0, axis="y", rms=0.5, seed=3
    )


@pytest.mark.parametrize("name", experiments.EXPERIMENTS)
def test_a_flag_is_the_nominal_operator(name):
    kind = experiments.EXPERIMENTS[name]
    for on, operator in ((True, hc.Operator()), (False, None)):
        assert kind.of({"operator": on}) == hc.SCENARIOS[name](operator=operator)
    with pytest.raises(ParameterError, match="operator = 1: must be"):
        kind.of({"operator": 1})
