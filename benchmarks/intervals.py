"""Share of 95 % intervals of `identify` that hold the truth.

Encoders from coarse to fine, every coefficient, many seeds.

    python -m benchmarks.intervals [--seeds 200] [--processes 2] [--out DIR]

Every seed draws phases and sensor noise anew; its runs are simulated once and measured by each
sensor. With a folder, writes intervals.md and intervals.json. 200 seeds take about two hours of
processor time.
"""

from __future__ import annotations

import functools
import importlib
import math
import multiprocessing
import statistics
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from tabulate import tabulate
from tqdm import tqdm

import hapticclay as hc
from hapticclay.studies import identification

from . import common

SENSORS = {
    f"{counts} counts": hc.studies.Noise(counts, 0.0)
    for counts in (8_000, 12_000, 16_000, 20_000, 40_000)
} | {
    "10000 counts, 0.1 N": hc.studies.Noise(10_000, 0.1),
    "2^30 counts": hc.studies.Noise(2**30, 0.0),
}
BLOCKS: tuple[tuple[str, bool], ...] = (
    ("G", False),
    ("S", False),
    ("S", True),
    ("Th", False),
)  # what, shaping


def one(
    seed: int,
    blocks: tuple[tuple[str, bool], ...] = BLOCKS,
    axes: str = "xy",
    sensors: Mapping[str, hc.studies.Noise] = SENSORS,
    **kw: Any,
) -> list[dict[str, Any]]:
    """A row for each coefficient of each block and sensor:

    its share of error, and of half its interval.
    """
    module = importlib.import_module("hapticclay.studies.identification")
    simulate = module.simulate
    runs = kw.get("realisations", identification.REALISATIONS)
    module.simulate = functools.lru_cache(runs)(
        functools.partial(simulate, engine="native")
    )  # for every sensor
    try:
        return [
            {
                "what": what,
                "inertia_shaping": shaping,
                "axis": axis,
                "sensors": name,
                "coefficient": c.name,
                "error": c.error,
                "half": 0.5 * (c.high - c.low) / c.printed,
            }
            for what, shaping in blocks
            for axis in axes
            for name, noise in sensors.items()
            for c in hc.studies.identify(
                axis, what, inertia_shaping=shaping, noise=noise, seed=seed, **kw
            ).coefficients
        ]
    finally:
        module.simulate = simulate


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Coverage and median half interval, of each coefficient and sensor."""
    groups: dict[tuple, list[dict[str, Any]]] = {}
    for r in rows:
        groups.setdefault(
            tuple(r[k] for k in ("what", "inertia_shaping", "axis", "coefficient", "sensors")), []
        ).append(r)
    return [
        dict(zip(("what", "inertia_shaping", "axis", "coefficient", "sensors"), key, strict=True))
        | {
            "seeds": len(g),
            "covered": sum(abs(r["error"]) <= r["half"] for r in g) / len(g),
            "half": statistics.median(r["half"] for r in g),
        }
        for key, g in groups.items()
    ]


def page(found: list[dict[str, Any]]) -> str:
    """The Markdown page."""
    cells: dict[tuple, list[str]] = {}
    for x in found:
        block = x["what"] + (", shaped" if x["inertia_shaping"] else "")
        cells.setdefault((block, x["axis"], x["coefficient"]), []).append(
            f"{x['covered']:.3f}, {x['half']:.1e}"
        )
    n = found[0]["seeds"]
    mean = {
        name: statistics.mean(x["covered"] for x in found if x["sensors"] == name)
        for name in SENSORS
    }
    cells["all", "", "mean share"] = [f"{x:.3f}" for x in mean.values()]
    return (
        "\n\n".join(
            [
                "# Coverage of the intervals of `identify`",
                f"Share of {n} seeds whose {100 * identification.CONFIDENCE:g} % interval "
                f"contains the printed value, and half the median interval as a share of it; "
                f"{identification.REALISATIONS} runs. Without force noise, except where the head "
                "of the column names one. By chance alone, two thirds of the shares are within "
                f"{math.sqrt(0.95 * 0.05 / n):.3f} of 0.95. The columns share the runs of a seed. "
                "Made by `benchmarks/intervals.py`.",
                tabulate(
                    [[*k, *v] for k, v in cells.items()],
                    ["block", "axis", "coefficient", *SENSORS],
                    tablefmt="github",
                    disable_numparse=True,
                ),
                "## Machine",
                "\n".join(f"- {x}" for x in common.foot()),
            ]
        )
        + "\n"
    )


def main(seeds: int = 200, processes: int = 2, out: Path | None = None) -> list[dict[str, Any]]:
    """Measures, prints and, with a folder, writes both files."""
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        rows = [
            r for some in tqdm(pool.map(one, range(seeds)), total=seeds, disable=None) for r in some
        ]
    found = summary(rows)
    common.publish(out, "intervals", found, page(found))
    return found


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    parser.set_defaults(out=None)
    args = parser.parse_args()
    main(args.seeds, args.processes, args.out)
