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
from .cut_line import GAIN_SHARE
from .draws import HAND, Range, Truth
from .environment import TaskEnv
from .follow import AHEAD, MOTION, Follow
from .quantities import Quantity, either_way
from .task import Arrays, Handles, scene_of
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
        """Quantities of an observation."""
        return (
            either_way("depth of the tool's edge below that of the block", 20.0, "mm"),
            Quantity("target depth", 0.0, 10.0, "mm"),
            Quantity("target depth 5 mm ahead", 0.0, 10.0, "mm"),
            *MOTION,
        )

    def line(self, truth: Truth) -> np.ndarray:
        """Nodes of the path of the tool centre [m].

        Args:
            truth: numbers drawn.
        """
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

    def depths(self, m: Arrays, at: lines.Place) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Depth of the tool edge, its target, and the target ahead [m], shape (n,) each.

        Args:
            m: memory of the task.
            at: positions of the handles along their lines.
        """
        along = m["lengths"][:, 1]
        step = m["depth_at_end"] - m["depth"]

        def target(s: np.ndarray) -> np.ndarray:
            share = np.minimum(np.maximum((s - APPROACH) / along, 0.0), 1.0)
            return m["depth"] + step * share

        here = target(at.s)
        return here - at.across, here, target(at.s + AHEAD)

    @override
    def error(self, m: Arrays, at: lines.Place) -> np.ndarray:
        depth, target, _ = self.depths(m, at)
        return (depth - target) / (SHARE * target)

    @override
    def observe(self, m: Arrays, h: Handles) -> np.ndarray:
        at = self.beside(m, h)
        depths = (1000.0 * d for d in self.depths(m, at))
        return np.stack((*depths, *self.motion(m, h, at)), axis=1)


class PareEdge(TaskEnv):
    """A hand pares the edge of a block of clay to an even depth.

    Args:
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        engine: as in `Simulation`: "auto", "python" or "native".
        render_mode: "human", "rgb_array" or None.
    """

    task_type = PareEdgeTask


class PareEdgeVector(TaskVectorEnv):
    """Many copies of `PareEdge`."""

    task_type = PareEdgeTask
