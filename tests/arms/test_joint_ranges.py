"""A pose at the end of a joint's range, and one outside."""

from dataclasses import replace

import mujoco
import pytest

import hapticclay as hc
from hapticclay.ports.device import held_scenario

ARM = """<mujoco><compiler angle="radian"/><worldbody><body>
<joint name="a" axis="0 1 0" range="{}"/>
<inertial pos=".2 0 .03" mass="1" diaginertia=".01 .01 .01"/>
<body pos=".31 .002 .017"><joint name="b" axis="0 1 0" range="-1 2"/>
<inertial pos=".107 0 .021" mass=".53" diaginertia=".003 .003 .003"/><site name="ee" pos=".3 0 0"/>
</body></body></worldbody></mujoco>"""
LAW = hc.JointPD((30.0, 10.0), (1.0, 0.3))
ENDS = {
    "low end": "0 3.665",
    "high end": "-2 0",
    "low end, rounded": "4e-7 3",
    "both": "-1e-7 1e-7",
}


def arm_with(range_):
    return hc.MjcfArm(mujoco.MjSpec.from_string(ARM.format(range_)))


@pytest.mark.parametrize("end", ENDS)
def test_a_joint_at_the_end_of_its_range_rests_there(end):
    arm = arm_with(ENDS[end])
    assert "pose: zero position of the file" in arm.notes
    run = hc.simulate(hc.Scenario(arm=arm, controller=LAW, Ts=1e-3, dt=1e-3, t_max=0.1))
    assert run.status.startswith("time limit")
    served = replace(held_scenario(arm, 1e-3), t_max=0.5)
    assert hc.simulate(served).status.startswith("time limit")


def test_runs_beside_the_limit_need_no_room():
    """They are of small motions about the pose, which theory has without ends of ranges."""
    at_end = hc.studies.joint_runs(arm_with("0 3.665"), LAW, 1e-3)
    free = hc.studies.joint_runs(arm_with("-3 3.665"), LAW, 1e-3)
    assert at_end.agrees.all()
    assert at_end.limit == free.limit


def test_a_pose_outside_the_range_is_said_so():
    arm = arm_with("-3.07 -0.07")
    note = "pose: zero position of the file, at which a (0) is outside its range, -3.07 to -0.07"
    assert note in arm.notes
    assert note in hc.theory.joint_limits(arm, LAW, 1e-3).assumed
    posed = hc.MjcfArm(arm.file, pose={"a": 0.5})
    assert any(x.startswith("pose: as given, at which a (0.5) is outside") for x in posed.notes)
    with pytest.raises(hc.ParameterError, match="must be within the range of the joint, -3.07 to"):
        hc.Scenario(arm=arm, controller=LAW, Ts=1e-3)
    with pytest.raises(hc.ParameterError, match="must be within the range of the joint, -3.07 to"):
        hc.studies.joint_runs(arm, LAW, 1e-3)
