"""Laws of clay come back from motions and forces, with intervals that hold the truth.

The data are made in closed form (`benchmarks/fit_coverage.py`), by noise on a record's own
velocities, or by runs of the simulator.
"""

import csv
import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize, stats
from scipy.interpolate import BSpline

import hapticclay as hc
from benchmarks import fit_coverage as coverage
from hapticclay.cli import app
from hapticclay.studies import sliding, trajectory
from hapticclay.views.fit_plots import fit_plot
from tests.hunt import examples

FINE = coverage.SENSORS["fine"]


@pytest.fixture
def short(monkeypatch):
    """Motions of the generator that last 6 s."""
    monkeypatch.setattr(coverage, "DURATION", 6.0)


def values(fitted):
    return {p.name: p.value for p in fitted.parameters}


def standing(f, p, v, **kw):
    """A record of given velocities and forces along x, in clay everywhere."""
    n = len(v)
    t = 1e-3 * np.arange(n)
    pairs = {x: np.stack([y, np.zeros(n)], axis=1) for x, y in (("p", p), ("v", v), ("fe", f))}
    record = hc.simulate(hc.Scenario(clay=hc.slab(10.0), t_max=0.01, length=None))
    return dataclasses.replace(record, t=t, b=np.full((n, 2), 10.0), **pairs, **kw)


def test_closed_forms_of_the_generator_agree():
    """Position and velocity, against central differences of fourth order at 2 ms."""
    t, p, v = coverage.motion(np.random.default_rng(1))
    h = t[1] - t[0]
    slope = (8.0 * (p[3:-1] - p[1:-3]) - (p[4:] - p[:-4])) / (12.0 * h)
    # h^4/30 of the fifth derivative of a clock that stops within 30 ms
    assert np.max(np.abs(slope - v[2:-2])) < 2e-4 * np.max(np.abs(v))
    assert np.count_nonzero(v == 0.0) > 300


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("law", coverage.TRUTHS)
def test_right_law_is_picked_and_intervals_hold_the_truth(law):
    """4 seeded trials; benchmarks/fit_coverage.py makes 200."""
    rows = [coverage.one(seed, law, "coarse") for seed in range(1000, 1004)]
    # of 2 % each, two would be picked wrongly by chance in 2e-3
    assert sum(r["picked"] == law for r in rows) >= 3
    for name, x in coverage.TRUTHS[law].items():
        missed = sum(not low <= x <= high for _, low, high in (r["parameters"][name] for r in rows))
        assert missed <= 2  # 3 of 4 at 5 % each: 5e-4
        # five half intervals of 0.95: never by chance
        for value, low, high in (r["parameters"][name] for r in rows):
            assert low <= value <= high and abs(value - x) < 2.5 * (high - low)


def test_minimum_is_that_of_all_unknowns_at_once():
    """Eliminated and banded, against SciPy's dense least squares over law and spline together."""
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 1.0, 240)
    p, v = 0.05 * np.sin(2.0 * t + 0.3) + 0.02 * t, 0.1 * np.cos(2.0 * t + 0.3) + 0.02
    law = trajectory.ForceLaw(("Fy", "K", "n"))
    truth = np.array([2.0, math.log(15.0), 0.5])
    keep = np.flatnonzero(v > 0.03)
    f = law.force(truth, v[keep]) + 0.05 * rng.standard_normal(len(keep))
    p = p + 2e-5 * rng.standard_normal(len(t))
    motion = trajectory.Motion([trajectory.Stretch(t, (0.4,))], 0.2, keep)
    ratio = (0.05 / 2e-5) ** 2
    joint = trajectory.JointFit(f, p, motion, motion.follow(p), ratio, 1e-3)
    found = joint.solve(law, np.array([1.5, 2.0, 0.7]))

    k = trajectory.DEGREE
    inner = [*np.linspace(0.0, 0.4, 3)[1:], 0.4, 0.4, *np.linspace(0.4, 1.0, 4)[1:-1]]
    knots = np.concatenate((np.zeros(k + 1), inner, np.ones(k + 1)))
    size = len(knots) - k - 1

    def rests(x):
        spline = BSpline(knots, x[3:], k)
        force = x[0] + np.exp(x[1]) * spline.derivative()(t[keep]) ** x[2]
        return np.concatenate((math.sqrt(ratio) * (p - spline(t)), f - force))

    start = np.concatenate(([1.5, 2.0, 0.7], BSpline(knots, np.eye(size), k)(t).T @ p * 0.0))
    start[3:] = np.linalg.lstsq(BSpline.design_matrix(t, knots, k).toarray(), p, rcond=None)[0]
    dense = optimize.least_squares(rests, start, x_scale="jac", xtol=1e-12, ftol=1e-14, gtol=1e-12)
    # SciPy's Jacobian is of finite differences: 1e-6 of a parameter
    np.testing.assert_allclose(found.theta, dense.x[:3], rtol=1e-4)
    spread = np.linalg.inv(dense.jac.T @ dense.jac)[:3, :3]
    np.testing.assert_allclose(found.spread, spread, rtol=1e-3)
    alone = ratio * np.sum((p - BSpline(knots, start[3:], k)(t)) ** 2)
    assert found.sum == pytest.approx(2.0 * dense.cost - alone, rel=1e-6)


@pytest.mark.parametrize("law, names", [("Bingham", ("Fy", "b")), ("Herschel-Bulkley", "Fy K n")])
def test_of_known_velocities_the_fit_is_that_of_the_textbook(law, names):
    """Values and intervals, against linear regression and SciPy's curve_fit."""
    rng = np.random.default_rng(5)
    v = 0.1 * np.sin(np.linspace(0.2, 40.0, 20000))
    truth = hc.Flow(**{"Fy": 2.0} | ({"b": 30.0} if law == "Bingham" else {"K": 15.0, "n": 0.6}))
    f = truth.force(v) + 0.1 * rng.standard_normal(len(v))
    fitted = hc.studies.fit_flow(standing(f, np.cumsum(v) * 1e-3, v), "x", level=0.9)
    assert fitted.law == law
    v, f = np.abs(fitted.v), fitted.f * np.sign(fitted.v)
    quantile = stats.t.ppf(0.95, len(v) - len(fitted.parameters))
    if law == "Bingham":
        line = stats.linregress(v, f)
        best = {"Fy": line.intercept, "b": line.slope}
        half = {"Fy": quantile * line.intercept_stderr, "b": quantile * line.stderr}
        tight = 1e-5  # a linear law's profile is a parabola, found within 1e-2 of its height
    else:
        best, C = optimize.curve_fit(
            lambda v, Fy, K, n: Fy + K * v**n, v, f, [1.0, 10.0, 0.5], xtol=1e-12, ftol=1e-12
        )
        best = dict(zip(("Fy", "K", "n"), best, strict=True))
        half = dict(zip(best, quantile * np.sqrt(np.diag(C)), strict=True))
        tight = 1e-4
    for p in fitted.parameters:
        assert p.value == pytest.approx(best[p.name], rel=tight)
        # a curved law's ends are unlike: the mean of both is that of the tangent within 5 %
        assert 0.5 * (p.high - p.low) == pytest.approx(half[p.name], rel=0.05)


def test_a_record_gives_back_its_own_clay():
    """Noise-free: within 1e-4, what is left to splines and steps."""
    cut = hc.studies.fit_flow(hc.simulate(hc.constant_cut(b=90.0, dt=1e-3)))
    assert cut.law == "viscous" and cut.flow.b == pytest.approx(90.0, rel=1e-6)
    assert any("factor" in x for x in cut.warnings)  # a cut's speed hardly changes
    layers = hc.Profile((0.05, 0.1, 0.15), (0.0, 40.0, 90.0, 0.0))
    scene = dataclasses.replace(hc.constant_cut(dt=1e-3), clay=hc.Clay(layers, layers))
    cuts = hc.simulate(scene)
    with pytest.raises(hc.ParameterError, match="one law: choose a part"):
        hc.studies.fit_flow(cuts)
    part = hc.studies.fit_flow(cuts, place=(0.051, 0.099))
    assert part.flow.b == pytest.approx(40.0, rel=1e-6)
    wall = hc.Profile((0.1,), (40.0, 40.0), springs=(hc.Spring(), hc.Spring(k=100.0)))
    press = hc.constant_cut(t_max=12.0, dt=2e-3)
    hit = hc.simulate(dataclasses.replace(press, clay=hc.Clay(wall, wall)))
    with pytest.raises(hc.ParameterError, match="springs.*from the velocity alone"):
        hc.studies.fit_flow(hit)
    assert hc.studies.fit_flow(hit, place=(0.0, 0.099)).flow.b == pytest.approx(40.0, rel=1e-6)
    field = hc.Smooth((0.0, 0.2), (-0.1, 0.1), ((50.0,), (50.0,)))
    cut = hc.constant_cut(t_max=3.0, dt=1e-3)
    even = hc.simulate(dataclasses.replace(cut, clay=hc.Clay(field, field)))
    assert hc.studies.fit_flow(even).flow.b == pytest.approx(50.0, rel=1e-6)


PUSH = hc.Samples(
    0.01 * np.arange(801),
    [(8.0 * math.sin(2.2 * t) + 5.0 * math.sin(6.9 * t), 0.0) for t in 0.01 * np.arange(801)],
)
FLOWS = {
    "Bingham": hc.Flow(Fy=2.0, b=40.0),
    "power law": hc.Flow(K=12.0, n=0.4),
    "Herschel-Bulkley": hc.Flow(Fy=2.0, K=15.0, n=0.5),
}


@pytest.mark.parametrize("law", FLOWS)
def test_runs_through_encoder_and_converter_tell_their_clay(law):
    """A run that sticks and slides: of the record, and of what 16-bit encoders and an ADC see."""
    flow = FLOWS[law]
    clay = dataclasses.replace(hc.slab(flow), isotropic=False)
    scene = hc.Scenario(clay=clay, muscle=PUSH, force=(0.0, 0.0), length=None, t_max=5.0, dt=1e-3)
    record = hc.simulate(scene)
    assert record.outcome.code == "time limit", record.status
    own = hc.studies.fit_flow(record)
    assert own.law == law
    for p in own.parameters:
        assert p.value == pytest.approx(getattr(flow, p.name), rel=1e-3)
    rng = np.random.default_rng(2)
    count = 2.0 * math.pi * 0.3 / 65536
    x = record.p[:, 0] + 1e-5 * rng.standard_normal(len(record.t))
    f = record.fe[:, 0] + 0.05 * rng.standard_normal(len(record.t))
    seen = hc.studies.Measurement(record.t, 0.02 * np.round(f / 0.02), count * np.round(x / count))
    fitted = hc.studies.fit_flow(seen, level=0.99)
    assert fitted.law == law
    for p in fitted.parameters:
        assert p.low <= getattr(flow, p.name) <= p.high


def test_isotropic_clay_is_fitted_along_the_path():
    """Where both axes move, the law holds for the speed along the path."""
    flow = hc.Flow(Fy=1.0, K=10.0, n=0.5)
    n = 4000
    angle = np.linspace(0.0, 5.0, n)
    v = (0.02 + 0.08 * np.linspace(0.0, 1.0, n) ** 2)[:, None] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=1
    )
    speed = np.hypot(*v.T)
    record = standing(np.zeros(n), np.zeros(n), speed)
    scene = dataclasses.replace(record.scenario, clay=hc.slab(flow))
    p = np.cumsum(v, axis=0) * 1e-3
    fe = flow.force(speed)[:, None] * v / speed[:, None]
    record = dataclasses.replace(record, v=v, p=p, fe=fe, scenario=scene)
    fitted = hc.studies.fit_flow(record)
    assert (fitted.axis, fitted.law) == ("path", "Herschel-Bulkley")
    for name, x in values(fitted).items():
        assert x == pytest.approx(getattr(flow, name), rel=1e-3)
    with pytest.raises(hc.ParameterError, match="axes yield by themselves"):
        apart = dataclasses.replace(scene, clay=dataclasses.replace(scene.clay, isotropic=False))
        hc.studies.fit_flow(dataclasses.replace(record, scenario=apart), "path")


@examples(3)
@given(
    st.sampled_from(sorted(coverage.TRUTHS)),
    st.sampled_from([0.125, 4.0, 64.0]),
    st.sampled_from([-1.0, 1.0]),
    st.floats(-5.0, 5.0),
)
def test_units_direction_and_zeros_do_not_matter(law, scale, way, zero):
    data = coverage.measured(law, 7, FINE._replace(position_count=0.0, force_count=0.0))
    few = slice(0, 2000)
    f, p = data.input[few], data.output[few]
    a = hc.studies.fit_flow(hc.studies.Measurement(data.t[few], f, p))
    b = hc.studies.fit_flow(
        hc.studies.Measurement(data.t[few] + zero, way * scale * f, way * p + zero)
    )
    assert a.law == b.law
    for x, y in zip(a.parameters, b.parameters, strict=True):
        factor = 1.0 if x.name == "n" else scale
        # the zero costs digits of the position, 1e-15 of 5 m beside noise of 2e-5 m
        assert y.value == pytest.approx(factor * x.value, rel=1e-5)
        assert (y.high - y.low) == pytest.approx(factor * (x.high - x.low), rel=0.03)


def test_correlation_time_is_that_of_the_noise():
    """White noise: 1. x' = 0.8 x + e: (1 + 0.8)/(1 - 0.8) = 9."""
    rng = np.random.default_rng(4)
    e = rng.standard_normal(40000)
    x = np.zeros(len(e))
    for i in range(1, len(e)):
        x[i] = 0.8 * x[i - 1] + e[i]
    assert trajectory.correlation_time(e) == pytest.approx(1.0, abs=0.05)
    assert trajectory.correlation_time(x) == pytest.approx(9.0, rel=0.15)  # 3 deviations
    assert trajectory.correlation_time(np.zeros(100)) == 1.0


def test_intervals_widen_for_noise_that_is_correlated():
    """Noise of the same size with a correlation time of 9 moves the fit three times as far."""
    v = 0.05 + 0.03 * np.sin(np.linspace(0.0, 60.0, 6000))
    missed = 0
    for seed in range(30):
        e = 0.1 * np.random.default_rng(seed).standard_normal(len(v) + 200)
        x = np.zeros(len(e))
        for i in range(1, len(e)):
            x[i] = 0.8 * x[i - 1] + e[i]
        record = standing(60.0 * v + x[200:], np.cumsum(v) * 1e-3, v)
        fitted = hc.studies.fit_flow(record, laws=["viscous"])
        assert 5.0 < fitted.correlation < 16.0
        missed += not fitted.parameters[0].low <= 60.0 <= fitted.parameters[0].high
    assert missed <= 5  # 1.5 expected; more than 5: 3e-3. Without, half of them would miss


def test_limits_of_a_claim_are_told():
    rng = np.random.default_rng(8)

    def told(p, f, t=None, **kw):
        t = 2e-3 * np.arange(len(p)) if t is None else t
        return " | ".join(hc.studies.fit_flow(hc.studies.Measurement(t, f, p), **kw).warnings)

    t = 2e-3 * np.arange(3000)
    v = 0.05 + 0.01 * np.sin(3.0 * t)
    p = 0.05 * t - 0.01 / 3.0 * np.cos(3.0 * t) + 2e-5 * rng.standard_normal(len(t))
    noise = 0.1 * rng.standard_normal(len(t))
    narrow = told(p, 60.0 * v + noise)
    assert "middle 96 % of samples range over a factor of 1.5 only" in narrow
    assert "may not be in SI units" in told(1e3 * p, 60.0 * v + noise)  # mm
    assert "fewer than 300" in told(p[:250], (60.0 * v + noise)[:250])
    assert "rounded to 1 N" in told(p, np.round(60.0 * v + 0.1 * noise))
    x, w = 0.05 * np.sin(2.0 * t), 0.1 * np.cos(2.0 * t)
    swing = x + 2e-5 * rng.standard_normal(len(t))
    spring = told(swing, 60.0 * w + 20.0 * x + noise)
    assert "no candidate explains" in spring and "correlated over" in spring
    assert "forward and backward differs by" in told(swing, 60.0 * w + 1.0 + noise)
    assert told(swing, 60.0 * w + noise) == ""


@pytest.mark.usefixtures("short")
def test_what_cannot_be_fitted_is_refused():
    data = coverage.measured("Bingham", 1, FINE)
    for kw, words in (
        ({"laws": ("bingam",)}, "did you mean 'Bingham'"),
        ({"laws": ()}, "must name one of"),
        ({"level": 1.0}, "level"),
        ({"axis": "z"}, "axis"),
        ({"time": (50.0, 60.0)}, "50 samples or more"),
        ({"time": (1.0,)}, "2 numbers"),
        ({"time": (7.0, 3.0)}, "time .*must ascend"),
        ({"place": (0.1, 0.1)}, "place .*must ascend"),
    ):
        with pytest.raises(hc.ParameterError, match=words):
            hc.studies.fit_flow(data, **kw)
    with pytest.raises(hc.ParameterError, match="must resist"):
        hc.studies.fit_flow(hc.studies.Measurement(data.t, -data.input, data.output))
    rng = np.random.default_rng(1)
    rest = hc.studies.Measurement(data.t, data.input, 1e-5 * rng.standard_normal(len(data.t)))
    with pytest.raises(hc.ParameterError, match="that slide"):
        hc.studies.fit_flow(rest)
    with pytest.raises(hc.ParameterError, match="a record with clay"):
        hc.studies.fit_flow(hc.simulate(hc.free(t_max=0.1)))
    block = hc.Groove(x=(0.02, 0.08), y=(-0.02, 0.02), pressure=20e3)
    grooved = dataclasses.replace(hc.free(t_max=0.1), clay=hc.Clay.of_groove(block))
    with pytest.raises(hc.ParameterError, match="which has no law of speed"):
        hc.studies.fit_flow(hc.simulate(grooved))
    with pytest.raises(hc.ParameterError, match="data = 3: must be a Measurement"):
        hc.studies.fit_flow(3)  # pyright: ignore[reportArgumentType]
    assert hc.studies.fit_flow(data, laws="power-law").law == "power law"


def test_counts_are_found_in_what_is_quantised():
    x = np.random.default_rng(0).standard_normal(1000)
    assert sliding.quantum(x) == 0.0 and sliding.quantum(np.ones(9)) == 0.0
    assert sliding.quantum(0.02 * np.round(x / 0.02)) == pytest.approx(0.02)
    assert sliding.quantum(3.0 + 1e-4 * np.round(x / 1e-4)) == pytest.approx(1e-4)


@pytest.mark.usefixtures("short")
def test_command_reads_columns_and_writes_table_json_and_figure(tmp_path, capsys):
    data = coverage.measured("Herschel-Bulkley", 11, FINE)
    file, out = tmp_path / "rig.csv", tmp_path / "out"
    with open(file, "w", newline="") as f:
        rows = csv.writer(f)
        rows.writerow(("time", "pos", "force"))
        rows.writerows(np.stack([data.t, data.output, data.input], axis=1).tolist())
    columns = [str(file), "--columns", "t=time", "p=pos", "f=force"]
    words = ["fit", *columns, "--dpi", "60", "--out", str(out)]
    assert app.main([*words, "--level", "0.9", "--laws", "power law", "herschel-bulkley"]) == 0
    shown = capsys.readouterr().out
    assert "90 % interval" in shown and "Herschel-Bulkley: " in shown
    found = json.loads((out / "fit.json").read_text())
    assert (found["schema"], found["law"]) == ("hapticclay-fit-1", "Herschel-Bulkley")
    assert [c["law"] for c in found["candidates"]] == ["power law", "Herschel-Bulkley"]
    assert found["candidates"][0]["parameters"][0]["low"] is None
    assert found["units"]["parameters"]["K"] == "N/(m/s)^n" and found["versions"]["hapticclay"]
    for p in found["parameters"]:
        assert p["low"] < coverage.TRUTHS["Herschel-Bulkley"][p["name"]] < p["high"]
    assert (out / "fit.png").stat().st_size > 20000
    record = hc.simulate(hc.constant_cut(t_max=8.0, dt=1e-3)).save(tmp_path / "run")
    assert app.main(["fit", str(record), "--out", str(out), "--time", "5.5", "8"]) == 0
    assert "viscous: " in capsys.readouterr().out
    two = tmp_path / "two.csv"
    two.write_text("t,p,fx,fy\n0,1,2,3\n")
    for more, words in (
        ([str(file), "--columns", "t=time", "p=position", "f=force"], "columns.p = 'position'"),
        ([str(file), "--columns", "x=time"], "must be one of t, p, f"),
        ([str(record), "--columns", "t=time"], "is for a log"),
        ([str(two)], "columns.f = 'f': must name the column of force, one of fx, fy; give --col"),
        ([*columns, "--axis", "y"], "axis = 'y': is for a record"),
        ([str(record / "scenario.toml")], "not a scenario"),
        ([str(record), "--time", "7", "3"], "must ascend"),
        ([str(tmp_path / "none.csv")], "must be a readable file"),
        ([str(file), "--lwas", "viscous"], "did you mean --laws?"),
    ):
        assert app.main(["fit", *more, "--out", str(out)]) == 2
        assert words in capsys.readouterr().err


@pytest.mark.usefixtures("short")
def test_figure_shows_data_law_and_what_is_left():
    fitted = hc.studies.fit_flow(coverage.measured("Bingham", 3, FINE))
    law, speed, time, lag = fit_plot(fitted).axes
    np.testing.assert_allclose(law.lines[0].get_ydata(), fitted.f[: len(fitted.f)][_shown(fitted)])
    curve = law.lines[2]  # forward
    assert np.asarray(curve.get_ydata()) == pytest.approx(
        4.0 + 40.0 * np.asarray(curve.get_xdata()), rel=5e-3
    )
    assert "time [s]" in time.get_xlabel() and "velocity" in speed.get_xlabel()
    assert "autocorrelation" in lag.get_ylabel()
    # a straight line's band, from the covariance of both ends
    half = fitted.band([0.1, -0.1])
    J = np.array([1.0, 0.1])
    assert half == pytest.approx(1.9605 * math.sqrt(J @ fitted.covariance @ J), rel=1e-3)


def _shown(fitted):
    return np.unique(np.linspace(0, len(fitted.v) - 1, 6000).astype(int))
