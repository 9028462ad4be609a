"""The scene of films, window and page: arm, room, and a block of clay cut by the tool.

The model is for drawing only: `Stage.pose` copies the joint angles of the run into it, and
`Stage.carve` lowers the clay along the path of the tool.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..kernel.engine import checked_model, compose_spec, mujoco, warnings_caught
from ..model.arm import PAPER, Arm
from ..model.constants import AXES
from ..scene.scenario import Scenario
from ..studies.removal import TOOL, Removal, Tool
from .palette import BLUE, PART_COLORS, SKY_BLUE, clay_color, clay_share, cutting_force, rgb

CAMERAS = ("room", "top", "close")
HIDDEN = (0.0, 0.0, -5.0)  # position of the hand's target without a pull [m]
GROUND = -0.06  # height of the table, the plane of the arm at 0 [m], as in room.xml
THICKNESS = 0.03  # of a block of clay [m]
SUNK = 3e-4  # [m] of the block under the table, which hides it where no clay is
GRAIN = 0.03  # rms of the brightness of clay, as a share
KNOB = (0.0, 0.0, 0.052)  # of the handle, from the tip of link 2 [m]
TARGET_ALPHA = 0.45
ARROW_LENGTH, ARROW_MOST = 0.08, 0.16  # [m] of the force that breaks the hardest clay; at most
ARROW_WIDTH = 0.006  # [m]


def plotted_axes(scenario: Scenario) -> tuple[int, ...]:
    """Returns the axes of live plots: those along which the clay changes, x without clay."""
    return tuple(map(AXES.index, scenario.clay.along)) if scenario.clay else (0,)


def hardest(scenario: Scenario) -> float:
    """Returns the largest damping of the clay, growth aside [N.s/m]; 0 without clay."""
    return scenario.clay.largest if scenario.clay else 0.0


class Arrow(NamedTuple):
    """The force of yielding clay on the handle, from the knob to the tip [m]."""

    begin: np.ndarray
    end: np.ndarray
    held: bool

    @property
    def color(self) -> str:
        """Blue, as the clay's force in plots; light while it holds the handle."""
        return SKY_BLUE if self.held else BLUE


class Stage:
    """The scene of one scenario: `model` and `data` for a renderer, `removal` the map of its clay.

    `field` is the id of the heightfield, -1 without clay; `stale` tells whether it lags behind the
    map; `place` is where the tool last cut [m]; `arrow` the force of clay that yields, or None.
    """

    def __init__(self, scenario: Scenario, tool: Tool = TOOL):
        """Compiles the model."""
        blocks = scenario.clay.blocks if scenario.clay else ()
        tool = next((block.tool for block in blocks if block.tool), tool)
        self.scenario, self.tool = scenario, tool
        self.removal = Removal(scenario, tool)
        grid, block = self.removal, None
        if scenario.clay is not None:
            low, high = (np.add(scenario.origin, (grid.x[k], grid.y[k])) for k in (0, -1))
            block = Block(low, high, len(grid.y), len(grid.x), THICKNESS, self._colors())
        self.model = picture(scenario.planar_arm, block, (tool.width, tool.depth))
        self.data = mujoco.MjData(self.model)
        self.field = 0 if block else -1
        self.place: tuple[float, float] | None = None
        self.stale = True
        clay = scenario.clay
        self._breaking = cutting_force(clay) if clay and clay.holding else 0.0
        self.arrow: Arrow | None = None
        self._target = self.model.body("target").mocapid[0]

    def pose(self, q: Any, target: tuple[float, float] | None = None) -> None:
        """Poses the arm and the target of the hand."""
        self.data.qpos[:] = q
        at = HIDDEN if target is None else (*np.add(target, self.scenario.origin), 0.0)
        self.data.mocap_pos[self._target] = at
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def push(self, fe: Any, held: bool) -> None:
        """Points the arrow along the force of yielding clay; call it after `pose`."""
        self.arrow = None
        size = float(np.hypot(*fe))
        if not self._breaking or not size > 1e-3 * self._breaking:
            return
        length = min(ARROW_LENGTH * size / self._breaking, ARROW_MOST)
        begin = self.data.body("tool").xpos + KNOB
        self.arrow = Arrow(begin, begin - length / size * np.append(fe, 0.0), held)

    def draw_arrow(self, scene: mujoco.MjvScene) -> None:
        """Adds the arrow, if there is one, to what a renderer draws."""
        if self.arrow is None or scene.ngeom >= scene.maxgeom:
            return
        begin, end, _ = self.arrow
        shape, geom = mujoco.mjtGeom.mjGEOM_ARROW.value, scene.geoms[scene.ngeom]
        color = np.array((*rgb(self.arrow.color), 1.0), dtype=np.float32)
        mujoco.mjv_initGeom(geom, shape, np.zeros(3), np.zeros(3), np.eye(3).ravel(), color)
        mujoco.mjv_connector(geom, shape, ARROW_WIDTH, begin, end)
        scene.ngeom += 1

    def carve(self, points: Any) -> float:
        """Moves the tool through points, from its present position."""
        gained = 0.0
        if self.field < 0:
            return gained
        for point in points:
            gained += self.removal.sweep(self.place or point, point)
            self.place = tuple(point)
        self.stale |= gained > 0.0
        return gained

    def restore(self) -> None:
        """Restores the uncut clay."""
        self.removal.restore()
        self.place, self.stale = None, True

    def relief(self) -> bool:
        """Copies the map into the heightfield; returns whether the renderer has to upload it."""
        if not self.stale or self.field < 0:
            return False
        self.stale = False
        self.model.hfield_data[:] = (self.removal.heights(THICKNESS) / THICKNESS).ravel()
        return True

    def _colors(self) -> np.ndarray:
        """The clay from above, darker where it is harder to cut, shape (ny, nx, 3) of bytes."""
        clay, grid = self.scenario.clay, self.removal
        assert clay is not None
        share = np.broadcast_to(clay_share(clay, grid.x, grid.y[:, None]), grid.cut.shape)
        rng = np.random.default_rng(0)
        grain = 1.0 + GRAIN * rng.standard_normal(share.shape)[..., None]
        colors = 255.0 * clay_color(share) * grain
        return np.clip(colors, 0, 255)[::-1]  # images start at the top


class Block(NamedTuple):
    """The block of clay in a picture."""

    low: Any  # lowest corner in the world [m], (2,)
    high: Any  # highest corner [m], (2,)
    rows: int  # of its map of heights
    columns: int
    thickness: float  # [m]
    colors: np.ndarray  # image over the block, shape (n, m, 3) of bytes, row 0 at the +y edge


def picture(arm: Arm, clay: Block | None, tool: tuple[float, float]) -> mujoco.MjModel:
    """Compiles a model to draw, not to step: the arm with its skin, the room, the block of clay.

    Its joints are those of `build`. The target of the hand is the mocap body "target", the tip of
    the tool the body "tool".
    """
    with warnings_caught() as caught:
        model = picture_spec(arm, clay, tool).compile()
    return checked_model(model, caught)


def picture_spec(
    arm: Arm, clay: Block | None, tool: tuple[float, float], more: tuple[str, ...] = ()
) -> mujoco.MjSpec:
    """The specification of a `picture`."""
    spec = compose_spec(["arm.xml", "room.xml", *more], arm)
    _enlarge_room(spec, room_scale(arm))
    for name, color in PART_COLORS.items():
        spec.material(name).rgba = (*rgb(color), 1.0)
    for body, *skin in arm_skin(arm):
        _skin(spec.body(body) if body else spec.worldbody, *skin)
    tip = (0.0, 0.0, GROUND + (clay.thickness if clay else THICKNESS) - tool[1])
    centre = (0.0, 0.0, 0.0)
    body = spec.body("link2").add_body(name="tool", pos=(arm.l2, 0.0, 0.0))
    _skin(body, "cylinder", tip, centre, 0.5 * tool[0], "steel")
    _skin(body, "cylinder", centre, (0.0, 0.0, 0.045), 0.008, "dark")
    _skin(body, "sphere", KNOB, KNOB, 0.016, "orange")
    target = spec.worldbody.add_body(name="target", mocap=True)
    _skin(target, "sphere", KNOB, KNOB, 0.012, "")
    target.geoms[0].rgba = (*rgb(PART_COLORS["orange"]), TARGET_ALPHA)
    if clay:
        _block(spec, clay)
    return spec


def room_scale(arm: Arm) -> float:
    """Scale of the room relative to that of the paper's arm; at least 1."""
    return max(1.0, arm.reach[1] / PAPER.reach[1])


def _enlarge_room(spec: mujoco.MjSpec, scale: float) -> None:
    """Moves cameras and light away from the shoulder, and widens the table."""
    for part in (*spec.cameras, *spec.lights):
        part.pos *= scale
    table = spec.geom("table")
    table.pos[:2] *= scale
    table.size[:2] *= scale
    spec.stat.center *= scale
    spec.stat.extent *= scale


def arm_skin(arm: Arm) -> Any:
    """Visible geometry of an arm, by link."""
    joint, elbow, handle = (0.0, 0.0, 0.0), (arm.l1, 0.0, 0.0), (arm.l2, 0.0, 0.0)
    return (
        ("", "cylinder", (0.0, 0.0, GROUND), (0.0, 0.0, -0.03), 0.060, "dark"),
        ("", "cylinder", (0.0, 0.0, -0.03), (0.0, 0.0, 0.022), 0.042, "steel"),
        ("link1", "cylinder", (0.0, 0.0, 0.022), (0.0, 0.0, 0.034), 0.034, "dark"),
        ("link1", "capsule", joint, elbow, 0.017, "dark"),
        ("link1", "cylinder", (arm.l1, 0.0, -0.024), (arm.l1, 0.0, 0.024), 0.026, "steel"),
        ("link2", "cylinder", (0.0, 0.0, 0.024), (0.0, 0.0, 0.034), 0.021, "blue"),
        ("link2", "capsule", joint, handle, 0.012, "blue"),
    )


def _skin(body: Any, shape: str, begin: Any, end: Any, radius: float, material: str) -> None:
    """Adds a purely visual geom, without mass or contact."""
    kind = getattr(mujoco.mjtGeom, f"mjGEOM_{shape.upper()}")
    place: Any = {"fromto": (*begin, *end)}
    if begin == end:
        place = {"pos": begin, "size": (radius, 0.0, 0.0)}
    geom = body.add_geom(type=kind, material=material, mass=0.0, contype=0, conaffinity=0, **place)
    geom.size[0] = radius


def _block(spec: mujoco.MjSpec, clay: Block) -> None:
    height, width = clay.colors.shape[:2]
    flat = mujoco.mjtTexture.mjTEXTURE_2D
    data = clay.colors.astype(np.uint8).ravel().tolist()
    spec.add_texture(name="block", type=flat, data=data, width=width, height=height, nchannel=3)
    textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "block"
    spec.add_material(name="block", textures=textures, specular=0.12, shininess=0.15)
    size = (*0.5 * np.subtract(clay.high, clay.low), clay.thickness, 1e-3)
    whole = np.ones(clay.rows * clay.columns)
    spec.add_hfield(name="clay", userdata=whole, nrow=clay.rows, ncol=clay.columns, size=size)
    look: Any = dict(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="clay", material="block")
    middle = (*0.5 * np.add(clay.high, clay.low), GROUND - SUNK)
    spec.worldbody.add_geom(name="clay", pos=middle, contype=0, conaffinity=0, **look)
