"""Peers of the sampled loop with hardware: SciPy and plain MuJoCo, the same computer beside both.

The computer is plain Python: what one writes beside an engine. SciPy solves the arm under held
torques from event to event, an event being a sample or torques that arrive; its right-hand side is
compiled where numba is there. MuJoCo steps at its own dt; torques that arrive within a step act
from the next one on, and so does the clay behind a border.
"""

from __future__ import annotations

import functools
import importlib.util
import time
from collections import deque
from dataclasses import dataclass
from math import pi

import mujoco
import numpy as np
from scipy.integrate import DOP853, RK23
from scipy.linalg import expm
from scipy.optimize import brentq

import hapticclay as hc
from hapticclay.formulas.arm import inverse_kinematics
from hapticclay.model.constants import C_POLE, G
from hapticclay.model.hardware import butterworth

from ..study import Method, Run
from . import common, handle
from .common import Job

# a step of DOP853 over a whole interval between events is exact to rounding: it has no coarse end
SOLVERS = {RK23: (1e-4, 1e-6, 1e-8, 1e-10), DOP853: (1e-4, 1e-8, 1e-12)}


@dataclass(frozen=True)
class Loop:
    """A scene as numbers: the job, its clay, its hardware.

    Attributes:
        job: arm, operator, gains; b before and behind the border.
        border: along x [m]. physical: whether the clay acts on the handle itself.
        Ts: control sample [s]. hardware: as the scene has it.
        limit: torque limits [N.m].
    """

    job: Job
    border: float
    physical: bool
    Ts: float
    hardware: hc.Hardware
    limit: tuple[float, float]

    @classmethod
    def of(cls, s: hc.Scenario) -> Loop:
        assert s.clay is not None and s.operator and s.Ts and s.hardware
        assert s.clay.x == s.clay.y and s.hardware.velocity == "difference"
        assert not s.inertia_shaping and s.start == s.velocity == (0.0, 0.0)
        th = (s.operator.mass, s.operator.damper, s.operator.spring)
        job = Job(
            s.force, s.gain, th, s.clay.x.values, s.origin,
            inverse_kinematics(*s.origin, s.arm.links), s.t_max,
        )  # fmt: skip
        limit = (s.torque_limit[0], s.torque_limit[1])
        return cls(job, s.clay.x.edges[0], s.render == "physical", s.Ts, s.hardware, limit)

    def b(self, x: float) -> float:
        """Damping at x [N.s/m]."""
        return self.job.b[0] if x < self.border else self.job.b[1]


def level(x: float, step: float, half: int) -> float:
    """A converter's output: the nearest multiple of step, from -half to half - 1 of them."""
    return min(max(round(x / step), -half), half - 1) * step


class Computer:
    """What happens at a sample, from measured angles and force to the torques."""

    def __init__(self, loop: Loop):
        io, job = loop.hardware, loop.job
        self.loop, self.at, self.wants = loop, handle.kinematics(job), handle.servo(job)
        self.count = 2.0 * pi / io.encoder
        first = self.read(job.q)
        self.past = deque([first] * io.velocity_window, io.velocity_window)
        self.filter, self.lag = butterworth(io.force_filter, io.filter_order, loop.Ts), [0.0] * 4
        self.rows, self.state = [], [[0.0] * 4, [0.0] * 4]  # delta, delta', y, y' of an axis
        for K, g in zip(job.K, G, strict=True):
            A = np.zeros((5, 5))
            A[0, 1] = A[2, 3] = 1.0
            A[1, 1], A[1, 4] = -C_POLE, K
            A[3, :4] = g.gain, 0.0, -g.gain, -g.damping
            self.rows.append(expm(A * loop.Ts)[:4].tolist())

    def read(self, q):
        """Joint angles as the encoders read them [rad]."""
        return round(q[0] / self.count) * self.count, round(q[1] / self.count) * self.count

    def filtered(self, f):
        """The force after filter and converter [N]."""
        (a, b, c, d, e, g), x, io = self.filter, self.lag, self.loop.hardware
        out, half = (x[0], x[2]), 1 << (io.adc_bits - 1)
        for i in (0, 1):
            x0, x1 = x[2 * i], x[2 * i + 1]
            x[2 * i], x[2 * i + 1] = a * x0 + b * x1 + e * f[i], c * x0 + d * x1 + g * f[i]
        return tuple(level(y, io.adc_range / half, half) for y in out)

    def sample(self, q, fh, b):
        """Torques on the joints [N.m], from true joint angles, the hand's force and the clay."""
        io, (x, y) = self.loop.hardware, self.state
        q = self.read(q)
        old = self.past[0]
        self.past.append(q)
        span = io.velocity_window * self.loop.Ts
        w1, w2 = (q[0] - old[0]) / span, (q[1] - old[1]) / span
        u1, u2, p, v, c, W = self.at(q[0], q[0] + q[1], w1, w1 + w2)
        (ax, ay), _ = self.wants(p, v, (x[0], y[0]), (x[2], y[2]), (x[3], y[3]))
        fh, fe = self.filtered(fh), (b * v[0], b * v[1])
        fx, fy = fh[0] - fe[0], fh[1] - fe[1]
        # link torques diag(I1, I2) J^-1 (want - J' q') give W f beside f; held clay is theirs too
        ax, ay, det = ax - c[0], ay - c[1], u1[0] * u2[1] - u2[0] * u1[1]
        t1 = common.I1 * (ax * u2[1] - ay * u2[0]) / det
        t2 = common.I2 * (ay * u1[0] - ax * u1[1]) / det
        if not self.loop.physical:
            t1 -= u1[0] * fe[0] + u1[1] * fe[1]
            t2 -= u2[0] * fe[0] + u2[1] * fe[1]
        self.state = [
            [r[0] * z[0] + r[1] * z[1] + r[2] * z[2] + r[3] * z[3] + r[4] * f for r in rows]
            for rows, z, f in zip(self.rows, self.state, (fx, fy), strict=True)
        ]
        half = 1 << (io.dac_bits - 1)
        return tuple(
            level(min(max(t, -m), m), m / half, half)
            for t, m in zip((t1 + t2, t2), self.loop.limit, strict=True)
        )


def arm(loop: Loop, jit=handle.plain):
    """Return a function of link angles, rates, held torques and the clay that acts.

    It gives the accelerations of the links and the hand's force on the handle, x and y.
    """
    job = loop.job
    (m, d, k), (ux, uy) = job.th, job.uh
    at, solve = jit(handle.kinematics(job)), jit(handle.with_mass(job))
    I1, I2 = common.I1, common.I2

    def arm(a1, a2, n1, n2, t1, t2, b):
        u1, u2, p, v, c, W = at(a1, a2, n1, n2)
        hx, hy = ux - d * v[0] - k * p[0], uy - d * v[1] - k * p[1]
        rx, ry = hx - b * v[0], hy - b * v[1]
        l1, l2 = (t1 - t2) / I1, t2 / I2
        ax, ay = solve(
            W,
            u1[0] * l1 + u2[0] * l2 + c[0] + W[0] * rx + W[1] * ry,
            u1[1] * l1 + u2[1] * l2 + c[1] + W[1] * rx + W[2] * ry,
        )
        fx, fy = rx - m * ax, ry - m * ay
        l1, l2 = l1 + (u1[0] * fx + u1[1] * fy) / I1, l2 + (u2[0] * fx + u2[1] * fy) / I2
        return l1, l2, hx - m * ax, hy - m * ay

    return jit(arm)


# ---- SciPy ---------------------------------------------------------------------------------------


def right_hand_side(loop: Loop, is_compiled: bool):
    """The arm's accelerations and its right-hand side (z, torques, b), z = angles and rates."""
    if not is_compiled:
        move = arm(loop)

        def rhs(z, t1, t2, b):
            a1, a2, n1, n2 = z.tolist()
            l1, l2, _, _ = move(a1, a2, n1, n2, t1, t2, b)
            return np.array((n1, n2, l1, l2))

        return move, rhs
    from numba import njit

    move = arm(loop, njit)

    @njit
    def rhs(z, t1, t2, b):
        a1, a2, n1, n2 = z
        l1, l2, _, _ = move(a1, a2, n1, n2, t1, t2, b)
        return np.array((n1, n2, l1, l2))

    return move, rhs


def begin(how, rhs, z, span, tau, b):
    """SciPy's solver at the begin of a span under held torques; how: its class and rtol.

    The first step is the whole span, as one who knows it would choose.
    """
    (solver, rtol), (t1, t2) = how, tau
    return solver(
        lambda t, z: rhs(z, t1, t2, b), 0.0, z, span, rtol=rtol, atol=1e-2 * rtol, first_step=span
    )


def advanced(s):
    """The solver a step further."""
    s.step()
    if s.status == "failed":
        raise RuntimeError(f"{type(s).__name__} failed")
    return s


class Arm:
    """The arm between events under SciPy."""

    def __init__(self, loop: Loop, rhs, how):
        self.loop, self.rhs, self.how, self.b = loop, rhs, how, loop.job.b[0]
        q = loop.job.q
        self.z = np.array((q[0], q[0] + q[1], 0.0, 0.0))

    def go(self, span, tau):
        """Goes on for a span under held torques."""
        while span > 0.0:
            ahead = self.loop.physical and self.b == self.loop.job.b[0]
            acting = self.b if self.loop.physical else 0.0
            s, left = begin(self.how, self.rhs, self.z, span, tau, acting), 0.0
            while s.status == "running" and not left:
                z = advanced(s).y
                if ahead and self.beyond(z) >= 0.0:
                    z, left = self.at_border(s, span)
            self.z, span = z, left

    def beyond(self, z):
        """How far the handle is beyond the border [m]."""
        x = common.L1 * np.cos(z[0]) + common.L2 * np.cos(z[1])
        return x - self.loop.job.origin[0] - self.loop.border

    def at_border(self, s, span):
        """The state on the border within the last step, from where on the clay acts; time left."""
        dense = s.dense_output()
        t = brentq(lambda t: self.beyond(dense(t)), s.t_old, s.t, xtol=1e-15)
        self.b = self.loop.job.b[1]
        return dense(t), span - t


def solve_by_scipy(loop: Loop, parts, solver, rtol: float) -> Run:
    """One run of a solver of SciPy's with a relative tolerance."""
    move, rhs = parts
    n = round(loop.job.t_max / loop.Ts)
    places, note = np.full((n + 1, 2), np.nan), ""
    begin = time.perf_counter()
    body, computer = Arm(loop, rhs, (solver, rtol)), Computer(loop)
    tau, late, at = (0.0, 0.0), deque(), computer.at
    end = begin + common.WALL_LIMIT
    try:
        for k in range(n + 1):
            a1, a2, n1, n2 = body.z.tolist()
            p = at(a1, a2, n1, n2)[2]
            places[k] = p
            acting = body.b if loop.physical else 0.0
            fh = move(a1, a2, n1, n2, *tau, acting)[2:] if k else loop.job.uh
            now, following = k * loop.Ts, (k + 1) * loop.Ts
            torques = computer.sample((a1, a2 - a1), fh, loop.b(p[0]))
            late.append((now + loop.hardware.delay, torques))
            while late and late[0][0] < following:
                when, new = late.popleft()
                body.go(when - now, tau)
                now, tau = when, new
            body.go(following - now, tau)
            if time.perf_counter() > end:
                raise TimeoutError(f"more than {common.WALL_LIMIT:g} s of wall time")
    except Exception as error:  # noqa: BLE001  a result, not a crash
        note = f"{type(error).__name__}: {error}"
    return Run(places[1:], time.perf_counter() - begin, note)


# ---- MuJoCo --------------------------------------------------------------------------------------


def solve_by_mujoco(scene: hc.Scenario, loop: Loop, dt: float) -> Run:
    """One run with engine steps of dt, the torques of a sample in a queue."""
    every, n = round(loop.Ts / dt), round(loop.job.t_max / loop.Ts)
    model = hc.build(scene)
    model.opt.timestep = dt
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = mujoco.MjData(model)
    data.qpos[:] = loop.job.q
    angles, rates, drive, push = (
        memoryview(x) for x in (data.qpos, data.qvel, data.ctrl, data.qfrc_applied)
    )
    go, move, computer = mujoco.mj_step, arm(loop), Computer(loop)
    at, tau, late = computer.at, (0.0, 0.0), deque()
    places = np.full((n + 1, 2), np.nan)
    begin = time.perf_counter()
    for i in range(n * every + 1):
        q1, q2 = angles
        n1, w2 = rates
        a2, n2 = q1 + q2, n1 + w2
        p = at(q1, a2, n1, n2)[2]
        b = loop.b(p[0])
        acting = b if loop.physical else 0.0
        if i % every == 0:
            places[i // every] = p
            fh = move(q1, a2, n1, n2, *tau, acting)[2:] if i else loop.job.uh
            late.append((i * dt + loop.hardware.delay, computer.sample((q1, q2), fh, b)))
        while late and late[0][0] <= i * dt + 1e-9 * dt:
            tau = late.popleft()[1]
        hx, hy = move(q1, a2, n1, n2, *tau, acting)[2:]
        drive[0], drive[1] = tau
        drive[2] = drive[3] = acting
        push[0], push[1] = common.torques(hx, hy, q1, q2)
        go(model, data)
    return Run(places[1:], time.perf_counter() - begin)


def methods(scene: hc.Scenario, is_compiled: bool | None = None) -> list[Method]:
    """SciPy by rtol, MuJoCo by dt [s].

    Args:
        scene: of the problem.
        is_compiled: whether numba compiles SciPy's right-hand side; None where it is there.
    """
    loop = Loop.of(scene)
    if is_compiled is None:
        is_compiled = importlib.util.find_spec("numba") is not None
    move, rhs = parts = right_hand_side(loop, is_compiled)
    q1, q2 = loop.job.q
    rhs(np.array((q1, q1 + q2, 0.0, 0.0)), 0.0, 0.0, 0.0)  # before the clock runs
    move(q1, q1 + q2, 0.0, 0.0, 0.0, 0.0, 0.0)
    out = [
        Method(
            "SciPy",
            solver.__name__ + (", compiled" if is_compiled else ""),
            tolerances,
            functools.partial(solve_by_scipy, loop, parts, solver),
        )
        for solver, tolerances in SOLVERS.items()
    ]
    steps = tuple(loop.Ts / n for n in (1, 2, 4, 8, 16, 32))
    mujoco = functools.partial(solve_by_mujoco, scene, loop)
    return [*out, Method("MuJoCo, plain", "implicitfast", steps, mujoco)]
