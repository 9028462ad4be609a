"""Probability of instability: Monte Carlo of runs beside quadrature of the exact linear verdict.

    python -m benchmarks.robustness [--out DIR] [--seeds 20] [--runs 2000] [--timed 100000]

Each case is made with several seeds; the quadrature should lie within the 95 % interval of at least
19 of 20. Writes robustness.md and robustness.json, whose every figure comes from the runs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate

import hapticclay as hc
from hapticclay import files
from hapticclay.studies import boundary
from hapticclay.studies.boundary import PushedLoop

from . import common

SEEDS, RUNS = 20, 2000
HAND = hc.Operator(0.4, 5.0, 80.0)
GAIN = hc.studies.Distribution("log-normal", 4.0, 1.0)
DAMPER = hc.studies.Distribution("log-normal", 5.0, 2.5)
DELAY = hc.studies.Distribution("uniform", 0.0, 1e-3)
POSE = hc.studies.Distribution("normal", 0.0, 0.03)


def cases() -> dict[str, tuple[hc.studies.Trials, list[str], int]]:
    """Trials of each case; the parameters that quadrature nodes are laid over; how many of each."""
    continuous = PushedLoop("x", b=90.0, operator=HAND)
    sampled = PushedLoop("x", b=90.0, operator=HAND, Ts=0.5e-3)
    turned = PushedLoop("x", b=90.0, operator=HAND, inertia_shaping=False)
    hand = ["operator.mass", "operator.damper", "operator.spring"]
    return {
        "hand and gain, continuous": (
            hc.studies.Trials(continuous, {"K": GAIN}, hands=hc.studies.Hands.around(HAND, 0.5)),
            hand, 10),
        "damper, delay and gain, sampled": (
            hc.studies.Trials(sampled, {"operator.damper": DAMPER, "delay": DELAY, "K": GAIN}),
            ["operator.damper", "delay"], 10),
        "damper, pose and gain, without shaping": (
            hc.studies.Trials(turned, {"operator.damper": DAMPER, "pose.x": POSE, "K": GAIN}),
            ["operator.damper", "pose.x"], 16),
    }  # fmt: skip


def quadrature(
    trials: hc.studies.Trials, names: list[str], nodes: int, limit: Callable[[Any], float]
) -> float:
    """Probability that K lies above the exact limit: the mean over the other numbers.

    K is log-normal, so its share above each limit is known, and the mean over the others is smooth:
    Gauss-Hermite nodes over normal and log-normal numbers, Gauss-Legendre over uniform ones.
    """
    laws = dict(trials.vary)
    if trials.hands:
        hands = trials.hands
        laws |= {f"operator.{n}": getattr(hands, n) for n in ("mass", "damper", "spring")}
    points, weights = [], []
    for name in names:
        if laws[name].law == "uniform":
            x, w = np.polynomial.legendre.leggauss(nodes)
            points.append(laws[name].spread(0.5 * (x + 1.0)))
            weights.append(0.5 * w)
        else:
            x, w = np.polynomial.hermite_e.hermegauss(nodes)
            points.append(laws[name].of_score(x))
            weights.append(w / math.sqrt(2.0 * math.pi))
    total = 0.0
    for index in np.ndindex(*(nodes,) * len(names)):
        values = {n: float(p[i]) for n, p, i in zip(names, points, index, strict=True)}
        weight = math.prod(w[i] for w, i in zip(weights, index, strict=True))
        total += weight * (1.0 - float(laws["K"].share_below(limit(trials.loop(values)))))
    return total


def exact_limit(loop: Any) -> float:
    """Largest stable K of the loop of a run, at its pose."""
    if loop.pose != (0.0, 0.0):
        return boundary.pose_limit(loop)
    return boundary.nominal_limit(loop)


def measure(seeds: int, runs: int) -> list[dict[str, Any]]:
    """A row of each case."""
    rows = []
    for name, (trials, names, nodes) in cases().items():
        exact = quadrature(trials, names, nodes, exact_limit)
        coarse = quadrature(trials, names, nodes - 3, exact_limit)
        found = [
            hc.studies.monte_carlo(replace(trials, runs=runs, seed=seed)) for seed in range(seeds)
        ]
        totals = [x.total for x in found]
        events, every = sum(t.events for t in totals), sum(t.runs for t in totals)
        rows.append({
            "case": name,
            "quadrature": float(exact),
            "change with fewer nodes": float(coarse - exact),
            "seeds": seeds,
            "runs a seed": runs,
            "inside": int(sum(t.low <= exact <= t.high for t in totals)),
            "all seeds": events / every,
            "off by standard errors": float(events / every - exact)
            / math.sqrt(exact * (1.0 - exact) / every),
            "repeated": float(np.mean([x.longer.mean() for x in found])),
        })  # fmt: skip
        print(rows[-1], flush=True)
    return rows


def timed(runs: int) -> dict[str, Any]:
    """Time of many runs of the first case."""
    trials = replace(next(iter(cases().values()))[0], runs=runs)
    hc.studies.monte_carlo(replace(trials, runs=20))  # imports
    wall, spent = time.perf_counter(), time.process_time()
    found = hc.studies.monte_carlo(trials)
    wall, spent = time.perf_counter() - wall, time.process_time() - spent
    return {"runs": runs, "wall [s]": wall, "processor [s]": spent, "total": str(found.total)}


def report(rows: list[dict[str, Any]], speed: dict[str, Any]) -> str:
    """The page, in Markdown."""
    head = ["case", "quadrature", "seeds inside", "all seeds", "standard errors off", "repeated"]
    body = [
        [r["case"], f"{100 * r['quadrature']:.3f} %", f"{r['inside']} of {r['seeds']}",
         f"{100 * r['all seeds']:.3f} %", f"{r['off by standard errors']:+.2f}",
         f"{100 * r['repeated']:.1f} %"]
        for r in rows
    ]  # fmt: skip
    each = 1e3 * speed["processor [s]"] / speed["runs"]
    return (
        f"# Probability of instability\n\n{rows[0]['runs a seed']} runs a seed.\n\n"
        + tabulate(body, head, "github")
        + f"\n\n{speed['runs']} runs of the first case: {speed['wall [s]']:.0f} s, "
        f"{each:.2f} ms of one processor each.\n\n## Machine\n\n"
        + "\n".join(f"- {x}" for x in common.foot())
        + "\n"
    )


def main(out: Path | None, seeds: int, runs: int, most: int) -> None:
    """Measures, prints and, with a folder, writes both files."""
    rows, speed = measure(seeds, runs), timed(most)
    page = report(rows, speed)
    print(page)
    if out:
        common.write(out, "robustness", {"rows": rows, "timed": speed})
        with files.atomic(out / "robustness.md") as f:
            f.write(page.encode())


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.set_defaults(out=None)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--timed", type=int, default=100_000)
    asked = parser.parse_args()
    main(asked.out, asked.seeds, asked.runs, asked.timed)
