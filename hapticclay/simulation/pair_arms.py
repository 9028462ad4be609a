"""Arms of a pair as they run: with what they carry and touch, their drives, their hardware."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..arms import model_file
from ..arms.joint_law import JointPD
from ..arms.mjcf_arm import MjcfArm
from ..errors import ParameterError
from ..model.arm import Arm
from ..model.clay import Clay
from ..model.hardware import Hardware
from ..model.operator import NO_HAND, Operator
from ..scene.contact import Contact
from ..scene.link import ENDS
from ..scene.pair import NOMINAL, Pair, axes_of, linear_arm
from ..scene.scenario import Scenario
from ..scene.virtual_wall import Device

BALL = 0.01  # [m] of the body of a device, which has no other meaning
STRONG = (1e6, 1e6)  # [N.m] motors of a two-link arm without limits
MOST_PARTS = 40  # engine steps of a control sample that are tried


def run_arm(pair: Pair, i: int, acts: bool) -> MjcfArm | Arm:
    """An arm of a pair as it runs; acts: whether its joint law does."""
    arm, law, given = pair.arms[i], pair.laws[i], pair.hardware[i]
    drive = law if acts and law.runs == "drive" else None
    if isinstance(arm, Arm) and drive is None:
        return arm
    if isinstance(arm, Arm):
        arm = _two_links(arm, given.friction if given else (0.0, 0.0))
    elif isinstance(arm, Device):
        limit = given.dac_range if given and given.dac_range else None
        return _slide(arm, drive, limit and limit[0])
    return arm if drive is None else _driven(arm, drive)


def _slide(device: Device, drive: JointPD | None, limit: float | None = None) -> MjcfArm:
    """A mass on a slide, with what its drive does."""
    from ..physics import mujoco

    spec = mujoco.MjSpec()
    spec.modelname, spec.option.gravity = "device", [0.0, 0.0, 0.0]
    body = spec.worldbody.add_body(name="handle")
    joint = body.add_joint(name="x", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])
    joint.damping, joint.frictionloss = [device.damper, 0.0, 0.0], device.friction
    size = [BALL, 0.0, 0.0]
    kind = mujoco.mjtGeom.mjGEOM_SPHERE
    body.add_geom(type=kind, size=size, mass=device.mass, contype=0, conaffinity=0)
    body.add_site(name="handle")
    if drive is not None:
        joint.stiffness = [drive.Kp[0], 0.0, 0.0]
        joint.damping = [device.damper + drive.Kd[0], 0.0, 0.0]
    return MjcfArm(spec, torque_limit=None if limit is None else [limit])


def _two_links(arm: Arm, friction: tuple[float, float]) -> MjcfArm:
    """The two-link arm as a model, elbow square."""
    from ..kernel.engine import compose_spec  # imported only for drives

    spec = compose_spec(["arm.xml"], arm)
    for motor in list(spec.actuators):
        spec.delete(motor)
    return MjcfArm(spec, site="handle", pose=NOMINAL, friction=friction)


def _driven(arm: MjcfArm, drive: JointPD) -> MjcfArm:
    """The arm with springs at its pose and dampers in place of drives."""
    from ..physics import mujoco

    spec = model_file.spec_of(arm.file)[0]
    for name, Kp, q in zip(arm.names, drive.Kp, arm.q, strict=True):
        joint = spec.joint(name)
        if np.any(joint.stiffness):
            bound = "must have no spring where its drive runs the law"
            raise ParameterError("joint", name, bound)
        turns = joint.type == mujoco.mjtJoint.mjJNT_HINGE and spec.compiler.degree
        rest = math.degrees(q) if turns else float(q)
        joint.stiffness, joint.springref = [Kp, 0.0, 0.0], rest
    damping = dict(zip(arm.names, np.add(np.array(arm.damping), drive.Kd).tolist(), strict=True))
    of_arm = {name: getattr(arm, name) for name in ("armature", "friction")}
    per_joint = {k: dict(zip(arm.names, x, strict=True)) for k, x in of_arm.items()}
    own: Any = {"site": arm.site, "joints": arm.names, "pose": dict(arm.pose)}  # type: ignore[arg-type]
    own["plane"] = arm.plane
    return MjcfArm(spec, damping=damping, gravity=arm.gravity, **per_joint, **own)


# ---- the scene of an arm -------------------------------------------------------------------------


def run_scene(pair: Pair, i: int, arm: MjcfArm | Arm, **more: Any) -> Scenario:
    """The scenario of an arm of a pair, whose torques are given step by step.

    Raises:
        ParameterError: it cannot run with what it touches.
    """
    arm, clay, operator = _carried(pair, i, arm)
    if clay is not None and clay.yields and _has_friction(arm):
        bound = "must be 0 where clay yields, in runs"
        raise ParameterError(f"{ENDS[i]}.friction", arm.friction, bound)  # type: ignore[union-attr]
    if isinstance(arm, MjcfArm):
        none = (0.0,) * pair.n
        more["controller"] = JointPD(none, none, gravity=False)
    else:
        more |= {"gain": (0.0, 0.0), "force": (0.0, 0.0), "length": None}
        more |= {"origin": (arm.l2, arm.l1), "torque_limit": STRONG}
    hardware = _acting(pair.hardware[i], arm)
    if hardware and hardware.dac_range and isinstance(arm, Arm):
        more["torque_limit"] = hardware.dac_range
    return Scenario(
        name=ENDS[i],
        arm=arm,
        clay=clay,
        control="sampled",
        render="physical",
        operator=operator,
        hardware=hardware,
        stop_when_unstable=False,
        **more,
    )


def least_parts(pair: Pair) -> int:
    """Engine steps of a control sample that clay needs: none takes more than the handle's rate.

    Raises:
        ParameterError: clay is too stiff for the most there may be.
    """
    parts = 1
    for i, name in enumerate(ENDS):
        touched = pair.touched[i]
        if isinstance(touched, Contact):
            touched = touched.wall if touched.unilateral else None
        if touched is None:
            continue
        linear = linear_arm(pair.arms[i])
        J = linear.jacobian
        mobility = float(np.trace(J @ np.linalg.solve(linear.inertia, J.T)))
        share = touched.largest * pair.Ts * mobility
        if share > MOST_PARTS:
            most = MOST_PARTS / (pair.Ts * mobility)
            bound = f"must be damped by at most {most:.4g} N.s/m at this rate, in runs"
            raise ParameterError(f"pair.{name}_clay", touched.largest, bound)
        parts = max(parts, math.ceil(share))
    return parts


def _has_friction(arm: Any) -> bool:
    return isinstance(arm, MjcfArm) and any(arm.friction)  # type: ignore[arg-type]


def _carried(pair: Pair, i: int, arm: Any) -> tuple[Any, Clay | None, Any]:
    """The arm, its plane as what it touches needs it, the clay, and what moves along with it."""
    hand, touched = pair.operators[i], pair.touched[i]
    if not isinstance(touched, Contact):
        return arm, touched, hand
    at = 0 if touched.axis is None else axes_of(arm).index(touched.axis)
    if at > 1 or (at == 1 and len(axes_of(arm)) > 2 and not touched.unilateral):
        arm, at = _facing(arm, touched.axis, i), 0
    if not touched.unilateral:
        return arm, None, _moved_along(hand, touched, at)
    wall = touched.wall
    return arm, wall if at == 0 else Clay(wall.y, replace(wall.x, along="y")), hand


def _facing(arm: MjcfArm, axis: Any, i: int) -> MjcfArm:
    """An arm from a file with an axis of the world as the first of its plane."""
    if i == 0:
        bound = f"must be {arm.axes[0]} in runs, where the muscle acts in the plane {arm.axes[:2]}"
        raise ParameterError("contact.axis", axis, bound)
    return replace(arm, plane=axis + next(c for c in arm.axes if c != axis))


def _moved_along(hand: Operator | None, contact: Contact, at: int) -> Any:
    """The hand and an object that the handle never leaves, as one, or one for each axis."""
    own = hand or NO_HAND
    both = Operator(own.mass + contact.mass, own.damper + contact.B, own.spring + contact.K)
    if contact.axis is None:
        return both
    return (hand, both) if at else (both, hand)


def _acting(given: Hardware | None, arm: MjcfArm | Arm) -> Hardware | None:
    """Hardware of the motors, which acts step by step; what is measured acts in the host."""
    if given is None:
        return None
    friction = given.friction if isinstance(arm, Arm) else (0.0, 0.0)
    span = given.dac_range if isinstance(arm, Arm) else None
    return Hardware(dac_bits=given.dac_bits, dac_range=span, friction=friction)
