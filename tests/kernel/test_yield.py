"""Clay that yields, in the default method: closed forms, rest, borders, energy, engines."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import hapticclay as hc
from tests.hunt import examples
from tests.oracles import friction

M = 1.25  # mass of the slider [kg]
V0 = 0.2  # its speed at the start [m/s]
FLOWS = {
    "Bingham": hc.Flow(Fy=2.0, b=5.0),
    "Coulomb": hc.Flow(Fy=2.0),
    "power law": hc.Flow(K=3.0, n=0.5),
    "paste": hc.Flow(K=1.5, n=0.23),
    "Herschel-Bulkley": hc.Flow(Fy=1.0, K=1.0, n=0.5),
    "thickening": hc.Flow(Fy=0.5, K=4.0, n=2.0),
    "all": hc.Flow(Fy=1.0, K=1.0, n=0.5, b=2.0),
}


def slider(clay, dt, t_max, v=(V0, 0.0), **changes):
    """The handle as a free body of mass M: servo and compensator hold nothing.

    The compensator's output and the reference run on at the speed of the start, so that what is
    left of the servo is p'' = f/M; its stiffness and damping are the least that are allowed.
    """
    free = hc.free()
    servo = tuple(hc.Servo(x.G, hc.SecondOrder(1.0 / M, 1e-9, 1e-9)) for x in free.servo)
    own = dict(
        clay=clay, gain=(0.0, 0.0), inertia_shaping=True, servo=servo, force=(0.0, 0.0), dt=dt
    )
    own |= dict(velocity=v, start=(0.02, 0.0), compensator=hc.Compensator((1.0,), (1.0, 0.0, 0.0)))
    own |= dict(t_max=t_max, length=None, torque_limit=(1e5, 1e5), stop_when_unstable=False)
    return dataclasses.replace(free, **(own | changes))


@pytest.mark.parametrize("name", FLOWS)
def test_a_slider_stops_where_the_closed_form_says(name):
    law = FLOWS[name]
    t, x = friction.stop(M, V0, law.Fy, law.K, law.n, law.b)
    for dt in (2e-3, 3.6e-4, 1e-4):
        r = hc.simulate(slider(hc.slab(law), dt, 1.5 * t))
        # the last step falls short or goes too far by at most the way of its deceleration in half
        # of it; the rest of the method errs by less
        a = float(law.force(0.5 * V0)) / M
        assert abs(r.p[-1, 0] - 0.02 - x) < max(0.25 * a, 1.0) * dt**2
        if dt == 1e-4:
            assert abs(r.p[-1, 0] - 0.02 - x) < 1e-6 * x
        if law.Fy:
            assert [s.axis for s in r.stops] == ["xy"] and r.stops[0].end is None
            assert abs(r.stops[0].start - t) < 20.0 * dt**2
            assert not r.v[r.t > t + dt].any()
        else:  # nothing holds it, and it comes to rest by way of ever smaller numbers
            assert np.abs(r.v[r.t > t + 3.0 * dt]).max() < 1e-15


@pytest.mark.parametrize("isotropic", [False, True])
def test_it_is_of_second_order_at_a_stop(isotropic):
    # errors of the place scatter within a bound that falls with dt^2: steps of 1 to 1.1 dt, worst
    law = hc.Flow(Fy=2.0, b=5.0)
    _, x = friction.stop(M, V0, law.Fy, 0.0, 1.0, law.b)
    clay = dataclasses.replace(hc.slab(law), isotropic=isotropic)
    worst = []
    for dt in (4e-3, 2e-3, 1e-3, 5e-4):
        steps = dt * np.linspace(1.0, 1.1, 8)
        runs = hc.simulate_batch([slider(clay, float(h), 0.2) for h in steps])
        worst.append(max(abs(r.p[-1, 0] - 0.02 - x) for r in runs))
    order = np.polyfit(np.log([4e-3, 2e-3, 1e-3, 5e-4]), np.log(worst), 1)[0]
    assert abs(order - 2.0) < 0.2


def test_a_spring_with_a_yield_force_loses_the_same_each_half_cycle():
    k, Fy, x0 = 200.0, 1.0, 0.03
    turns = friction.spring_turns(M, k, Fy, x0)
    hand = hc.Operator(0.0, 0.0, k)
    half = math.pi * math.sqrt(M / k)
    clay = hc.Clay(hc.Profile((), (0.0,), Fy=(Fy,)), hc.Profile((), (0.0,)))
    s = slider(clay, 2e-4, half * (len(turns) + 1), (0.0, 0.0), start=(x0, 0.0), operator=hand)
    r = hc.simulate(s)
    ends = [r.p[np.searchsorted(r.t, half * i), 0] for i in range(len(turns))]
    # near its turning points the body is flat: samples beside them err by (dt/2)^2 k x0/M/2
    np.testing.assert_allclose(ends, turns, atol=2e-7)
    assert abs(r.p[-1, 0]) <= Fy / k and not r.v[-1, 0]
    assert len(r.stops) == 1 and r.stops[0].start == pytest.approx(
        half * (len(turns) - 1), abs=1e-6
    )


def test_the_passage_through_bingham_clay():
    law = hc.Flow(Fy=1.0, b=4.0)
    t, v = friction.bingham_passage(M, V0, law.Fy, law.b, 0.01)
    first = 0.01 / V0
    for dt, most in ((2e-3, 4e-6), (3.6e-4, 2e-7), (1e-4, 2e-8)):
        r = hc.simulate(slider(hc.slab(law, 0.03, 0.04), dt, first + t + 0.02))
        assert [c.border for c in r.crossings] == [0.03, 0.04]
        assert abs(r.crossings[0].time - first) < 2e-8  # the servo's least stiffness
        assert abs(r.crossings[1].time - first - t) < most
        assert r.v[-1, 0] == pytest.approx(v, abs=max(most, 1e-7))


def test_it_rests_below_the_yield_force_to_the_last_bit():
    hold = hc.Profile((), (30.0,), Fy=(5.0,))
    for clay in (hc.Clay(hold, hold), hc.slab(hc.Flow(Fy=5.0, b=30.0))):
        for dt in (1e-5, 3.6e-4, 1e-2):
            s = dataclasses.replace(
                hc.free(), clay=clay, force=(3.0, -3.9), dt=dt, t_max=100 * dt, length=None
            )
            r = hc.simulate(s)
            assert not r.v.any() and not r.qd.any()
            assert not np.ptp(r.p, axis=0).any() and not np.ptp(r.q, axis=0).any()
            np.testing.assert_allclose(r.fe, r.fh, atol=1e-12)  # sums of torques over the arm
            assert all(x.start == 0.0 and x.end is None for x in r.stops) and r.stops


def test_it_breaks_away_where_the_push_exceeds_the_yield_force():
    s = dataclasses.replace(
        hc.free(), clay=hc.slab(hc.Flow(Fy=5.0, b=30.0)), force=(0.0, 0.0), t_max=1.0,
        muscle=hc.Ramp((10.0, 0.0), 0.0, 1.0), length=None,
    )  # fmt: skip
    r = hc.simulate(s)
    assert [(x.axis, x.start) for x in r.stops] == [("xy", 0.0)]
    assert r.stops[0].end == pytest.approx(0.5, abs=2.0 * s.dt)
    assert not r.v[r.t < 0.4996].any() and r.v[-1, 0] > 0.01


def test_an_axis_that_is_held_beside_one_that_slides_does_not_drift():
    hold = hc.Profile((), (30.0,), Fy=(5.0,))
    for dt, most in ((2e-3, 5e-9), (3.6e-4, 3e-11)):  # third order: the way of one bent step
        s = dataclasses.replace(
            hc.constant_cut(), clay=hc.Clay(hold, hold), force=(12.0, 1.0), dt=dt, length=0.15
        )
        r = hc.simulate(s)
        rests = r.t > r.stops[-1].start + 2.0 * dt
        assert r.stops[-1].axis == "y" and not r.v[rests, 1].any()
        assert np.ptp(r.p[rests, 1]) < most < np.ptp(r.p[rests, 0])


@pytest.mark.parametrize("dt", [1e-5, 3.6e-4, 1e-2])
@pytest.mark.parametrize("Fy", [0.0, 0.1, 10.0, 1e4])
def test_no_chatter_at_any_step_and_yield_force(dt, Fy):
    # three periods of a sine of twice the yield force, 200 steps each: two turns a period, and at
    # each turn one stop at most
    period = 200.0 * dt
    push = hc.Multisine((max(2.0 * Fy, 0.1), 0.0), 0.9 / period, 1.1 / period, period, lines=1)
    s = dataclasses.replace(
        hc.free(), clay=hc.slab(hc.Flow(Fy=Fy, b=max(300.0, 100.0 * Fy))), dt=dt,
        force=(0.0, 0.0), muscle=push,
        t_max=3.0 * period, length=None, stop_when_unstable=False, torque_limit=(1e6, 1e6),
        gain=(0.05, 0.05),
    )  # fmt: skip
    r = hc.simulate(s)
    turns = np.count_nonzero(np.diff(np.sign(r.v[r.v[:, 0] != 0.0, 0])))
    assert np.isfinite(r.p).all() and turns <= 7 and len(r.stops) <= 8
    assert (r.v[1:, 0] == 0.0).any() == (Fy > 0.0)


@st.composite
def scenes(draw):
    """Seeded random clay that yields, borders, coupling, pushes and steps."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))

    def flow():
        return (
            float(rng.choice([0.0, 10.0 ** rng.uniform(-2, 4)])),
            float(rng.choice([0.0, 10.0 ** rng.uniform(-1, 3)])),
            float(rng.uniform(0.1, 2.5)),
            float(rng.choice([0.0, 10.0 ** rng.uniform(0, 6)])),
        )

    isotropic = bool(rng.integers(2))
    edges = tuple(sorted(rng.uniform(-0.02, 0.08, size=rng.integers(0, 4)).tolist()))
    laws = []
    for _ in range(2):
        Fy, K, n, b = zip(*(flow() for _ in range(len(edges) + 1)), strict=True)
        laws.append(hc.Profile(edges, b, Fy=Fy, K=K, n=n))
    laws = [laws[0], laws[0]] if isotropic else laws
    dt = float(10.0 ** rng.uniform(-4.3, -2.05))
    soft = max(max(x.values) for x in laws) * dt < 2.0
    return dataclasses.replace(
        hc.free(),
        clay=hc.Clay(*laws, isotropic=isotropic, angle=float(soft * rng.uniform(-3.0, 3.0))),
        force=tuple(rng.normal(size=2) * 10.0 ** rng.uniform(-1, 2)),
        velocity=tuple(rng.normal(size=2) * rng.choice([0.0, 0.1])),
        gain=tuple(rng.uniform(0.01, 1.0, 2)),
        operator=hc.Operator() if rng.integers(2) else None,
        inertia_shaping=bool(rng.integers(2)),
        muscle=hc.Multisine(
            tuple(rng.uniform(0.0, 20.0, 2)), 0.5, min(20.0, 0.4 / dt), 2.0, lines=8, seed=1
        ),
        dt=dt,
        t_max=300.0 * dt,
        length=None,
        stop_when_unstable=False,
    )


SLOW = settings(examples(15), suppress_health_check=[HealthCheck.too_slow])


@SLOW
@given(scene=scenes())
def test_clay_takes_energy_whatever_moves_in_it(scene):
    r = hc.simulate(scene)
    through = r.energy["throughput"]
    power = (r.fe * r.v).sum(axis=1)
    assert np.isfinite(r.p).all() and power.min() >= -1e-12 * np.abs(power).max(initial=1.0)
    # a step is straight in the joints and bends the path by (v dt)^2/(2 l1), on which what holds an
    # axis beside one that slides does work of either sign
    bend = np.abs(r.v).max() ** 2 * scene.dt**2 / 0.48
    assert r.energy["clay"] >= -len(r.t) * bend * np.abs(r.fe).max() - 1e-9 * through
    if scene.operator is None:  # with a hand the spring's mean over three samples leaves dt^2
        assert abs(r.energy["residual"]) <= 1e-10 * through + 1e-12


def test_step_by_step_it_is_the_same_run_and_a_file_keeps_it(tmp_path):
    s = dataclasses.replace(
        hc.constant_cut(), clay=hc.slab(hc.Flow(Fy=5.0, b=30.0), 0.05, 0.15), force=(4.0, 0.0),
        start=(0.048, 0.0), t_max=1.2,
    )  # fmt: skip
    whole = hc.simulate(s)
    with hc.Simulation(s) as sim:
        while sim.outcome is None:
            sim.step()
    record = sim.record()
    for r in (record, hc.Record.load(whole.save(tmp_path))):
        assert r.stops == whole.stops and whole.stops[-1].end is None
        assert np.array_equal(r.fe, whole.fe) and np.array_equal(r.p, whole.p)


def test_in_steady_motion_the_clay_and_the_compensator_share_the_push():
    # the damper of C is 10/K: fh = 10/K v + b v + Fy
    s = dataclasses.replace(
        hc.free(), clay=hc.slab(hc.Flow(Fy=5.0, b=30.0)), force=(5.4, 0.0), t_max=6.0, length=None
    )
    r = hc.simulate(s)
    np.testing.assert_allclose(r.v[-1], (0.4 / 40.0, 0.0), atol=5e-5)  # the pose still turns
    np.testing.assert_allclose(r.fe[-1, 0], 5.0 + 30.0 * r.v[-1, 0], rtol=1e-5)


@pytest.mark.parametrize("isotropic", [False, True])
def test_rotated_axes_is_felt_along_its_own_axes(isotropic):
    # beside the accurate method, which errs by 1e-9: second order, in velocity as in place
    hard = hc.Profile((), (30.0,), Fy=(2.0,))
    soft = hard if isotropic else hc.Profile((), (10.0,), Fy=(1.0,))
    s = dataclasses.replace(
        hc.free(), clay=hc.Clay(hard, soft, angle=0.7, isotropic=isotropic), force=(6.0, 2.0),
        muscle=hc.Multisine((3.0, 3.0), 0.5, 6.0, 2.0, lines=6), t_max=0.25, length=None,
        stop_when_unstable=False,
    )  # fmt: skip
    for dt in (1e-3, 2.5e-4):
        fast = dataclasses.replace(s, dt=dt)
        a, b = hc.simulate(fast), hc.simulate(dataclasses.replace(fast, integrator="accurate"))
        assert np.abs(a.p - b.p).max() < 0.5 * dt**2 and np.abs(a.v - b.v).max() < 80.0 * dt**2
        assert (a.fe * a.v).sum(axis=1).min() >= 0.0


@pytest.mark.parametrize("isotropic", [False, True])
@pytest.mark.parametrize(
    ("law", "push"),
    [
        (hc.Flow(K=691.0, n=0.36, b=6e5), 8.0),
        (hc.Flow(K=3e4, n=1.0, b=1e4), 8.0),
        (hc.Flow(K=1e6, n=2.0, b=1e4), 2000.0),
        (hc.Flow(Fy=2.0, K=691.0, n=0.36, b=6e4), 8.0),
    ],
)
def test_stiff_clay_with_a_consistency_creeps_evenly(law, push, isotropic):
    # Fy + K v^n + (b + 10/gain) v = push, with a K v^n that changes faster than b v
    v = brentq(lambda v: float(law.force(v)) + 10.0 / 0.3 * v - push, 0.0, push / law.b)
    profile = hc.Profile((), (law.b,), Fy=(law.Fy,), K=(law.K,), n=(law.n,))
    for dt in (1e-2, 1e-3):
        s = dataclasses.replace(
            hc.free(), clay=hc.Clay(profile, profile, isotropic=isotropic), force=(push, 0.0),
            gain=(0.3, 0.1), inertia_shaping=True, dt=dt, t_max=1.1, length=None,
            stop_when_unstable=False, torque_limit=(1e5, 1e5),
        )  # fmt: skip
        r = hc.simulate(s)
        # delta' settles as exp(-10 t); the last step is a short one, and divides v of both steps
        # around it unevenly
        late = (r.t > 0.9) & (r.t < r.t[-1] - 2.5 * dt)
        np.testing.assert_allclose(r.v[late, 0], v, rtol=1e-3)
        np.testing.assert_allclose(r.fe[late, 0], push - 10.0 / 0.3 * v, rtol=1e-3)
