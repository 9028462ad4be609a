"""The Z-width of a virtual wall over damping, sample, delay, encoder and filter, by runs.

    python -m benchmarks.zwidth [--out DIR] [--quick]

The trends of Colgate and Brown (Factors affecting the Z-width of a haptic display, ICRA 1994) as a
table; writes zwidth.md and zwidth.json, whose every figure comes from runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tabulate import tabulate

import hapticclay as hc
from hapticclay import files

from . import common

DEVICE = hc.Device(mass=0.1, damper=0.5)
SMOOTH = hc.VirtualWall(device=DEVICE)
DRY = replace(SMOOTH, device=replace(DEVICE, friction=0.02))
ROUGH = replace(DRY, device=replace(DRY.device, quantum=2e-5))
Case = tuple[str, str, hc.VirtualWall, tuple[Any, ...]]
CASES: tuple[Case, ...] = (
    ("grows with physical damping", "damper", SMOOTH, (0.1, 0.5, 2.0, 10.0)),
    ("falls with the sample", "Ts", SMOOTH, (2.5e-4, 5e-4, 1e-3, 2e-3)),
    ("falls with the delay", "delay", SMOOTH, (0.0, 1e-3, 3e-3, 1e-2)),
    ("falls with a coarse encoder", "quantum", DRY, (0.0, 5e-6, 2e-5, 8e-5)),
    ("a filter helps until its lag costs more", "filter", ROUGH, (None, 100.0, 30.0, 10.0, 3.0)),
    ("so does a longer window", "velocity_window", ROUGH, (1, 4, 16, 64)),
)


def measure(case: Case, quick: bool) -> list[dict[str, Any]]:
    """Rows of one family.

    Args:
        case: what it shows, what varies, the wall, the values.
        quick: fewer values and dampings.
    """
    about, vary, wall, values = case
    if quick:
        values = values[:: len(values) - 1] if vary != "filter" else (None, 30.0, 3.0)
    found = hc.walls.zwidth(wall, vary, values, quick=quick, press=hc.walls.Press(still=1e-6))
    return [
        {
            "about": about,
            "region": r.name,
            "verdict": r.verdict,
            "K0": r.K[0],
            "K": r.largest_K,
            "B": r.largest_B,
            "area": r.area,
            "gap": r.gap() if r.linear else None,
            "violations": r.violations(),
        }
        for r in found.regions
    ]


def page(rows: Sequence[dict[str, Any]]) -> str:
    """The Markdown page."""
    head = ["", "", "K at B = 0 [N/m]", "largest K [N/m]", "largest B [N.s/m]"]
    head += ["area [N^2.s/m^2]", "verdict of a run", "off the exact line"]
    cells, about = [], ""
    for r in rows:
        gap = "-" if r["gap"] is None else f"{100.0 * r['gap']:.2g} %"
        sizes = [f"{r[k]:.4g}" for k in ("K0", "K", "B", "area")]
        name = "" if r["about"] == about else r["about"]
        cells.append([name, r["region"], *sizes, r["verdict"], gap])
        about = r["about"]
    gaps = [r["gap"] for r in rows if r["gap"] is not None]
    below = [x for r in rows for x in r["violations"]]
    return (
        "\n\n".join(
            [
                "# Z-width of a virtual wall",
                "A device of 0.1 kg and b = 0.5 N.s/m, no hand, Ts = 1 ms, unless the row differs; "
                "with an encoder fc = 0.02 N, and the filter's and window's encoder reads 20 um. "
                "Without friction and encoder a wall is stable if the oscillation of a run decays, "
                "with them if it comes to rest within 1 um after a push of 1 N at 50 mm/s. Made by "
                "`benchmarks/zwidth.py`.",
                f"Runs are within {100.0 * max(gaps, default=math.nan):.2g} % of the exact line of "
                f"the linear loop; {len(below)} were unstable below a line that is sufficient.",
                tabulate(cells, head, tablefmt="github", disable_numparse=True),
                "## Machine",
                "\n".join(f"- {x}" for x in common.foot()),
            ]
        )
        + "\n"
    )


def main(out: Path | None, quick: bool = False) -> list[dict[str, Any]]:
    """Measures, prints and, with a folder, writes both files."""
    rows = [row for case in CASES for row in measure(case, quick)]
    print(page(rows))
    if out:
        common.write(out, "zwidth", {"rows": rows})
        with files.atomic(out / "zwidth.md") as f:
            f.write(page(rows).encode())
    return rows


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.set_defaults(out=None)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    main(options.out, options.quick)
