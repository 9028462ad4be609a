"""Who is fastest at a requested error: the tables that follow from rows of error and run time.

A row is a dictionary: problem, package, method, setting, run time per simulated second (wall), and
errors by kind, None where a run failed. A setting is a number, or a text where a method has two.
"""

from __future__ import annotations

import itertools
import statistics
from typing import Any

from tabulate import tabulate

from . import common

ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # errors, in the unit of the kind
# methods that model hardware; their error is the hold's, no matter how well they are computed
SAMPLED = "sampled"


def setting_text(setting: float | str) -> str:
    """A setting as the tables print it."""
    return setting if isinstance(setting, str) else format(setting, "g")


def recommend(
    rows: list[dict], packages: set[str] | None = None, kind: str = "crossing"
) -> list[dict[str, Any]]:
    """For each asked error of a kind, over all jobs:

    the fastest setting that keeps it in every one.
    """
    groups: dict[tuple, list[dict]] = {}
    for r in rows:
        if (packages is None or r["package"] in packages) and not r["method"].startswith(SAMPLED):
            groups.setdefault((r["package"], r["method"], r["setting"]), []).append(r)
    most = {
        package: max(len(g) for key, g in groups.items() if key[0] == package)
        for package, *_ in groups
    }
    out = []
    for asked in ASKED:
        fit = {
            key: (max(r[kind] for r in g), statistics.mean(r["wall"] for r in g))
            for key, g in groups.items()
            if len(g) == most[key[0]] and all(r[kind] is not None and r[kind] <= asked for r in g)
        }
        if fit:
            key = min(fit, key=lambda k: fit[k][1])
            out.append(
                {
                    "asked": asked,
                    "package": key[0],
                    "method": key[1],
                    "setting": key[2],
                    "error": fit[key][0],
                    "wall": fit[key][1],
                }
            )
    return out


def leaders(rows: list[dict], kind: str = "crossing") -> list[dict[str, Any]]:
    """For each asked error of a kind:

    the package that keeps it in the least time, the next one, and how much longer it takes.
    """
    packages = dict.fromkeys(r["package"] for r in rows)
    best = [x for package in packages for x in recommend(rows, {package}, kind)]
    out = []
    for asked in ASKED:
        order = sorted((x for x in best if x["asked"] == asked), key=lambda x: x["wall"])
        if order:
            named = [f"{x['package']}, {x['method']}" for x in order[:2]]
            out.append(
                {
                    "asked": asked,
                    "first": named[0],
                    "package": order[0]["package"],
                    "next": named[1] if len(order) > 1 else "none",
                    "factor": order[1]["wall"] / order[0]["wall"] if len(order) > 1 else None,
                }
            )
    return out


def who_leads(found: list[dict[str, Any]], unit: str = "s") -> str:
    """One line on which package leads in which span of errors."""
    spans = [list(run) for _, run in itertools.groupby(found, lambda x: x["package"])]
    texts = [
        f"{s[0]['package']} at {s[0]['asked']:.0e}"
        + (f" to {s[-1]['asked']:.0e} {unit}" if s[1:] else f" {unit}")
        for s in spans
    ]
    return "Fastest, by requested error: " + "; ".join(texts) + "."


def table_of_leaders(found: list[dict[str, Any]], unit: str = "s") -> str:
    """The leaders, one line for each asked error."""
    cells = [
        [
            format(x["asked"], ".0e"),
            x["first"],
            x["next"],
            "-" if x["factor"] is None else f"{x['factor']:.1f}",
        ]
        for x in found
    ]
    head = [
        f"requested error [{unit}]",
        "fastest",
        "fastest of another package",
        "run time over that of the fastest",
    ]
    return tabulate(cells, head, tablefmt="github", disable_numparse=True)


def table_of_settings(found: list[dict[str, Any]], unit: str = "s") -> str:
    """The recommended settings, one line for each asked error."""
    cells = [
        [
            format(x["asked"], ".0e"),
            x["package"],
            x["method"],
            setting_text(x["setting"]),
            common.number(x["error"]),
            common.number(x["wall"]),
        ]
        for x in found
    ]
    head = [
        f"requested error [{unit}]",
        "package",
        "method",
        "setting",
        f"error [{unit}]",
        "time per simulated s",
    ]
    return tabulate(cells, head, tablefmt="github", disable_numparse=True)


def table_of_rows(rows: list[dict], heads: dict[str, str]) -> str:
    """All rows of a problem.

    Args:
        rows: as above.
        heads: of the columns of errors, by kind.
    """
    cells = [
        [
            r["package"],
            r["method"],
            setting_text(r["setting"]),
            *(common.number(r[k]) for k in heads),
            common.number(r["wall"]),
            r["note"],
        ]
        for r in rows
    ]
    head = ["package", "method", "setting", *heads.values(), "time per simulated s", "note"]
    return tabulate(cells, head, tablefmt="github", disable_numparse=True)


def dominance(rows: list[dict], kind: str = "crossing") -> list[dict]:
    """For each other package:

    how many of its points hapticclay beats in both error and time, with one setting.
    """
    ours = [
        r
        for r in rows
        if r["package"] == "hapticclay"
        and r[kind] is not None
        and not r["method"].startswith(SAMPLED)
    ]
    out = []
    for package in dict.fromkeys(r["package"] for r in rows if r["package"] != "hapticclay"):
        points = [r for r in rows if r["package"] == package]
        failed = sum(r[kind] is None for r in points)
        beaten = sum(
            any(
                o["problem"] == r["problem"] and o[kind] <= r[kind] and o["wall"] <= r["wall"]
                for o in ours
            )
            for r in points
            if r[kind] is not None
        )
        out.append(
            {
                "package": package,
                "points": len(points),
                "failed": failed,
                "behind hapticclay in both": beaten,
            }
        )
    return out
