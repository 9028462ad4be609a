"""Pinocchio: pin.aba for the arm, a Python loop for time and controller.

"semi-implicit Euler" is the loop that most robot controllers are simulated with, "RK4" the
classical one.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from . import common
from .common import C_POLE, I2, IZZ1, L1, MASS1, MASS2, Job, Result

NAME = "Pinocchio"


def methods() -> dict[str, list[float]]:
    """Method -> dt [s], coarse to fine."""
    return {"semi-implicit Euler": [2e-3, 1e-3, 3.6e-4, 1e-4], "RK4": [4e-3, 2e-3, 1e-3, 3.6e-4]}


def build() -> pin.Model:
    """The arm: both centres of mass on their joint's axis."""
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    zero = np.zeros(3)
    j1 = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "shoulder")
    model.appendBodyToJoint(j1, pin.Inertia(MASS1, zero, IZZ1 * np.eye(3)), pin.SE3.Identity())
    j2 = model.addJoint(
        j1, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([L1, 0.0, 0.0])), "elbow"
    )
    model.appendBodyToJoint(j2, pin.Inertia(MASS2, zero, I2 * np.eye(3)), pin.SE3.Identity())
    return model


def _euler(job: Job, h: float, model: pin.Model, data: pin.Data):
    law, advance, aba = common.law(job), common.advance(job, h), pin.aba
    q, w, tau, c = np.array(job.q), np.zeros(2), np.zeros(2), [0.0] * 8

    def step():
        px, py, vx, _, fx, fy, ax, ay, m1, m2, h1, h2, b = law(*q.tolist(), *w.tolist(), *c)
        tau[:] = m1 + h1, m2 + h2
        w[:] += h * aba(model, data, q, w, tau)
        q[:] += h * w
        advance(c, fx, fy, ax, ay)
        return px, py, vx, b

    return step


def _rk4(job: Job, h: float, model: pin.Model, data: pin.Data):
    law, aba, (Kx, Ky) = common.law(job), pin.aba, job.K
    z, tau = np.zeros(12), np.zeros(2)
    z[:2] = job.q

    def rate(z):
        q1, q2, w1, w2, dx, dy, ex, ey, yx, yy, rx, ry = z.tolist()
        o = law(q1, q2, w1, w2, dx, dy, ex, ey, yx, yy, rx, ry)
        _, _, _, _, fx, fy, ax, ay, m1, m2, h1, h2, _ = o
        tau[:] = m1 + h1, m2 + h2
        a1, a2 = aba(model, data, z[:2], z[2:4], tau).tolist()
        return np.array(
            (w1, w2, a1, a2, ex, ey, Kx * fx - C_POLE * ex, Ky * fy - C_POLE * ey, rx, ry, ax, ay)
        ), o

    def step():
        nonlocal z
        k1, o = rate(z)
        k2, _ = rate(z + (0.5 * h) * k1)
        k3, _ = rate(z + (0.5 * h) * k2)
        k4, _ = rate(z + h * k3)
        z = z + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
        return o[0], o[1], o[2], o[12]

    return step


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with steps of `setting`."""
    job, model = Job.of(problem), build()
    make = {"semi-implicit Euler": _euler, "RK4": _rk4}[method]
    return common.march(job, setting, make(job, setting, model, model.createData()))
