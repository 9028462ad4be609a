"""The sampled loop with hardware: error against run time, beside SciPy and plain MuJoCo.

    python -m benchmarks.sampled_loop [--quick] [--out DIR]

Writes sampled_loop.json and one PNG a problem; benchmarks.pages makes the page.
"""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc
from hapticclay.model.constants import TS

from . import common, sampled_reference, study

HARDWARE = hc.Hardware(
    encoder=65536,
    velocity="difference",
    velocity_window=16,
    force_filter=400.0,
    adc_bits=12,
    dac_bits=12,
    delay=1.3 * TS,
)
BORDER = 0.002  # [m] the clay begins
END, SHORT = 1250, 150  # samples of a run; of a quick one
PARTS = 1, 2, 4, 8, 16, 32, 64, 128  # steps to a sample
SECOND = "RK45", 1e-11  # of the second reference
ROUNDING = 1e-16  # [m] of a position of some centimetres
RENDERED = {
    "held": "The clay is rendered: its force is computed from the measured velocity and held.",
    "physical": "The clay is physical: it acts on the handle itself, between samples too.",
}
OMISSIONS = [
    "Sampled control with hardware: python-control, PyBullet, Drake and Pinocchio were not "
    "measured; their loop would be that of SciPy or of plain MuJoCo, with a sample at each event.",
]


def scene(render: str, end: int = END) -> hc.Scenario:
    """A cut by a hand, pushed off the axis, through hardware.

    Args:
        render: "held" or "physical".
        end: samples.
    """
    cut = hc.constant_cut(
        control="sampled",
        render=render,
        operator=hc.Operator(),
        force=(5.0, 1.0),
        clay=(BORDER, 0.15),
        Ts=TS,
        t_max=end * TS,
    )
    return dataclasses.replace(cut, hardware=HARDWARE, length=None, stop_when_unstable=False)


def about(s: hc.Scenario) -> str:
    """The paragraph that states the problem."""
    io = s.hardware
    assert io and io.encoder and s.clay
    return (
        f"The paper's arm and a hand of {s.operators[0].mass:g} kg, pushed by {s.force[0]:g} N "
        f"along x and {s.force[1]:g} N along y, enter clay of {s.clay.x.values[1]:g} N.s/m at "
        f"{1e3 * BORDER:g} mm; {s.t_max:g} s. {RENDERED[s.render]} Control is sampled every "
        f"{1e3 * TS:g} ms, with an encoder of {io.encoder} counts, velocity from the difference "
        f"over {io.velocity_window} samples, a force filter of {io.force_filter:g} Hz, converters "
        f"of {io.adc_bits} bits, and a delay of {io.delay / TS:g} samples; no noise, no jitter. "
        "Ts is fixed; the setting is the step of the arm between samples [s], or the relative "
        "tolerance. SciPy restarts at every event (a sample, or torques that arrive) with the "
        "whole interval as its first step. MuJoCo applies late torques from its next step on.\n\n"
        "Rounding makes the motion a discontinuous function of rounding errors: one count read "
        "differently moves the handle by about 1e-6 m. So the error of a run is that of the handle "
        "position at the samples, counts read differently included. A run that reads all counts as "
        "the reference does has the error of its integration alone; plain MuJoCo misreads some at "
        "each of these steps, and its error levels off."
    )


def reference(s: hc.Scenario) -> tuple[np.ndarray, str]:
    """Positions at the samples [m], and what a second solution says of their error."""
    one, other = sampled_reference.solve(s), sampled_reference.solve(s, *SECOND)
    differ = sum(int(np.sum(one.levels[k] != other.levels[k])) for k in one.levels)
    spare = min(float(x.min()) for x in one.spare.values())
    apart = max(float(np.abs(one.p - other.p).max()), ROUNDING)
    total = sum(x.size for x in one.levels.values())
    return one.p[1:], (
        "The reference is the arm in complex numbers under DOP853 at 1e-12 between events, the "
        "controller by matrix exponential, the filter by SciPy (`benchmarks/sampled_reference.py`);"
        f" nothing of hapticclay steps it. A second solution, {SECOND[0]} at {SECOND[1]:g}, rounds "
        f"{'all' if not differ else f'all but {differ} of'} {total} numbers (encoder, A/D, D/A) to "
        f"the same level and differs by at most {apart:.0e} m; every rounded number lies at least "
        f"{spare:.0e} of a level from the edge between two."
    )


def methods(s: hc.Scenario, times: np.ndarray, quick: bool) -> list[study.Method]:
    """hapticclay's methods and those of the peers; a quick run leaves compiled ones out."""
    from .peers import sampled_loop as peers

    steps = tuple(TS / n for n in PARTS)
    ladders = {"fast": steps[:4]} | ({} if quick else {"fast" + study.NATIVE: steps})
    own = study.our_methods(s, times, ladders)
    return own + peers.methods(s, False if quick else None)


def problem(render: str, quick: bool) -> study.Problem:
    """The problem with clay that is "held" or "physical"."""
    s = scene(render, SHORT if quick else END)
    times = TS * np.arange(1, round(s.t_max / TS) + 1)
    return study.Problem(
        f"sampled loop with {render} clay",
        about(s),
        s,
        times,
        functools.partial(reference, s),
        functools.partial(methods, s, times, quick),
    )


sections, conclusions = study.sections, study.conclusions
figures, tables = study.figures, study.tables


def main(out: Path = Path("out/bench"), quick: bool = False) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    problems = [problem(render, quick) for render in RENDERED]
    return study.main("sampled_loop", problems, OMISSIONS, out, quick)


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="a short run, few settings")
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, args.quick))))
