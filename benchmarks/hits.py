"""Hits on clay of any stiffness beside an exact solution.

Cuts, hits, rebounds, layers and grazing contact.

    python -m benchmarks.hits [--quick] [--random N] [--out DIR]

With inertia shaping and motors that no hit can drive into their limits, the loop is linear between
borders: the reference is the matrix exponential (tests/oracles.py). --random N compares N random
hits, with weak motors, without shaping, on both axes, with the reference of benchmarks/reference.py
instead. Writes hits.json.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.kernel import native
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay, slab
from hapticclay.model.constants import AXES, L1, L2, ORIGIN, TS
from hapticclay.model.operator import Operator
from hapticclay.scene.scenario import Scenario
from tests import oracles

from . import common, reference
from .problems import EDGES

CLAYS = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)  # [N.s/m]
STRONG = (1e6, 1e6)  # [N.m] motors that no hit here drives into their limits ...
NOMINAL_BORDER = (
    L2 - EDGES[0],
    L1,
)  # ... where shaping has least to do: the border lies at the nominal pose
FELT = 0.05  # [s] after the hit, at which the force on the hand is compared
SLOW = 1e-3  # [m/s] the time at which a border is passed more slowly than this says little
LIMIT_TIME, LIMIT_PLACE = 1e-4, 1e-5  # [s], [m] what random hits at 0.36 ms keep


def jobs(b: float) -> dict[str, Scenario]:
    """One of each kind in clay b [N.s/m]."""
    s = Scenario(
        clay=slab(b, *EDGES[:2]),
        length=None,
        inertia_shaping=True,
        torque_limit=STRONG,
        origin=NOMINAL_BORDER,
    )
    hand = Operator(0.25, 2.0, 60.0)
    thin = Profile((0.05, 0.051, 0.052, 0.053), (0.0, b, 0.1 * b, b, 0.0))
    return {
        "cut": dataclasses.replace(s, t_max=2.0),
        "hit": dataclasses.replace(
            s, force=(-0.5, 0.0), velocity=(0.3, 0.0), start=(0.03, 0.0), t_max=0.6
        ),
        "hit, hand": dataclasses.replace(
            s, force=(0.0, 0.0), velocity=(0.5, 0.0), start=(0.02, 0.0), operator=hand, t_max=0.4
        ),
        "layers": dataclasses.replace(
            s, clay=Clay(thin, thin), velocity=(0.3, 0.0), start=(0.03, 0.0), t_max=0.6
        ),
        "grazing": dataclasses.replace(
            s, force=(-0.5, 0.0), velocity=(0.03, 0.0), start=(0.0495, 0.0), t_max=0.3
        ),
    }


@functools.cache
def exact(kind: str, b: float) -> tuple[list[tuple[float, float, float]], float, float]:
    """Return a job's crossings, its last position [m], and the clay's force [N].

    The force is that FELT after the first crossing.
    """
    s = jobs(b)[kind]
    assert s.clay is not None
    edges, values = s.clay.x.edges, s.clay.x.values
    th = dataclasses.astuple(s.operator) if s.operator else (0.0, 0.0, 0.0)
    given = edges, values, s.gain[0], s.force[0], th, 0, s.start[0], s.velocity[0], s.t_max
    crossings, _ = oracles.bounces(*given)
    _, states = oracles.bounces(*given, (felt := crossings[0][0] + FELT, s.t_max))
    where = sum(c[0] < felt for c in crossings)
    region = 0
    for _, border, v in crossings[:where]:
        region = int(np.argmin(np.abs(np.array(edges) - border))) + (1 if v > 0.0 else 0)
    return crossings, float(states[1, 0]), values[region] * float(states[0, 1])


def row(kind: str, b: float, method: str, dt: float) -> dict[str, Any]:
    """One run of one job: the shape of a row of work_precision.py."""
    integrator, _, how = method.partition(", ")
    s = dataclasses.replace(jobs(b)[kind], dt=dt, integrator=integrator)
    out: dict[str, Any] = {
        "problem": kind,
        "b": b,
        "package": "hapticclay",
        "method": method,
        "setting": dt,
    }
    try:
        runs = [hc.simulate(s, engine="native" if how else "python")]
        runs += [
            hc.simulate(s, engine="native") for _ in range(2) if how and runs[0].wall_time < 0.3
        ]
    except ParameterError as error:  # an explicit method in clay too stiff for it
        return {
            **out,
            **dict.fromkeys(("crossing", "leaves", "position", "force", "wall")),
            "note": error.bound,
        }
    r, (crossings, place, felt) = runs[0], exact(kind, b)
    mine, clear = (
        [c.time for c in r.crossings if abs(c.speed) > SLOW],
        [e[0] for e in crossings if abs(e[2]) > SLOW],
    )
    same = len(mine) == len(clear)
    i = np.searchsorted(r.t, crossings[0][0] + FELT)
    force = float(np.interp(crossings[0][0] + FELT, r.t[i - 1 : i + 1], r.fe[i - 1 : i + 1, 0]))
    return {
        **out,
        "crossing": max(abs(a - b) for a, b in zip(mine, clear, strict=True)) if same else None,
        "leaves": min((abs(c.time - crossings[-1][0]) for c in r.crossings), default=None),
        "position": abs(float(r.p[-1, 0]) - place),
        "force": abs(force - felt) / max(abs(felt), 0.1),
        "wall": statistics.median(x.wall_time for x in runs) / s.t_max,
        "note": "" if same else r.status,
    }


def methods() -> dict[str, tuple[float, ...]]:
    """Way to step -> dt [s], coarse to fine."""
    fast, accurate = (2e-2, 1e-2, 4e-3, 2e-3, 1e-3, TS, 1e-4), (4e-3, 2e-3, 1e-3, 5e-4)
    if not native.is_there():
        return {"fast": fast, "accurate": accurate}
    common.warm()
    return {"fast, native": (*fast, 3.6e-5, 1e-5), "accurate, native": (*accurate, 2.5e-4, 1.6e-4)}


def scene(seed: int) -> Scenario:
    """A random hit:

    b from 1e2 to 1e7 in one to three layers, 0.05 to 0.5 m/s, with and without a hand, on one axis.
    """
    rng = np.random.default_rng(seed)
    v, axis = rng.uniform(0.05, 0.5), int(rng.integers(2))
    n = int(rng.integers(1, 4))
    borders = (0.05, *(0.05 + np.sort(rng.uniform(0.001, 0.01, n - 1))), 0.15)
    profile = Profile(borders, (0.0, *(10.0 ** rng.uniform(2.0, 7.0, n)), 0.0), AXES[axis])
    hand = Operator(rng.uniform(0.1, 0.5), rng.uniform(1.0, 5.0), rng.uniform(0.0, 100.0))
    along, across = [0.0, 0.0], rng.uniform(-0.3, 0.3)
    along[axis] = 1.0
    ahead = 0.05 - v * rng.uniform(0.01, 0.06)
    push = -rng.uniform(0.1, 4.0 * v)
    return Scenario(
        clay=Clay(profile, profile),
        gain=(1.0, 0.3),
        force=(along[0] * push + along[1] * across, along[1] * push + along[0] * across),
        operator=hand if rng.random() < 0.5 else None,
        inertia_shaping=bool(rng.random() < 0.5),
        start=(along[0] * ahead, along[1] * ahead),
        velocity=(along[0] * v, along[1] * v),
        origin=ORIGIN if axis == 0 else (0.33, 0.16),
        length=None,
        t_max=0.6,
    )


def against_reference(
    seed: int, dt: float = TS, solve: Callable[..., Any] = reference.solve
) -> dict[str, Any]:
    """One random hit beside the reference:

    largest errors of border times and of positions on the way.
    """
    s = dataclasses.replace(scene(seed), dt=dt)
    index = np.arange(1, math.floor(s.t_max / dt), max(1, round(3e-3 / dt)))
    x = solve(s, index * dt)
    r = hc.simulate(s)
    # a handle that hardly leaves the clay may pass the border some times more, as slowly: the
    # nearest time counts
    late = [
        (abs(c.speed), min(abs(c.time - e[2]) for e in x.crossings))
        for c in r.crossings
        if len(x.crossings)
    ]
    n = min(len(x.p), int(np.searchsorted(index, len(r.p))))
    return {
        "seed": seed,
        "inertia_shaping": s.inertia_shaping,
        "hand": s.operator is not None,
        "crossings": len(x.crossings),
        "crossing": max((error for speed, error in late if speed > SLOW), default=0.0),
        "slow": max((error for speed, error in late if speed <= SLOW), default=0.0),
        "position": float(np.abs(r.p[index[:n]] - x.p[:n]).max()),
    }


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    kinds = list(dict.fromkeys(r["problem"] for r in data["rows"]))
    cells = []
    for method, dt in dict.fromkeys((r["method"], r["setting"]) for r in data["rows"]):
        mine = [r for r in data["rows"] if (r["method"], r["setting"]) == (method, dt)]
        line = [method, format(dt, "g")]
        for kind in kinds:
            found = [r["crossing"] for r in mine if r["problem"] == kind]
            line.append("refused" if None in found else common.number(max(found)))
        for what in ("position", "force"):
            found = [r[what] for r in mine]
            line.append("refused" if None in found else common.number(max(found)))
        cells.append(line)
    head = [
        "method",
        "step [s]",
        *(f"{k} [s]" for k in kinds),
        "position [m]",
        f"force after {FELT:g} s",
    ]
    return [
        f"Clay of {', '.join(format(b, 'g') for b in data['clays'])} N.s/m: a cut from rest, a "
        "hit at 0.3 m/s and its rebound, a hit at 0.5 m/s with a hand, three layers of 1 mm (b, "
        "b/10, b), and grazing contact at about 1 cm/s. Largest error over all clays of the "
        f"border-crossing times (faster than {SLOW:g} m/s), and of the final position, and "
        f"relative error of the force on the hand {FELT:g} s after the hit. The reference is the "
        "matrix exponential. Refused: the explicit method would need more than 1000 steps per "
        "sample.",
        common.table(cells, head),
    ]


def conclusions(data: dict[str, Any]) -> list[str]:
    """The largest error of a border-crossing time at the control sample's step."""
    found = [r["crossing"] for r in data["rows"] if r["setting"] == TS and r["method"][0] == "f"]
    if not found or None in found:
        return []
    least, most = (format(f(data["clays"]), "g") for f in (min, max))
    return [
        f"Hits. In clay of {least} to {common.plain(most)} N.s/m, with the default step of "
        f"{1e3 * TS:g} ms, border-crossing times are within {common.number(max(found))} s of the "
        "exact ones."
    ]


def tables(data: dict[str, Any]) -> list[dict[str, Any]]:
    """All measured rows, for the CSV file."""
    return data["rows"]


def main(out: Path = Path("out/bench"), quick: bool = False) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    clays = CLAYS[1::2] if quick else CLAYS
    ladder = methods()
    if quick:
        ladder = {m: x[2:4] for m, x in ladder.items()}
    rows = [
        row(kind, b, m, dt)
        for m, x in ladder.items()
        for dt in x
        for b in clays
        for kind in jobs(b)
    ]
    return common.write(out, "hits", {"clays": clays, "rows": rows})


def study(n: int) -> None:
    """Prints n random hits beside the reference, and how many keep the limits."""
    kept = 0
    for seed in range(n):
        r = against_reference(seed)
        kept += r["crossing"] <= LIMIT_TIME and r["position"] <= LIMIT_PLACE
        print(
            *(f"{k} {v:.1e}" if isinstance(v, float) else f"{k} {v}" for k, v in r.items()),
            flush=True,
        )
    print(f"{kept} of {n} within {LIMIT_TIME:g} s and {LIMIT_PLACE:g} m")


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer clays and steps")
    parser.add_argument(
        "--random", type=int, metavar="N", help="compare N random hits with the reference instead"
    )
    args = parser.parse_args()
    if args.random:
        study(args.random)
    else:
        print("\n\n".join(sections(main(args.out, args.quick))))
