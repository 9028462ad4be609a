"""What all peers share: job, closed loop, crossings, result.

The formulas are those of docs/equations.md (sections 2 and 3, without shaping); every constant is
hapticclay's.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import cos, sin

import numpy as np

from hapticclay import build, free
from hapticclay.formulas.arm import inverse_kinematics
from hapticclay.model.arm import PAPER
from hapticclay.model.constants import C_POLE, L1, L2, G, S

from ..problems import EDGES, PROBLEMS, Result

I1, I2 = PAPER.I1, PAPER.I2
WALL_LIMIT = 60.0  # [s] of wall time for one run
MASS1, MASS2 = (
    float(m) for m in build(free()).body_mass[1:]
)  # [kg]; only I1 and I2 matter to the motion
IZZ1 = (
    I1 - MASS2 * L1**2
)  # [kg.m^2] of link 1 about the shoulder, link 2 being a balanced mass at the elbow
GRID = 0.01  # [s] samples of solvers with dense output


@dataclass(frozen=True)
class Job:
    """One problem as numbers:

    uh, K per axis, Th = m s^2 + d s + k, b in the three regions between EDGES.
    """

    uh: tuple[float, float]
    K: tuple[float, float]
    th: tuple[float, float, float]
    b: tuple[float, ...]
    origin: tuple[float, float]
    q: tuple[float, float]  # joint angles at the start [rad]; everything else starts at zero
    t_max: float

    @classmethod
    def of(cls, problem: str) -> Job:
        s = PROBLEMS[problem]
        assert (
            s.clay is not None
            and s.clay.x == s.clay.y
            and s.clay.x.edges == EDGES[:2]
            and s.length == EDGES[2]
        )
        assert not s.inertia_shaping and s.start == (0.0, 0.0)
        o = s.operator
        th = (o.mass, o.damper, o.spring) if o else (0.0, 0.0, 0.0)
        return cls(
            s.force,
            s.gain,
            th,
            s.clay.x.values,
            s.origin,
            inverse_kinematics(*s.origin, s.arm.links),
            s.t_max,
        )


def law(job: Job):
    """The control law and the hand at one instant.

    Returns a function of joint angles and rates (relative), compensator (delta, rate), reference
    model (y, rate) and, where the caller knows it, the damping b (else b at x). It gives
    (p, v, f, y'', motor torques, joint torques of the hand force f), each a pair, flat, then b.
    """
    (m, d, k), (ux, uy), (ox, oy) = job.th, job.uh, job.origin
    (b0, b1, b2), (e0, e1, _) = job.b, EDGES
    (gx, gy), (sx, sy) = G, S
    g0x, g1x, g0y, g1y = gx.gain, gx.damping, gy.gain, gy.damping
    s0x, s1x, s0y, s1y = sx.stiffness, sx.damping, sy.stiffness, sy.damping

    def law(q1, q2, w1, w2, dx, dy, ex, ey, yx, yy, rx, ry, b=None):  # noqa: PLR0913  # flat: fast
        a2, n2 = q1 + q2, w1 + w2  # absolute angle and rate of link 2
        u1x, u1y, u2x, u2y = -L1 * sin(q1), L1 * cos(q1), -L2 * sin(a2), L2 * cos(a2)
        px, py = u1y + u2y - ox, -u1x - u2x - oy
        vx, vy = u1x * w1 + u2x * n2, u1y * w1 + u2y * n2
        if b is None:
            b = b0 if px < e0 else b1 if px < e1 else b2
        ax, ay = g0x * (dx - yx) - g1x * rx, g0y * (dy - yy) - g1y * ry  # y''
        wx = ax + s1x * (rx - vx) + s0x * (yx - px)  # what the servo wants for p''
        wy = ay + s1y * (ry - vy) + s0y * (yy - py)
        fx, fy = ux - (d + b) * vx - k * px, uy - (d + b) * vy - k * py
        if m:  # p'' = want + W f,  f = rest - m p''
            Wxx, Wxy = u1x * u1x / I1 + u2x * u2x / I2, u1x * u1y / I1 + u2x * u2y / I2
            Wyy = u1y * u1y / I1 + u2y * u2y / I2
            cx, cy = wx + Wxx * fx + Wxy * fy, wy + Wxy * fx + Wyy * fy
            A, B, D = 1.0 + m * Wxx, m * Wxy, 1.0 + m * Wyy
            n = m / (A * D - B * B)
            fx, fy = fx - n * (D * cx - B * cy), fy - n * (A * cy - B * cx)
        # motors: J' Lambda (want - J' q') = diag(I1, I2) J^-1 (...) in absolute angles
        cx, cy = wx + u1y * w1 * w1 + u2y * n2 * n2, wy - u1x * w1 * w1 - u2x * n2 * n2
        det = u1x * u2y - u2x * u1y
        t1, t2 = I1 * (cx * u2y - cy * u2x) / det, I2 * (cy * u1x - cx * u1y) / det
        h2 = u2x * fx + u2y * fy
        return px, py, vx, vy, fx, fy, ax, ay, t1 + t2, t2, u1x * fx + u1y * fy + h2, h2, b

    return law


def torques(fx: float, fy: float, q1: float, q2: float) -> tuple[float, float]:
    """Joint torques J' f of a force at the handle."""
    t2 = L2 * (cos(q1 + q2) * fy - sin(q1 + q2) * fx)
    return t2 + L1 * (cos(q1) * fy - sin(q1) * fx), t2


def ode(job: Job):
    """Return rhs(t, z, b) of the arm in absolute link angles, on plain floats.

    Its inertia there is diag(I1, I2).

    z = (theta1, theta2, rates, delta, delta', y, y'), 12 numbers. Raises TimeoutError after
    WALL_LIMIT.
    """
    from_arm, (Kx, Ky), clock = law(job), job.K, time.perf_counter
    end = clock() + WALL_LIMIT

    def rhs(t, z, b=None):
        if clock() > end:
            raise TimeoutError(f"more than {WALL_LIMIT:g} s of wall time at t = {t:.3g} s")
        a1, a2, w1, w2, dx, dy, ex, ey, yx, yy, rx, ry = z.tolist()
        o = from_arm(a1, a2 - a1, w1, w2 - w1, dx, dy, ex, ey, yx, yy, rx, ry, b)
        _, _, _, _, fx, fy, ax, ay, t1, t2, h1, h2, _ = o
        n2 = t2 + h2
        n1 = t1 + h1 - n2
        return [
            w1,
            w2,
            n1 / I1,
            n2 / I2,
            ex,
            ey,
            Kx * fx - C_POLE * ex,
            Ky * fy - C_POLE * ey,
            rx,
            ry,
            ax,
            ay,
        ]

    return rhs


def compiled_ode(job: Job):
    """`ode` as machine code:

    numba compiles the same `law`; with its array, and without a limit of wall time.
    """
    from numba import njit

    from_arm, (Kx, Ky) = njit(law(job)), job.K

    @njit
    def rhs(t, z, b):
        a1, a2, w1, w2, dx, dy, ex, ey, yx, yy, rx, ry = z
        o = from_arm(a1, a2 - a1, w1, w2 - w1, dx, dy, ex, ey, yx, yy, rx, ry, b)
        _, _, _, _, fx, fy, ax, ay, t1, t2, h1, h2, _ = o
        n2 = t2 + h2
        n1 = t1 + h1 - n2
        return np.array(
            [
                w1,
                w2,
                n1 / I1,
                n2 / I2,
                ex,
                ey,
                Kx * fx - C_POLE * ex,
                Ky * fy - C_POLE * ey,
                rx,
                ry,
                ax,
                ay,
            ]
        )

    return rhs


def initial(job: Job) -> np.ndarray:
    """The state of `ode` at the start."""
    z = np.zeros(12)
    z[:2] = job.q[0], job.q[0] + job.q[1]
    return z


def of_states(job: Job, z: np.ndarray):
    """Handle position (n, 2) and velocity (n, 2) of states (n, >= 4) of `ode`."""
    c, s, w = np.cos(z[:, :2]) * (L1, L2), np.sin(z[:, :2]) * (L1, L2), z[:, 2:4]
    p = np.stack((c.sum(1), s.sum(1)), 1) - job.origin
    return p, np.stack((-(s * w).sum(1), (c * w).sum(1)), 1)


def advance(job: Job, h: float):
    """A semi-implicit Euler step of the controller:

    list of its eight states, changed in place, from f and y''.
    """
    (Kx, Ky) = job.K

    def advance(c, fx, fy, ax, ay):
        c[2] += h * (Kx * fx - C_POLE * c[2])
        c[3] += h * (Ky * fy - C_POLE * c[3])
        c[6] += h * ax
        c[7] += h * ay
        c[0] += h * c[2]
        c[1] += h * c[3]
        c[4] += h * c[6]
        c[5] += h * c[7]

    return advance


def march(job: Job, h: float, step) -> Result:
    """Runs a fixed step solver until x passes the last edge.

    step() returns (px, py, vx, b) at t and goes on to t + h.
    """
    samples: list[tuple] = []
    put, clock, last = samples.append, time.perf_counter, EDGES[-1]
    note = ""
    begin = clock()
    end = begin + WALL_LIMIT
    try:
        for _ in range(int(job.t_max / h) + 1):
            now = step()
            put(now)
            if not now[0] < last:  # or not a number
                break
            if clock() > end:
                raise TimeoutError(f"more than {WALL_LIMIT:g} s of wall time")
        else:
            note = f"x < {last:g} m at t_max"
    except Exception as error:  # noqa: BLE001  a result, not a crash, whatever the engine does
        note = f"{type(error).__name__}: {error}"
    wall = clock() - begin
    a = np.array(samples, float).reshape(-1, 4)
    if not note and not np.isfinite(a).all():
        note = "not a number"
    note = note or blown_up(a[:, 0])
    t = h * np.arange(len(a))
    return Result(linear(t, a[:, 0]), t, a[:, :2], a[:, 3] * a[:, 2], a[:, 2], wall, note)


def blown_up(x: np.ndarray) -> str:
    """Return a note if x jumps by a quarter of the path within a step; else "".

    No run of these jobs does.
    """
    return "blow-up" if len(x) > 1 and np.abs(np.diff(x)).max() > EDGES[-1] / 4 else ""


def linear(t: np.ndarray, x: np.ndarray) -> list[float]:
    """First times at which the samples x pass EDGES, by linear interpolation."""
    out = []
    for edge in EDGES:
        i = int(np.argmax(x >= edge)) if len(x) else 0
        if i == 0:
            break
        out.append(float(t[i - 1] + (edge - x[i - 1]) / (x[i] - x[i - 1]) * (t[i] - t[i - 1])))
    return out


def hermite(t: np.ndarray, x: np.ndarray, v: np.ndarray) -> list[float]:
    """First times at which x passes EDGES, by cubic interpolation of the samples."""
    from scipy.interpolate import CubicHermiteSpline
    from scipy.optimize import brentq

    out = []
    for edge in EDGES:
        i = int(np.argmax(x >= edge)) if len(x) else 0
        if i == 0:
            break
        s = CubicHermiteSpline(t[i - 1 : i + 1], x[i - 1 : i + 1], v[i - 1 : i + 1])
        out.append(float(brentq(lambda u, s=s, edge=edge: s(u) - edge, t[i - 1], t[i], xtol=1e-14)))
    return out
