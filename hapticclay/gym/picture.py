"""Pictures of an episode."""

from __future__ import annotations

import math

import numpy as np

from ..formulas.arm import inverse_kinematics
from ..scene.scenario import Scenario
from ..views.plan_picture import Plan, PlanPicture
from .draws import Truth
from .task import Handle, Memory, Task

RADIUS = 0.005  # [m] of the tool where a task has none
PATH = 2000  # points of the path to keep


class Picture:
    """A picture of one copy, in a window or as an array; `unseen` says why there is no window."""

    def __init__(self, task: Task, window: bool):
        self._task, self._plan = task, PlanPicture(window)
        self.unseen = self._plan.unseen
        self._path: list[tuple[float, float]] = []

    def begin(self) -> None:
        self._path = []

    def note(self, p: tuple[float, float]) -> None:
        point = float(p[0]), float(p[1])
        if not self._path or self._path[-1] != point:
            self._path.append(point)
        del self._path[:-PATH]

    def draw(self, truth: Truth, m: Memory, h: Handle) -> np.ndarray | None:
        """The present picture, shape (height, width, 3), uint8; None if a window shows it."""
        x, y = map(float, h.p)
        scenario, nodes = self._task.scenario(truth), m.get("nodes")
        plan = Plan(
            joints_at(scenario, x, y), np.array(self._path), nodes, blocks_of(scenario), RADIUS,
            view_of(nodes, np.array((x, y))), self._title(m, h),
        )  # fmt: skip
        return self._plan.draw(plan)

    def _title(self, m: Memory, h: Handle) -> str:
        speed = f"{100.0 * math.hypot(*h.v):.1f} cm/s"
        return f"K = {m['K']:.2f} 1/kg, {speed}" if "K" in m else speed

    def close(self) -> None:
        self._plan.close()


def joints_at(s: Scenario, x: float, y: float) -> np.ndarray:
    """Shoulder, elbow and handle [m], shape (3, 2), in the coordinates of p."""
    ox, oy = s.origin
    q, _ = inverse_kinematics(ox + x, oy + y, s.arm.links)
    elbow = s.arm.l1 * math.cos(q) - ox, s.arm.l1 * math.sin(q) - oy
    return np.array([(-ox, -oy), elbow, (x, y)])


def blocks_of(s: Scenario) -> list[tuple[float, float, float, float]]:
    """Blocks of clay, (x, y, width, height) [m]; empty if clay is everywhere."""
    blocks = [] if s.clay is None else s.clay.blocks
    return [(b.x[0], b.y[0], b.x[1] - b.x[0], b.y[1] - b.y[0]) for b in blocks]


def view_of(nodes: np.ndarray | None, p: np.ndarray) -> tuple[float, float, float]:
    """Centre of the close-up view and half its side [m]."""
    if nodes is None:
        return 0.0, 0.0, max(0.08, 1.1 * float(np.abs(p).max()))
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    middle = 0.5 * (low + high)
    return float(middle[0]), float(middle[1]), 0.5 * float((high - low).max()) + 0.015
