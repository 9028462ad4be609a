"""Independent solutions. Nothing here is taken from hapticclay but the printed numbers' meaning.

`piecewise_linear` is the loop at one constant inertia (shaping on), axis by axis, solved by the matrix
exponential. `nonlinear` is the arm in joint space, with its mass matrix, Jacobian and torques spelt
out, integrated by SciPy at 1e-11 with the borders as events.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

# Printed numbers, typed again on purpose (Eqs. 15-20, Sec. 4)
G0, G1 = np.array([910.19, 765.5]), np.array([41.8, 30.3])
SG, S1, S0 = np.array([0.7919, 0.131]), np.array([41.1, 32.4]), np.array([432.0, 492.46])
L1, L2, ORIGIN = 0.24, 0.35, np.array([0.25, 0.24])
I1, I2 = L1**2 / 0.7919, L2**2 / 0.131


class Linear:
    """One axis with constant b: z' = A z, z = (p, v, delta, delta', y, y', 1)."""

    def __init__(self, axis, b, K, uh, th=(0.0, 0.0, 0.0)):
        m, d, k = th
        i = axis
        force = np.array([-k, -(d + b), 0, 0, 0, 0, uh])
        servo = np.array([-S0[i], -S1[i], G0[i], 0, S0[i] - G0[i], S1[i] - G1[i], 0])
        acceleration = (servo + SG[i] * force) / (1 + SG[i] * m)
        f = force - m * acceleration
        self.A = np.zeros((7, 7))
        self.A[0, 1] = self.A[2, 3] = self.A[4, 5] = 1
        self.A[1] = acceleration
        self.A[3] = K * f
        self.A[3, 3] -= 10
        self.A[5] = [0, 0, G0[i], 0, -G0[i], -G1[i], 0]

    def poles(self):
        return np.linalg.eigvals(self.A[:6, :6])


def piecewise_linear(edges, values, K, uh, th=(0.0, 0.0, 0.0), axis=0, t_max=60.0, z0=None):
    """Exact solution along one axis, moving forward through the borders `edges` with b = `values`.

    Returns (crossing times, position(t)).
    """
    z = np.array([0, 0, 0, 0, 0, 0, 1.0]) if z0 is None else np.array(z0, float)
    t, pieces, crossings = 0.0, [], []
    for edge, b in zip(edges, values, strict=True):
        A = Linear(axis, b, K, uh, th).A
        h = 0.002
        E = expm(A * h)
        a, ta = z, t
        while True:
            n = E @ a
            if n[0] >= edge or ta > t_max:
                break
            a, ta = n, ta + h
        pieces.append((t, z, A))
        if ta > t_max:
            break
        s = brentq(lambda s, A=A, a=a, edge=edge: (expm(A * s) @ a)[0] - edge, 0.0, h, xtol=1e-15)
        z = expm(A * s) @ a
        z[0] = edge
        t = ta + s
        crossings.append(t)

    def position(times):
        """p at ascending times [m]."""
        out = np.empty(len(times))
        starts = np.array([p[0] for p in pieces])
        index = np.searchsorted(starts, times, side="right") - 1
        for j, (t0, z0, A) in enumerate(pieces):
            mine = np.flatnonzero(index == j)
            if not len(mine):
                continue
            gaps = np.diff(times[mine])
            uniform = len(mine) > 2 and np.allclose(gaps, gaps[0], rtol=1e-9, atol=0)
            if uniform:
                E = expm(A * gaps[0])
                a = expm(A * (times[mine[0]] - t0)) @ z0
                for i in mine:
                    out[i] = a[0]
                    a = E @ a
            else:
                for i in mine:
                    out[i] = (expm(A * (times[i] - t0)) @ z0)[0]
        return out

    return crossings, position


class Arm:
    """The two-link arm in relative joint angles, from first principles."""

    M = np.array([[I1 + I2, I2], [I2, I2]])

    @staticmethod
    def forward(q):
        a = q[0] + q[1]
        return np.array([L1 * np.cos(q[0]) + L2 * np.cos(a), L1 * np.sin(q[0]) + L2 * np.sin(a)])

    @staticmethod
    def jacobian(q):  # Eq. 14
        s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q[0] + q[1]), np.cos(q[0] + q[1])
        return np.array([[-L1 * s1 - L2 * s12, -L2 * s12], [L1 * c1 + L2 * c12, L2 * c12]])

    @staticmethod
    def jacobian_rate(q, w):
        s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q[0] + q[1]), np.cos(q[0] + q[1])
        w12 = w[0] + w[1]
        return np.array(
            [
                [-L1 * c1 * w[0] - L2 * c12 * w12, -L2 * c12 * w12],
                [-L1 * s1 * w[0] - L2 * s12 * w12, -L2 * s12 * w12],
            ]
        )

    @staticmethod
    def start(p):
        x, y = ORIGIN + p
        q2 = -np.arccos((x * x + y * y - L1 * L1 - L2 * L2) / (2 * L1 * L2))
        return np.array([np.arctan2(y, x) - np.arctan2(L2 * np.sin(q2), L1 + L2 * np.cos(q2)), q2])


class Pieces:
    """A solution with events: dense pieces, one a region."""

    def __init__(self):
        self.crossings, self.spans, self.solutions = [], [], []

    def __call__(self, times):
        """Handle position and velocity at ascending times within the solution, (n, 2) each."""
        index = np.searchsorted([t for t, _ in self.spans], times, side="right") - 1
        p, v = np.empty((len(times), 2)), np.empty((len(times), 2))
        for j, sol in enumerate(self.solutions):
            mine = np.flatnonzero(index == j)
            if len(mine):
                for i, x in zip(mine, sol(times[mine]).T, strict=True):
                    p[i], v[i] = Arm.forward(x[:2]) - ORIGIN, Arm.jacobian(x[:2]) @ x[2:4]
        return p, v


def nonlinear(
    b_of_region,
    edges,
    K,
    uh,
    th=None,
    shaping=False,
    t_max=60.0,
    t_eval=None,
    rtol=1e-11,
    atol=1e-13,
    p0=(0.0, 0.0),
):
    """The whole arm, both axes, a slab across x: b_of_region[i] on both axes between edges i-1 and i.

    Forward crossings of x only; ends at the last edge. Returns (crossing times, t, p (n, 2), v (n, 2)) at
    the times t_eval before the end.
    """
    pieces = nonlinear_pieces(
        b_of_region, edges, K, uh, th, shaping, t_max, rtol, atol, p0, t_eval is not None
    )
    t = np.empty(0) if t_eval is None else t_eval[t_eval < pieces.spans[-1][1]]
    return pieces.crossings, t, *(pieces(t) if len(t) else (np.empty((0, 2)), np.empty((0, 2))))


def nonlinear_pieces(
    b_of_region,
    edges,
    K,
    uh,
    th,
    shaping,
    t_max,
    rtol,
    atol,
    p0=(0.0, 0.0),
    dense=True,
    method="DOP853",
):
    """As `nonlinear`, the solution as Pieces."""
    K, uh = np.array(K), np.array(uh)
    m, d, k = th or (0.0, 0.0, 0.0)
    p0 = np.array(p0, float)

    def rhs(t, z, b):
        q, w, delta, rate, y, yr = z.reshape(6, 2)
        J, Jd = Arm.jacobian(q), Arm.jacobian_rate(q, w)
        p, v, c = Arm.forward(q) - ORIGIN, J @ w, Jd @ w
        W = J @ np.linalg.solve(Arm.M, J.T)
        Lam = np.linalg.inv(W)
        y2 = G0 * (delta - y) - G1 * yr
        want = y2 + S1 * (yr - v) + S0 * (y - p)
        S = np.diag(SG) if shaping else W
        # p'' = want + S f,  f = uh - m p'' - d v - k p - b v
        rest = uh - d * v - k * p - b * v
        acc = np.linalg.solve(np.eye(2) + m * S, want + S @ rest)
        f = rest - m * acc
        tau = J.T @ (Lam @ (want - c + (S - W) @ f))
        wd = np.linalg.solve(Arm.M, tau + J.T @ f)
        return np.concatenate((w, wd, rate, K * f - 10 * rate, yr, y2))

    z = np.concatenate((Arm.start(p0), [0, 0], p0, [0, 0], p0, [0, 0]))
    t, out = 0.0, Pieces()
    for edge, b in zip(edges, b_of_region, strict=True):

        def hit(t, z, b, edge=edge):
            return Arm.forward(z[:2])[0] - ORIGIN[0] - edge

        hit.terminal, hit.direction = True, 1
        s = solve_ivp(
            rhs,
            (t, t_max),
            z,
            method,
            rtol=rtol,
            atol=atol,
            args=(b,),
            events=hit,
            dense_output=dense,
        )
        out.spans.append((t, s.t[-1]))
        out.solutions.append(s.sol)
        z, t = s.y[:, -1], s.t[-1]
        if not len(s.t_events[0]):
            break
        out.crossings.append(t)
    return out


def hybrid(
    b_of_x,
    Ts,
    K,
    uh,
    th=None,
    shaping=False,
    render="held",
    t_end=1.0,
    edges=(0.05, 0.15),
    p0=(0.0, 0.0),
    v0=(0.0, 0.0),
):
    """The sampled loop: measured and held every Ts, the arm exact (DOP853 at 1e-12) in between.

    b_of_x(x) is the damping on both axes. render "held": the clay's force is the motors', held too; "implicit": it is
    physical. It starts at p0 and moves with v0 as it had before t = 0, without acceleration.
    Returns positions at the samples (n, 2), the velocities there (n, 2), and the torques held (n, 2).
    """
    K, uh, p0, v0 = np.array(K), np.array(uh), np.array(p0, float), np.array(v0, float)
    m, d, k = th or (0.0, 0.0, 0.0)
    blocks = []
    for i in (0, 1):
        A = np.zeros((5, 5))
        A[0, 1] = A[2, 3] = 1
        A[1, 1], A[1, 4] = -10, K[i]
        A[3] = [G0[i], 0, -G0[i], -G1[i], 0]
        blocks.append(expm(A * Ts))
    q = Arm.start(p0)
    w, z = np.linalg.solve(Arm.jacobian(q), v0), np.column_stack((p0 + G1 / G0 * v0, v0, p0, v0))
    tau = None
    P, V, T = [], [], []

    def hand_and_rates(q, w, tau, b):
        J, Jd = Arm.jacobian(q), Arm.jacobian_rate(q, w)
        p, v, c = Arm.forward(q) - ORIGIN, J @ w, Jd @ w
        rest = uh - d * v - k * p
        W = J @ np.linalg.solve(Arm.M, J.T)
        free = J @ np.linalg.solve(Arm.M, tau) + c
        acc = np.linalg.solve(np.eye(2) + m * W, free + W @ (rest - b * v))
        fh = rest - m * acc
        return fh, np.linalg.solve(Arm.M, tau + J.T @ (fh - b * v))

    for _ in range(round(t_end / Ts) + 1):
        J, Jd = Arm.jacobian(q), Arm.jacobian_rate(q, w)
        p, v = Arm.forward(q) - ORIGIN, J @ w
        b = b_of_x(p[0])
        physical = b if render == "implicit" else 0.0
        fh = uh - k * p - d * v if tau is None else hand_and_rates(q, w, tau, physical)[0]
        fe = b * v
        f = fh - fe
        W = J @ np.linalg.solve(Arm.M, J.T)
        want = G0 * (z[:, 0] - z[:, 2]) - G1 * z[:, 3] + S1 * (z[:, 3] - v) + S0 * (z[:, 2] - p)
        shape = (np.diag(SG) if shaping else W) - W
        tau = J.T @ np.linalg.solve(W, want - Jd @ w + shape @ f)
        if render == "held":
            tau = tau - J.T @ fe
        P.append(p)
        V.append(v)
        T.append(tau)
        z = np.array([(blocks[i] @ np.append(z[i], f[i]))[:4] for i in (0, 1)])
        t, x = 0.0, np.concatenate((q, w))
        while t < Ts:
            b = b_of_x(Arm.forward(x[:2])[0] - ORIGIN[0] + 1e-15) if render == "implicit" else 0.0

            def rhs(t, x, tau=tau, b=b):
                return np.concatenate((x[2:], hand_and_rates(x[:2], x[2:], tau, b)[1]))

            events = []
            if render == "implicit":
                for edge in edges:

                    def hit(t, x, edge=edge):  # fmt: skip
                        return Arm.forward(x[:2])[0] - ORIGIN[0] - edge

                    hit.terminal, hit.direction = True, 1
                    events.append(hit)
            s = solve_ivp(rhs, (t, Ts), x, "DOP853", rtol=1e-12, atol=1e-14, events=events or None)
            t, x = s.t[-1], s.y[:, -1]
        q, w = x[:2], x[2:]
    return np.array(P), np.array(V), np.array(T)


def bounces(
    edges, values, K, uh, th=(0.0, 0.0, 0.0), axis=0, p0=0.0, v0=0.0, t_max=1.0, times=(), scan=2e-4
):
    """Exact motion along one axis at one constant inertia, through the borders `edges` in both directions.

    b is values[i] between edges i - 1 and i. At the start the loop has moved with v0 for long. A return to a border
    within `scan` seconds of leaving it is missed. In each region the state is that from its border on, with b v for v:
    so it keeps its digits in any clay.

    Returns (crossings as (time, border, velocity), states (p, v, ...) at the ascending times, (n, 7)).
    """
    place = np.array([1.0, 0, 1, 0, 1, 0, 0])  # what a shift of the origin shifts
    z = np.array([0.0, v0, G1[axis] / G0[axis] * v0, v0, 0.0, v0, 1.0])
    region, t, c, crossings, states, times = (
        int(np.searchsorted(edges, p0, side="right")),
        0.0,
        p0,
        [],
        [],
        list(times),
    )
    while True:
        scale = np.array([1.0, max(values[region], 1.0), 1.0, 1.0, 1.0, 1.0, 1.0])
        A = Linear(axis, values[region], K, uh - th[2] * c, th).A * scale[:, None] / scale
        z = z * scale
        low = edges[region - 1] - c if region else -np.inf
        high = edges[region] - c if region < len(edges) else np.inf
        E, a, ta = expm(A * scan), z, t
        while ta < t_max and low <= (ahead := E @ a)[0] <= high:
            a, ta = ahead, ta + scan
        end = t_max
        if ta < t_max:
            border = high if ahead[0] > high else low
            # next to a border that it has just left, the handle is on the near side of it already
            begin = 1e-3 * scan if a is z and border == 0.0 else 0.0
            h = brentq(
                lambda h, A=A, a=a, d=border: (expm(A * h) @ a)[0] - d,
                begin,
                scan,
                xtol=1e-17,
                rtol=1e-15,
            )
            end = ta + h
        while times and times[0] <= min(end, t_max):
            states.append((expm(A * (times.pop(0) - t)) @ z) / scale + c * place)
        if end >= t_max:
            return crossings, np.array(states).reshape(-1, 7)
        z, t = (expm(A * h) @ a) / scale, end
        crossings.append((t, c + border, float(z[1])))
        z, c = z - z[0] * np.eye(7)[0] - border * (place - np.eye(7)[0]), c + border
        region += 1 if border == high else -1
