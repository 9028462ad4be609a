"""Energy of random links with passivity controllers: does what they have taken stay above -2 E0?

    python -m benchmarks.pair_passivity [--seeds 200] [--first 0]

Two devices of 6 kg, a hand that pushes with 5 N for 0.3 s, contact of 0.1 to 1 kN/m; any kind of
link, one-way delays up to 300 ms, jitter up to 50 ms, up to 30 % of losses, E0 of 1 to 100 mJ.
200 links take some six minutes of processor time.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

import hapticclay as hc
from hapticclay.scene.link import KINDS

TS, PARTS, T_MAX = 10e-3, 8, 1.2  # s, engine steps of a sample, s
PUSH = hc.Pulse((5.0, 0.0), 0.0, 0.3)
LATEST, JITTER, LOSS = 0.3, 0.05, 0.3  # s, s


class Least(NamedTuple):
    """Least energy that link and controllers had taken, per reserve E0: the bound is -2.

    Attributes:
        kind: kind of the link.
        guarded: with passivity controllers.
        free: without them.
    """

    kind: str
    guarded: float
    free: float


def drawn(seed: int) -> hc.Pair:
    """A random pair and link, with passivity controllers."""
    rng = np.random.default_rng((seed, 51))
    late = rng.integers(0, round(LATEST * PARTS / TS) + 1, 2) * TS / PARTS
    link = hc.Link(
        KINDS[int(rng.integers(len(KINDS)))],
        (float(late[0]), float(late[1])),
        jitter=float(rng.uniform(0.0, JITTER)),
        loss=float(rng.uniform(0.0, LOSS)),
        passivity=True,
        energy=float(10.0 ** rng.uniform(-3.0, -1.0)),
        seed=seed,
    )
    device, law = hc.Device(6.0, 0.1), hc.JointPD((400.0,), (50.0,))
    clay = hc.Contact(float(10.0 ** rng.uniform(2.0, 3.0)), 1.0)
    hand = hc.Operator(2.0, 2.0, 10.0)
    held = {"leader_operator": hand, "follower_clay": clay}
    return hc.Pair(device, device, law, link, Ts=TS, muscle=PUSH, t_max=T_MAX, **held)


def least(seed: int, compared: bool = False) -> Least:
    """The least energy of a random link; compared: without controllers, too."""
    pair = drawn(seed)
    plain = replace(pair, link=replace(pair.link, passivity=False, energy=None))
    E0 = pair.link.reserve

    def found(x: hc.Pair) -> float:
        return float(hc.simulate(x).energy.min()) / E0

    return Least(pair.link.kind, found(pair), found(plain) if compared else float("nan"))


def main() -> None:
    """Prints how many links stay above the bound, and the least energy by kind."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--compared", action="store_true", help="also without controllers")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    all_found = [least(seed, options.compared) for seed in tqdm(seeds)]
    for kind in KINDS:
        of_kind = [x for x in all_found if x.kind == kind]
        held = sum(x.guarded >= -2.0 for x in of_kind)
        worst = min((x.guarded for x in of_kind), default=float("nan"))
        free = sum(x.free < -2.0 for x in of_kind)
        text = f"{kind}: {held} of {len(of_kind)} above -2 E0, least {worst:.3f} E0"
        print(text + (f"; {free} below it without controllers" if options.compared else ""))


if __name__ == "__main__":
    main()
