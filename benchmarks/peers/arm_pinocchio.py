"""Pinocchio: `pin.aba` in a loop in Python moves an arm from a file under held torques."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

import hapticclay as hc

from .arm_mechanics import PinocchioArm as Read

NAME = "Pinocchio"
CASES = (
    *(("semi-implicit Euler", n) for n in (1, 4, 16, 64)),
    *(("RK4", n) for n in (1, 4)),
)


class PinocchioArm:
    """A serial arm; armature is the model's, damping is added to the torques.

    Args:
        file: MJCF file.
        method: of `CASES`.
        Ts: control sample [s].
        substeps: steps in it.
    """

    def __init__(self, file: Path, method: str, Ts: float, substeps: int):
        self.model = Read(file, hc.MjcfArm(file)).model
        self.data, self.substeps, self.h = self.model.createData(), substeps, Ts / substeps
        self.damping = np.array(self.model.damping)
        self.step = self._rk4 if method == "RK4" else self._euler

    def start(self, q: np.ndarray) -> None:
        """At rest at positions q."""
        self.q, self.qd = np.array(q, float), np.zeros(self.model.nv)

    def weight(self) -> np.ndarray:
        """Torques against the arm's weight [N.m]."""
        return pin.computeGeneralizedGravity(self.model, self.data, self.q).copy()

    def hold(self, torque: np.ndarray, samples: int = 1) -> None:
        """Goes on for control samples under a torque."""
        for _ in range(samples * self.substeps):
            self.step(torque)

    def mass_matrix(self) -> np.ndarray:
        """M(q) [kg.m^2], armature included."""
        return np.linalg.inv(pin.computeMinverse(self.model, self.data, self.q))

    def _acceleration(self, q: np.ndarray, v: np.ndarray, torque: np.ndarray) -> np.ndarray:
        return pin.aba(self.model, self.data, q, v, torque - self.damping * v).copy()

    def _euler(self, torque: np.ndarray) -> None:
        self.qd = self.qd + self.h * self._acceleration(self.q, self.qd, torque)
        self.q = self.q + self.h * self.qd

    def _rk4(self, torque: np.ndarray) -> None:
        q, v, h = self.q, self.qd, self.h
        v1, a1 = v, self._acceleration(q, v, torque)
        v2 = v + 0.5 * h * a1
        a2 = self._acceleration(q + 0.5 * h * v1, v2, torque)
        v3 = v + 0.5 * h * a2
        a3 = self._acceleration(q + 0.5 * h * v2, v3, torque)
        v4 = v + h * a3
        a4 = self._acceleration(q + h * v3, v4, torque)
        self.q = q + h / 6.0 * (v1 + 2.0 * (v2 + v3) + v4)
        self.qd = v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)


make = PinocchioArm
