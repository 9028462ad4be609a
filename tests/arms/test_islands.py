"""What hangs on an arm is locked: inertia against the engine's own, of the joints that move."""

import dataclasses
import math
import pickle

import mujoco
import numpy as np
import pytest

import hapticclay as hc

FINGERS = """
<body name="{p}f1" pos=".2 0 0"><joint name="{p}g1" type="slide" axis="0 0 1"/>
<inertial pos="0 .01 .01" mass=".05" diaginertia="1e-5 1e-5 1e-5"/></body>
<body name="{p}f2" pos=".2 0 0"><joint name="{p}g2" type="slide" axis="0 0 -1"/>
<inertial pos="0 -.01 -.01" mass=".07" diaginertia="1e-5 2e-5 1e-5"/></body>"""
ARM = """
<body name="{p}l1" pos="0 {y} .1"><joint name="{p}a" axis="0 1 0"/>
<inertial pos=".2 0 0" mass="1" diaginertia=".01 .01 .01"/>
<body name="{p}l2" pos=".4 0 0"><joint name="{p}b" axis="0 {c} {s}" armature=".002"/>
<inertial pos=".1 .02 0" mass=".5" diaginertia=".003 .003 .003"/>{site}{more}</body></body>"""
EQUAL = '<joint joint1="{p}g2" joint2="{p}g1"/>'
MOTORS = '<motor joint="{p}a"/><motor joint="{p}b"/><position joint="{p}g1" kp="10"/>'


def limb(p="", y=0, hand=FINGERS, site='<site name="{p}ee" pos=".2 0 0"/>'):
    more, at = hand.format(p=p), site.format(p=p)
    return ARM.format(p=p, y=y, more=more, site=at, c=math.cos(0.3), s=math.sin(0.3))


def model(bodies, equality="", actuator="", rest=""):
    return (
        f'<mujoco model="m"><compiler angle="radian"/><worldbody>{bodies}</worldbody>'
        f"<equality>{equality}</equality><actuator>{actuator}</actuator>{rest}</mujoco>"
    )


def own_inertia(text, names, pose=None):
    """Rows and columns of the engine's M at a pose of all joints."""
    of = mujoco.MjModel.from_xml_string(text)
    data, whole = mujoco.MjData(of), np.zeros((of.nv, of.nv))
    for name, q in (pose or {}).items():
        data.qpos[of.jnt_qposadr[of.joint(name).id]] = q
    mujoco.mj_forward(of, data)
    mujoco.mj_fullM(of, data, whole)
    dofs = [int(of.jnt_dofadr[of.joint(name).id]) for name in names]
    return whole[np.ix_(dofs, dofs)]


def arm_of(text, **kw):
    return hc.MjcfArm(mujoco.MjSpec.from_string(text), **kw)


def test_a_hinge_with_a_site_and_two_slides_tied():
    text = """<mujoco><worldbody><body><joint name="h" axis="0 1 0"/>
    <inertial pos=".1 0 0" mass="1" diaginertia=".01 .01 .01"/><site name="ee" pos=".2 0 0"/>
    <body><joint name="s1" type="slide"/><geom size=".01"/></body>
    <body><joint name="s2" type="slide"/><geom size=".01"/></body></body></worldbody>
    <equality><joint joint1="s1" joint2="s2"/></equality></mujoco>"""
    arm = arm_of(text)
    assert arm.names == ("h",) and "locked: s1, s2" in arm.notes
    np.testing.assert_allclose(arm.mass_matrix(), own_inertia(text, ["h"]), rtol=1e-12)


TEN = '<body><freejoint name="f"/><geom size=".1"/></body>'
SCENES = {
    "fingers tied": model(limb(), EQUAL.format(p=""), MOTORS.format(p="")),
    "tied, without actuators": model(limb(), EQUAL.format(p="")),
    "a loose cube first": model(TEN + limb(), EQUAL.format(p="")),
    "a loose cube last": model(limb() + TEN, EQUAL.format(p="")),
    "a target moved by hand": model(
        limb() + '<body name="t" mocap="true"><geom size=".1"/><site name="x"/></body>',
        EQUAL.format(p="") + '<weld body1="t" body2="l2"/>',
    ),
    "a ball that hangs on it": model(
        limb(hand='<body name="{p}c"><joint type="ball"/><geom size=".02" pos=".1 0 0"/></body>')
    ),
    "a springy tendon of the hand": model(
        limb(),
        actuator='<position tendon="t" kp="3" damping="2" armature=".1"/>',
        rest='<tendon><fixed name="t" stiffness="5" frictionloss="1"><joint joint="g1" coef="1"/>'
        '<joint joint="g2" coef="-1"/></fixed></tendon>',
    ),
    "fingers closed by a connect": model(
        limb(), '<connect body1="f1" body2="f2" anchor="0 0 0"/>', MOTORS.format(p="")
    ),
    "a tendon that ties the fingers": model(
        limb(),
        '<tendon tendon1="t"/>',
        rest='<tendon><fixed name="t"><joint joint="g1" coef="1"/><joint joint="g2" coef="1"/>'
        "</fixed></tendon>",
    ),
}


@pytest.mark.parametrize("scene", SCENES)
def test_what_hangs_on_an_arm_is_locked(scene):
    """M is the engine's own of the arm's joints, at any pose of all."""
    text = SCENES[scene]
    for pose in ({}, {"a": 0.4, "b": -0.7}):
        arm = arm_of(text, pose=pose or None)
        assert arm.names == ("a", "b")
        # 1e-12: the same algorithm on the same numbers, in another order where joints were deleted
        np.testing.assert_allclose(
            arm.mass_matrix(), own_inertia(text, arm.names, pose), rtol=1e-12
        )


def test_locked_joints_may_be_posed():
    text = SCENES["fingers tied"]
    pose = {"g1": 0.05, "g2": 0.05}
    arm = arm_of(text, pose=pose)
    np.testing.assert_allclose(arm.mass_matrix(), own_inertia(text, "ab", pose), rtol=1e-12)
    assert np.abs(arm.mass_matrix() - arm_of(text).mass_matrix()).max() > 1e-4


@pytest.mark.parametrize("side", ["left/", "right/"])
@pytest.mark.parametrize("by_name", [False, True])
def test_two_arms_in_one_file(side, by_name):
    sides = "left/", "right/"
    text = model(
        limb("left/", 0.3) + limb("right/", -0.3),
        "".join(EQUAL.format(p=p) for p in sides),
        "".join(MOTORS.format(p=p) for p in sides),
    )
    names = (f"{side}a", f"{side}b")
    arm = arm_of(text, site=f"{side}ee", joints=names if by_name else None)
    assert arm.names == names
    np.testing.assert_allclose(arm.mass_matrix(), own_inertia(text, names), rtol=1e-12)
    other = "right/" if side == "left/" else "left/"
    assert f"{other}a" in next(x for x in arm.notes if x.startswith("locked: "))
    with pytest.raises(hc.ParameterError, match="must be named.* such as left/ee, right/ee$"):
        arm_of(text)
    assert arm_of(text, joints=names).site == f"{side}ee"


BASE = '<body name="pelvis" pos="0 0 1" euler=".1 .2 .3"><freejoint name="root"/><geom size=".2"/>'


def test_a_floating_base_is_held_where_it_is():
    """At the key frame home if there is one; gravity acts as the base leans there."""
    leaning = "0 0 2 0.6 0.8 0 0"
    text = model(
        f"{BASE}{limb(hand='')}</body>",
        rest=f'<keyframe><key name="home" qpos="{leaning} .3 .2"/></keyframe>',
    )
    arm = arm_of(text)
    assert arm.names == ("a", "b")
    assert "pelvis (a floating base) is held where it is" in arm.notes
    of = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(of)
    mujoco.mj_resetDataKeyframe(of, data, 0)
    mujoco.mj_forward(of, data)
    np.testing.assert_allclose(arm.handle(), data.site_xpos[0], atol=1e-14)
    whole = np.zeros((of.nv, of.nv))
    mujoco.mj_fullM(of, data, whole)
    np.testing.assert_allclose(arm.mass_matrix(), whole[6:, 6:], rtol=1e-12)
    np.testing.assert_allclose(arm.mechanism.weights(), data.qfrc_bias[6:], rtol=1e-12)
    again = hc.MjcfArm(arm.file, pose=arm.pose)
    np.testing.assert_allclose(again.handle(), arm.handle(), atol=1e-15)


@pytest.mark.parametrize("root", ["root", ""])
def test_the_place_of_a_base_is_part_of_the_pose(root, tmp_path):
    """An arm of another key frame stays there in copies, pickles and files."""
    rest = '<keyframe><key name="lying" qpos="1 2 3 0.6 0 0.8 0 .3 .2"/></keyframe>'
    text = model(f"{BASE}{limb(hand='')}</body>", rest=rest).replace('"root"', f'"{root}"')
    file = tmp_path / "robot.xml"
    file.write_text(text)
    arm = hc.MjcfArm(file, pose="lying")
    law = hc.JointPD((20.0, 10.0), (1.0, 0.5))
    run = hc.Scenario(arm=arm, controller=law, Ts=1e-3, dt=1e-3, t_max=0.1)
    for other in (
        dataclasses.replace(arm),
        pickle.loads(pickle.dumps(arm)),
        hc.Scenario.load(run.save(tmp_path / "run.toml")).arm,
    ):
        np.testing.assert_array_equal(other.handle(), arm.handle())
        np.testing.assert_array_equal(other.mechanism.weights(), arm.mechanism.weights())
    name = root or "joint 1"
    up = hc.MjcfArm(file, pose={name: (0, 0, 0, 1, 0, 0, 0), "a": 0.3})
    alone = arm_of(model(limb(hand="")), pose={"a": 0.3})
    np.testing.assert_allclose(up.handle(), alone.handle(), atol=1e-15)
    for bad in ((0, 0, 0), (0, 0, 0, 0, 0, 0, 0), (0, 0, 0, 1, 0, 0, np.nan), 1.0):
        with pytest.raises(hc.ParameterError, match="pose"):
            hc.MjcfArm(file, pose={name: bad})


def test_a_run_holds_what_is_locked():
    """The same motion as of the arm alone, its hand made one with the last link."""
    arms = [arm_of(SCENES["fingers tied"]), arm_of(SCENES["a loose cube first"])]
    alone = limb(hand=FINGERS.replace('<joint name="{p}g1" type="slide" axis="0 0 1"/>', ""))
    arms.append(arm_of(model(alone.replace('<joint name="g2" type="slide" axis="0 0 -1"/>', ""))))
    law = hc.JointPD((20.0, 10.0), (1.0, 0.5), reference=(0.3, -0.2))
    runs = [
        hc.simulate(hc.Scenario(arm=arm, controller=law, Ts=1e-3, dt=1e-3, t_max=0.2))
        for arm in arms
    ]
    for run in runs[1:]:  # sums of masses in another order: some rounding a step
        np.testing.assert_allclose(run.q, runs[0].q, atol=1e-12)


# ---- joints that follow --------------------------------------------------------------------------

FOLLOWED = """<mujoco><compiler angle="radian"/><worldbody>
<body><joint name="scapula" axis="0 1 0"/><inertial pos=".05 0 0" mass=".2" diaginertia="1 1 1"/>
<body pos=".1 0 0"><joint name="elevation" axis="0 1 0"/>
<inertial pos=".15 0 0" mass="1" diaginertia=".01 .01 .01"/><site name="ee" pos=".3 0 0"/></body>
</body></worldbody><equality>
<joint joint1="scapula" joint2="elevation" polycoef="0 .4 .1 0 0"/></equality></mujoco>"""


@pytest.mark.parametrize("q", [0.0, 0.6])
def test_a_joint_before_the_handle_follows_another(q):
    """By G of the constraint: scapula moves .4 + .2 q times as fast as elevation."""
    arm = arm_of(FOLLOWED, pose={"elevation": q})
    assert arm.names == ("elevation",)
    assert "constraints, taken as rigid, move scapula" in arm.notes
    M = own_inertia(
        FOLLOWED, ("scapula", "elevation"), {"scapula": 0.4 * q + 0.1 * q**2, "elevation": q}
    )
    G = np.array([0.4 + 0.2 * q, 1.0])
    np.testing.assert_allclose(arm.mass_matrix(), [[G @ M @ G]], rtol=1e-10)  # closed to 1e-10 rad


def test_a_leader_that_is_not_before_the_handle_stands_for_its_follower():
    """The handle is on a finger that follows the other."""
    text = model(limb(site="").replace("</body></body>", "</body></body>"), EQUAL.format(p=""))
    arm = arm_of(text, site="f2")
    assert arm.names == ("a", "b", "g1")
    M = own_inertia(text, ("a", "b", "g1", "g2"))
    G = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
    np.testing.assert_allclose(arm.mass_matrix(), G.T @ M @ G, rtol=1e-12)


def test_chains_of_followers_lead_to_one_joint():
    text = model(
        limb(hand="", site="") + '<body name="x"><joint name="c"/><geom size=".1"/></body>',
        '<joint joint1="b" joint2="a" polycoef="0 2 0 0 0"/>'
        '<joint joint1="a" joint2="c" polycoef="0 3 0 0 0"/>',
    )
    arm = arm_of(text, site="l2")
    assert arm.names == ("c",)
    M, G = own_inertia(text, "cab"), np.array([1.0, 3.0, 6.0])
    np.testing.assert_allclose(arm.mass_matrix(), [[G @ M @ G]], rtol=1e-12)


# ---- closed chains -------------------------------------------------------------------------------

BARS = """<mujoco><compiler angle="radian"/><worldbody>
<body name="u"><joint name="j1" axis="0 1 0"/>{i}<body name="v" pos=".3 0 0">
<joint name="j2" axis="0 1 0"/>{i}<site name="ee" pos=".2 0 0"/></body></body>
<body name="w" pos="0 0 -.1"><joint name="j3" axis="0 1 0"/>{i}<body name="x" pos=".3 0 0">
<joint name="j4" axis="0 1 0"/>{i}</body></body></worldbody><equality>
<connect body1="x" body2="v" anchor="0 0 .1"/></equality>{rest}</mujoco>"""
LINK = '<inertial pos=".1 0 0" mass="1" diaginertia=".01 .01 .01"/>'


@pytest.mark.parametrize(
    "motors", ["", '<actuator><motor joint="j1"/><motor joint="j2"/></actuator>']
)
def test_a_parallelogram_before_the_handle(motors):
    """Five bars with coincident axes: j3 turns as j1; without actuators the first joints drive."""
    text = BARS.format(i=LINK, rest=motors)
    arm = arm_of(text, site="ee", pose={"j1": 0.2, "j2": 0.9, "j3": 0.2, "j4": 0.9})
    assert arm.names == ("j1", "j2")
    h, base = 1e-6, dict(arm.pose)
    columns = []
    for j in range(2):
        ends = [
            arm_of(
                text,
                site="ee",
                pose={**base, **{n: arm.q[k] + s * h * (k == j) for k, n in enumerate(arm.names)}},
            ).pose
            for s in (1, -1)
        ]
        columns.append([(ends[0][n] - ends[1][n]) / (2 * h) for n in base])
    G, M = np.array(columns).T, own_inertia(text, list(base), base)
    np.testing.assert_allclose(arm.mass_matrix(), G.T @ M @ G, rtol=1e-6)  # differences of 1e-6


# ---- files without a handle ----------------------------------------------------------------------


def test_without_a_site_the_arm_ends_where_its_hand_branches():
    arm = arm_of(model(limb(site="")))
    assert arm.names == ("a", "b") and arm.site is None
    assert "locked: g1, g2" in arm.notes
    with pytest.raises(hc.ParameterError, match="such as l2"):
        arm.handle()


def test_several_arms_without_sites_are_named_by_their_ends():
    text = model(limb("left_", 0.3, site="") + limb("right_", -0.3, site=""))
    with pytest.raises(hc.ParameterError, match="such as left_l2, right_l2"):
        arm_of(text)


def test_a_torso_that_carries_two_arms_is_no_arm():
    body = '<body name="torso"><joint name="waist"/><geom size=".2"/>{}</body>'
    with pytest.raises(hc.ParameterError, match="such as l_l2, r_l2"):
        arm_of(model(body.format(limb("l_", site="", hand="") + limb("r_", site="", hand=""))))
    assert arm_of(model(body.format(limb("l_", site="", hand="")))).names == ("waist", "l_a", "l_b")
    sensor = '<body name="torso"><joint name="waist"/><geom size=".2"/><site name="imu"/>{}</body>'
    with pytest.raises(hc.ParameterError, match="such as l_l2, r_l2"):
        arm_of(model(sensor.format(limb("l_", site="", hand="") + limb("r_", site="", hand=""))))


def test_sites_of_fingers_are_no_handles_to_choose_from():
    """The joint before them is locked; an arm without a site is named by its last link."""
    hand = FINGERS.replace("<inertial", '<site name="{p}pad"/><inertial', 1)
    one, other = limb("l/", 0.3, hand), limb("r/", -0.3, site="")
    with pytest.raises(hc.ParameterError, match="such as l/ee, r/l2$"):
        arm_of(model(one + other))


def test_a_torso_before_an_arm_is_named():
    """It counts among the joints before the handle, and carries the other arm."""
    body = '<body name="torso"><joint name="waist"/><geom size=".2"/>{}</body>'
    text = model(body.format(limb("l_", site="", hand="") + limb("r_", site="", hand="")))
    arm = arm_of(text, site="r_l2")
    assert arm.names == ("waist", "r_a", "r_b")
    assert any("carry other limbs, too: waist;" in x for x in arm.notes)
    arm = arm_of(text, site="r_l2", joints=("r_a", "r_b"))
    np.testing.assert_allclose(arm.mass_matrix(), own_inertia(text, arm.names), rtol=1e-12)
    assert not any("carry other limbs" in x for x in arm_of(model(limb()), site="ee").notes)


def test_names_in_refusals_are_whole():
    """However many there are, the last that is shown is one of the file."""
    names = [f"a_rather_long_name_of_a_link_{i}" for i in range(30)]
    bodies = "".join(f'<body name="{x}"><joint/><geom size=".1"/></body>' for x in names)
    for wanted in ("qqq", None):
        with pytest.raises(hc.ParameterError) as error:
            arm_of(model(bodies), site=wanted)
        words = str(error.value).rpartition(" and ")[0].replace(",", "").split()
        assert words[-1] in names and " more" in str(error.value)
    with pytest.raises(hc.ParameterError) as error:
        arm_of(model(limb()), joints=[*names, "a", "a"])
    assert all(x.strip("[]',:") in names for x in str(error.value).split() if "rather" in x)
