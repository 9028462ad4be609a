"""Clay that yields, sticks and slips: error against run time, beside SciPy with modes and with a
regularised law.

    python -m benchmarks.yielding_clay [--quick] [--out DIR]

Writes yielding_clay.json and one PNG; benchmarks.pages makes the page.
"""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc
from tests.oracles.yielding import Yielding

from . import common, study

EVERY = 0.02  # [s] between the positions that are compared
END, SHORT = 2.0, 0.6  # [s] of a run; of a quick one
FY, B = 2.0, 5.0  # N, N.s/m
MUSCLE = hc.Multisine(rms=(3.0, 2.0), low=0.5, high=2.0, period=2.0, seed=1)
FAST = 2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5  # [s]
ACCURATE = 1e-2, 5e-3, 2.5e-3, 1e-3, 5e-4  # [s]
SECOND = "LSODA", 1e-11  # of the second reference
OMISSIONS = [
    "Clay that yields: plain MuJoCo. The friction loss of its joints is a torque for each joint; "
    "the yield force acts along x and y at the handle.",
    "Clay that yields: python-control, PyBullet, Drake and Pinocchio were not measured.",
]


def scene(end: float = END) -> hc.Scenario:
    """A hand that pushes to and fro in Bingham clay, each axis yielding on its own.

    Args:
        end: of the run [s].
    """
    clay = dataclasses.replace(hc.slab(hc.Flow(Fy=FY, b=B)), isotropic=False)
    return dataclasses.replace(
        hc.free(t_max=end),
        clay=clay,
        muscle=MUSCLE,
        force=(0.5, 0.2),
        operator=hc.Operator(),
        length=None,
        stop_when_unstable=False,
    )


def solved(s: hc.Scenario, **how: Any) -> Yielding:
    """The loop in joint space under SciPy, with the modes of the clay, see tests/oracles."""
    wave, hand = s.muscle, s.operators[0]
    assert isinstance(wave, hc.Multisine)

    def uh(t: float) -> np.ndarray:
        cosines = np.cos(wave.omega[:, None] * t + wave.phase)
        return np.array(s.force) + wave.amplitude * cosines.sum(axis=0)

    law = {"Fy": (FY, FY), "K": (0.0, 0.0), "n": (1.0, 1.0), "b": (B, B)}
    th = hand.mass, hand.damper, hand.spring
    return Yielding([law], gain=s.gain, uh=uh, hand=th, t_end=s.t_max, **how)


def reference(s: hc.Scenario, times: np.ndarray) -> tuple[np.ndarray, str]:
    """Positions [m], and what a second solution says of their error."""
    one, other = solved(s), solved(s, method=SECOND[0], rtol=SECOND[1])
    p, apart = one(times)[0], one(times)[0] - other(times)[0]
    text = (
        "The reference is the arm in joint space under DOP853 at 1e-12, which stops where an axis "
        "comes to rest or is let go (`tests/oracles/yielding.py`); nothing of hapticclay steps it."
    )
    both = one.stops, other.stops
    if [x[:2] for x in both[0]] == [x[:2] for x in both[1]]:
        late = max(abs(a[2] - b[2]) for a, b in zip(*both, strict=True))
        same = f"has the same {len(one.stops)} stops and releases, {late:.0e} s apart at most"
    else:
        same = "stops otherwise"
    return p, (
        f"{text} A second solution, {SECOND[0]} at {SECOND[1]:g}, {same}, and differs by at most "
        f"{np.abs(apart).max():.0e} m."
    )


def about(s: hc.Scenario) -> str:
    """The paragraph that states the problem."""
    return (
        f"A hand of {s.operators[0].mass:g} kg pushes to and fro in Bingham clay, Fy = {FY:g} N "
        f"and b = {B:g} N.s/m, each axis yielding on its own, for {s.t_max:g} s: each axis sticks "
        "and slips. The setting is a step [s], or a relative tolerance. SciPy solves the problem "
        "in two ways. With modes: DOP853 stops where an axis comes to rest or the clay cannot hold "
        "it any longer, in steps of at most 0.1 s, since longer ones pass over short stops. "
        "Regularised: Fy tanh(v/eps) in place of Fy v/|v|, under solvers for stiff "
        "equations, for all pairs of eps [m/s] and relative tolerance; of the pairs, diagram and "
        "table show those that no other one of the solver beats in both error and run time. A "
        "regularised handle creeps where it should rest, so the error is at least of the order of "
        "eps times the time at rest."
    )


def methods(s: hc.Scenario, times: np.ndarray, quick: bool) -> list[study.Method]:
    """hapticclay's methods and those of the peers; a quick run leaves compiled ones out."""
    from .peers import yielding_clay as peers

    ladders = {"fast": FAST[:5], "accurate": ACCURATE[:3]}
    if not quick:
        ladders |= {"fast" + study.NATIVE: FAST, "accurate" + study.NATIVE: ACCURATE}
    return study.our_methods(s, times, ladders) + peers.methods(s, times, False if quick else None)


def problem(quick: bool) -> study.Problem:
    """The problem."""
    s = scene(SHORT if quick else END)
    times = EVERY * np.arange(1, round(s.t_max / EVERY))
    return study.Problem(
        "yielding clay",
        about(s),
        s,
        times,
        functools.partial(reference, s, times),
        functools.partial(methods, s, times, quick),
    )


sections, conclusions = study.sections, study.conclusions
figures, tables = study.figures, study.tables


def main(out: Path = Path("out/bench"), quick: bool = False) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    return study.main("yielding_clay", [problem(quick)], OMISSIONS, out, quick)


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="a short run, few settings")
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, args.quick))))
