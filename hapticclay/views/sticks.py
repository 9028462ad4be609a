"""Stick figures in MuJoCo's scenes, and the room that they stand in."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..arms.mechanism import Sticks
from ..kernel.engine import mujoco
from .palette import PART_COLORS, SKY, TABLE, rgb

LINK, JOINT, KNOB, SHAFT = 0.016, 0.024, 0.03, 0.012  # radii, as shares of a mechanism's size
FIELD = 40.0  # [deg] of view
LEAST_ASPECT = 1.2  # of a picture, for which the cameras are placed
MARGIN = 0.92  # of a picture that `fit` fills
VIEWS = {"room": (-50.0, 24.0, 1.0), "top": (-90.0, 89.0, 1.0), "close": (-50.0, 24.0, 0.45)}
SMALLEST = 0.01  # [m] size of a room, and distance of a camera, of an arm that is one point
"""Azimuth and elevation of each camera [deg], and its distance as a share of the first one's."""


def draw_sticks(scene: mujoco.MjvScene, shown: Sticks, size: float, color: str, knob: str) -> None:
    """Adds a mechanism to what a renderer draws.

    Args:
        scene: of the renderer.
        shown: the mechanism.
        size: of it [m].
        color: of every other link.
        knob: colour of the handle.
    """
    for k, (begin, end) in enumerate(shown.segments):
        capsule(scene, begin, end, LINK * size, color if k % 2 else PART_COLORS["dark"])
    for place in shown.joints:
        sphere(scene, place, JOINT * size, PART_COLORS["steel"])
    sphere(scene, shown.handle, KNOB * size, knob)


def capsule(scene: mujoco.MjvScene, begin: Any, end: Any, radius: float, color: str) -> None:
    """Adds a link."""
    _joined(scene, mujoco.mjtGeom.mjGEOM_CAPSULE.value, (begin, end), radius, color)


def arrow(scene: mujoco.MjvScene, begin: Any, end: Any, radius: float, color: str) -> None:
    """Adds an arrow."""
    _joined(scene, mujoco.mjtGeom.mjGEOM_ARROW.value, (begin, end), radius, color)


def _joined(scene: Any, kind: int, ends: Any, radius: float, color: str) -> None:
    geom = _added(scene, kind, np.zeros(3), np.zeros(3), color)
    if geom is not None:
        mujoco.mjv_connector(geom, kind, radius, *map(np.array, ends))


def sphere(
    scene: mujoco.MjvScene, place: Any, radius: float, color: str, opacity: float = 1.0
) -> Any:
    """Adds a ball, and returns it; None where the scene is full."""
    kind = mujoco.mjtGeom.mjGEOM_SPHERE.value
    return _added(scene, kind, np.full(3, radius), np.array(place), color, opacity)


def box(scene: mujoco.MjvScene, place: Any, half: Any, color: str, opacity: float = 1.0) -> None:
    """Adds a box."""
    kind = mujoco.mjtGeom.mjGEOM_BOX.value
    _added(scene, kind, np.array(half), np.array(place), color, opacity)


def _added(
    scene: Any, kind: int, size: np.ndarray, place: np.ndarray, color: str, opacity: float = 1.0
) -> Any:
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    rgba = np.array((*rgb(color), opacity), dtype=np.float32)
    mujoco.mjv_initGeom(geom, kind, size, place, np.eye(3).ravel(), rgba)
    scene.ngeom += 1
    return geom


def room(places: np.ndarray, handles: np.ndarray) -> mujoco.MjModel:
    """A table below all places, a light, and cameras that see them."""
    low, high = places.min(axis=0), places.max(axis=0)
    middle, size = 0.5 * (low + high), max(SMALLEST, float((high - low).max()))
    spec = mujoco.MjSpec()
    spec.visual.headlight.ambient[:] = 0.35
    spec.visual.headlight.diffuse[:] = 0.3
    spec.visual.headlight.specular[:] = 0.0  # it would glare from straight above
    spec.stat.extent, spec.stat.center = 2.0 * size, middle
    sky = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    light, dark = (np.array(rgb(x)) for x in SKY)
    gradient = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    spec.add_texture(
        name="sky", type=sky, builtin=gradient, rgb1=light, rgb2=dark, width=64, height=384
    )
    plane, floor = mujoco.mjtGeom.mjGEOM_PLANE, low[2] - 0.06 * size
    spec.worldbody.add_geom(
        name="table",
        type=plane,
        size=(8.0 * size, 8.0 * size, 0.1),
        pos=(*middle[:2], floor),
        rgba=(*rgb(TABLE), 1.0),
    )
    above = middle + size * np.array((0.6, -0.8, 3.0))
    spec.worldbody.add_light(pos=above, dir=middle - above, diffuse=(0.38,) * 3)
    distance = 0.62 * size / math.tan(math.radians(0.5 * FIELD)) + 0.3 * size
    for name, (azimuth, elevation, share) in VIEWS.items():
        target = middle if name != "close" else handles.mean(axis=0)
        back, quat = look(azimuth, elevation)
        at = target + share * distance * back
        spec.worldbody.add_camera(name=name, pos=at, quat=quat, fovy=FIELD)
    return spec.compile()


def fit(model: mujoco.MjModel, camera: str, places: np.ndarray) -> None:
    """Moves a camera along its line of sight until it just sees all places."""
    azimuth, elevation, _ = VIEWS[camera]
    back, _ = look(azimuth, elevation)
    right = np.array([-math.sin(math.radians(azimuth)), math.cos(math.radians(azimuth)), 0.0])
    up = np.cross(back, right)
    seen = places @ np.column_stack((right, up, back))
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    target = np.column_stack((right, up, back)) @ middle
    across, high, near = (seen - middle).T
    half = MARGIN * math.tan(math.radians(0.5 * FIELD))
    away = np.maximum(np.abs(across) / (LEAST_ASPECT * half), np.abs(high) / half) + near
    model.cam_pos[model.camera(camera).id] = target + max(SMALLEST, float(away.max())) * back


def look(azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray]:
    """Direction from what a camera sees to the camera, and its orientation."""
    a, e = math.radians(azimuth), math.radians(elevation)
    back = np.array((math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)))
    right = np.array((-math.sin(a), math.cos(a), 0.0))
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.column_stack((right, np.cross(back, right), back)).ravel())
    return back, quat
