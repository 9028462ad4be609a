"""The picture shows the arm of its scenario."""

import dataclasses

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.formulas.arm import inverse_kinematics
from hapticclay.views import stage
from tests.oracles.links import Links

ARMS = {
    "paper": (hc.Arm(), (0.25, 0.24)),
    "longer": (hc.Arm(0.3, 0.45, 0.1, 0.9), (0.35, 0.3)),
    "large": (hc.Arm(0.8, 0.6, 1.0, 1.0), (0.7, 0.6)),
    "small": (hc.Arm(0.15, 0.2, 0.02, 0.03), (0.1, 0.15)),
}


def shown(name):
    arm, origin = ARMS[name]
    cut = hc.constant_cut(length=0.05, clay=(0.01, 0.04))
    scene = stage.Stage(dataclasses.replace(cut, arm=arm, origin=origin))
    scene.pose(inverse_kinematics(*origin, arm.links))
    return arm, origin, scene


@pytest.mark.parametrize("name", ARMS)
def test_links_are_as_long_as_those_of_the_arm_and_the_tool_is_at_the_handle(name):
    arm, origin, scene = shown(name)
    model, data = scene.model, scene.data
    np.testing.assert_allclose(data.body("tool").xpos, (*origin, 0.0), atol=1e-15)
    q = data.qpos.tolist()
    elbow = arm.l1 * np.array([np.cos(q[0]), np.sin(q[0]), 0.0])
    np.testing.assert_allclose(data.body("link2").xpos, elbow, atol=1e-15)
    np.testing.assert_allclose(data.body("tool").xpos[:2], Links(*arm.links[:4]).forward(q))
    for body, length in (("link1", arm.l1), ("link2", arm.l2)):
        bars = [
            2.0 * model.geom_size[g, 1]
            for g in range(model.ngeom)
            if model.geom_bodyid[g] == model.body(body).id
            and model.geom_type[g] == mujoco.mjtGeom.mjGEOM_CAPSULE
        ]
        assert bars == pytest.approx([length], rel=1e-14)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("camera", stage.CAMERAS[:2])
def test_cameras_of_the_room_show_shoulder_elbow_and_tool(name, camera):
    """Those of the paper's arm stand where room.xml puts them, for larger ones farther away."""
    arm, _, scene = shown(name)
    model, data = scene.model, scene.data
    place, turn = data.camera(camera).xpos, data.camera(camera).xmat.reshape(3, 3)
    half = np.tan(0.5 * np.radians(model.camera(camera).fovy[0]))
    for body in ("link1", "link2", "tool"):
        x, y, z = turn.T @ (data.body(body).xpos - place)
        assert z < 0.0 and abs(y) < -z * half and abs(x) < -z * half * 1.5  # width over height
    grows = max(1.0, (arm.l1 + arm.l2) / 0.59)
    np.testing.assert_allclose(model.geom("table").size[:2], np.multiply((0.46, 0.44), grows))
