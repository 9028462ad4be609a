"""Closed loop against the floor: a bare mj_step loop in C of the same model, in turns, medians.

    python benchmarks/throughput.py [--out DIR] [--rounds N] [--steps N]

Ratios hold on a noisy machine, microseconds do not.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import time
from pathlib import Path

import mujoco
from tabulate import tabulate

import hapticclay as hc
from hapticclay import leapfrog, record

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
    import dataclasses

    leapfrog.FUSE_FROM = 0 if inlined else 10**12
    leapfrog._fused.clear()
    r = hc.simulate(dataclasses.replace(scenario, t_max=(steps + 0.5) * scenario.dt, length=None))
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--steps", type=int, default=20_000)
    args = parser.parse_args()
    rows = measure(args.rounds, args.steps)
    print(tabulate(rows, headers="keys", floatfmt=".2f", tablefmt="github"))
    versions = record.versions()
    print(f"\n{platform.machine()}, {', '.join(f'{k} {v}' for k, v in versions.items())}")
    if args.out:
        with record.atomic(args.out / "throughput.json") as f:
            f.write(json.dumps({"versions": versions, "machine": platform.machine(), "rows": rows}, indent=2).encode())


if __name__ == "__main__":
    main()
