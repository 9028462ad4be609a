"""Every benchmark, and the one page that holds their results.

    python -m benchmarks.bench [--quick] [--out DIR] [--readme FILE] [--page-only]

Each part writes its own data as JSON; bench.md is made from these files and nothing else.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hapticclay import files

from . import common, extremes, hits, parts, scaling, stiffness, throughput, work_precision

PARTS: dict[str, Any] = {
    "work_precision": work_precision,
    "hits": hits,
    "stiffness": stiffness,
    "extremes": extremes,
    "throughput": throughput,
    "parts": parts,
    "scaling": scaling,
}
LIMITATIONS = (
    "Run times are those of one machine, named below, with other programs on it: compare numbers "
    "within a table, not with those of another machine. Compilation is left out of all run times "
    "but that of the first call.",
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
    text += ["## Limitations", "\n".join(f"- {x}" for x in LIMITATIONS)]
    text += ["## Left out", "\n".join(f"- {x}" for x in omissions) or "Nothing.", "## Machine"]
    made: dict[tuple[str, ...], list[str]] = {}
    for name, found in data.items():
        made.setdefault(tuple(found["machine"]), []).append(name.replace("_", " "))
    text += [
        "\n".join((f"- {', '.join(names)}:", *(f"  - {x}" for x in lines)))
        for lines, names in made.items()
    ]
    return "\n\n".join(text) + "\n"


def recommended(data: dict[str, dict[str, Any]]) -> str:
    """The table of recommended settings for the README:

    good for every job of hapticclay's, hits among them.
    """
    rows = data["work_precision"]["rows"] + data["hits"]["rows"]
    return work_precision.table_of_settings(work_precision.recommend(rows, {"hapticclay"}))


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


def main(out: Path = Path("out/bench"), quick: bool = False, readme: Path | None = None) -> None:
    """Measures all parts, writes data, diagrams and the page, prints what matters most."""
    for name, part in PARTS.items():
        print(f"{name.replace('_', ' ')} ...", flush=True)
        part.main(out, quick)
    publish(out, readme)
    data = load(out)
    print(f"\n{recommended(data)}\n")
    print(
        work_precision.tabulate(
            work_precision.dominance(data["work_precision"]["rows"]), headers="keys"
        )
    )
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
        "--quick", action="store_true", help="fewer jobs, settings and scenes: about a minute"
    )
    parser.add_argument(
        "--readme", type=Path, help="a README whose table of recommended settings is to be renewed"
    )
    parser.add_argument(
        "--page-only", action="store_true", help="make the page anew from the data in the folder"
    )
    args = parser.parse_args()
    if args.page_only:
        publish(args.out, args.readme)
    else:
        main(args.out, args.quick, args.readme)
