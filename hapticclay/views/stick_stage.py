"""The scene of films of an arm from a file: a stick figure of its mechanism on a table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..arms.mechanism import Sticks
from ..errors import ParameterError
from ..kernel.engine import mujoco
from ..simulation.record import Record
from .palette import BLUE, PART_COLORS, SKY, TABLE, rgb

POSES = 40  # of a run, from which the cameras see all
LINK, JOINT, KNOB = 0.016, 0.024, 0.03  # radii, as shares of the mechanism's size
FIELD = 40.0  # [deg] of view
VIEWS = {"room": (-50.0, 24.0, 1.0), "top": (-90.0, 89.0, 1.0), "close": (-50.0, 24.0, 0.45)}
"""Azimuth and elevation of each camera [deg], and its distance as a share of the first one's."""


class StickStage:
    """The scene of one record: `model` and `data` for a renderer; see `stage.Stage`.

    Motion about the median pose is shown `magnify` times.
    """

    field = -1  # without clay

    def __init__(self, record: Record, magnify: float = 1.0):
        arm = record.scenario.file_arm
        self._arm, self._magnify = arm, magnify
        self._rest = np.median(record.q, axis=0) if magnify != 1.0 else np.zeros(len(arm.names))
        chosen = np.unique(np.linspace(0, len(record.q) - 1, POSES).astype(int))
        figures = [self._sticks(record.q[k]) for k in chosen]
        places = np.concatenate([x.segments.reshape(-1, 3) for x in figures])
        handles = np.array([x.handle for x in figures])
        self.model = _room(places, handles)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self._size = float(np.ptp(places, axis=0).max())
        self._shown = figures[0]

    def pose(self, q: Any, target: Any = None) -> None:
        """Poses the mechanism."""
        self._shown = self._sticks(q)

    def _sticks(self, q: Any) -> Sticks:
        place = self._rest + self._magnify * (np.asarray(q) - self._rest)
        if self._magnify == 1.0:
            return self._arm.mechanism.sticks(np.asarray(q))
        try:
            return self._arm.mechanism.sticks(place)
        except ParameterError:
            bound = "must be smaller: its chains cannot be closed in the motion so magnified"
            raise ParameterError("magnify", self._magnify, bound) from None

    def push(self, fe: Any, held: bool) -> None:
        """Forces of clay are not drawn."""

    def carve(self, points: Any) -> float:
        """Clay is not drawn."""
        return 0.0

    def relief(self) -> bool:
        """No heightfield is to be uploaded."""
        return False

    def draw_arrow(self, scene: mujoco.MjvScene) -> None:
        """Adds the mechanism to what a renderer draws."""
        size, shown = self._size, self._shown
        for k, (begin, end) in enumerate(shown.segments):
            color = BLUE if k % 2 else PART_COLORS["dark"]
            _capsule(scene, begin, end, LINK * size, color)
        for place in shown.joints:
            _sphere(scene, place, JOINT * size, PART_COLORS["steel"])
        _sphere(scene, shown.handle, KNOB * size, PART_COLORS["orange"])


def _capsule(scene: mujoco.MjvScene, begin: Any, end: Any, radius: float, color: str) -> None:
    geom = _added(scene, mujoco.mjtGeom.mjGEOM_CAPSULE.value, np.zeros(3), np.zeros(3), color)
    if geom is not None:
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE.value
        mujoco.mjv_connector(geom, kind, radius, np.array(begin), np.array(end))


def _sphere(scene: mujoco.MjvScene, place: Any, radius: float, color: str) -> None:
    kind = mujoco.mjtGeom.mjGEOM_SPHERE.value
    _added(scene, kind, np.full(3, radius), np.array(place), color)


def _added(scene: Any, kind: int, size: np.ndarray, place: np.ndarray, color: str) -> Any:
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    rgba = np.array((*rgb(color), 1.0), dtype=np.float32)
    mujoco.mjv_initGeom(geom, kind, size, place, np.eye(3).ravel(), rgba)
    scene.ngeom += 1
    return geom


def _room(places: np.ndarray, handles: np.ndarray) -> mujoco.MjModel:
    """A table below all places, a light, and cameras that see them."""
    low, high = places.min(axis=0), places.max(axis=0)
    middle, size = 0.5 * (low + high), float((high - low).max())
    spec = mujoco.MjSpec()
    spec.visual.headlight.ambient[:] = 0.35
    spec.visual.headlight.diffuse[:] = 0.3
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
        back, quat = _look(azimuth, elevation)
        at = target + share * distance * back
        spec.worldbody.add_camera(name=name, pos=at, quat=quat, fovy=FIELD)
    return spec.compile()


def _look(azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray]:
    """Direction from what a camera sees to the camera, and its orientation."""
    a, e = math.radians(azimuth), math.radians(elevation)
    back = np.array((math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)))
    right = np.array((-math.sin(a), math.cos(a), 0.0))
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.column_stack((right, np.cross(back, right), back)).ravel())
    return back, quat
