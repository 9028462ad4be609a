"""The terms of an arm that Python computes, some 0.3 ms a step; the kernel calls it by address.

Its chain is closed by constraints, soft in the engine and here exact; or some of its passive forces
are beyond a spring and a damper at each joint: polynomials, tendons, a fluid, weights in parts.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

from ..arms.mechanism import Mechanism
from ..errors import ParameterError
from ..scene.scenario import Scenario


class ComputedTerms:
    """The functions that the kernel calls, which read and fill the arrays of a mover.

    Where a chain cannot be closed the terms are NaN, and the run ends.

    Attributes:
        handle: place of the handle [m], and where it is tried.
        failed: Ctrl-C and its like, which compiled code would drop; the terms are NaN from then
            on, too.
    """

    def __init__(self, scenario: Scenario, places: dict[str, np.ndarray]):
        self.failed: list[BaseException] = []
        arm: Any = scenario.file_arm
        of, n = arm.mechanism, len(arm.names)
        self.chain = Mechanism(copy.copy(of.model), of.dofs, of.site, of.pose)
        self.rows = ["xyz".index(c) for c in arm.axes]
        self.pose, self.rates = places["pose"][:n], places["pose"][n : 2 * n]
        self._calls, self._answers = places["pose"][2 * n :], 0.0
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
        self._try(self._at_pose, self.inertia, self.dampers, self.J, self.handle)

    def at_rates(self, _: Any = None) -> None:
        """Bias torques, dampers and drag, and the handle's centripetal acceleration."""
        self._try(self._at_rates, self.bias, self.dampers, self.drag, self.C)

    def at_scratch(self, _: Any = None) -> None:
        """Place and Jacobian of the handle, and the torques that hold the arm, at another pose."""
        self._try(self._at_scratch, self.held, self.scratch_J, self.scratch_handle)

    def _try(self, compute: Callable[[], None], *terms: np.ndarray) -> None:
        try:
            self._answers += 1.0
            self.note_dropped()
            if not self.failed:
                compute()
                return
        except (ParameterError, np.linalg.LinAlgError):
            pass  # there are no such terms
        except BaseException as error:
            self.failed.append(error)
        for array in terms:
            array[:] = np.nan

    def note_dropped(self) -> None:
        """Notes a call that Ctrl-C ended before it could be stored."""
        if not self.failed and self._answers != self._calls[0]:
            self.failed.append(KeyboardInterrupt())

    def forgive(self) -> None:
        """Begins anew after a failure."""
        self.failed.clear()
        self._answers = float(self._calls[0])

    def _at_pose(self) -> None:
        found = self.chain.at(self.pose)
        self.inertia[:], self.dampers[:] = found.inertia, found.damping - self.own_dampers
        self.J[: len(self.rows)] = found.jacobian[self.rows]
        self.handle[:] = self.chain.handle_place()

    def _at_rates(self) -> None:
        found = self.chain.moving(self.rates)
        self.dampers[:], self.drag[:] = found.damping - self.own_dampers, found.drag
        self.bias[:] = found.bias - self._own_springs()
        self.C[: len(self.rows)] = found.centripetal[self.rows]

    def _at_scratch(self) -> None:
        here = self.chain.position
        try:
            found = self.chain.at(self.pose)
            self.scratch_J[: len(self.rows)] = found.jacobian[self.rows]
            self.scratch_handle[:] = self.chain.handle_place()
            self.held[:] = self.chain.weights()
        finally:
            self.chain.put(here)

    def _own_springs(self) -> np.ndarray:
        """Torques of the springs of the arm's joints, which the kernel adds."""
        stiffness, rest = self.springs
        return stiffness * (self.chain.position[self.chain.dofs] - rest)
