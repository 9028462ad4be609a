"""Who is fastest at a requested error: the tables that follow from rows of error and run time.

A row is a dictionary: problem, package, method, setting, run time per simulated second (wall), and
errors by kind, None where a run failed. A setting is a number, or a text where a method has two.
"""

from __future__ import annotations

import itertools
import statistics
from typing import Any

from . import common

ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # errors, in the unit of the kind
# methods that model hardware; their error is the hold's, no matter how well they are computed
SAMPLED = "sampled"
RUN_TIME = "run time [ms per simulated s]"


def setting_text(setting: float | str) -> str:
    """A setting as the tables print it."""
    return setting if isinstance(setting, str) else common.plain(format(setting, "g"))


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
    """One sentence on which package is fastest in which span of errors, and by what factor."""
    parts = []
    for _, run in itertools.groupby(found, lambda x: x["package"]):
        span = list(run)
        asked = list(dict.fromkeys(error_text(x["asked"]) for x in (span[0], span[-1])))
        part = f"{span[0]['package']} at {' to '.join(asked)} {unit}"
        factors = [x["factor"] for x in span if x["factor"]]
        if factors:
            bounds = list(dict.fromkeys(f"{f(factors):.1f}" for f in (min, max)))
            part += f" (the next package takes {' to '.join(bounds)} times as long)"
        parts.append(part)
    return "Fastest, by requested error: " + "; ".join(parts) + "."


def error_text(x: float) -> str:
    """A requested error, a power of ten."""
    return common.plain(format(x, ".0e"))


def table_of_leaders(found: list[dict[str, Any]], unit: str = "s") -> str:
    """The leaders, one line for each asked error."""
    cells = [
        [
            error_text(x["asked"]),
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
        "its run time over that of the fastest",
    ]
    return common.table(cells, head)


def setting_cells(x: dict[str, Any]) -> list[str]:
    """Method, setting, error and run time of a recommended setting."""
    method = x["method"].partition(", ")[0] if x["package"] == "hapticclay" else x["method"]
    times = common.number(x["error"]), common.milliseconds(x["wall"])
    return [method, setting_text(x["setting"]), *times]


def table_of_settings(found: list[dict[str, Any]], unit: str = "s") -> str:
    """The recommended settings: a line for each, with the errors for which it is the fastest."""
    cells = spans([[error_text(x["asked"]), *setting_cells(x)] for x in found])
    head = [f"requested error [{unit}]", "method", "step [s]", f"error [{unit}]", RUN_TIME]
    return common.table(cells, head)


def spans(cells: list[list[str]]) -> list[list[str]]:
    """Rows of a table, those that differ in their first cell alone made one."""
    groups = [list(group) for _, group in itertools.groupby(cells, lambda x: x[1:])]
    return [
        [" to ".join(dict.fromkeys((group[0][0], group[-1][0]))), *group[0][1:]] for group in groups
    ]


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
