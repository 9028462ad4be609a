"""Maps of stability: analytic boundaries, the one that runs find, and the cells where theory and run disagree."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..errors import choice
from ..model.constants import TS
from ..theory import gain_limit, margins, passivity
from . import boundary
from .boundary import Loop

MAP_KINDS = ("gain-damping", "delay-damping", "gain-pose")
MAP_POSES = 0.10  # [m] the handle's path, either way from the nominal pose
DAMPINGS = (1.0, 3000.0)  # [N.s/m] of the map of gains
FINE = 61  # points of an analytic line
UNDAMPED = "held clay is never passive without a damper behind it (Colgate, Schenkel)"
MOST_CELLS = 1e5  # [N.s/m] clay is looked for up to here


@dataclass(frozen=True)
class MapCell:
    """One point of a map: whether the linear continuous loop at the nominal pose is stable there, and what a run does.

    x, y: as the map's axes. simulated: as boundary.classify_run. cause: why the two differ, "" if they do not.
    """

    x: float
    y: float
    theory: bool
    simulated: str
    cause: str = ""


@dataclass(frozen=True)
class StabilityMap:
    """Boundaries over a plane; stable below them.

    Attributes:
        kind: one of KINDS. loop: what is kept fixed. x_name, y_name: quantity and unit of the axes.
        lines: analytic boundaries by name: (x, y) of each, inf where there is none.
        found: boundaries from runs, likewise. exact: what theory says of those very loops, by name: y of each.
        cells: see Cell. notes: what has no line, and why.
    """

    kind: str
    loop: Loop
    x_name: str
    y_name: str
    lines: dict[str, tuple[list[float], list[float]]]
    found: dict[str, tuple[list[float], list[float]]]
    exact: dict[str, list[float]]
    cells: tuple[MapCell, ...]
    notes: tuple[str, ...] = ()

    def gap(self) -> float:
        """Largest relative difference between the runs and the exact line of the same loop; NaN if there is none."""
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
    kind: str, loop: Loop, quick: bool = False, progress: Callable[[Iterable], Iterable] = iter
) -> StabilityMap:
    """Makes a map.

    Args:
        kind: "gain-damping", "delay-damping" (the loop's own K; sampled every 0.36 ms if it is continuous) or
            "gain-pose" (without shaping, and with it).
        loop: what is kept fixed. quick: four columns of three cells instead of eight of five.
        progress: wraps the iterable of the columns.
    """
    columns, rows = (4, 3) if quick else (8, 5)
    make = {"gain-damping": _gain_damping, "delay-damping": _delay_damping, "gain-pose": _gain_pose}
    return make[choice("map", kind, MAP_KINDS)](loop, columns, rows, progress)


def _gain_damping(loop: Loop, columns: int, rows: int, progress) -> StabilityMap:
    fine, x = np.geomspace(*DAMPINGS, FINE).tolist(), np.geomspace(*DAMPINGS, columns).tolist()
    at = lambda b: replace(loop, b=b)  # noqa: E731
    lines = {"continuous time": (fine, [_limit(replace(at(b), Ts=None, delay=0.0)) for b in fine])}
    if loop.Ts:
        lines[f"sampled every {1e3 * loop.Ts:g} ms{_late(loop)}"] = (
            fine,
            [_limit(at(b)) for b in fine],
        )
    notes = []
    for name, law in (
        ("small gain (Eq. 13)", lambda b: _largest(lambda K: bool(_small_gain(at(b), K)))),
        (
            "passive: stable with every hand",
            lambda b: _largest(lambda K: bool(passivity.passivity(loop.axis, K, b))),
        ),
    ):
        y = [law(b) for b in fine]
        if any(y):
            lines[name] = (fine, [v or math.nan for v in y])
        else:
            notes.append(f"{name}: holds for no K in this range")
    damper = loop.operator.damper if loop.operator else 0.0
    middle = _limit(replace(loop, Ts=None, delay=0.0))
    ys = np.geomspace(0.25 * middle, 4.0 * middle, rows).tolist()
    if loop.Ts and damper:
        lines["held clay passive left of it (Colgate, Schenkel)"] = (
            [damper, damper],
            [ys[0], ys[-1]],
        )
    elif loop.Ts:
        notes.append(UNDAMPED)
    found = {"runs": (x, [boundary.simulated_gain(at(b)) for b in progress(x)])}
    exact = {"runs": [_limit(at(b)) for b in x]}
    cells = _map_cells([at(b) for b in x], x, lambda c, K: replace(c, K=K), ys, progress)
    names = "damping b of the clay [N.s/m]", "gain K [1/kg]"
    return StabilityMap("gain-damping", loop, *names, lines, found, exact, cells, tuple(notes))


def _delay_damping(loop: Loop, columns: int, rows: int, progress) -> StabilityMap:
    loop = loop if loop.Ts else replace(loop, Ts=TS)
    assert loop.Ts
    low, high = 0.5 * loop.Ts, 16.0 * loop.Ts
    fine, x = np.geomspace(low, high, FINE // 2).tolist(), np.geomspace(low, high, columns).tolist()
    at = lambda d: replace(loop, delay=d)  # noqa: E731
    lines = {
        "continuous time, late": (
            fine,
            [_damping(replace(at(d), Ts=None, delay=0.0), d) for d in fine],
        ),
        f"sampled every {1e3 * loop.Ts:g} ms and late": (fine, [_damping(at(d), d) for d in fine]),
    }
    notes = []
    damper = loop.operator.damper if loop.operator else 0.0
    if damper:
        name = "held clay passive (Colgate, Schenkel)"
        lines[name] = (fine, [_passive_damping(loop.Ts, d, damper) for d in fine])
    else:
        notes.append(UNDAMPED)
    exact = [_damping(at(d), d) for d in x]
    runs = [
        boundary.simulated_damping(at(d), min(b, MOST_CELLS) or 1.0)
        for d, b in zip(progress(x), exact, strict=True)
    ]
    found = {"runs": (x, runs)}
    finite = [b for b in exact if 0.0 < b < math.inf] or [1000.0]
    ys = np.geomspace(0.5 * min(finite), 2.0 * max(finite), rows).tolist()
    cells = _map_cells([at(d) for d in x], x, lambda c, b: replace(c, b=b), ys, progress)
    names = "delay of the motors [s]", "damping b of the clay [N.s/m]"
    return StabilityMap(
        "delay-damping", loop, *names, lines, found, {"runs": exact}, cells, tuple(notes)
    )


def _gain_pose(loop: Loop, columns: int, rows: int, progress) -> StabilityMap:
    fine, x = (
        np.linspace(-MAP_POSES, MAP_POSES, FINE).tolist(),
        np.linspace(-MAP_POSES, MAP_POSES, columns).tolist(),
    )
    at = lambda dx, shaping: replace(loop, pose=(dx, 0.0), shaping=shaping)  # noqa: E731
    nominal = _limit(loop)
    how = f"sampled{_late(loop)}" if loop.Ts else "continuous time"
    lines = {
        f"linear loop at the nominal pose, {how}": (fine, [nominal] * len(fine)),
        f"linear loop at this pose, {how}": (
            fine,
            [boundary.pose_limit(at(dx, False)) for dx in fine],
        ),
    }
    here = [boundary.pose_limit(at(dx, False)) for dx in x]
    found = {
        "runs": (
            x,
            [
                boundary.simulated_gain(at(dx, False), g)
                for dx, g in zip(progress(x), here, strict=True)
            ],
        ),
        "runs, shaped": (x, [boundary.simulated_gain(at(dx, True)) for dx in x]),
    }
    exact = {"runs": here, "runs, shaped": [boundary.pose_limit(at(dx, True)) for dx in x]}
    ys = np.geomspace(0.4 * nominal, 1.2 * nominal, rows).tolist()
    cells = _map_cells([at(dx, False) for dx in x], x, lambda c, K: replace(c, K=K), ys, progress)
    names = "handle from its nominal position, x [m]", "gain K [1/kg]"
    return StabilityMap("gain-pose", loop, *names, lines, found, exact, cells)


def _map_cells(loops, x, put, ys, progress) -> tuple[MapCell, ...]:
    out = []
    for loop, at in zip(progress(loops), x, strict=True):
        for y in ys:
            tried = replace(put(loop, y), push=boundary.LARGE_PUSH)
            theory, run = boundary.linear_rate(tried), boundary.classify_run(tried)
            agree = theory == (run == "stable")
            out.append(
                MapCell(
                    at,
                    y,
                    theory,
                    run,
                    "" if agree else boundary.explain_disagreement(tried, run == "stable"),
                )
            )
    return tuple(out)


def _late(loop: Loop) -> str:
    return f", {1e3 * loop.delay:g} ms late" if loop.delay else ""


def _other_hand(loop: Loop) -> dict:
    return dict(impedance=loop.operator is not None, operator=loop.operator)


def _limit(loop: Loop) -> float:
    return gain_limit.gain_limit(
        loop.axis, loop.b, Ts=loop.Ts, delay=loop.delay, **_other_hand(loop)
    )


def _small_gain(loop: Loop, K: float) -> margins.Verdict:
    return margins.small_gain(loop.axis, K, loop.b, **_other_hand(loop))


def _largest(holds: Callable[[float], bool], low: float = 1e-2, high: float = 1e3) -> float:
    """Largest K from `low` on up to which a property holds; 0 if not even there, inf if up to `high`."""
    if not holds(low):
        return 0.0
    if holds(high):
        return math.inf
    while high / low > 1.0 + 1e-4:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _damping(loop: Loop, delay: float) -> float:
    """Smallest b at which the late linear loop is unstable [N.s/m]; inf if there is none up to MOST, 0 if from 1 on."""
    stable = lambda b: gain_limit.is_stable(loop.axis, loop.K, b, loop.operator, loop.Ts, delay)  # noqa: E731
    grid = np.geomspace(1.0, MOST_CELLS, 60)
    bad = next((i for i, b in enumerate(grid) if not stable(float(b))), None)
    if bad is None:
        return math.inf
    if bad == 0:
        return 0.0
    low, high = float(grid[bad - 1]), float(grid[bad])
    while high / low > 1.0 + 1e-6:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return high


def _passive_damping(Ts: float, delay: float, damper: float) -> float:
    """Largest held clay, late, that is passive behind a damper [N.s/m]: what it needs is in proportion to it."""
    late = lambda z: (1.0 - 1.0 / z) / Ts * z ** (-delay / Ts)  # noqa: E731
    return damper / (damper - passivity.colgate_schenkel(late, Ts, damper, 2001).margin)
