"""Environments against the floor: a bare mj_step loop in C of as many engine steps, in turns.

    python -m benchmarks.gym_speed [--out DIR] [--rounds N] [--seconds N] [--processor] [--docs]

Ratios hold on a noisy machine, steps per second do not; where others use all cores, --processor
counts processor time, of all threads, in place of time. Also: Gymnasium's own four numbers
(gymnasium.utils.performance), the time of a reset, and the memory of 1,000 copies. Writes
gym_speed.json. --docs writes it into docs/, too, and its table into docs/gym.md.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import performance

import hapticclay as hc
from hapticclay import files
from hapticclay.gym import registry

from . import common, gym_baselines, provenance

PUBLISHED = gym_baselines.DOCS / "gym_speed.json"
COPIES, MANY = 64, 1000
Clock = Callable[[], float]
PERIODS = 20  # of an environment between two looks at the clock


def floor(scenario: hc.Scenario, steps: int, clock: Clock) -> float:
    """Return seconds of as many bare engine steps, looping in C."""
    model = hc.build(scenario)
    data = mujoco.MjData(model)
    data.qpos[:] = (1.9, -1.9)
    begin = clock()
    mujoco.mj_step(model, data, nstep=steps)
    return clock() - begin


def stepped(env: Any, actions: np.ndarray, clock: Clock) -> float:
    """Return seconds of control periods."""
    begin = clock()
    for action in actions:
        _, _, ended, cut_off, _ = env.step(action)
        if np.ndim(ended) == 0 and (ended or cut_off):
            env.reset()
    return clock() - begin


def ratios(env: Any, rounds: int, clock: Clock) -> dict[str, float]:
    """Return steps a second, and the floor's time over the environment's, medians of pairs.

    A floor of all cores is that of one core over the number of cores.
    """
    inner, n = env.unwrapped, getattr(env, "num_envs", 1)
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    shape = (PERIODS, *env.action_space.shape)
    truth = inner.info_of(0) if n > 1 else inner._episodes.truth
    scenario = inner.task.scenario(truth)
    stepped(env, rng.uniform(-0.2, 0.2, shape).astype(np.float32), clock)
    found, spent = [], []
    cores = common.CORES if n > 1 and clock is time.perf_counter else 1
    for _ in range(rounds):
        actions = rng.uniform(-0.2, 0.2, shape).astype(np.float32)
        bare = floor(scenario, PERIODS * n * inner.task.steps, clock) / cores
        spent.append(stepped(env, actions, clock))
        found.append(bare / spent[-1])
    return {
        "copies": n,
        "steps_per_second": PERIODS * n / statistics.median(spent),
        "share_of_floor": statistics.median(found),
    }


def resets(env: Any, clock: Clock, n: int = 50) -> float:
    """Return seconds of a reset, the median."""
    spent = []
    for i in range(n):
        begin = clock()
        env.reset(seed=i)
        spent.append(clock() - begin)
    return statistics.median(spent)


def memory() -> float:
    """Return memory of this process [MB]; 0 where the system does not tell."""
    status = Path("/proc/self/statm")
    return int(status.read_text().split()[1]) * 4096 / 1e6 if status.is_file() else 0.0


def measured(
    id: str, engine: str, rounds: int, seconds: float, many: int, clock: Clock
) -> dict[str, Any]:
    """Return the figures of an environment."""
    single = gymnasium.make(id, engine=engine, disable_env_checker=True)
    vector = gymnasium.make_vec(id, num_envs=COPIES if many > COPIES else many, engine=engine)
    row: dict[str, Any] = {"id": id, "single": ratios(single, rounds, clock)}
    row["vector"] = ratios(vector, rounds, clock)
    row["reset_ms"] = 1e3 * resets(single, clock)
    row["benchmark_step"] = performance.benchmark_step(single, seconds, seed=0)
    row["benchmark_vector_step"] = performance.benchmark_vector_step(vector, seconds, seed=0)
    row["benchmark_init"] = performance.benchmark_init(
        lambda: gymnasium.make(id, engine=engine, disable_env_checker=True), seconds, seed=0
    )
    drawn = gymnasium.make(id, engine=engine, render_mode="rgb_array", disable_env_checker=True)
    drawn.reset(seed=0)
    row["benchmark_render"] = performance.benchmark_render(drawn, seconds)
    before = memory()
    crowd = gymnasium.make_vec(id, num_envs=many, engine=engine)
    crowd.reset(seed=0)
    crowd.step(np.zeros(crowd.action_space.shape, np.float32))
    row["copies_kept"], row["memory_MB"] = many, memory() - before
    for env in (single, vector, drawn, crowd):
        env.close()
    return row


def rounded(x: float) -> str:
    """A number of periods to two digits."""
    return f"{float(f'{x:.2g}'):,.0f}"


def table(data: dict[str, Any]) -> str:
    """The table of docs/gym.md, and what it was measured on."""
    clock = "processor time" if data["processor"] else "time"
    copies = data["environments"][0]["vector"]["copies"]
    kept = data["environments"][0]["copies_kept"]
    head = ("environment", "single, periods per second", "of the bare steps")
    head += (f"{copies} copies, periods per second", "of the bare steps on all cores", "reset")
    lines = [
        f"Measured on {data['made']['date']} at commit {data['made']['commit']}: "
        f"{data['machine'][0]}, Gymnasium {data['gymnasium']}; medians of {data['rounds']} turns, "
        f"{clock}; load average {data['made']['load'][0]} before.",
        "",
        f"| {' | '.join(head)} | {kept:,} copies |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in data["environments"]:
        one, many = row["single"], row["vector"]
        name = row["id"].removeprefix("hapticclay/").partition("-")[0]
        lines.append(
            f"| {name} | {rounded(one['steps_per_second'])} | {one['share_of_floor']:.2f} | "
            f"{rounded(many['steps_per_second'])} | {many['share_of_floor']:.2f} | "
            f"{row['reset_ms']:.1f} ms | {row['memory_MB']:.0f} MB |"
        )
    return "\n".join(lines)


def publish(data: dict[str, Any]) -> None:
    """Write the data into docs/, and the table into docs/gym.md."""
    with files.atomic(PUBLISHED) as f:
        f.write((json.dumps(data, indent=1) + "\n").encode())
    gym_baselines.put(gym_baselines.DOCS / "gym.md", "speed", table(data))


def main(argv: list[str] | None = None) -> dict[str, Any]:
    """Measure, print and write."""
    parser = common.parser(__doc__)
    parser.add_argument("--rounds", type=int, default=21)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--copies", type=int, default=MANY)
    parser.add_argument("--processor", action="store_true")
    parser.add_argument("--docs", action="store_true")
    parser.add_argument("--engine", default="native")
    parser.add_argument("--ids", nargs="*", default=list(registry.IDS))
    a = parser.parse_args(argv)
    rows, clock = [], time.process_time if a.processor else time.perf_counter
    watch = provenance.Stopwatch("gym_speed")
    for id in a.ids:
        row = measured(id, a.engine, a.rounds, a.seconds, a.copies, clock)
        rows.append(row)
        one, many = row["single"], row["vector"]
        print(
            f"{id}: single {one['steps_per_second']:.0f} steps/s, {one['share_of_floor']:.2f} of "
            f"the floor; {many['copies']} copies {many['steps_per_second']:.0f} steps/s, "
            f"{many['share_of_floor']:.2f} of all cores; "
            f"reset {row['reset_ms']:.2f} ms; "
            f"{row['copies_kept']} copies {row['memory_MB']:.0f} MB",
            flush=True,
        )
    found = {"processor": a.processor, "rounds": a.rounds, "gymnasium": gymnasium.__version__}
    found |= {"environments": rows, "made": watch.stamp()}
    data = common.write(a.out, "gym_speed", found)
    if a.docs:
        publish(data)
    return data


if __name__ == "__main__":
    main(sys.argv[1:])
