"""What a run looks like: a model to draw, posed from the run, its clay lowered where the tool has passed."""

from __future__ import annotations

import numpy as np

from ..model.scenario import AXES, Scenario
from ..stepping import scene
from ..stepping.engine import mujoco
from ..studies.removal import TOOL, Removal, Tool

CAMERAS = ("room", "top", "close")
PALE, DEEP = np.array([222, 168, 132]), np.array([186, 100, 62])  # clay of the least and of the most damping
HIDDEN = (0.0, 0.0, -5.0)  # where the target is when nobody pulls [m]


def cut_axes(scenario: Scenario) -> tuple[int, ...]:
    """The axes that plots beside a picture show: those along which the clay is laid out, x where there is none."""
    clay = scenario.clay
    return tuple(sorted({AXES.index(f.along) for f in (clay.x, clay.y)})) if clay is not None else (0,)


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
            clay = scene.Block((low[0], low[1]), (high[0], high[1]), rows, columns, scene.THICKNESS, self._colors())
        self.model = scene.picture(clay, (tool.width, tool.depth))
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
        self.model.hfield_data[:] = (self.removal.heights(scene.THICKNESS) / scene.THICKNESS).ravel()
        return True

    def _colors(self) -> np.ndarray:
        """The clay from above, darker where it damps more, shape (ny, nx, 3) of bytes."""
        clay = self.scenario.clay
        assert clay is not None
        top = hardest(self.scenario) or 1.0
        b = np.zeros(self.removal.cut.shape)
        for f in (clay.x, clay.y):
            along = np.array(f.values)[np.searchsorted(f.edges, self.removal.x if f.along == "x" else self.removal.y)]
            b = np.maximum(b, along[None, :] if f.along == "x" else along[:, None])
        rng = np.random.default_rng(0)  # a little grain, as clay has
        grain = 1.0 + 0.03 * rng.standard_normal(b.shape)[..., None]
        return np.clip((PALE + (b / top)[..., None] ** 2 * (DEEP - PALE)) * grain, 0, 255)[
            ::-1
        ]  # images start at the top
