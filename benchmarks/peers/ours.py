"""hapticclay itself."""

from __future__ import annotations

import dataclasses
from typing import Any

import hapticclay as hc
from hapticclay.kernel import native as kernel

from ..common import warm
from .common import PROBLEMS, Result

NAME = "hapticclay"


def methods() -> dict[str, list[float]]:
    """Map each method to its dt [s], coarse to fine.

    A method is an integrator in Python, its compiled form, or a rendering under sampled control,
    compiled where the kernel is there.
    """
    fast = [2e-2, 1e-2, 4e-3, 2e-3, 1e-3, 3.6e-4, 1e-4]
    accurate = [4e-3, 2e-3, 1e-3, 5e-4]
    sampled = [4e-3, 2e-3, 1e-3, 3.6e-4, 1e-4]
    native: dict[str, list[float]] = {}
    if kernel.is_there():
        warm()  # before the clock runs
        native["fast, native"] = [*fast, 3.6e-5, 1e-5]
        native["accurate, native"] = [*accurate, 2.5e-4, 1.6e-4]
    return {
        "fast": fast,
        **native,
        "accurate": accurate,
        "sampled, held": sampled,
        "sampled, physical": sampled,
    }


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with steps of `setting`, every sample recorded."""
    kind, _, how = method.partition(", ")
    way: dict[str, Any] = (
        dict(control=kind, render=how) if kind == "sampled" else dict(integrator=kind)
    )
    engine = "auto" if kind == "sampled" else "native" if how == "native" else "python"
    r = hc.simulate(dataclasses.replace(PROBLEMS[problem], dt=setting, **way), engine=engine)
    note = "" if r.outcome.code == "finished" else r.status
    return Result([c.time for c in r.crossings], r.t, r.p, r.fe[:, 0], r.v[:, 0], r.wall_time, note)
