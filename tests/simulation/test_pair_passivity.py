"""Passivity controllers of pairs: their bound at each end, and late links that they tame."""

from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from benchmarks.pair_passivity import least
from hapticclay.simulation.pair_passivity import MOST, Port

PUSH = hc.Pulse((5.0, 0.0), 0.0, 0.5)


def late(delay, t_max=4.0, **kw):
    """Force feedback from a spring of 1 kN/m."""
    device, law = hc.Device(6.0, 0.1), hc.JointPD((400.0,), (50.0,))
    link = hc.Link("position-force", delay, **kw)
    carried = {"leader_operator": hc.Operator(2.0, 2.0, 10.0), "follower_clay": hc.Contact(1e3)}
    return hc.Pair(device, device, law, link, Ts=5e-3, muscle=PUSH, t_max=t_max, **carried)


@pytest.mark.parametrize("room", [0.0, 1e-4, 3e-3])
def test_a_torque_works_no_more_than_the_room(room):
    """Over a sample of free motion, two joints: work t (v Ts + W t Ts^2/2), from closed form."""
    M, Ts = np.array([[2.0, 0.5], [0.5, 1.0]]), 1e-2
    rng = np.random.default_rng(7)
    for _ in range(100):
        torque, v = rng.normal(size=2), rng.normal(size=2)
        port = Port(M, Ts, room)
        found = port.guarded(torque, v)
        work = found @ (v * Ts + np.linalg.solve(M, found) * Ts**2 / 2.0)
        assert work <= room + 1e-15  # rounding of a square root
        wanted = torque @ (v * Ts + np.linalg.solve(M, torque) * Ts**2 / 2.0)
        if wanted <= room:
            np.testing.assert_array_equal(found, torque)
        elif np.any(found):
            assert work == pytest.approx(room, abs=1e-15)


def test_a_damper_takes_back_what_came_out():
    """Torque c M v takes Ts c v M v: the deficit, and at most half of the speed."""
    port, v = Port(np.diag([2.0, 1.0]), 1e-2, 0.0), np.array([0.3, -0.1])
    port.out = 1e-4
    found = port.guarded(np.zeros(2), v)
    assert -found @ v * port.Ts == pytest.approx(1e-4, rel=1e-12)
    port.out = 10.0
    found = port.guarded(np.zeros(2), v)
    np.testing.assert_allclose(port.Ts * np.linalg.solve(port.inertia, -found), MOST * v)


@pytest.mark.parametrize("delay", [0.05, 0.1])
def test_force_feedback_grows_without_and_is_bounded_with(delay):
    """The pair of the page; the largest motion falls from quarter to quarter."""
    plain = hc.simulate(late(delay))
    guarded = hc.simulate(late(delay, passivity=True, energy=0.01))
    peaks = [[x.max() for x in np.array_split(found.motion, 4)] for found in (plain, guarded)]
    assert plain.grows and np.all(np.diff(peaks[0]) > 0.0) and plain.energy.min() < -1e3
    assert not guarded.grows and np.all(np.diff(peaks[1]) < 0.0)
    assert guarded.energy.min() >= -0.02
    assert guarded.follower.max() > 0.015
    np.testing.assert_allclose(guarded.port_energy.sum(axis=1), guarded.energy, atol=1e-12)


def test_without_a_reserve_it_stands_still():
    """The leader feels nothing in free motion: nothing goes in, so nothing may come out."""
    found = hc.simulate(late(0.05, 0.5, passivity=True, energy=0.0))
    assert found.leader.max() > 0.05 and not np.any(found.follower) and not np.any(found.energy)


@pytest.mark.parametrize("seed", [7, 10, 108])
def test_random_links_stay_above_the_bound(seed):
    """Of the study of 200 links: position-force twice, four-channel; all three use the reserve."""
    assert least(seed).guarded >= -2.0


def test_theory_leaves_them_out_and_says_so():
    pair = late(0.02, passivity=True)
    found = hc.theory.pair_limits(pair)
    assert found.delay == hc.theory.pair_limits(late(0.02)).delay
    assert any("passivity controllers: left out" in x for x in found.assumed)


@pytest.mark.parametrize("field, value", [("energy", -1.0), ("energy", float("nan"))])
def test_bounds(field, value):
    with pytest.raises(hc.ParameterError, match=field):
        hc.Link(passivity=True, **{field: value})


def test_a_reserve_without_controllers_is_refused():
    with pytest.raises(hc.ParameterError, match="must be None without passivity"):
        hc.Link(energy=0.01)


def test_a_drive_is_refused():
    pair = late(0.02, passivity=True)
    with pytest.raises(hc.ParameterError, match="must be 'host' with passivity"):
        replace(pair, law=replace(pair.law, runs="drive"))


def test_a_late_host_is_refused():
    with pytest.raises(hc.ParameterError, match="must be 0 with passivity"):
        replace(late(0.02, passivity=True), delay=1e-3)
