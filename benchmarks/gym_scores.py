"""What AdaptiveGain's scores 0 and 1 are: the best shares of the gain limit, by a search.

    python -m benchmarks.gym_scores [--out DIR] [--docs]

Writes gym_scores.json: the return of each reference episode at each share of the gain limit, of the
limit of the worst hand ("best fixed gain") and of that of the drawn one ("best oracle"), with the
commit, the date and the versions. --docs writes it into docs/, too, and its
table into the page of AdaptiveGain.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np

from hapticclay import files
from hapticclay.gym import scores
from hapticclay.gym.baselines import mean_of

from . import common
from .gym_baselines import DOCS, commit, page_of, put

FILE = DOCS / "gym_scores.json"


def table(data: dict[str, Any]) -> str:
    """Return the table of a search: mean returns with 95 % intervals, lost episodes."""
    lines = ["| share of the limit | " + " | ".join(f"{x} | lost" for x in data["families"]) + " |"]
    lines.append("|---|" + "---|---|" * len(data["families"]))
    rows: dict[float, list[str]] = {}
    for i, found in enumerate(data["families"].values()):
        for share, returns, lost in zip(
            found["shares"], found["returns"], found["lost"], strict=True
        ):
            mean, half = mean_of(np.array(returns))
            told = f"{mean:.2f} ± {half:.2f}"
            told = f"**{told}**" if share == found["share"] else told
            rows.setdefault(share, ["", ""] * len(data["families"]))[2 * i : 2 * i + 2] = (
                told,
                str(lost),
            )
    lines += [f"| {share:.2f} | " + " | ".join(rows[share]) + " |" for share in sorted(rows)]
    lines.append("")
    seeds = f"Means over the seeds 0 to {data['seeds'] - 1}, with 95 % intervals"
    lines.append(f"{seeds}; the best in bold. Measured {data['measured']}.")
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> dict[str, Any]:
    """Search, print and write."""
    parser = common.parser(__doc__)
    parser.add_argument("--engine", default="native")
    parser.add_argument("--seeds", type=int, default=len(scores.SEEDS))
    parser.add_argument("--shares", type=float, nargs="*", default=list(scores.SHARES))
    parser.add_argument("--docs", action="store_true")
    a = parser.parse_args(argv)
    found = {}
    for name in scores.FAMILIES:
        x = scores.search(name, a.shares, range(a.seeds), engine=a.engine)
        found[name] = {
            "share": x.best, "shares": x.shares.tolist(), "lost": x.lost.sum(axis=1).tolist(),
            "returns": np.round(x.totals, 4).tolist(),
        }  # fmt: skip
        print(
            f"{name}: {x.best:g} of the gain limit, {x.totals.mean(axis=1).max():.3f}", flush=True
        )
    data = {"measured": commit(), "seeds": a.seeds, "families": found}
    written = common.write(a.out, "gym_scores", data)
    if a.docs:
        with files.atomic(FILE) as f:
            f.write((json.dumps(written) + "\n").encode())
        put(page_of(scores.ID), "scores", table(written))
    return written


if __name__ == "__main__":
    main(sys.argv[1:])
