"""Random pairs: by how much of a limit do runs and theory disagree?

    python -m benchmarks.pair_agreement [--seeds 300] [--first 0]

All kinds of link, one to three joints, with and without a hand and something to touch. Each pair
runs 1 % below and above its largest factor of all Kp, and below and above its largest delay where
engine steps divide delays finely enough; one without a limit, or unstable as it is, runs as it is.
Near a limit a slow motion hardly grows in a run of some hundred samples, but all motion shows by
which map it moves: that of theory, or one with another gain or delay. The run is fitted by the
modes of the exact map, and of maps with 1 % more and less gain or delay. What these leave of it
says at which gain or delay the map would be that of the run. 300 pairs take some twenty minutes of
processor time.
"""

from __future__ import annotations

import argparse
import collections
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

import hapticclay as hc
from hapticclay.arms import model_file
from hapticclay.scene.link import KINDS
from hapticclay.theory.pair_build import Build

BESIDE = 0.01  # share of a limit at which runs are made
FINE = 0.5  # of that share: the engine step
PARTS = (2, 4, 5, 8, 10, 20)  # engine steps of a sample, the fewest first
SAMPLES = 400  # of a run ...
SETTLED = 40  # ... behind so many, and those of the link, that are left out
FADED = 1e-9  # what has decayed to this by then is no mode of the rest
ROWS = 2  # samples a mode, at least
CLEAR = 0.5  # of what the other maps leave: most that the own one may leave of a run that agrees


class Seen(NamedTuple):
    """A run beside the map.

    Attributes:
        kind: kind of the link.
        joints: joints of an arm.
        what: what was varied, and by how much.
        growth: by the map [1/s].
        off: share of gain or delay by which the run may be that of another map.
        left: what the map leaves of the run, over the least that those 1 % off leave.
    """

    kind: str
    joints: int
    what: str
    growth: float
    off: float
    left: float

    @property
    def verdict(self) -> str:
        """Whether the map explains the run better than those 1 % off, or worse."""
        if self.left < CLEAR:
            return "agree"
        return "differ" if self.left > 1.0 / CLEAR else "open"


def arm(joints: int, rng: np.random.Generator) -> hc.MjcfArm | hc.Device:
    """An arm without friction, which theory leaves out, and weight, under which hands fall."""
    if joints == 1:
        return hc.Device(float(10.0 ** rng.uniform(-1.0, 1.0)), float(rng.uniform(0.0, 1.0)))
    spec = model_file.spec_of("planar_2r" if joints == 2 else "haptic_3")[0]
    spec.option.gravity = [0.0, 0.0, 0.0]
    return hc.MjcfArm(spec, site="handle", friction=[0.0] * joints)


def drawn(seed: int) -> hc.Pair:
    """A random pair whose delays are whole halves of a sample."""
    rng = np.random.default_rng((seed, 53))
    kind = KINDS[seed % len(KINDS)]
    joints = 1 + seed // len(KINDS) % 3
    Ts = float(10.0 ** rng.uniform(-3.3, -2.3))
    arms = [arm(joints, rng) for _ in range(2)]

    def law(of: hc.MjcfArm | hc.Device) -> hc.JointPD:
        M = [of.mass] if isinstance(of, hc.Device) else np.diag(of.mass_matrix()).tolist()
        omega, zeta = rng.uniform(0.02, 0.2) / Ts, rng.uniform(0.1, 1.0)
        how = str(rng.choice(["exact", "difference", "filter"]))
        return hc.JointPD(
            tuple(m * omega**2 for m in M),
            tuple(2.0 * zeta * omega * m for m in M),
            velocity=how,  # type: ignore[arg-type]
            cutoff=float(rng.uniform(2.0, 10.0) * omega) if how == "filter" else None,
            runs="host" if kind == "waves" or rng.random() < 0.5 else "drive",
        )

    felt = kind in ("position-force", "four-channel")
    link = hc.Link(
        kind,
        (0.5 * Ts * int(rng.integers(0, 20)), 0.5 * Ts * int(rng.integers(0, 20))),
        scale=(float(rng.uniform(0.7, 1.5)), float(rng.uniform(0.3, 1.0)) if felt else 1.0),
        rates=kind == "waves" or bool(rng.random() < 0.7),
    )
    size = 1.0 if joints == 1 else 0.05  # [kg] at a handle
    hand = hc.Operator(*(size * rng.uniform(0.2, 2.0, 3) * (1.0, 5.0, 20.0)).tolist())
    K, B, mass = (size * rng.uniform(0.0, 2.0, 3) * (100.0, 5.0, 0.5)).tolist()
    return hc.Pair(
        arms[0], arms[1], law(arms[0]), link, law(arms[1]), Ts,
        delay=0.5 * Ts * int(rng.integers(0, 3)),
        leader_operator=hand if rng.random() < 0.6 else None,
        follower_clay=hc.Contact(K, B, mass) if rng.random() < 0.6 else None,
        muscle=hc.Pulse((1.0, 0.0) if joints == 1 else (1e-4, 7e-5), 0.0, 5.0 * Ts),
    )  # fmt: skip


def cases(pair: hc.Pair) -> Iterator[tuple[str, hc.Pair]]:
    """Pairs beside the limits of theory, and what they are."""
    found = hc.theory.pair_limits(pair)
    if math.isfinite(found.gain) and found.gain > 0.0:
        for share in (1.0 - BESIDE, 1.0 + BESIDE):
            yield f"all Kp {share - 1.0:+.0%}", stiffer(pair, share * found.gain)
    elif math.isinf(found.delay) or not found.stable:
        yield "as it is", pair
    if math.isfinite(found.delay) and found.delay > 0.0:
        yield from delayed(pair, found.delay)


def stiffer(pair: hc.Pair, factor: float) -> hc.Pair:
    """The pair with a factor on Kp of both laws."""
    laws = [replace(law, Kp=tuple(factor * x for x in law.Kp)) for law in pair.laws]
    return replace(pair, law=laws[0], follower_law=laws[1])


def delayed(pair: hc.Pair, limit: float) -> Iterator[tuple[str, hc.Pair]]:
    """The pair with delays a percent below and above a limit, as engine steps allow.

    Above, the one of those up to a percent at which the map grows fastest: where a measured force
    jumps, some are stable again.
    """
    whole = Build(pair).architecture.whole  # read at samples
    fitting = (p for p in ((1,) if whole else PARTS) if pair.Ts / p <= FINE * BESIDE * limit)
    parts = next(fitting, 0)
    if not parts:
        return
    step = pair.Ts / parts
    below = math.floor((1.0 - BESIDE) * limit / step + 1e-6)
    last = math.floor((1.0 + BESIDE) * limit / step) + 2
    above = range(math.floor(limit / step + 1e-6) + 1, last)
    if abs(limit / step - round(limit / step)) < 1e-6 and parts > 1:
        above = range(round(limit / step), above.stop)
    build = Build(pair)
    most = max(above, key=lambda k: build.loop((k * step, k * step)).radius())
    for steps in (below, most):
        late = replace(pair, link=replace(pair.link, delay=steps * step))
        yield f"delay {steps * step / limit - 1.0:+.1%}", late


def seen(what: str, pair: hc.Pair) -> Seen:
    """A run of a pair beside its map."""
    build = Build(pair)
    late = SETTLED + math.ceil(sum(pair.link.delays) / pair.Ts)
    modes = int(np.sum(np.abs(build.loop().eigenvalues) ** late > FADED))
    samples = max(SAMPLES, ROWS * modes)
    record = hc.simulate(replace(pair, t_max=(late + samples) * pair.Ts))
    moved = np.diff(np.hstack([record.leader, record.follower]), axis=0)[late:]
    there, back = pair.link.delays

    def left(share: float) -> float:
        factor = 1.0 + share
        if what.startswith("delay"):
            loop = build.loop((factor * there, factor * back))
        else:
            loop = build.loop(gain=factor)
        z = loop.eigenvalues
        return unexplained(moved, z[np.abs(z) ** late > FADED])

    own, less, more = left(0.0), left(-BESIDE), left(BESIDE)
    growth = math.log(build.loop().radius()) / pair.Ts
    off = BESIDE * own / (0.5 * (less + more))  # what is left grows with the distance
    return Seen(pair.link.kind, pair.n, what, growth, off, own / min(less, more))


def unexplained(x: np.ndarray, z: np.ndarray) -> float:
    """What modes of some eigenvalues, and steady motion, leave of a record of shape (m, n)."""
    k = np.arange(len(x))[:, None]
    late = np.where(np.abs(z) > 1.0, len(x), 0)  # of the one that grows fastest
    powers = [np.ones((len(x), 1))] + [
        y ** (k - n) for y, n in zip(z.tolist(), late.tolist(), strict=True) if y.imag >= 0.0
    ]
    columns = np.hstack([np.hstack([y.real, y.imag]) if np.any(y.imag) else y.real for y in powers])
    basis, size, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
    basis = basis[:, size > 1e-12 * size[0]]
    return float(np.linalg.norm(x - basis @ (basis.T @ x)))


def study(seeds: range) -> list[Seen]:
    """Runs of random pairs beside their maps."""
    found = []
    for seed in tqdm(seeds, disable=None):
        for what, pair in cases(drawn(seed)):
            found.append(seen(what, pair))
            if found[-1].verdict != "agree":
                tqdm.write(f"{seed}, {found[-1].verdict}: {found[-1]}")
    return found


def main() -> int:
    """Prints how many runs agree, by kind of link; 1 if one differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    found = study(range(options.first, options.first + options.seeds))
    for kind in KINDS:
        count = collections.Counter(x.verdict for x in found if x.kind == kind)
        print(f"{kind:18}", ", ".join(f"{count[x]} {x}" for x in ("agree", "differ", "open")))
    off = [abs(x.off) for x in found if x.verdict == "agree"]
    if off:
        print(f"off by {np.median(off):.1e} of gain or delay, half of them, and {max(off):.1e} all")
    return int(any(x.verdict == "differ" for x in found))


if __name__ == "__main__":
    sys.exit(main())
