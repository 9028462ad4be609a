"""Peers of the loop in clay that yields, each axis on its own: SciPy with modes, SciPy regularised.

With modes: an axis slides either way or is held; DOP853 stops where a sliding axis comes to rest or
where the clay can no longer hold one, and goes on in the mode that fits. Regularised:
Fy tanh(v/eps) in place of Fy v/|v|, under solvers for stiff equations; a held axis creeps, so eps
bounds the error, and the smaller it is, the stiffer the equation.
"""

from __future__ import annotations

import functools
import importlib.util
import time
from dataclasses import dataclass
from math import cos, tanh

import numpy as np
from scipy.integrate import solve_ivp

import hapticclay as hc
from hapticclay.formulas.arm import inverse_kinematics
from hapticclay.model.constants import C_POLE

from ..study import Method, Run
from . import common, handle
from .common import Job

# eps [m/s] and rtol of each solver, in all pairs
REGULARISED = {
    "LSODA": ((1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8), (1e-3, 1e-4, 1e-6, 1e-8, 1e-10)),
    "BDF": ((1e-2, 1e-3, 1e-4, 1e-5, 1e-6), (1e-3, 1e-4, 1e-6, 1e-8)),
    "Radau": ((1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7), (1e-3, 1e-4, 1e-6, 1e-8)),
}
LONGEST = 0.1  # [s] a longer step of the solver would pass over short stops
MANY = 10_000  # changes of mode that no run here has


@dataclass(frozen=True)
class Loop:
    """A scene as numbers: the job in clay of one region, its yield force, and the muscle signal.

    Attributes:
        job: arm, operator, gains, b.
        Fy: yield force of each axis [N].
        lines: of the muscle signal: amplitude of x and y [N], omega [rad/s], phase of x and y.
    """

    job: Job
    Fy: float
    lines: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, s: hc.Scenario) -> Loop:
        assert s.clay is not None and s.operator and isinstance(s.muscle, hc.Multisine)
        (Fy, K, _), wave = s.clay.x.flows, s.muscle
        assert not s.clay.isotropic and s.clay.x == s.clay.y and not s.clay.x.edges
        assert not np.any(K) and not s.inertia_shaping and s.start == s.velocity == (0.0, 0.0)
        th = (s.operator.mass, s.operator.damper, s.operator.spring)
        job = Job(
            s.force, s.gain, th, s.clay.x.values, s.origin,
            inverse_kinematics(*s.origin, s.arm.links), s.t_max,
        )  # fmt: skip
        (ax, ay), phases = wave.amplitude, wave.phase
        lines = [
            (float(ax), float(ay), float(w), float(a), float(b))
            for w, a, b in zip(wave.omega, *phases.T, strict=True)
        ]
        return cls(job, float(np.max(Fy)), tuple(lines))


def push(loop: Loop):
    """Return the muscle force as a function of time, x and y [N]."""
    (ux, uy), lines = loop.job.uh, loop.lines

    def push(t):
        x, y = ux, uy
        for ax, ay, w, a, b in lines:
            x, y = x + ax * cos(w * t + a), y + ay * cos(w * t + b)
        return x, y

    return push


def loaded(loop: Loop, jit):
    """Return a function of t and a state, before yielding: all that acts, and what a force does.

    z = (theta1, theta2, rates, delta, delta', y, y') as in common.ode.
    """
    (_, d, k), b = loop.job.th, loop.job.b[0]
    at, solve = jit(handle.kinematics(loop.job)), jit(handle.with_mass(loop.job))
    wants, uh = jit(handle.servo(loop.job)), jit(push(loop))

    def loaded(t, z):
        a1, a2, n1, n2, dx, dy, _, _, yx, yy, rx, ry = z
        u1, u2, p, v, c, W = at(a1, a2, n1, n2)
        want, y2 = wants(p, v, (dx, dy), (yx, yy), (rx, ry))
        ux, uy = uh(t)
        rest = ux - (d + b) * v[0] - k * p[0], uy - (d + b) * v[1] - k * p[1]
        acc = solve(
            W,
            want[0] + W[0] * rest[0] + W[1] * rest[1],
            want[1] + W[1] * rest[0] + W[2] * rest[1],
        )
        xx, yx_ = solve(W, W[0], W[1])
        _, yy_ = solve(W, W[1], W[2])
        return u1, u2, v, c, rest, acc, (xx, yx_, yy_), y2

    return jit(loaded)


def rates(loop: Loop, jit):
    """Return the rates of the state from `loaded` and the yield force (fx, fy)."""
    m, (Kx, Ky) = loop.job.th[0], loop.job.K

    def rates(z, parts, fx, fy):
        _, _, n1, n2, _, _, ex, ey, _, _, rx, ry = z
        u1, u2, _, c, rest, acc, B, y2 = parts
        ax, ay = acc[0] - B[0] * fx - B[1] * fy, acc[1] - B[1] * fx - B[2] * fy
        netx, nety = rest[0] - fx - m * ax, rest[1] - fy - m * ay
        cx, cy, det = ax - c[0], ay - c[1], u1[0] * u2[1] - u2[0] * u1[1]
        return (
            n1, n2, (cx * u2[1] - cy * u2[0]) / det, (cy * u1[0] - cx * u1[1]) / det,
            ex, ey, Kx * netx - C_POLE * ex, Ky * nety - C_POLE * ey, rx, ry, y2[0], y2[1],
        )  # fmt: skip

    return jit(rates)


def yielding(Fy: float):
    """Return a function of `loaded` and of the way of each axis: the yield force.

    A way is 1.0 or -1.0, or 0.0 for an axis that the clay holds.
    """

    def force(parts, wx, wy):
        acc, B = parts[5], parts[6]
        fx, fy = wx * Fy, wy * Fy
        if wx == 0.0 and wy == 0.0:
            det = B[0] * B[2] - B[1] * B[1]
            return (B[2] * acc[0] - B[1] * acc[1]) / det, (B[0] * acc[1] - B[1] * acc[0]) / det
        if wx == 0.0:
            return (acc[0] - B[1] * fy) / B[0], fy
        if wy == 0.0:
            return fx, (acc[1] - B[1] * fx) / B[2]
        return fx, fy

    return force


def equations(loop: Loop, jit=handle.plain):
    """The loop with modes and regularised.

    Returns:
        rhs(t, z, wx, wy) in a mode; state(t, z, wx, wy), the force of the clay and the velocity in
        it; and smooth(t, z, eps), regularised.
    """
    before, turn = loaded(loop, jit), rates(loop, jit)
    yields, Fy = jit(yielding(loop.Fy)), loop.Fy

    def state(t, z, wx, wy):
        parts = before(t, z)
        return yields(parts, wx, wy), parts[2]

    def rhs(t, z, wx, wy):
        parts = before(t, z)
        fx, fy = yields(parts, wx, wy)
        return np.array(turn(z, parts, fx, fy))

    def smooth(t, z, eps):
        parts = before(t, z)
        vx, vy = parts[2]
        fx, fy = Fy * tanh(vx / eps), Fy * tanh(vy / eps)
        return np.array(turn(z, parts, fx, fy))

    return jit(rhs), jit(state), jit(smooth)


# ---- with modes ----------------------------------------------------------------------------------


def fitting(Fy: float, state, t: float, z: np.ndarray, ways: list[float]) -> list[float]:
    """The ways of both axes at an instant: one that the clay cannot hold goes on."""
    ways = list(ways)
    for _ in (0, 1):
        f, _ = state(t, z, *ways)
        beyond = [abs(f[i]) - Fy if ways[i] == 0.0 else -1.0 for i in (0, 1)]
        i = int(beyond[1] > beyond[0])
        if beyond[i] <= 0.0:
            break
        ways[i] = float(np.sign(f[i]))
    return ways


def at_rest(z: np.ndarray, held: list[int]) -> np.ndarray:
    """The state without velocity on some axes."""
    u = np.array(
        [[-common.L1 * np.sin(z[0]), -common.L2 * np.sin(z[1])],
         [common.L1 * np.cos(z[0]), common.L2 * np.cos(z[1])]]
    )  # fmt: skip
    v = u @ z[2:4]
    v[held] = 0.0
    z = z.copy()
    z[2:4] = np.linalg.solve(u, v)
    return z


def events(Fy: float, state, ways):
    """What ends a mode, by falling through 0: an axis stops, or the clay cannot hold one."""

    def event(i):
        def left(t, z, wx, wy):
            f, v = state(t, z, wx, wy)
            return ways[i] * v[i] if ways[i] else Fy - abs(f[i])

        left.terminal, left.direction = True, -1
        return left

    return [event(0), event(1)]


def solve_with_modes(loop: Loop, laws, times: np.ndarray, rtol: float) -> Run:
    """One run with a relative tolerance."""
    rhs, state, _ = laws
    z, t, end, note = common.initial(loop.job), 0.0, loop.job.t_max, ""
    states = []
    begin = time.perf_counter()
    try:
        ways = fitting(loop.Fy, state, t, z, [0.0, 0.0])
        for _ in range(MANY):
            s = solve_ivp(
                rhs, (t, end), z, "DOP853", t_eval=times[(times > t) & (times <= end)],
                events=events(loop.Fy, state, ways), args=tuple(ways), rtol=rtol,
                atol=1e-2 * rtol, max_step=LONGEST,
            )  # fmt: skip
            states.append(np.transpose(s.y).reshape(-1, 12))  # [] if no time lies within
            if s.status != 1:
                note = s.message if s.status else ""
                break
            i = 0 if len(s.t_events[0]) else 1
            t, z = float(s.t_events[i][0]), s.y_events[i][0]
            if ways[i]:
                ways[i] = 0.0
            else:
                ways[i] = float(np.sign(state(t, z, *ways)[0][i]))
            z = at_rest(z, [j for j in (0, 1) if ways[j] == 0.0])
            ways = fitting(loop.Fy, state, t, z, ways)
        else:
            note = f"more than {MANY} changes of mode"
    except Exception as error:  # noqa: BLE001  a result, not a crash
        note = f"{type(error).__name__}: {error}"
    wall = time.perf_counter() - begin
    return Run(common.of_states(loop.job, np.concatenate(states))[0], wall, note)


# ---- regularised ---------------------------------------------------------------------------------


def solve_regularised(loop: Loop, laws, times: np.ndarray, solver: str, setting: str) -> Run:
    """One run with a setting "eps, rtol"."""
    eps, rtol = map(float, setting.split(", "))
    begin, note = time.perf_counter(), ""
    clock, end = time.perf_counter, time.perf_counter() + common.WALL_LIMIT

    def rhs(t, z):
        if clock() > end:
            raise TimeoutError(f"more than {common.WALL_LIMIT:g} s of wall time")
        return laws[2](t, z, eps)

    states = np.empty((0, 12))
    try:
        s = solve_ivp(
            rhs, (0.0, loop.job.t_max), common.initial(loop.job), solver, t_eval=times,
            rtol=rtol, atol=1e-2 * min(rtol, eps),
        )  # fmt: skip
        states, note = s.y.T, s.message if s.status else ""
    except Exception as error:  # noqa: BLE001  a result, not a crash
        note = f"{type(error).__name__}: {error}"
    wall = time.perf_counter() - begin
    return Run(common.of_states(loop.job, states)[0], wall, note)


def methods(scene: hc.Scenario, times: np.ndarray, is_compiled: bool | None = None) -> list[Method]:
    """SciPy with modes by rtol, and regularised by eps [m/s] and rtol.

    Args:
        scene: of the problem.
        times: of the positions [s].
        is_compiled: whether numba compiles the right-hand sides; None where it is there.
    """
    loop, jit, end = Loop.of(scene), handle.plain, ""
    if is_compiled is None:
        is_compiled = importlib.util.find_spec("numba") is not None
    if is_compiled:
        from numba import njit

        jit, end = njit, ", compiled"
    laws, z = equations(loop, jit), common.initial(loop.job)
    for law, more in zip(laws, ((0.0, 0.0), (0.0, 0.0), (1e-3,)), strict=True):
        law(0.0, z, *more)  # before the clock runs
    modes = functools.partial(solve_with_modes, loop, laws, times)
    out = [
        Method("SciPy", f"DOP853, modes{end}", (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12), modes)
    ]
    for solver, (widths, tolerances) in REGULARISED.items():
        settings = tuple(f"{eps:g}, {rtol:g}" for eps in widths for rtol in tolerances)
        solve = functools.partial(solve_regularised, loop, laws, times, solver)
        out.append(Method("SciPy", f"{solver}, regularised{end}", settings, solve))
    return out
