"""Runs of arms at their gains and beside their limit, against the exact map."""

import functools
import importlib
import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.studies.joint_runs import built_scenario, buzz, holding, near_limit

CASES = {
    "planar_2r": (hc.JointPD((20.0, 10.0), (0.3, 0.1), velocity="difference"), 1e-3, 1e-3),
    "haptic_3": (hc.JointPD((2.0,) * 3, (0.02,) * 3, velocity="difference"), 2e-3, 1e-3),
    "five_bar": (hc.JointPD((5.0,) * 2, (0.1,) * 2), 1e-3, 0.0),
    "leader_7": (
        hc.JointPD(
            (240, 240, 240, 240, 24, 31, 25),
            (3, 3, 3, 3, 0.2, 0.2, 0.2),
            velocity="filter",
            cutoff=90.0,
        ),
        2e-3,
        2e-3,
    ),
}


@pytest.fixture(autouse=True, scope="module")
def short_runs():
    """Runs of fewer periods, whose modes must be as near to those of the map."""
    module = importlib.import_module(near_limit.__module__)
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"PERIODS": 20.0, "LONGEST": 0.6, "BUILT": 0.2}.items():
            patch.setattr(module, name, value)
        yield


@functools.cache
def runs_of(name):
    return hc.studies.joint_runs(hc.MjcfArm(name), *CASES[name])


@pytest.mark.parametrize("name", CASES)
def test_runs_agree_with_the_map_beside_the_limit(name):
    """Growth within 10 %, which is 0.05 % of the limit; steps of Ts/8 leave a tenth of that."""
    found = runs_of(name)
    assert found.agrees.all() and len(found.factor) == 3
    assert found.growth[1] < 0.0 < found.growth[2]
    assert found.limit == pytest.approx(found.scale, rel=1e-3)
    np.testing.assert_allclose(found.frequency, found.expected_frequency, rtol=1e-3)
    assert "agree" in found.headline() and found.built.startswith("time limit")
    assert len(found.plot().axes) == 3
    again = type(found)
    assert again is hc.studies.JointRuns


def test_saved_and_read(tmp_path):
    found = runs_of("planar_2r")
    again = hc.studies.JointRuns.load(found.save(tmp_path / "runs.json"))
    np.testing.assert_array_equal(again.motion[2], found.motion[2])
    assert again.headline() == found.headline()
    assert found.summary()["tables"]["runs"]["agrees"] == ["yes"] * 3


def test_an_unstable_loop_grows_as_the_map_says():
    law = hc.JointPD((400.0, 200.0), (0.3, 0.1), velocity="difference")
    found = hc.studies.joint_runs(hc.MjcfArm("planar_2r"), law, 1e-3, 1e-3)
    assert found.agrees.all() and found.growth[0] > 1.0
    assert found.built.startswith("diverged")
    record, mode = buzz(hc.MjcfArm("planar_2r"), law, 1e-3, 1e-3)
    assert record.scenario.controller.Kp == law.Kp
    assert mode.frequency == pytest.approx(found.frequency[0], rel=1e-3)


def test_weight_is_held_at_the_pose():
    """Where gravity acts, the reference is off the pose by G/Kp, and the arm stays there."""
    arm = hc.MjcfArm("leader_7", gravity="acts", friction=(0.0,) * 7)
    law = CASES["leader_7"][0]
    reference = holding(arm, law)
    assert np.abs(reference - arm.q).max() > 1e-3
    held = replace(law, reference=tuple(reference.tolist()))
    run = hc.simulate(hc.Scenario(arm=arm, controller=held, Ts=2e-3, t_max=0.5))
    assert np.abs(run.q - arm.q).max() < 1e-9
    assert hc.studies.joint_runs(arm, law, 2e-3, 2e-3).agrees.all()


def test_drives_keep_no_torque_limit():
    law = replace(CASES["planar_2r"][0], runs="drive", velocity="exact")
    arm = hc.MjcfArm("planar_2r", torque_limit=(5.0, 5.0))
    assert not np.isfinite(built_scenario(arm, law, 1e-3, 0.0).arm.torque_limit).any()
    found = hc.studies.joint_runs(arm, law, 1e-3, 0.0)
    assert math.isnan(found.limit) and found.agrees.all() and len(found.factor) == 1


def test_friction_and_limits_are_left_out_of_runs_beside_the_limit():
    arm = hc.MjcfArm("haptic_3", torque_limit=(1.0,) * 3)
    s = near_limit(arm, *CASES["haptic_3"], 2.0)
    assert not any(s.arm.friction) and not np.isfinite(s.arm.torque_limit).any()
    assert s.controller.Kp == (4.0,) * 3 and s.hardware.delay == 1e-3


def test_what_cannot_be_run_is_refused():
    arm = hc.MjcfArm("leader_7", gravity="acts")
    law = replace(CASES["leader_7"][0], Kp=(0.0,) * 7)
    with pytest.raises(hc.ParameterError, match="Kp .*pulls away from the pose"):
        hc.studies.joint_runs(arm, law, 2e-3, 2e-3)
    low = hc.MjcfArm("leader_7").ranges[3, 0]
    arm = hc.MjcfArm("leader_7", pose={"joint4": float(low) - 0.1})
    with pytest.raises(hc.ParameterError, match="arm.pose.joint4.*within the range of the joint"):
        hc.studies.joint_runs(arm, CASES["leader_7"][0], 2e-3, 2e-3)
