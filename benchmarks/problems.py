"""The jobs that every integrator is given, and their reference solutions.

A job is a constant cut without shaping: the nonlinear arm, the servo, the compensator, the clay
between 5 and 15 cm, both axes. The reference is the arm in joint space under SciPy's DOP853 at
1e-12, borders as events (tests/oracles.py).
"""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass

import numpy as np

import hapticclay as hc
from tests.oracles import Pieces, nonlinear_pieces

EDGES = (0.05, 0.15, 0.20)  # [m] the clay begins, ends; the path ends

PROBLEMS = {
    "default cut": hc.constant_cut(),
    "hand in the loop": hc.constant_cut(operator=hc.Operator(), force=(2.0, 0.0)),
    "off-axis force": hc.constant_cut(force=(1.0, 0.3)),
}


@dataclass(frozen=True)
class Result:
    """What an integrator made of a job.

    Attributes:
        crossings: times at which x crossed EDGES [s], in order; shorter if the run failed.
        t, p: samples of time [s], (n,), and handle position [m], (n, 2).
        fe, v: clay force [N] and velocity [m/s] along x at the samples, (n,).
        wall: seconds of run time of the integration alone. note: why it failed, if it did.
    """

    crossings: list[float]
    t: np.ndarray
    p: np.ndarray
    fe: np.ndarray
    v: np.ndarray
    wall: float
    note: str = ""


@functools.cache
def reference(name: str) -> Pieces:
    """The reference solution of a job:

    its crossings, and p(t), v(t) at any ascending times before the end.
    """
    s = PROBLEMS[name]
    assert s.clay is not None
    th = dataclasses.astuple(s.operator) if s.operator else None
    return nonlinear_pieces(
        s.clay.x.values, EDGES, s.gain, s.force, th, s.inertia_shaping, s.t_max, 1e-12, 1e-14
    )
