"""Drives that sample at a rate of their own, under a host that feeds gravity and friction."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.studies.joint_runs import built_scenario
from hapticclay.theory.joint_gains import Study
from tests.hunt import examples

ARM = hc.MjcfArm("planar_2r", friction=(0.0, 0.0))  # in a plane without gravity
LEADER = hc.MjcfArm("leader_7", friction=[0.0] * 7)
KP, KD = (240, 240, 240, 240, 24, 31, 25), (3, 3, 3, 3, 0.2, 0.2, 0.2)
KHZ = hc.JointPD(KP, KD, runs="drive", drive_rate=1000.0)


@given(
    many=st.integers(1, 8),
    rate=st.floats(200.0, 5000.0),
    late=st.floats(0.0, 3.0),
    Kp=st.tuples(st.floats(1.0, 100.0), st.floats(1.0, 100.0)),
    Kd=st.tuples(st.floats(0.05, 2.0), st.floats(0.05, 2.0)),
)
@examples(20)
def test_alone_a_drive_is_a_host_of_its_rate(many, rate, late, Kp, Kd):
    """Nothing is fed forward, so the slower host and its delay change nothing."""
    drive = hc.JointPD(Kp, Kd, runs="drive", drive_rate=rate)
    Ts = many / rate
    slow = Study(ARM, drive, Ts, late * Ts).loop
    fast = Study(ARM, hc.JointPD(Kp, Kd), 1.0 / rate, 0.0).loop
    want = np.sort(np.abs(np.linalg.eigvals(fast.map())) ** many)[-4:]
    found = np.sort(np.abs(np.linalg.eigvals(slow.map())))[-4:]
    np.testing.assert_allclose(found, want, rtol=1e-9, atol=1e-9)


def dense(arm, law, Ts, delay):
    """Largest eigenvalue of the loop, its drives' samples one by one: own code, own hold."""
    from scipy.linalg import expm

    x, n = arm.linear(), len(arm.names)
    samples = round(law.drive_rate * Ts)
    late, step = int(np.ceil(delay * law.drive_rate - 1e-9)), Ts / samples
    inverse = np.linalg.inv(x.inertia)
    stiffness = x.stiffness + x.gravity_stiffness
    a = np.zeros((3 * n, 3 * n))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n] = np.hstack([-inverse @ stiffness, -inverse @ x.damping, inverse])
    e = expm(a * step)[: 2 * n]
    memory = 1 + late // samples + 1
    size = (2 + memory) * n

    def advance(state):
        q, w, sent = state[:n], state[n : 2 * n], state[2 * n :].reshape(memory, n)
        for k in range(samples):
            if k == 0:
                fed = x.gravity_stiffness @ q + np.array(law.slopes) * w
                sent = np.vstack([fed, sent[:-1]])
            held = sent[-((k - late) // samples)] - np.array(law.Kp) * q - np.array(law.Kd) * w
            q, w = np.split(e @ np.concatenate([q, w, held]), 2)
        return np.concatenate([q, w, sent.ravel()])

    z = np.linalg.eigvals(np.array([advance(unit) for unit in np.eye(size)]).T)
    return np.abs(z).max()


@pytest.mark.parametrize("late", [0.0, 0.3e-3, 2e-3, 5.5e-3])
@pytest.mark.parametrize("slope", [0.0, 0.5])
@pytest.mark.parametrize("factor", [0.5, 20.0])
def test_the_map_of_both_rates_is_that_of_their_samples_one_by_one(late, slope, factor):
    law = replace(
        KHZ,
        Kp=[factor * k for k in KP],
        friction=[(0.0, 1.0, slope * k) for k in KD],
        drive_rate=2e3,
    )
    found = Study(LEADER, law, 2e-3, late).loop.radius()
    assert found == pytest.approx(dense(LEADER, law, 2e-3, late), rel=1e-10)


def test_limits_lie_where_the_map_turns_and_more_than_linearly_in_the_rate():
    limits = hc.theory.joint_limits(LEADER, KHZ, 2e-3, 2e-3)
    for share, stable in ((0.999, True), (1.001, False)):
        law = replace(KHZ, Kp=[share * limits.scale * k for k in KP])
        assert Study(LEADER, law, 2e-3, 2e-3).loop.stable() is stable
    faster = hc.theory.joint_limits(LEADER, replace(KHZ, drive_rate=4000.0), 2e-3, 2e-3)
    assert 3.5 < faster.scale / limits.scale < 4.5  # Kp < (D + Kd) 2/Ts of each joint, nearly


def test_runs_at_both_rates_are_those_of_the_map():
    """Gravity and friction are fed by the host at 500 Hz, 2 ms late, gains at 1 kHz."""
    law = replace(KHZ, friction=[(0.0, 1.0, 0.2 * k) for k in KD], velocity="difference")
    runs = hc.studies.joint_runs(LEADER, law, 2e-3, 2e-3)
    assert bool(np.all(runs.agrees)) and runs.limit == pytest.approx(runs.scale, rel=1e-4)


def test_a_drive_without_rate_is_continuous_and_a_fast_one_comes_near_it():
    """Of first order in its sample."""
    law = replace(KHZ, drive_rate=None)
    exact = Study(LEADER, law, 2e-3, 0.0).loop.radius()
    errors = [
        abs(Study(LEADER, replace(law, drive_rate=rate), 2e-3, 0.0).loop.radius() - exact)
        for rate in (2e4, 4e4)
    ]
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize(
    "law, field, words",
    [
        (dict(runs="host", drive_rate=1000.0), "drive_rate", "left out where the law runs on"),
        (dict(runs="drive", drive_rate=5.0), "drive_rate", "10"),
        (dict(runs="drive", drive_rate=1234.0), "drive_rate", "such as 1000, 1500"),
        (dict(runs="drive", drive_rate=100.0), "drive_rate", "such as 500"),
    ],
)
def test_what_is_no_rate_of_a_drive_is_refused(law, field, words):
    with pytest.raises(hc.ParameterError) as error:
        hc.theory.joint_limits(LEADER, hc.JointPD(KP, KD, **law), 2e-3)
    assert error.value.field == field and words in str(error.value)


def test_a_scenario_says_how_a_drive_that_samples_is_run():
    with pytest.raises(hc.ParameterError, match="runs='host'"):
        hc.Scenario(arm=LEADER, controller=KHZ, Ts=2e-3)
    built = built_scenario(LEADER, KHZ, 2e-3, 0.0)
    assert built.Ts == pytest.approx(1e-3) and built.controller.runs == "host"


def test_drives_without_a_rate_are_told_what_one_would_carry():
    limits = hc.theory.joint_limits(LEADER, replace(KHZ, drive_rate=None), 2e-3, 2e-3)
    sampled = hc.theory.joint_limits(LEADER, KHZ, 2e-3, 2e-3)
    assert limits.scale == np.inf
    assert f"sampled at 1000 Hz they carry all Kp times {sampled.scale:.4g}" in limits.advice()
