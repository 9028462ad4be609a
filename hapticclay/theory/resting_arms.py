"""An arm with a hand around a pose, in its joints: what own controllers are judged with."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..formulas import arm as arm_law
from ..scene.scenario import Scenario

TURN = np.array([[1.0, 0.0], [1.0, 1.0]])  # absolute angles of the links from those of the joints
STEP = 1e-5  # [rad or m] of differences of static torques
NOTHING = 1e-9  # of 1 N.m/rad and of the static torques: a smaller slope is rounding


class ClosedForm:
    """The two-link arm in closed form.

    Attributes:
        start: joint positions from which rest is sought, shape (n,).
        axes: axes along which its handle moves.
        spring: of the hand along each [N/m].
    """

    def __init__(self, scenario: Scenario):
        self._links, self._origin = scenario.arm.links, np.array(scenario.origin)
        x, y = self._origin + scenario.start
        self.start = np.array(arm_law.inverse_kinematics(float(x), float(y), self._links))
        self.axes = 2
        self.spring = np.array([hand.spring for hand in scenario.hands])

    def _of_links(self, q: np.ndarray) -> np.ndarray:
        """Velocity of the handle from the rates of the links, one column a link."""
        u = arm_law.jacobian(float(q[0]), float(q[1]), self._links)
        return np.array(u).reshape(2, 2).T

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Velocity of the handle per joint rate, shape (axes, n)."""
        return self._of_links(q) @ TURN

    def force(self, q: np.ndarray) -> np.ndarray:
        """Force of the hand at rest [N], shape (axes,)."""
        u = self._of_links(q)
        return -self.spring * (np.array([u[1].sum(), -u[0].sum()]) - self._origin)

    def static(self, q: np.ndarray) -> np.ndarray:
        """Torques on the joints at rest but for the motors' [N.m], shape (n,)."""
        return self.jacobian(q).T @ self.force(q)

    def slope(self, q: np.ndarray) -> np.ndarray:
        """Their change with the joints [N.m/rad], shape (n, n)."""
        u = self._of_links(q)
        turned = np.array([-u[1], u[0]])  # change of each column as its link turns
        of_links = np.diag(self.force(q) @ turned) - u.T @ (self.spring[:, None] * u)
        return TURN.T @ of_links @ TURN

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """Inertia of the joints [kg.m^2], shape (n, n)."""
        return TURN.T @ np.diag(self._links[2:4]) @ TURN

    def damping(self, q: np.ndarray) -> np.ndarray:
        """Damping of the joints [N.m.s/rad], shape (n, n)."""
        return np.zeros((2, 2))


class FromFile:
    """An arm from a file at its pose, as `ClosedForm`."""

    def __init__(self, scenario: Scenario):
        self._arm: Any = scenario.file_arm
        self._rows = ["xyz".index(axis) for axis in scenario.axes]
        self.start, self.axes = self._arm.q, len(self._rows)
        self.spring = np.array([hand.spring for hand in scenario.hands])
        mechanism = self._arm.mechanism
        masses = np.array([hand.mass for hand in scenario.hands])
        gravity = np.array(mechanism.model.opt.gravity)[self._rows]
        self._weight = masses * gravity * float(mechanism.weighs)
        self._origin = self._arm.handle()[self._rows]

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        return self._arm.jacobian(q)[self._rows]

    def force(self, q: np.ndarray) -> np.ndarray:
        return self._weight - self.spring * (self._arm.handle(q)[self._rows] - self._origin)

    def static(self, q: np.ndarray) -> np.ndarray:
        pushed = self.jacobian(q).T @ self.force(q)
        moving = self._arm.mechanism.moving(np.zeros(len(q)))
        return pushed - moving.bias + moving.drag

    def slope(self, q: np.ndarray) -> np.ndarray:
        ways = STEP * np.eye(len(q))
        rows = [(self.static(q + way) - self.static(q - way)) / (2.0 * STEP) for way in ways]
        out = np.array(rows).T
        small = NOTHING * (1.0 + np.abs(self.static(q)).max())
        return np.where(np.abs(out) < small, 0.0, out)

    def inertia(self, q: np.ndarray) -> np.ndarray:
        return self._arm.mass_matrix(q)

    def damping(self, q: np.ndarray) -> np.ndarray:
        return self._arm.mechanism.at(q).damping


def resting_arm(scenario: Scenario) -> ClosedForm | FromFile:
    """The arm of a scenario."""
    return ClosedForm(scenario) if scenario.is_closed_form else FromFile(scenario)
