"""Baselines of the environments: mean return with its 95 % interval, over the same seeds.

    python -m benchmarks.gym_baselines [--out DIR] [--seeds N] [--docs] [--ids ID ...]

Writes gym_baselines.json. --docs puts the tables into docs/gym_*.md, with the commit and the date.
"""

from __future__ import annotations

import datetime
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from hapticclay import files
from hapticclay.gym import baselines, scores
from hapticclay.gym.draws import Range
from hapticclay.gym.quantities import Quantity
from hapticclay.views.captions import unit_text

from . import common

DOCS = Path(__file__).parents[1] / "docs"
SHOWN = {  # beside the return
    "CutLine-v0": ("is_success", "mean_error", "speed_spread", "lost"),
    "PareEdge-v0": ("is_success", "mean_error", "speed_spread", "lost"),
    "AdaptiveGain-v0": ("K", "lost"),
    "ProbeClay-v0": ("error_b", "error_Fy", "lost"),
}


def page_of(id: str) -> Path:
    """Return the page of an environment."""
    return DOCS / f"gym_{re.sub(r'(?<!^)(?=[A-Z])', '_', id.split('-')[0]).lower()}.md"


def measure(id: str, seeds: int, engine: str) -> dict[str, Any]:
    """Return the rows of an environment."""
    rows = {}
    for name, maker in baselines.BASELINES[id].items():
        found = baselines.returns(id, maker, range(seeds), engine=engine)
        mean, half = baselines.mean_of(found.total)
        info = {k: float(np.mean(found.info[k])) for k in SHOWN[id]}
        rows[name] = {"return": mean, "half": half, "length": float(found.length.mean()), **info}
        print(f"{id}, {name}: {mean:.2f} +- {half:.2f}", flush=True)
    means = {name: row["return"] for name, row in rows.items()}
    for name, score in scores.scores_of(id, means).items():
        rows[name]["score"] = score
    return rows


def table(id: str, rows: dict[str, Any], seeds: int, measured: str) -> str:
    """Return the table of an environment."""
    columns = ["length", *SHOWN[id], *(["score"] if id in scores.ANCHORS else [])]
    lines = [
        "| policy | return | " + " | ".join(x.replace("_", " ") for x in columns) + " |",
        "|---|---|" + "---|" * len(columns),
    ]
    for name, row in rows.items():
        cells = " | ".join(f"{row[x]:.3g}" for x in columns)
        lines.append(f"| {name} | {row['return']:.2f} ± {row['half']:.2f} | {cells} |")
    lines.append("")
    lines.append(
        f"Means over the seeds 0 to {seeds - 1}, with 95 % intervals. Measured {measured}."
    )
    return "\n".join(lines)


def put(page: Path, section: str, text: str) -> None:
    """Put text into a marked section of a page."""
    begin, end = f"<!-- {section} -->\n", "\n<!-- end -->"
    before, _, rest = page.read_text().partition(begin)
    after = rest.partition(end)[2]
    with files.atomic(page) as f:
        f.write(f"{before}{begin}{text}{end}{after}".encode())


def commit() -> str:
    """Return the commit of the checkout and the date, in words."""
    found = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=DOCS
    )
    return f"on {datetime.date.today()} at commit {found.stdout.strip() or 'unknown'}"


def quantity_table(quantities: Sequence[Quantity]) -> str:
    """Markdown table of quantities: number, name, bounds, unit."""
    rows = ["| num | name | min | max | unit |", "|---|---|---|---|---|"]
    for i, q in enumerate(quantities):
        rows.append(f"| {i} | {q.name} | {q.low:g} | {q.high:g} | {q.unit or '-'} |")
    return "\n".join(rows)


def draw_table(ranges: Mapping[str, Range]) -> str:
    """Markdown table of the numbers drawn."""
    rows = ["| option | what | drawn from | law | allowed | unit |", "|---|---|---|---|---|---|"]
    for name, r in ranges.items():
        law = "log-uniform" if r.log else "uniform"
        ends = f"{r.low:g} to {r.high:g} | {law} | {r.least:g} to {r.most:g}"
        rows.append(f"| `{name}` | {r.what} | {ends} | {r.unit or '-'} |")
    return "\n".join(rows)


def spaces(id: str) -> dict[str, str]:
    """Return the tables of an environment's spaces and draws, by section."""
    env: Any = gymnasium.make(f"hapticclay/{id}", engine="python").unwrapped
    task = env.task
    found = {
        "actions": quantity_table(task.actions),
        "observations": quantity_table(task.observations),
        "draws": draw_table(task.ranges),
    }
    return {name: unit_text(text) for name, text in found.items()}


def main(argv: list[str] | None = None) -> dict[str, Any]:
    """Measure, print and write."""
    parser = common.parser(__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--engine", default="native")
    parser.add_argument("--docs", action="store_true")
    parser.add_argument("--ids", nargs="*", default=list(baselines.BASELINES))
    a = parser.parse_args(argv)
    when, found = commit(), {}
    for id in a.ids:
        found[id] = measure(id, a.seeds, a.engine)
        if a.docs:
            put(page_of(id), "baselines", table(id, found[id], a.seeds, when))
            for section, text in spaces(id).items():
                put(page_of(id), section, text)
    return common.write(a.out, "gym_baselines", {"seeds": a.seeds, "environments": found})


if __name__ == "__main__":
    main(sys.argv[1:])
