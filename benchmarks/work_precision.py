"""Error against run time: hapticclay and its peers on the same jobs, in one process, taking turns.

    python -m benchmarks.work_precision [--quick] [--out DIR]

Writes work_precision.json; benchmarks.pages makes the page and the diagrams.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc

from . import common, diagrams
from . import reference as hybrid
from .problems import EDGES, PROBLEMS, Result, reference
from .ranking import dominance, leaders, table_of_leaders, who_leads
from .study import figure_name
from .turns import take_turns

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
    runs = [
        (f"{m.NAME} {method}", functools.partial(m.solve, problem, method, x))
        for problem, m, method, x in jobs
    ]
    first, walls = take_turns(runs, rounds)
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
                "wall": wall / simulated if simulated else None,
                "note": r.note,
            }
        )
    return rows, omissions


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    rows = data["rows"]
    found = leaders(rows)
    text = [
        "Every package steps the same closed loop: the nonlinear arm, servo, compensator and clay "
        "on both axes, to the end of the path. Errors are those against the arm in joint space, "
        "solved by DOP853 at 1e-12 with borders as events. The setting is a step [s], or a "
        "relative tolerance for adaptive methods.",
        "## Fastest package",
        who_leads(found),
        table_of_leaders(found),
        "How many settings of each package are no better than one setting of hapticclay in "
        "continuous time, in error and in run time:",
        common.table(dominance(rows)),
        "## Sampled control",
        "hapticclay's rows `sampled` belong to another system, that of the hardware: measured "
        "and held every Ts, here Ts = dt. Beside the others they show the delay of the hold, half "
        "a sample, and borders noticed up to a sample late, both first-order in Ts. This is a "
        "property of the hardware, not a numerical error; so the diagrams leave them out. The "
        "numerical error is that against the hybrid system, exact between samples (default cut, "
        f"largest position error up to {HYBRID_END:g} s):",
        table_of_hybrid(data["hybrid"]),
        "## Diagrams",
        "A line is the best of all settings and methods of a package. Shown are the six packages "
        "that keep border-crossing times within 1e-3 s in the least time.",
    ]
    for problem in dict.fromkeys(r["problem"] for r in rows):
        text.append(f"![{problem}: error over run time]({figure_name(problem)})")
    return text


def conclusions(data: dict[str, Any]) -> list[str]:
    """Who is fastest in the cuts."""
    return [f"Cuts, error of the border-crossing times. {who_leads(leaders(data['rows']))}"]


def figures(data: dict[str, Any]) -> dict[str, Any]:
    """The diagrams of each job, by file."""
    jobs = dict.fromkeys(r["problem"] for r in data["rows"])
    return {figure_name(x): diagrams.draw(data["rows"], x, ERRORS) for x in jobs}


def tables(data: dict[str, Any]) -> list[dict[str, Any]]:
    """All measured rows, for the CSV file."""
    return data["rows"]


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
    """Errors of sampled runs."""
    cells = [
        [x["render"], format(x["Ts"], "g"), *map(common.number, (x["hybrid"], x["continuous"]))]
        for x in rows
    ]
    head = ["render", "Ts [s]", "against the hybrid system [m]", "against continuous time [m]"]
    return common.table(cells, head)


def main(out: Path = Path("out/bench"), quick: bool = False) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    problems = list(PROBLEMS)[: 1 if quick else None]
    rows, omissions = measure(quick, problems, rounds=2 if quick else 5)
    found = {"omissions": omissions, "rows": rows, "hybrid": against_hybrid(quick)}
    return common.write(out, "work_precision", found)


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="one job, three settings a method")
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, args.quick))))
