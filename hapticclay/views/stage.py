"""What a run looks like: a model to draw, posed from the run, its clay lowered where the tool has passed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model.constants import AXES, L1, L2
from ..model.scenario import Scenario
from ..stepping.engine import _compose, _sound, mujoco, warnings_caught
from ..studies.removal import TOOL, Removal, Tool

CAMERAS = ("room", "top", "close")
PALE, DEEP = (
    np.array([222, 168, 132]),
    np.array([186, 100, 62]),
)  # clay of the least and of the most damping
HIDDEN = (0.0, 0.0, -5.0)  # where the target is when nobody pulls [m]


def cut_axes(scenario: Scenario) -> tuple[int, ...]:
    """The axes that plots beside a picture show: those along which the clay is laid out, x where there is none."""
    clay = scenario.clay
    return (
        tuple(sorted({AXES.index(f.along) for f in (clay.x, clay.y)})) if clay is not None else (0,)
    )


def hardest(scenario: Scenario) -> float:
    """The most damping that the clay has by its profiles, growth aside [N.s/m]; 0 without clay."""
    clay = scenario.clay
    return max(*clay.x.values, *clay.y.values) if clay is not None else 0.0


class Stage:
    """A picture of one scenario.

    Attributes:
        model, data: for the engine's renderers. removal: map of the clay, led by `carve`.
        field: id of the heightfield; -1 if there is no clay.
    """

    def __init__(self, scenario: Scenario, tool: Tool = TOOL):
        self.scenario, self.tool = scenario, tool
        self.removal = Removal(scenario, tool)
        grid, origin = self.removal, np.array(scenario.origin)
        clay = None
        if scenario.clay is not None:
            low, high = [np.array([grid.x[j], grid.y[j]]) + origin for j in (0, -1)]
            rows, columns = len(grid.y), len(grid.x)
            clay = Block(
                (low[0], low[1]), (high[0], high[1]), rows, columns, THICKNESS, self._colors()
            )
        self.model = picture(clay, (tool.width, tool.depth))
        self.data = mujoco.MjData(self.model)
        self.field = 0 if clay else -1
        self.place: tuple[float, float] | None = None  # of the tool, where it last cut [m]
        self.stale = True  # the heightfield is not yet what the map is
        self._target = self.model.body("target").mocapid[0]

    def pose(self, q, target: tuple[float, float] | None = None) -> None:
        """Poses the arm at joint angles q [rad], and the target of the hand [m] if somebody pulls."""
        self.data.qpos[:] = q
        at = HIDDEN if target is None else (*np.add(target, self.scenario.origin), 0.0)
        self.data.mocap_pos[self._target] = at
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def carve(self, points) -> float:
        """Leads the tool through points [m], shape (n, 2), from where it is; returns the volume removed [m^3]."""
        gained = 0.0
        if self.field < 0:
            return gained
        for point in points:
            gained += self.removal.sweep(self.place or point, point)
            self.place = tuple(point)
        self.stale |= gained > 0.0
        return gained

    def whole(self) -> None:
        """Makes the clay whole again."""
        self.removal.cut[:] = 0.0
        self.removal.volume = 0.0
        self.place, self.stale = None, True

    def relief(self) -> bool:
        """Brings the heightfield up to the map; True if there was something to bring, for the renderer to upload."""
        if not self.stale or self.field < 0:
            return False
        self.stale = False
        self.model.hfield_data[:] = (self.removal.heights(THICKNESS) / THICKNESS).ravel()
        return True

    def _colors(self) -> np.ndarray:
        """The clay from above, darker where it damps more, shape (ny, nx, 3) of bytes."""
        clay = self.scenario.clay
        assert clay is not None
        top = hardest(self.scenario) or 1.0
        b = np.zeros(self.removal.cut.shape)
        for f in (clay.x, clay.y):
            along = np.array(f.values)[
                np.searchsorted(f.edges, self.removal.x if f.along == "x" else self.removal.y)
            ]
            b = np.maximum(b, along[None, :] if f.along == "x" else along[:, None])
        rng = np.random.default_rng(0)  # a little grain, as clay has
        grain = 1.0 + 0.03 * rng.standard_normal(b.shape)[..., None]
        return np.clip((PALE + (b / top)[..., None] ** 2 * (DEEP - PALE)) * grain, 0, 255)[
            ::-1
        ]  # images start at the top


@dataclass(frozen=True)
class Block:
    """The block of clay in a picture.

    Attributes:
        low, high: corners [m], in world coordinates. rows, columns: of its map of heights. thickness: [m].
        colors: image over the block, shape (n, m, 3) of bytes, row 0 at the +y edge.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    rows: int
    columns: int
    thickness: float
    colors: np.ndarray


def picture(clay: Block | None, tool: tuple[float, float]) -> mujoco.MjModel:
    """A model to look at, not to step: the same arm with skin on, the room, the block of clay as a heightfield.

    Its joints are those of `build`; whoever draws copies the angles. The target of the hand is the mocap body
    "target", the tool's tip the body "tool".

    Args:
        clay: the block; None for none. tool: width of the tool, and depth of its tip under the surface [m].
    """
    with warnings_caught() as caught:
        spec = _compose(["arm.xml", "room.xml"])
        for body, *skin in SKIN:
            _skin(spec.body(body) if body else spec.worldbody, *skin)
        surface = GROUND + (clay.thickness if clay else THICKNESS)
        body = spec.body("link2").add_body(name="tool", pos=(L2, 0.0, 0.0))
        _skin(
            body, "cylinder", (0.0, 0.0, surface - tool[1]), (0.0, 0.0, 0.0), 0.5 * tool[0], "steel"
        )
        _skin(body, "cylinder", (0.0, 0.0, 0.0), (0.0, 0.0, 0.045), 0.008, "dark")
        _skin(body, "sphere", (0.0, 0.0, 0.052), (0.0, 0.0, 0.052), 0.016, "orange")
        target = spec.worldbody.add_body(name="target", mocap=True)
        _skin(
            target,
            "sphere",
            (0.0, 0.0, 0.052),
            (0.0, 0.0, 0.052),
            0.012,
            "",
            (0.9, 0.42, 0.05, 0.45),
        )
        if clay:
            _block(spec, clay)
        model = spec.compile()
    return _sound(model, caught)


GROUND = -0.06  # height of the table under the plane of the arm [m], as in room.xml
THICKNESS = 0.03  # of a block of clay [m]
SKIN: Any = (  # body ("" for the world), shape, from, to [m], radius [m], material
    ("", "cylinder", (0.0, 0.0, GROUND), (0.0, 0.0, -0.03), 0.060, "dark"),
    ("", "cylinder", (0.0, 0.0, -0.03), (0.0, 0.0, 0.022), 0.042, "steel"),
    ("link1", "cylinder", (0.0, 0.0, 0.022), (0.0, 0.0, 0.034), 0.034, "dark"),
    ("link1", "capsule", (0.0, 0.0, 0.0), (L1, 0.0, 0.0), 0.017, "dark"),
    ("link1", "cylinder", (L1, 0.0, -0.024), (L1, 0.0, 0.024), 0.026, "steel"),
    ("link2", "cylinder", (0.0, 0.0, 0.024), (0.0, 0.0, 0.034), 0.021, "blue"),
    ("link2", "capsule", (0.0, 0.0, 0.0), (L2, 0.0, 0.0), 0.012, "blue"),
)


def _skin(
    body, shape: str, begin, end, radius: float, material: str, rgba=(0.5, 0.5, 0.5, 1.0)
) -> None:
    """Adds a geom that is only seen: it weighs nothing and touches nothing."""
    kind = getattr(mujoco.mjtGeom, f"mjGEOM_{shape.upper()}")
    place = (
        {"pos": begin, "size": (radius, 0.0, 0.0)} if begin == end else {"fromto": (*begin, *end)}
    )
    geom = body.add_geom(type=kind, material=material, mass=0.0, contype=0, conaffinity=0, **place)
    geom.size[0] = radius
    if not material:
        geom.rgba = rgba


def _block(spec: mujoco.MjSpec, clay: Block) -> None:
    size = [0.5 * (high - low) for low, high in zip(clay.low, clay.high, strict=True)]
    middle = [0.5 * (high + low) for low, high in zip(clay.low, clay.high, strict=True)]
    height, width = clay.colors.shape[:2]
    spec.add_texture(
        name="block", type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3,
        data=clay.colors.astype(np.uint8).ravel().tolist(),
    )  # fmt: skip
    textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "block"
    spec.add_material(name="block", textures=textures, specular=0.12, shininess=0.15)
    spec.add_hfield(
        name="clay", nrow=clay.rows, ncol=clay.columns, size=(*size, clay.thickness, 1e-3),
        userdata=np.ones(clay.rows * clay.columns),
    )  # fmt: skip
    spec.worldbody.add_geom(
        name="clay", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="clay", material="block",
        pos=(*middle, GROUND), contype=0, conaffinity=0,
    )  # fmt: skip
