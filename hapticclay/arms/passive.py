"""Passive forces of a compiled model: springs, dampers, fluid, compensated weight, friction.

MuJoCo lets flags and actuators change what joints and tendons say of themselves. Here that is
settled once, after which the fields of joints and tendons hold all that acts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .actuators import gear

STILL = 1e-9  # rate of a follower per rate of a joint that does not move it
CREEP = 1e-7  # [rad/s or m/s] rates of differences of a fluid's forces


def settle(model: Any) -> None:
    """Applies the flags of a file, and adds what its actuators give to what they drive."""
    from ..physics import mujoco

    bits = mujoco.mjtDisableBit
    _move_actuators(model)
    springs, dampers = (
        not model.opt.disableflags & int(bit) for bit in (bits.mjDSBL_SPRING, bits.mjDSBL_DAMPER)
    )
    if not springs:
        for name in ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness"):
            getattr(model, name)[:] = 0.0
        model.tendon_stiffnesspoly[:] = 0.0
    if not dampers:
        for name in ("dof_damping", "dof_dampingpoly", "tendon_damping", "tendon_dampingpoly"):
            getattr(model, name)[:] = 0.0
    if not springs and not dampers:  # as the engine has it
        model.body_gravcomp[:] = 0.0
        model.opt.density = model.opt.viscosity = 0.0
    model.opt.disableflags &= ~int(bits.mjDSBL_SPRING | bits.mjDSBL_DAMPER)
    if model.opt.disableflags & int(bits.mjDSBL_FRICTIONLOSS | bits.mjDSBL_CONSTRAINT):
        model.dof_frictionloss[:], model.tendon_frictionloss[:] = 0.0, 0.0
    if model.opt.disableflags & int(bits.mjDSBL_LIMIT | bits.mjDSBL_CONSTRAINT):
        model.jnt_limited[:], model.tendon_limited[:] = 0, 0
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER  # a run integrates in its own way
    model.opt.enableflags = 0


def _move_actuators(model: Any) -> None:
    """Adds armature and damping of actuators, times gear^2, to their joints and tendons."""
    from ..physics import mujoco

    kinds, joint = mujoco.mjtTrn, {int(mujoco.mjtTrn.mjTRN_JOINT)}
    joint.add(int(kinds.mjTRN_JOINTINPARENT))
    for i in range(model.nactuator):
        at, kind = int(model.actuator_trnid[i, 0]), int(model.actuator_trntype[i])
        if kind in joint:
            of, at = "dof", int(model.jnt_dofadr[at])
        elif kind == int(kinds.mjTRN_TENDON):
            of = "tendon"
        else:
            continue
        for name in ("armature", "damping", "dampingpoly"):
            own = getattr(model, f"actuator_{name}")
            getattr(model, f"{of}_{name}")[at] += own[i] * gear(model, i) ** 2
            own[i] = 0.0


# ---- dampers -------------------------------------------------------------------------------------


def is_linear(model: Any) -> bool:
    """Whether springs and dampers of joints are linear, and nothing else is passive."""
    poly = (model.jnt_stiffnesspoly, model.dof_dampingpoly)
    return not (any(map(np.any, poly)) or _tendons_act(model) or has_fluid(model))


def _tendons_act(model: Any) -> bool:
    names = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "armature")
    return any(np.any(getattr(model, f"tendon_{name}")) for name in names)


def has_fluid(model: Any) -> bool:
    """Whether a fluid acts on the bodies."""
    return bool(model.opt.density or model.opt.viscosity)


def dampers(model: Any, data: Any, rates: np.ndarray) -> np.ndarray:
    """Matrix of all dampers whose product with the rates is their torques, shape (nv, nv)."""
    out = np.diag(_secant(model.dof_damping, model.dof_dampingpoly, rates))
    if np.any(model.tendon_damping) or np.any(model.tendon_dampingpoly):
        J = tendon_jacobian(model, data)
        out += (J.T * _secant(model.tendon_damping, model.tendon_dampingpoly, J @ rates)) @ J
    return out


def _secant(linear: np.ndarray, higher: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Torque of dampers a v + b v |v| + c v^3 per rate."""
    size = np.abs(rates)
    return linear + size * (higher[:, 0] + size * higher[:, 1])


def tendon_jacobian(model: Any, data: Any) -> np.ndarray:
    """Rate of the tendons' lengths per joint rate, shape (ntendon, nv)."""
    out = np.zeros((model.ntendon, model.nv))
    for i, (first, count) in enumerate(zip(model.ten_J_rowadr, model.ten_J_rownnz, strict=True)):
        row = slice(int(first), int(first) + int(count))
        out[i, model.ten_J_colind[row]] = np.ravel(data.ten_J)[row]
    return out


def viscous(model: Any, data: Any, follow: np.ndarray) -> np.ndarray:
    """Torques of a fluid per rate of the arm's joints around rest, less, shape (n, n).

    The symmetric part, which is all of them without wind.
    """
    from ..physics import mujoco

    columns = []
    for rates in follow.T:
        sides = []
        for sign in (CREEP, -CREEP):
            data.qvel[:] = sign * rates
            mujoco.mj_fwdVelocity(model, data)
            sides.append(data.qfrc_fluid @ follow)
        columns.append((sides[1] - sides[0]) / (2.0 * CREEP))
    data.qvel[:] = 0.0
    mujoco.mj_fwdVelocity(model, data)
    return 0.5 * (np.array(columns) + np.array(columns).T)


# ---- weight --------------------------------------------------------------------------------------


def weight_shares(model: Any) -> np.ndarray:
    """Share of each body's weight that is compensated, shape (nbody,): 1 without gravity."""
    from ..physics import mujoco

    off = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    if off or not np.any(model.opt.gravity):
        return np.ones(model.nbody)
    return np.array(model.body_gravcomp)


def weighs_in_parts(model: Any) -> bool:
    """Whether the weights of some bodies are compensated, and of others not, or not wholly."""
    shares = np.unique(weight_shares(model)[model.body_mass > 0.0]).tolist()
    return shares not in ([], [0.0], [1.0])


# ---- friction ------------------------------------------------------------------------------------


def carry_friction(model: Any, dofs: list[int], following: list[int], follow: np.ndarray) -> None:
    """Moves Coulomb friction of followers to the joint that moves them, by its ratio.

    follow: rates of all joints per rate of the arm's, shape (nv, n). What several joints move keeps
    its friction, which no joint of the arm can bear.
    """
    loss = model.dof_frictionloss
    for i in following:
        movers = np.flatnonzero(np.abs(follow[i]) > STILL)
        if len(movers) == 1:
            loss[dofs[movers[0]]] += abs(follow[i, movers[0]]) * loss[i]
            loss[i] = 0.0
