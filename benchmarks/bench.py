"""All benchmarks, each measured where its data are missing or were measured on other code.

    python -m benchmarks.bench [--out DIR] [--readme FILE] [--quick] [--anew] [--check]

Each part writes its own data as JSON; `benchmarks.pages` makes the pages from these files. After an
interruption, the same command measures the parts that are missing.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from tabulate import tabulate
from tqdm import tqdm

from . import common, extremes, pages, provenance, ranking


def is_measured(name: str, out: Path, quick: bool) -> bool:
    """Whether a folder holds a part's data, as asked for, measured on the code of this checkout."""
    found = pages.load(out).get(name)
    return bool(found and found.get("quick") == quick and not provenance.stale({name: found}))


def estimated(names: list[str], data: dict[str, dict[str, Any]]) -> float:
    """Time that parts take together by the durations that were noted last [s]; 0 for unknown."""
    took = [data.get(name, {}).get("made", {}).get("took", 0.0) for name in names]
    return sum(took) if all(took) else 0.0


def measure(out: Path, quick: bool, anew: bool) -> None:
    """Measures the parts whose data are missing or stale, with a bar."""
    due = [name for name in pages.PARTS if anew or not is_measured(name, out, quick)]
    for name in pages.PARTS:
        if name not in due:
            print(f"{name.replace('_', ' ')}: measured before on this code", flush=True)
    published = {} if quick else pages.load(provenance.ROOT / "docs" / "bench")
    left = estimated(due, published | pages.load(out))
    if left:
        print(f"about {left / 60.0:.0f} min by the durations noted last", flush=True)
    with tqdm(total=len(due), unit="part", disable=None, leave=False) as bar:
        for name in due:
            bar.set_description(name.replace("_", " "))
            watch = provenance.Stopwatch(name)
            found = pages.PARTS[name].main(out, quick)
            common.note(out, name, {**found, "quick": quick, "made": watch.stamp()})
            bar.update()


def check(folder: Path) -> int:
    """Prints which parts of a page are older than the code; the exit status, 1 if one is."""
    data = pages.load(folder)
    old = provenance.stale(data)
    missing = [name for name in pages.PARTS if name not in data]
    for name in missing:
        print(f"{name}: not measured")
    for name, commit in old.items():
        print(f"{name}: measured on other code than this (commit {commit})")
    if not (old or missing):
        print(f"{folder / 'bench.md'}: all parts were measured on this code")
    return int(bool(old or missing))


def main(
    out: Path = Path("out/bench"),
    quick: bool = False,
    readme: Path | None = None,
    anew: bool = False,
) -> None:
    """Measures what is due, writes data, diagrams and pages, prints what matters most."""
    measure(out, quick, anew)
    pages.publish(out, readme)
    data = pages.load(out)
    print(f"\n{pages.recommended(data)}\n")
    print(tabulate(ranking.dominance(data["work_precision"]["rows"]), headers="keys"))
    print(f"\nextreme scenes: {extremes.verdicts(data['extremes']['rows'])}")
    for x in data["work_precision"]["omissions"]:
        print(f"left out: {x}")
    print(f"written to {out}, the first page is {out / 'bench.md'}")


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="fewer jobs, settings and scenes: about two minutes"
    )
    parser.add_argument(
        "--readme", type=Path, help="a README whose table of recommended settings is to be renewed"
    )
    parser.add_argument("--anew", action="store_true", help="measure all parts again")
    parser.add_argument(
        "--check", action="store_true", help="name the parts in the folder older than the code"
    )
    args = parser.parse_args()
    if args.check:
        sys.exit(check(args.out))
    main(args.out, args.quick, args.readme, args.anew)
