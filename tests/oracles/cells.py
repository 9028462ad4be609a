"""The arm in joint space under SciPy, in clay of cells on a grid, with rotated axes or not."""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from .arm import ORIGIN, Arm
from .arm_loop import arm_loop


class Solved(NamedTuple):
    """Crossings as (coordinate, border [m], time [s]); p [m] and v [m/s] at the times, (n, 2)."""

    crossings: list[tuple[int, float, float]]
    p: np.ndarray
    v: np.ndarray


def cells(  # noqa: PLR0913  # a case, spelt out
    edges,
    b,
    K,
    uh,
    times,
    th=(0.0, 0.0, 0.0),
    inertia_shaping=False,
    angle=0.0,
    grows=None,
    length=np.inf,
    place=None,
):
    """Motion from rest at p = 0, DOP853 at 1e-12, up to the last of the times.

    b(i, j) are the dampings of the clay's own axes in the cell (i, j) between the edges, and
    grows(i, j) the rates at which they grow from the first entry; place(p), if given, replaces b.
    """
    rates = arm_loop(K, uh, th, inertia_shaping)
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    entered = {}

    def rhs(t, z, cell):
        def clay(p, v):
            now = np.array(place(p) if place else b(*cell), float)
            if grows:
                now = now + np.array(grows(*cell)) * (t - entered[cell])
            return R @ (now * (R.T @ v))

        return rates(z, clay)

    z, t, crossings, p, v = np.concatenate((Arm.start((0.0, 0.0)), np.zeros(10))), 0.0, [], [], []
    cell = tuple(int(np.searchsorted(e, 0.0, side="right")) for e in edges)
    times = np.asarray(times, float)
    while True:
        entered.setdefault(cell, t)
        events, borders = [], []
        for i in (0, 1):
            for up in (1, -1):
                n = cell[i] if up > 0 else cell[i] - 1
                if 0 <= n < len(edges[i]):
                    border = edges[i][n]

                    def hit(t, z, cell, i=i, border=border):
                        return Arm.forward(z[:2])[i] - ORIGIN[i] - border

                    hit.terminal, hit.direction = True, up
                    events.append(hit)
                    borders.append((i, up, border))
        ask = times[(times > t) & (times <= times[-1])]
        s = solve_ivp(
            rhs, (t, times[-1]), z, "DOP853", rtol=1e-12, atol=1e-14, args=(cell,), events=events,
            dense_output=True,
        )  # fmt: skip
        ask = ask[ask <= s.t[-1]]
        for x in s.sol(ask).T if len(ask) else ():
            p.append(Arm.forward(x[:2]) - ORIGIN)
            v.append(Arm.jacobian(x[:2]) @ x[2:4])
        if s.status != 1:
            return Solved(crossings, np.array(p), np.array(v))
        t, z = s.t[-1], s.y[:, -1]
        n = next(n for n, at in enumerate(s.t_events) if len(at))
        i, up, border = borders[n]
        crossings.append((i, border, t))
        cell = (cell[0] + up, cell[1]) if i == 0 else (cell[0], cell[1] + up)
        if i == 0 and border >= length:
            return Solved(crossings, np.array(p), np.array(v))
