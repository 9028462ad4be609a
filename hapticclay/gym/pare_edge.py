"""`hapticclay/PareEdge-v0`: a hand pares the edge of a block of clay to an even depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from ..model.clay import Clay
from ..model.groove import Groove
from ..model.tool import Tool
from ..scene.scenario import Scenario
from . import lines
from .columns import Value, clipped
from .cut_line import GAIN_SHARE
from .draws import HAND, Range, Truth
from .environment import TaskEnv
from .follow import AHEAD, MOTION, Follow
from .quantities import Quantity, symmetric
from .task import Handle, Memory, scene_of
from .vector import TaskVectorEnv

TOOL = Tool(0.010, 0.010)
RADIUS = 0.5 * TOOL.width
APPROACH, LENGTH, BEYOND = 0.010, 0.060, 0.010  # [m] to the block, along it, and its rest
WIDTH = 0.012  # of the block [m]
CELL = 1e-3  # [m]
SHARE = 0.2  # of the target depth: tolerance


@dataclass(frozen=True)
class PareEdgeTask(Follow):
    """Task: pare the edge of a block that stays cut."""

    drawn: ClassVar[dict[str, Range]] = {
        **HAND,
        "pressure": Range(5e4, 3e5, "Pa", 1.0, 1e7, True, "force per cross-section of the cut"),
        "damping": Range(
            5e5, 3e6, "N.s/m^3", 0.0, 2e7, True, "force per cross-section of the cut and speed"
        ),
        "gain": GAIN_SHARE,
        "depth": Range(1e-3, 3e-3, "m", 2e-4, 5e-3, False, "target depth where the block begins"),
        "depth_at_end": Range(1e-3, 3e-3, "m", 2e-4, 5e-3, False, "target depth at its end"),
        "offset": Range(-1e-3, 1e-3, "m", -3e-3, 3e-3, False, "start beside the line"),
    }
    far: ClassVar[float] = 0.006
    most: ClassVar[float] = 20.0

    @property
    def observations(self) -> tuple[Quantity, ...]:
        return (
            symmetric("depth of the tool's edge below that of the block", 20.0, "mm"),
            Quantity("target depth", 0.0, 10.0, "mm"),
            Quantity("target depth 5 mm ahead", 0.0, 10.0, "mm"),
            *MOTION,
        )

    def line(self, truth: Truth) -> np.ndarray:
        """Nodes of the path of the tool centre [m]."""
        end = truth["depth"] - truth["depth_at_end"]
        return np.array([(0.0, 0.0), (APPROACH, 0.0), (APPROACH + LENGTH, end)])

    @override
    def scenario(self, truth: Truth) -> Scenario:
        edge = truth["depth"] - RADIUS  # of the block, along y
        x, y = (APPROACH, APPROACH + LENGTH + BEYOND), (edge - WIDTH, edge)
        cells = round((x[1] - x[0]) / CELL), round(WIDTH / CELL)
        groove = Groove(
            x, y, truth["pressure"], 0.0, truth["damping"], TOOL, (float(cells[0]), float(cells[1]))
        )
        start = 0.0, truth["offset"]
        return scene_of(truth, name="pare edge", clay=Clay.of_groove(groove), start=start)

    def depths(self, m: Memory, at: lines.Place) -> tuple[Value, Value, Value]:
        """Depth of the tool edge, its target, and the target ahead [m]."""
        along = m["pieces"][1][4]
        step = m["depth_at_end"] - m["depth"]

        def target(s: Value) -> Value:
            return m["depth"] + step * clipped((s - APPROACH) / along, 0.0, 1.0)

        here = target(at.s)
        return here - at.across, here, target(at.s + AHEAD)

    @override
    def error(self, m: Memory, at: lines.Place) -> Value:
        depth, target, _ = self.depths(m, at)
        return (depth - target) / (SHARE * target)

    @override
    def observe(self, m: Memory, h: Handle) -> tuple[Value, ...]:
        at = self.place(m, h)
        depth, target, ahead = self.depths(m, at)
        return 1000.0 * depth, 1000.0 * target, 1000.0 * ahead, *self.motion(m, h, at)


class PareEdge(TaskEnv):
    """A hand pares the edge of a block of clay to an even depth.

    Args:
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        engine: "auto", "python" or "native", as in `Simulation`.
        render_mode: "human", "rgb_array" or None.
    """

    task_type = PareEdgeTask


class PareEdgeVector(TaskVectorEnv):
    """Many copies of `PareEdge`."""

    task_type = PareEdgeTask
