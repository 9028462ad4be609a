"""The arm in joint space under SciPy at 1e-11, borders as events."""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from .arm import ORIGIN, Arm
from .arm_loop import arm_loop


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


class Solved(NamedTuple):
    """A solution at some times: crossings [s], t [s], p [m] and v [m/s] of shape (n, 2)."""

    crossings: list[float]
    t: np.ndarray
    p: np.ndarray
    v: np.ndarray


def nonlinear(  # noqa: PLR0913  # a case, spelt out
    b_of_region,
    edges,
    K,
    uh,
    th=None,
    inertia_shaping=False,
    t_max=60.0,
    t_eval=None,
    rtol=1e-11,
    atol=1e-13,
    p0=(0.0, 0.0),
):
    """The whole arm in a slab across x.

    b is b_of_region[i] on both axes between edges i-1 and i.

    Forward crossings of x only; ends at the last edge. Solved at the times t_eval before the end.
    """
    pieces = nonlinear_pieces(
        b_of_region, edges, K, uh, th, inertia_shaping, t_max, rtol, atol, p0, t_eval is not None
    )
    t = np.empty(0) if t_eval is None else t_eval[t_eval < pieces.spans[-1][1]]
    there = pieces(t) if len(t) else (np.empty((0, 2)), np.empty((0, 2)))
    return Solved(pieces.crossings, t, *there)


def nonlinear_pieces(  # noqa: PLR0913  # a case, spelt out
    b_of_region,
    edges,
    K,
    uh,
    th,
    inertia_shaping,
    t_max,
    rtol,
    atol,
    p0=(0.0, 0.0),
    dense=True,
    method="DOP853",
):
    """As `nonlinear`, the solution as Pieces."""
    rates, p0 = arm_loop(K, uh, th, inertia_shaping), np.array(p0, float)

    def rhs(t, z, b):
        return rates(z, lambda p, v: b * v)

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
