"""Every benchmark, and the one page that holds their results.

    python -m benchmarks.bench [--out DIR] [--readme FILE] [--quick] [--anew] [--check]
        [--page-only]

Each part writes its own data as JSON; bench.md is made from these files and nothing else. After an
interruption, the same command measures the parts that are missing or were measured on other code.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from tabulate import tabulate
from tqdm import tqdm

from hapticclay import files

from . import (
    common,
    extremes,
    hits,
    parts,
    provenance,
    ranking,
    sampled_loop,
    scaling,
    stiffness,
    study,
    throughput,
    work_precision,
    yielding_clay,
)

PARTS: dict[str, Any] = {
    "work_precision": work_precision,
    "sampled_loop": sampled_loop,
    "yielding_clay": yielding_clay,
    "hits": hits,
    "stiffness": stiffness,
    "extremes": extremes,
    "throughput": throughput,
    "parts": parts,
    "scaling": scaling,
}
LIMITATIONS = (
    "Run times are those of one machine, named below, with other programs on it: compare numbers "
    "within a table, not with those of another machine. Run times leave out imports, and the "
    "compilation of SciPy's right-hand sides.",
    "All jobs are the planar arm of the paper in clay. Another arm, contact geometry or a larger "
    "model was not measured.",
    "The programs for the other packages are ours, written from the same equations "
    "(`benchmarks/peers`). Their authors might tune them better; a corrected program is welcome.",
    "Settings are a ladder of steps or tolerances. The best setting between two of them may be "
    "faster than the table says.",
    "Errors are those against a reference of limited accuracy, stated with each section. An error "
    "close to that accuracy is an upper bound.",
    "The real-time behaviour of an operating system, a bus or a device is not part of any number.",
)
PARTLY_IN_PYTHON = (  # said of figures of a release that left some steps to Python
    "The release measured here made the first steps of a process that cross a border or stop in "
    "Python. The tables of cuts, hits and sampled loops contain such steps; those of throughput "
    "are compiled throughout; that of yielding clay has both."
)
BEGIN, END = "<!-- recommend: benchmarks/bench.py --readme -->", "<!-- end -->"


def load(folder: Path) -> dict[str, dict[str, Any]]:
    """The data of the parts that folder holds."""
    files = {name: folder / f"{name}.json" for name in PARTS}
    return {name: json.loads(file.read_text()) for name, file in files.items() if file.is_file()}


def page(data: dict[str, dict[str, Any]]) -> str:
    """The Markdown page."""
    text = [
        "# Benchmarks",
        "Every figure here comes from the runs of `hapticclay bench`; do not edit.",
    ]
    if {"work_precision", "hits"} <= set(data):
        text += [
            "## Which step to take",
            "hapticclay's fastest setting whose border-crossing times stay within the requested "
            "error, in every cut of the next section and in every clay and job of the section on "
            "hits.",
            recommended(data),
        ]
    for name, found in data.items():
        text += PARTS[name].sections(found)
    omissions = [x for found in data.values() for x in found.get("omissions", ())]
    limitations = list(LIMITATIONS)
    if any(study.is_of_both(found) for found in data.values()):
        limitations.insert(2, PARTLY_IN_PYTHON)
    text += ["## Limitations", "\n".join(f"- {x}" for x in limitations)]
    text += ["## Left out", "\n".join(f"- {x}" for x in omissions) or "Nothing.", "## Machine"]
    made: dict[tuple[str, ...], list[str]] = {}
    for name, found in data.items():
        lines = *found["machine"], *made_line(found.get("made"))
        made.setdefault(lines, []).append(name.replace("_", " "))
    text += [
        "\n".join((f"- {', '.join(names)}:", *(f"  - {x}" for x in lines)))
        for lines, names in made.items()
    ]
    return "\n\n".join(text) + "\n"


def made_line(made: dict[str, Any] | None) -> list[str]:
    """A line on when and on which code a part was measured; none for data without it."""
    if made is None:
        return []
    load = " and ".join(map(str, made["load"]))
    return [
        f"commit {made['commit']}, {made['date']}, in {made['took']:.0f} s; "
        f"load average {load}, before and after"
    ]


def recommended(data: dict[str, dict[str, Any]]) -> str:
    """The table of recommended settings for the README:

    good for every job of hapticclay's, hits among them.
    """
    rows = data["work_precision"]["rows"] + data["hits"]["rows"]
    return ranking.table_of_settings(ranking.recommend(rows, {"hapticclay"}))


def publish(out: Path, readme: Path | None = None) -> None:
    """Writes the page from the data in out, and the table in readme."""
    data = load(out)
    with files.atomic(out / "bench.md") as f:
        f.write(page(data).encode())
    if readme:
        head, _, rest = readme.read_text().partition(BEGIN)
        with files.atomic(readme) as f:
            f.write(
                f"{head}{BEGIN}\n\n{recommended(data)}\n\n{END}{rest.partition(END)[2]}".encode()
            )


def is_measured(name: str, out: Path, quick: bool) -> bool:
    """Whether a folder holds a part's data, as asked for, measured on the code of this checkout."""
    found = load(out).get(name)
    return bool(found and found.get("quick") == quick and not provenance.stale({name: found}))


def estimated(names: list[str], data: dict[str, dict[str, Any]]) -> float:
    """Time that parts take together by the durations that were noted last [s]; 0 for unknown."""
    took = [data.get(name, {}).get("made", {}).get("took", 0.0) for name in names]
    return sum(took) if all(took) else 0.0


def measure(out: Path, quick: bool, anew: bool) -> None:
    """Measures the parts whose data are missing or stale, with a bar."""
    due = [name for name in PARTS if anew or not is_measured(name, out, quick)]
    for name in PARTS:
        if name not in due:
            print(f"{name.replace('_', ' ')}: measured before on this code", flush=True)
    published = {} if quick else load(provenance.ROOT / "docs" / "bench")
    left = estimated(due, published | load(out))
    if left:
        print(f"about {left / 60.0:.0f} min by the durations noted last", flush=True)
    with tqdm(total=len(due), unit="part", disable=None, leave=False) as bar:
        for name in due:
            bar.set_description(name.replace("_", " "))
            watch = provenance.Stopwatch()
            found = PARTS[name].main(out, quick)
            common.note(out, name, {**found, "quick": quick, "made": watch.stamp()})
            bar.update()


def check(folder: Path) -> int:
    """Prints which parts of a page are older than the code; the exit status, 1 if one is."""
    data = load(folder)
    old = provenance.stale(data)
    missing = [name for name in PARTS if name not in data]
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
    """Measures what is due, writes data, diagrams and the page, prints what matters most."""
    measure(out, quick, anew)
    publish(out, readme)
    data = load(out)
    print(f"\n{recommended(data)}\n")
    print(tabulate(ranking.dominance(data["work_precision"]["rows"]), headers="keys"))
    rows = data["extremes"]["rows"]
    print(
        f"\nextreme scenes: {sum(r['agree'] for r in rows)} of {len(rows)} verdicts are those of "
        "the reference"
    )
    for x in data["work_precision"]["omissions"]:
        print(f"left out: {x}")
    print(f"written to {out}, the page is {out / 'bench.md'}")


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="fewer jobs, settings and scenes: about two minutes"
    )
    parser.add_argument(
        "--readme", type=Path, help="a README whose table of recommended settings is to be renewed"
    )
    parser.add_argument(
        "--page-only", action="store_true", help="make the page anew from the data in the folder"
    )
    parser.add_argument("--anew", action="store_true", help="measure all parts again")
    parser.add_argument(
        "--check", action="store_true", help="name the parts in the folder older than the code"
    )
    args = parser.parse_args()
    if args.check:
        sys.exit(check(args.out))
    if args.page_only:
        publish(args.out, args.readme)
    else:
        main(args.out, args.quick, args.readme, args.anew)
