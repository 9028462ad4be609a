"""What a leader and a follower carry, in runs and by theory: error against run time.

    python -m benchmarks.pairs [--out DIR] [--quick]

Two leaders of seven joints, position-position at 500 Hz, 4 ms each way: the largest factor of all
Kp, by the exact map, by runs of hapticclay and of plain MuJoCo with the same messages. A pair of
one axis, with hand and object: the longest delay of four kinds of link. Writes pairs.json;
benchmarks.pages makes the page.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc
from hapticclay.scene.link import KINDS
from hapticclay.simulation.pair_run import parts_of

from . import arm_integrators as engine
from . import arms, common

TS, LATE = 2e-3, 2  # s, samples one way
SECONDS, SECONDS_QUICK = 3.0, 1.0
OWN, OWN_HALVINGS = (0.8, 1.25), 7  # of the exact factor, where runs of hapticclay are searched
PUSH = hc.Pulse((1e-4, 0.0), 0.0, 0.05)
CASES = [
    *(("Euler", n) for n in (1, 4, 16)),
    *(("RK4", n) for n in (1, 4, 16)),
]
ONE_TS, ONE_SECONDS, ONE_QUICK = 4e-3, 20.0, 12.0  # s; its slowest swing takes 2.7 s
LONG = 1.0  # s, delay of a link without limit
AXIS = {
    "leader": hc.Device(6.0, 0.1),
    "follower": hc.Device(6.0, 0.1),
    "law": hc.JointPD((400.0,), (50.0,)),
    "leader_operator": hc.Operator(2.0, 2.0, 10.0),
    "follower_clay": hc.Contact(50.0, 1.0, 3.0),
}


def leaders(factor: float = 1.0, seconds: float = SECONDS) -> hc.Pair:
    """Two leaders whose hosts run the law, all Kp times a factor."""
    arm = hc.MjcfArm(engine.FILE, friction=[0.0] * len(engine.KP))
    law = hc.JointPD(tuple(factor * engine.KP), tuple(engine.KD))
    link = hc.Link("position-position", delay=LATE * TS)
    return hc.Pair(arm, arm, law, link, Ts=TS, muscle=PUSH, t_max=seconds)


# ---- plain MuJoCo --------------------------------------------------------------------------------


def plain_run(method: str, substeps: int, factor: float, seconds: float) -> np.ndarray:
    """Positions of both arms at the samples, from a deviation of 1e-7 rad."""
    both = [arms.mujoco_arm(engine.FILE, method, TS, substeps) for _ in range(2)]
    home = hc.MjcfArm(engine.FILE).q
    rng = np.random.default_rng(0)
    for arm in both:
        arm.start(home + 1e-7 * rng.normal(size=len(home)))
    Kp, none = factor * engine.KP, np.zeros(len(home))
    late: deque[list[np.ndarray]] = deque([[none, none]] * LATE)  # pulls on their way
    rows = []
    for _ in range(round(seconds / TS)):
        pulls = [Kp * (arm.q - home) + engine.KD * arm.qd for arm in both]
        late.append(pulls[::-1])
        for arm, own, other in zip(both, pulls, late.popleft(), strict=True):
            arm.hold(arm.weight() - own + other)
        rows.append(np.concatenate([arm.q for arm in both]))
        if not np.abs(rows[-1] - np.tile(home, 2)).max() < 1e-2:
            break
    return np.array(rows)


def plain_grows(method: str, substeps: int, factor: float, seconds: float) -> bool:
    """Whether such a run grows, by its rates: a free pair rests anywhere."""
    rows = plain_run(method, substeps, factor, seconds)
    if len(rows) < round(seconds / TS):
        return True
    return engine.outgrows(np.abs(np.diff(rows, axis=0)).max(axis=1))


def plain_limit(method: str, substeps: int, exact: float, seconds: float) -> float:
    """Factor of all Kp at which runs of MuJoCo begin to grow; inf above 8 times the exact one."""

    def grows(factor: float) -> bool:
        return plain_grows(method, substeps, factor, seconds)

    low, high = 0.5 * exact, 8.0 * exact
    return engine.bisected(grows, low, high) if grows(high) else math.inf


def plain_time(method: str, substeps: int) -> float:
    """Processor time of a simulated second of both arms and their law [s]."""
    return arms.spent(lambda: plain_run(method, substeps, 0.5, 1.0))


# ---- ours ----------------------------------------------------------------------------------------


def own_limit(exact: float, seconds: float, halvings: int) -> float:
    """Factor of all Kp at which runs of hapticclay begin to grow."""

    def grows(factor: float) -> bool:
        return hc.simulate(leaders(factor, seconds)).grows

    return engine.bisected(grows, OWN[0] * exact, OWN[1] * exact, halvings)


def own_time(repeats: int) -> float:
    """Processor time of a simulated second of both arms, laws, link and record [s]."""
    pair = leaders(seconds=1.0)
    return statistics.median(arms.spent(lambda: hc.simulate(pair)) for _ in range(repeats))


def row(
    package: str, method: str, steps: int, found: float, exact: float, time: float
) -> dict[str, Any]:
    """Error of the factor and run time of one method and step."""
    error = None if math.isinf(found) else found / exact - 1.0
    return {"package": package, "method": method, "steps": steps, "error": error, "time": time}


def rows_of_gains(exact: float, quick: bool) -> list[dict[str, Any]]:
    """All methods and steps."""
    seconds, halvings = (SECONDS_QUICK, 2) if quick else (SECONDS, OWN_HALVINGS)
    found, time = own_limit(exact, seconds, halvings), own_time(1 if quick else 3)
    out = [row("hapticclay", "sampled", parts_of(leaders()), found, exact, time)]
    for method, n in CASES[:: 3 if quick else 1]:
        found = plain_limit(method, n, exact, seconds)
        time = statistics.median(plain_time(method, n) for _ in range(arms.REPEATS))
        out.append(row("MuJoCo", method, n, found, exact, time))
    return out


# ---- one axis ------------------------------------------------------------------------------------


def axis(kind: str, delay: float, seconds: float) -> hc.Pair:
    """The pair of one axis of Yokokohji and Yoshikawa, with hand and object."""
    return hc.Pair(link=hc.Link(kind, delay), Ts=ONE_TS, t_max=seconds, **AXIS)  # type: ignore[arg-type]


def last_stable(grows: Callable[[int], bool], low: int, high: int) -> int:
    """Largest number of samples at which runs decay, between one that does and one that grows."""
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return low


def delay_row(kind: str, quick: bool) -> dict[str, Any]:
    """The longest stable delay of a link in whole samples, by theory and in runs."""
    seconds = ONE_QUICK if quick else ONE_SECONDS
    limit = hc.theory.pair_limits(axis(kind, ONE_TS, seconds)).delay

    def grows(samples: int) -> bool:
        return hc.simulate(axis(kind, samples * ONE_TS, seconds)).grows

    out: dict[str, Any] = {"kind": kind, "limit": None, "theory": None}
    if math.isinf(limit):
        return {**out, "runs": None, "decays": not grows(round(LONG / ONE_TS))}
    theory = math.ceil(limit / ONE_TS - 1e-9) - 1
    while hc.theory.pair_limits(axis(kind, (theory + 1) * ONE_TS, seconds)).stable:
        theory += 1  # a share of a sample less was unstable
    near = (theory - 1, theory + 2) if quick else (theory // 2, 2 * theory)
    return {**out, "limit": limit, "theory": theory, "runs": last_stable(grows, *near)}


# ---- the exact answers ---------------------------------------------------------------------------


def theory_times(quick: bool) -> list[dict[str, Any]]:
    """Processor time of the exact answers for two leaders [s]."""
    pair, cells = leaders(), 5 if quick else 20
    jobs: dict[str, tuple[Callable[[], Any], int]] = {
        "all limits of two arms of seven joints": (lambda: hc.theory.pair_limits(pair), 3),
        f"a map of {cells} gains by {cells} delays": (
            lambda: hc.theory.pair_map(pair, cells, cells), 1,
        ),
        "all limits of a pair of one axis": (
            lambda: hc.theory.pair_limits(axis("position-position", ONE_TS, 1.0)), 3,
        ),
    }  # fmt: skip
    return [
        {"question": name, "time": statistics.median(arms.spent(job) for _ in range(rounds))}
        for name, (job, rounds) in jobs.items()
    ]


def main(out: Path = Path("out/bench"), quick: bool = False) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    common.warm()
    exact = hc.theory.pair_limits(leaders()).gain
    found = {
        "exact": exact,
        "resolution": arms.resolution(),
        "own_resolution": float((OWN[1] / OWN[0]) ** (0.5 / 2**OWN_HALVINGS) - 1.0),
        "rows": rows_of_gains(exact, quick),
        "delays": [delay_row(kind, quick) for kind in KINDS[: 1 if quick else None]],
        "theory": theory_times(quick),
    }
    return common.write(out, "pairs", found)


# ---- page ----------------------------------------------------------------------------------------


def runs_words(r: dict[str, Any]) -> str:
    """What runs say of the delay of a kind of link."""
    if r["theory"] is None:
        return f"{'decays' if r['decays'] else 'grows'} at {LONG:g} s"
    return f"{r['runs']} samples"


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    cells = [
        [
            r["package"],
            r["method"],
            engine.step_words(r["steps"]),
            arms.error_words(r["error"]),
            common.milliseconds(r["time"]),
        ]
        for r in data["rows"]
    ]
    delays = [
        [
            r["kind"],
            "none" if r["limit"] is None else f"{1e3 * r['limit']:.1f}",
            "any" if r["theory"] is None else f"{r['theory']} samples",
            runs_words(r),
        ]
        for r in data["delays"]
    ]
    times = [[r["question"], common.milliseconds(r["time"])] for r in data["theory"]]
    resolution, own = (100.0 * data[x] for x in ("resolution", "own_resolution"))
    return [
        "## The largest gain",
        "Two leaders of seven joints (`mjcf/arms/leader_7.xml`) without joint friction, "
        "position-position with rates, laws on the hosts at 500 Hz, 4 ms each way. By the exact "
        f"map all Kp may rise {data['exact']:.4f} times. In runs they are multiplied by a factor "
        f"until rates grow; the bisection finds it to {resolution:.2f} %, for hapticclay, between "
        f"{OWN[0]:g} and {OWN[1]:g} of the exact one, to {own:.2f} %. MuJoCo's runs get the same "
        "messages from a program in Python. Run time: processor time of a simulated second of "
        "both arms and their law; hapticclay's has link, energy and record as well, all in Python "
        "from sample to sample.",
        common.table(
            cells, ["package", "method", "step", "error of the factor", "run time [ms/s]"]
        ),
        "## The longest delay",
        "Two devices of 6 kg and 0.1 N.s/m, Kp = 400 N/m, Kd = 50 N.s/m, at 250 Hz, with a hand "
        "and an object ([the published pair](../pair.md#a-published-pair)). Theory: the least "
        "one-way delay that is unstable, shares of a sample included, and the number of samples up "
        "to which whole ones are stable. Runs: the largest whole number of samples at which motion "
        "after a push decays, by bisection from half to twice that of theory.",
        common.table(delays, ["link", "unstable from [ms]", "stable by theory", "stable in runs"]),
        "## The exact answer",
        "Without runs, processor time:",
        common.table(times, ["question", "time [ms]"]),
        "Random links with passivity controllers are counted by "
        "`python -m benchmarks.pair_passivity` ([numbers](../pair.md#with-passivity-controllers)).",
    ]


def conclusions(data: dict[str, Any]) -> list[str]:
    """How far runs of two arms are off, and whether delays agree."""
    ours, *theirs = data["rows"]
    said = f"Runs of hapticclay find the largest gain within {abs(100.0 * ours['error']):.1f} %"
    at_one = [r for r in theirs if r["steps"] == 1 and r["method"] == "Euler"]
    said += "".join(
        f", MuJoCo's Euler at one step a sample {arms.error_words(r['error'])}" for r in at_one
    )
    agree = all(
        r["decays"] if r["theory"] is None else r["theory"] == r["runs"] for r in data["delays"]
    )
    also, n = "all" if agree else "not all", len(data["delays"])
    return [
        f"Leader and follower. {said}; {also} longest delays of {n} kind{'s' * (n > 1)} of link "
        "are those of theory to the sample."
    ]


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer steps, shorter runs")
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, args.quick))))
