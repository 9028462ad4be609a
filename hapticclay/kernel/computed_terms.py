"""The terms of an arm that Python computes, some 0.3 ms a step; the kernel calls it by address.

Its chain is closed by constraints, soft in the engine and here exact; or some of its passive forces
are beyond a spring and a damper at each joint: polynomials, tendons, a fluid, weights in parts.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from ..arms.mechanism import Mechanism
from ..scene.scenario import Scenario


class ComputedTerms:
    """The functions that the kernel calls, which read and fill the arrays of a mover.

    Attributes:
        handle: place of the handle [m], and where it is tried.
    """

    def __init__(self, scenario: Scenario, places: dict[str, np.ndarray]):
        arm: Any = scenario.file_arm
        of, n = arm.mechanism, len(arm.names)
        self.chain = Mechanism(copy.copy(of.model), of.dofs, of.site, of.pose)
        self.rows = ["xyz".index(c) for c in arm.axes]
        self.pose, self.rates = places["pose"][:n], places["pose"][n:]
        self.inertia = places["joint_M"].reshape(n, n)
        self.dampers, self.drag = places["joint_D"].reshape(n, n), places["joint_F"]
        self.own_dampers = np.diag(arm.damping)
        self.J = places["joint_J"].reshape(3, n)
        self.bias, self.C = places["joint_bias"], places["joint_c"]
        self.scratch_J, self.held = places["scratch_J"].reshape(3, n), places["scratch_bias"]
        self.handle, self.scratch_handle = np.zeros(3), np.zeros(3)
        self.springs = [np.array(x) for x in of.springs]

    def at_pose(self, _: Any = None) -> None:
        """Inertia, dampers at rest, Jacobian and place of the handle."""
        found = self.chain.at(self.pose)
        self.inertia[:], self.dampers[:] = found.inertia, found.damping - self.own_dampers
        self.J[: len(self.rows)] = found.jacobian[self.rows]
        self.handle[:] = self.chain.handle_place()

    def at_rates(self, _: Any = None) -> None:
        """Bias torques, dampers and drag, and the handle's centripetal acceleration."""
        found = self.chain.moving(self.rates)
        self.dampers[:], self.drag[:] = found.damping - self.own_dampers, found.drag
        self.bias[:] = found.bias - self._own_springs()
        self.C[: len(self.rows)] = found.centripetal[self.rows]

    def at_scratch(self, _: Any = None) -> None:
        """Place and Jacobian of the handle, and the torques that hold the arm, at another pose."""
        here = self.chain.position
        found = self.chain.at(self.pose)
        self.scratch_J[: len(self.rows)] = found.jacobian[self.rows]
        self.scratch_handle[:] = self.chain.handle_place()
        self.held[:] = self.chain.weights()
        self.chain.put(here)

    def _own_springs(self) -> np.ndarray:
        """Torques of the springs of the arm's joints, which the kernel adds."""
        stiffness, rest = self.springs
        return stiffness * (self.chain.position[self.chain.dofs] - rest)
