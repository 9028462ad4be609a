"""Error against run time: hapticclay and its peers on the same jobs, in one process, taking turns.

    python -m benchmarks.work_precision [--quick] [--out DIR]

Writes work_precision.json and one PNG a job; benchmarks.bench makes the page.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
import statistics
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate
from tqdm import tqdm

import hapticclay as hc
from hapticclay import files

from . import common
from . import reference as hybrid
from .problems import EDGES, PROBLEMS, Result, reference

PEERS = (
    "ours",
    "mujoco_plain",
    "scipy_ivp",
    "python_control",
    "pybullet_peer",
    "drake_peer",
    "pinocchio_peer",
)
ERRORS = {
    "crossing": "largest error of the three crossing times [s]",
    "position": "largest error of the handle position [m]",
    "force": "root mean square error of the clay force along x [N]",
    "b": "error of b fitted to the cut's speed [N.s/m]",
}
ASKED = (
    1e-2,
    1e-3,
    1e-4,
    1e-5,
    1e-6,
    1e-7,
    1e-8,
)  # errors in crossing time [s] of the `recommend` table
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222")
MARKERS = "osD^v<>P"
# methods that model hardware; their error is the hold's, no matter how well they are computed
SAMPLED = "sampled"
HYBRID_END = 0.9  # [s] end of the runs against the hybrid system, beyond the first border


def errors(problem: str, r: Result) -> dict[str, float | None]:
    """The four errors of a result; None where it does not reach so far."""
    exact = reference(problem)
    out: dict[str, float | None] = dict.fromkeys(ERRORS)
    if r.note or len(r.crossings) < len(EDGES):
        return out
    out["crossing"] = float(np.max(np.abs(np.array(r.crossings) - exact.crossings)))
    mine = np.flatnonzero(r.t < min(exact.crossings[-1], r.crossings[-1]))
    mine = mine[:: max(1, len(mine) // 4000)]
    p, v = exact(r.t[mine])
    out["position"] = float(np.max(np.linalg.norm(r.p[mine] - p, axis=1)))
    s = PROBLEMS[problem]
    assert s.clay is not None
    b = np.array(s.clay.x.values)[np.searchsorted(exact.crossings[:2], r.t[mine], side="right")]
    clear = (
        np.min(np.abs(r.t[mine, None] - exact.crossings), axis=1) > 1e-5
    )  # on a border, b has two values
    out["force"] = float(np.sqrt(np.mean((r.fe[mine] - b * v[:, 0])[clear] ** 2)))
    i = np.flatnonzero((r.p[:, 0] >= 0.10) & (r.p[:, 0] <= 0.14))
    if (
        s.operator is None and len(i) > 1
    ):  # f = (10/K + b) v, from the time between 10 and 14 cm, ours and exact
        i = i[[0, -1]]
        span, ways = r.t[i[1]] - r.t[i[0]], (r.p[i, 0], exact(r.t[i])[0][:, 0])
        mine_b, exact_b = (s.force[0] * span / (x[1] - x[0]) - 10.0 / s.gain[0] for x in ways)
        out["b"] = float(abs(mine_b - exact_b))
    return out


def measure(
    quick: bool, problems: list[str], peers: tuple[str, ...] = PEERS, rounds: int = 5
) -> tuple[list[dict], list[str]]:
    """All rows, and what was left out.

    Every setting is run once a round; times are medians over rounds.
    """
    modules, omissions = [], []
    for name in peers:
        try:
            modules.append(importlib.import_module(f".peers.{name}", __package__))
        except ImportError as error:
            omissions.append(f"{name}: {error}")
    jobs = []
    for problem in problems:
        for m in modules:
            for method, settings in m.methods().items():
                jobs += [(problem, m, method, x) for x in (settings[: 3 if quick else None])]
    first: list[Result] = []
    walls: list[list[float]] = [[] for _ in jobs]
    with tqdm(total=rounds * len(jobs), delay=2.0, disable=None, leave=False) as bar:
        for n in range(rounds):
            for i, (problem, m, method, setting) in enumerate(jobs):
                bar.set_description(f"{m.NAME} {method}")
                if n == 0 or statistics.median(walls[i]) < 5.0:
                    r = m.solve(problem, method, setting)
                    walls[i].append(r.wall)
                    if n == 0:
                        first.append(r)
                bar.update()
    rows = []
    for (problem, m, method, setting), r, wall in zip(jobs, first, walls, strict=True):
        simulated = (
            r.crossings[-1]
            if len(r.crossings) == len(EDGES)
            else (float(r.t[-1]) if len(r.t) else 0.0)
        )
        rows.append(
            {
                "problem": problem,
                "package": m.NAME,
                "method": method,
                "setting": setting,
                **errors(problem, r),
                "wall": statistics.median(wall) / simulated if simulated else None,
                "note": r.note,
            }
        )
    return rows, omissions


def recommend(rows: list[dict], packages: set[str] | None = None) -> list[dict[str, Any]]:
    """For each asked error in crossing time, over all jobs:

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
            key: (max(r["crossing"] for r in g), statistics.mean(r["wall"] for r in g))
            for key, g in groups.items()
            if len(g) == most[key[0]]
            and all(r["crossing"] is not None and r["crossing"] <= asked for r in g)
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


def leaders(rows: list[dict]) -> list[dict[str, Any]]:
    """For each asked error:

    the package that keeps it in the least time, the next one, and how much longer it takes.
    """
    packages = dict.fromkeys(r["package"] for r in rows)
    best = [x for package in packages for x in recommend(rows, {package})]
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


def who_leads(found: list[dict[str, Any]]) -> str:
    """One line on which package leads in which span of errors."""
    spans: list[list[dict[str, Any]]] = []
    for x in found:
        if spans and spans[-1][0]["package"] == x["package"]:
            spans[-1].append(x)
        else:
            spans.append([x])
    told = [
        f"{s[0]['package']} at {s[0]['asked']:.0e}"
        + (f" to {s[-1]['asked']:.0e} s" if s[1:] else " s")
        for s in spans
    ]
    return "Fastest, by requested error: " + "; ".join(told) + "."


def table_of_leaders(found: list[dict[str, Any]]) -> str:
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
        "requested error [s]",
        "fastest",
        "fastest of another package",
        "run time over that of the fastest",
    ]
    return tabulate(cells, head, tablefmt="github", disable_numparse=True)


def dominance(rows: list[dict]) -> list[dict[str, Any]]:
    """For each other package:

    how many of its points hapticclay beats in both error and time, with one setting.
    """
    ours = [
        r
        for r in rows
        if r["package"] == "hapticclay"
        and r["crossing"] is not None
        and not r["method"].startswith(SAMPLED)
    ]
    out = []
    for package in dict.fromkeys(r["package"] for r in rows if r["package"] != "hapticclay"):
        points = [r for r in rows if r["package"] == package]
        failed = sum(r["crossing"] is None for r in points)
        beaten = sum(
            any(
                o["problem"] == r["problem"]
                and o["crossing"] <= r["crossing"]
                and o["wall"] <= r["wall"]
                for o in ours
            )
            for r in points
            if r["crossing"] is not None
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


def draw(rows: list[dict], problem: str):
    """The four work-precision diagrams of a job."""
    import matplotlib
    from matplotlib.figure import Figure

    from hapticclay.views.style import STYLE

    mine = [r for r in rows if r["problem"] == problem]
    kinds = [k for k in ERRORS if any(r[k] is not None for r in mine)]
    packages = list(dict.fromkeys(r["package"] for r in rows))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.9 * math.ceil(len(kinds) / 2)))
        axes = figure.subplots(math.ceil(len(kinds) / 2), 2, squeeze=False).ravel()
        for ax, kind in zip(axes, kinds, strict=False):
            for package, method in dict.fromkeys((r["package"], r["method"]) for r in mine):
                methods = list(dict.fromkeys(r["method"] for r in mine if r["package"] == package))
                points = [
                    r for r in mine if (r["package"], r["method"]) == (package, method) and r[kind]
                ]
                if not points:
                    continue
                label = package if len(methods) == 1 else f"{package}, {method}"
                ax.plot(
                    [r["wall"] for r in points],
                    [r[kind] for r in points],
                    color=COLORS[packages.index(package) % len(COLORS)],
                    marker=MARKERS[methods.index(method) % 8],
                    ls=("-", "--", ":", "-.")[methods.index(method) % 4],
                    ms=4,
                    label=label,
                    lw=2.6 if package == "hapticclay" else 1.1,
                    zorder=5 if package == "hapticclay" else 2,
                )
            ax.set(xscale="log", yscale="log", xlabel="run time per simulated second [s]")
            ax.set_ylabel(ERRORS[kind].replace(" [", "\n["), fontsize=9)
        for ax in axes[len(kinds) :]:
            ax.remove()
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside lower center", ncols=4, fontsize=8, handlelength=4.0
        )
        figure.suptitle(f"{problem}: down and left is better", fontsize=11)
    return figure


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    rows = data["rows"]
    parts = [
        "## Error against run time",
        "Every package steps the same closed loop: the nonlinear arm, servo, compensator and clay "
        "on both axes, to the "
        "end of the path. Errors are those against the arm in joint space, solved by DOP853 "
        "at 1e-12 with borders as events. "
        "The setting is a step [s], or a relative tolerance for adaptive methods.",
        "### Recommended settings",
        "The fastest setting whose border-crossing times stay within the requested error on each "
        "of the three cuts.",
        table_of_settings(recommend(rows)),
        "With a MuJoCo model in the loop:",
        table_of_settings(recommend(rows, {"hapticclay", "MuJoCo, plain"})),
        "### Fastest package",
        who_leads(leaders(rows)),
        table_of_leaders(leaders(rows)),
        "Settings of each package for which one setting of hapticclay (continuous time) is at "
        "least as good in both error and run time.",
        tabulate(dominance(rows), headers="keys", tablefmt="github"),
        "### Sampled control",
        "hapticclay's rows `sampled` belong to another system, that of the hardware: measured "
        "and held every Ts, here Ts = dt. In the diagrams they show the delay of the hold, half "
        "a sample, and borders noticed up to a sample late, both first-order in Ts. This is a "
        "property of the hardware, not a numerical error. The numerical error is that against "
        "the hybrid system, exact between samples (default cut, largest position error up to "
        f"{HYBRID_END:g} s):",
        table_of_hybrid(data["hybrid"]),
    ]
    for problem in dict.fromkeys(r["problem"] for r in rows):
        mine = [r for r in rows if r["problem"] == problem]
        name = problem.replace(" ", "_")
        cells = [
            [
                r["package"],
                r["method"],
                format(r["setting"], "g"),
                *(common.number(r[k]) for k in ERRORS),
                common.number(r["wall"]),
                r["note"],
            ]
            for r in mine
        ]
        head = [
            "package",
            "method",
            "setting",
            "crossing [s]",
            "position [m]",
            "force [N]",
            "b [N.s/m]",
            "time per simulated s",
            "note",
        ]
        parts += [f"### {problem.capitalize()}", f"![work-precision diagrams]({name}.png)"]
        parts.append(tabulate(cells, head, tablefmt="github", disable_numparse=True))
    return parts


def against_hybrid(quick: bool) -> list[dict[str, Any]]:
    """Position errors of sampled runs against the hybrid and the continuous system."""
    out = []
    exact = reference("default cut")
    for render in ("held", "physical"):
        for Ts in (4e-3, 1e-3) if quick else (4e-3, 2e-3, 1e-3, 3.6e-4):
            s = dataclasses.replace(
                PROBLEMS["default cut"],
                control="sampled",
                render=render,
                dt=Ts,
                t_max=HYBRID_END,
                length=None,
            )
            r = hc.simulate(s)
            x = hybrid.solve(s, r.t)
            n = min(len(x.p), len(r.p))
            gap = {
                "hybrid": r.p[:n] - x.p[:n],
                "continuous": r.p[:n] - exact(r.t[:n])[0],
            }
            largest = {k: float(np.max(np.linalg.norm(v, axis=1))) for k, v in gap.items()}
            out.append({"render": render, "Ts": Ts, **largest})
    return out


def table_of_hybrid(rows: list[dict[str, Any]]) -> str:
    cells = [
        [
            x["render"],
            format(x["Ts"], "g"),
            common.number(x["hybrid"]),
            common.number(x["continuous"]),
        ]
        for x in rows
    ]
    head = ["render", "Ts [s]", "against the hybrid system [m]", "against continuous time [m]"]
    return tabulate(cells, head, tablefmt="github", disable_numparse=True)


def table_of_settings(found: list[dict[str, Any]]) -> str:
    cells = [
        [
            format(x["asked"], ".0e"),
            x["package"],
            x["method"],
            format(x["setting"], "g"),
            common.number(x["error"]),
            common.number(x["wall"]),
        ]
        for x in found
    ]
    head = [
        "requested error [s]",
        "package",
        "method",
        "setting",
        "error [s]",
        "time per simulated s",
    ]
    return tabulate(cells, head, tablefmt="github", disable_numparse=True)


def main(out: Path = Path("out/bench"), quick: bool = False) -> dict[str, Any]:
    """Measures, writes the data and the diagrams; returns the data."""
    problems = list(PROBLEMS)[: 1 if quick else None]
    rows, omissions = measure(quick, problems, rounds=2 if quick else 5)
    for problem in problems:
        with files.atomic(out / f"{problem.replace(' ', '_')}.png") as f:
            draw(rows, problem).savefig(f, format="png")
    found = {"omissions": omissions, "rows": rows, "hybrid": against_hybrid(quick)}
    return common.write(out, "work_precision", found)


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="one job, three settings a method")
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, args.quick))))
