"""The gains that the actuators of a file have, as a law of the arm's joints.

An actuator of length l pulls with -kp l - kv l' about its set point, whatever its gear and
transmission; its moment arms carry both to the joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

DCMOTOR_KP, DCMOTOR_KI, DCMOTOR_KD = 4, 5, 6  # places in gainprm
SMALL = 1e-9  # of the largest moment arm: smaller ones are none


class ServoGains(NamedTuple):
    """Gains of a file.

    Attributes:
        Kp: stiffness of each joint [N.m/rad], shape (n,).
        Kd: damping of each joint [N.m.s/rad], shape (n,).
        taken: what they are, in words; "" if the file has none.
        notes: what of the actuators takes no part in them, a sentence each.
        dt: step of the file's simulation, at which it runs its servos [s].
        integrator: of that simulation, as MJCF calls it.
    """

    Kp: tuple[float, ...]
    Kd: tuple[float, ...]
    taken: str
    notes: tuple[str, ...]
    dt: float
    integrator: str


class _Servo(NamedTuple):
    """An actuator: gains along its length [N/m or N.m/rad, ...], what it is, what is left out."""

    kp: float
    kv: float
    kind: str
    leaves: str = ""


def servo_gains(
    model: Any, position: np.ndarray, follow: np.ndarray, names: Sequence[str]
) -> ServoGains:
    """The gains that a model's actuators give the joints of an arm.

    Args:
        model: compiled of the whole file, where damping ratios are resolved.
        position: of all its joints, as in qpos.
        follow: rates of its degrees of freedom per rate of the arm's joints, shape (nv, n).
        names: the arm's joints.
    """
    arms = _moment_arms(model, position) @ follow
    Kp, Kd = np.zeros((2, len(names)))
    kinds: dict[str, list[str]] = {}
    left: dict[str, list[str]] = {}
    for i in range(model.nactuator):
        arm = arms[int(model.actuator_outadr[i])]
        moved = np.flatnonzero(np.abs(arm) > SMALL * np.abs(arm).max(initial=0.0))
        servo = _servo(model, i)
        if not moved.size or servo is None:
            continue
        name = model.actuator(i).name or f"actuator {i + 1}"
        if moved.size > 1 and servo.kind:
            left.setdefault("servos that pull at several joints take no part", []).append(name)
            continue
        if servo.leaves:
            left.setdefault(servo.leaves, []).append(name)
        if servo.kind:
            j = int(moved[0])
            Kp[j] += servo.kp * arm[j] ** 2
            Kd[j] += servo.kv * arm[j] ** 2
            kinds.setdefault(servo.kind, []).append(names[j])
    taken = "; ".join(f"{kind} at {_joint_words(at, names)}" for kind, at in kinds.items())
    notes = [f"{what}: {', '.join(which)}" for what, which in left.items()]
    return ServoGains(
        tuple(Kp.tolist()), tuple(Kd.tolist()), taken, tuple(notes), *_simulation(model)
    )


def _joint_words(at: Sequence[str], names: Sequence[str]) -> str:
    own = list(dict.fromkeys(at))
    return "all joints" if len(own) == len(names) > 1 else ", ".join(own)


def _simulation(model: Any) -> tuple[float, str]:
    from ..physics import mujoco

    name = str(mujoco.mjtIntegrator(model.opt.integrator).name).removeprefix("mjINT_")
    return float(model.opt.timestep), {"EULER": "Euler", "RK4": "RK4"}.get(name, name.lower())


def _moment_arms(model: Any, position: np.ndarray) -> np.ndarray:
    """Change of each actuator's length with each degree of freedom, a row an output."""
    from ..physics import mujoco

    data = mujoco.MjData(model)
    data.qpos[:] = position
    mujoco.mj_fwdPosition(model, data)
    out = np.zeros((len(data.moment_rownnz), model.nv))
    if out.size:
        mujoco.mju_sparse2dense(
            out, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
    return out


def _servo(model: Any, i: int) -> _Servo | None:
    """What an actuator is; None for one that only pushes as it is told, or is off."""
    from ..physics import mujoco

    gain, bias = mujoco.mjtGain, mujoco.mjtBias
    if model.opt.disableactuator >> int(model.actuator_group[i]) & 1:
        return None
    prm, of_gain = model.actuator_biasprm[i], model.actuator_gainprm[i]
    kinds = int(model.actuator_gaintype[i]), int(model.actuator_biastype[i])
    if kinds[0] == int(gain.mjGAIN_DCMOTOR):
        return _motor(model, i)
    if kinds[1] != int(bias.mjBIAS_AFFINE):
        return None
    kp, kv = 0.0 - float(prm[1]), 0.0 - float(prm[2])
    if not kp and not kv:
        return None
    if min(kp, kv) < 0.0:
        return _Servo(0.0, 0.0, "", "actuators with a negative gain take no part")
    if kinds[0] == int(gain.mjGAIN_AFFINE) and np.any(of_gain[1:3]):
        return _Servo(0.0, 0.0, "", "servos whose gain changes with their command take no part")
    integral = kinds[0] == int(gain.mjGAIN_PID) and bool(of_gain[0])
    leaves = "integral action (ki) takes no part" if integral else ""
    return _Servo(kp, kv, "position servos" if kp else "velocity servos", leaves)


def _motor(model: Any, i: int) -> _Servo:
    """A DC motor: its controller delivers the torque of a PD, up to its limits."""
    of_gain, of_dyn = model.actuator_gainprm[i], model.actuator_dynprm[i]
    kp, kd = float(of_gain[DCMOTOR_KP]), float(of_gain[DCMOTOR_KD])
    if not kp and not kd:
        return _Servo(0.0, 0.0, "", "the back-EMF of motors without controller takes no part")
    lags = "electrical lag" * bool(of_dyn[0]) + ", " * bool(of_dyn[0] and of_gain[DCMOTOR_KI])
    lags += "integral action" * bool(of_gain[DCMOTOR_KI])
    return _Servo(kp, kd, "controllers of motors", f"{lags} takes no part" if lags else "")


def without_gains(gains: ServoGains, names: Sequence[str]) -> Iterator[str]:
    """Joints to which a file gives no gain, of one that gives some."""
    rows = zip(names, gains.Kp, gains.Kd, strict=True)
    if bare := [name for name, kp, kd in rows if not kp and not kd]:
        yield f"no gains in the file, 0 taken: {', '.join(bare)}"
