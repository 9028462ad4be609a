"""The rows of a sweep: parameters, outcome and measurements of a run, and its run time."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..model.constants import AXES
from ..scene.experiments import parameter_unit
from ..simulation.record import Record
from ..theory.pose_limits import PoseLimits

CROSSINGS_KEPT = 3  # crossings that have columns of their own
Notes = Mapping[str, tuple[str, str]]  # unit and description; crossing1 and x stand for their likes
RESULT_COLUMNS: Notes = {
    "run": ("", "number of the run"),
    "status": ("", "how it ended; refused if a parameter was out of bounds"),
    "axis": ("", "the unstable axis, empty for none"),
    "cause": ("", "what happened, or why it was refused"),
    "end_time": ("s", "simulated time of the end"),
    "crossing1": ("s", "when the handle crossed a border, of the first three"),
    "b_x": ("N.s/m", "damping of the stiffest clay that the handle met"),
    "fe_over_v_x": ("N.s/m", "force of that clay over the velocity, where the speed is steady"),
    "speed_x": ("m/s", "steady speed in that clay"),
    "gain_margin_x": ("factor on K", "least gain limit of the linear loop in that clay, over K"),
    "energy_residual": ("share of the energy put through", "residual of the energy balance"),
    "wall_time": ("s", "run time"),
}


def column_note(name: str, notes: Notes = RESULT_COLUMNS) -> tuple[str, str]:
    """Unit and description of a column of the data set, "" for no unit."""
    like = re.sub("_y$", "_x", re.sub(r"^crossing\d$", "crossing1", name))
    return notes.get(like) or (parameter_unit(name), "parameter of the run")


def result_row(
    index: int, names: list[str], point: np.ndarray, r: Record | None, refused: str = ""
) -> dict[str, Any]:
    """One row of the data set: parameters, outcome and measurements; NaN for none."""
    nan = math.nan
    out: dict[str, Any] = {"run": index, **dict(zip(names, point.tolist(), strict=True))}
    out |= {
        "status": r.outcome.code if r else "refused",
        "axis": r.outcome.axis if r else "",
        "cause": r.outcome.cause if r else refused,
        "end_time": r.outcome.time if r else nan,
    }
    times = [c.time for c in r.crossings] if r else []
    out |= {f"crossing{k + 1}": times[k] if k < len(times) else nan for k in range(CROSSINGS_KEPT)}
    for i, axis in enumerate(AXES):
        deepest = max(r.regions(axis), key=lambda x: x[axis]["b"], default=None) if r else None
        entry = deepest[axis] if deepest else {}
        fe = entry.get("steady_fe_over_v") or {}
        speed = entry.get("steady_speed")
        out |= {
            f"b_{axis}": entry.get("b", nan),
            f"fe_over_v_{axis}": fe.get("mean", nan),
            f"speed_{axis}": nan if speed is None else speed,
        }
        margin = nan
        clay = r and r.scenario.clay
        linear = not clay or clay.viscous
        if r and linear and r.scenario.gain[i] > 0.0:
            margin = _least_limit(r, axis, deepest) / r.scenario.gain[i]
        out[f"gain_margin_{axis}"] = margin
    through = r.energy.get("throughput", 0.0) if r else 0.0
    out["energy_residual"] = abs(r.energy["residual"]) / through if r and through else nan
    out["wall_time"] = r.wall_time if r else nan
    return out


def _least_limit(r: Record, axis: str, stretch: dict[str, Any] | None) -> float:
    """The least gain limit of the linear loop over a stretch of a run, else at its start."""
    s, i, limits = r.scenario, AXES.index(axis), PoseLimits(r.scenario)
    if stretch is None:
        return limits.at(i, s.start, (0.0, 0.0))
    rows = (r.t >= stretch["from_s"]) & (r.t <= stretch["to_s"])
    low, high = r.p[rows].min(axis=0), r.p[rows].max(axis=0)
    return limits.least(i, (low[0], low[1]), (high[0], high[1])).K
