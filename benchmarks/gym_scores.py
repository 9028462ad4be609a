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
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from hapticclay import files
from hapticclay.errors import choice
from hapticclay.gym.baselines import Fixed, Maker, Oracle, Scores, mean_of, returns
from hapticclay.gym.scores import ID

from . import common
from .gym_baselines import DOCS, commit, page_of, put

FILE = DOCS / "gym_scores.json"
SEEDS = range(100)  # of the reference episodes
SHARES = tuple(round(0.05 * n, 2) for n in range(14, 25))  # of the gain limit, to begin with
FINE, AROUND = 0.01, 4  # step, and number of steps to either side of the best of these
FAMILIES: dict[str, Callable[[float], Maker]] = {"best fixed gain": Fixed, "best oracle": Oracle}


class Searched(NamedTuple):
    """Returns of the policies of a family.

    Attributes:
        shares: of the gain limit, shape (m,).
        totals: sum of rewards of each episode, shape (m, n).
        lost: whether the run diverged, shape (m, n).
    """

    shares: np.ndarray
    totals: np.ndarray
    lost: np.ndarray

    @property
    def best(self) -> float:
        """The share with the largest mean return; of several, the least."""
        return float(self.shares[np.argmax(self.totals.mean(axis=1))])


def search(
    family: str,
    shares: Sequence[float] = SHARES,
    seeds: Sequence[int] = SEEDS,
    *,
    around: int = AROUND,
    **options: Any,
) -> Searched:
    """Runs AdaptiveGain with shares of the gain limit, over the same episodes.

    The shares given come first, then those in steps of 0.01 around the best of them.
    """
    make = FAMILIES[choice("family", family, tuple(FAMILIES))]
    found: dict[float, Scores] = {}

    def run(wanted: Iterable[float]) -> Searched:
        for share in wanted:
            if share not in found:
                found[share] = returns(ID, make(share), seeds, **options)
        tried = sorted(found)
        totals = np.stack([found[x].total for x in tried])
        lost = np.stack([found[x].info["lost"] for x in tried]).astype(bool)
        return Searched(np.array(tried), totals, lost)

    best = run(shares).best
    return run(round(best + FINE * k, 2) for k in range(-around, around + 1))


def table(data: dict[str, Any]) -> str:
    """Return the table of a search: mean returns with 95 % intervals, lost episodes."""
    lines = ["| share of the limit | " + " | ".join(f"{x} | lost" for x in data["families"]) + " |"]
    lines.append("|---|" + "---|---|" * len(data["families"]))
    rows: dict[float, list[str]] = {}
    for i, found in enumerate(data["families"].values()):
        columns = found["shares"], found["returns"], found["lost"]
        for share, totals, lost in zip(*columns, strict=True):
            mean, half = mean_of(np.array(totals))
            text = f"{mean:.2f} ± {half:.2f}"
            text = f"**{text}**" if share == found["share"] else text
            row = rows.setdefault(share, ["", ""] * len(data["families"]))
            row[2 * i : 2 * i + 2] = text, str(lost)
    lines += [f"| {share:.2f} | " + " | ".join(rows[share]) + " |" for share in sorted(rows)]
    lines.append("")
    seeds = f"Means over the seeds 0 to {data['seeds'] - 1}, with 95 % intervals"
    lines.append(f"{seeds}; the best in bold. Measured {data['measured']}.")
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> dict[str, Any]:
    """Search, print and write."""
    parser = common.parser(__doc__)
    parser.add_argument("--engine", default="native")
    parser.add_argument("--seeds", type=int, default=len(SEEDS))
    parser.add_argument("--shares", type=float, nargs="*", default=list(SHARES))
    parser.add_argument("--docs", action="store_true")
    a = parser.parse_args(argv)
    found = {}
    for name in FAMILIES:
        x = search(name, a.shares, range(a.seeds), engine=a.engine)
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
        put(page_of(ID), "scores", table(written))
    return written


if __name__ == "__main__":
    main(sys.argv[1:])
