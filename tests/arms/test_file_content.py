"""What a file says of an arm acts as in plain MuJoCo, is noted, or is refused."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.arms import content
from tests.hunt import examples
from tests.oracles.file_arms import plain_motion, random_arm

TS, SAMPLES = 2e-3, 30


def of(text, **kw):
    return hc.MjcfArm(mujoco.MjSpec.from_string(text), **kw)


def end(arm, Kp, Kd, ratio, Ts=TS, samples=SAMPLES):
    n = len(arm.names)
    law = hc.JointPD(tuple(Kp), tuple(Kd), reference=(0.0,) * n)
    run = hc.simulate(
        hc.Scenario(
            arm=arm,
            controller=law,
            Ts=Ts,
            dt=Ts / ratio,
            t_max=Ts * samples,
            stop_when_unstable=False,
        )  # fmt: skip
    )
    assert run.status.startswith("time limit")
    return run.q[-1]


@examples(12)
@given(seed=st.integers(0, 10**6))
def test_random_content_moves_an_arm_as_plain_mujoco_does(seed):
    """Of second order in the step: half of it leaves a quarter of the error, 0.3 with its noise."""
    random = np.random.default_rng(seed)
    text = random_arm(random)
    start = random.normal(0.0, 0.3, mujoco.MjModel.from_xml_string(text).nq)
    Kp, Kd = random.uniform(1, 30, len(start)), random.uniform(0, 1, len(start))
    arm = of(text, pose=start.tolist())
    exact = plain_motion(text, start, Kp, Kd, TS, SAMPLES)
    far = np.abs(exact - start).max()
    coarse, fine = (np.abs(end(arm, Kp, Kd, ratio) - exact).max() for ratio in (8, 16))
    assert fine < 1e-3 * far + 1e-9
    assert fine < 0.3 * coarse + 1e-7 * far + 1e-10


@examples(6)
@given(seed=st.integers(0, 10**6))
def test_energy_is_balanced_with_random_content(seed):
    """Of second order in the step: a quarter of it leaves a sixteenth of the rest, or noise."""
    random = np.random.default_rng(seed)
    text = random_arm(random)
    arm = of(text, pose=random.normal(0.0, 0.3, mujoco.MjModel.from_xml_string(text).nq).tolist())
    n, left = len(arm.names), []
    law = hc.JointPD((10.0,) * n, (0.3,) * n, reference=(0.0,) * n)
    for ratio in (4, 8, 16):
        e = hc.simulate(
            hc.Scenario(
                arm=arm,
                controller=law,
                Ts=TS,
                dt=TS / ratio,
                t_max=0.06,
                force=(1.0, 0.5),
                stop_when_unstable=False,
            )  # fmt: skip
        ).energy
        left.append(abs(e["residual"]) / e["throughput"])
    assert left[2] < 1e-3 and left[2] < 0.2 * left[0] + 1e-6, left


@examples(20)
@given(seed=st.integers(0, 10**6))
def test_theory_has_the_slopes_of_plain_mujoco(seed):
    """Central differences of the engine's torques: 1e-6 of them, for steps of 1e-4."""
    random, step = np.random.default_rng(seed), 1e-4
    text = re.sub('wind="[^"]*"', "", random_arm(random))  # lift of a wind has no symmetric slope
    model = mujoco.MjModel.from_xml_string(text)
    start, data = random.normal(0.0, 0.3, model.nq), mujoco.MjData(model)

    def torques(q, w):
        data.qpos[:], data.qvel[:] = q, w
        mujoco.mj_forward(model, data)
        return data.qfrc_bias - data.qfrc_passive

    def slopes(of):
        ways = step * np.eye(model.nv)
        return np.array([(of(way) - of(-way)) / (2 * step) for way in ways]).T

    linear = of(text, pose=start.tolist()).linear()
    creep = 1e-3  # the share of quadratic drag falls with the rates
    D = slopes(lambda way: torques(start, creep * way) / creep)
    S = slopes(lambda way: torques(start + way, np.zeros(model.nv)))
    size = np.abs(D).max() + np.abs(S).max()
    np.testing.assert_allclose(linear.damping, D, atol=1e-5 * size)
    np.testing.assert_allclose(linear.stiffness + linear.gravity_stiffness, S, atol=1e-5 * size)
    M = np.zeros((model.nv, model.nv))
    data.qpos[:] = start
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, M)
    np.testing.assert_allclose(linear.inertia, M, rtol=1e-12, atol=1e-14)


ONE = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="a" axis="0 0 1" {}/>
<inertial pos=".1 0 0" mass="1" diaginertia=".05 .05 .05"/><site name="h" pos=".2 0 0"/></body>{}
</worldbody>{}</mujoco>"""
TIED = """<body pos="1 0 0"><joint name="f" axis="0 0 1" frictionloss="1.5" armature=".05"/>
<inertial pos="0 0 0" mass="1" diaginertia=".05 .05 .05"/></body>"""
RATIO = '<equality><joint joint1="f" joint2="a" polycoef="0 {} 0 0 0"/></equality>'


@pytest.mark.parametrize("ratio", [1.0, -0.4, 3.0])
def test_friction_of_a_follower_holds_the_joint_that_moves_it(ratio):
    """A spring of the law moves the joint from rest once it exceeds ratio times the friction."""
    text, Kp = ONE.format('frictionloss="0.2"', TIED, RATIO.format(ratio)), 10.0
    arm = of(text, joints=["a"])
    friction = 0.2 + abs(ratio) * 1.5
    assert arm.friction == pytest.approx((friction,), rel=1e-9)  # of a chain closed within 1e-10
    for share, rests in ((0.999, True), (1.001, False)):
        law = hc.JointPD((Kp,), (0.0,), reference=(share * friction / Kp,))
        run = hc.simulate(hc.Scenario(arm=arm, controller=law, Ts=1e-3, t_max=0.1))
        assert bool(run.q[-1, 0] == 0.0) is rests
    again = of(text, joints=["a"], friction=arm.friction, armature=arm.armature)
    assert again.friction == arm.friction  # what is given stands for all of it
    assert of(text, joints=["a"], friction=[0.3]).friction == (0.3,)


def test_friction_that_several_joints_move_is_noted():
    bars = Path(__file__).parents[2] / "mjcf" / "arms" / "five_bar.xml"
    spec = mujoco.MjSpec.from_file(str(bars))
    spec.joint("left_elbow").frictionloss = 0.1
    arm = hc.MjcfArm(spec)
    assert arm.friction == (0.0, 0.0)
    assert "friction of joints that several move takes no part: left_elbow" in arm.notes


NOTES = {
    "springs off": ('<option><flag spring="disable"/></option>', "", "(flag spring): springs"),
    "dampers off": ('<option><flag damper="disable"/></option>', "", "(flag damper): dampers"),
    "limits off": ('<option><flag limit="disable"/></option>', "", "ranges of joints"),
    "weight off": ('<option><flag gravity="disable"/></option>', "", "(flag gravity): gravity"),
    "a fluid": ('<option density="1000"/>', "", "a fluid acts on the bodies (1000 kg/m^3, 0 Pa.s)"),
    "polynomials": ("", 'damping="1 2" stiffness="1 2"', "dampers that are not linear"),
    "a spring that yields": ("", 'stiffness="5" springyield="3"', "(springyield), here elastic: a"),
    "a torque range": ("", 'actuatorfrcrange="-2 5"', "of a: the smaller side of -2 to 5"),
}


@pytest.mark.parametrize("name", NOTES)
def test_what_acts_in_a_way_of_its_own_is_noted(name):
    tail, joint, note = NOTES[name]
    assert any(note in x for x in of(ONE.format(joint, "", tail)).notes)


def test_ranges_that_are_off_end_no_run():
    text = ONE.format('range="-1 1"', "", '<option><flag limit="disable"/></option>')
    assert not np.isfinite(of(text).ranges).any()


LIMITS = {  # actuators, torque limit
    '<position joint="a" kp="9" forcerange="-3 4" gear="2"/>': 6.0,
    '<position joint="a" kp="9" forcerange="-3 4" gear="-2"/>': 6.0,
    '<motor joint="a" gear="2" ctrlrange="-5 6"/>': 10.0,
    '<motor joint="a" gear="2" ctrlrange="-5 6" forcerange="-1 1"/>': 2.0,
    '<general joint="a" gainprm="0.5" ctrlrange="-5 5"/>': 2.5,
    '<position joint="a" kp="9" ctrlrange="-1 1"/>': np.inf,  # a position is limited, no torque
    '<motor joint="a" ctrlrange="0 5"/>': np.inf,
    '<motor joint="a" ctrlrange="-2 2"/><motor joint="a" ctrlrange="-1 1" gear="3"/>': 5.0,
    '<motor joint="a" ctrlrange="-2 2"/><motor joint="a"/>': np.inf,
    '<motor joint="a" ctrlrange="-9 9"/>': 7.0,  # of the joint
}


@pytest.mark.parametrize("actuators", LIMITS)
def test_torque_limits_are_what_the_engine_gives_at_most(actuators):
    joint = 'actuatorfrcrange="-7 7"' if LIMITS[actuators] == 7.0 else ""
    text = ONE.format(joint, "", f"<actuator>{actuators}</actuator>")
    arm = of(text)
    assert arm.torque_limit == (LIMITS[actuators],)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    if np.isfinite(arm.torque_limit[0]):
        most = []
        for sign in (1e6, -1e6):
            data.ctrl[:] = sign * np.sign(model.actuator_gear[:, 0])
            mujoco.mj_forward(model, data)
            most.append(abs(data.qfrc_actuator[0]))
        assert min(most) == pytest.approx(arm.torque_limit[0])


def test_joints_without_names_have_their_own_at_their_own_poses():
    text = (
        ONE.format("", "", "")
        .replace('name="a" ', "")
        .replace(
            '<site name="h" pos=".2 0 0"/>',
            '<body><joint axis="0 1 0"/><joint name="joint 1" axis="1 0 0"/>'
            '<inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/><site name="h" pos=".2 0 0"/>'
            "</body>",
        )
    )
    arm = of(text, pose=[0.3, 0.7, -0.2])
    assert arm.names == ("joint 1'", "joint 2", "joint 1")
    np.testing.assert_array_equal(arm.q, [0.3, 0.7, -0.2])
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = arm.q
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(arm.handle(), data.site_xpos[0], atol=1e-15)
    law = hc.JointPD((1.0,) * 3, (0.0,) * 3)
    run = hc.simulate(hc.Scenario(arm=arm, controller=law, Ts=1e-3, t_max=0.01))
    np.testing.assert_array_equal(run.q[0], arm.q)


ELEMENTS = {  # of the table, and of MuJoCo's reference
    "option": ("option",),
    "flag": ("option-flag",),
    "joint": ("body-joint",),
    "tendon": ("tendon-spatial", "tendon-fixed"),
    "equality": (
        "equality-connect", "equality-weld", "equality-joint", "equality-tendon", "equality-flex",
        "equality-flexstrain",
    ),
    "actuator": ("actuator-general",),
    "body": ("body",),
}  # fmt: skip


def test_the_table_has_every_attribute_of_mujoco_s_reference():
    reference = Path(mujoco.__file__).parent / "doc" / "XMLreference.rst"
    if not reference.exists():
        pytest.skip("this mujoco brings no manual")
    text, table = reference.read_text(), {}
    for row in content.CONTENT:
        table.setdefault(row.element, set()).update(row.attributes.split())
    for element, of_reference in ELEMENTS.items():
        names = {
            x for part in of_reference for x in re.findall(rf"^\.\. _{part}-(\w+):$", text, re.M)
        }
        assert names <= table[element], names - table[element]


def test_the_page_has_the_table():
    page = Path(__file__).parents[2] / "docs" / "own_arm.md"
    assert content.page(page.read_text()) == page.read_text()
