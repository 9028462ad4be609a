"""PyBullet: the arm from a URDF in DIRECT mode, torque control every step.

Clay and hand act as joint torques J' f from the measured state; the controller takes semi-implicit
Euler steps. PyBullet would otherwise add velocity motors, damping of 0.04 per link and its own
guess of the inertias: all off.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import pybullet

from . import common
from .common import I2, IZZ1, L1, MASS1, MASS2, Job, Result

NAME = "PyBullet"

URDF = f"""<robot name="ddarm">
  <link name="base"><inertial><mass value="0"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="link1"><inertial><mass value="{MASS1}"/>
    <inertia ixx="{IZZ1!r}" iyy="{IZZ1!r}" izz="{IZZ1!r}"
             ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="link2"><inertial><mass value="{MASS2}"/>
    <inertia ixx="{I2!r}" iyy="{I2!r}" izz="{I2!r}" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="link1"/>
    <axis xyz="0 0 1"/>
    <dynamics damping="0" friction="0"/></joint>
  <joint name="elbow" type="continuous"><parent link="link1"/><child link="link2"/>
    <axis xyz="0 0 1"/>
    <origin xyz="{L1!r} 0 0"/><dynamics damping="0" friction="0"/></joint>
</robot>"""


def methods() -> dict[str, list[float]]:
    """Method -> dt [s], coarse to fine."""
    return {"semi-implicit Euler": [2e-3, 1e-3, 3.6e-4, 1e-4]}


def _load(client: int, dt: float, q: tuple[float, float]) -> int:
    on = {"physicsClientId": client}
    pybullet.setGravity(0, 0, 0, **on)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=dt, numSubSteps=0, **on)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(URDF)
        arm = pybullet.loadURDF(
            str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, **on
        )
    for link in (-1, 0, 1):
        pybullet.changeDynamics(arm, link, linearDamping=0, angularDamping=0, jointDamping=0, **on)
    pybullet.setJointMotorControlArray(arm, [0, 1], pybullet.VELOCITY_CONTROL, forces=[0, 0], **on)
    for joint in (0, 1):
        pybullet.resetJointState(arm, joint, q[joint], 0.0, **on)
    return arm


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with steps of `setting`."""
    job = Job.of(problem)
    law, advance, c = common.law(job), common.advance(job, setting), [0.0] * 8
    client = pybullet.connect(pybullet.DIRECT)
    try:
        arm = _load(client, setting, job.q)
        states, torques, go = (
            pybullet.getJointStates,
            pybullet.setJointMotorControlArray,
            pybullet.stepSimulation,
        )
        joints, mode = [0, 1], pybullet.TORQUE_CONTROL

        def step():
            (q1, w1, _, _), (q2, w2, _, _) = states(arm, joints, client)
            px, py, vx, _, fx, fy, ax, ay, m1, m2, h1, h2, b = law(q1, q2, w1, w2, *c)
            torques(arm, joints, mode, forces=[m1 + h1, m2 + h2], physicsClientId=client)
            go(client)
            advance(c, fx, fy, ax, ay)
            return px, py, vx, b

        return common.march(job, setting, step)
    finally:
        pybullet.disconnect(client)
