"""How a sweep scales: dask workers on the cores of this machine, and what limits it on many.

    python -m benchmarks.scaling [--out DIR] [--rounds N]

A real scheduler and worker processes, as on a cluster; worker counts in turns. Writes scaling.json
and scaling.png.
"""

from __future__ import annotations

import importlib.util
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from hapticclay.files import atomic
from hapticclay.studies import store, store_runs
from hapticclay.studies.sampling import parse_grid
from hapticclay.studies.sweep import Sweep

from . import common

NEEDS = ("distributed", "pyarrow")
TASKS = 2000  # empty ones, by which the scheduler is timed
ASKED = 10.0  # [s] that a task of a cluster takes (docs/sweep.md)


def job(quick: bool) -> Sweep:
    """Chunks of equal work: runs to the time limit."""
    n = 4 if quick else 32
    return Sweep(
        "constant",
        parse_grid(f"b=20:200:{n}log gain.x=0.2:1:4"),
        {"t_max": 0.2 if quick else 2.0},
        chunk=4,
    )


def nothing(n: int) -> int:
    """A task without work."""
    return n


def measure(quick: bool, rounds: int) -> dict[str, Any]:
    """Time the sweep by number of workers [s], a chunk, and a task of the scheduler."""
    from distributed import Client, LocalCluster

    todo, times = job(quick), {n: [] for n in range(1, common.CORES + 1)}
    bytes_ = 0
    with (
        tempfile.TemporaryDirectory() as folder,
        LocalCluster(
            n_workers=common.CORES,
            threads_per_worker=1,
            dashboard_address="",
            local_directory=folder,
        ) as cluster,
        Client(cluster) as client,
    ):
        crew = sorted(client.scheduler_info(n_workers=-1)["workers"])
        for k in range(rounds + 1):
            for n in times:
                out = Path(folder) / f"{k}-{n}"
                chunks = store.begin(todo, out)
                begin = time.perf_counter()
                jobs = client.map(
                    store_runs.run_part,
                    [todo] * todo.chunks,
                    chunks,
                    [str(out)] * todo.chunks,
                    workers=crew[:n],
                    pure=False,
                )
                client.gather(jobs)
                if k:  # the first time the workers import and compile
                    times[n].append(time.perf_counter() - begin)
                bytes_ = sum(f.stat().st_size for f in (out / "data").iterdir()) / todo.chunks
        begin = time.perf_counter()
        client.gather(client.map(nothing, range(TASKS), pure=False))
        task = (time.perf_counter() - begin) / TASKS
    return {
        "chunks": todo.chunks,
        "runs": len(todo),
        "times": times,
        "task_s": task,
        "chunk_bytes": bytes_,
    }


def rows(found: dict[str, Any]) -> list[dict[str, float]]:
    """Workers, time, rate and efficiency, medians of ratios within a round."""
    alone = found["times"][1]
    out = []
    for n, taken in found["times"].items():
        gain = statistics.median(a / b for a, b in zip(alone, taken, strict=True))
        wall = statistics.median(taken)
        out.append(
            {
                "workers": n,
                "wall_s": wall,
                "runs_per_s": found["runs"] / wall,
                "speedup": gain,
                "efficiency": gain / n,
            }
        )
    return out


def projection(found: dict[str, Any]) -> list[dict[str, float]]:
    """Upper bounds for many machines:

    chunks of ASKED seconds, a scheduler that hands out one task at a time.
    """
    full = ASKED / found["task_s"]
    out = []
    for n in (16, 128, 1024, 8192, 65536):
        out.append(
            {
                "workers": n,
                "speedup": min(n, full),
                "writes_kB_per_s": 1e-3 * found["chunk_bytes"] * min(n, full) / ASKED,
            }
        )
    return out


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    if not data.get("rows"):
        return []

    def table(found: list[dict[str, float]]) -> str:
        cells = [
            {k.replace("_", " "): (f"{x:.3g}" if x < 1e3 else f"{x:.0f}") for k, x in r.items()}
            for r in found
        ]
        return common.table(cells)

    return [
        f"A sweep of {data['runs']} runs in {data['chunks']} chunks on dask workers of one thread, "
        "up to all "
        f"{data['cores']} cores of this machine: measured, medians of ratios.",
        table(data["rows"]),
        "![scaling of a sweep](scaling.png)",
        "More cores were not measured. Chunks do not communicate, so many machines are limited "
        f"by the scheduler, {1e3 * data['task_s']:.2f} ms per task here with busy workers, and by "
        f"the shared folder, {1e-3 * data['chunk_bytes']:.0f} kB per chunk. With chunks of "
        f"{data['asked_s']:.0f} s that gives, at best:",
        table(data["projection"]),
    ]


def conclusions(data: dict[str, Any]) -> list[str]:
    """The speed-up that was measured."""
    return [
        f"Scaling. A sweep on {r['workers']} dask workers is {r['speedup']:.2f} times as fast as "
        "on one."
        for r in data["rows"][-1:]
    ]


def draw(data: dict[str, Any], out: Path) -> None:
    """Speed-up measured, beside the ideal and the bound by the scheduler."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.2), layout="constrained")
    ax = figure.add_subplot()
    full = data["asked_s"] / data["task_s"]  # workers that the scheduler keeps busy
    many = sorted([1.0, full, *(r["workers"] for r in data["projection"])])
    ax.plot(many, many, color="0.7", lw=1.0, label="ideal")
    label = f"bound by the scheduler, chunks of {data['asked_s']:.0f} s: projected"
    ax.plot(many, [min(n, full) for n in many], "--", color="#D55E00", label=label)
    ax.plot(
        [r["workers"] for r in data["rows"]],
        [r["speedup"] for r in data["rows"]],
        "o",
        color="#0072B2",
        label="measured",
    )
    ax.set(xscale="log", yscale="log", xlabel="workers [1]", ylabel="speed-up over one worker [1]")
    ax.grid(color="0.9")
    ax.legend(frameon=False, fontsize=9)
    with atomic(out / "scaling.png") as f:
        figure.savefig(f, dpi=150)


def main(
    out: Path = Path("out/bench"), quick: bool = False, rounds: int | None = None
) -> dict[str, Any]:
    """Measures, writes the data and the diagram; returns the data."""
    missing = [name for name in NEEDS if not importlib.util.find_spec(name)]
    if missing:
        return common.write(
            out,
            "scaling",
            {"rows": [], "omissions": [f"scaling: {x} is not installed" for x in missing]},
        )
    found = measure(quick, rounds or (1 if quick else 5))
    data = {
        **found,
        "cores": common.CORES,
        "asked_s": ASKED,
        "rows": rows(found),
        "projection": projection(found),
    }
    draw(data, out)
    return common.write(out, "scaling", data)


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--rounds", type=int)
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, rounds=args.rounds))))
