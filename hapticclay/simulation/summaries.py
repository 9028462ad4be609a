"""Summaries of runs without their samples: of one run, of many rows, and an array of all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..kernel import path
from ..kernel.summary import CROSSINGS
from ..model.constants import AXES
from ..scene.scenario import Scenario
from . import monitor
from .run import COLUMNS, LEDGER, Run, balance

WORKS = (
    "muscle",
    "motors",
    "clay",
    "hand_damper",
    "kinetic",
    "hand_stored",
    "residual",
    "throughput",
)
LAST = {"p": "m", "v": "m/s", "fh": "N", "fe": "N", "b": "N.s/m"}  # at the last good sample
SUMMARY = np.dtype(
    [
        ("code", "U12"),  # record.Outcome.code; the rest of it: record.status of a run made again
        ("axis", "U24"),  # or joint that is to blame, "" if none
        ("time", "f8"),  # of the end, or of the verdict [s]
        ("step", "i8"),  # last good sample
        ("steps", "i8"),  # engine steps made
        ("crossings", "i8"),  # number of borders crossed; of the first of them:
        ("crossing_axis", "i8", CROSSINGS),  # 0 for x, 1 for y, -1 for none
        ("crossing_time", "f8", CROSSINGS),  # [s], NaN for none
        # along the axis [m/s]: the steady one, if the region was long enough
        ("crossing_speed", "f8", CROSSINGS),
        *((name, "f8", 2) for name in LAST),
        *((name, "f8") for name in WORKS),  # record.Record.energy [J]
    ]
)


def of_run(run: Run) -> tuple[Any, ...]:
    """Summary of a run that has ended."""
    o, energy, last = run.outcome, run.balance(), run.ending()
    assert o is not None
    crossed = np.full((CROSSINGS, 3), (-1.0, np.nan, np.nan))
    for i, c in enumerate(run.crossings[:CROSSINGS]):
        crossed[i] = AXES.index(c.axis), c.time, c.speed
    ends = (last[COLUMNS[name] : COLUMNS[name] + 2] for name in LAST)
    counts = o.step, run.steps, len(run.crossings)
    return o.code, o.axis, o.time, *counts, *crossed.T, *ends, *(energy[name] for name in WORKS)


def of_rows(like: Scenario, m: Any, states: np.ndarray, outs: np.ndarray) -> dict[str, Any]:
    """The fields of summaries, arrays over runs of one kind; `outs`: records.Summary of each."""
    seen, moved, unbound, _ = states["watch"]["seen"].T
    saturated, stalled = monitor.at_rest(seen, moved, unbound, like.dt)
    ends = np.where(saturated, "saturated", np.where(stalled, "stalled", "time limit"))
    w = states["work"]
    stored = outs["kinetic"], outs["at_hand"]
    energy = balance([w[x] for x in LEDGER], [x[:, 0] for x in stored], [x[:, 1] for x in stored])
    if like.hardware is not None and any(like.hardware.friction):
        energy["residual"] = energy["residual"] - w["friction"]
    crossed = outs["crossed"].reshape(-1, CROSSINGS, 3).copy()
    crossed[np.arange(CROSSINGS) >= outs["crossings"][:, None]] = -1.0, np.nan, np.nan
    row = outs["row"]
    force = outs["force"] if m.records_clay_force else row[:, 12:14] * row[:, 4:6]
    sample = np.concatenate((row, force), axis=1)
    return {
        "code": np.where(states["code"] == path.FINISHED, "finished", ends),
        "axis": np.zeros(len(states), "U24"),
        "time": states["t"],
        "step": states["i"],
        "steps": outs["steps"],
        "crossings": outs["crossings"],
        "crossing_axis": crossed[:, :, 0],
        "crossing_time": crossed[:, :, 1],
        "crossing_speed": crossed[:, :, 2],
        **{name: sample[:, COLUMNS[name] : COLUMNS[name] + 2] for name in LAST},
        **energy,
    }


def put_fields(out: np.ndarray, places: Any, fields: dict[str, Any]) -> None:
    """Puts the fields of some runs into an array of summaries."""
    for name, values in fields.items():
        out[name][places] = values


class Summaries:
    """An array of summaries that grows in place, whose parts arrive in any order."""

    def __init__(self):
        self.found, self.n = np.zeros(0, SUMMARY), 0

    def put(self, first: int, results: Sequence[Any]) -> None:
        """Stores the results of consecutive runs."""
        end = first + len(results)
        self.n = max(self.n, end)
        if end > len(self.found):
            self.found.resize(max(end, len(self.found) + len(self.found) // 4), refcheck=False)
        self.found[first:end] = results

    def all(self) -> np.ndarray:
        """All of them."""
        self.found.resize(self.n, refcheck=False)
        return self.found
