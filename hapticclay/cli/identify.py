"""What `hapticclay identify` does: identifies block by block, prints a table, writes figures and numbers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ..files import atomic, writable
from ..model.constants import AXES
from ..studies.identification import BLOCK_KINDS, IDENTIFICATION_SCHEMA, Identified, Noise, identify
from ..studies.workspace import Drift, drift_map

QUICK: dict[str, Any] = {"periods": 1, "lines": 20}
QUICK_PERIOD = {"G": 2.5, "S": 2.5, "Th": 5.0}  # [s]
QUICK_BAND = {"G": (0.3, 20.0), "S": (0.3, 20.0), "Th": (0.15, 3.0)}  # [Hz]
SPACING, QUICK_SPACING = 0.08, 0.2  # of the map's poses [m]


def run(
    out: Path,
    axes: Sequence[str],
    noise: bool,
    with_map: bool,
    quick: bool,
    seed: int,
    control: str,
) -> None:
    """Does all of it, under a progress bar.

    Args:
        out: folder for identify.json and the figures. axes: which. noise: whether the sensors have any.
        with_map: whether to identify over the workspace too. quick: shorter signals. seed, control: as identify().

    Raises:
        ParameterError: seed is out of its bounds, or a file cannot be written.
    """
    from tqdm import tqdm

    form = "{desc} {percentage:3.0f}% |{bar}| {elapsed} <{remaining}"
    results: list[Identified] = []
    found = None
    with tqdm(
        total=1.0, desc="identify", bar_format=form, delay=2.0, disable=None, leave=False
    ) as bar:

        def show(done: int, total: int) -> None:
            bar.update(done / total - bar.n)

        jobs = [(what, axis) for what in BLOCK_KINDS for axis in axes]
        for i, (what, axis) in enumerate(jobs):
            kw = {**QUICK, "period": QUICK_PERIOD[what], "band": QUICK_BAND[what]} if quick else {}
            results.append(
                identify(
                    axis, what, noise=Noise() if noise else None, seed=seed, control=control, **kw,
                    progress=lambda done, total, i=i: show(i * total + done, len(jobs) * total),
                )
            )  # fmt: skip
        if with_map:
            bar.set_description("map")
            found = drift_map(QUICK_SPACING if quick else SPACING, seed=seed, progress=show)
    try:
        save(results, found, out)
    finally:  # a full disk must not hide what was found
        print(table(results))
        if found:
            print("\n" + map_table(found))


def table(results: Sequence[Identified]) -> str:
    """Printed and fitted coefficients, a row each."""
    from tabulate import tabulate

    rows = [
        [
            r.what,
            r.axis,
            f"{c.name} [{c.unit}]",
            f"{c.printed:g}",
            f"{c.value:.6g}",
            f"{c.low:.6g} to {c.high:.6g}",
            f"{100.0 * c.error:+.4f} %",
        ]
        for r in results
        for c in r.coefficients
    ]
    head = ["", "axis", "coefficient", "printed", "fitted", "95 % interval", "error"]
    lines = [
        tabulate(
            rows, head, colalign=("left", "left", "left", *("right",) * 4), disable_numparse=True
        )
    ]
    low = min(float(r.coherence.min()) for r in results)
    counts = ", ".join(f"{r.what}{r.axis} {len(r.frequency)}" for r in results)
    return "\n".join([*lines, f"lines: {counts}; lowest coherence {low:.6f}"])


def map_table(found: Drift) -> str:
    """Range of each coefficient over the workspace, with and without shaping."""
    from tabulate import tabulate

    ranges = found.ranges()
    rows = [
        [
            a["what"],
            a["axis"],
            a["name"],
            f"{a['printed']:g}",
            *(f"{r['lowest']:.5g} to {r['highest']:.5g}" for r in (a, b)),
        ]
        for a, b in zip(ranges[::2], ranges[1::2], strict=True)
    ]
    head = ["", "axis", "coefficient", "printed", "without shaping", "with shaping"]
    text = tabulate(
        rows, head, colalign=("left", "left", "left", *("right",) * 3), disable_numparse=True
    )
    return f"over {len(found.x)} poses of the workspace:\n{text}"


def save(results: Sequence[Identified], found: Drift | None, out: Path) -> None:
    """Writes identify.json and the figures, each whole or not at all.

    Raises:
        ParameterError: a file cannot be written.
    """
    head = {"schema": IDENTIFICATION_SCHEMA, "results": [r.summary() for r in results]}
    with atomic(out / "identify.json") as f:
        f.write(
            (
                json.dumps({**head, "map": found.summary() if found else None}, indent=1) + "\n"
            ).encode()
        )
    from ..views import study_plots

    figures = {
        block.figure: study_plots.identification_plot([r for r in results if r.what == what])
        for what, block in study_plots.BLOCKS.items()
    }
    if found:
        figures["map"] = study_plots.workspace_plot(found)
    for name, figure in figures.items():
        with atomic(out / f"{name}.png") as f:
            figure.savefig(f, format="png")


@dataclass(frozen=True)
class Identify:
    """Identify G, Sh and Th on the simulated arm: frequency responses, fits, Figs. 4, 5, 6 (half a minute)."""

    out: Path = Path("out/identify")
    """Folder for identify.json, fig4.png, fig5.png, fig6.png and map.png."""
    axis: Literal["x", "y", "both"] = "both"
    """Which axis."""
    noise: bool = False
    """Record with noise: encoders of 65536 counts a turn, a force sensor of 0.02 N rms."""
    map: bool = False
    """Also how G and Sh drift over the workspace, with and without inertia shaping (two minutes more)."""
    quick: bool = False
    """Shorter signals, a coarser map."""
    seed: int = 0
    """Of the signals' phases and of the noise."""
    control: Literal["continuous", "sampled"] = "continuous"
    """Sampled control is slow: some ten minutes, two with --quick."""

    def __call__(self) -> int:
        writable(self.out)
        axes = AXES if self.axis == "both" else (self.axis,)
        run(self.out, axes, self.noise, self.map, self.quick, self.seed, self.control)
        print(f"written to {self.out}")
        return 0
