"""Plain MuJoCo: the joints of an arm in a file as it is, all other joints held where they are."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hapticclay.physics import warnings_caught

HOME = "home"
FEWEST = 8  # steps of RK4 in a sample ...
STIFFEST = 0.5  # ... and the largest product of a step and a rate of decay by joint damping
SIZES = 1e-6, 1e-4, 1e-4  # differences of positions [rad], rates [rad/s], torques per inertia


class HeldArm:
    """MuJoCo's M(q), bias and passive forces of some joints of a file.

    Args:
        file: MJCF or URDF file that MuJoCo loads.
        arm: names of the joints, and the pose of all.

    Raises:
        ValueError: MuJoCo does not load it, or other joints follow those of the arm.
    """

    def __init__(self, file: Path, arm: Any):
        if arm.mechanism.following:
            raise ValueError("joints that follow")
        with warnings_caught(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            spec = mujoco.MjSpec.from_file(str(file))
            spec.compiler.fusestatic = False  # fused, a link without mass loses its inertia
            self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        keys = [self.model.key(i).name for i in range(self.model.nkey)]
        if HOME in keys:
            self.data.qpos[:] = self.model.key_qpos[keys.index(HOME)]
        joints = {self.model.joint(j).name: j for j in range(self.model.njnt)}
        for name, q in arm.pose.items():
            if name in joints:
                self.data.qpos[self.model.jnt_qposadr[joints[name]]] = q
        if missing := [x for x in arm.names if x not in joints]:
            raise ValueError(f"no joint of the name {missing[0]}")
        self.places = self.model.jnt_qposadr[[joints[x] for x in arm.names]]
        self.dofs = self.model.jnt_dofadr[[joints[x] for x in arm.names]]
        self.steps = FEWEST
        self.home = arm.q
        if Path(file).suffix == ".urdf":  # MuJoCo reads no rotors of transmissions
            self.model.dof_armature[self.dofs] = arm.armature

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """M(q) of the joints, shape (n, n)."""
        self._place(q, np.zeros(len(q)))
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return full[np.ix_(self.dofs, self.dofs)]

    def weight(self, q: np.ndarray) -> np.ndarray:
        """Torques against gravity [N.m]."""
        self._place(q, np.zeros(len(q)))
        return (self.data.qfrc_bias - self.data.qfrc_gravcomp)[self.dofs]

    def _place(self, q: np.ndarray, qd: np.ndarray) -> None:
        self.data.qpos[self.places], self.data.qvel[:] = q, 0.0
        self.data.qvel[self.dofs] = qd
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def _rates(self, state: np.ndarray, torque: np.ndarray) -> np.ndarray:
        q, qd = state
        inertia = self.inertia(q)
        self._place(q, qd)
        force = torque + (self.data.qfrc_passive - self.data.qfrc_bias)[self.dofs]
        return np.array([qd, np.linalg.solve(inertia, force)])

    def steps_of(self, Ts: float) -> int:
        """Steps of RK4 in a sample."""
        damping = np.diag(self.model.dof_damping[self.dofs].reshape(len(self.dofs), -1)[:, 0])
        rates = np.abs(np.linalg.eigvals(np.linalg.solve(self.inertia(self.home), damping)))
        return max(FEWEST, int(np.ceil(rates.max() * Ts / STIFFEST)))

    def sample(self, state: np.ndarray, torque: np.ndarray, Ts: float) -> np.ndarray:
        """Positions and rates, shape (2, n), after a sample under held torques."""
        h = Ts / self.steps
        for _ in range(self.steps):
            a = self._rates(state, torque)
            b = self._rates(state + 0.5 * h * a, torque)
            c = self._rates(state + 0.5 * h * b, torque)
            d = self._rates(state + h * c, torque)
            state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        return state

    def radius(self, law: Any, scale: float, Ts: float) -> float:
        """Spectral radius of a sample about the pose: torques a sample late, all Kp times scale."""
        n, self.steps = len(self.home), self.steps_of(Ts)
        Kp, Kd = scale * np.array(law.Kp), np.array(law.Kd)
        M = self.inertia(self.home)
        sizes = np.array([SIZES[0]] * n + [SIZES[1]] * n + [*(SIZES[2] * np.diag(M) / Ts)])
        rest = np.concatenate((self.home, np.zeros(n), self.weight(self.home)))

        def after(z: np.ndarray) -> np.ndarray:
            q, qd, held = z[:n], z[n : 2 * n], z[2 * n :]
            torque = self.weight(q) - Kp * (q - self.home) - Kd * qd
            return np.concatenate((*self.sample(np.array([q, qd]), held, Ts), torque))

        steps = np.diag(sizes)
        columns = [(after(rest + d) - after(rest - d)) / (2.0 * d.sum()) for d in steps]
        return float(np.abs(np.linalg.eigvals(np.array(columns).T)).max())


def urdf_inertia(file: Path, arm: Any) -> np.ndarray | None:
    """Pinocchio's M(q) of the arm's joints in a URDF, which needs no meshes; None if it cannot."""
    text = file.read_text(errors="replace")
    if "<robot" not in text or arm.mechanism.following:
        return None
    try:
        import pinocchio as pin  # type: ignore[import-not-found]
    except ImportError:
        return None
    try:
        model = pin.buildModelFromXML(text)
    except ValueError:  # a link that is not declared
        return None
    data, q = model.createData(), pin.neutral(model)
    for name, value in arm.pose.items():
        if model.existJointName(name):
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                value if joint.nq == 1 else (np.cos(value), np.sin(value))
            )
    full = np.triu(pin.crba(model, data, q))
    full += np.triu(full, 1).T
    ids = [model.joints[model.getJointId(x)].idx_v for x in arm.names]
    return full[np.ix_(ids, ids)] + np.diag(arm.armature)
