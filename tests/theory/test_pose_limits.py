"""Gain limits where the handle is, against eigenvalues of the state space and against runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.formulas import arm
from hapticclay.theory import linear_loop
from hapticclay.theory.loops import TIMING, Loop
from hapticclay.theory.pose_limits import MOST_KNOWN, PoseLimits


def growth(s, gain, p, b):
    """Largest real part of the poles of both axes [1/s], but for those at zero."""
    q = arm.inverse_kinematics(s.origin[0] + p[0], s.origin[1] + p[1], s.arm.links)
    xx, xy, yy = arm.mobility(arm.jacobian(*q, s.arm.links), s.arm.links)
    axes = [replace(Loop.of(s, a, d), K=K, **TIMING) for a, d, K in zip("xy", b, gain, strict=True)]
    z = np.linalg.eigvals(
        linear_loop.state_space(*axes, mobility=np.array([[xx, xy], [xy, yy]]))[0]
    )
    return z[np.abs(z) > 1e-4].real.max()


@pytest.mark.parametrize("seed", range(40))
def test_the_loop_of_both_axes_is_stable_up_to_the_limit_of_its_pose(seed):
    """Poles cross at the limit to 1e-6 of it: K is a simple root away from tangencies."""
    rng = np.random.default_rng(seed)
    i, p = seed % 2, tuple(rng.uniform(-0.12, 0.12, 2).tolist())
    b = tuple((10.0 ** rng.uniform(0.5, 3.0, 2)).tolist())
    th = hc.Operator(*rng.uniform((0.01, 0.1, 1.0), (0.5, 5.0, 50.0)).tolist())
    C = hc.Compensator(
        *(((1.0, 5.0), (1.0, 20.0, 0.0)) if seed % 3 else ((1.0,), (1.0, 10.0, 0.0)))
    )
    gain = (float(10.0 ** rng.uniform(-2.0, 0.3)),) * 2
    s = hc.Scenario(gain=gain, operator=th if seed % 4 else None, compensator=C, length=None)
    limit = PoseLimits(s).at(i, p, b)

    def grows(K, beside):
        return growth(s, (K, beside) if i == 0 else (beside, K), p, b)

    beside = s.gain[1 - i]
    if grows(1e-6, beside) > 1e-9:  # the other axis alone is unstable
        beside = 0.0
    if limit == math.inf:
        assert all(grows(K, beside) <= 1e-9 for K in (0.1, 1.0, 10.0, 100.0))
    else:
        assert all(grows(f * limit, beside) <= 1e-9 for f in (0.01, 0.3, 0.7, 1.0 - 1e-6))
        assert grows((1.0 + 1e-6) * limit, beside) > 0.0


@pytest.mark.parametrize("shaping", [True, False])
def test_at_the_nominal_pose_and_with_shaping_it_is_the_gain_limit(shaping):
    s = hc.Scenario(inertia_shaping=shaping, length=None)
    for i, axis in enumerate("xy"):
        for b in (30.0, 90.0, 300.0):
            found = PoseLimits(s).at(i, (0.02, 0.0) if shaping else (0.1, 0.0), (b, b))
            assert found == pytest.approx(hc.theory.gain_limit(axis, b), rel=1e-9)


def test_rotated_clay_has_the_limit_of_its_own_axes():
    """Turned by a right angle, the damping of its y resists x."""
    law = (hc.Profile((), (30.0,)), hc.Profile((), (200.0,), "y"))
    s = hc.Scenario(clay=hc.Clay(*law, angle=0.5 * math.pi), inertia_shaping=True, length=None)
    for i, axis in enumerate("xy"):
        found = PoseLimits(s).at(i, s.start, (30.0, 200.0))
        exact = hc.theory.gain_limit(axis, (200.0, 30.0)[i])
        assert found == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("x,y", [(0.25, 0.24), (0.45, 0.2)])
def test_the_advice_at_a_far_pose_works(x, y):
    """The handle is pushed where it rests: the advice is right within 5 % of K.

    At the nominal pose K would be stable.
    """
    b, way = 90.0, hc.Profile((), (90.0,))
    s = hc.Scenario(clay=hc.Clay(way, way), force=(0.0, 0.0), velocity=(2e-3, 0.0), length=None)
    s = replace(s, origin=(x, y), gain=(3.2, 0.1), t_max=20.0)
    limit = PoseLimits(s).at(0, (0.0, 0.0), (b, b))
    assert limit < 0.8 * hc.theory.gain_limit("x", b)
    for factor, unstable in ((1.05, True), (0.95, False)):
        r = hc.simulate(replace(s, gain=(factor * limit, 0.1)))
        assert (r.outcome.code == "diverged") == unstable, r.status
        if unstable:
            told = f"to less than {limit:.4g}"
            assert told in r.outcome.advice and "turn shaping on" in r.outcome.advice


def test_a_search_of_all_places_finds_the_worst_of_a_fine_grid():
    """A path over seven layers, to 0.5 %: the change between two places."""
    edges = tuple((0.03 * np.arange(6)).tolist())
    way = hc.Profile(edges, (20.0, 150.0, 60.0, 3.0, 90.0, 40.0, 10.0))
    s = hc.Scenario(clay=hc.Clay(way, way), gain=(1.0, 0.3))
    limits = PoseLimits(s)
    x = np.linspace(0.0, s.length, 101)
    b = s.clay.at(x, 0.0 * x)
    for i in (0, 1):
        every = [
            PoseLimits(s).at(i, (float(v), 0.0), tuple(d))
            for v, d in zip(x, b.T.tolist(), strict=True)
        ]
        found = limits.ahead(i)
        assert found.K == pytest.approx(min(every), rel=5e-3)
        assert found.K == limits.at(i, found.place, tuple(s.clay.at(*found.place).tolist()))
        assert len(limits.known[i]) <= MOST_KNOWN


def test_in_free_space_no_gain_is_too_much_whatever_the_compensator():
    """Te + Th = 0: the gain drives nothing. One of first order, and one with a pole at 0."""
    for C in (hc.Compensator((1.0,), (1.0, 50.0)), hc.Compensator((1.0,), (1.0, 50.0, 0.0))):
        limits = PoseLimits(hc.Scenario(compensator=C, length=None))
        assert [limits.at(i, (0.05, 0.02), (0.0, 0.0)) for i in (0, 1)] == [math.inf] * 2
