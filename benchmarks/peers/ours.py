"""hapticclay itself."""

from __future__ import annotations

import dataclasses

import hapticclay as hc

from .common import PROBLEMS, Result

NAME = "hapticclay"


def methods() -> dict[str, list[float]]:
    """Integrator -> dt [s], coarse to fine."""
    return {"fast": [2e-2, 1e-2, 4e-3, 2e-3, 1e-3, 3.6e-4, 1e-4], "accurate": [4e-3, 2e-3, 1e-3, 5e-4]}


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with steps of `setting`, every sample recorded."""
    r = hc.simulate(dataclasses.replace(PROBLEMS[problem], integrator=method, dt=setting))
    note = "" if r.outcome.code == "finished" else r.status
    return Result([c.time for c in r.crossings], r.t, r.p, r.fe[:, 0], r.v[:, 0], r.wall_time, note)
