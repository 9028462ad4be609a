"""The loop with any parts: arm, servo, compensator and hand of each axis.

One axis of the shaped loop by the matrix exponential; both axes and the arm as it is by SciPy, its
controller continuous or sampled. States of the compensator are those of scipy.signal.tf2ss, the arm
is written in absolute angles with its handle a complex number; nothing of the package is used but
the numbers of a scenario's parts.
"""

import bisect
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.signal import tf2ss


def realisation(compensator, K):
    """A, B, C, D of K num/den."""
    if len(compensator.den) == 1:
        D = K * compensator.num[0] / compensator.den[0]
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), D
    A, B, C, D = tf2ss(np.atleast_1d(compensator.num), np.atleast_1d(compensator.den))
    return A, K * B[:, 0], C[0], K * float(D[0, 0])


def impedance(operator):
    """Mass, damper and spring; zeros for no hand."""
    return (operator.mass, operator.damper, operator.spring) if operator else (0.0, 0.0, 0.0)


def system(servo, compensator, K, operator, b, start=0.0):
    """z' = A z + B uh with z = (p, v, states of C, y, y', 1); also the rows of f and of delta."""
    Ac, Bc, Cc, Dc = realisation(compensator, K)
    n = len(Bc)
    m, d, k = impedance(operator)
    G, S = servo.G, servo.S
    size = n + 5
    p, v, y, yd, one = 0, 1, n + 2, n + 3, n + 4

    def row(**at):
        out = np.zeros(size + 1)  # the last one is uh
        for name, x in at.items():
            out[dict(p=p, v=v, y=y, yd=yd, one=one, uh=size)[name]] = x
        return out

    shown = row(one=start)
    shown[2 : 2 + n] = Cc
    external = row(uh=1.0, p=-k, v=-d - b)
    base = G.gain * shown + row(y=-G.stiffness, yd=-G.damping)
    law = base + S.damping * row(yd=1.0, v=-1.0) + S.stiffness * row(y=1.0, p=-1.0)
    W = S.gain + G.gain * Dc  # what a force does at once, by way of Sh and of C
    acceleration = (law + W * external) / (1.0 + m * W)
    f = external - m * acceleration
    M = np.zeros((size, size + 1))
    M[p, v] = M[y, yd] = 1.0
    M[v] = acceleration
    M[yd] = base + G.gain * Dc * f
    M[2 : 2 + n] = np.outer(Bc, f)
    M[2 : 2 + n, 2 : 2 + n] += Ac
    return M[:, :size], M[:, size], f, shown + Dc * f


def at_rest(servo, compensator, start):
    """The state of a handle that rests at start."""
    z = np.zeros(len(compensator.den) - 1 + 5)
    z[0] = start
    z[-3] = start
    z[-1] = 1.0
    return z


def forward(scenario, axis, edges, values, t_max, scan=1e-3, times=()):
    """One axis of the shaped loop on its way through `edges`, with b = `values` before each.

    Returns (times at which it passes them, positions at the ascending `times` before the last one).
    """
    i = "xy".index(axis)
    servo, c, th = scenario.servo[i], scenario.compensators[i], scenario.operators[i]
    start = scenario.start[i]
    shown = start * servo.G.stiffness / servo.G.gain
    z, t, found, place, times = at_rest(servo, c, start), 0.0, [], [], list(times)
    for edge, b in zip(edges, values, strict=True):
        A, B, _, _ = system(servo, c, scenario.gain[i], th, b, shown)
        A = A.copy()
        A[:, -1] += B * scenario.force[i]
        scale = np.ones(len(z))  # with b v for v the state keeps its digits in any clay
        scale[1] = max(b, 1.0)
        A, z = A * scale[:, None] / scale, z * scale
        E, a, ta = expm(A * scan), z, t
        while (ahead := E @ a)[0] < edge and ta < t_max:
            a, ta = ahead, ta + scan
        end = t_max
        if ta < t_max:
            h = brentq(lambda h, A=A, a=a, d=edge: (expm(A * h) @ a)[0] - d, 0.0, scan, xtol=1e-15)
            end = ta + h
        while times and times[0] <= end:
            place.append((expm(A * (times.pop(0) - t)) @ z)[0])
        if ta >= t_max:
            break
        z, t = (expm(A * h) @ a) / scale, end
        found.append(t)
    return found, np.array(place)


def growth(scenario, axis, K, b):
    """Largest real part of the poles of one axis, less those at zero."""
    i = "xy".index(axis)
    parts = scenario.servo[i], scenario.compensators[i], K, scenario.operators[i], b
    z = np.linalg.eigvals(system(*parts)[0][:-1, :-1])
    return z.real[np.abs(z) > 1e-5].max()


class TwoLink:
    """The arm in absolute angles, in which its inertia is diag(I1, I2)."""

    def __init__(self, arm):
        self.l = np.array([arm.l1, arm.l2])
        self.I = np.array([arm.I1, arm.I2])

    def place(self, a):
        return _plane(self.l @ np.exp(1j * a))

    def jacobian(self, a):
        return np.array(_plane(1j * self.l * np.exp(1j * a)))

    def centripetal(self, a, w):
        """J' w."""
        return _plane(-(self.l * w**2) @ np.exp(1j * a))

    def angles(self, place):
        """Elbow on the left of the way to the handle, q2 < 0: by the law of cosines."""
        r, (l1, l2) = np.hypot(*place), self.l
        first = np.arctan2(place[1], place[0]) + np.arccos((r**2 + l1**2 - l2**2) / (2 * r * l1))
        elbow = l1 * np.exp(1j * first)
        return np.array([first, np.angle(complex(*place) - elbow)])


def _plane(z):
    return np.array([z.real, z.imag])


class Loop:
    """Both axes and the arm as it is: z = (angles, rates, states of C of x and y, y, y').

    uh(t) is the muscle force, that of the scenario by default.
    """

    def __init__(self, scenario, uh=None):
        s = self.s = scenario
        self.arm, self.origin = TwoLink(s.arm), np.array(s.origin)
        self.uh = uh or (lambda t: np.array(s.force))
        self.G, self.S = (
            np.array([[p.gain, p.damping, p.stiffness] for p in pair]).T
            for pair in zip(*((x.G, x.S) for x in s.servo), strict=True)
        )
        self.C = [realisation(*x) for x in zip(s.compensators, s.gain, strict=True)]
        self.D = np.array([x[3] for x in self.C])
        self.th = np.array([impedance(x) for x in s.operators]).T
        n = [len(x[1]) for x in self.C]
        self.own = [slice(4, 4 + n[0]), slice(4 + n[0], 4 + sum(n))]
        self.y = 4 + sum(n)
        self.shown = np.array(s.start) * self.G[2] / self.G[0]

    def start(self):
        z = np.zeros(self.y + 4)
        z[:2] = self.arm.angles(self.origin + self.s.start)
        z[self.y : self.y + 2] = self.s.start
        J = self.arm.jacobian(z[:2])
        z[2:4] = np.linalg.solve(J, self.s.velocity)
        return z

    def motion(self, z):
        """Position, velocity, Jacobian, J' w, mobility of the handle."""
        a, w = z[:2], z[2:4]
        J = self.arm.jacobian(a)
        return (
            self.arm.place(a) - self.origin, J @ w, J, self.arm.centripetal(a, w),
            (J / self.arm.I) @ J.T,
        )  # fmt: skip

    def wanted(self, z, p, v):
        """Acceleration of the handle but for the force's, and y'' but for it."""
        show = self.shown + [x[2] @ z[at] for x, at in zip(self.C, self.own, strict=True)]
        y, rate = z[self.y : self.y + 2], z[self.y + 2 : self.y + 4]
        y2 = self.G[0] * show - self.G[2] * y - self.G[1] * rate
        return y2 + self.S[1] * (rate - v) + self.S[2] * (y - p), y2

    def force_of(self, t, p, v):
        """Of the hand but for its mass."""
        return self.uh(t) - self.th[1] * v - self.th[2] * p

    def moved(self, J, c, W, torque, rest):
        """Acceleration of the handle under torques on the joints and a force, less the mass's."""
        on_links = np.array([torque[0] - torque[1], torque[1]])
        free = J @ (on_links / self.arm.I) + c
        return np.linalg.solve(np.eye(2) + W * self.th[0], free + W @ rest)

    def torque(self, J, c, W, want, f):
        """Of the joints, that give the handle `want` and Sh beside the net force f."""
        shape = np.diag(self.S[0]) if self.s.inertia_shaping else W
        at_hand = np.linalg.solve(W, want - c + (shape - W) @ f)
        on_links = J.T @ at_hand
        return np.array([on_links.sum(), on_links[1]])

    def rates(self, t, z, b):
        p, v, J, c, W = self.motion(z)
        want, y2 = self.wanted(z, p, v)
        rest = self.force_of(t, p, v) - b * v
        shape = np.diag(self.S[0]) if self.s.inertia_shaping else W
        all_of_f = shape + np.diag(self.G[0] * self.D)
        acc = np.linalg.solve(np.eye(2) + all_of_f * self.th[0], want + all_of_f @ rest)
        f = rest - self.th[0] * acc
        torque = self.torque(J, c, W, want + self.G[0] * self.D * f, f)
        limit = np.array(self.s.torque_limit)
        if np.any(np.abs(torque) > limit):
            acc = self.moved(J, c, W, np.clip(torque, -limit, limit), rest)
            f = rest - self.th[0] * acc
        out = np.empty(len(z))
        out[:2], out[2:4] = z[2:4], np.linalg.solve(J, acc - c)
        for i, (x, at) in enumerate(zip(self.C, self.own, strict=True)):
            out[at] = x[0] @ z[at] + x[1] * f[i]
        out[self.y : self.y + 2] = z[self.y + 2 : self.y + 4]
        out[self.y + 2 :] = y2 + self.G[0] * self.D * f
        return out

    def clay(self, at):
        """Damping of both axes in the region that holds the place `at`."""
        profiles = (self.s.clay.x, self.s.clay.y) if self.s.clay else ()
        b = [f.values[bisect.bisect_right(f.edges, at["xy".index(f.along)])] for f in profiles]
        return np.array(b or [0.0, 0.0])


def solve(scenario, times, uh=None, method="DOP853", rtol=1e-11, atol=1e-13):
    """The loop through layers of clay, to the last of the ascending `times` or the end of the path.

    Returns (times at which it passes borders, positions at `times` until the end, (n, 2)).
    """
    loop = Loop(scenario, uh)
    profiles = (scenario.clay.x, scenario.clay.y) if scenario.clay else ()
    borders = [sorted({e for f in profiles if f.along == x for e in f.edges}) for x in "xy"]
    if scenario.length is not None:
        borders[0] = sorted({e for e in borders[0] if e < scenario.length} | {scenario.length})
    at = [bisect.bisect_right(borders[i], scenario.start[i]) for i in (0, 1)]
    z, t, passed, out = loop.start(), 0.0, [], []
    while t < times[-1]:
        fences = [[-np.inf, *e, np.inf] for e in borders]
        around = [(fences[i][at[i]], fences[i][at[i] + 1]) for i in (0, 1)]
        inside = [np.clip(0.0, a + 1e-9, b - 1e-9) for a, b in around]
        events = [
            _hit(loop, i, around[i][j], (-1, 1)[j])
            for i in (0, 1)
            for j in (0, 1)
            if np.isfinite(around[i][j])
        ]
        found = solve_ivp(
            loop.rates, (t, times[-1]), z, method, rtol=rtol, atol=atol, args=(loop.clay(inside),),
            events=events or None, dense_output=True,
        )  # fmt: skip
        z, t = found.y[:, -1], found.t[-1]
        mine = times[len(out) :][times[len(out) :] <= t]
        out += [loop.arm.place(x[:2]) - loop.origin for x in map(found.sol, mine)]
        if found.status != 1:
            break
        k = next(k for k, x in enumerate(found.t_events) if len(x))
        passed.append(t)
        at[events[k].axis] += events[k].way
        if scenario.length is not None and events[k].edge == scenario.length:
            break
    return passed, np.array(out)


class Places(NamedTuple):
    """Positions of a handle, (n, 2)."""

    p: np.ndarray


def positions(scenario, times, accuracy):
    """As `solve`, to be stored."""
    return Places(solve(scenario, times, **accuracy)[1])


class Passed(NamedTuple):
    """Times of a handle at borders."""

    t: np.ndarray


def passed(scenario, axis, edges, values):
    """As `forward`, to be stored."""
    return Passed(np.array(forward(scenario, axis, edges, values, 60.0, scan=5e-3)[0]))


def _hit(loop, axis, edge, way):
    def event(t, z, b):
        return loop.arm.place(z[:2])[axis] - loop.origin[axis] - edge

    event.terminal, event.direction, event.axis, event.edge, event.way = True, way, axis, edge, way
    return event


def sampled(scenario, t_end, uh=None, friction=(0.0, 0.0), way=(1.0, 1.0)):
    """The sampled loop: controller exact over a sample in which f is held, the arm between samples.

    Clay that is held may have borders; physical clay is that of the start. Joints slide the given
    way all along. Returns positions and velocities at the samples, and torques, (n, 2) each.
    """
    loop, T = Loop(scenario, uh), scenario.Ts or scenario.dt
    blocks = []
    for i, (A, B, C, D) in enumerate(loop.C):
        n, (gain, damping, stiffness) = len(B), loop.G[:, i]
        m = np.zeros((n + 4, n + 4))  # (z, y, y', 1, f)
        m[:n, :n], m[:n, n + 3], m[n, n + 1] = A, B, 1.0
        m[n + 1] = [*gain * C, -stiffness, -damping, gain * loop.shown[i], gain * D]
        blocks.append(expm(m * T))
    z, limit, torque = loop.start(), np.array(scenario.torque_limit), None
    physical, rub = scenario.render == "physical", -np.multiply(friction, way)
    P, V, Q = [], [], []
    for k in range(round(t_end / T) + 1):
        t = k * T
        p, v, J, c, W = loop.motion(z)
        b = loop.clay(p)
        rest = loop.force_of(t, p, v)
        fh = rest
        if torque is not None:
            resisted = rest - b * v if physical else rest
            fh = rest - loop.th[0] * loop.moved(J, c, W, torque + rub, resisted)
        f = fh - b * v
        want, _ = loop.wanted(z, p, v)
        torque = loop.torque(J, c, W, want + loop.G[0] * loop.D * f, f)
        if not physical:
            on_links = J.T @ (b * v)
            torque = torque - [on_links.sum(), on_links[1]]
        torque = np.clip(torque, -limit, limit)
        P.append(p)
        V.append(v)
        Q.append(torque)
        x = z.copy()
        for i, at in enumerate(loop.own):
            y = [loop.y + i, loop.y + 2 + i]
            new = blocks[i] @ [*z[at], *z[y], 1.0, f[i]]
            x[at], x[y] = new[:-4], new[-4:-2]

        def rhs(t, arm, torque=torque + rub, b=b if physical else 0.0):
            p, v, J, c, W = loop.motion(arm)
            acc = loop.moved(J, c, W, torque, loop.force_of(t, p, v) - b * v)
            return np.concatenate((arm[2:], np.linalg.solve(J, acc - c)))

        x[:4] = solve_ivp(rhs, (t, t + T), z[:4], "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        z = x
    return np.array(P), np.array(V), np.array(Q)
