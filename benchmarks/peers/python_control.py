"""python-control: the same ODE as a NonlinearIOSystem, input_output_response.

"RK45", "LSODA": b(x) inside the rhs, the plain use; the error control has to find the borders by
rejecting steps. "RK45, events", "LSODA, events": input_output_response has no events of its own,
but hands solve_ivp_kwargs through, so each border can end a call, and with evaluation_times=None
the last sample is the border.
"""

from __future__ import annotations

import time

import control
import numpy as np

from . import common
from .common import EDGES, L1, L2, Job, Result

NAME = "python-control"
SAMPLE = 1e-3  # [s] of the output, where crossings are interpolated


def methods() -> dict[str, list[float]]:
    """Method -> rtol, coarse to fine."""
    return {
        name: [1e-4, 1e-6, 1e-8, 1e-10]
        for name in ("RK45", "LSODA", "RK45, events", "LSODA, events")
    }


def _border(x: float):
    """Terminal event of solve_ivp: the handle reaches world x [m]."""

    def hit(t, z):
        return L1 * np.cos(z[0]) + L2 * np.cos(z[1]) - x

    hit.terminal, hit.direction = True, 1
    return hit


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with relative tolerance `setting`."""
    job = Job.of(problem)
    name, _, events = method.partition(", ")
    rhs = common.ode(job)
    # the muscle force is constant and part of the ODE; the one input is there for
    # input_output_response and unused
    system = control.nlsys(
        lambda t, z, u, params: rhs(t, z, params["b"]), inputs=1, states=12, params={"b": None}
    )
    z, tolerances = common.initial(job), {"rtol": setting, "atol": setting * 1e-2}
    crossings: list[float] = []
    T, Z, B, note = [], [], [], ""
    begin = time.perf_counter()
    try:
        if events:
            t = 0.0
            for edge, b in zip(EDGES, job.b, strict=True):
                r = control.input_output_response(
                    system,
                    [t, job.t_max],
                    0.0,
                    z,
                    params={"b": b},
                    evaluation_times=None,
                    solve_ivp_method=name,
                    solve_ivp_kwargs=tolerances | {"events": _border(job.origin[0] + edge)},
                )
                T.append(r.time)
                Z.append(r.states.T)
                B.append(np.full(len(r.time), b))
                t, z = float(r.time[-1]), r.states[:, -1]
                if t >= job.t_max:
                    note = "t_max"
                    break
                crossings.append(t)
        # one call, ended a little behind the path by an event, or it would go on to the end of the
        # reach
        else:
            grid = np.arange(0.0, job.t_max, SAMPLE)
            stop = _border(job.origin[0] + EDGES[-1] + 1e-3)
            r = control.input_output_response(
                system,
                grid,
                0.0,
                z,
                solve_ivp_method=name,
                solve_ivp_kwargs=tolerances | {"events": stop},
            )
            T, Z = [r.time], [r.states.T]
    except Exception as error:  # noqa: BLE001  a result, not a crash
        note = f"{type(error).__name__}: {error}"
    wall = time.perf_counter() - begin
    t = np.concatenate([*T, np.empty(0)])
    p, v = common.of_states(job, np.concatenate([*Z, np.empty((0, 12))]))
    if events:
        b = np.concatenate([*B, np.empty(0)])
    else:
        crossings = common.hermite(t, p[:, 0], v[:, 0])
        b = np.array(job.b)[np.searchsorted(EDGES[:2], p[:, 0], side="right")]
        if len(crossings) < len(EDGES):
            note = note or "x < last edge at t_max"
    return Result(crossings, t, p, b * v[:, 0], v[:, 0], wall, note)
