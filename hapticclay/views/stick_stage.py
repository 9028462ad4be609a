"""The scene of films of an arm from a file: a stick figure of its mechanism on a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arms.mechanism import Sticks
from ..errors import ParameterError
from ..kernel.engine import mujoco
from ..simulation.record import Record
from .palette import BLUE, PART_COLORS
from .sticks import draw_sticks, room

POSES = 40  # of a run, from which the cameras see all


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
        self.model = room(places, handles)
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
        draw_sticks(scene, self._shown, self._size, BLUE, PART_COLORS["orange"])
