"""hapticclay itself."""

from __future__ import annotations

import dataclasses
from typing import Any

import hapticclay as hc

from .common import PROBLEMS, Result

NAME = "hapticclay"


def methods() -> dict[str, list[float]]:
    """Integrator, or way of rendering under sampled control -> dt [s], coarse to fine."""
    sampled = [4e-3, 2e-3, 1e-3, 3.6e-4, 1e-4]
    return {
        "fast": [2e-2, 1e-2, 4e-3, 2e-3, 1e-3, 3.6e-4, 1e-4],
        "accurate": [4e-3, 2e-3, 1e-3, 5e-4],
        "sampled, held": sampled,
        "sampled, implicit": sampled,
    }


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with steps of `setting`, every sample recorded."""
    kind, _, render = method.partition(", ")
    way: dict[str, Any] = dict(control=kind, render=render) if render else dict(integrator=kind)
    r = hc.simulate(dataclasses.replace(PROBLEMS[problem], dt=setting, **way))
    note = "" if r.outcome.code == "finished" else r.status
    return Result([c.time for c in r.crossings], r.t, r.p, r.fe[:, 0], r.v[:, 0], r.wall_time, note)
