"""Closed loop against the floor: a bare mj_step loop in C of the same model, in turns, medians.

    python -m benchmarks.throughput [--out DIR] [--rounds N] [--steps N] [--full]

Ratios hold on a noisy machine, microseconds do not. Short runs, of 100 steps, are 1e5 from a
generator, and up to 1e6 as columns; 1e4 where it is quick. --full takes minutes more: 16384 runs in
a batch, 100 000 runs for linearity, and a stability map. Writes throughput.json; benchmarks.pages
makes the page.
"""

from __future__ import annotations

import dataclasses
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import hapticclay as hc
from hapticclay.files import atomic
from hapticclay.kernel import native as kernel
from hapticclay.model.constants import CLAY_X as CLAY
from hapticclay.simulation import batch

from . import common

LONG = 5555  # steps of 2 s, as the runs of the map
SHORT, SHORT_QUICK, SHORT_STEPS = 100_000, 10_000, 100  # runs, steps of each
COLUMNS = {"continuous": 6, "sampled": 5}  # powers of ten of the runs of columns
FEW, TURNS = 10_000, 5  # runs of columns up to which they are made so often
OFTEN = 5  # compiled runs to one in Python, which takes as long
SCENES = {
    "constant cut": hc.constant_cut(start=(0.06, 0.0)),
    "constant cut, shaping": hc.constant_cut(start=(0.06, 0.0), inertia_shaping=True),
    "constant cut, Th": hc.constant_cut(
        start=(0.06, 0.0), operator=hc.Operator(), force=(2.0, 0.0)
    ),
    "free space": hc.free(gain=(0.01, 0.01)),
}


def floor(
    scenario: hc.Scenario, steps: int, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Return seconds a step of the engine alone, looping in C.

    It is restarted often enough to stay clear of denormals.
    """
    model = hc.build(scenario)
    data = mujoco.MjData(model)
    data.qpos[:] = (1.9, -1.9)
    if scenario.clay:
        data.ctrl[2:] = 45.0
    spent = 0.0
    for _ in range(steps // 500):
        data.qvel[:] = (0.1, -0.2)
        begin = clock()
        mujoco.mj_step(model, data, 500)
        spent += clock() - begin
    return spent / (steps // 500 * 500)


def loop(scenario: hc.Scenario, steps: int) -> float:
    """Seconds a step of the Python run, every sample recorded."""
    r = hc.simulate(lasting(scenario, steps), engine="python")
    assert r.steps >= steps, r.status
    return r.wall_time / r.steps


def lasting(scenario: hc.Scenario, steps: int) -> hc.Scenario:
    """The scenario, cut after so many steps."""
    return dataclasses.replace(scenario, t_max=(steps + 0.5) * scenario.dt, length=None)


def timed(function, *args, **kw) -> tuple[np.ndarray, Any]:
    """Seconds that function(*args, **kw) takes and processor seconds on all cores; its result."""
    begin = time.perf_counter(), time.process_time()
    found = function(*args, **kw)
    return np.array((time.perf_counter() - begin[0], time.process_time() - begin[1])), found


def warm(todo: list[hc.Scenario]) -> None:
    """Imports, and loads the engine's model: a small batch before one that is timed."""
    hc.simulate_batch(todo[: batch.MANY], keep="summaries")


def native(scenario: hc.Scenario, steps: int) -> tuple[float, float, float]:
    """The compiled run over the floor just before and after it, in processor time.

    One of a batch of summaries; one alone, from call to return, all samples recorded; none but the
    last.
    """

    def bare() -> float:
        return steps * floor(scenario, steps, time.process_time)

    s, pool = lasting(scenario, steps), batch.BatchPool()
    first, short, then = bare(), timed(pool.summary, s)[0][1], bare()
    whole = timed(hc.simulate, s, engine="native")[0][1]
    between = bare()
    thin = timed(hc.simulate, s, engine="native", every=1_000_000)[0][1]
    return (
        short / (0.5 * (first + then)),
        whole / (0.5 * (then + between)),
        thin / (0.5 * (between + bare())),
    )


def measure(rounds: int, steps: int) -> list[dict[str, float | str]]:
    """One row a scene: medians over rounds in which floor and loops take turns."""
    rows: list[dict[str, float | str]] = []
    for name, scenario in SCENES.items():
        times = []
        if kernel.is_there():
            warm([lasting(scenario, steps)])
        for _ in range(rounds):
            times.append((floor(scenario, steps), loop(scenario, steps)))
        compiled = (
            [native(scenario, steps) for _ in range(OFTEN * rounds)] if kernel.is_there() else []
        )
        rows.append(
            {
                "scene": name,
                "floor_us": 1e6 * statistics.median(t[0] for t in times),
                "python_us": 1e6 * statistics.median(t[1] for t in times),
                "ratio": statistics.median(t[1] / t[0] for t in times),
            }
        )
        for what, ratios in zip(
            ("native", "native_recorded", "native_last_alone"),
            zip(*compiled, strict=True),
            strict=False,
        ):
            rows[-1][what] = statistics.median(ratios)
    return rows


def jobs(n: int, steps: int) -> list[hc.Scenario]:
    """Runs that differ in clay, gain and start, and cross a border."""
    rng = np.random.default_rng(n)
    b, gain, start = (
        rng.uniform(10.0, 200.0, n),
        rng.uniform(0.2, 1.0, n),
        rng.uniform(0.0, 0.049, n),
    )
    cuts = (
        hc.constant_cut(b=x, gain=(k, 0.2), start=(p, 0.0))
        for x, k, p in zip(b, gain, start, strict=True)
    )
    return [lasting(s, steps) for s in cuts]


def both() -> np.ndarray:
    """The time, and the processor time of this thread [s]."""
    return np.array((time.perf_counter(), time.thread_time()))


def beside(
    todo: list[hc.Scenario], steps: int, keep: str = "summaries"
) -> tuple[np.ndarray, np.ndarray]:
    """A batch whose threads take turns with the floor, so that a drift of the machine moves both.

    Returns:
        (core seconds and processor seconds a run, those of a step of the bare engine on all cores
        at once).
    """
    each = max(1, min(100, len(todo) // (8 * common.CORES)))
    bare: list[Any] = []  # of a step
    aside: list[Any] = []  # of the turns of the floor, its preparations included

    class Turns(batch.BatchPool):
        def _turn(self, runs: int) -> None:
            made = self.own.__dict__.setdefault("made", 0)
            if made == 0 or made // each != (made - runs) // each:
                begin = both()
                bare.append(floor(todo[0], max(500, each * steps // 5), both))
                aside.append(both() - begin)
            self.own.made = made + runs

        def run(self, *args: Any) -> Any:
            self._turn(1)
            return super().run(*args)

        def together(self, jobs: Any) -> Any:
            self._turn(len(jobs))
            return super().together(jobs)

    usual, batch.BatchPool = batch.BatchPool, Turns
    try:
        took = timed(hc.simulate_batch, todo, keep=keep)[0] * (common.CORES, 1.0)
    finally:
        batch.BatchPool = usual
    return (took - sum(aside)) / len(todo), np.mean(bare, axis=0)


def batches(sizes: list[tuple[int, int]], rounds: int) -> list[dict[str, Any]]:
    """Batches of n runs of so many steps over the floor on all cores: time, processor time."""
    rows: list[dict[str, Any]] = []
    for n, steps in sizes:
        todo = jobs(n, steps)
        warm(todo)
        row: dict[str, Any] = {"runs": n, "steps": steps}
        for keep in ("summaries", "records")[: 2 if n <= 1024 else 1]:
            made = (beside(todo, steps, keep) for _ in range(rounds if n < 10_000 else 1))
            ratios = [run / (steps * bare) for run, bare in made]
            row[keep], row[f"{keep}_cpu"] = np.median(ratios, axis=0).tolist()
        rows.append(row)
    return rows


def first_calls() -> dict[str, float]:
    """Processor seconds of a process up to its first record, and of a second run in it."""
    code = (
        "import time, hapticclay as hc; s = hc.free(t_max=0.01); hc.simulate(s, engine='native'); "
        "a = time.process_time(); hc.simulate(s, engine='native'); "
        "print(a, time.process_time() - a)"
    )
    made = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout
        for _ in range(3)
    ]
    first, second = zip(*(map(float, x.split()) for x in made), strict=True)
    return {"first_s": statistics.median(first), "second_s": statistics.median(second)}


def memory() -> float | str:
    """The most memory that this process has taken [MiB], or "unknown"."""
    try:
        import resource
    except ImportError:
        return "unknown"
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def linearity(sizes: list[int], steps: int) -> list[dict[str, Any]]:
    """Time a run, from the smallest batch to the largest; small ones are made often."""
    rows: list[dict[str, Any]] = []
    for n in sizes:
        todo = jobs(n, steps)
        warm(todo)
        run, bare = np.mean([beside(todo, steps) for _ in range(max(1, 20_000 // n))], axis=0)
        over, over_cpu = (run / (steps * bare)).tolist()
        rows.append(
            {
                "runs": n,
                "steps": steps,
                "us_a_run": 1e6 * float(run[0]) / common.CORES,
                "over_floor": over,
                "over_floor_cpu": over_cpu,
                "peak_MiB": memory(),
            }
        )
    return rows


def monte_carlo(n: int, control: str) -> Iterator[hc.Scenario]:
    """Short runs that differ in operator, clay, gain and start, and where sampled in the delay."""
    same = hc.constant_cut(start=(0.02, 0.0), operator=hc.Operator(), control=control)
    same, rng = lasting(same, SHORT_STEPS), np.random.default_rng(n)
    for _ in range(n):
        mass, damper, spring, b, gain, start, delay = rng.random(7).tolist()
        own: Any = dict(hardware=hc.Hardware(delay=1e-3 * delay)) if control == "sampled" else {}
        yield dataclasses.replace(
            same,
            operator=hc.Operator(0.1 + mass, 1.0 + damper, 2.0 + 8.0 * spring),
            clay=hc.slab(10.0 + 190.0 * b, *CLAY),
            gain=(0.2 + 0.8 * gain, 0.2),
            start=(0.049 * start, 0.0),
            **own,
        )


def short_runs(n: int, control: str) -> dict[str, Any]:
    """Many short runs from a generator: seconds, and those of their engine steps alone."""
    first = next(monte_carlo(1, control))
    warm(list(monte_carlo(100, control)))
    before = floor(first, 20_000)
    begin = time.perf_counter()
    found = hc.simulate_batch(monte_carlo(n, control), keep="summaries")
    wall = time.perf_counter() - begin
    steps = int(found["steps"].sum())
    bare = 0.5 * (before + floor(first, 20_000)) * steps / common.CORES
    few = max(1, n // 100)
    begin = time.perf_counter()
    for _ in monte_carlo(few, control):
        pass
    making = (time.perf_counter() - begin) * n / few
    return {
        "runs": n,
        "steps": SHORT_STEPS,
        "control": control,
        "engine_steps": steps,
        "wall_s": wall,
        "floor_s": bare,
        "over_floor": wall / bare,
        "making_scenarios_s": making,
        "peak_MiB": memory(),
    }


def drawn_columns(n: int, control: str) -> tuple[hc.Scenario, dict[str, np.ndarray]]:
    """The same as columns, but for the start: a scenario, and what n runs of it differ in."""
    own: Any = dict(hardware=hc.Hardware(delay=1e-3)) if control == "sampled" else {}
    base = hc.constant_cut(start=(0.02, 0.0), operator=hc.Operator(), control=control)
    base = dataclasses.replace(base, **own)
    mass, damper, spring, b, gain, delay = np.random.default_rng(n).random((6, n))
    columns = {
        "operator.mass": 0.1 + mass, "operator.damper": 1.0 + damper,
        "operator.spring": 2.0 + 8.0 * spring, "clay.x.values.1": 10.0 + 190.0 * b,
        "gain.x": 0.2 + 0.8 * gain,
    }  # fmt: skip
    columns |= {"hardware.delay": 1e-3 * (1.0 - delay)} if control == "sampled" else {}
    return lasting(base, SHORT_STEPS), columns


def column_runs(sizes: list[int], control: str) -> list[dict[str, Any]]:
    """Runs of columns: processor time over that of their engine steps alone, before and after."""
    base, few = drawn_columns(100, control)
    warm([hc.with_fields(base, {n: float(x[0]) for n, x in few.items()})])
    hc.simulate_columns(base, few)  # imports
    rows = []
    for n in sizes:
        base, columns = drawn_columns(n, control)
        made = [column_run(base, columns, n) for _ in range(TURNS if n <= FEW else 1)]
        wall, spent, bare = np.median(made, axis=0).tolist()
        rows.append(
            {
                "runs": n,
                "control": control,
                "runs_a_second": n / wall,
                "over_floor_cpu": statistics.median(x[1] / x[2] for x in made),
                "floor_us_a_run": 1e6 * bare / n,
                "us_a_run": 1e6 * spent / n,
                "peak_MiB": memory(),
            }
        )
    return rows


def column_run(
    base: hc.Scenario, columns: dict[str, np.ndarray], n: int
) -> tuple[float, float, float]:
    """Time and processor time of runs of columns, and that of their engine steps alone [s]."""
    least = max(20_000, min(200_000, n * SHORT_STEPS // 50))  # steps of the floor
    before = floor(base, least, time.process_time)
    (wall, spent), found = timed(hc.simulate_columns, base, columns)
    after = floor(base, least, time.process_time)
    return float(wall), float(spent), 0.5 * (before + after) * int(found["steps"].sum())


def draw(rows: list[dict[str, Any]], out: Path) -> None:
    """Runs per second of one processor over the number of runs, beside the floor."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    ax = figure.add_subplot()
    for control, color in (("continuous", "#0072B2"), ("sampled", "#D55E00")):
        some = [r for r in rows if r["control"] == control]
        n = [r["runs"] for r in some]
        made = [1e6 / r["us_a_run"] for r in some]
        bare = [1e6 / r["floor_us_a_run"] for r in some]
        ax.plot(n, made, "o-", color=color, label=f"{control} control")
        ax.plot(n, bare, "--", color=color, lw=1.0)
    ax.plot([], [], "--", color="0.4", lw=1.0, label="as many steps of mj_step alone")
    ax.set(xscale="log", xlabel="runs in a call [1]", ylim=(0.0, None))
    ax.set(ylabel=f"runs of {SHORT_STEPS} steps per processor second [1/s]")
    ax.grid(color="0.9")
    ax.legend(frameon=False, fontsize=9)
    with atomic(out / "throughput.png") as f:
        figure.savefig(f, dpi=150)


def stability_map() -> dict[str, float]:
    """50 dampings by 20 gains, 2 s each: seconds, and how many are unstable."""
    grid = [(b, k) for b in np.geomspace(5.0, 500.0, 50) for k in np.linspace(0.2, 6.0, 20)]
    todo = [hc.constant_cut(b=b, gain=(k, 0.2), start=(0.1, 0.0), t_max=2.0) for b, k in grid]
    warm(todo)
    begin = time.perf_counter()
    found = hc.simulate_batch(todo, keep="summaries")
    wall = time.perf_counter() - begin
    return {
        "runs": len(todo),
        "wall_s": wall,
        "unstable": int(np.isin(found["code"], ["diverged", "limit cycle"]).sum()),
    }


TITLES = {
    "first_call": "The first native run of a process, imports included, in processor seconds. "
    "Earlier releases compiled in it (uncached) or loaded what an earlier process had stored "
    "(cached).",
    "rows": "The closed loop, every sample recorded, against the floor: a bare loop of `mj_step` "
    "in C with the same model, measured alternately; medians. `mj_step` also looks for contacts "
    "and reads a clock 28 times; the loop calls only the pieces of a step that the arm needs, "
    "which give the same bits. On a busy machine the ratios are reliable, the microseconds are "
    "not.",
    "batch": "Batches over the floor on all cores, measured alternately: time on the clock, and "
    "processor time.",
    "linearity": "Time per run, from a small batch to a large one, over the floor in the same way; "
    "peak memory of the process so far.",
    "short": "Short runs from a generator, summaries only, on all cores: seconds; seconds of as "
    "many steps of the bare engine on all cores; seconds for making the scenarios.",
    "columns": "Runs of 100 steps drawn as columns, summaries only: processor time over that of "
    "as many steps of the bare engine, which are measured before and after: a drift of the machine "
    "within the minutes of a million runs is in the ratio.\n\n![runs of columns](throughput.png)",
    "map": "A stability map: 50 dampings by 20 gains, 2 s each.",
}


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    out = []
    for name, title in TITLES.items():
        if data.get(name):
            cells = [
                {
                    k.replace("_", " "): format(x, ".2f") if isinstance(x, float) else x
                    for k, x in r.items()
                }
                for r in data[name]
            ]
            out += [title, common.table(cells)]
            if name == "columns" and "column_turns" in data:
                out.append(f"Up to {FEW:,} runs: medians of {data['column_turns']} calls.")
    return out


def conclusions(data: dict[str, Any]) -> list[str]:
    """The cost of a step beside the engine's, and the largest number of runs."""
    out = []
    found = [r["native_recorded"] for r in data.get("rows", ()) if r.get("native_recorded")]
    if found:
        bounds = dict.fromkeys(f"{f(found):.2f}" for f in (min, max))
        out.append(
            f"Throughput. A compiled step of the whole loop, every sample recorded, takes "
            f"{' to '.join(bounds)} times as long as a bare `mj_step` of the same model."
        )
    if data.get("columns"):
        x = max(data["columns"], key=lambda r: r["runs"])
        out.append(
            f"Many runs. {x['runs']:,} runs of {SHORT_STEPS} steps in one call take "
            f"{x['over_floor_cpu']:.2f} times the processor time of as many bare steps, "
            f"{x['runs_a_second']:,.0f} runs a second."
        )
    return out


def main(
    out: Path = Path("out/bench"),
    quick: bool = False,
    rounds: int | None = None,
    steps: int | None = None,
    full: bool = False,
) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    rounds, steps = rounds or (3 if quick else 7), steps or (5000 if quick else 20_000)
    data: dict[str, Any] = {"rounds": rounds, "steps": steps}
    compiled = kernel.is_there()
    if compiled and not quick:
        data["first_call"] = [first_calls()]
    data["rows"] = measure(rounds, steps)
    if compiled:
        sizes = [(64, 1000)] if quick else [(64, 1000), (1024, 1000), (64, LONG), (1024, LONG)]
        data["batch"] = batches(sizes + full * [(16384, LONG)], 1 if quick else min(rounds, 5))
        runs = SHORT_QUICK if quick else SHORT
        data["short"] = [short_runs(runs, "continuous"), short_runs(runs // 4, "sampled")]
        powers = {x: 4 if quick else most for x, most in COLUMNS.items()}
        sizes = {x: [10**k for k in range(2, most + 1)] for x, most in powers.items()}
        data["columns"] = [row for x, some in sizes.items() for row in column_runs(some, x)]
        data["column_turns"] = TURNS
        out.mkdir(parents=True, exist_ok=True)
        draw(data["columns"], out)
    if compiled and full:
        data["linearity"] = linearity([1000, 10_000, 100_000], 200)
        data["map"] = [stability_map()]
    return common.write(out, "throughput", data)


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--rounds", type=int)
    parser.add_argument("--steps", type=int)
    parser.add_argument("--full", action="store_true")
    args = parser.parse_args()
    print(
        "\n\n".join(sections(main(args.out, rounds=args.rounds, steps=args.steps, full=args.full)))
    )
