"""Limit cycles in clay that yields: describing function, exact cycle, and runs.

    python -m benchmarks.limit_cycles [--out DIR]

The y axis with shaping, its motors without limits; writes limit_cycles.md and limit_cycles.json,
whose every figure comes from the runs.
"""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from tabulate import tabulate

import hapticclay as hc
from hapticclay import files
from hapticclay.model.constants import TS
from hapticclay.studies.boundary import PushedLoop
from hapticclay.studies.yield_map import MeasuredCycle, measured_cycle, yielding_run

from . import common

YIELD_FORCES = (0.1, 1.0, 10.0, 100.0)  # [N]
GAINS_AND_DAMPINGS = ((0.6, 0.0), (0.7, 0.0), (1.0, 0.0), (1.0, 30.0), (1.0, 50.0), (2.0, 0.0))
THINNING = (hc.Flow(K=5.0, n=0.5, b=10.0), hc.Flow(K=9.0, n=0.2), hc.Flow(Fy=5.0, K=10.0, n=0.4))
STEPS = (TS, TS / 4.0)  # [s]
START = 1.2  # of the speed of the cycle
SPAN = 8.0  # [s] of a run


def cases() -> list[tuple[float, hc.Flow]]:
    """Gain and law of each row."""
    laws = [(K, hc.Flow(Fy=Fy, b=b)) for K, b in GAINS_AND_DAMPINGS for Fy in YIELD_FORCES]
    return laws + [(1.0, flow) for flow in THINNING]


def measure(K: float, flow: hc.Flow, steps: tuple[float, ...] = STEPS) -> dict[str, Any]:
    """One row: the predicted cycle, the exact one, and that of a run at each step."""
    loop = PushedLoop("y", b=flow.b, K=K, inertia_shaping=True)
    predicted = next(
        x for x in hc.theory.limit_cycles(loop.linear, flow) if x.kind == "limit cycle"
    )
    exact = None
    if flow.Fy and not flow.K:
        exact = next((x for x in hc.theory.exact_cycles(loop.linear, flow) if x.stable), None)
    speed = exact.speed if exact else predicted.speed
    found: list[MeasuredCycle | None] = []
    for dt in steps:
        run = yielding_run(replace(loop, push=min(START * speed, 10.0)), flow, SPAN)
        record = hc.simulate(replace(run, dt=dt))
        whole = record.t[-1] > SPAN - 2.0 * dt
        found.append(measured_cycle(record, "y") if whole else None)
    return {
        "K": K,
        "flow": asdict(flow),
        "predicted": {**asdict(predicted), "trusted": predicted.trusted},
        "exact": exact and asdict(exact),
        "runs": [x and asdict(x) for x in found],
    }


def percent(x: float, of: float) -> str:
    """Where x lies, from another number."""
    return f"{100.0 * (x / of - 1.0):+.2g} %"


def page(rows: list[dict[str, Any]], steps: tuple[float, ...] = STEPS) -> str:
    """The Markdown page."""
    head = ["K", "clay", "V predicted [mm/s]", "Hz", "third harmonic", "trusted"]
    head += ["exact: speed", "Hz", "run: fundamental", "Hz", "run from exact: speed", "Hz"]
    head += ["the same at a quarter of the step"]
    cells, worst = [], [0.0, 0.0]
    for row in rows:
        theory, exact, (run, *finer) = row["predicted"], row["exact"], row["runs"]
        law = {k: v for k, v in row["flow"].items() if v and (k != "n" or row["flow"]["K"])}
        cell = [f"{row['K']:g}", ", ".join(f"{k} = {v:g}" for k, v in law.items())]
        cell += [f"{1e3 * theory['speed']:.4g}", f"{theory['omega'] / math.tau:.4g}"]
        cell += [f"{100.0 * theory['third']:.2g} %", "yes" if theory["trusted"] else "no"]
        cell += [percent(exact[k], theory[k]) for k in ("speed", "omega")] if exact else ["-", "-"]
        if run is None:
            cell += ["out of reach", "-", "-", "-", "-"]
        else:
            pairs = ("fundamental", "speed"), ("omega", "omega")
            ratios = [run[a] / theory[b] - 1.0 for a, b in pairs]
            if theory["trusted"]:
                worst = [max(w, abs(r)) for w, r in zip(worst, ratios, strict=True)]
            cell += [f"{100.0 * r:+.2g} %" for r in ratios]
            cell += [percent(run[k], exact[k]) for k in ("speed", "omega")] if exact else ["-", "-"]
            quarter = finer[0] if finer else None
            cell.append(percent(quarter["speed"], exact["speed"]) if exact and quarter else "-")
        cells.append(cell)
    return (
        "\n\n".join(
            [
                "# Limit cycles: prediction against runs",
                "The y axis, no hand, inertia shaping, motors without limits: a push above the "
                "threshold in clay of one law everywhere. The prediction is that of the "
                "describing function. The next columns are the deviation from it of the exact "
                f"cycle (matrix exponentials) and of a run at {1e3 * steps[0]:g} ms, and the "
                "deviation of the run from the exact cycle. Made by "
                "`benchmarks/limit_cycles.py`.",
                f"Where the prediction is trusted, runs are within {100.0 * worst[0]:.2g} % "
                f"of its amplitude and {100.0 * worst[1]:.2g} % of its frequency.",
                tabulate(cells, head, tablefmt="github", disable_numparse=True),
                "## Machine",
                "\n".join(f"- {x}" for x in common.foot()),
            ]
        )
        + "\n"
    )


def main(out: Path | None, **kw: Any) -> list[dict[str, Any]]:
    """Measures, prints and, with a folder, writes both files."""
    rows = [measure(*case, **kw) for case in cases()]
    print(page(rows))
    if out:
        common.write(out, "limit_cycles", {"steps": STEPS, "rows": rows})
        with files.atomic(out / "limit_cycles.md") as f:
            f.write(page(rows).encode())
    return rows


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.set_defaults(out=None)
    main(parser.parse_args().out)
