"""Hits and rebounds on clay of any stiffness, against solutions that are not ours."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import hapticclay as hc
from benchmarks import hits, reference
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay, slab
from hapticclay.model.constants import TS
from hapticclay.model.operator import Operator
from hapticclay.scene.scenario import Scenario
from tests.hunt import some
from tests.oracles import bounces, store

REBOUND = Scenario(
    clay=slab(1e4, 0.05, 0.15),
    force=(-0.5, 0.0),
    velocity=(0.3, 0.0),
    start=(0.03, 0.0),
    length=None,
    inertia_shaping=True,
    t_max=0.6,
)


@pytest.mark.parametrize("b,leaves", [(1e4, 0.4766), (1e5, 0.4756), (1e6, 0.4754)])
def test_handle_leaves_stiff_clay_when_it_should(b, leaves):
    """Motors reach their limits; the reference has 1e-10, and its published value."""
    s = dataclasses.replace(REBOUND, clay=slab(b, 0.05, 0.15))
    exact = store.solution(f"rebound-{b:g}", reference.solve, s, [0.59]).crossings[1][2]
    assert exact == pytest.approx(leaves, abs=5e-5)
    for engine in ("python", "native"):
        assert hc.simulate(s, engine=engine).crossings[1].time == pytest.approx(exact, abs=2e-5)


def test_handle_with_a_hand_leaves_stiff_clay_when_it_should():
    s = dataclasses.replace(
        REBOUND,
        clay=slab(1e5, 0.05, 0.15),
        operator=Operator(0.25, 2.0, 60.0),
        force=(0.0, 0.0),
        velocity=(0.5, 0.0),
        start=(0.02, 0.0),
        t_max=0.2,
    )
    exact = store.solution("rebound-hand", reference.solve, s, [0.19]).crossings[1][2]
    assert exact == pytest.approx(0.1510, abs=5e-5)
    assert hc.simulate(s).crossings[1].time == pytest.approx(exact, abs=3e-5)


@pytest.mark.parametrize("seed", range(12))
def test_random_hits_keep_what_the_documents_promise(seed):
    """`python -m benchmarks.hits --random 300` does it 300 times."""
    r = hits.against_reference(
        seed, solve=lambda *at: store.solution(f"hit-{seed}", reference.solve, *at)
    )
    assert r["crossing"] <= hits.LIMIT_TIME and r["position"] <= hits.LIMIT_PLACE, r


KINDS = "cut", "hit", "hit, hand", "layers", "grazing"


@pytest.mark.parametrize("kind,b", some(itertools.product(KINDS, [1e2, 1e4, 1e6, 1e9]), 10))
def test_order_is_two_at_any_stiffness(kind, b):
    """Fitted to the largest error of border times over five steps; no motor at its limit."""
    steps = np.array([4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4])
    errors = [hits.row(kind, b, "fast, native", float(dt))["crossing"] for dt in steps]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 1.7 < order < 2.3, errors
    assert errors[-1] < 2e-6


@settings(max_examples=25)
@given(
    st.floats(0.0, 9.0),
    st.floats(0.05, 0.5),
    st.booleans(),
    st.booleans(),
    st.sampled_from([TS, 1e-3]),
)
def test_any_hit_is_within_second_order_of_the_exact_solution(power, v, hand, y, dt):
    """Border times are within 150 dt^2, 2e-5 s at 0.36 ms, whatever b.

    This is of borders passed faster than 1 mm/s.

    The constant is that of the servo, whose poles of 30 rad/s answer a hit at 0.5 m/s; 400 draws
    came to 80.
    """
    b, axis = 10.0**power, int(y)
    th = (0.25, 2.0, 60.0) if hand else (0.0, 0.0, 0.0)
    across = "y" if y else "x"
    profile = Profile((0.05, 0.15), (0.0, b, 0.0), across)
    put = lambda x: (0.0, x) if y else (x, 0.0)  # noqa: E731
    s = Scenario(
        clay=Clay(profile, profile),
        operator=Operator(*th) if hand else None,
        force=put(-v),
        velocity=put(v),
        start=put(0.05 - 0.05 * v),
        gain=(1.0, 0.3),
        inertia_shaping=True,
        torque_limit=hits.STRONG,
        length=None,
        t_max=0.4,
        dt=dt,
        stop_when_unstable=False,
        origin=(0.35, 0.19) if y else hits.NOMINAL_BORDER,
    )
    exact, _ = bounces(
        (0.05, 0.15), (0.0, b, 0.0), s.gain[axis], -v, th, axis, 0.05 - 0.05 * v, v, s.t_max
    )
    r = hc.simulate(s)
    theirs = [e[0] for e in exact if abs(e[2]) > hits.SLOW]
    assume(
        theirs and all(abs(abs(e[2]) / hits.SLOW - 1.0) > 0.1 for e in exact)
    )  # reached, and each clear or not
    mine = [c.time for c in r.crossings if abs(c.speed) > hits.SLOW]
    assert len(mine) == len(theirs)
    assert max(abs(a - b) for a, b in zip(mine, theirs, strict=True)) < 150.0 * dt * dt


def test_force_after_a_hit_is_felt_as_it_is():
    """50 ms after a plain hit on clay of 3e4 N.s/m, where an error of the compensator shows:

    to 1e-3.
    """
    assert hits.row("hit", 3e4, "fast", TS)["force"] < 1e-3


def test_clay_takes_what_the_hit_brought_and_nothing_is_lost():
    """Energy closes to rounding, also where a hit drives motors into their limits."""
    for b in (1e3, 1e5, 1e7, 1e9):
        r = hc.simulate(dataclasses.replace(REBOUND, clay=slab(b, 0.05, 0.15)))
        assert abs(r.energy["residual"]) < 1e-12 * r.energy["throughput"]


@pytest.mark.parametrize("b", [3e3, 1e5, 1e8])
def test_recorded_force_in_stiff_clay_balances_what_pushes(b):
    """Pushed for long, the handle creeps at (uh + servo)/b:

    fe is what the exact solution says, sample by sample.
    """
    s = dataclasses.replace(
        REBOUND, clay=slab(b, 0.05, 0.15), start=(0.06, 0.0), velocity=(0.0, 0.0), t_max=0.3
    )
    r = hc.simulate(s)
    _, z = bounces((0.05, 0.15), (0.0, b, 0.0), 1.0, -0.5, p0=0.06, t_max=0.31, times=r.t[3:])
    np.testing.assert_allclose(
        r.fe[3:, 0], b * z[:, 1], atol=1e-3
    )  # of 0.5 N; the mean over a kick at the beginning


@pytest.mark.parametrize("b", [1e4, 1e6])
def test_sampled_control_measures_the_speed_in_stiff_clay(b):
    """In physical clay the velocity at a sample is that of the hybrid system."""
    s = dataclasses.replace(
        REBOUND,
        clay=slab(b, 0.05, 0.15),
        start=(0.06, 0.0),
        velocity=(0.0, 0.0),
        t_max=0.1,
        control="sampled",
        render="physical",
    )
    r = hc.simulate(s)
    x = store.solution(f"sampled-stiff-{b:g}", reference.solve, s, r.t[:-1])
    n = min(len(x.p), len(r.p))
    np.testing.assert_allclose(
        b * r.p[:n, 0], b * x.p[:n, 0], atol=1e-3
    )  # b times distance: an impulse [N.s]
