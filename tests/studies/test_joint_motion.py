"""The swing of an arm's joints read from a run, beside eigenvalues of the exact map."""

import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.theory.joint_gains import Study

KP, KD = np.array((240, 240, 240, 240, 24, 31, 25.0)), np.array((3, 3, 3, 3, 0.2, 0.2, 0.2))
ARM = hc.MjcfArm("leader_7", friction=[0.0] * 7)
AIM = tuple((ARM.q + 1e-4).tolist())  # small: motion is linear to 1e-4
TS, DELAY = 2e-3, 4e-3


def scene(controller, t_max=0.8):
    return hc.Scenario(
        arm=ARM,
        controller=controller,
        Ts=TS,
        dt=TS / 8,
        t_max=t_max,
        hardware=hc.Hardware(delay=DELAY),
        stop_when_unstable=False,
        force=(0.0, 0.0),
    )


def own(factor):
    """The same law as a function of one's own."""

    def pd(t, q, qd, fh, state, params):
        aim = factor * KP * (np.array(AIM) - q) - KD * np.array(qd)
        return tuple(aim.tolist()), state

    return hc.Controller(pd)


@pytest.mark.parametrize("factor", [0.5, 1.3, 1.5, 2.0])
def test_growth_frequency_and_joint_of_a_controller_of_ones_own(factor):
    """Within 1 %: a step of an eighth of a sample, and motion that is not quite linear."""
    law = hc.JointPD(tuple(factor * KP), tuple(KD), reference=AIM)
    loop = Study(ARM, law, TS, DELAY).loop
    values, vectors = np.linalg.eig(loop.map())
    s = np.log(values[np.abs(values) > 0.5].astype(complex)) / TS
    swings = s[np.abs(s.imag) > 1.0]
    expected = swings[swings.real.argmax()]
    i = int(np.abs(np.log(values.astype(complex)) / TS - expected).argmin())
    motion = hc.studies.joint_motion(hc.simulate(scene(own(factor))))
    assert motion.growth == pytest.approx(expected.real, abs=0.01 * abs(expected))
    assert motion.frequency == pytest.approx(abs(expected.imag) / (2.0 * math.pi), rel=0.01)
    shares = np.abs(vectors[:7, i])
    np.testing.assert_allclose(motion.shares, shares / shares.max(), atol=0.05)


def test_at_rest_there_is_no_swing():
    still = scene(hc.JointPD(tuple(KP), tuple(KD)))
    with pytest.raises(hc.ParameterError, match="must show a swing"):
        hc.studies.joint_motion(hc.simulate(still))


def test_joints_that_turn_on_do_not_swing():
    arm = replace(ARM, damping=[1.0] * 7)
    drifts = replace(scene(hc.Controller(lambda *x: ((0.05,) * 7, ()))), arm=arm)
    with pytest.raises(hc.ParameterError, match="must show a swing"):
        hc.studies.joint_motion(hc.simulate(replace(drifts, t_max=0.3)))


def test_the_two_link_arm_in_closed_form_is_refused():
    with pytest.raises(hc.ParameterError):
        hc.studies.joint_motion(hc.simulate(hc.constant_cut(t_max=0.1)))
