"""Files that would end the interpreter, take all memory, or give numbers that are none."""

import pytest

import hapticclay as hc

BODY = '<body><joint name="j" axis="0 0 1"/><geom size=".1"/><site name="h" pos=".1 0 0"/></body>'


def model(body=BODY, head="", more="", tail=""):
    return f"<mujoco>{head}<worldbody>{body}{more}</worldbody>{tail}</mujoco>"


def joint(attribute):
    return model(BODY.replace("<joint", f"<joint {attribute}"))


ODD = {  # text, words
    "attaches itself": (
        model(
            head='<asset><model name="x" file="arm.xml"/></asset>',
            more='<attach model="x" prefix="p"/>',
        ),
        "must not contain itself .<model file='arm.xml'>",
    ),
    "includes itself": (model(head='<include file="arm.xml"/>'), "must not contain itself"),
    "a hundred million copies": (
        model(more='<replicate count="100000000"><geom size=".1"/></replicate>'),
        "at most 100000 elements in <replicate>, not 2e.08",
    ),
    "copies of copies": (
        model(
            more='<replicate count="3000"><replicate count="3000"><geom size=".1"/></replicate>'
            "</replicate>"
        ),
        "at most 100000 elements in <replicate>",
    ),
    "a vast height field": (
        model(head='<asset><hfield name="a" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>'),
        "at most 10000000 heights in <hfield 'a'>, not 1e.10",
    ),
    "a vast texture": (
        model(
            head='<asset><texture name="a" type="2d" builtin="checker" width="30000" '
            'height="30000"/></asset>'
        ),
        "at most 100000000 pixels in <texture 'a'>",
    ),
    "a vast grid": (
        model(more='<body name="b"><flexcomp name="f" count="999 999 999" dim="3"/></body>'),
        "at most 100000 vertices in <flexcomp 'f'>",
    ),
    "a vast memory": (model(head='<size memory="10E"/>'), "MuJoCo loads .*allocate memory"),
    "a vast mass": (
        model(BODY.replace('size=".1"', 'size=".1" mass="1e308"')), "body_mass must be at mo"
    ),
    "a vast damper": (joint('damping="1e308"'), "dof_damping must be at most"),
    "a vast spring": (joint('stiffness="1 1e300"'), "jnt_stiffnesspoly must be at most"),
    "a far joint": (joint('pos="1e300 0 0"'), "jnt_pos must be at most"),
    "gravity that is no number": (model(head='<option gravity="nan 0 0"/>'), "gravity is not fin"),
    "a pose that is no number": (
        model(tail='<keyframe><key name="home" qpos="nan"/></keyframe>'), "key_qpos is not finite"
    ),
    "a plugin that is not there": (
        model(head='<extension><plugin plugin="mujoco.no"/></extension>'), "mujoco.no not found"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_an_odd_file_is_refused_in_a_line(name, tmp_path):
    text, words = ODD[name]
    (tmp_path / "arm.xml").write_text(text)
    with pytest.raises(hc.ParameterError, match=words) as error:
        hc.MjcfArm(tmp_path / "arm.xml")
    assert "\n" not in str(error.value) and len(str(error.value)) < 600


def test_parts_that_two_files_share_are_no_circle(tmp_path):
    (tmp_path / "part.xml").write_text('<mujocoinclude><geom size=".01"/></mujocoinclude>')
    twice = '<body name="{}"><include file="part.xml"/></body>'
    text = model(more=twice.format("a"))
    (tmp_path / "arm.xml").write_text(text)
    assert hc.MjcfArm(tmp_path / "arm.xml").names == ("j",)
