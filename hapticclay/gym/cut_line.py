"""`hapticclay/CutLine-v0`: a hand guides the arm through clay along a line, at constant speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from typing_extensions import override

from ..errors import choice
from ..model.clay import slab
from ..scene.scenario import Scenario
from . import lines
from .columns import Value
from .draws import HAND, Range, Truth
from .environment import TaskEnv
from .follow import MOTION, Follow
from .quantities import Quantity, symmetric
from .task import Handle, Memory, scene_of
from .vector import TaskVectorEnv

LENGTH = 0.10  # [m]
TOLERANCE = 2e-3  # [m]
GAIN_SHARE = Range(0.3, 1.0, "", 0.01, 2.0, False, "gain of the device, share of (1, 0.5) 1/kg")


@dataclass(frozen=True)
class CutLineTask(Follow):
    """Task: cut along a line through viscous clay."""

    shape: Literal["straight", "arc", "corner"] = "straight"
    drawn: ClassVar[dict[str, Range]] = {
        **HAND,
        "b": Range(30.0, 120.0, "N.s/m", 0.0, 1e4, True, "damping of the clay"),
        "gain": GAIN_SHARE,
        "angle": Range(-0.5, 0.5, "rad", -0.5, 0.5, False, "direction of the line at its start"),
        "offset": Range(-3e-3, 3e-3, "m", -0.01, 0.01, False, "start beside the line"),
    }

    def __post_init__(self):
        super().__post_init__()
        choice("shape", self.shape, tuple(lines.SHAPES))

    @property
    def observations(self) -> tuple[Quantity, ...]:
        return (
            symmetric("distance from the line, positive to its left", 50.0, "mm"),
            *MOTION,
            symmetric("sine of the turn of the line 5 mm ahead", 1.0),
        )

    def line(self, truth: Truth) -> np.ndarray:
        return lines.rotated(lines.SHAPES[self.shape](LENGTH), truth["angle"])

    @override
    def scenario(self, truth: Truth) -> Scenario:
        line = self.line(truth)
        (dx, dy), d = line[1] - line[0], truth["offset"]
        r = float(np.hypot(dx, dy))
        start = float(-dy / r * d), float(dx / r * d)
        return scene_of(truth, name="cut line", clay=slab(truth["b"]), start=start)

    @override
    def error(self, m: Memory, at: lines.Place) -> Value:
        return at.across / TOLERANCE

    @override
    def observe(self, m: Memory, h: Handle) -> tuple[Value, ...]:
        at = self.place(m, h)
        turn = lines.along_across(at.tangent, at.ahead)[1]
        return 1000.0 * at.across, *self.motion(m, h, at), turn


class CutLine(TaskEnv):
    """A hand guides the arm through clay along a line, at 5 cm/s.

    Args:
        shape: shape of the line: "straight", "arc" or "corner".
        ranges: ends (low, high) of each number drawn for an episode, by name; None for the task's.
        engine: "auto", "python" or "native", as in `Simulation`.
        render_mode: "human", "rgb_array" or None.
    """

    task_type = CutLineTask


class CutLineVector(TaskVectorEnv):
    """Many copies of `CutLine`."""

    task_type = CutLineTask
