"""The sampled loop: controller by matrix exponential, the arm exact between its samples."""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from .arm import G0, G1, ORIGIN, S0, S1, SG, Arm


def hybrid(  # noqa: PLR0913  # a case, spelt out
    b_of_x,
    Ts,
    K,
    uh,
    th=None,
    inertia_shaping=False,
    render="held",
    t_end=1.0,
    edges=(0.05, 0.15),
    p0=(0.0, 0.0),
    v0=(0.0, 0.0),
):
    """The sampled loop: measured and held every Ts, the arm exact (DOP853 at 1e-12) in between.

    b_of_x(x) is the damping on both axes; without edges it may change smoothly. render "held": the
    clay's force is the motors', held too; "physical": it is physical. It starts at p0 and moves
    with v0 as it had before t = 0, without acceleration. Returns positions at the samples (n, 2),
    the velocities there (n, 2), and the torques held (n, 2).
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
        physical = b if render == "physical" else 0.0
        fh = uh - k * p - d * v if tau is None else hand_and_rates(q, w, tau, physical)[0]
        fe = b * v
        f = fh - fe
        W = J @ np.linalg.solve(Arm.M, J.T)
        want = G0 * (z[:, 0] - z[:, 2]) - G1 * z[:, 3] + S1 * (z[:, 3] - v) + S0 * (z[:, 2] - p)
        shape = (np.diag(SG) if inertia_shaping else W) - W
        tau = J.T @ np.linalg.solve(W, want - Jd @ w + shape @ f)
        if render == "held":
            tau = tau - J.T @ fe
        P.append(p)
        V.append(v)
        T.append(tau)
        z = np.array([(blocks[i] @ np.append(z[i], f[i]))[:4] for i in (0, 1)])
        t, x = 0.0, np.concatenate((q, w))
        while t < Ts:
            b = b_of_x(Arm.forward(x[:2])[0] - ORIGIN[0] + 1e-15) if render == "physical" else 0.0

            def rhs(t, x, tau=tau, b=b):
                if render == "physical" and not edges:
                    b = b_of_x(Arm.forward(x[:2])[0] - ORIGIN[0])
                return np.concatenate((x[2:], hand_and_rates(x[:2], x[2:], tau, b)[1]))

            events = []
            if render == "physical":
                for edge in edges:

                    def hit(t, x, edge=edge):
                        return Arm.forward(x[:2])[0] - ORIGIN[0] - edge

                    hit.terminal, hit.direction = True, 1
                    events.append(hit)
            s = solve_ivp(rhs, (t, Ts), x, "DOP853", rtol=1e-12, atol=1e-14, events=events or None)
            t, x = s.t[-1], s.y[:, -1]
        q, w = x[:2], x[2:]
    return np.array(P), np.array(V), np.array(T)


class Samples(NamedTuple):
    """Positions, velocities, and torques at some samples, (n, 2) each."""

    p: np.ndarray
    v: np.ndarray
    tau: np.ndarray


def in_slab(b, begin, end, every, case):
    """As `hybrid` with b from begin to end, to be stored: the first sample, and each so many."""
    found = hybrid(lambda x: b if begin <= x < end else 0.0, **case)
    return Samples(*(x[::every] for x in found))
