"""Closed loop against the floor: a bare mj_step loop in C of the same model, in turns, medians.

    python benchmarks/throughput.py [--out DIR] [--rounds N] [--steps N]

Ratios hold on a noisy machine, microseconds do not. Writes throughput.json; benchmarks/bench.py makes the page.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import mujoco

sys.path.insert(0, str(Path(__file__).resolve().parent))

from tabulate import tabulate  # noqa: E402
from work_precision import write  # noqa: E402

import hapticclay as hc  # noqa: E402
from hapticclay import leapfrog  # noqa: E402

SCENES = {
    "constant cut": hc.constant_cut(start=(0.06, 0.0)),
    "constant cut, shaping": hc.constant_cut(start=(0.06, 0.0), shaping=True),
    "constant cut, Th": hc.constant_cut(start=(0.06, 0.0), impedance=True, force=(2.0, 0.0)),
    "free space": hc.free(gain=(0.01, 0.01)),
}


def floor(scenario: hc.Scenario, steps: int) -> float:
    """Seconds a step of the engine alone, looping in C; restarted often enough to stay clear of denormals."""
    model = hc.build(scenario)
    data = mujoco.MjData(model)
    data.qpos[:] = (1.9, -1.9)
    if scenario.clay:
        data.ctrl[2:] = 45.0
    spent = 0.0
    for _ in range(steps // 500):
        data.qvel[:] = (0.1, -0.2)
        begin = time.perf_counter()
        mujoco.mj_step(model, data, 500)
        spent += time.perf_counter() - begin
    return spent / (steps // 500 * 500)


def loop(scenario: hc.Scenario, steps: int, inlined: bool = True) -> float:
    """Seconds a step of simulate(), every sample recorded."""
    usual, leapfrog.FUSE_FROM = leapfrog.FUSE_FROM, 0 if inlined else 10**12
    leapfrog._fused.clear()
    try:
        r = hc.simulate(dataclasses.replace(scenario, t_max=(steps + 0.5) * scenario.dt, length=None))
    finally:
        leapfrog.FUSE_FROM = usual
    assert r.steps >= steps, r.status
    return r.wall_time / r.steps


def measure(rounds: int, steps: int) -> list[dict[str, float | str]]:
    """One row a scene: medians over rounds in which floor and loops take turns."""
    rows: list[dict[str, float | str]] = []
    for name, scenario in SCENES.items():
        times = []
        for _ in range(rounds):
            times.append((floor(scenario, steps), loop(scenario, steps), loop(scenario, steps, inlined=False)))
        rows.append(
            {
                "scene": name,
                "floor_us": 1e6 * statistics.median(t[0] for t in times),
                "python_us": 1e6 * statistics.median(t[1] for t in times),
                "ratio": statistics.median(t[1] / t[0] for t in times),
                "ratio_not_inlined": statistics.median(t[2] / t[0] for t in times),
            }
        )
    return rows


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    cells = [[format(x, ".2f") if isinstance(x, float) else x for x in r.values()] for r in data["rows"]]
    head = ["scene", "bare engine [us/step]", "closed loop [us/step]", "ratio", "ratio, loop not inlined"]
    return [
        "## Throughput",
        "The closed loop, every sample recorded, against the floor: a bare loop of `mj_step` in C over the same model, "
        f"in turns; medians of {data['rounds']} rounds of {data['steps']} steps. Ratios hold on a noisy machine, "
        "microseconds do not.",
        tabulate(cells, head, tablefmt="github", disable_numparse=True),
    ]  # fmt: skip


def main(
    out: Path = Path("out/bench"), quick: bool = False, rounds: int | None = None, steps: int | None = None
) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    rounds, steps = rounds or (3 if quick else 7), steps or (5000 if quick else 20_000)
    return write(out, "throughput", {"rounds": rounds, "steps": steps, "rows": measure(rounds, steps)})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--rounds", type=int)
    parser.add_argument("--steps", type=int)
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, rounds=args.rounds, steps=args.steps))))
