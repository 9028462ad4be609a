"""Share of trials in which `fit` picks the right law, and in which its intervals hold the truth.

    python -m benchmarks.fit_coverage [--seeds 200] [--processes 2] [--out DIR]

Each trial has a motion of its own: four sines of random frequency, amplitude and phase over a time
that stands still twice. Force and position follow in closed form, get white noise, and are rounded.
With a folder, writes fit.md and fit.json. 200 seeds take some twenty minutes of processor time.
"""

from __future__ import annotations

import functools
import math
import multiprocessing
import statistics
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tabulate import tabulate
from tqdm import tqdm

import hapticclay as hc

from . import common

TRUTHS = {
    "viscous": {"b": 60.0},
    "Coulomb": {"Fy": 5.0},
    "Bingham": {"Fy": 4.0, "b": 40.0},
    "power law": {"K": 12.0, "n": 0.4},
    "Herschel-Bulkley": {"Fy": 3.0, "K": 15.0, "n": 0.5},
}
RATE, DURATION = 500.0, 12.0  # samples a second, and seconds
REACH = 0.06  # farthest from the middle [m]
REST, RAMP = 0.6, 0.03  # half of a rest, and how fast it begins and ends [s]


class Sensors(NamedTuple):
    """Noise and rounding of a force and of a position, [N] and [m]."""

    force_noise: float
    force_count: float
    position_noise: float
    position_count: float


SENSORS = {
    "fine": Sensors(0.1, 0.05, 20e-6, 20e-6),
    "coarse": Sensors(0.5, 0.2, 100e-6, 100e-6),
    "counts": Sensors(0.03, 0.1, 5e-6, 100e-6),
}


def motion(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], position [m] and velocity [m/s]; 0 in two rests."""
    t = np.arange(0.0, DURATION, 1.0 / RATE)
    clock, rate = t.copy(), np.ones(len(t))
    for third in (0.2, 0.6):  # clock' falls to 0 and rises again, both in closed form
        middle = DURATION * rng.uniform(third, third + 0.2)
        for side in (1.0, -1.0):
            at = (t - middle + side * REST) / RAMP
            clock -= side * RAMP * np.logaddexp(0.0, at)
            rate -= side * 0.5 * (1.0 + np.tanh(0.5 * at))
    w, phase = 2.0 * math.pi * rng.uniform(0.2, 1.2, 4), rng.uniform(0.0, 2.0 * math.pi, 4)
    size = rng.uniform(0.3, 1.0, 4) / w
    angle = w * clock[:, None] + phase
    p, v = np.sin(angle) @ size, (np.cos(angle) @ (size * w)) * rate
    scale = REACH / np.max(np.abs(p))
    return t, scale * p, np.where(rate > 1e-6, scale * v, 0.0)


def measured(law: str, seed: int, sensors: Sensors) -> hc.studies.Measurement:
    """What the sensors tell of a motion through clay of a law."""
    rng = np.random.default_rng((seed, 16))
    t, p, v = motion(rng)
    a = {"Fy": 0.0, "K": 0.0, "n": 1.0, "b": 0.0} | TRUTHS[law]
    f = np.sign(v) * (a["Fy"] + a["K"] * np.abs(v) ** a["n"]) + a["b"] * v
    f = np.where(v == 0.0, a["Fy"] * np.sin(7.0 * t), f)  # at rest, any force up to Fy
    f = _rounded(f + sensors.force_noise * rng.standard_normal(len(t)), sensors.force_count)
    p = _rounded(p + sensors.position_noise * rng.standard_normal(len(t)), sensors.position_count)
    return hc.studies.Measurement(t, f, p, name=f"{law}, seed {seed}")


def _rounded(x: np.ndarray, count: float) -> np.ndarray:
    return count * np.round(x / count) if count else x


def one(seed: int, law: str, sensors: str) -> dict[str, Any]:
    """One trial: which law is picked, and each parameter of the true one with its interval."""
    data = measured(law, seed, SENSORS[sensors])
    fitted = hc.studies.fit_flow(data)
    right = fitted if fitted.law == law else hc.studies.fit_flow(data, laws=(law,))
    return {
        "law": law,
        "sensors": sensors,
        "seed": seed,
        "picked": fitted.law,
        "warnings": list(fitted.warnings),
        "parameters": {p.name: [p.value, p.low, p.high] for p in right.parameters},
    }


def trials(seed: int) -> list[dict[str, Any]]:
    """Those of one seed."""
    return [one(seed, law, sensors) for sensors in SENSORS for law in TRUTHS]


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Shares of trials, of each law and sensors; of each parameter, error and half interval."""
    out = []
    for sensors in SENSORS:
        for law, truth in TRUTHS.items():
            mine = [r for r in rows if (r["law"], r["sensors"]) == (law, sensors)]
            found: dict[str, Any] = {
                "law": law,
                "sensors": sensors,
                "trials": len(mine),
                "picked": sum(r["picked"] == law for r in mine) / len(mine),
                "parameters": {},
            }
            for name, x in truth.items():
                of = [r["parameters"][name] for r in mine]
                found["parameters"][name] = {
                    "covered": sum(low <= x <= high for _, low, high in of) / len(of),
                    "half": statistics.median(0.5 * (high - low) for _, low, high in of) / x,
                    "bias": statistics.mean(value for value, _, _ in of) / x - 1.0,
                }
            out.append(found)
    return out


def page(found: list[dict[str, Any]]) -> str:
    """The Markdown page."""
    n = found[0]["trials"]
    rows = [
        [
            x["sensors"],
            x["law"],
            f"{x['picked']:.3f}",
            name,
            f"{TRUTHS[x['law']][name]:g}",
            f"{p['covered']:.3f}",
            f"{p['half']:.1e}",
            f"{p['bias']:+.1e}",
        ]
        for x in found
        for name, p in x["parameters"].items()
    ]
    head = ["sensors", "law", "picked", "", "true", "covered", "half", "bias"]
    every = [p["covered"] for x in found for p in x["parameters"].values()]
    sensors = [
        f"- {name}: force {s.force_noise:g} N rms, counts of {s.force_count:g} N; position "
        f"{1e6 * s.position_noise:g} um rms, counts of {1e6 * s.position_count:g} um"
        for name, s in SENSORS.items()
    ]
    return (
        "\n\n".join(
            [
                "# Laws chosen and intervals of `fit`",
                f"Share of {n} trials in which the right law of five is chosen, and in which "
                "the 95 % interval contains the true parameter; half the median interval and the "
                f"mean error as shares of it. {DURATION:g} s at {RATE:g} Hz, within "
                f"{1e3 * REACH:g} mm, two rests. By chance alone, two thirds of the shares "
                f"covered are within {math.sqrt(0.95 * 0.05 / n):.3f} of 0.95; their mean is "
                f"{statistics.mean(every):.3f}. Made by `benchmarks/fit_coverage.py`; do not "
                "edit.",
                "\n".join(sensors),
                tabulate(rows, head, tablefmt="github", disable_numparse=True),
                "## Machine",
                "\n".join(f"- {x}" for x in common.foot()),
            ]
        )
        + "\n"
    )


def main(seeds: int = 200, processes: int = 2, out: Path | None = None) -> list[dict[str, Any]]:
    """Measures, prints and, with a folder, writes both files."""
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        show = functools.partial(tqdm, total=seeds, disable=None)
        rows = [r for some in show(pool.map(trials, range(seeds))) for r in some]
    found = summary(rows)
    common.publish(out, "fit", found, page(found))
    return found


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    parser.set_defaults(out=None)
    args = parser.parse_args()
    main(args.seeds, args.processes, args.out)
