"""The sampled loop in clay that yields: the controller by matrix exponential, the arm and the clay
between samples by SciPy, stopped at every stop and start of an axis.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from .arm import G0, G1, ORIGIN, S0, S1, Arm

# [m/s] in clay that yields along the motion: slower than this the handle is taken to rest, which
# moves it by less than 1e-13 m; its speed when it is let go, of no account
REST, STARTS = 1e-6, 1e-9


class Plant:
    """Arm, operator and clay under torques that are held.

    law is (Fy, K, n, b) of both axes. ways says how each axis moves: 1.0, -1.0, or 0.0 where the
    clay holds it; where the clay yields along the motion, (1.0, 1.0) or (0.0, 0.0).
    """

    def __init__(self, law, along, uh, th):
        self.law, self.along, self.uh = law, along, np.array(uh, float)
        self.m, self.d, self.k = th
        self.ways, self.tau = [0.0, 0.0], np.zeros(2)

    def parts(self, z):
        q, w = z[:2], z[2:]
        J, c = Arm.jacobian(q), Arm.jacobian_rate(q, w) @ w
        p, v = Arm.forward(q) - ORIGIN, J @ w
        hand = self.uh - self.d * v - self.k * p
        W = J @ np.linalg.solve(Arm.M, J.T)
        inertia = np.eye(2) + self.m * W
        free = J @ np.linalg.solve(Arm.M, self.tau) + c + W @ (hand - self.law[3] * v)
        return J, c, p, v, hand, np.linalg.solve(inertia, free), np.linalg.solve(inertia, W)

    def moving(self, v):
        """Yield force of axes that move."""
        Fy, K, n, _ = self.law
        if self.along:
            m = np.hypot(*v)
            return (Fy + K * m**n) * v / m
        return np.array([s * (Fy + K * abs(x) ** n) for s, x in zip(self.ways, v, strict=True)])

    def forces(self, z):
        """Yield force on each axis: of one that rests, what keeps it there."""
        _, _, _, v, _, free, B = self.parts(z)
        still = [i for i in (0, 1) if self.ways[i] == 0.0]
        if not still:
            return self.moving(v)
        f = np.zeros(2) if len(still) == 2 else self.moving(v)
        f[still] = 0.0
        f[still] = np.linalg.solve(B[np.ix_(still, still)], (free - B @ f)[still])
        return f

    def rates(self, _, z):
        J, c, _, _, _, free, B = self.parts(z)
        return np.concatenate((z[2:], np.linalg.solve(J, free - B @ self.forces(z) - c)))

    def sensed(self, z):
        """The hand's force on the sensor, and the clay's."""
        _, _, _, v, hand, free, B = self.parts(z)
        f = self.forces(z)
        return hand - self.m * (free - B @ f), self.law[3] * v + f

    def settle(self, z, share=1.0):
        """Lets those axes go that the clay cannot hold, by this share of its force; velocities of
        the others are 0."""
        J, v = Arm.jacobian(z[:2]), Arm.jacobian(z[:2]) @ z[2:]
        for _ in range(3):
            f, Fy = self.forces(z), self.law[0]
            if self.along:
                if self.ways[0] == 0.0 and np.hypot(*f) > share * Fy:
                    self.ways, v = [1.0, 1.0], STARTS * f / np.hypot(*f)
                break
            goes = [i for i in (0, 1) if self.ways[i] == 0.0 and abs(f[i]) > Fy]
            if not goes:
                break
            i = max(goes, key=lambda i: abs(f[i]))
            self.ways[i] = np.sign(f[i])
        v = np.where(np.array(self.ways) == 0.0, 0.0, v)
        return np.concatenate((z[:2], np.linalg.solve(J, v)))

    def events(self):
        def stops(i):
            def f(_, z):
                v = Arm.jacobian(z[:2]) @ z[2:]
                return np.hypot(*v) - REST if self.along else v[i] * self.ways[i]

            f.terminal, f.direction = True, -1
            return f

        def goes(i):
            def f(_, z):
                r = self.forces(z)
                return (np.hypot(*r) if self.along else abs(r[i])) - self.law[0]

            f.terminal, f.direction = True, 1
            return f

        return [goes(i) if self.ways[i] == 0.0 else stops(i) for i in (0, 1)]

    def hold(self, z, tau, span):
        """State after torques tau for a span."""
        self.tau, t = tau, 0.0
        z = self.settle(z)
        while t < span:
            s = solve_ivp(
                self.rates, (t, span), z, "DOP853", rtol=1e-11, atol=1e-13, events=self.events()
            )
            t, z = s.t[-1], s.y[:, -1]
            if s.status == 1:
                hit = [i for i in (0, 1) if len(s.t_events[i])]
                if self.along:
                    self.ways = [0.0, 0.0] if self.ways[0] else self.ways
                    z = self.settle(z, 1.0 - 1e-9)
                for i in () if self.along else hit:
                    self.ways[i] = 0.0 if self.ways[i] else np.sign(self.forces(z)[i])
                    z = self.settle(z)
        return z


class Samples(NamedTuple):
    """At the samples, (n, 2) each."""

    p: np.ndarray
    v: np.ndarray
    fe: np.ndarray
    tau: np.ndarray


def yielding(  # noqa: PLR0913  # a case, spelt out
    law, Ts, K, uh, th=(0.0, 0.0, 0.0), along=False, render="physical", t_end=0.2, v0=(0.0, 0.0)
):
    """The sampled loop in clay that yields everywhere, as `hybrid.hybrid`.

    Held clay is the law of the velocity at the sample, nothing at rest. Physical clay is known to
    the controller. Returns positions and velocities at the samples, force of the clay there
    before the torques change, and torques held, (n, 2) each.
    """
    K, v0 = np.array(K), np.array(v0, float)
    held = render == "held"
    plant = Plant((0.0, 0.0, 1.0, 0.0) if held else law, along, uh, th)
    shown = Plant(law, along, uh, th)
    blocks = []
    for i in (0, 1):
        A = np.zeros((5, 5))
        A[0, 1] = A[2, 3] = 1
        A[1, 1], A[1, 4] = -10, K[i]
        A[3] = [G0[i], 0, -G0[i], -G1[i], 0]
        blocks.append(expm(A * Ts))
    q = Arm.start(np.zeros(2))
    z = np.concatenate((q, np.linalg.solve(Arm.jacobian(q), v0)))
    loop = np.column_stack((G1 / G0 * v0, v0, np.zeros(2), v0))
    plant.ways = [1.0, 1.0] if held or (along and v0.any()) else list(np.sign(v0))
    P, V, F, T = [], [], [], []
    z = plant.settle(z)
    for k in range(round(t_end / Ts) + 1):
        J, Jd = Arm.jacobian(z[:2]), Arm.jacobian_rate(z[:2], z[2:])
        p, v = Arm.forward(z[:2]) - ORIGIN, J @ z[2:]
        fh, fe = plant.sensed(z)
        if k == 0:  # of a handle that does not accelerate
            fh = plant.uh - plant.d * v
        if held:
            shown.ways = list(np.sign(v))
            fe = law[3] * v + (shown.moving(v) if v.any() else 0.0)
        f = fh - fe
        W = J @ np.linalg.solve(Arm.M, J.T)
        ref = G0 * (loop[:, 0] - loop[:, 2]) - G1 * loop[:, 3]
        want = ref + S1 * (loop[:, 3] - v) + S0 * (loop[:, 2] - p)
        tau = J.T @ np.linalg.solve(W, want - Jd @ z[2:])
        tau = tau - J.T @ fe if held else tau
        for out, x in ((P, p), (V, v), (F, fe), (T, tau)):
            out.append(x)
        loop = np.array([(blocks[i] @ np.append(loop[i], f[i]))[:4] for i in (0, 1)])
        z = plant.hold(z, tau, Ts)
    return Samples(*map(np.array, (P, V, F, T)))
