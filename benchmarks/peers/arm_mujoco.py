"""Plain MuJoCo: the engine's own integrators move an arm from a file under held torques."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np


class MujocoArm:
    """An arm without joint friction and joint stops.

    Args:
        file: MJCF file.
        integrator: of the engine, as mjINT_EULER.
        Ts: control sample [s].
        substeps: steps of the engine in it.
    """

    def __init__(self, file: Path, integrator: str, Ts: float, substeps: int):
        self.model = mujoco.MjModel.from_xml_path(str(file))
        self.model.dof_frictionloss[:], self.model.jnt_limited[:] = 0.0, 0
        self.model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
        self.model.opt.timestep = Ts / substeps
        self.substeps = substeps
        self.data, self.static = mujoco.MjData(self.model), mujoco.MjData(self.model)

    def start(self, q: np.ndarray) -> None:
        """At rest at positions q."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = q

    @property
    def q(self) -> np.ndarray:
        """Positions of the joints [rad]."""
        return self.data.qpos.copy()

    @property
    def qd(self) -> np.ndarray:
        """Their rates [rad/s]."""
        return self.data.qvel.copy()

    def weight(self) -> np.ndarray:
        """Torques against the arm's weight [N.m]."""
        self.static.qpos[:] = self.data.qpos
        mujoco.mj_fwdPosition(self.model, self.static)
        mujoco.mj_fwdVelocity(self.model, self.static)
        return self.static.qfrc_bias.copy()

    def hold(self, torque: np.ndarray, samples: int = 1) -> None:
        """Goes on for control samples under a torque."""
        self.data.qfrc_applied[:] = torque
        mujoco.mj_step(self.model, self.data, samples * self.substeps)

    def mass_matrix(self) -> np.ndarray:
        """M(q) [kg.m^2]."""
        mujoco.mj_fwdPosition(self.model, self.data)
        out = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, out)
        return out
