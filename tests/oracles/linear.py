"""The loop at one constant inertia (shaping on), axis by axis, by the matrix exponential."""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from .arm import G0, G1, S0, S1, SG


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


def axis_rates(axis, K, th=(0.0, 0.0, 0.0)):
    """Rates of z = (p, v, delta, delta', y, y') of one axis, a function of z, b, uh and a command.

    The command adds to delta where the reference model sees it.
    """
    free, one = (Linear(axis, b, K, 0.0, th).A for b in (0.0, 1.0))
    forced = Linear(axis, 0.0, K, 1.0, th).A[:, 6]

    def rates(z, b, uh, command=0.0):
        shown = np.append(z, 0.0)
        shown[2] += command
        return ((free + b * (one - free)) @ shown + forced * uh)[:6]

    return rates


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


def bounces(  # noqa: PLR0913  # a case, spelt out
    edges, values, K, uh, th=(0.0, 0.0, 0.0), axis=0, p0=0.0, v0=0.0, t_max=1.0, times=(), scan=2e-4
):
    """Exact motion along one axis at one constant inertia, through borders both ways.

    b is values[i] between edges i - 1 and i. At the start the loop has moved with v0 for long. A
    return to a border within `scan` seconds of leaving it is missed. In each region the state is
    that from its border on, with b v for v: so it keeps its digits in any clay.

    Returns (crossings as (time, border, velocity), states (p, v, ...) at the ascending times, (n,
    7)).
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
