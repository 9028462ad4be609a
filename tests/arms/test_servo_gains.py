"""Gains that a file's actuators have: against forces that the engine computes."""

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.theory import file_servo

LINKS = """<body><joint name="a" axis="0 1 0" damping=".1"/>
<inertial pos=".2 0 0" mass="1" diaginertia=".01 .01 .01"/><body pos=".4 0 0">
<joint name="b" axis="0 1 0" armature=".002"/>
<inertial pos=".1 .02 0" mass=".5" diaginertia=".003 .003 .003"/><site name="ee" pos=".2 0 0"/>
{}</body></body>"""
FINGERS = """<body><joint name="f" type="slide"/><geom size=".02"/></body>
<body><joint name="g" type="slide"/><geom size=".02"/></body>"""


def model(actuators, option="", rest="", more=""):
    return (
        f'<mujoco><compiler angle="radian"/>{option}<worldbody>{LINKS.format(more)}</worldbody>'
        f"<actuator>{actuators}</actuator>{rest}</mujoco>"
    )


def arm_of(text, **kw):
    return hc.MjcfArm(mujoco.MjSpec.from_string(text), **kw)


def slopes(text, q=(0.0, 0.0)):
    """-d(force of the actuators)/d(q, w), shape (2, 2) each, by differences in the engine."""
    of = mujoco.MjModel.from_xml_string(text)
    data, h, out = mujoco.MjData(of), 1e-6, np.zeros((2, 2, 2))
    for kind, state in enumerate((data.qpos, data.qvel)):
        for j in range(2):
            for sign in (1, -1):
                mujoco.mj_resetData(of, data)
                data.qpos[:2] = q
                state[j] += sign * h
                mujoco.mj_forward(of, data)
                out[kind][:, j] -= sign * data.qfrc_actuator[:2] / (2.0 * h)
    return out


ACTUATORS = {
    "position": '<position joint="a" kp="50" kv="3"/><position joint="b" kp="20" kv="1"/>',
    "gear": '<position joint="a" kp="50" kv="3" gear="2"/><position joint="b" kp="2" gear="-9"/>',
    "damping ratio": '<position joint="a" kp="50" dampratio="1"/><position joint="b" kp="9"/>',
    "general": '<general joint="a" gainprm="80" biastype="affine" biasprm="1 -50 -3"/>'
    '<motor joint="b"/>',
    "set points filtered": '<position joint="a" kp="50" kv="2" timeconst=".1"/>'
    '<position joint="b" kp="50" forcerange="-5 5"/>',
    "integrated velocity": '<intvelocity joint="a" kp="50" kv="3" actrange="-1 1"/>'
    '<velocity joint="b" kv="2"/>',
    "two at a joint": '<position joint="a" kp="50"/><velocity joint="a" kv="2"/>'
    '<position joint="b" kp="7" kv="1"/>',
    "PID": '<pid joint="a" kp="50" kv="3" ki=".4"/><pid joint="b" kp="20" dampratio=".7"/>',
    "motors with controllers": '<dcmotor joint="a" resistance="2" motorconst=".1 .1" gear="3" '
    'input="pos vel" controller="7 0 1.1"/><dcmotor joint="b" resistance="2" motorconst=".1" '
    'input="pos" controller="3 0 .2"/>',
    "in the frame of the parent": '<position jointinparent="a" kp="50"/><position joint="b"/>',
}


@pytest.mark.parametrize("kind", ACTUATORS)
def test_gains_are_the_slopes_of_the_engine_s_forces(kind):
    text = model(ACTUATORS[kind])
    law = hc.JointPD.of(arm_of(text))
    stiff, damped = slopes(text)
    # 1e-7: differences of 1e-6 of numbers with 16 digits
    np.testing.assert_allclose(np.diag(law.Kp), stiff, atol=1e-7 * np.abs(stiff).max())
    np.testing.assert_allclose(np.diag(law.Kd), damped, atol=1e-7 * (1 + np.abs(damped).max()))


def test_a_servo_of_a_tendon_and_of_a_follower():
    """Both pull at a joint of the arm by their moment arm there: 2^2 and (3 * .5)^2 times kp."""
    tendon = '<tendon><fixed name="t"><joint joint="b" coef="2"/></fixed></tendon>'
    arm = arm_of(model('<position tendon="t" kp="5" kv=".5"/>', rest=tendon))
    np.testing.assert_allclose(arm.servo.Kp, [0.0, 20.0])
    np.testing.assert_allclose(arm.servo.Kd, [0.0, 2.0])
    follower = '<equality><joint joint1="b" joint2="a" polycoef="0 .5 0 0 0"/></equality>'
    arm = arm_of(model('<position joint="b" kp="5" gear="3"/>', rest=follower))
    assert arm.names == ("a",)
    np.testing.assert_allclose(arm.servo.Kp, [5.0 * 1.5**2])


def test_what_of_actuators_is_no_gain_is_told():
    tendon = (
        '<tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="2"/></fixed>'
        "</tendon>"
    )
    acts = (
        '<position name="both" tendon="t" kp="5"/><pid name="i" joint="a" kp="9" ki="1"/>'
        '<dcmotor name="m" joint="b" resistance="2" motorconst=".1"/>'
        '<general name="up" joint="b" biastype="affine" biasprm="0 3 0"/>'
    )
    law = hc.JointPD.of(arm := arm_of(model(acts, rest=tendon)))
    assert law.Kp == (9.0, 0.0) and law.Kd == (0.0, 0.0)
    notes = hc.theory.joint_limits(arm, law, 1e-3).assumed
    for words in (
        "gains: of the file, position servos at a",
        "no gains in the file, 0 taken: b",
        "servos that pull at several joints take no part: both",
        "integral action (ki) takes no part: i",
        "the back-EMF of motors without controller takes no part: m",
        "actuators with a negative gain take no part: up",
    ):
        assert words in notes
    other = hc.theory.joint_limits(arm, hc.JointPD((8.0, 1.0), (0.0, 0.1)), 1e-3).assumed
    assert not any(x.startswith("gains:") for x in other)


def test_gripper_servos_are_no_gains_of_the_arm():
    text = model('<position joint="f" kp="9"/>', more=FINGERS)
    with pytest.raises(hc.ParameterError, match=r"the arm's file has none.*2 numbers each \(a, b"):
        hc.JointPD.of(arm_of(text))
    off = '<position joint="a" kp="9" group="3"/><position joint="b" kp="4"/>'
    arm = arm_of(model(off, '<option actuatorgroupdisable="3"/>'))
    assert arm.servo.Kp == (0.0, 4.0)


def test_damping_ratios_of_a_floating_base():
    """MuJoCo resolves them with the base free; the file's gains are those."""
    acts = '<position joint="a" kp="50" dampratio="1"/><position joint="b" kp="20" dampratio="1"/>'
    base = '<body name="pelvis"><freejoint/><geom size=".1"/>{}</body>'
    text = model(acts).replace(LINKS.format(""), base.format(LINKS.format("")))
    of = mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(arm_of(text).servo.Kd, -of.actuator_biasprm[:, 2], rtol=1e-12)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4", "discrete"])
@pytest.mark.parametrize("dt, kv", [(0.002, 3), (0.01, 30)])
def test_a_step_of_the_file_s_simulation(integrator, dt, kv):
    """The eigenvalues of a step of the engine itself, by differences at rest."""
    option = f'<option timestep="{dt}" integrator="{integrator}"/>'
    acts = f'<position joint="a" kp="50" kv="{kv}" gear="2"/><position joint="b" kp="20" kv=".5"/>'
    text = model(acts, option)
    of = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(of)
    mujoco.mj_forward(of, data)
    held, h, A = data.qfrc_bias.copy(), 1e-6, np.zeros((4, 4))
    for k in range(4):
        for sign in (1, -1):
            mujoco.mj_resetData(of, data)
            data.qfrc_applied[:] = held
            (data.qpos if k < 2 else data.qvel)[k % 2] = sign * h
            mujoco.mj_step(of, data)
            A[:, k] += sign * np.concatenate([data.qpos, data.qvel]) / (2.0 * h)
    arm = arm_of(text)
    found = file_servo.radius(arm, arm.servo.Kp, arm.servo.Kd, arm.servo.dt, arm.servo.integrator)
    # 1e-7: differences of 1e-6, and a quadratic term of rates
    assert found == pytest.approx(np.abs(np.linalg.eigvals(A)).max(), rel=1e-7)
    notes = hc.theory.joint_limits(arm, hc.JointPD.of(arm), 1e-3).assumed
    (said,) = [x for x in notes if x.startswith("in the file's own simulation")]
    assert f"({integrator})" in said and ("unstable" in said) == (found > 1.0)
    assert "in drives, whose own loops count as continuous (runs drive): stable" in notes
    other = hc.theory.joint_limits(arm, hc.JointPD.of(arm, runs="drive"), dt, dt)
    host = hc.theory.joint_limits(arm, hc.JointPD.of(arm), dt, dt)
    assert other.stable
    (said,) = [x for x in other.assumed if x.startswith("in a host at")]
    assert ("unstable" in said) == (not host.stable)
