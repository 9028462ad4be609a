"""SciPy: the arm as a hand-written ODE (common.ode), borders as terminal events.

What one writes without a robotics engine: steps end on the borders, so the adaptive error control
holds everywhere. With numba, DOP853 runs with a compiled right-hand side too: what hapticclay's
compiled loop is to be measured against.
"""

from __future__ import annotations

import functools
import importlib.util
import time

import numpy as np
from scipy.integrate import solve_ivp

from . import common
from .common import EDGES, GRID, L1, L2, Job, Result

NAME = "SciPy"
COMPILED = ", compiled"  # end of the name of a method whose right-hand side is


def methods() -> dict[str, list[float]]:
    """Method -> rtol, coarse to fine."""
    names = ["RK45", "DOP853", "LSODA", "Radau", "BDF"]
    if importlib.util.find_spec("numba"):
        names.insert(2, "DOP853" + COMPILED)
    return {name: [1e-4, 1e-6, 1e-8, 1e-10, 1e-12] for name in names}


@functools.cache
def compiled(problem: str):
    """The compiled right-hand side of a job, warm: compiling it is not part of a run."""
    job = Job.of(problem)
    rhs = common.compiled_ode(job)
    rhs(0.0, common.initial(job), job.b[0])
    return rhs


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with relative tolerance `setting`."""
    job = Job.of(problem)
    solver = method.removesuffix(COMPILED)
    rhs, z = common.ode(job) if solver == method else compiled(problem), common.initial(job)
    grid = np.arange(0.0, job.t_max, GRID)

    def border(edge):
        x0 = job.origin[0] + edge

        def hit(t, z, b):
            return L1 * np.cos(z[0]) + L2 * np.cos(z[1]) - x0

        hit.terminal, hit.direction = True, 1
        return hit

    events = [border(edge) for edge in EDGES]
    t, note = 0.0, ""
    crossings: list[float] = []
    T, Z, B = [], [], []
    begin = time.perf_counter()
    try:
        for hit, b in zip(events, job.b, strict=True):
            s = solve_ivp(
                rhs,
                (t, job.t_max),
                z,
                solver,
                t_eval=grid[grid >= t],
                events=hit,
                args=(b,),
                rtol=setting,
                atol=setting * 1e-2,
            )
            T.append(s.t)
            Z.append(s.y.T.reshape(-1, 12))
            B.append(np.full(len(s.t), b))
            if s.status != 1:
                note = s.message
                break
            t, z = float(s.t_events[0][0]), s.y_events[0][0]
            crossings.append(t)
    except Exception as error:  # noqa: BLE001  a result, not a crash
        note = f"{type(error).__name__}: {error}"
    wall = time.perf_counter() - begin
    p, v = common.of_states(job, np.concatenate([*Z, np.empty((0, 12))]))
    b = np.concatenate([*B, np.empty(0)])
    return Result(crossings, np.concatenate([*T, np.empty(0)]), p, b * v[:, 0], v[:, 0], wall, note)
