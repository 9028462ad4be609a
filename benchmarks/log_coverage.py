"""Share of 95 % intervals that hold the truth, for logs whose rows are not even.

    python -m benchmarks.log_coverage [--seeds 300] [--out DIR]

A device of mass, damper and spring is pushed by a multisine of many lines; force and position at
any time follow in closed form. Rows are taken and stamped as logs do it; the position gets white
noise. With a folder, writes logs.md and logs.json. 300 seeds take some ten minutes of processor
time.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from tabulate import tabulate
from tqdm import tqdm

import hapticclay as hc

from . import common

RATE, DURATION = 400.0, 20.0  # rows a second, and seconds
BAND = (0.3, 15.0)  # [Hz]
NOISE = 0.1  # of the position, as a share of its rms
LINES = 400
PERIOD = 27.0  # [s] of the lines: longer than a log, which has no period of its own
NAMES = ("mass", "damper", "spring")
Rows = tuple[np.ndarray, np.ndarray]  # times at which rows are taken, and their stamps


def _even(rng: np.random.Generator) -> Rows:
    t = np.arange(round(RATE * DURATION)) / RATE
    return t, t


def _jitter(share: float) -> Callable[[np.random.Generator], Rows]:
    def rows(rng: np.random.Generator) -> Rows:
        t = _even(rng)[0]
        t = t + rng.uniform(-share, share, len(t)) / RATE
        return t, t

    return rows


def _late(rng: np.random.Generator) -> Rows:
    t = _even(rng)[0]
    return t, np.maximum.accumulate(t + rng.exponential(0.4 / RATE, len(t))) + 1e-9 * t


def _rounded(rng: np.random.Generator) -> Rows:
    t = _even(rng)[0]
    return t, np.floor(t / 0.005 + 1e-9) * 0.005


def _missing(rng: np.random.Generator) -> Rows:
    t = _even(rng)[0]
    return (t[rng.random(len(t)) > 0.02],) * 2


def _drawn(rng: np.random.Generator) -> Rows:
    """A poor clock: steps of 60 to 140 %, and a hundredth of the rows missing."""
    t = np.cumsum(rng.uniform(0.6, 1.4, round(RATE * DURATION))) / RATE
    return (t[rng.random(len(t)) > 0.01],) * 2


LOGS: dict[str, Callable[[np.random.Generator], Rows]] = {
    "even": _even,
    "jitter of 10 %": _jitter(0.1),
    "jitter of 30 %": _jitter(0.3),
    "jitter of 45 %": _jitter(0.45),
    "steps of 60 to 140 %, 1 % missing": _drawn,
    "2 % of the rows missing": _missing,
    "even, stamped up to steps later": _late,
    "even, stamps rounded to 5 ms": _rounded,
}


def one(seed: int, log: str) -> dict[str, Any]:
    """One trial: each number of the device, and its interval."""
    rng = np.random.default_rng((seed, list(LOGS).index(log)))
    mass = 10.0 ** rng.uniform(-1.0, 0.5)
    omega = 2.0 * math.pi * rng.uniform(3.0, 7.0)
    truth = mass, 2.0 * rng.uniform(0.5, 1.0) * omega * mass, mass * omega**2
    times, stamps = LOGS[log](rng)
    k = rng.choice(np.arange(1, round(20.0 * PERIOD)), LINES, replace=False)
    s = 2j * math.pi * k / PERIOD
    push = np.exp(1j * rng.uniform(0.0, 2.0 * math.pi, LINES))
    moved = push / (truth[0] * s**2 + truth[1] * s + truth[2])
    lines = np.zeros((round(20.0 * PERIOD), 2), complex)  # of the powers of one turn a period
    lines[k] = np.column_stack((push, moved))
    force, place = polyval(np.exp(2j * math.pi / PERIOD * times), lines).real
    place = place + NOISE * np.std(place) * rng.standard_normal(len(place))
    data = hc.studies.Measurement.resampled(stamps, force, place)
    found = hc.studies.identify_data(data, "S", band=BAND)
    gains = 1.0 / truth[0], truth[1] / truth[0], truth[2] / truth[0]
    pairs = zip(NAMES, found.coefficients, gains, strict=True)
    rows = {name: (c.low <= x <= c.high, 0.5 * (c.high - c.low) / x, c.value / x - 1.0)
            for name, c, x in pairs}  # fmt: skip
    return {"log": log, "seed": seed, "notes": len(data.notes), "coefficients": rows}


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Share covered, median half interval and mean error, of each log and coefficient."""
    out = []
    for log in dict.fromkeys(r["log"] for r in rows):
        mine = [r["coefficients"] for r in rows if r["log"] == log]
        for name in NAMES:
            covered, half, error = zip(*(r[name] for r in mine), strict=True)
            out.append(
                {
                    "log": log,
                    "of": name,
                    "trials": len(mine),
                    "covered": statistics.mean(map(float, covered)),
                    "half": statistics.median(half),
                    "bias": statistics.mean(error),
                }
            )
    return out


def page(found: list[dict[str, Any]]) -> str:
    """The Markdown page."""
    n = found[0]["trials"]
    names = {"mass": "1/mass", "damper": "damper/mass", "spring": "spring/mass"}
    rows = [
        [
            x["log"] if x["of"] == NAMES[0] else "",
            names[x["of"]],
            f"{x['covered']:.3f}",
            f"{x['half']:.1e}",
            f"{x['bias']:+.1e}",
        ]
        for x in found
    ]
    every = statistics.mean(x["covered"] for x in found)
    about = (
        f"Share of {n} trials in which the 95 % interval of `identify` contains the true value; "
        "half the median interval and the mean error as shares of it. "
        f"{DURATION:g} s at {RATE:g} Hz, a random device, {LINES} lines to 20 Hz, noise of "
        f"{100 * NOISE:g} % of the position. By chance alone, two thirds of the shares are within "
        f"{math.sqrt(0.95 * 0.05 / n):.3f} of 0.95; their mean is {every:.3f}. Made by "
        "`benchmarks/log_coverage.py`."
    )
    table = tabulate(
        rows, ["rows", "", "covered", "half", "bias"], tablefmt="github", disable_numparse=True
    )
    machine = "\n".join(f"- {x}" for x in common.foot())
    head = "# Intervals from logs whose rows are not even"
    return "\n\n".join([head, about, table, "## Machine", machine]) + "\n"


def main(seeds: int = 300, out: Path | None = None) -> list[dict[str, Any]]:
    """Measures, prints and, with a folder, writes both files."""
    rows = [one(seed, log) for seed in tqdm(range(seeds), disable=None) for log in LOGS]
    found = summary(rows)
    common.publish(out, "logs", found, page(found))
    return found


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--seeds", type=int, default=300)
    parser.set_defaults(out=None)
    args = parser.parse_args()
    main(args.seeds, args.out)
