"""Linear mechanics of a compiled MuJoCo model in the coordinates of an arm's joints.

Each joint of the model belongs to the arm, follows it through equality constraints, or is locked.
Constraints are projected out exactly, where the engine's own are soft.
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError

STEP = 1e-5  # [rad or m] of differences of static torques: 1e-10 of them is rounding
CLOSED = 1e-10  # [rad or m] a closed chain is closed within
MOST_CLOSING = 50  # Newton steps that close a chain
STILL = 1e-9  # [m] least motion of the handle per joint rate
POSES_TRIED, NEARBY = 8, 0.3  # poses at which the handle's motion is asked, rms off [rad or m]
DEPENDENT = 1e-9  # of the largest singular value: smaller ones belong to redundant constraints


class Linear(NamedTuple):
    """An arm linearised at a pose, n joints.

    Attributes:
        inertia: M, rotors included [kg.m^2 or kg], shape (n, n).
        damping: viscous damping of the joints [N.m.s/rad], shape (n, n).
        stiffness: springs of the joints [N.m/rad], shape (n, n).
        gravity_stiffness: change of the gravity torques with the joints [N.m/rad], shape (n, n).
        weight_stiffness: the same for a unit mass at the handle [N.m/rad/kg], shape (n, n).
        jacobian: velocity of the handle per joint rate [m], shape (3, n); of no use without handle.
    """

    inertia: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    gravity_stiffness: np.ndarray
    weight_stiffness: np.ndarray
    jacobian: np.ndarray


class Mechanism:
    """A compiled model with a choice of driven joints.

    Attributes:
        dofs: degree of freedom of each joint of the arm.
        following: degrees of freedom that constraints move with the arm.
        pose: position of each joint of the model that closes its chains at the arm's pose.
    """

    def __init__(self, model: Any, dofs: list[int], site: tuple[str, int] | None, pose: np.ndarray):
        from ..physics import mujoco

        self._mujoco, self._model, self._site = mujoco, model, site
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self._data = mujoco.MjData(model)
        self.dofs = list(dofs)
        self._place(pose)
        rows = self._constraints()[0]
        moved = [i for i in range(model.nv) if np.any(rows[:, i])] if len(rows) else []
        self.following = [i for i in moved if i not in self.dofs]
        self.pose = self._closed(pose)

    # ---- one pose

    def linear(self, q: np.ndarray) -> Linear:
        """The arm linearised at joint positions [rad or m], shape (n,).

        Raises:
            ParameterError: constraints cannot be satisfied there.
        """
        inertia, follow = self.inertia(q), self._follow()
        damping = follow.T @ (self._model.dof_damping[:, None] * follow)
        jacobian = self._jacobian() @ follow
        springs, gravity, weight = self._stiffness(q)
        return Linear(inertia, damping, springs, gravity, weight, jacobian)

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """M, rotors included [kg.m^2 or kg], shape (n, n).

        Raises:
            ParameterError: constraints cannot be satisfied there.
        """
        self._at(q)
        whole, follow = np.zeros((self._model.nv,) * 2), self._follow()
        self._mujoco.mj_fullM(self._model, self._data, whole)
        return follow.T @ whole @ follow

    def handle(self, q: np.ndarray) -> np.ndarray:
        """Position of the handle in the frame of the world [m], shape (3,)."""
        self._at(q)
        kind, number = self._site or ("body", 0)
        return np.array(getattr(self._data, "site_xpos" if kind == "site" else "xpos")[number])

    # ---- runs

    def axes(self) -> list[int]:
        """Axes of the world along which the handle can move, here or at poses nearby."""
        rng = np.random.default_rng(0)
        moves = np.zeros(3)
        for _ in range(POSES_TRIED):
            self._place(self.pose + rng.normal(0.0, NEARBY, len(self.pose)))
            moves = np.maximum(moves, np.abs(self._jacobian()[:, self.dofs]).max(axis=1))
        self._place(self.pose)
        return np.flatnonzero(moves > STILL).tolist()

    def runnable(self) -> Any:
        """A copy of the model in which nothing acts but inertia and gravity.

        Raises:
            ParameterError: constraints move joints, or gravity is compensated in a part of the file.
        """
        if self.following:
            bound = "must be an open chain in runs: its linear theory takes closed ones, too"
            raise ParameterError("arm", self._model.joint(self.following[0]).name, bound)
        model, bits = copy.copy(self._model), self._mujoco.mjtDisableBit
        for name in ("CONSTRAINT", "SENSOR", "EULERDAMP"):
            model.opt.disableflags |= getattr(bits, f"mjDSBL_{name}")
        model.jnt_stiffness[:], model.dof_damping[:] = 0.0, 0.0
        model.opt.integrator = self._mujoco.mjtIntegrator.mjINT_EULER
        shares = np.unique(model.body_gravcomp[model.body_mass > 0.0][1:])
        if not self.has_gravity or np.array_equal(shares, [1.0]):
            model.opt.gravity[:] = 0.0
        elif np.any(shares):
            raise ParameterError("gravcomp", shares.tolist(), "must be 0 or 1 in runs, of all bodies")
        model.body_gravcomp[:] = 0.0
        return model

    @property
    def has_gravity(self) -> bool:
        """Whether weights act."""
        off = self._model.opt.disableflags & self._mujoco.mjtDisableBit.mjDSBL_GRAVITY
        return not off and bool(np.any(self._model.opt.gravity))

    @property
    def springs(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness of each joint's spring [N.m/rad], and where it rests [rad]."""
        model, dofs = self._model, self.dofs
        return np.array(model.jnt_stiffness[dofs]), np.array(model.qpos_spring[dofs])

    @property
    def site(self) -> tuple[str, int] | None:
        """Kind, "site" or "body", and index of the handle."""
        return self._site

    # ---- the engine's terms

    def _place(self, position: np.ndarray) -> None:
        self._data.qpos[:], self._data.qvel[:] = position, 0.0
        self._mujoco.mj_fwdPosition(self._model, self._data)
        self._mujoco.mj_fwdVelocity(self._model, self._data)

    def _at(self, q: np.ndarray) -> None:
        """Places the arm, its followers where constraints hold."""
        position = self.pose.copy()
        position[self.dofs] = q
        self._closed(position)

    def _constraints(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the equality constraints, shape (m, nv), and how far each is from closed."""
        data, model = self._data, self._model
        equal = data.efc_type[: data.nefc] == int(self._mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        rows = np.array(data.efc_J).reshape(-1, model.nv)[: data.nefc][equal]
        return rows, np.array(data.efc_pos[: data.nefc][equal])

    def _closed(self, position: np.ndarray) -> np.ndarray:
        """Moves the followers by Newton's method until the constraints hold."""
        position = position.copy()
        for _ in range(MOST_CLOSING):
            self._place(position)
            rows, gap = self._constraints()
            if not self.following or np.abs(gap).max(initial=0.0) <= CLOSED:
                return position
            step = np.linalg.lstsq(rows[:, self.following], gap, rcond=None)[0]
            position[self.following] -= step
        raise ParameterError(
            "pose", position[self.dofs].tolist(), "must be one at which the chain can be closed"
        )

    def _follow(self) -> np.ndarray:
        """Rates of all joints per rate of the arm's, shape (nv, n); locked joints rest."""
        out = np.zeros((self._model.nv, len(self.dofs)))
        out[self.dofs, range(len(self.dofs))] = 1.0
        if self.following:
            rows = self._constraints()[0]
            own, rest = rows[:, self.following], rows[:, self.dofs]
            out[self.following] = -np.linalg.lstsq(own, rest, rcond=DEPENDENT)[0]
        return out

    def freedom(self) -> int:
        """Followers that the constraints leave free, and so no joint of the arm moves."""
        if not self.following:
            return 0
        own = self._constraints()[0][:, self.following]
        return len(self.following) - int(np.linalg.matrix_rank(own, DEPENDENT * np.abs(own).max()))

    def overclosed(self) -> bool:
        """Whether constraints hold joints of the arm against each other."""
        if not self.following:
            return bool(np.any(self._constraints()[0][:, self.dofs]))
        rows, follow = self._constraints()[0], self._follow()
        return bool(np.abs(rows @ follow).max() > 1e-6 * np.abs(rows).max())

    def _static(self) -> np.ndarray:
        """Torques that hold springs, gravity, and a unit mass at the handle, shape (3, n)."""
        data, up = self._data, -np.array(self._model.opt.gravity)
        every = -data.qfrc_spring, data.qfrc_bias - data.qfrc_gravcomp, up @ self._jacobian()
        return np.array(every) @ self._follow()

    def _stiffness(self, q: np.ndarray) -> np.ndarray:
        """Central differences of the static torques, shape (3, n, n)."""
        columns = []
        for j in range(len(self.dofs)):
            sides = []
            for sign in (1.0, -1.0):
                there = np.array(q, float)
                there[j] += sign * STEP
                self._at(there)
                sides.append(self._static())
            columns.append((sides[0] - sides[1]) / (2.0 * STEP))
        found = np.stack(columns, axis=2)
        return 0.5 * (found + found.transpose(0, 2, 1))

    def _jacobian(self) -> np.ndarray:
        out = np.zeros((3, self._model.nv))
        if self._site is not None:
            kind, number = self._site
            of = self._mujoco.mj_jacSite if kind == "site" else self._mujoco.mj_jacBody
            of(self._model, self._data, out, None, number)
        return out
