"""Linear mechanics of a compiled MuJoCo model in the coordinates of an arm's joints.

Each joint of the model belongs to the arm, follows it through equality constraints, or is locked.
Constraints are projected out exactly, where the engine's own are soft.
"""

from __future__ import annotations

import copy
import hashlib
import threading
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError
from . import passive

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


class Resting(NamedTuple):
    """Terms of an arm at rest, n joints, as in `Linear`."""

    inertia: np.ndarray
    damping: np.ndarray
    jacobian: np.ndarray


class Moving(NamedTuple):
    """Terms of motion, n joints.

    Attributes:
        bias: torques of motion, weight and springs [N.m], shape (n,).
        centripetal: less the acceleration of the handle while the joints turn evenly [m/s^2], (3,).
        damping: dampers whose product with the rates is their torques [N.m.s/rad], shape (n, n).
        drag: torques of a fluid, but for what is in `damping` [N.m], shape (n,).
    """

    bias: np.ndarray
    centripetal: np.ndarray
    damping: np.ndarray
    drag: np.ndarray


class Sticks(NamedTuple):
    """A mechanism as a stick figure [m].

    Attributes:
        segments: ends of links, shape (m, 2, 3).
        joints: anchors of the moving joints, shape (k, 3).
        handle: place of the handle, shape (3,).
    """

    segments: np.ndarray
    joints: np.ndarray
    handle: np.ndarray


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
        self._own = threading.local()  # data of each thread
        self.dofs = list(dofs)
        self._place(pose)
        rows = self._constraints()[0]
        moved = [i for i in range(model.nv) if np.any(rows[:, i])] if len(rows) else []
        self.following = [i for i in moved if i not in self.dofs]
        self.pose = self._closed(pose)

    @property
    def _data(self) -> Any:
        """The engine's data, of this thread alone."""
        if not hasattr(self._own, "data"):
            self._own.data = self._mujoco.MjData(self._model)
        return self._own.data

    def __eq__(self, other: object) -> bool:
        """Whether it moves as another one does: models of the same numbers, the same joints."""
        if not isinstance(other, Mechanism):
            return NotImplemented
        return self.dofs == other.dofs and self._numbers == other._numbers

    def __hash__(self) -> int:
        return hash(tuple(self.dofs))

    @cached_property
    def _numbers(self) -> bytes:
        """A digest of the compiled model as the engine stores it."""
        out = np.empty(self._mujoco.mj_sizeModel(self._model), np.uint8)
        self._mujoco.mj_saveModel(self._model, None, out)
        return hashlib.blake2b(out.tobytes()).digest()

    # ---- one pose

    def linear(self, q: np.ndarray) -> Linear:
        """The arm linearised at joint positions [rad or m], shape (n,).

        Raises:
            ParameterError: constraints cannot be satisfied there.
        """
        inertia, damping, jacobian = self.at(q)
        springs, gravity, weight = self._stiffness(q)
        return Linear(inertia, damping, springs, gravity, weight, jacobian)

    def at(self, q: np.ndarray) -> Resting:
        """Places the arm, and returns its inertia, dampers and Jacobian there.

        Raises:
            ParameterError: constraints cannot be satisfied there.
        """
        self._at(q)
        whole, follow = np.zeros((self._model.nv,) * 2), self._follow()
        self._mujoco.mj_fullM(self._model, self._data, whole)
        damping = self._damping(np.zeros(self._model.nv)) + self._viscous()
        return Resting(follow.T @ whole @ follow, damping, self._jacobian() @ follow)

    def _damping(self, rates: np.ndarray) -> np.ndarray:
        """Dampers in the coordinates of the arm, at rates of all joints."""
        follow = self._follow()
        return follow.T @ passive.dampers(self._model, self._data, rates) @ follow

    def _viscous(self) -> np.ndarray:
        """A fluid's part of them, where the arm is."""
        if not passive.has_fluid(self._model):
            return np.zeros((len(self.dofs),) * 2)
        return passive.viscous(self._model, self._data, self._follow())

    def at_handle(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position of the handle and its Jacobian at joint positions, [m], (3,) and (3, n).

        Raises:
            ParameterError: constraints cannot be satisfied there.
        """
        self._at(q)
        return self.handle_place(), self._jacobian() @ self._follow()

    def handle(self, q: np.ndarray) -> np.ndarray:
        """Position of the handle in the frame of the world [m], shape (3,)."""
        self._at(q)
        return self.handle_place()

    # ---- runs

    @cached_property
    def axes(self) -> list[int]:
        """Axes of the world along which the handle can move, here or at poses nearby."""
        rng = np.random.default_rng(0)
        moves, q = np.zeros(3), self.pose[self.dofs]
        for _ in range(POSES_TRIED):
            try:
                moves = np.maximum(moves, np.abs(self.at(q).jacobian).max(axis=1))
            except ParameterError:  # a chain that cannot be closed there
                pass
            q = self.pose[self.dofs] + rng.normal(0.0, NEARBY, len(self.dofs))
        return np.flatnonzero(moves > STILL).tolist()

    @property
    def reach(self) -> list[float]:
        """Distance of the handle from each joint along its links, stretched [m]; 1 of a slide."""
        model, (kind, number) = self._model, self._site or ("body", 0)
        body, far, distances = self._held(), 0.0, dict[int, float]()
        if kind == "site":
            far = float(np.linalg.norm(model.site_pos[number]))
        while body:
            distances[body] = far
            far += float(np.linalg.norm(model.body_pos[body]))
            body = int(model.body_parentid[body])
        return [
            distances.get(int(model.dof_bodyid[dof]), far)
            + float(np.linalg.norm(model.jnt_pos[dof]))
            if turns
            else 1.0
            for dof, turns in zip(self.dofs, self.turning, strict=True)
        ]

    @property
    def turning(self) -> list[bool]:
        """Whether each joint of the arm turns; others slide."""
        slide = int(self._mujoco.mjtJoint.mjJNT_SLIDE)
        return [bool(self._model.jnt_type[dof] != slide) for dof in self.dofs]

    def runnable(self) -> Any:
        """A copy of the model in which nothing acts but inertia and weight."""
        model, bits = copy.copy(self._model), self._mujoco.mjtDisableBit
        for name in ("CONSTRAINT", "SENSOR", "EULERDAMP"):
            model.opt.disableflags |= getattr(bits, f"mjDSBL_{name}")
        model.jnt_stiffness[:], model.dof_damping[:], model.body_gravcomp[:] = 0.0, 0.0, 0.0
        if not self.weighs:
            model.opt.gravity[:] = 0.0
        return model

    @property
    def model(self) -> Any:
        """The compiled model."""
        return self._model

    @property
    def weighs(self) -> bool:
        """Whether weights act."""
        model = self._model
        return bool(np.any((passive.weight_shares(model) != 1.0)[model.body_mass > 0.0]))

    @property
    def is_computed(self) -> bool:
        """Whether Python computes its terms: machine code has open chains and linear laws."""
        model = self._model
        plain = passive.is_linear(model) and not passive.weighs_in_parts(model)
        return bool(self.following) or not plain

    @property
    def springs(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness of each joint's spring [N.m/rad], and where it rests [rad]."""
        model, dofs = self._model, self.dofs
        return np.array(model.jnt_stiffness[dofs]), np.array(model.qpos_spring[dofs])

    @property
    def site(self) -> tuple[str, int] | None:
        """Kind, "site" or "body", and index of the handle."""
        return self._site

    @property
    def position(self) -> np.ndarray:
        """Positions of all joints of the model, as last put [rad or m]."""
        return self._data.qpos.copy()

    def put(self, position: np.ndarray) -> None:
        """Puts all joints of the model to positions at which its constraints hold [rad or m]."""
        self._place(position)

    def moving(self, w: np.ndarray) -> Moving:
        """Terms of the arm's motion where `at` put it, at rates of its joints [rad/s]."""
        data, rates = self._data, self._follow() @ w
        drift = self._drift(rates) if self.following else np.zeros(self._model.nv)
        viscous = self._viscous()
        data.qvel[:] = rates
        self._mujoco.mj_fwdVelocity(self._model, data)
        whole, turned = np.zeros((self._model.nv,) * 2), np.zeros((3, self._model.nv))
        self._mujoco.mj_fullM(self._model, data, whole)
        place, body = self.handle_place(), self._held()
        self._mujoco.mj_jacDot(self._model, data, turned, None, place, body)
        torques = data.qfrc_bias - data.qfrc_spring - data.qfrc_gravcomp + whole @ drift
        return Moving(
            torques @ self._follow(),
            -(turned @ rates + self._jacobian() @ drift),
            self._damping(rates) + viscous,
            data.qfrc_fluid @ self._follow() + viscous @ w,
        )

    def weights(self) -> np.ndarray:
        """Torques that hold the arm against its weight where `at` put it [N.m], shape (n,)."""
        return (self._data.qfrc_bias - self._data.qfrc_gravcomp) @ self._follow()

    def taken(self, q: np.ndarray, w: np.ndarray) -> float:
        """Power that dampers and a fluid take at positions and rates of the joints [W]."""
        self._at(q)
        moving = self.moving(w)
        return float(w @ (moving.damping @ w - moving.drag))

    def energy(self, q: np.ndarray, w: np.ndarray) -> float:
        """Energy of motion, weight and springs at positions and rates of the joints [J]."""
        self._at(q)
        data = self._data
        data.qvel[:] = self._follow() @ w
        self._mujoco.mj_energyPos(self._model, data)
        self._mujoco.mj_fwdVelocity(self._model, data)
        self._mujoco.mj_energyVel(self._model, data)
        held = passive.weight_shares(self._model) * self._model.body_mass
        lifted = -float(held @ (data.xipos @ self._model.opt.gravity))
        lifted *= not self._model.opt.disableflags & self._mujoco.mjtDisableBit.mjDSBL_GRAVITY
        return float(data.energy.sum()) - lifted

    def _drift(self, rates: np.ndarray) -> np.ndarray:
        """Acceleration of the followers while the arm's joints turn evenly."""
        here, rows = self.position, []
        h = STEP / max(1.0, float(np.abs(rates).max()))
        for sign in (1.0, -1.0):
            self._place(here + sign * h * rates)
            rows.append(self._constraints()[0])
        self._place(here)
        turned = (rows[0] - rows[1]) @ rates / (2.0 * h)
        out = np.zeros(len(rates))
        own = self._constraints()[0][:, self.following]
        out[self.following] = -np.linalg.lstsq(own, turned, rcond=DEPENDENT)[0]
        return out

    def sticks(self, q: np.ndarray) -> Sticks:
        """The mechanism at joint positions as a stick figure.

        Raises:
            ParameterError: constraints cannot be satisfied there.
        """
        self._at(q)
        model, data = self._model, self._data
        moved = {int(model.dof_bodyid[i]) for i in (*self.dofs, *self.following)}
        nodes, moving, ends = np.array(data.xpos), set(), set(range(model.nbody))
        for body in range(1, model.nbody):
            first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            if count:
                nodes[body] = np.mean(data.xanchor[first : first + count], axis=0)
            if body in moved or int(model.body_parentid[body]) in moving:
                moving.add(body)
        segments = [(nodes[body], anchor) for body, anchor in self._anchors()]
        if self._site is not None:
            segments.append((nodes[self._held()], self.handle_place()))
            ends.discard(self._held())
        for body in sorted(moving):
            parent = int(model.body_parentid[body])
            ends.discard(parent)
            if parent:
                segments.append((nodes[parent], nodes[body]))
        ends -= {body for body, _ in self._anchors()}
        segments += [(nodes[body], np.array(data.xipos[body])) for body in sorted(moving & ends)]
        place = self.handle_place() if self._site is not None else segments[-1][1]
        return Sticks(np.array(segments), nodes[sorted(moved)], np.array(place))

    def _held(self) -> int:
        """Body that the hand holds."""
        kind, number = self._site or ("body", 0)
        return int(self._model.site_bodyid[number]) if kind == "site" else number

    def _anchors(self) -> list[tuple[int, np.ndarray]]:
        """Bodies, and places at which constraints tie them to others."""
        model, data, found = self._model, self._data, []
        connect, site = self._mujoco.mjtEq.mjEQ_CONNECT, self._mujoco.mjtObj.mjOBJ_SITE
        for k in range(model.neq):
            if model.eq_type[k] != connect:
                continue
            for i, number in enumerate((int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))):
                if model.eq_objtype[k] == site:
                    found.append((int(model.site_bodyid[number]), np.array(data.site_xpos[number])))
                    continue
                local = model.eq_data[k, 3 * i : 3 * i + 3]
                turn = np.reshape(data.xmat[number], (3, 3))
                found.append((number, data.xpos[number] + turn @ local))
        return [(body, place) for body, place in found if body]

    # ---- the engine's terms

    def handle_place(self) -> np.ndarray:
        kind, number = self._site or ("body", 0)
        return np.array(getattr(self._data, "site_xpos" if kind == "site" else "xpos")[number])

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
        here = self._data.qpos.tobytes()
        if getattr(self._own, "followed_at", None) != here:  # a step asks three times at a pose
            self._own.followed_at, self._own.follow = here, self._followed()
        return self._own.follow

    def _followed(self) -> np.ndarray:
        """`_follow`, computed."""
        out = np.zeros((self._model.nv, len(self.dofs)))
        out[self.dofs, range(len(self.dofs))] = 1.0
        if self.following:
            rows = self._constraints()[0]
            own, rest = rows[:, self.following], rows[:, self.dofs]
            out[self.following] = -np.linalg.lstsq(own, rest, rcond=DEPENDENT)[0]
        return out

    def follow(self) -> np.ndarray:
        """Rates of all joints per rate of the arm's where it was put last, shape (nv, n)."""
        return self._follow().copy()

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
        """Torques that hold springs (and wind), weight, a unit mass at the handle, (3, n)."""
        data, up = self._data, -np.array(self._model.opt.gravity)
        held = -data.qfrc_spring - data.qfrc_fluid
        every = held, data.qfrc_bias - data.qfrc_gravcomp, up @ self._jacobian()
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
