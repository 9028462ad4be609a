"""The reference solution of any scenario, and a verdict on it by its own means.

Nothing of how hapticclay steps, controls or judges is used: the arm is that of tests/oracles.py in
relative joint angles, with the printed numbers typed again; time is SciPy's (DOP853, or LSODA where
the clay is stiff); borders are found on the dense solution, in both directions. Torques are
clipped, and the hand's mass answers to what is left.

On a border that both sides push the handle onto, a solution chatters ever faster. Bounces lower
than BOUNCE are replaced by Filippov's sliding motion: the mixture of both sides' clay that keeps
the handle on the border, until one side alone does.

Sampled scenes: controller by matrix exponential at the samples, the arm under held torques between
them.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import DOP853, LSODA, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from hapticclay.model.cells import Profile
from hapticclay.scene.scenario import Scenario
from tests.oracles.arm import G0, G1, I1, I2, L1, L2, S0, S1, SG

FOLD = math.sin(math.radians(1.0))  # the elbow within 1 degree of stretched or folded
STILL, WHILE = (
    1e-5,
    1.0,
)  # [m/s], [s] stalled is slower than this for so long; saturated, in the limit for so long
BOUNCE = 1e-10  # [m] height of a bounce on a border below which it is sliding
GROWTH = math.log(
    1e4
)  # an excitation that the linear loop would have made so much larger is an instability
SATURATED = (
    0.1  # share of the last WHILE in the torque limits from which an oscillation is bounded by them
)
STIFF = 3e3  # [1/s] rate from which LSODA is used
RTOL = {DOP853: 1e-10, LSODA: 1e-10}
ATOL = 1e-13
LONG = 1e3  # [s] a run so long is for its verdict; tolerances are 1e4 times as wide


@dataclass
class Solution:
    """A reference run.

    Attributes:
        code: the verdict: finished, time limit, stalled, saturated, unstable, limit cycle, out of
            reach, singular.
        end: time of the end [s]. sigma: largest real part of the loop's oscillating poles on the
            way [1/s].
        p: handle position [m] at the times asked for that lie before the end, (n, 2).
        crossings: of borders, (axis, border [m], time [s]). kinetic: largest kinetic energy of the
            arm [J].
        slides: times at which sliding began [s].
    """

    code: str = ""
    end: float = 0.0
    sigma: float = -math.inf
    p: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    crossings: list[tuple[int, float, float]] = field(default_factory=list)
    kinetic: float = 0.0
    slides: list[float] = field(default_factory=list)


class Loop:
    """The closed loop as a differential equation.

    z = (q, q', delta, delta', y, y'), two axes each.
    """

    def __init__(self, s: Scenario):
        self.s = s
        th = s.operator
        self.m, self.d, self.k = (th.mass, th.damper, th.spring) if th else (0.0, 0.0, 0.0)
        self.muscle, self.command = _signal(s.muscle), _signal(s.command)
        self.first = (
            self.command(0.0) if self.command else (0.0, 0.0)
        )  # a command is counted from t = 0

    def uh(self, t: float) -> tuple[float, float]:
        if not self.muscle:
            return self.s.force
        x, y = self.muscle(t)
        return self.s.force[0] + x, self.s.force[1] + y

    def kinematics(self, q1, q2, w1, w2):
        """Jacobian (row by row), position, velocity, J' q', mobility (xx, xy, yy)."""
        s1, c1, s12, c12 = math.sin(q1), math.cos(q1), math.sin(q1 + q2), math.cos(q1 + q2)
        a, b, c, d = -L1 * s1 - L2 * s12, -L2 * s12, L1 * c1 + L2 * c12, L2 * c12
        n = w1 + w2
        x = L1 * c1 + L2 * c12 - self.s.origin[0]
        y = L1 * s1 + L2 * s12 - self.s.origin[1]
        jx = -L1 * c1 * w1 * w1 - L2 * c12 * n * n
        jy = -L1 * s1 * w1 * w1 - L2 * s12 * n * n
        # M^-1 of M = [[I1 + I2, I2], [I2, I2]] is [[1, -1], [-1, 1 + I1/I2]]/I1
        g = 1.0 + I1 / I2
        W = (
            (a * a - 2 * a * b + g * b * b) / I1,
            (a * c - a * d - b * c + g * b * d) / I1,
            (c * c - 2 * c * d + g * d * d) / I1,
        )
        return (a, b, c, d), (x, y), (a * w1 + b * w2, c * w1 + d * w2), (jx, jy), W

    def want(self, z, p, v):
        """What the servo wants for p'', and y''."""
        dx, dy, yx, yy, rx, ry = z[4], z[5], z[8], z[9], z[10], z[11]
        y2 = (G0[0] * (dx - yx) - G1[0] * rx, G0[1] * (dy - yy) - G1[1] * ry)
        ax = y2[0] + S1[0] * (rx - v[0]) + S0[0] * (yx - p[0])
        ay = y2[1] + S1[1] * (ry - v[1]) + S0[1] * (yy - p[1])
        return (float(ax), float(ay)), (float(y2[0]), float(y2[1]))

    def answer(self, J, c, W, tau, rest):
        """Handle acceleration and net hand force f = rest - m p'' under motor torques tau."""
        k1, k2 = (tau[0] - tau[1]) / I1, (-tau[0] + (1.0 + I1 / I2) * tau[1]) / I1
        gx, gy = J[0] * k1 + J[1] * k2 + c[0], J[2] * k1 + J[3] * k2 + c[1]
        a = _solve(
            self.m, W, gx + W[0] * rest[0] + W[1] * rest[1], gy + W[1] * rest[0] + W[2] * rest[1]
        )
        return a, (rest[0] - self.m * a[0], rest[1] - self.m * a[1])

    def at(self, t: float, z, b, clip: bool = True, uh=None):
        """Return (z', position, velocity, handle acceleration, torques, one in its limit?)."""
        z = [float(x) for x in z]
        if self.command:
            now = self.command(t)
            z[4] += now[0] - self.first[0]
            z[5] += now[1] - self.first[1]
        J, p, v, c, W = self.kinematics(*z[:4])
        want, y2 = self.want(z, p, v)
        ux, uy = uh or self.uh(t)
        rest = (
            ux - (self.d + b[0]) * v[0] - self.k * p[0],
            uy - (self.d + b[1]) * v[1] - self.k * p[1],
        )
        S = (float(SG[0]), 0.0, float(SG[1])) if self.s.inertia_shaping else W
        a = _solve(
            self.m,
            S,
            want[0] + S[0] * rest[0] + S[1] * rest[1],
            want[1] + S[1] * rest[0] + S[2] * rest[1],
        )  # p'' = want + S f
        f = (rest[0] - self.m * a[0], rest[1] - self.m * a[1])
        # tau = J^T W^-1 (p'' - c - W f)
        ex, ey = a[0] - c[0] - W[0] * f[0] - W[1] * f[1], a[1] - c[1] - W[1] * f[0] - W[2] * f[1]
        det = W[0] * W[2] - W[1] * W[1]
        hx, hy = (W[2] * ex - W[1] * ey) / det, (W[0] * ey - W[1] * ex) / det
        tau = (J[0] * hx + J[2] * hy, J[1] * hx + J[3] * hy)
        l1, l2 = self.s.torque_limit
        bound = abs(tau[0]) > l1 or abs(tau[1]) > l2
        if bound and clip:
            tau = (min(max(tau[0], -l1), l1), min(max(tau[1], -l2), l2))
            a, f = self.answer(J, c, W, tau, rest)
        t1, t2 = tau[0] + J[0] * f[0] + J[2] * f[1], tau[1] + J[1] * f[0] + J[3] * f[1]
        K = self.s.gain
        rate = (
            z[2],
            z[3],
            (t1 - t2) / I1,
            (-t1 + (1.0 + I1 / I2) * t2) / I1,
            z[6],
            z[7],
            K[0] * f[0] - 10.0 * z[6],
            K[1] * f[1] - 10.0 * z[7],
            z[10],
            z[11],
            y2[0],
            y2[1],
        )
        return rate, p, v, a, tau, bound

    def start(self) -> np.ndarray:
        """At start with the given velocity, delta ahead by the lag of G."""
        s = self.s
        x, y = s.origin[0] + s.start[0], s.origin[1] + s.start[1]
        q2 = -math.acos((x * x + y * y - L1 * L1 - L2 * L2) / (2 * L1 * L2))
        q1 = math.atan2(y, x) - math.atan2(L2 * math.sin(q2), L1 + L2 * math.cos(q2))
        a, b, c, d = self.kinematics(q1, q2, 0.0, 0.0)[0]
        p, v = np.array(s.start), np.array(s.velocity)
        w = np.linalg.solve([[a, b], [c, d]], v)
        return np.concatenate(((q1, q2), w, p + G1 / G0 * v, v, p, v))

    def kinetic(self, z) -> float:
        return 0.5 * (I1 * z[2] * z[2] + I2 * (z[2] + z[3]) ** 2)

    def at_rest(self, z) -> tuple[np.ndarray, tuple[float, float]]:
        """Return the equilibrium at the pose of z and the muscle force that holds it."""
        _, p, _, _, _ = self.kinematics(z[0], z[1], 0.0, 0.0)
        out = np.zeros(12)
        out[:2] = z[:2]
        out[4:6] = out[8:10] = p
        return out, (self.k * p[0], self.k * p[1])

    def growth(self, z, b) -> float:
        """Return the largest real part of the poles at the pose of z [1/s], without limits."""
        rest, uh = self.at_rest(z)
        A = np.empty((12, 12))
        for j in range(12):
            e = np.zeros(12)
            e[j] = 1e-6
            up, down = (self.at(0.0, rest + x, b, False, uh)[0] for x in (e, -e))
            A[:, j] = (np.array(up) - np.array(down)) / 2e-6
        return _oscillating(np.linalg.eigvals(A))


def _oscillating(poles: np.ndarray) -> float:
    """Largest real part of the oscillating poles.

    The slow drift along the path (integrators, moved by the pose) does not count.
    """
    return float(
        np.max(poles.real[(np.abs(poles.imag) > 0.5) | (poles.real > 0.5)], initial=-math.inf)
    )


def _solve(m: float, S, x: float, y: float) -> tuple[float, float]:
    """(1 + m S)^-1 (x, y)."""
    if not m:
        return x, y
    a, b, d = 1.0 + m * S[0], m * S[1], 1.0 + m * S[2]
    n = a * d - b * b
    return (d * x - b * y) / n, (a * y - b * x) / n


def _signal(multisine) -> Callable[[float], Any] | None:
    if multisine is None:
        return None
    s = multisine  # its phases are the scenario's, by definition
    return lambda t: [
        float(np.sum(s.amplitude[i] * np.cos(s.omega * t + s.phase[:, i]))) for i in (0, 1)
    ]


class Map:
    """Which clay lies where: a grid of regions between the borders of both coordinates."""

    def __init__(self, s: Scenario):
        self.profiles: tuple[Profile, ...] = (s.clay.x, s.clay.y) if s.clay else ()
        self.edges: list[list[float]] = [
            sorted({e for f in self.profiles if f.along == a for e in f.edges}) for a in ("x", "y")
        ]
        if s.length is not None:  # nobody gets there
            self.edges[0] = [e for e in self.edges[0] if e < s.length]
        self.place = [bisect.bisect_right(self.edges[i], s.start[i]) for i in (0, 1)]
        self.entered: dict[tuple[int, int], float] = {}

    def bounds(self, i: int) -> tuple[float, float]:
        e, k = self.edges[i], self.place[i]
        return e[k - 1] if k else -math.inf, e[k] if k < len(e) else math.inf

    def law(
        self, t: float, place: list[int] | None = None
    ) -> Callable[[float], tuple[float, float]]:
        """Return b(t) on both axes in a region; the present one is entered now unless it was."""
        terms = [(0.0, 0.0, 0.0)] * 2
        where = place or self.place
        for i, f in enumerate(self.profiles):
            a = 0 if f.along == "x" else 1
            k = where[a]
            low = self.edges[a][k - 1] if k else -math.inf
            j = sum(e <= low for e in f.edges)
            since = self.entered.get((i, j), t) if place else self.entered.setdefault((i, j), t)
            terms[i] = (f.values[j], f.growth[j] if f.growth else 0.0, since)
        (b0, r0, t0), (b1, r1, t1) = terms
        return lambda t: (b0 + r0 * (t - t0), b1 + r1 * (t - t1))


class Run:
    """Steps a solver from border to border."""

    def __init__(self, s: Scenario, times: np.ndarray):
        self.s, self.loop, self.map = s, Loop(s), Map(s)
        self.times, self.done = times, 0
        self.out = Solution()
        self.p: list[np.ndarray] = []
        self.trace: list[
            tuple[float, float, bool, float, float]
        ] = []  # t, speed, motor in its limit, v
        self.sum = self.worst = (
            0.0  # growth of an excitation since it last began to grow, and at most [1]
        )
        self.judged = self.looked = 0.0
        self.sigma, self.where = 0.0, None
        self.spacing = max(0.02, s.t_max / 500)
        self.slide: tuple[int, int] | None = None  # coordinate, its region below the border

    def laws(self, t: float):
        """The clay in the present region; while sliding, on either side."""
        if self.slide is None:
            b = self.map.law(t)
            return b, b
        i, k = self.slide
        places = [list(self.map.place), list(self.map.place)]
        places[0][i], places[1][i] = k, k + 1
        return self.map.law(t, places[0]), self.map.law(t, places[1])

    def mixed(self, t, z, low, high) -> tuple[float, tuple[float, float]]:
        """Share of the upper side in the motion along the border, and the clay of that mixture."""
        b0, b1 = low(t), high(t)
        if self.slide is None:
            return 0.0, b0
        i = self.slide[0]
        a0, a1 = self.loop.at(t, z, b0)[3][i], self.loop.at(t, z, b1)[3][i]
        x = a0 / (a0 - a1) if a0 != a1 else 0.0
        return x, (b0[0] + x * (b1[0] - b0[0]), b0[1] + x * (b1[1] - b0[1]))

    def rhs(self, t: float):
        low, high = self.laws(t)
        return lambda t, z: self.loop.at(t, z, self.mixed(t, z, low, high)[1])[0]

    def solver(self, t: float, z: np.ndarray):
        """SciPy's, of z with angles from here on:

        in stiff clay, b times the rounding of a whole one is an impulse.
        """
        low, high = self.laws(t)
        self.base = np.concatenate((z[:2], np.zeros(10)))
        b = max(*low(t), *high(t))
        stiff = (b + self.loop.d) * 0.93 > STIFF
        kind = LSODA if stiff else DOP853
        scale = 1.0 if self.s.t_max < LONG else 1e4
        rhs = self.rhs(t)
        return kind(
            lambda t, gained: rhs(t, self.base + gained),
            t,
            z - self.base,
            self.s.t_max,
            rtol=RTOL[kind] * scale,
            atol=ATOL
            * scale
            * min(
                1.0, max(1e-3, 1e3 / max(b, 1.0))
            ),  # of a position, b times of which is an impulse
            max_step=max(self.s.t_max / 50, 0.05),
        )

    def events(self, z, t, low, high) -> list[float]:
        """Functions of the state that are positive until something happens."""
        _, (x, y), _, _, _ = self.loop.kinematics(z[0], z[1], 0.0, 0.0)
        out = [abs(math.sin(z[1])) - FOLD]
        out.append(self.s.length - x if self.s.length is not None else 1.0)
        for i, c in enumerate((x, y)):
            if self.slide and self.slide[0] == i:
                share = self.mixed(t, z, low, high)[0]
                out += [share + 1e-9, 1.0 + 1e-9 - share]
            else:
                a, b = self.map.bounds(i)
                out += [c - a if a > -math.inf else 1.0, b - c if b < math.inf else 1.0]
        return out

    def go(self) -> Solution:
        t, z = 0.0, self.loop.start()
        self.note(t, z, self.map.law(t)(t))
        while True:
            solver, (low, high) = self.solver(t, z), self.laws(t)
            what, base = -1, self.base
            while solver.status == "running" and what < 0:
                solver.step()
                if solver.status == "failed":
                    raise RuntimeError(
                        f"reference: {type(solver).__name__} failed at {solver.t:g} s"
                    )
                gained, a, b = solver.dense_output(), solver.t_old, solver.t
                dense = lambda t, base=base, gained=gained: base + gained(t)  # noqa: E731
                t, z, what = self.first(dense, a, b, low, high)
                self.keep(dense, a, t, low, high)
                if self.verdict(t, z, low(t)):
                    return self.finish("unstable", t)
            if what < 0:
                return self.finish("time limit", t)
            if what == 0:
                return self.finish("out of reach" if math.cos(z[1]) > 0.0 else "singular", t)
            if what == 1:
                return self.finish("finished", t)
            z = self.cross((what - 2) // 2, bool(what % 2), t, z)

    def first(self, dense, a: float, b: float, low, high):
        """(time, state, number of the event) of the first event in a step, or its end and -1."""
        before = a
        for t in np.linspace(a, b, 7)[1:]:
            now = self.events(dense(t), t, low, high)
            hit = [k for k, x in enumerate(now) if x < -1e-13]
            if hit:
                found = []
                for k in hit:
                    g = lambda t, k=k: self.events(dense(t), t, low, high)[k]  # noqa: E731
                    # a run that has just left the border may come back to it within the same step
                    clear = [u for u in np.linspace(before, t, 17)[:-1] if g(u) > 0.0]
                    found.append(
                        (brentq(g, clear[-1], t, xtol=1e-15, rtol=1e-15) if clear else before, k)
                    )
                when, k = min(found)
                return when, dense(when), k
            before = t
        return b, dense(b), -1

    def cross(self, i: int, up: bool, t: float, z: np.ndarray) -> np.ndarray:
        """Steps over a border, onto it to slide, or off it."""
        if self.slide and self.slide[0] == i:
            self.map.place[i], self.slide = self.slide[1] + up, None
            return z
        edge = self.map.bounds(i)[up]
        k = self.map.place[i] - (not up)
        below, above = list(self.map.place), list(self.map.place)
        below[i], above[i] = k, k + 1
        b0, b1 = self.map.law(t, below)(t), self.map.law(t, above)(t)
        a0, a1 = self.loop.at(t, z, b0)[3][i], self.loop.at(t, z, b1)[3][i]
        v = self.loop.at(t, z, b0)[2]
        self.out.crossings.append((i, edge, t))
        if a0 > 0.0 > a1 and v[i] * v[i] < 2.0 * BOUNCE * min(a0, -a1):
            self.slide = (i, k)
            self.out.slides.append(t)
            (a, b, c, d), *_ = self.loop.kinematics(*z[:4])
            flat = [v[0], v[1]]
            flat[i] = 0.0
            z = z.copy()
            z[2:4] = np.linalg.solve([[a, b], [c, d]], flat)
            return z
        self.map.place[i] += 1 if up else -1
        self.map.law(t)
        return z

    def note(self, t, z, b) -> None:
        _, _, v, _, _, bound = self.loop.at(t, z, b)
        self.trace.append((t, max(abs(v[0]), abs(v[1])), bound, v[0], v[1]))
        self.out.kinetic = max(self.out.kinetic, self.loop.kinetic(z))

    def keep(self, dense, a: float, b: float, low, high) -> None:
        for t in np.linspace(a, b, 5)[1:] if b > a else ():
            z = dense(t)
            self.note(float(t), z, self.mixed(t, z, low, high)[1])
        while self.done < len(self.times) and self.times[self.done] <= b:
            z = dense(self.times[self.done])
            self.p.append(np.array(self.loop.kinematics(z[0], z[1], 0.0, 0.0)[1]))
            self.done += 1

    def verdict(self, t: float, z, b) -> bool:
        """Add up the growth of the linear loop; True if the run is to end as unstable."""
        where = (*self.map.place, self.slide)
        if t - self.looked >= self.spacing or where != self.where:
            self.sigma, self.looked, self.where = self.loop.growth(z, b), t, where
            self.out.sigma = max(self.out.sigma, self.sigma)
        self.sum = max(0.0, self.sum + self.sigma * (t - self.judged))
        self.worst = max(self.worst, self.sum)
        self.judged = t
        return self.s.stop_when_unstable and self.worst > GROWTH

    def finish(self, code: str, t: float) -> Solution:
        out = self.out
        out.end, out.p = t, np.array(self.p).reshape(-1, 2)
        out.code = judged(code, np.array(self.trace, float), self.worst > GROWTH)
        return out


def judged(code: str, trace: np.ndarray, unstable: bool) -> str:
    """The verdict on a run that ended by `code`; trace:

    time, speed, motor in its limit, v along x and y, (n, 5).
    """
    last = trace[trace[:, 0] >= trace[-1, 0] - WHILE]
    share = float(np.trapezoid(last[:, 2], last[:, 0]) / max(last[-1, 0] - last[0, 0], 1e-12))
    if unstable:
        return "limit cycle" if share > SATURATED else "unstable"
    if code != "time limit":
        return code
    if share == 1.0:
        return "saturated"
    if share > SATURATED and _swings_on(last):
        return "limit cycle"
    return "stalled" if last[:, 1].max() < STILL else code


def _swings_on(last: np.ndarray) -> bool:
    """Whether the velocity swings on, no less in the second half of the time."""
    half = 0.5 * (last[0, 0] + last[-1, 0])
    v = last[:, 3:] - last[:, 3:].mean(axis=0)
    late = last[:, 0] > half
    swings = np.sum(v[1:] * v[:-1] < 0.0, axis=0).max()
    # both axes together: one may lend its energy to the other
    return swings > 10 and np.sum(v[late].var(axis=0)) > 0.98 * np.sum(v[~late].var(axis=0))


class SampledRun:
    """The hybrid system:

    z = (q, q') of the arm between samples; controller x = (delta, delta', y, y') an axis.
    """

    def __init__(self, s: Scenario, times: np.ndarray):
        self.s, self.loop, self.map, self.times = s, Loop(s), Map(s), times
        self.Ts = s.Ts or s.dt
        self.blocks = []
        for i in (0, 1):
            A = np.zeros((5, 5))
            A[0, 1] = A[2, 3] = 1.0
            A[1, 1], A[1, 4] = -10.0, s.gain[i]
            A[3] = [G0[i], 0.0, -G0[i], -G1[i], 0.0]
            self.blocks.append(expm(A * self.Ts))
        self.physical = s.render == "physical"
        self.out = Solution()

    def b(self, p) -> tuple[float, float]:
        """Damping at p [N.s/m] (without growth)."""
        place = [bisect.bisect_right(self.map.edges[i], p[i]) for i in (0, 1)]
        return self.map.law(0.0, place)(0.0)

    def arm(self, z, tau, b, uh):
        """(derivative of z, hand force without the clay) under held torques."""
        J, p, v, c, W = self.loop.kinematics(*z)
        d, k = self.loop.d, self.loop.k
        hand = (uh[0] - d * v[0] - k * p[0], uh[1] - d * v[1] - k * p[1])
        rest = (hand[0] - b[0] * v[0], hand[1] - b[1] * v[1])
        a, f = self.loop.answer(J, c, W, tau, rest)
        t1, t2 = tau[0] + J[0] * f[0] + J[2] * f[1], tau[1] + J[1] * f[0] + J[3] * f[1]
        fh = (hand[0] - self.loop.m * a[0], hand[1] - self.loop.m * a[1])
        return (z[2], z[3], (t1 - t2) / I1, (-t1 + (1.0 + I1 / I2) * t2) / I1), fh

    def control(self, z, x, tau, uh, b, clip=True):
        """New torques, and the states after the sample. b: clay at the sample."""
        J, p, v, c, W = self.loop.kinematics(*z)
        if tau is None:
            fh = (
                uh[0] - self.loop.d * v[0] - self.loop.k * p[0],
                uh[1] - self.loop.d * v[1] - self.loop.k * p[1],
            )
        else:
            fh = self.arm(z, tau, b if self.physical else (0.0, 0.0), uh)[1]
        fe = np.array(b) * v
        f = np.array(fh) - fe
        flat = (0, 0, 0, 0, x[0][0], x[1][0], x[0][1], x[1][1], x[0][2], x[1][2], x[0][3], x[1][3])
        want, _ = self.loop.want(flat, p, v)
        Wm = np.array([[W[0], W[1]], [W[1], W[2]]])
        S = np.diag(SG) if self.s.inertia_shaping else Wm
        Jm = np.reshape(J, (2, 2))
        new = Jm.T @ np.linalg.solve(Wm, np.array(want) - c + (S - Wm) @ f)
        if not self.physical:
            new = new - Jm.T @ fe
        limit = np.array(self.s.torque_limit)
        bound = bool(np.any(np.abs(new) > limit))
        new = np.clip(new, -limit, limit) if clip else new
        return (
            tuple(map(float, new)),
            [(self.blocks[i] @ np.append(x[i], f[i]))[:4] for i in (0, 1)],
            bound,
        )

    def between(self, z, tau, span, uh):
        """The arm over a span under held torques; (state, time of reaching length or None)."""
        if not self.physical:
            fast = math.sqrt(self.loop.k * 0.93) + self.loop.d * 0.93 + 50.0
            n = max(2, math.ceil(span * fast / 0.05))
            new, h = np.array(z), span / n
            for _ in range(n):
                f = lambda z: np.array(self.arm(z, tau, (0.0, 0.0), uh)[0])  # noqa: E731
                k1 = f(new)
                k2 = f(new + 0.5 * h * k1)
                k3 = f(new + 0.5 * h * k2)
                new = new + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + f(new + h * k3))
            if self.s.length is None or self.loop.kinematics(*new)[1][0] < self.s.length:
                return new, None
        t, z, edges = 0.0, np.array(z), [(i, e) for i in (0, 1) for e in self.map.edges[i]]
        if self.s.length is not None:
            edges.append((0, self.s.length))
        for _ in range(50):
            p, v = self.loop.kinematics(*z)[1:3]
            b = (
                self.b([p[i] + math.copysign(1e-12, v[i]) for i in (0, 1)])
                if self.physical
                else (0.0, 0.0)
            )
            stiff = max(b) * 0.93 > STIFF
            marks = []
            for i, e in edges:
                mark: Any = lambda t, z, i=i, e=e: self.loop.kinematics(*z)[1][i] - e  # noqa: E731
                mark.terminal = abs(p[i] - e) > 1e-12
                marks.append(mark)
            r = solve_ivp(
                lambda t, z, b=b: self.arm(z, tau, b, uh)[0],
                (t, span),
                z,
                "LSODA" if stiff else "DOP853",
                rtol=1e-10 if stiff else 1e-11,
                atol=1e-14,
                events=marks or None,
            )
            t, z = r.t[-1], r.y[:, -1]
            if (
                self.s.length is not None
                and self.loop.kinematics(*z)[1][0] >= self.s.length - 1e-12
            ):
                return z, t
            if t >= span:
                break
        return z, None

    def growth(self, z, b) -> float:
        """Return the largest growth rate of the sampled loop at the pose of z [1/s]."""
        rest, uh = self.loop.at_rest(z)
        clay = b if self.physical else (0.0, 0.0)
        arm = np.zeros((6, 6))  # of (q, q') and the torques held, over one sample
        for j in range(6):
            e = np.zeros(6)
            e[j] = 1e-6
            up, down = (self.arm(rest[:4] + x[:4], x[4:], clay, uh)[0] for x in (e, -e))
            arm[:4, j] = (np.array(up) - np.array(down)) / 2e-6
        arm = expm(arm * self.Ts)

        def step(y):
            tau, x, _ = self.control(y[:4], [y[4:8], y[8:12]], tuple(y[12:]), uh, b, False)
            new = rest[:4] + (arm @ np.concatenate((y[:4] - rest[:4], tau)))[:4]
            return np.concatenate((new, *x, tau))

        here = np.zeros(14)
        here[:2] = rest[:2]
        here[4], here[6], here[8], here[10] = rest[4], rest[4], rest[5], rest[5]
        A = np.empty((14, 14))
        for j in range(14):
            e = np.zeros(14)
            e[j] = 1e-6
            A[:, j] = (step(here + e) - step(here - e)) / 2e-6
        poles = np.linalg.eigvals(A).astype(complex)
        poles = poles[np.abs(poles) > 1e-12]
        return _oscillating(np.log(poles) / self.Ts)

    def go(self) -> Solution:
        s, out = self.s, self.out
        z12 = self.loop.start()
        z, x, tau = z12[:4], [z12[4:12:2], z12[5:12:2]], None
        trace, p, t, n = [], [], 0.0, 0
        total = worst = judged_at = 0.0
        code = "time limit"
        while t < s.t_max - 1e-9:
            uh = self.loop.uh(t)
            kin = self.loop.kinematics(*z)
            b = self.b(kin[1])
            tau, x, bound = self.control(z, x, tau, uh, b)
            trace.append((t, max(map(abs, kin[2])), bound, *kin[2]))
            out.kinetic = max(out.kinetic, self.loop.kinetic(z))
            if t - judged_at >= max(0.02, s.t_max / 100) or not n:
                sigma = self.growth(z, b)
                out.sigma = max(out.sigma, sigma)
                total = max(0.0, total + sigma * (t - judged_at))
                worst, judged_at = max(worst, total), t
            if abs(math.sin(z[1])) < FOLD:
                code = "out of reach" if math.cos(z[1]) > 0.0 else "singular"
                break
            if s.stop_when_unstable and worst > GROWTH:
                break
            end = min((n + 1) * self.Ts, s.t_max)
            for at in self.times[np.searchsorted(self.times, t) : np.searchsorted(self.times, end)]:
                there = self.between(z, tau, at - t, uh)[0] if at > t else z
                p.append(self.loop.kinematics(*there)[1])
            z, reached = self.between(z, tau, end - t, uh)
            if reached is not None:
                t, code = t + reached, "finished"
                break
            t, n = end, n + 1
        out.end = t
        out.p = np.array([x for x, at in zip(p, self.times, strict=False) if at <= t]).reshape(
            -1, 2
        )
        out.code = judged(code, np.array(trace, float), worst > GROWTH)
        return out


def solve(s: Scenario, times: np.ndarray) -> Solution:
    """The reference solution of a scenario, its positions at ascending `times` [s]."""
    return (SampledRun if s.control == "sampled" else Run)(s, times).go()
