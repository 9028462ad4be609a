"""Where the arm of a running pair is: Jacobian of its handle, torques against its weight."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arms.mjcf_arm import MjcfArm
from ..model import arm as closed_form
from ..model.arm import Arm
from ..scene.pair import axes_of
from ..scene.scenario import Scenario


class Places:
    """An arm at places of its joints.

    Attributes:
        axes: of the world, for each column of forces in its run.
        shown: those columns in the order of the arm's own plane.
    """

    def __init__(self, scenario: Scenario, own: Any, held: bool):
        self.arm: Any = scenario.arm
        self.axes = ["xyz".index(c) for c in scenario.axes]
        self.shown = [self.axes.index("xyz".index(c)) for c in axes_of(own)]
        self._masses = np.array([hand.mass for hand in scenario.hands])
        self._weighs = held and isinstance(self.arm, MjcfArm) and self.arm.mechanism.weighs

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Velocity of the handle along the axes of its run per joint rate, shape (axes, n)."""
        if not isinstance(self.arm, Arm):
            return self.arm.jacobian(q)[self.axes]
        u1x, u1y, u2x, u2y = closed_form.jacobians(q[0], q[1], self.arm.links)
        return np.array([[u1x + u2x, u2x], [u1y + u2y, u2y]])

    def weight(self, q: np.ndarray) -> np.ndarray:
        """Torques against the weight of the arm and what it carries; 0 where nothing holds it."""
        if not self._weighs:
            return np.zeros(len(q))
        mechanism = self.arm.mechanism
        mechanism.at(q)
        gravity = np.array(mechanism.model.opt.gravity)[self.axes]
        return mechanism.weights() - self.jacobian(q).T @ (self._masses * gravity)
