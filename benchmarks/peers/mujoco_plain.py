"""MuJoCo as one would use it at first: measure, compute, hold, mj_step; first order.

The clay is a damper actuator that the engine treats implicitly; its force on the controller is that
of the measured velocity; controller states take semi-implicit Euler steps; borders are noticed at
the next sample.
"""

from __future__ import annotations

import mujoco

from hapticclay import build

from . import common
from .common import PROBLEMS, Job, Result

NAME = "MuJoCo, plain"


def methods() -> dict[str, list[float]]:
    """Method -> dt [s], coarse to fine."""
    return {"implicitfast": [4e-3, 2e-3, 1e-3, 3.6e-4, 1e-4]}


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with steps of `setting`."""
    job = Job.of(problem)
    law, advance, c = common.law(job), common.advance(job, setting), [0.0] * 8
    model = build(PROBLEMS[problem])
    model.opt.timestep = setting
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{method.upper()}")
    data = mujoco.MjData(model)
    data.qpos[:] = job.q
    angles, rates, drive, push = (
        memoryview(x) for x in (data.qpos, data.qvel, data.ctrl, data.qfrc_applied)
    )
    go = mujoco.mj_step

    def step():
        q1, q2 = angles
        w1, w2 = rates
        px, py, vx, vy, fx, fy, ax, ay, m1, m2, h1, h2, b = law(q1, q2, w1, w2, *c)
        drive[0], drive[1], drive[2], drive[3] = m1, m2, b, b
        p1, p2 = common.torques(b * vx, b * vy, q1, q2)
        push[0], push[1] = h1 + p1, h2 + p2  # the clay is the dampers' business
        go(model, data)
        advance(c, fx, fy, ax, ay)
        return px, py, vx, b

    return common.march(job, setting, step)
