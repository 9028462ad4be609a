"""Files as projects keep them: meshes that are not there, parts elsewhere, other formats."""

import os

import mujoco
import numpy as np
import pytest

import hapticclay as hc

INERTIAL = (
    '<inertial><origin xyz="{x} 0 0"/><mass value="{m}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" '
    'ixy="0" ixz="0" iyz="0"/></inertial>'
)
HINGE = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{x} 0 0"/><axis xyz="0 1 0"/>{more}</joint>'
)
MESH = '<{0}><geometry><mesh filename="{1}"/></geometry></{0}>'
PLAIN = {"kind": "revolute", "more": '<limit lower="-2" upper="2" effort="40" velocity="1"/>'}


def link(name, inertia=(0.2, 1.0, 0.01), more=""):
    of = "" if inertia is None else INERTIAL.format(x=inertia[0], m=inertia[1], i=inertia[2])
    return f'<link name="{name}">{of}{more}</link>'


def joint(name, parent, child, x=0.4, **kw):
    return HINGE.format(name=name, parent=parent, child=child, x=x, **{**PLAIN, **kw})


def robot(*parts, head=""):
    return (
        f'<?xml version="1.0"?>{head}<robot name="r">{link("base", None)}{"".join(parts)}</robot>'
    )


TWO = (
    link("la"),
    link("lb", (0.1, 0.5, 0.003)),
    joint("j1", "base", "la", 0.0),
    joint("j2", "la", "lb"),
)
M_OF_TWO = [[0.01 + 0.04 + 0.003 + 0.5 * 0.25, 0.003 + 0.05 * 0.5], [0.003 + 0.05 * 0.5, 0.008]]


@pytest.fixture
def saved(tmp_path):
    def save(text, name="robot.urdf", folder="."):
        file = tmp_path / folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        return file

    return save


# ---- URDF ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["package://r/m/{}.stl", "m/{}.dae", "file:///none/{}.obj", "a\\{}.STL"]
)
def test_meshes_are_left_out_where_links_state_inertia(saved, name):
    """By hand: two links, m r^2 + I about their joints."""
    looks = [MESH.format(kind, name.format(kind)) for kind in ("visual", "collision")]
    parts = link("la", more="".join(looks)), *TWO[1:]
    arm = hc.MjcfArm(saved(robot(*parts)), site="lb")
    assert arm.names == ("j1", "j2") and arm.torque_limit == (40.0, 40.0)
    np.testing.assert_allclose(arm.mass_matrix(), M_OF_TWO, rtol=1e-14)
    assert any(x.startswith("not there, and take no part: ") for x in arm.notes)
    empty = MESH.format("visual", ""), "<visual/>", "<collision><geometry/></collision>"
    for more in ("", *empty):
        plain = hc.MjcfArm(saved(robot(link("la", more=more), *TWO[1:])), site="lb")
        assert not any("not there" in x for x in plain.notes)


def test_continuous_fixed_and_mimic_joints_limits_and_dynamics(saved):
    friction = '<dynamics damping="0.3" friction="0.1"/>'
    text = robot(
        link("la"), link("lb", (0.1, 0.5, 0.003)), link("tool", None), link("f1", (0, 0.1, 1e-5)),
        link("f2", (0, 0.1, 1e-5)),
        joint("j1", "base", "la", 0.0, kind="continuous", more=friction),
        joint("j2", "la", "lb"),
        joint("jt", "lb", "tool", 0.3, kind="fixed", more=""),
        joint("g1", "tool", "f1", 0.0, kind="prismatic"),
        joint("g2", "tool", "f2", 0.0, kind="prismatic", more='<mimic joint="g1"/>'),
    )  # fmt: skip
    arm = hc.MjcfArm(saved(text), site="tool")
    assert arm.names == ("j1", "j2") and arm.damping == (0.3, 0.0) and arm.friction == (0.1, 0.0)
    assert arm.ranges.tolist() == [[-np.inf, np.inf], [-2.0, 2.0]]
    assert "locked: g1, g2" in arm.notes
    np.testing.assert_allclose(arm.handle(), [0.7, 0.0, 0.0], atol=1e-15)
    assert hc.MjcfArm(saved(text)).names == ("j1", "j2")


def test_a_joint_that_mimics_one_before_it(saved):
    """G = (1, -1): by hand M11 - 2 M12 + M22."""
    mimic = PLAIN["more"] + '<mimic joint="j1" multiplier="-1"/>'
    arm = hc.MjcfArm(saved(robot(*TWO[:3], joint("j2", "la", "lb", more=mimic))), site="lb")
    (a, b), (_, c) = M_OF_TWO
    assert arm.names == ("j1",)
    np.testing.assert_allclose(arm.mass_matrix(), [[a - 2 * b + c]], rtol=1e-12)


def test_a_link_whose_inertia_is_in_a_missing_mesh_is_named(saved):
    parts = link("la", None, MESH.format("collision", "package://r/la.stl")), *TWO[1:]
    with pytest.raises(hc.ParameterError, match=r"la\.stl.*inertia of la comes from it"):
        hc.MjcfArm(saved(robot(*parts)), site="lb")
    hanging = link("lc", None, MESH.format("collision", "lc.dae")), joint("j3", "base", "lc")
    arm = hc.MjcfArm(saved(robot(*TWO, *hanging)), site="lb")  # it does not move lb
    np.testing.assert_allclose(arm.mass_matrix(), M_OF_TWO, rtol=1e-14)


def test_links_that_turn_nothing_leave_no_log(saved, capfd, tmp_path, monkeypatch):
    """Eyes of humanoids: MuJoCo warns of their inertia, in a file where one stands."""
    monkeypatch.chdir(tmp_path)
    eye = link("eye", (0.0, 1e-6, 0.0)), joint("j3", "lb", "eye")
    arm = hc.MjcfArm(saved(robot(*TWO, *eye)), site="lb")
    # a milligram at 0.4 m behind lb, of which M has 0.05 and more
    np.testing.assert_allclose(arm.linear().inertia, M_OF_TWO, rtol=1e-4)
    assert not os.path.exists("MUJOCO_LOG.TXT") and not "".join(capfd.readouterr())


@pytest.mark.parametrize("kind", ["fixed", "prismatic"])
def test_a_tool_whose_mesh_is_not_there_is_counted_as_none(saved, kind):
    """Texts of robots come without meshes; fingers and mounts often have no inertia in them."""
    tool = link("tool", None, MESH.format("collision", "package://r/tool.stl"))
    arm = hc.MjcfArm(saved(robot(*TWO, tool, joint("j3", "lb", "tool", kind=kind))), site="lb")
    np.testing.assert_allclose(arm.mass_matrix(), M_OF_TWO, rtol=1e-12)  # 2e-15 kg for MuJoCo
    assert arm.notes[0].startswith("no inertia in the file") and arm.notes[0].endswith(": tool")
    assert not any("computed from geometry" in x for x in arm.notes)
    wrist = TWO[0], link("lb", None), TWO[2], TWO[3], tool, joint("j3", "lb", "tool", kind=kind)
    with pytest.raises(hc.ParameterError, match=r"tool\.stl|j2.*must have an inertia"):
        hc.MjcfArm(saved(robot(*wrist)), site="lb")


@pytest.mark.parametrize(
    "shape",
    ['<sphere radius="0"/>', '<box size="0.1 0 0.1"/>', '<cylinder radius="0.1" length="0"/>'],
)
def test_geometry_without_volume_gives_no_inertia(saved, shape):
    """Frames that drawings mark with points."""
    look = f"<collision><geometry>{shape}</geometry></collision>"
    tip = link("tip", None, look), joint("j3", "lb", "tip", 0.0, kind="fixed")
    arm = hc.MjcfArm(saved(robot(*TWO, *tip)), site="tip")
    np.testing.assert_allclose(arm.mass_matrix(), M_OF_TWO, rtol=1e-14)


def test_a_mesh_without_volume_is_named_with_its_link(saved):
    saved("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4", "flat.obj")
    part = link("la", None, MESH.format("collision", "flat.obj"))
    with pytest.raises(hc.ParameterError, match=r"flat\.obj.*<inertial> for la"):
        hc.MjcfArm(saved(robot(part, joint("j1", "base", "la", 0.0))))


def test_a_joint_that_turns_nothing_is_told_what_to_state(saved):
    parts = (*TWO, link("tip", None), joint("j3", "lb", "tip"))
    with pytest.raises(hc.ParameterError, match=r"j3.*<inertial>.*armature"):
        hc.MjcfArm(saved(robot(*parts)), site="tip")
    arm = hc.MjcfArm(saved(robot(*parts)), site="tip", armature={"j3": 0.01})
    assert arm.armature == (0.0, 0.0, 0.01)


def cube():
    """A cube of 0.2 m, as an OBJ file."""
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    sides = [(0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6), (0, 1, 3, 2), (4, 6, 7, 5)]
    lines = [f"v {0.2 * x - 0.1} {0.2 * y - 0.1} {0.2 * z - 0.1}" for x, y, z in corners]
    lines += [f"f {a + 1} {b + 1} {c + 1}\nf {a + 1} {c + 1} {d + 1}" for a, b, c, d in sides]
    return "\n".join(lines)


@pytest.mark.parametrize("key", ["cube.obj", "looks/cube.obj"])
def test_meshes_in_memory(key):
    """A spec may hold its files; 1e-6: MuJoCo keeps vertices in single precision."""
    text = (
        '<mujoco><compiler meshdir="looks"/><asset><mesh file="cube.obj"/></asset><worldbody><body>'
        '<joint axis="0 1 0"/><geom type="mesh" mesh="cube"/></body></worldbody></mujoco>'
    )
    spec = mujoco.MjSpec.from_string(text, assets={key: cube().encode()})
    np.testing.assert_allclose(hc.MjcfArm(spec).mass_matrix(), [[8.0 * 0.04 / 6.0]], rtol=1e-6)


@pytest.mark.parametrize("folder", ["r/urdf", "other/urdf"])
def test_a_mesh_that_gives_inertia_is_found_in_its_package(saved, folder):
    """A cube of 0.2 m at 1000 kg/m^3: 8 kg, m a^2/6."""
    root = folder.split("/")[0]
    saved(cube(), "cube.obj", f"{root}/meshes")
    look = MESH.format("collision", "package://r/meshes/cube.obj")
    file = saved(robot(link("la", None, look), joint("j1", "base", "la", 0.0)), folder=folder)
    arm = hc.MjcfArm(file, site="la")
    # 1e-6: MuJoCo keeps vertices in single precision
    np.testing.assert_allclose(arm.mass_matrix(), [[8.0 * 0.04 / 6.0]], rtol=1e-6)
    assert any(x.startswith("no inertia in the file, computed from geometry") for x in arm.notes)


def test_rotors_of_transmissions(saved):
    rotor = (
        '<transmission name="t"><joint name="j1"/><actuator name="m"><drake:gear_ratio value="50"/>'
        '<drake:rotor_inertia value="2e-5"/></actuator></transmission>'
    )
    assert hc.MjcfArm(saved(robot(*TWO, rotor)), site="lb").armature == (0.05, 0.0)
    plain = rotor.replace("drake:gear_ratio", "mechanicalReduction").replace("drake:rotor", "mass")
    notes = hc.MjcfArm(saved(robot(*TWO, plain)), site="lb").notes
    assert any(x.startswith("reductions of transmissions: j1 50") for x in notes)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_joint_that_nothing_turns_is_held(saved, kind):
    parts = link("car", (0, 9, 1)), joint("world", "base", "car", 1.0, kind=kind, more="")
    arms = TWO[0], TWO[1], joint("j1", "car", "la", 0.0), TWO[3]
    arm = hc.MjcfArm(saved(robot(*parts, *arms)), site="lb")
    assert arm.names == ("j1", "j2") and f"held where it is: world ({kind})" in arm.notes
    np.testing.assert_allclose(arm.handle(), [1.4, 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_inertia_of_no_body_is_taken_as_the_file_has_it(saved, turned):
    """By rotating the tensor: MuJoCo refuses it, though no dynamics needs A + B >= C."""
    odd = link("la").replace('ixx="0.01"', 'ixx="0.07"').replace('ixz="0"', 'ixz="0.02"')
    odd = odd.replace('xyz="0.2 0 0"/>', f'xyz="0.2 0 0" rpy="0 0 {turned}"/>')
    arm = hc.MjcfArm(saved(robot(odd, *TWO[1:])), site="lb")
    assert any("taken as the file has it: la" in x for x in arm.notes)
    c, s = np.cos(turned), np.sin(turned)
    own = np.array([0.0, 1.0, 0.0]) @ [[c, -s, 0], [s, c, 0], [0, 0, 1]]  # the axis in its frame
    about = own @ [[0.07, 0, 0.02], [0, 0.01, 0], [0.02, 0, 0.01]] @ own
    gap = arm.mass_matrix() - M_OF_TWO
    np.testing.assert_allclose(gap, [[about - 0.01, 0.0], [0.0, 0.0]], atol=1e-15)


@pytest.mark.parametrize("moment", ["0", "-1e-13"])
def test_a_mass_in_a_point(saved, moment):
    arm = hc.MjcfArm(saved(robot(link("la").replace('"0.01"', f'"{moment}"'), *TWO[1:])), site="lb")
    gap = arm.mass_matrix() - M_OF_TWO
    np.testing.assert_allclose(gap, [[-0.01, 0.0], [0.0, 0.0]], atol=2e-13)
    assert not any("inertia of no body" in x for x in arm.notes)
    tip = link("tip", (0.0, 0.0, 0.0)), joint("jt", "lb", "tip", kind="fixed", more="")
    arm = hc.MjcfArm(saved(robot(*TWO, *tip)), site="tip")
    np.testing.assert_allclose(arm.mass_matrix(), M_OF_TWO, atol=1e-13)


def test_links_that_only_joints_name(saved):
    """An undeclared world is the world; a tool that is not there is a frame."""
    world = joint("w", "world", "base", 0.0, kind="fixed", more="")
    tool = joint("t", "lb", "tool", 0.3, kind="fixed", more="")
    arm = hc.MjcfArm(saved(robot(*TWO, world, tool)), site="tool")
    np.testing.assert_allclose(arm.handle(), [0.7, 0.0, 0.0], atol=1e-15)
    assert any(x.endswith("taken as empty: tool") for x in arm.notes)


def test_links_without_mass_between_joints(saved):
    """Two joints with one axis at one place, as of a ball joint that a file makes of three."""
    parts = link("la", None), link("lb", (0.1, 0.5, 0.003)), joint("j1", "base", "la", 0.0)
    turned = joint("j2", "la", "lb", 0.0).replace('axis xyz="0 1 0"', 'axis xyz="0 0 1"')
    arm = hc.MjcfArm(saved(robot(*parts, turned)), site="lb")
    np.testing.assert_allclose(arm.mass_matrix(), 0.008 * np.eye(2), atol=1e-13)
    with pytest.raises(hc.ParameterError, match=r"joint = 'j2': must have an inertia"):
        hc.MjcfArm(saved(robot(*TWO[:1], link("lb", None), *TWO[2:])), site="lb")


# ---- MJCF ----------------------------------------------------------------------------------------

ASSETS = """<compiler meshdir="assets" texturedir="assets"/><asset>
<texture name="skin" type="2d" file="skin.png"/><material name="skin" texture="skin"/>
<hfield name="floor" file="floor.png" size="1 1 1 1"/>
<mesh name="link" file="link.stl"/></asset>"""
BODY = """<worldbody><geom type="hfield" hfield="floor"/><body name="la">
<joint name="j1" axis="0 1 0"/>{}<geom name="look" type="mesh" mesh="link" material="skin"/>
<site name="ee" material="skin"/>
</body></worldbody>"""
STATED = '<inertial pos=".2 0 0" mass="1" diaginertia=".01 .01 .01"/>'


def test_an_mjcf_without_its_meshes_and_pictures(saved):
    rest = '<contact><pair geom1="look" geom2="look"/></contact>'
    arm = hc.MjcfArm(saved(f"<mujoco>{ASSETS}{BODY.format(STATED)}{rest}</mujoco>", "a.xml"))
    np.testing.assert_allclose(arm.mass_matrix(), [[0.05]], rtol=1e-14)
    (note,) = [x for x in arm.notes if x.startswith("not there")]
    assert "link.stl" in note and "skin.png" in note
    with pytest.raises(hc.ParameterError, match=r"link\.stl.*inertia of la comes from it"):
        hc.MjcfArm(saved(f"<mujoco>{ASSETS}{BODY.format('')}</mujoco>", "b.xml"))
    nameless = BODY.format("").replace('body name="la"', "body")
    with pytest.raises(hc.ParameterError, match=r"link\.stl.*inertia of unnamed body comes from"):
        hc.MjcfArm(saved(f"<mujoco>{ASSETS}{nameless}</mujoco>", "c.xml"))


@pytest.mark.parametrize("name", ["arm.mjcf", "arm.xml", "arm"])
def test_parts_from_other_folders(saved, name):
    body = f'<body name="la"><joint name="j1" axis="0 1 0"/>{STATED}<site name="ee"/></body>'
    saved(f"<mujocoinclude>{body}</mujocoinclude>", "links.xml", "shared/parts")
    text = '<mujoco><worldbody><include file="shared/parts/links.xml"/></worldbody></mujoco>'
    arm = hc.MjcfArm(saved(text, name, "robots/one/"))
    np.testing.assert_allclose(arm.mass_matrix(), [[0.05]], rtol=1e-14)
    assert any("was found at" in x for x in arm.notes)
    with pytest.raises(hc.ParameterError, match=r"includes links\.xml, which is not there"):
        hc.MjcfArm(saved(text.replace("shared/parts/", ""), name, "robots/two"))


def test_warnings_of_mujoco_are_notes(saved, recwarn, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    limits = '<limit lower="0" upper="0" effort="0" velocity="0"/>'
    arm = hc.MjcfArm(saved(robot(TWO[0], joint("j1", "base", "la", 0.0, more=limits))))
    assert arm.ranges.tolist() == [[-np.inf, np.inf]]
    assert any("equal lower and upper limits" in x for x in arm.notes)
    part = f'<body name="la"><joint name="j1"/>{STATED}</body>'
    saved(
        f'<mujoco model="p"><option timestep="1e-3"/><worldbody>{part}</worldbody></mujoco>',
        "p.xml",
    )
    whole = (
        '<mujoco><asset><model name="p" file="p.xml"/></asset><worldbody>'
        '<attach model="p" prefix=""/></worldbody></mujoco>'
    )
    assert hc.MjcfArm(saved(whole, "whole.xml")).names == ("j1",)
    ball = '<worldbody><body><freejoint/><geom size=".1"/></body></worldbody>'
    assert hc.MjcfArm(saved(whole.replace("</mujoco>", f"{ball}</mujoco>"), "ball.xml")).names
    assert not recwarn.list and not os.path.exists("MUJOCO_LOG.TXT")


# ---- what is no model ----------------------------------------------------------------------------

DEEP = "<robot>" + "<link>" * 100_000
REFUSED = {
    "x.urdf.xacro": ("<robot/>", r"run `xacro x\.urdf\.xacro > x\.urdf`"),
    "arm.xacro": ("<robot/>", r"run `xacro arm\.xacro > arm\.urdf`"),
    "left.urdf": (
        '<robot><xacro:include filename="a"/><joint/></robot>',
        r"xacro left\.urdf > left_",
    ),
    "value.urdf": (robot(*TWO).replace('"40"', '"${e}"'), r"not expanded \(\$\{e\}\)"),
    "no_joints.urdf": (robot(), "must have joints"),
    "still.urdf": (
        robot(link("la"), joint("j", "base", "la", kind="fixed", more="")),
        "must be some that move: the file has none",
    ),
    "part.xml": ("<mujocoinclude/>", "give the file that includes it"),
    "model.sdf": ('<sdf version="1.6"/>', "is SDF"),
    "scene.usda": ("#usda 1.0", "is USD"),
    "page.xml": ("<html/>", "XML of another kind"),
    "empty.xml": ("", "XML"),
    "half.urdf": ('<robot name="r"><link', "XML"),
    "deep.urdf": (DEEP, "XML|deep"),
    "bomb.urdf": (
        robot(*TWO, head='<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>'),
        "must declare no XML entities",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_model_is_refused_in_one_line(saved, name):
    text, words = REFUSED[name]
    with pytest.raises(hc.ParameterError, match=words) as error:
        hc.MjcfArm(saved(text, name))
    assert "\n" not in str(error.value)
    assert name in str(error.value) or error.value.field == "joints"


@pytest.mark.parametrize("folder", [".", "parts"])
def test_the_model_of_a_part_is_named(saved, folder):
    body = f'<body><joint name="j1"/>{STATED}</body>'
    part = saved(f"<mujocoinclude>{body}</mujocoinclude>", "arm (1).xml", folder)
    saved(f'<half><include file="{part.name}"/>', "broken.xml")
    saved("<mujoco><worldbody/></mujoco>", "other.xml")
    include = f'<include file="{folder}/arm (1).xml"/>'.replace("./", "")
    whole = saved(f"<mujoco><worldbody>{include}</worldbody></mujoco>", "scene.xml")
    with pytest.raises(hc.ParameterError, match=r"that includes it, such as .*scene\.xml"):
        hc.MjcfArm(part)
    assert hc.MjcfArm(whole).names == ("j1",)


def test_a_long_path_is_shown_to_its_end(saved):
    file = saved("<sdf/>", "the_arm_of_mine.xml", "a_rather_long_folder/" * 6)
    with pytest.raises(hc.ParameterError, match=r"/the_arm_of_mine\.xml': is SDF"):
        hc.MjcfArm(file)


def test_an_entity_of_the_system_is_not_read(saved):
    secret = saved("<link name='secret'/>", "secret.xml")
    text = robot(*TWO, "&x;", head=f'<!DOCTYPE r [<!ENTITY x SYSTEM "{secret.as_uri()}">]>')
    with pytest.raises(hc.ParameterError, match="no XML entities"):
        hc.MjcfArm(saved(text))


@pytest.mark.parametrize("n", [1, 2])
def test_a_key_frame_is_a_pose(saved, n):
    """By name, or number; text that is a number is the position of an arm with one joint."""
    body = f'<body>{{}}{STATED}<site name="ee" pos="1 0 0"/></body>'
    joints = "".join(f'<joint name="j{i}" axis="0 {i} 1"/>' for i in range(n))
    values = ("home", 1.0), ("ready", 0.5), ("", 0.25)
    keys = "".join(f'<key name="{name}" qpos="{" ".join(n * [str(q)])}"/>' for name, q in values)
    text = f"<worldbody>{body.format(joints)}</worldbody><keyframe>{keys}</keyframe>"
    file = saved(f'<mujoco><compiler angle="radian"/>{text}</mujoco>', "keys.xml")
    for pose, q in ((None, 1.0), ("home", 1.0), ("ready", 0.5), (2, 0.25), (1, 0.5)):
        assert hc.MjcfArm(file, pose=pose).q.tolist() == n * [q]
    number = [2.0] if n == 1 else [0.25, 0.25]
    assert hc.MjcfArm(file, pose="2").q.tolist() == number
    assert "pose: key frame ready of the file" in hc.MjcfArm(file, pose="ready").notes
    with pytest.raises(hc.ParameterError, match="did you mean 'ready'"):
        hc.MjcfArm(file, pose="redy")
    with pytest.raises(hc.ParameterError, match="no key frames"):
        hc.MjcfArm(saved(robot(*TWO)), site="lb", pose="home")
    arm = hc.MjcfArm(file, armature=0.1, pose="0.2 rad" if n == 1 else None)
    assert arm.armature == n * (0.1,) and (n == 2 or arm.q.tolist() == [0.2])
