"""Runs of leaders and followers: where theory says so they grow; motion, forces and energy."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hapticclay as hc
from hapticclay.theory.pair_build import Build

KP = (240.0, 240.0, 240.0, 240.0, 24.0, 31.0, 25.0)
KD = (3.0, 3.0, 3.0, 3.0, 0.2, 0.2, 0.2)
DRIVE = hc.JointPD(KP, KD, runs="drive")
HELD = {"leader_operator": hc.Operator(2.0, 2.0, 10.0), "follower_clay": hc.Contact(50.0, 1.0, 3.0)}


def one(kind="position-position", late=0.0, **kw):
    device = hc.Device(6.0, 0.1)
    law = kw.pop("law", hc.JointPD((400.0,), (50.0,)))
    return hc.Pair(device, device, law, hc.Link(kind, late), **kw)


def seven(law=DRIVE, **kw):
    """Two arms of the package without joint friction, which theory leaves out."""
    arm = hc.MjcfArm("leader_7", friction=[0.0] * 7)
    return hc.Pair(arm, arm, law, **kw)


@functools.cache
def limits_of(pair):
    """Limits of theory, for both sides of them."""
    return hc.theory.pair_limits(pair)


@pytest.mark.parametrize("share, grows", [(0.97, False), (1.03, True)])
def test_a_run_grows_beyond_the_delay_of_theory(share, grows):
    """40 samples one way: a sample is 2.5 % of the limit."""
    pair = one(Ts=4e-3)
    limit = limits_of(pair).delay
    delay = round(share * limit / pair.Ts) * pair.Ts
    assert hc.simulate(replace(pair, link=hc.Link(delay=delay), t_max=4.0)).grows is grows


@pytest.mark.parametrize("share, grows", [(0.99, False), (1.01, True)])
def test_seven_joints_grow_beyond_the_gain_of_theory(share, grows):
    """1 % of the largest factor of all Kp, on each side."""
    pair = seven(link=hc.Link(delay=4e-3), Ts=2e-3)
    factor = share * limits_of(pair).gain
    stiff = replace(pair, law=replace(DRIVE, Kp=tuple(factor * x for x in KP)))
    assert hc.simulate(stiff).grows is grows


def test_friction_fed_forward_grows_as_fast_as_theory_says():
    """A push of micronewtons, so that the friction law is its slope: the rate within 1 %."""
    slopes = (0.93, 0.93, 1.77, 2.97, 0.79, 2.08, 0.22)
    law = replace(DRIVE, friction=[(0.0, 1.0, x) for x in slopes])
    pair = seven(law, Ts=1e-3, delay=1e-3, muscle=hc.Pulse((1e-6, 0.0), 0.0, 0.02), t_max=0.25)
    found = hc.simulate(pair)
    rates = np.abs(np.diff(found.leader, axis=0)).max(axis=1)
    growth = math.log(rates[-1] / rates[-51]) / (50 * pair.Ts)
    assert growth == pytest.approx(math.log(Build(pair).loop().radius()) / pair.Ts, rel=0.01)


def test_motion_is_that_of_scipy():
    """Without delay at 2 kHz, against continuous control: the hold lags by 0.25 ms of some 100."""
    found = hc.simulate(one(Ts=5e-4, muscle=hc.Step((2.0, 0.0), 0.0), t_max=0.5, **HELD))

    def slope(t, x):
        (ql, qf, vl, vf) = x
        pull = 400.0 * (qf - ql) + 50.0 * (vf - vl)
        leader = (2.0 + pull - (0.1 + 2.0) * vl - 10.0 * ql) / (6.0 + 2.0)
        return vl, vf, leader, (-pull - (0.1 + 1.0) * vf - 50.0 * qf) / (6.0 + 3.0)

    want = solve_ivp(slope, (0.0, 0.5), np.zeros(4), rtol=1e-10, atol=1e-13, t_eval=found.t).y
    scale = np.abs(want[0]).max()
    np.testing.assert_allclose(found.leader[:, 0], want[0], atol=5e-3 * scale)
    np.testing.assert_allclose(found.follower[:, 0], want[1], atol=5e-3 * scale)


@pytest.mark.parametrize("kind", ["position-position", "position-force", "waves"])
def test_a_run_is_the_map(kind):
    """A push of one sample, then 150 samples free: states of the map from where the push ended."""
    push = {"muscle": hc.Pulse((1.0, 0.0), 0.0, 4e-3), "t_max": 0.9}
    pair = one(kind, (8e-3, 4e-3), Ts=4e-3, delay=4e-3, **push, **HELD)
    found = hc.simulate(pair)
    loop = Build(pair).loop()
    A, x, out = loop.map(), np.zeros(loop.states), []
    q = found.leader[1, 0]
    # the leader with its hand under 1 N for a sample, torques at rest
    m, d, k = 8.0, 2.1, 10.0
    w = np.sqrt(k / m - (d / (2 * m)) ** 2)
    decay = np.exp(-d / (2 * m) * pair.Ts)
    rest, c, s = 1.0 / k, np.cos(w * pair.Ts), np.sin(w * pair.Ts)
    assert q == pytest.approx(rest * (1 - decay * (c + d / (2 * m * w) * s)), rel=1e-4)
    x[0], x[1] = q, rest * decay * (k / m / w) * s
    for _ in range(200):
        out.append((x[0], x[loop.leader.states]))
        x = A @ x
    both = np.column_stack([found.leader[1:201, 0], found.follower[1:201, 0]])
    # the engine's step, half a sample, is of second order: 1e-4 of the largest motion
    np.testing.assert_allclose(both, np.array(out), atol=1e-3 * np.abs(both).max())


def test_jitter_and_losses_hold_the_newest_packet():
    """The same seed gives the same run; 20 % of losses at 20 ms leave the pair stable."""
    late = hc.Link(delay=20e-3, jitter=6e-3, loss=0.2, seed=3)
    pair = replace(one(Ts=2e-3, t_max=0.5, **HELD), link=late)
    a, b = (hc.simulate(pair) for _ in range(2))
    np.testing.assert_array_equal(a.leader, b.leader)
    other = hc.simulate(replace(pair, link=replace(late, seed=4)))
    assert not np.array_equal(a.leader, other.leader)
    assert np.abs(other.leader).max() < 2.0 * np.abs(a.leader).max()


def test_energy_is_what_the_arms_lost():
    """Work of the hand less motion, friction and spring of both sides: what the link took."""
    found = hc.simulate(one(Ts=1e-3, muscle=hc.Pulse((5.0, 0.0), 0.0, 0.05), t_max=0.4))
    t, q = found.t, np.hstack([found.leader, found.follower])
    v = np.gradient(q, t, axis=0)
    work = 5.0 * (q[50, 0] - q[0, 0])
    lost = np.trapezoid(0.1 * (v[:-1] ** 2).sum(axis=1), t[:-1]) + 3.0 * (v[-2] ** 2).sum()
    assert found.energy[-2] == pytest.approx(work - lost, rel=1e-3)  # rates by differences
    assert found.energy.min() > -1e-6


@pytest.mark.parametrize("made, told", [(lambda: one(late=math.pi * 1e-4), "whole parts")])
def test_refused(made, told):
    with pytest.raises(hc.ParameterError, match=told):
        hc.simulate(made())


def test_a_pair_that_diverges_ends_and_says_so():
    device = hc.Device(mass=0.1, damper=0.0)
    pair = hc.Pair(device, device, hc.JointPD((4000.0,), (1.0,)), hc.Link(delay=0.05))
    found = hc.simulate(replace(pair, t_max=6.0))
    assert found.grows and "diverged" in found.ended and found.t[-1] < 6.0


def test_a_closed_chain_that_diverges_ends_before_it_cannot_be_closed(capfd):
    arm = hc.MjcfArm("haptic_3", friction=[0.0] * 3)
    law = hc.JointPD((3e3,) * 3, (0.1,) * 3)
    found = hc.simulate(hc.Pair(arm, arm, law, hc.Link(delay=0.02), Ts=2e-3, t_max=1.0))
    assert found.grows and found.ended and found.t[-1] < 1.0
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("samples", [1, 2, 3, 4, 5])
def test_a_short_record_says_that_it_shows_no_trend(samples):
    """Five samples have four rates, one for each quarter; they rise under a constant force."""
    pair = one(muscle=hc.Step((2.0, 0.0), 0.0))
    found = hc.simulate(replace(pair, t_max=samples * pair.Ts))
    assert len(found.t) == samples and found.grows is (samples == 5)
    assert ("too short" in found.headline()) is (samples < 5)
    assert found.text() and found.summary() and found.plot()
