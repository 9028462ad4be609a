"""Arms from files: their mechanics against other derivations, and what is refused."""

import dataclasses
import math
import pickle
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc

CARDS = Path(__file__).parents[2] / "mjcf" / "arms"
NAMES = ("planar_2r", "five_bar", "haptic_3", "leader_7")


def card(name, **kw):
    return hc.MjcfArm(CARDS / f"{name}.xml", **kw)


@given(q=st.tuples(*[st.floats(-2.5, 2.5)] * 2))
@settings(max_examples=30, deadline=None)
def test_the_planar_arm_is_its_formula(q):
    """M of two links from their kinetic energy, by hand; J from the positions."""
    arm, (q1, q2), l1, l2 = card("planar_2r"), q, 0.24, 0.35
    rho, rotor = 2700.0, 0.0008
    m1 = rho * math.pi * (0.02**2 - 0.018**2) * l1
    m2 = rho * math.pi * (0.0125**2 - 0.0105**2) * l2
    i1 = m1 * (3 * (0.02**2 + 0.018**2) + l1**2) / 12 + m1 * (l1 / 2) ** 2 + 1.0 * l1**2
    i2 = m2 * (3 * (0.0125**2 + 0.0105**2) + l2**2) / 12
    c, r = math.cos(q2), l2 / 2
    inner = i2 + m2 * r**2
    M = np.array(
        [
            [i1 + m2 * (l1**2 + 2 * l1 * r * c) + inner, inner + m2 * l1 * r * c],
            [inner + m2 * l1 * r * c, inner],
        ]
    )
    # the file has six digits of masses, five of inertias
    np.testing.assert_allclose(arm.mass_matrix(q), M + rotor * np.eye(2), rtol=3e-5)
    s1, s12 = math.sin(q1), math.sin(q1 + q2)
    c1, c12 = math.cos(q1), math.cos(q1 + q2)
    J = [[-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12], [0.0, 0.0]]
    np.testing.assert_allclose(arm.jacobian(q), J, atol=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_the_jacobian_is_that_of_the_positions(name):
    """Central differences of the handle's place, followers of a closed chain moved along."""
    arm, h = card(name), 1e-5
    for j in range(len(arm.names)):
        step = h * np.eye(len(arm.names))[j]
        slope = (arm.handle(arm.q + step) - arm.handle(arm.q - step)) / (2.0 * h)
        np.testing.assert_allclose(arm.jacobian()[:, j], slope, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_inertia_is_kinetic_energy(name):
    """Twice the energy that the engine finds, at rates that keep the chain closed."""
    arm, random = card(name), np.random.default_rng(1)
    model = mujoco.MjModel.from_xml_path(str(CARDS / f"{name}.xml"))
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    at = {model.joint(j).name: j for j in range(model.njnt)}
    data.qpos[:] = [arm.pose[x] for x in at]
    for _ in range(5):
        w, h = random.normal(size=len(arm.names)), 1e-6
        there = hc.MjcfArm(
            CARDS / f"{name}.xml", pose=dict(zip(arm.names, arm.q + h * w, strict=True))
        )
        data.qvel[:] = [(there.pose[x] - arm.pose[x]) / h for x in at]
        mujoco.mj_forward(model, data)
        assert w @ arm.mass_matrix() @ w == pytest.approx(2.0 * data.energy[1], rel=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_gravity_stiffness_is_the_curvature_of_the_energy(name):
    arm, h = card(name), 1e-3
    n, model = len(arm.names), mujoco.MjModel.from_xml_path(str(CARDS / f"{name}.xml"))
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY

    def energy(q):
        there = hc.MjcfArm(CARDS / f"{name}.xml", pose=dict(zip(arm.names, q, strict=True)))
        data = mujoco.MjData(model)
        data.qpos[:] = [there.pose[model.joint(j).name] for j in range(model.njnt)]
        mujoco.mj_forward(model, data)
        return data.energy[0]

    e = np.eye(n)
    found = [
        [
            sum(s * t * energy(arm.q + h * (s * e[i] + t * e[j])) for s in (1, -1) for t in (1, -1))
            / (4.0 * h * h)
            for j in range(n)
        ]
        for i in range(n)
    ]
    np.testing.assert_allclose(arm.gravity_stiffness(), found, atol=2e-5)


def test_the_five_bar_has_its_published_bars():
    """Elbow to handle is 75 mm on both sides, at any pose of the motors."""
    arm = card("five_bar")
    for q in ([0.9599, 2.1817], [0.6, 2.0], [1.3, 2.6]):
        for base, angle in zip((0.0, -0.025), q, strict=True):
            elbow = base + 0.063 * math.cos(angle), 0.063 * math.sin(angle)
            assert math.dist(elbow, arm.handle(q)[:2]) == pytest.approx(0.075, abs=1e-9)


def test_a_pose_that_does_not_close_the_chain_is_told():
    assert "close" not in " ".join(card("five_bar").notes)
    text = (CARDS / "five_bar.xml").read_text().replace("1.31643921903851 2.18", "1.0 2.18")
    notes = hc.MjcfArm(mujoco.MjSpec.from_string(text)).notes
    assert "does not close the chain: right_elbow was moved by 0.316" in " ".join(notes)


def test_connected_points_are_told():
    """Drawn at its zero position, with all bars along x, a chain of other bars is made."""
    assert "(0.075, 0, 0) of right_tip is (0.075, 0, 0) of left_tip [m]" in card("five_bar").notes
    drawn = (CARDS / "five_bar.xml").read_text()
    flat = re.sub(r' (ref|euler)="[^"]*"', "", drawn)
    notes = hc.MjcfArm(mujoco.MjSpec.from_string(flat)).notes
    assert "(0.075, 0, 0) of right_tip is (0.1, 0, 0) of left_tip [m]" in notes


def test_values_by_name_and_by_place():
    arm = card("leader_7", armature={"joint3": 0.2}, damping=[0.1] * 7, pose={"joint2": "30 deg"})
    assert arm.armature == (0.0081, 0.0081, 0.2, 0.16, 0.01, 0.01, 0.0049)
    assert arm.damping == (0.1,) * 7
    assert arm.pose["joint2"] == pytest.approx(math.pi / 6)
    plain = card("leader_7", pose=arm.pose)
    gap = arm.mass_matrix() - plain.mass_matrix()
    np.testing.assert_allclose(gap, np.diag([0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 0.0]), atol=1e-15)


def test_what_a_file_leaves_open_is_said():
    spec = mujoco.MjSpec.from_file(str(CARDS / "leader_7.xml"))
    for joint in spec.joints:
        joint.armature = 0.0
    notes = " ".join(hc.MjcfArm(spec).notes)
    assert "joint1, joint2" in notes and "no rotor inertia" in notes
    assert "key frame home" in notes
    notes = " ".join(card("five_bar").notes)
    assert (
        "constraints" in notes
        and "right_elbow, left_elbow" in notes
        and "2 actuators of the file give no torque" in notes
    )


BODY = (
    '<body name="b"><joint name="j"/><inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/>{}</body>'
)
SITE = '<site name="handle"/>'


def xml(body, rest=""):
    return f"<mujoco><worldbody>{body}</worldbody>{rest}</mujoco>"


REFUSED = {
    "no such file": ("nothing.xml", {}, "there is none"),
    "not a model": ("<a/>", {}, r"XML of another kind \(<a>\)"),
    "not MuJoCo's": (xml("<bdy/>"), {}, "MuJoCo loads"),
    "no mass": (xml('<body><joint/><geom size="1" mass="0"/></body>'), {}, "have an inertia"),
    "a free joint": (
        xml(BODY.format(SITE).replace('<joint name="j"/>', "<freejoint/>")),
        {},
        "no joint moves the handle",
    ),
    "a ball joint": (
        xml(BODY.format(SITE).replace('name="j"', 'name="j" type="ball"')),
        {},
        "is ball",
    ),
    "friction of a tendon": (
        xml(
            BODY.format(SITE),
            '<tendon><fixed name="t" frictionloss="1"><joint joint="j" coef="1"/></fixed></tendon>',
        ),
        {},
        "frictionloss = 't': must be 0",
    ),
    "a damper that gives energy": (
        xml(BODY.format(SITE).replace("<joint", '<joint damping="1 -3 1"')),
        {},
        "must take energy at all rates",
    ),
    "no such site": (xml(BODY.format(SITE)), {"site": "handel"}, "did you mean 'handle'"),
    "no such joint": (xml(BODY.format(SITE)), {"joints": ["k"]}, "must be a joint"),
    "a joint twice": (xml(BODY.format(SITE)), {"joints": ["j", "j"]}, "each joint once"),
    "wrong name of a pose": (xml(BODY.format(SITE)), {"pose": {"jj": 1.0}}, "did you mean 'j'"),
    "too many positions": (xml(BODY.format(SITE)), {"pose": [0.0, 1.0]}, "for each joint"),
    "a pose that is NaN": (xml(BODY.format(SITE)), {"pose": [math.nan]}, "finite"),
    "negative armature": (xml(BODY.format(SITE)), {"armature": [-1.0]}, ">= 0"),
    **{
        f"{name} of the file below 0": (
            xml(BODY.format(SITE).replace("<joint", f'<joint {name}="-1"')),
            {},
            rf"\[j\] = -1.0: must be >= 0 in the file \({name}\)",
        )
        for name in ("armature", "damping", "frictionloss")
    },
    "torque to one side": (
        xml(BODY.format(SITE).replace("<joint", '<joint actuatorfrcrange="0 5"')),
        {},
        r"torque_limit\[j\] = 0.0: must be > 0; the range of a file",
    ),
    "a unit of another kind": (xml(BODY.format(SITE)), {"damping": ["1 m"]}, "m"),
    "no joint": (
        xml('<body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>' + SITE + "</body>"),
        {},
        "joint",
    ),
    "gravity": (xml(BODY.format(SITE)), {"gravity": "off"}, "compensated, acts"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line(case, tmp_path):
    text, given, told = REFUSED[case]
    file = tmp_path / "arm.xml"
    if text.startswith("<"):
        file.write_text(text)
    with pytest.raises(hc.ParameterError, match=told) as error:
        hc.MjcfArm(file if text.startswith("<") else tmp_path / text, **given)
    assert "\n" not in str(error.value)


def test_a_torque_limit_takes_the_place_of_the_file_s(tmp_path):
    file = tmp_path / "arm.xml"
    file.write_text(xml(BODY.format(SITE).replace("<joint", '<joint actuatorfrcrange="-3 5"')))
    assert hc.MjcfArm(file).torque_limit == (3.0,)
    file.write_text(xml(BODY.format(SITE).replace("<joint", '<joint actuatorfrcrange="1 5"')))
    assert hc.MjcfArm(file, torque_limit=[2.0]).torque_limit == (2.0,)


def test_what_is_no_file_is_told_what_it_is(tmp_path):
    with pytest.raises(hc.ParameterError, match="this is a folder"):
        hc.MjcfArm(tmp_path)
    with pytest.raises(hc.ParameterError, match="text: give mujoco.MjSpec.from_string") as error:
        hc.MjcfArm(xml(BODY.format(SITE)) + 50 * "<!-- -->\n")
    assert "\n" not in str(error.value) and len(str(error.value)) < 400
    arm = hc.MjcfArm(mujoco.MjSpec.from_string(xml(BODY.format(""))))
    with pytest.raises(hc.ParameterError, match=r"1 number, for the joint \(j\)"):
        hc.theory.joint_limits(arm, hc.JointPD([1.0, 2.0], [0.0, 0.0]), 1e-3)


def test_a_spec_may_be_changed_by_its_owner():
    """Copies, stored arms and pairs of drives read the spec again."""
    spec = mujoco.MjSpec.from_string(xml(BODY.format(SITE)))
    arm = hc.MjcfArm(spec, armature=[0.1])
    before = arm.mass_matrix()
    spec.bodies[-1].mass = 30.0
    assert arm.mass_matrix() == before
    assert dataclasses.replace(arm).mass_matrix() == before
    assert pickle.loads(pickle.dumps(arm)).mass_matrix() == before


def test_an_open_chain_held_in_itself_is_refused(tmp_path):
    """Both joints of a pair that a constraint ties cannot be driven one by one."""
    file = tmp_path / "arm.xml"
    inner = BODY.format(BODY.format(SITE).replace('"b"', '"c"').replace('"j"', '"k"'))
    file.write_text(xml(inner, '<equality><joint joint1="j" joint2="k"/></equality>'))
    with pytest.raises(hc.ParameterError, match="constraints of the file tie them"):
        hc.MjcfArm(file, joints=["j", "k"])
    assert hc.MjcfArm(file, joints=["j"]).names == ("j",)


def test_without_handle_the_joints_are_judged_alone(tmp_path):
    file = tmp_path / "arm.xml"
    file.write_text(xml(BODY.format("")))
    arm = hc.MjcfArm(file, armature=[0.1])
    assert hc.theory.joint_limits(arm, hc.JointPD([1.0], [0.1]), 1e-3).stable
    with pytest.raises(hc.ParameterError, match="site or body at the handle"):
        arm.jacobian()


def test_two_sites_on_one_link_leave_the_handle_open(tmp_path):
    """The joints are the same; what needs a handle names both."""
    file = tmp_path / "arm.xml"
    file.write_text(xml(BODY.format(SITE + '<site name="b"/>')))
    arm = hc.MjcfArm(file, armature=[0.1])
    assert arm.names == ("j",) and arm.site is None
    with pytest.raises(hc.ParameterError, match="such as handle, b"):
        arm.handle()
    np.testing.assert_array_equal(hc.MjcfArm(file, site="b").handle(), [0.0, 0.0, 0.0])


def test_arms_of_the_package_by_name():
    assert hc.MjcfArm("leader_7").names == card("leader_7").names
    with pytest.raises(hc.ParameterError, match="did you mean 'planar_2r'"):
        hc.MjcfArm("planar2r")


URDF = """<robot name="two"><link name="base"/>
<link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool"/>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="5" velocity="1"/></joint>
<joint name="fixed" type="fixed"><parent link="a"/><child link="tool"/>
<origin xyz="0.2 0 0"/></joint></robot>"""


def test_a_urdf_with_its_tool(tmp_path):
    file = tmp_path / "two.urdf"
    file.write_text(URDF)
    arm = hc.MjcfArm(file, site="tool")
    assert arm.names == ("j",) and arm.ranges.tolist() == [[-1.0, 1.0]]
    assert arm.mass_matrix() == pytest.approx(0.01 + 1.0 * 0.1**2)
    np.testing.assert_allclose(arm.handle([0.5]), [0.2 * math.cos(0.5), 0.2 * math.sin(0.5), 0.0])


@pytest.mark.parametrize("name", ["planar_2r", "five_bar", "haptic_3", "leader_7"])
def test_arms_of_the_same_numbers_are_equal(name):
    arm = hc.MjcfArm(name)
    twin = pickle.loads(pickle.dumps(arm))
    assert twin == arm == hc.MjcfArm(name) and hash(twin) == hash(arm)
    heavier = hc.MjcfArm(name, armature=[x + 1e-12 for x in arm.armature])
    others = hc.MjcfArm(name, gravity="acts"), heavier, hc.MjcfArm("planar_2r", damping=(9.0, 9.0))
    assert all(arm != other for other in others)
