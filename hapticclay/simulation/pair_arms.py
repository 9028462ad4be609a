"""Arms of a pair as they run: a device as a slide, and drives as springs and dampers of joints."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arms import loading
from ..arms.joint_law import JointPD
from ..arms.mjcf_arm import MjcfArm
from ..errors import ParameterError
from ..model.arm import Arm
from ..model.operator import Operator
from ..scene.pair import Pair
from ..scene.scenario import Scenario
from ..scene.virtual_wall import Device

BALL = 0.01  # [m] of the body of a device, which has no other meaning


def run_arm(pair: Pair, i: int, acts: bool) -> MjcfArm:
    """An arm of a pair as it runs; acts: whether its joint law does.

    Raises:
        ParameterError: it is the two-link arm in closed form, which has no such run.
    """
    arm, law = pair.arms[i], pair.laws[i]
    if isinstance(arm, Arm):
        bound = "must be an arm from a file, as planar_2r, or a device, in runs"
        raise ParameterError(("leader", "follower")[i], arm, bound)
    drive = law if acts and law.runs == "drive" else None
    if isinstance(arm, Device):
        return _slide(arm, drive)
    return arm if drive is None else _driven(arm, drive)


def _slide(device: Device, drive: JointPD | None) -> MjcfArm:
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
    return MjcfArm(spec)


def _driven(arm: MjcfArm, drive: JointPD) -> MjcfArm:
    """The arm with springs at its pose and dampers in place of drives."""
    spec = loading.spec_of(arm.file)[0]
    for name, Kp, q in zip(arm.names, drive.Kp, arm.q, strict=True):
        joint = spec.joint(name)
        if np.any(joint.stiffness):
            bound = "must have no spring where its drive runs the law"
            raise ParameterError("joint", name, bound)
        joint.stiffness, joint.springref = [Kp, 0.0, 0.0], float(q)
    damping = dict(zip(arm.names, np.add(np.array(arm.damping), drive.Kd).tolist(), strict=True))
    of_arm = {name: getattr(arm, name) for name in ("armature", "friction")}
    per_joint = {k: dict(zip(arm.names, x, strict=True)) for k, x in of_arm.items()}
    own: Any = {"site": arm.site, "joints": arm.names, "pose": dict(arm.pose)}  # type: ignore[arg-type]
    return MjcfArm(spec, damping=damping, gravity=arm.gravity, **per_joint, **own)


def run_scene(pair: Pair, i: int, arm: MjcfArm, **more: Any) -> Scenario:
    """The scenario of an arm of a pair, whose torques are given step by step.

    Raises:
        ParameterError: the contact acts along one axis of an arm with more.
    """
    none = (0.0,) * pair.n
    carried = pair.leader_operator
    if i == 1:
        clay = pair.follower_clay
        if clay is not None and clay.axis is not None and pair.n > 1:
            bound = "must be None in runs: a contact acts along all axes"
            raise ParameterError("contact.axis", clay.axis, bound)
        carried = None if clay is None else Operator(clay.mass, clay.B, clay.K)
    return Scenario(
        name=("leader", "follower")[i],
        arm=arm,
        controller=JointPD(none, none, gravity=False),
        control="sampled",
        operator=carried,
        stop_when_unstable=False,
        **more,
    )
