"""Clay that yields under SciPy: sliding, stuck and border events, the arm in joint space."""

import itertools
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from .arm import G0, G1, ORIGIN, S0, S1, SG, Arm

SLOW = 1e-10  # [m/s] speed at which a handle as a whole, or a thinning flow, counts as at rest


class Found(NamedTuple):
    """A solution at some times: t [s], p [m] and v [m/s], (n, 2) each.

    stops: a row each, 0 for x, 1 for y, 2 for both; 1 where it stops, 0 where it goes on; time [s].
    """

    t: np.ndarray
    p: np.ndarray
    v: np.ndarray
    stops: np.ndarray
    crossings: np.ndarray


def yielding(laws, pushes=(), every=4e-3, **case):
    """The loop in clay that yields, at equal times; see Yielding.

    Args:
        laws: a tuple of the regions along x, each ((Fy, K, n, b) of x, of y).
        pushes: further forces, (rate [N/s], from, to [s]) each; a step where both are equal [N].
        every: between the times [s].
        case: as of Yielding.
    """
    uh, names = np.array(case.pop("uh", (1.0, 0.0)), float), ("Fy", "K", "n", "b")

    def force(t):
        f = uh.copy()
        for value, begin, end in pushes:
            f += np.array(value) * (np.clip(t, begin, end) - begin if end > begin else t >= begin)
        return f

    breaks = sorted({x for _, *times in pushes for x in times})
    regions = [{k: [row[j] for row in both] for j, k in enumerate(names)} for both in laws]
    o = Yielding(regions, uh=force, breaks=breaks, **case)
    t = np.arange(1, round(o.spans[-1][1] / every)) * every
    stops = [[("x", "y", "xy").index(axis), now, t] for axis, now, t in o.stops]
    return Found(t, *o(t), np.array(stops, float).reshape(-1, 3), np.array(o.crossings))


def yielding_case(case):
    """As `yielding`, of a dictionary.

    Args:
        case: its arguments.
    """
    return yielding(**case)


class Yielding:
    """The loop in clay that yields, solved piece by piece, a mode each (DOP853 at 1e-12).

    Args:
        laws: of the regions along x, each {"Fy": (x, y), "K":, "n":, "b":}; along axes turned by
            `angle`, or of the motion as a whole (`isotropic`, the first of each pair).
        edges: borders between them [m].
        gain: K of x and y.
        uh: muscle force, a function of time [N].
        breaks: times at which it jumps [s].
        hand: mass, damper, spring.
        limit: of the torques [N.m].
    """

    def __init__(  # noqa: PLR0913  # a case, spelt out
        self, laws, edges=(), gain=(1.0, 0.5), uh=None, breaks=(), hand=None, inertia_shaping=False,
        t_end=1.0, p0=(0.0, 0.0), v0=(0.0, 0.0), isotropic=False, angle=0.0, limit=None,
        method="DOP853", rtol=1e-12,
    ):  # fmt: skip
        self.laws = [{k: np.array(x, float) for k, x in law.items()} for law in laws]
        self.edges, self.K, self.limit = np.array(edges, float), np.array(gain, float), limit
        self.uh = uh
        self.m, self.d, self.k = hand or (0.0, 0.0, 0.0)
        self.inertia_shaping, self.isotropic, self.method = inertia_shaping, isotropic, method
        self.rtol = rtol
        c, s = np.cos(angle), np.sin(angle)
        self.R = np.array([[c, s], [-s, c]])  # world to clay
        p0, v0 = np.array(p0, float), np.array(v0, float)
        q = Arm.start(p0)
        z = np.concatenate((q, np.linalg.solve(Arm.jacobian(q), v0), p0 + G1 / G0 * v0, v0, p0, v0))
        self.at = int(np.searchsorted(self.edges, p0[0], side="right"))
        self.stops, self.crossings, self.spans, self.solutions, self.modes = [], [], [], [], []
        self.solve(z, [*(x for x in breaks if x < t_end), t_end])

    def __call__(self, times):
        """Position and velocity at ascending times, (n, 2) each."""
        index = np.searchsorted([t for t, _ in self.spans], times, side="right") - 1
        p, v = np.empty((len(times), 2)), np.empty((len(times), 2))
        for i, (t, j) in enumerate(zip(times, index, strict=True)):
            x = self.solutions[j](t)
            p[i], v[i] = Arm.forward(x[:2]) - ORIGIN, Arm.jacobian(x[:2]) @ x[2:4]
        return p, v

    def law(self, i, m):
        """Fy + K m^n of an axis."""
        law = self.laws[self.at]
        m = max(m, 0.0)
        return law["Fy"][i] + (law["K"][i] * m ** law["n"][i] if law["K"][i] else 0.0)

    def parts(self, t, z, near=0.0):
        """Acceleration without yielding and per unit of its force, along the clay's axes."""
        q, w, delta, rate, y, yr = z.reshape(6, 2)
        J, c = Arm.jacobian(q), Arm.jacobian_rate(q, w) @ w
        p, v = Arm.forward(q) - ORIGIN, J @ w
        W = J @ np.linalg.solve(Arm.M, J.T)
        y2 = G0 * (delta - y) - G1 * yr
        want = y2 + S1 * (yr - v) + S0 * (y - p)
        S = np.diag(SG) if self.inertia_shaping else W
        damping = self.R.T @ np.diag(self.laws[self.at]["b"]) @ self.R
        rest = self.uh(t + near) - self.d * v - self.k * p - damping @ v
        P = np.linalg.inv(np.eye(2) + self.m * S)
        return J, c, v, W, S, want, rest, y2, P

    def force(self, v, acc, B, mode):
        """Force of yielding in a mode; acc and B along the clay's axes, v too."""
        if self.isotropic:
            if mode is None:
                return np.linalg.solve(B, acc)
            m = np.linalg.norm(v)
            e = v / m if m > SLOW else mode
            return self.law(0, m) * e
        r = np.array([x * self.law(i, x * v[i]) if x else 0.0 for i, x in enumerate(mode)])
        stuck = [i for i in (0, 1) if mode[i] == 0]
        if stuck:
            need = acc[stuck] - B[stuck] @ r
            r[stuck] = np.linalg.solve(B[np.ix_(stuck, stuck)], need)
        return r

    def rates(self, t, z, mode, near=0.0, full=False):
        """Derivative of the state in a mode; `full`, with v, acceleration and force of clay."""
        J, c, v, W, S, want, rest, y2, P = self.parts(t, z, near)
        R = self.R
        acc, B = P @ (want + S @ rest), P @ S
        a0 = acc
        r = R.T @ self.force(R @ v, R @ acc, R @ B @ R.T, mode)
        acc = acc - B @ r
        f = rest - r - self.m * acc
        tau = J.T @ np.linalg.solve(W, want - c + (S - W) @ f)
        if self.limit is not None and np.any(np.abs(tau) > self.limit):
            tau = np.clip(tau, -np.array(self.limit), self.limit)
            P = np.linalg.inv(np.eye(2) + self.m * W)
            acc, B = P @ (J @ np.linalg.solve(Arm.M, tau) + c + W @ rest), P @ W
            a0 = acc
            r = R.T @ self.force(R @ v, R @ acc, R @ B @ R.T, mode)
            acc = acc - B @ r
            f = rest - r - self.m * acc
        wd = np.linalg.solve(J, acc - c)
        _, w, _, rate, _, yr = z.reshape(6, 2)
        out = np.concatenate((w, wd, rate, self.K * f - 10 * rate, yr, y2))
        return (out, R @ v, R @ acc, R @ r, R @ a0, R @ B @ R.T) if full else out

    def choose(self, t, z, mode, rests, freed):
        """The mode from here on; `rests`: axes without velocity."""
        near = 1e-12
        if self.isotropic:
            if not rests:
                return mode
            _, _, _, r, a0, B = self.rates(t, z, None, near, True)
            need, most = np.linalg.norm(r), self.law(0, 0.0)
            if need <= most and not freed:
                return None
            if need <= most * (1 + 1e-9):
                return r / need

            if most == 0.0:
                return a0 / np.linalg.norm(a0)

            def excess(mu):  # (most B + mu) e = a0, |e| = 1
                return np.linalg.norm(np.linalg.solve(most * B + mu * np.eye(2), a0)) - 1.0

            mu = brentq(excess, 0.0, 10.0 * np.linalg.norm(a0), xtol=1e-14, rtol=1e-14)
            return np.linalg.solve(most * B + mu * np.eye(2), a0)
        options = [(0, 1, -1) if i in rests else (mode[i],) for i in (0, 1)]
        for trial in itertools.product(*options):
            _, _, acc, r, _, _ = self.rates(t, z, trial, near, True)
            good = True
            for i in rests:
                if trial[i] == 0:
                    good &= i != freed and abs(r[i]) <= self.law(i, 0.0)
                else:
                    good &= trial[i] * acc[i] > (-1e-9 if i == freed else 0.0)
                    good &= i != freed or trial[i] == self.freed_sign
            if good:
                return trial
        raise AssertionError("no mode fits")

    def events(self, mode):
        """(what, axis, function) of all that ends a mode."""
        out = []

        def slides(i):
            return lambda t, z: mode[i] * self.velocity(z)[i]

        def holds(i):
            return lambda t, z: self.law(i, 0.0) - abs(self.rates(t, z, mode, 0.0, True)[3][i])

        if self.isotropic:
            if mode is None:
                size = lambda t, z: np.linalg.norm(self.rates(t, z, None, 0.0, True)[3])  # noqa: E731
                out.append(("free", 0, lambda t, z: self.law(0, 0.0) - size(t, z)))
            else:
                out.append(("rest", 0, lambda t, z: np.linalg.norm(self.velocity(z)) - SLOW))
        else:
            for i in (0, 1):
                active = self.laws[self.at]["Fy"][i] > 0 or self.laws[self.at]["K"][i] > 0
                if active:
                    out.append(("rest", i, slides(i)) if mode[i] else ("free", i, holds(i)))
        for j in (self.at - 1, self.at):
            if 0 <= j < len(self.edges):
                place = lambda t, z, x=self.edges[j]: Arm.forward(z[:2])[0] - ORIGIN[0] - x  # noqa: E731
                out.append(("border", j, place))
        return out

    def velocity(self, z):
        """Along the clay's axes."""
        return self.R @ Arm.jacobian(z[:2]) @ z[2:4]

    def put_to_rest(self, z, axes):
        """Without velocity along some of the clay's axes."""
        v = self.velocity(z)
        v[axes] = 0.0
        z = z.copy()
        z[2:4] = np.linalg.solve(Arm.jacobian(z[:2]), self.R.T @ v)
        return z

    def solve(self, z, ends):
        """Piece by piece."""
        t, ended, stuck = 0.0, ("start", 0), [False, False]
        v = self.velocity(z)
        mode = v / max(np.linalg.norm(v), 1e-300) if self.isotropic else [*np.sign(v).astype(int)]
        for end in ends:
            while t < end:
                what, axis = ended
                freed = axis if what == "free" else None
                v = self.velocity(z)
                if self.isotropic:
                    rests = [0] if mode is None or what == "rest" or np.linalg.norm(v) == 0 else []
                    if rests:
                        z = self.put_to_rest(z, [0, 1])
                    mode = self.choose(t, z, mode, rests, freed is not None)
                    now = [mode is None] * 2
                    if mode is not None and np.linalg.norm(self.velocity(z)) < SLOW:
                        z = z.copy()  # a little way on, so that its direction is known
                        z[2:4] = np.linalg.solve(Arm.jacobian(z[:2]), 1.01 * SLOW * mode)
                else:
                    rests = [i for i in (0, 1) if mode[i] == 0]
                    if what == "rest" and axis not in rests:
                        rests.append(axis)
                    z = self.put_to_rest(z, rests)
                    mode = self.choose(t, z, mode, rests, freed)
                    now = [x == 0 for x in mode]
                for i in (0, 1):
                    if now[i] != stuck[i] and not (self.isotropic and i):
                        self.stops.append(("xy" if self.isotropic else "xy"[i], now[i], t))
                stuck = now
                found = self.events(mode)
                s = solve_ivp(
                    self.rates, (t, end), z, self.method, rtol=self.rtol, atol=1e-2 * self.rtol,
                    args=(mode,), dense_output=True,
                    events=[self.begun(f, what, t, z) for what, _, f in found],
                )  # fmt: skip
                self.spans.append((t, s.t[-1]))
                self.solutions.append(s.sol)
                self.modes.append(mode)
                z, t, ended = s.y[:, -1], s.t[-1], ("end", 0)
                for (what, axis, _), times in zip(found, s.t_events, strict=True):
                    if len(times):
                        ended = what, axis
                        if what == "free" and not self.isotropic:
                            self.freed_sign = np.sign(self.rates(t, z, mode, 0.0, True)[3][axis])
                        if what == "border":
                            self.crossings.append(t)
                            self.at = axis + 1 if axis == self.at else axis
                            if not self.isotropic:  # clay that did not yield has no signs
                                v = self.velocity(z)
                                mode = [
                                    0 if abs(v[i]) < 1e-13 else int(np.sign(v[i])) for i in (0, 1)
                                ]
                            elif np.linalg.norm(self.velocity(z)) > 0:
                                v = self.velocity(z)
                                mode = v / np.linalg.norm(v)

    def begun(self, f, what, begins, z):
        """An event as SciPy calls it; what holds at the begin counts from a little later on."""
        at_border = what == "border"
        sign = np.sign((self.R.T @ self.velocity(z))[0]) if at_border else 1.0
        at_once = abs(f(begins, z)) < (1e-12 if at_border else 1e-9)

        def event(t, z, mode):
            return sign * 1e-30 if at_once and t <= begins + 1e-9 else f(t, z)

        event.terminal = True
        return event
