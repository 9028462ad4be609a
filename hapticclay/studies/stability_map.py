"""Stability maps: analytic boundaries, boundaries by runs, and where the two disagree."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..display import table_of, text_table
from ..errors import choice
from ..model.constants import TS
from ..results import Result, figure_of
from ..scene.virtual_wall import Device, VirtualWall
from ..theory import gain_crossings, loop_passivity, stability_margins, wall_limits
from ..theory.loops import TIMING
from ..theory.roots import first_failure
from . import boundary
from .boundary import PushedLoop, nominal_limit

MAP_KINDS = ("gain-damping", "delay-damping", "gain-pose")
MAP_POSES = 0.10  # [m] the handle's path, either way from the nominal pose
DAMPINGS = (1.0, 3000.0)  # [N.s/m] of the map of gains
LINE_POINTS = 61  # of an analytic line
UNDAMPED = "held clay is never passive without a damper behind it (Colgate, Schenkel)"
MOST_DAMPING = 1e5  # [N.s/m] end of the search for clay

Line = tuple[list[float], list[float]]
Progress = Callable[[Iterable], Iterable]


@dataclass(frozen=True)
class MapCell:
    """One point of a map.

    Attributes:
        x: value on the map's first axis.
        y: value on the map's second axis.
        theory: whether the linear loop is stable, in continuous time at the nominal pose.
        simulated: class of a run, as boundary.classify_run.
        cause: cause of a difference between the two, "" if they agree.
    """

    x: float
    y: float
    theory: bool
    simulated: str
    cause: str = ""


@dataclass(frozen=True, repr=False)
class StabilityMap(Result):
    """Boundaries over a plane; the loop is stable below them.

    Attributes:
        kind: one of MAP_KINDS.
        loop: the fixed parts.
        x_name: quantity and unit of the first axis.
        y_name: quantity and unit of the second axis.
        lines: analytic boundaries by name: x and y of each, inf where there is none.
        found: boundaries by runs, likewise.
        exact: boundaries of the linear loop of the same runs, by name: y of each.
        cells: points at which theory and a run are compared.
        notes: missing lines and the reasons.
        limit: name of the line of the linear loop of the runs: above it, the gain margin is below
            1; "" for none.
    """

    drawn_by = "hapticclay.views.stability_map_plots:stability_map_plot"

    kind: str
    loop: PushedLoop
    x_name: str
    y_name: str
    lines: dict[str, Line]
    found: dict[str, Line]
    exact: dict[str, list[float]]
    cells: tuple[MapCell, ...]
    notes: tuple[str, ...] = ()
    limit: str = ""

    def tables(self) -> dict[str, dict[str, list]]:
        """Returns the numbers of the figure: cells, lines, and boundaries by runs."""
        x, y = self.x_name, self.y_name
        out = {"cells": table_of((x, y, "stable by theory", "run", "cause"), self.cells)}
        for name, lines in (("lines", self.lines), ("runs", self.found)):
            out[name] = {
                "line": [label for label, (places, _) in lines.items() for _ in places],
                x: [place for places, _ in lines.values() for place in places],
                y: [value for _, values in lines.values() for value in values],
            }
        return out

    def headline(self) -> str:
        """How far the boundary of the runs is from the exact one."""
        gap = f"within {100.0 * self.gap():.2g} %"
        return f"boundary found by runs against the exact one of the same loop: {gap}"

    def text(self, form: str = "") -> str:
        """Cells whose run differs from the analysis in continuous time, and the causes."""
        wrong = [c for c in self.cells if c.cause]
        lines = [
            self.headline(),
            *self.notes,
            f"{len(wrong)} of {len(self.cells)} cells differ from continuous time without delay "
            "at the nominal pose",
        ]
        if wrong:
            head = (self.x_name, self.y_name, "stable by theory", "run", "cause")
            lines.append(text_table(table_of(head, wrong), form=form))
        return "\n".join(lines)

    def figures(self) -> dict[str, Any]:
        """The map."""
        return {self.kind: figure_of(self)}

    def gap(self) -> float:
        """Largest relative gap between the runs and the exact line of their loop; NaN for none."""
        pairs = [
            (a, b)
            for name, (_, y) in self.found.items()
            for a, b in zip(y, self.exact[name], strict=True)
        ]
        gaps = [
            abs(a / b - 1.0) if b else math.inf for a, b in pairs if math.isfinite(a + b) and a != b
        ]
        return max(gaps, default=0.0 if pairs else math.nan)


def stability_map(
    kind: str, loop: PushedLoop, quick: bool = False, progress: Progress = iter
) -> StabilityMap:
    """Make a map."""
    columns, rows = (4, 3) if quick else (8, 5)
    make = {"gain-damping": _gain_damping, "delay-damping": _delay_damping, "gain-pose": _gain_pose}
    return make[choice("map", kind, MAP_KINDS)](loop, columns, rows, progress)


def _gain_damping(loop: PushedLoop, columns: int, rows: int, progress: Progress) -> StabilityMap:
    dense = np.geomspace(*DAMPINGS, LINE_POINTS).tolist()
    x = np.geomspace(*DAMPINGS, columns).tolist()
    continuous = replace(loop, **TIMING)
    linear = continuous.linear

    def line(law: Callable[[float], float]) -> Line:
        return dense, [law(b) for b in dense]

    def small_gain(b: float, K: float) -> bool:
        return bool(stability_margins.small_gain(replace(linear, b=b), K=K))

    def passive(b: float, K: float) -> bool:
        return bool(loop_passivity.passivity(replace(linear, b=b), K=K))

    lines = {"continuous time": line(lambda b: nominal_limit(replace(continuous, b=b)))}
    if loop.Ts:
        name = f"sampled every {1e3 * loop.Ts:g} ms{_late(loop)}"
        lines[name] = line(lambda b: nominal_limit(replace(loop, b=b)))
    limit = list(lines)[-1]
    notes = []
    for name, holds in (
        ("small gain (Eq. 13)", small_gain),
        ("passive: stable with every passive hand", passive),
    ):
        y = [_largest_gain(lambda K, b=b, holds=holds: holds(b, K)) for b in dense]
        if any(y):
            lines[name] = (dense, [v or math.nan for v in y])
        else:
            notes.append(f"{name}: holds for no K in this range")
    middle = nominal_limit(continuous)
    ys = np.geomspace(0.25 * middle, 4.0 * middle, rows).tolist()
    damper = loop.hand.damper
    if loop.Ts and damper:
        name = "held clay passive left of it (Colgate, Schenkel)"
        lines[name] = ([damper, damper], [ys[0], ys[-1]])
    elif loop.Ts:
        notes.append(UNDAMPED)
    loops = [replace(loop, b=b) for b in x]
    found = {"runs": (x, [boundary.simulated_gain(each) for each in progress(loops)])}
    exact = {"runs": [nominal_limit(each) for each in loops]}
    cells = _map_cells(loops, x, "K", ys, progress)
    names = "damping b of the clay [N.s/m]", "gain K [1/kg]"
    said = tuple(notes)
    return StabilityMap("gain-damping", loop, *names, lines, found, exact, cells, said, limit)


def _delay_damping(loop: PushedLoop, columns: int, rows: int, progress: Progress) -> StabilityMap:
    Ts = loop.Ts or TS
    loop = replace(loop, Ts=Ts)
    low, high = 0.5 * Ts, 16.0 * Ts
    dense = np.geomspace(low, high, LINE_POINTS // 2).tolist()
    x = np.geomspace(low, high, columns).tolist()
    lines = {
        "continuous time, late": (dense, [_unstable_damping(loop, None, d) for d in dense]),
        f"sampled every {1e3 * Ts:g} ms and late": (
            dense,
            [_unstable_damping(loop, Ts, d) for d in dense],
        ),
    }
    limit, notes = list(lines)[-1], []
    damper = loop.hand.damper
    if damper:
        name = "held clay passive (Colgate, Schenkel)"
        held = VirtualWall(device=Device(damper=damper), Ts=Ts)
        limits = [wall_limits.passive_damping_limit(replace(held, delay=d)) for d in dense]
        lines[name] = (dense, limits)
    else:
        notes.append(UNDAMPED)
    exact = [_unstable_damping(loop, Ts, d) for d in x]
    loops = [replace(loop, delay=d) for d in x]
    runs = [
        boundary.simulated_damping(each, min(b, MOST_DAMPING) or 1.0)
        for each, b in zip(progress(loops), exact, strict=True)
    ]
    finite = [b for b in exact if 0.0 < b < math.inf] or [1000.0]
    ys = np.geomspace(0.5 * min(finite), 2.0 * max(finite), rows).tolist()
    cells = _map_cells(loops, x, "b", ys, progress)
    names = "delay of the motors [s]", "damping b of the clay [N.s/m]"
    return StabilityMap(
        "delay-damping",
        loop,
        *names,
        lines,
        {"runs": (x, runs)},
        {"runs": exact},
        cells,
        tuple(notes),
        limit,
    )


def _gain_pose(loop: PushedLoop, columns: int, rows: int, progress: Progress) -> StabilityMap:
    dense = np.linspace(-MAP_POSES, MAP_POSES, LINE_POINTS).tolist()
    x = np.linspace(-MAP_POSES, MAP_POSES, columns).tolist()
    loop_at = replace(loop, inertia_shaping=False)
    plain = [replace(loop_at, pose=(dx, 0.0)) for dx in x]
    shaped = [replace(each, inertia_shaping=True) for each in plain]
    nominal = nominal_limit(loop)
    how = f"sampled{_late(loop)}" if loop.Ts else "continuous time"
    lines = {
        f"linear loop at the nominal pose, {how}": (dense, [nominal] * len(dense)),
        f"linear loop at this pose, {how}": (
            dense,
            [boundary.pose_limit(replace(loop_at, pose=(dx, 0.0))) for dx in dense],
        ),
    }
    exact = {
        "runs": [boundary.pose_limit(each) for each in plain],
        "runs, shaped": [boundary.pose_limit(each) for each in shaped],
    }
    runs = [
        boundary.simulated_gain(each, K)
        for each, K in zip(progress(plain), exact["runs"], strict=True)
    ]
    found = {
        "runs": (x, runs),
        "runs, shaped": (x, [boundary.simulated_gain(each) for each in shaped]),
    }
    ys = np.geomspace(0.4 * nominal, 1.2 * nominal, rows).tolist()
    cells = _map_cells(plain, x, "K", ys, progress)
    names = "handle from its nominal position, x [m]", "gain K [1/kg]"
    limit = list(lines)[-1]
    return StabilityMap("gain-pose", loop, *names, lines, found, exact, cells, limit=limit)


def _map_cells(
    loops: list[PushedLoop], x: list[float], field: str, ys: list[float], progress: Progress
) -> tuple[MapCell, ...]:
    """Theory and a run for each loop, with each of ys as its field."""
    out = []
    for loop, at in zip(progress(loops), x, strict=True):
        for y in ys:
            tried = replace(loop, **{field: y}, push=boundary.LARGE_PUSH)
            theory, run = boundary.continuous_stable(tried), boundary.classify_run(tried)
            cause = ""
            if theory != (run == "stable"):
                cause = boundary.explain_disagreement(tried, run == "stable")
            out.append(MapCell(at, y, theory, run, cause))
    return tuple(out)


def _late(loop: PushedLoop) -> str:
    return f", {1e3 * loop.delay:g} ms late" if loop.delay else ""


def _largest_gain(holds: Callable[[float], bool], low: float = 1e-2, high: float = 1e3) -> float:
    """Largest K from low on up to which a property holds; 0 if not at low, inf if up to high.

    The property may fail and hold again: the first failure counts, unless it is narrower than
    1.5 times in K.
    """
    low, failing = first_failure(holds, np.geomspace(low, high, 31).tolist(), rtol=1e-9)
    return math.inf if failing == math.inf else low


def _unstable_damping(loop: PushedLoop, Ts: float | None, delay: float) -> float:
    """Least b at which the delayed linear loop is unstable [N.s/m]; inf for none, 0 if below 1."""
    linear = replace(loop.linear, Ts=Ts, delay=delay)

    def stable(b: float) -> bool:
        return gain_crossings.is_stable(replace(linear, b=b))

    low, high = first_failure(stable, np.geomspace(1.0, MOST_DAMPING, 60).tolist())
    return high if low else 0.0
