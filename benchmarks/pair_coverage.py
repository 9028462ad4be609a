"""Share of made logs of pairs in which the intervals of `identify_pair` hold the truth.

    python -m benchmarks.pair_coverage [--seeds 100]

Each log has a leader of four sines, a follower with its own inertia and friction, exact from sample
to sample, a law with its own gains, filter and link delay, torques with white noise and encoders
that count. 100 seeds take some three minutes of processor time.
"""

from __future__ import annotations

import statistics
from typing import Any

import numpy as np
from tqdm import tqdm

import hapticclay as hc
from hapticclay.studies.coulomb_axis import Axis, follow
from hapticclay.studies.pair_laws import PairLaw

from . import common

TS, ROWS = 5e-4, 8000
NOISE = 1e-3  # [N.m] of a logged torque
COUNT = 2e-5  # [rad] of an encoder
NAMES = {
    "P": "P",
    "D": "D",
    "filter lag": "lag",
    "link delay": "link",
    "inertia": "J",
    "viscous friction": "b",
    "Coulomb friction": "friction",
}


def made(seed: int) -> tuple[hc.studies.PairLog, dict[str, float]]:
    """A log, and what is true of it; torques are computed from the counts, as a computer does."""
    rng = np.random.default_rng((seed, 52))
    t = TS * np.arange(ROWS)
    P = rng.uniform(6.0, 30.0)
    link = int(rng.integers(0, 20))
    law = PairLaw(P, P * rng.uniform(0.006, 0.012), TS * rng.uniform(1.0, 3.0), link * TS)
    axis = Axis(*(rng.uniform(0.7, 1.3, 4) * (1.6e-3, 4e-3, 0.03, 0.005)).tolist())
    f, phase = rng.uniform(0.4, 6.0, 4), rng.uniform(0.0, 2.0 * np.pi, 4)
    size = rng.uniform(0.5, 1.0, 4) * 0.35 / f / 2.0 / np.pi
    leader = np.sin(2.0 * np.pi * f * t[:, None] + phase) @ size
    leader = COUNT * np.round(leader / COUNT)
    late = np.concatenate((np.full(link, leader[0]), leader[: ROWS - link]))
    measured: list[tuple[float, float]] = []

    def counted():
        torque = law.start(TS, 0.0)
        calls = iter(range(ROWS + 1))

        def law_of(error: float) -> float:
            k = max(next(calls) - 1, 0)  # the first call is that of the torque before the start
            q = COUNT * round((late[k] - error) / COUNT)
            u = torque(late[k] - q)
            measured.append((q, u))
            return u

        return law_of

    follow(axis, late.tolist(), counted, (float(leader[0]), 0.0), TS)
    follower, torque = np.array(measured[1:]).T
    torque = torque + NOISE * rng.standard_normal(ROWS)
    true = {**law._asdict(), **axis._asdict()}
    return hc.studies.PairLog(t, leader, follower, torque, name=f"seed {seed}"), true


def main(seeds: int = 100) -> list[dict[str, Any]]:
    """Judges the logs and prints a table."""
    rows = []
    for seed in tqdm(range(seeds), disable=None):
        log, true = made(seed)
        found = hc.studies.identify_pair(log)
        numbers = {x.name: x for x in found.numbers}
        for name, key in NAMES.items():
            if name in numbers:
                x = numbers[name]
                rows.append((name, x.low <= true[key] <= x.high, x.value - true[key], x, true[key]))
    cells = []
    for name in NAMES:
        mine = [r for r in rows if r[0] == name]
        if mine:
            half = statistics.median(0.5 * (r[3].high - r[3].low) for r in mine)
            bias = statistics.mean(r[2] for r in mine)
            share = sum(r[1] for r in mine) / len(mine)
            cells.append([name, str(len(mine)), f"{share:.3f}", f"{half:.2e}", f"{bias:+.1e}"])
    print(common.table(cells, ["number", "logs", "covered", "half, median", "bias"]))
    return rows


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    args = parser.parse_args()
    main(args.seeds)
