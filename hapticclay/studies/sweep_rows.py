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
MEASURED = ("b", "fe_over_v", "speed", "gain_margin")  # columns for each axis
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
    crossings = [f"crossing{k + 1}" for k in range(CROSSINGS_KEPT)]
    measured = [f"{name}_{axis}" for axis in AXES for name in MEASURED]
    numbers = ["end_time", *crossings, *measured, "energy_residual", "wall_time"]
    row = {"run": index, **dict(zip(names, point.tolist(), strict=True))}
    row |= {"status": "refused", "axis": "", "cause": refused, **dict.fromkeys(numbers, math.nan)}
    if r is None:
        return row
    end = r.outcome
    row |= {"status": end.code, "axis": end.axis, "cause": end.cause, "end_time": end.time}
    row |= dict(zip(crossings, (c.time for c in r.crossings), strict=False))
    for axis in AXES:
        row |= {f"{name}_{axis}": x for name, x in _in_stiffest_clay(r, axis).items()}
    if through := r.energy.get("throughput", 0.0):
        row["energy_residual"] = abs(r.energy["residual"]) / through
    return row | {"wall_time": r.wall_time}


def _in_stiffest_clay(r: Record, axis: str) -> dict[str, float]:
    """Measurements of one axis, in the stiffest clay that the handle met."""
    gain, clay = r.scenario.gain[AXES.index(axis)], r.scenario.clay
    stretch = max(r.regions(axis), key=lambda x: x[axis]["b"], default=None)
    found = {}
    if stretch:
        found["b"] = stretch[axis]["b"]
        if steady := stretch[axis].get("steady_fe_over_v"):
            found["fe_over_v"] = steady["mean"]
        if (speed := stretch[axis].get("steady_speed")) is not None:
            found["speed"] = speed
    if gain > 0.0 and (not clay or clay.viscous):
        found["gain_margin"] = _least_limit(r, axis, stretch) / gain
    return found


def _least_limit(r: Record, axis: str, stretch: dict[str, Any] | None) -> float:
    """The least gain limit of the linear loop over a stretch of a run, else at its start."""
    s, i, limits = r.scenario, AXES.index(axis), PoseLimits(r.scenario)
    if stretch is None:
        return limits.at(i, s.start, (0.0, 0.0))
    rows = (r.t >= stretch["from_s"]) & (r.t <= stretch["to_s"])
    low, high = r.p[rows].min(axis=0), r.p[rows].max(axis=0)
    return limits.least(i, (low[0], low[1]), (high[0], high[1])).K
