"""The pages of the benchmarks, made from the data that the parts have written and nothing else.

    python -m benchmarks.pages [--out DIR] [--readme FILE]

bench.md has the conclusions and which step to take; behind it each part has a page of its tables,
and a CSV file of all its rows where it has many.
"""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path
from typing import Any

from hapticclay import files

from . import (
    arms,
    common,
    diagrams,
    extremes,
    hits,
    pairs,
    parts,
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
    "arms": arms,
    "pairs": pairs,
    "throughput": throughput,
    "parts": parts,
    "scaling": scaling,
}
TITLES = {
    "work_precision": "Error against run time: cuts",
    "sampled_loop": "Error against run time: sampled control",
    "yielding_clay": "Error against run time: clay that yields",
    "hits": "Hits on clay of any stiffness",
    "stiffness": "Stiff clay",
    "extremes": "Stiff and extreme scenes",
    "arms": "Gain limits of arms in runs",
    "pairs": "Leader and follower: gain and delay in runs",
    "throughput": "Throughput",
    "parts": "What each part costs",
    "scaling": "Scaling of a sweep",
}
LIMITATIONS = (
    "Run times are those of one machine, named below, with other programs on it: compare numbers "
    "within a table, not with those of another machine. Run times leave out imports, and the "
    "compilation of SciPy's right-hand sides.",
    "All jobs but the limits of arms and pairs are of the planar arm in clay. Contact geometry "
    "or a larger model was not measured.",
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
BEGIN, END = "<!-- recommend: benchmarks/pages.py --readme -->", "<!-- end -->"


def load(folder: Path) -> dict[str, dict[str, Any]]:
    """The data of the parts that folder holds."""
    files = {name: folder / f"{name}.json" for name in PARTS}
    return {name: json.loads(file.read_text()) for name, file in files.items() if file.is_file()}


def conclusions_page(data: dict[str, dict[str, Any]]) -> str:
    """The first page: what follows from the numbers, and which step to take."""
    text = ["# How accurate and how fast", measured_on(data), "## Conclusions"]
    rows = []
    for name, found in data.items():
        for sentence in PARTS[name].conclusions(found):
            subject, _, rest = sentence.partition(". ")
            rows.append(f"- **{subject}:** {rest} ([numbers]({name}.md))")
    text.append("\n".join(rows))
    if "work_precision" in data:
        text += [
            "![Error of the border-crossing times over run time, a line a package](bench.png)",
            "*The cut of the paper. A line is the best of all settings and methods of a package; "
            "shown are the six packages that keep an error of 1e-3 s in the least time.*",
        ]
    if {"work_precision", "hits"} <= set(data):
        text += ["## Which step to take", *steps_to_take(data)]
    limitations: list[str] = list(LIMITATIONS)
    if any(study.is_of_both(found) for found in data.values()):
        limitations.insert(2, PARTLY_IN_PYTHON)
    text += ["## Limitations", "\n".join(f"- {x}" for x in limitations)]
    text += ["## Data", *list_of_parts(data)]
    return "\n\n".join(text) + "\n"


def part_page(name: str, found: dict[str, Any]) -> str:
    """The page of one part: its sections, what it leaves out, when and on what it was measured."""
    text = [f"# {TITLES[name]}", *PARTS[name].sections(found)]
    if found.get("omissions"):
        text += ["## Left out", "\n".join(f"- {x}" for x in found["omissions"])]
    links = [f"[{name}.{kind}]({name}.{kind})" for kind in ("csv", "json") if kind in kinds(name)]
    text += ["## Data and machine", f"All numbers: {', '.join(links)}."]
    text.append("\n".join(f"- {x}" for x in [*made_line(found), *found["machine"][:2]]))
    return "\n\n".join(text) + "\n"


def kinds(name: str) -> tuple[str, ...]:
    """The kinds of files that hold the numbers of a part."""
    return ("json", "csv") if hasattr(PARTS[name], "tables") else ("json",)


def measured_on(data: dict[str, dict[str, Any]]) -> str:
    """The sentence on commits, dates and machines of all parts."""
    made = [found["made"] for found in data.values() if "made" in found]
    commits = ", ".join(f"`{x}`" for x in dict.fromkeys(x["commit"] for x in made))
    dates = ", ".join(dict.fromkeys(x["date"] for x in made))
    machines = "; ".join(dict.fromkeys(found["machine"][0] for found in data.values()))
    when = f" at commit {commits} on {dates}" if made else ""
    return f"Measured{when}: {machines}."


def made_line(found: dict[str, Any]) -> list[str]:
    """A line on when and on which code a part was measured; none for data without it."""
    if "made" not in found:
        return []
    made = found["made"]
    load = " and ".join(map(str, made["load"]))
    return [
        f"commit `{made['commit']}`, {made['date']}, in {made['took']:.0f} s; "
        f"load average {load}, before and after"
    ]


def list_of_parts(data: dict[str, dict[str, Any]]) -> list[str]:
    """The table of parts with their pages, files and measurements, and the machines' lines."""
    cells = []
    for name, found in data.items():
        made = found.get("made", {})
        links = ", ".join(f"[{kind.upper()}]({name}.{kind})" for kind in kinds(name))
        load = " / ".join(map(str, made.get("load", ())))
        took = f"{made['took']:.0f}" if made else ""
        title = f"[{TITLES[name]}]({name}.md)"
        cells.append([title, links, made.get("commit", ""), made.get("date", ""), took, load])
    head = ["part", "data", "commit", "date", "took [s]", "load before / after"]
    machines = dict.fromkeys("; ".join(found["machine"][:2]) for found in data.values())
    return [common.table(cells, head), *machines]


def steps_to_take(data: dict[str, dict[str, Any]]) -> list[str]:
    """The fastest settings for a requested error, for cuts alone and for all jobs, in one table."""
    cuts = ranking.recommend(data["work_precision"]["rows"], {"hapticclay"})
    every = {x["asked"]: x for x in every_job(data)}
    cells = []
    for x in cuts:
        both = [ranking.setting_cells(y) if y else ["-"] * 4 for y in (x, every.get(x["asked"]))]
        error, step = [c[2] for c in both], [f"{c[0]}, {c[1]}" for c in both]
        run = [c[3] for c in both]
        cells.append([ranking.error_text(x["asked"]), step[0], error[0], run[0]]
                     + [step[1], error[1], run[1]])  # fmt: skip
    head = ["requested error [s]", "cuts: method, step [s]", "error [s]", "run time [ms/s]"]
    head += ["with hits: method, step [s]", "error [s]", "run time [ms/s]"]
    return [
        "The fastest setting of hapticclay that keeps border-crossing times within the requested "
        "error, and its run time per simulated second. *Cuts*: the three cuts into clay of up to "
        "90 N.s/m. *With hits*: in addition every clay and job of the page on "
        "[hits](hits.md). These need shorter steps: where the handle hits stiff clay, its "
        "speed decays within a fraction of a step, and the accurate method is refused or must "
        "divide its steps many times.",
        common.table(ranking.spans(cells), head),
    ]


def every_job(data: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Recommended settings that are good for every cut and hit."""
    rows = data["work_precision"]["rows"] + data["hits"]["rows"]
    return ranking.recommend(rows, {"hapticclay"})


def recommended(data: dict[str, dict[str, Any]]) -> str:
    """The README's table of steps, good for every job."""
    return ranking.table_of_settings(every_job(data))


def csv_text(rows: list[dict[str, Any]]) -> str:
    """Rows as CSV, an empty cell for None."""
    out = io.StringIO()
    columns = list(dict.fromkeys(key for r in rows for key in r))
    writer = csv.DictWriter(out, columns, lineterminator="\n")
    writer.writeheader()
    for r in rows:
        writer.writerow({k: format(x, ".6g") if isinstance(x, float) else x for k, x in r.items()})
    return out.getvalue()


def typeset(text: str) -> str:
    """Units with a centred dot, as figures have them."""
    return re.sub(r"\bN\.(?=s\b|m\b)", "N·", text)


def pages(data: dict[str, dict[str, Any]]) -> dict[str, str]:
    """All pages and CSV files, by name."""
    out = {"bench.md": typeset(conclusions_page(data))}
    for name, found in data.items():
        out[f"{name}.md"] = typeset(part_page(name, found))
        if "csv" in kinds(name):
            out[f"{name}.csv"] = csv_text(PARTS[name].tables(found))
    return out


def figures(data: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The diagrams of error over run time, by file."""
    out = {}
    for name, found in data.items():
        if hasattr(PARTS[name], "figures"):
            out |= PARTS[name].figures(found)
    if "work_precision" in data:
        rows = data["work_precision"]["rows"]
        crossing = {"crossing": work_precision.ERRORS["crossing"]}
        out["bench.png"] = diagrams.draw(rows, rows[0]["problem"], crossing)
    return out


def publish(out: Path, readme: Path | None = None) -> None:
    """Writes pages, CSV files and diagrams from the data in out, and the table in readme."""
    data = load(out)
    for name, text in pages(data).items():
        with files.atomic(out / name) as f:
            f.write(text.encode())
    for name, figure in figures(data).items():
        with files.atomic(out / name) as f:
            figure.savefig(f, format="png", dpi=150)
    if readme:
        head, _, rest = readme.read_text().partition(BEGIN)
        table = f"{BEGIN}\n\n{recommended(data)}\n\n{END}"
        with files.atomic(readme) as f:
            f.write(f"{head}{table}{rest.partition(END)[2]}".encode())


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument(
        "--readme", type=Path, help="a README whose table of recommended settings is to be renewed"
    )
    args = parser.parse_args()
    publish(args.out, args.readme)
