"""Whole runs against independent solutions (oracles.py), not against earlier runs."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.simulation import run
from tests.hunt import examples
from tests.oracles import Linear, nonlinear, piecewise_linear, store

EDGES = (0.05, 0.15, 0.20)
TH = (0.25, 2.0, 6.0)


def times(record):
    return np.array([c.time for c in record.crossings])


def test_exact_solution_has_the_published_borders():
    """The oracle itself, against the expected values derived from the paper."""
    t, _ = piecewise_linear(EDGES, (0, 90, 0), 1.0, 1.0)
    np.testing.assert_allclose(t, [0.62730, 10.51276, 11.12730], atol=5e-6)
    t, _ = piecewise_linear(EDGES, (0, 90, 0), 1.0, 2.0, TH)
    np.testing.assert_allclose(t, [0.43825, 7.71517, 8.43288], atol=5e-6)


@pytest.mark.parametrize(
    "impedance,force", [(False, 1.0), (True, 2.0)], ids=["hand off", "hand on"]
)
def test_shaped_cut_against_the_exact_solution(impedance, force):
    th = TH if impedance else (0, 0, 0)
    exact, position = piecewise_linear(EDGES, (0, 90, 0), 1.0, force, th)
    for dt, border, place in ((3.6e-4, 1e-6, 1e-7), (2e-3, 1e-5, 3e-6)):
        r = hc.simulate(
            hc.constant_cut(
                force=(force, 0.0),
                operator=hc.Operator() if impedance else None,
                inertia_shaping=True,
                dt=dt,
            )
        )
        assert r.outcome.code == "finished"
        np.testing.assert_allclose(times(r), exact, atol=border)
        np.testing.assert_allclose(r.p[:-1, 0], position(r.t[:-1]), atol=place)
        assert np.max(np.abs(r.p[:, 1])) < place  # decoupled


CASES = {
    "plain": dict(),
    "hand": dict(operator=hc.Operator(), force=(2.0, 0.0)),
    "off axis": dict(force=(1.0, 0.3)),
    "off axis, shaped": dict(force=(1.0, 0.3), inertia_shaping=True),
    "off axis, hand, shaped": dict(force=(2.0, -0.5), inertia_shaping=True, operator=hc.Operator()),
}


@pytest.mark.parametrize("name", CASES)
def test_second_order_against_the_nonlinear_arm(name):
    """Both axes in clay:

    error at 0.36 ms, and convergence order 2 +- 0.2 fitted over four steps.
    """
    s = hc.constant_cut(**CASES[name])
    th = TH if s.operator else None
    grid = np.arange(1, 400) * 0.024  # in every dt below
    x = store.solution(
        f"second-order-{name}",
        nonlinear,
        (0, 90, 0),
        EDGES,
        s.gain,
        s.force,
        th,
        s.inertia_shaping,
        60.0,
        grid,
    )
    exact, t, p = x.crossings, x.t, x.p
    assert len(exact) == 3
    r = hc.simulate(s)
    np.testing.assert_allclose(times(r), exact, atol=1e-6)
    steps = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    border, place = [], []
    for dt in steps:
        r = hc.simulate(dataclasses.replace(s, dt=float(dt)))
        i = np.rint(t / dt).astype(int)
        place.append(np.max(np.linalg.norm(r.p[i] - p, axis=1)))
        border.append(np.max(np.abs(times(r) - exact)))
    for error in (place, border):
        order = np.polyfit(np.log(steps), np.log(error), 1)[0]
        assert 1.8 < order < 2.5, error
    assert place[-1] < 3e-7 and border[-1] < 1e-6


stable_cut = {
    "b": st.floats(1.0, 1000.0),
    "K": st.floats(0.2, 2.0),
    "f": st.floats(0.1, 5.0),
}


@examples(10)
@given(**stable_cut, hand=st.booleans())
def test_any_stable_shaped_cut(b, K, f, hand):
    th = TH if hand else (0, 0, 0)
    # keep a margin: beside the stability limit any error grows with the number of swings
    assume(
        all(
            Linear(i, c, K if i == 0 else 0.2, f, th).poles().real.max() < 1e-9
            for i in (0, 1)
            for c in (0, b)
        )
    )
    assume(np.sort(Linear(0, b, K, f, th).poles().real)[-2] < -0.02)
    s = hc.constant_cut(
        b=b,
        gain=(K, 0.2),
        force=(f, 0.0),
        operator=hc.Operator() if hand else None,
        inertia_shaping=True,
        t_max=8.0,
    )
    exact, position = piecewise_linear(EDGES, (0, b, 0), K, f, th, t_max=8.0)
    exact = [t for t in exact if t < 8.0]
    r = hc.simulate(s)
    found = times(r)
    if len(found) > len(
        exact
    ):  # it swung back over a border, which the exact solution does not follow
        assume(False)
    np.testing.assert_allclose(found, exact, rtol=2e-3)
    n = np.searchsorted(r.t, (*exact, 8.0)[-1 if len(exact) < 3 else 2])
    scale = max(
        1.0, f * b / 50.0
    )  # the error of a kick grows with the jump of acceleration at the border
    np.testing.assert_allclose(r.p[: n - 1, 0], position(r.t[: n - 1]), atol=3e-6 * scale)


@examples(3)
@given(**stable_cut)
def test_any_stable_cut_without_shaping(b, K, f):
    assume(K < 0.6 * min(hc.theory.gain_limit("x", b), 3.0))
    Ky = 0.3 * min(hc.theory.gain_limit("y", b), 1.0)
    s = hc.constant_cut(b=b, gain=(K, Ky), force=(f, 0.0), t_max=3.0)
    exact, *_ = nonlinear((0, b, 0), EDGES, s.gain, s.force, t_max=3.0, rtol=1e-7, atol=1e-9)
    r = hc.simulate(s)
    assume(len(r.crossings) == len(exact) and r.outcome.code != "diverged")
    np.testing.assert_allclose(times(r), exact, rtol=2e-3)


def test_clay_force_and_speeds_of_the_default_cut():
    r = hc.simulate(hc.constant_cut())
    inside = (r.p[:, 0] >= 0.05) & (r.p[:, 0] < 0.15)
    assert np.all(r.fe[~inside] == 0.0)
    steady = r.steady()[:, 0] & inside
    assert steady.sum() > 20_000
    np.testing.assert_allclose(r.ratio(r.fe)[steady, 0], 90.0, rtol=1e-3)
    np.testing.assert_allclose(r.v[steady, 0], 1.0 / (10.0 + 90.0), rtol=1e-3)
    np.testing.assert_allclose(r.ratio(r.fh)[steady, 0], 100.0, rtol=1e-3)


@given(b=st.floats(1, 500), K=st.floats(0.2, 1.0), f=st.floats(0.5, 2.0))
@examples(8)
def test_steady_speed_law(b, K, f):
    assume(K < 0.5 * hc.theory.gain_limit("x", b))
    r = hc.simulate(
        hc.constant_cut(
            b=b, gain=(K, 0.1), force=(f, 0.0), start=(0.06, 0.0), inertia_shaping=True, t_max=4.0
        )
    )
    inside = r.b[:, 0] > 0.0
    last = np.flatnonzero(inside & r.steady()[:, 0])
    assume(len(last))
    assert r.v[last[-1], 0] == pytest.approx(K * f / (10 + K * b), rel=1e-3)


def test_free_run_is_exact_to_second_order():
    exact, position = piecewise_linear((0.20,), (0.0,), 1.0, 1.0)
    r = hc.simulate(hc.free(inertia_shaping=True))
    np.testing.assert_allclose(times(r), exact, atol=1e-6)
    np.testing.assert_allclose(r.p[:-1, 0], position(r.t[:-1]), atol=1e-7)
    assert np.all(r.fe == 0.0) and np.all(r.b == 0.0)


def test_run_ends_on_the_border_and_on_time():
    r = hc.simulate(hc.constant_cut(b=5.0))
    assert r.p[-1, 0] == pytest.approx(0.20, abs=1e-15)
    assert r.t[-1] == r.crossings[-1].time == r.outcome.time
    assert np.all(np.diff(r.t) > 0.0)
    r = hc.simulate(hc.constant_cut(t_max=0.1001))
    assert r.t[-1] == 0.1001 and r.outcome.code == "time limit"
    r = hc.simulate(hc.constant_cut(t_max=1e-5))
    assert list(r.t) == [0.0, 1e-5]


def test_start_inside_the_clay():
    exact, _ = piecewise_linear((0.15, 0.20), (90, 0), 1.0, 1.0, z0=[0.1, 0, 0.1, 0, 0.1, 0, 1])
    r = hc.simulate(hc.constant_cut(start=(0.1, 0.0), inertia_shaping=True))
    np.testing.assert_allclose(times(r), exact, atol=1e-6)
    assert r.fe[0, 0] == 0.0 and r.b[0, 0] == 90.0


def test_opposing_force_leaves_through_the_near_border():
    r = hc.simulate(
        hc.constant_cut(start=(0.06, 0.0), force=(-1.0, 0.0), inertia_shaping=True, t_max=3.0)
    )
    exact, _ = piecewise_linear((0.01,), (90,), 1.0, 1.0)  # 1 cm of clay, mirrored
    assert r.crossings[0].border == 0.05 and r.crossings[0].speed < 0.0
    assert r.crossings[0].time == pytest.approx(exact[0], abs=1e-6)


def test_no_force_no_motion():
    r = hc.simulate(hc.constant_cut(force=(0.0, 0.0), t_max=2.0))
    assert np.max(np.abs(r.v)) < 1e-12 and r.outcome.code == "stalled"


@pytest.mark.parametrize("b", [9000.0, 1e5, 1e6, 1e9])
@pytest.mark.parametrize("inertia_shaping", [False, True])
def test_stiff_clay_stops_the_handle_where_it_should(b, inertia_shaping):
    s = hc.constant_cut(b=b, inertia_shaping=inertia_shaping, t_max=3.0)
    r = hc.simulate(s)
    assert r.outcome.code in ("time limit", "stalled")
    if inertia_shaping:
        _, position = piecewise_linear(EDGES, (0, b, 0), 1.0, 1.0, t_max=3.0)
        expected = position(np.array([3.0]))[0]
    else:  # quasi-static beyond the border
        expected = 0.05 + (3.0 - r.crossings[0].time) / (10 + b) + 0.126 / b
    assert r.p[-1, 0] == pytest.approx(expected, abs=2e-5)
    energy = r.v[:, 0] ** 2
    assert np.max(energy) < 1.1 * 0.1001**2


def test_every_keeps_every_nth_sample_and_the_last():
    full = hc.simulate(hc.constant_cut(t_max=1.0))
    thin = hc.simulate(hc.constant_cut(t_max=1.0), every=7)
    np.testing.assert_array_equal(thin.p[:-1], full.p[:-1][::7][: len(thin.p) - 1])
    np.testing.assert_array_equal(thin.t[:-1], full.t[:-1][::7][: len(thin.t) - 1])
    assert thin.t[-1] == full.t[-1] and np.all(thin.p[-1] == full.p[-1])
    assert thin.crossings == full.crossings


def test_progress_is_told_and_may_interrupt():
    seen = []
    hc.simulate(hc.constant_cut(), progress=lambda t, x: seen.append((t, x)))
    assert len(seen) > 3 and seen == sorted(seen)

    def stop(t, x):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hc.simulate(hc.constant_cut(), progress=stop)


def test_simulate_refuses_what_is_no_scenario():
    with pytest.raises(ParameterError, match="scenario"):
        hc.simulate("constant")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="every"):
        hc.simulate(hc.free(), every=0)


@pytest.mark.parametrize("ulps", [0, 1, 2, 3, -1, -2])
def test_a_border_that_lies_at_a_sample_is_crossed_once(ulps):
    """The step lands within rounding of the end of a whole step."""
    edge = float(hc.simulate(hc.constant_cut(t_max=0.2)).p[300, 0])
    for _ in range(abs(ulps)):
        edge = float(np.nextafter(edge, -1.0 if ulps > 0 else 1.0))
    r = hc.simulate(hc.constant_cut(t_max=0.5, clay=(edge, 0.15)))
    assert r.t[-1] == 0.5 and [c.border for c in r.crossings] == [edge]
    assert r.crossings[0].time == pytest.approx(300 * 3.6e-4, abs=1e-9)


def test_a_handle_that_slides_along_a_border_goes_on():
    """Chatter over the border of the clay: no verdict of instability, and the motion converges."""
    y = [
        hc.simulate(hc.constant_cut(start=(0.1501, 0.0), force=(0.0, 1.0), t_max=0.6, dt=dt)).p[
            -1, 1
        ]
        for dt in (1e-3, 3.6e-4)
    ]
    assert y[0] == pytest.approx(y[1], rel=0.03)


def test_a_border_into_stiff_clay_on_the_other_axis_is_crossed_once():
    from hapticclay.model.cells import Profile
    from hapticclay.model.clay import Clay
    from hapticclay.model.operator import Operator
    from hapticclay.scene.scenario import Scenario

    e = (0.008008749625277495, 0.11265424819257426)
    s = Scenario(
        clay=Clay(Profile(e, (0, 0, 0)), Profile(e, (0, 1e9, 0))),
        operator=Operator(0, 0.5, 300),
        gain=(0.44598979672675334, 0.3833403871645688),
        force=(-0.1010242091352522, 0.3805432376543556),
        start=(0.06284143979853994, -0.028811052389286194),
        t_max=0.5,
    )
    r = hc.simulate(s)
    assert [c.border for c in r.crossings] == [e[0]]
    assert r.crossings[0].speed == pytest.approx(-0.303, abs=0.001)


def test_a_start_at_rest_in_stiff_clay_is_recorded_at_rest():
    r = hc.simulate(hc.constant_cut(b=1e6, start=(0.06, 0.0), t_max=0.01))
    assert np.all(r.v[0] == 0.0) and np.all(r.fe[0] == 0.0)
    assert r.fe[-1, 0] == pytest.approx(1.0, rel=1e-3)


def test_runs_are_repeatable_bit_for_bit():
    a, b = (hc.simulate(hc.constant_cut(t_max=1.0)) for _ in range(2))
    np.testing.assert_array_equal(a.p, b.p)


@pytest.mark.perf
def test_speed_is_a_small_multiple_of_the_bare_engine():
    """A guard, not the measurement: benchmarks/throughput.py measures 24."""
    from benchmarks import throughput

    scene = throughput.SCENES["constant cut"]
    ratio = min(throughput.loop(scene, 4000) / throughput.floor(scene, 4000) for _ in range(3))
    assert ratio < 60.0


@pytest.mark.parametrize("engine", ["python", "auto"])
def test_runs_within_and_beside_a_run_leave_it_as_it_is(engine, monkeypatch):
    """Runs share engines one after the other, never at the same time."""
    monkeypatch.setattr(run, "CHUNK", 512)  # rows between two looks
    s = hc.constant_cut(t_max=0.3, start=(0.045, 0.0))  # one look at its progress
    alone = hc.simulate(s, engine=engine)
    inner = []

    def progress(t, x):
        inner.append(hc.simulate(hc.constant_cut(b=30.0, t_max=0.1), engine=engine))

    outer = hc.simulate(s, engine=engine, progress=progress)
    with ThreadPoolExecutor(2) as pool:
        beside = list(pool.map(lambda _: hc.simulate(s, engine=engine), range(3)))
    for r in (outer, *beside):
        np.testing.assert_array_equal(r.p, alone.p)
        assert r.energy == alone.energy and r.crossings == alone.crossings
    assert inner and all(r.scenario.clay.x.values[1] == 30.0 for r in inner)
    assert {r.p.tobytes() for r in inner} == {inner[0].p.tobytes()}
