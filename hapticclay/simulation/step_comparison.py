"""Comparison of runs at three steps: error of the finest, in border times or in positions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .run import Crossing

ORDER_GAP = 0.5  # largest deviation of an observed order that confirms that of the integrator
CLOSER = 0.7  # share of the gap of 4h to h that the gap of 2h to h may have; 0.2 at second order
ROUNDING_LEFT = 1e-12  # [s], [m] rounding that remains at any step
FINEST_GAP = 1.5  # gap of 2h to h over the error at h, at least; 3 at second order
PASSED = 1e-13  # [m] distance beyond a border at which it counts as passed


class Trace(NamedTuple):
    """The data of a run that are compared."""

    dt: float  # [s]
    code: str  # of the outcome
    crossings: tuple[Crossing, ...]
    t: np.ndarray  # of the samples [s], shape (n,)
    p: np.ndarray  # [m], shape (n, 2)


class Comparison(NamedTuple):
    """Error of the finest of three runs, from their comparison."""

    estimate: float | None  # None where there is nothing to compare
    order: float | None  # as observed; None where it cannot be determined
    confirmed: bool  # the order is that of the integrator, so that the estimate is sharp
    note: str  # what is wrong, "" for nothing
    final: bool = False  # finer steps would not help
    finest: float | None = None  # error of the finest run, where estimate is that of a coarser


UNSTABLE = "the loop is unstable: errors grow with time, and nothing bounds them"
DIFFERENT = "from step to step, the runs cross other borders or end otherwise"
AT_ROUNDING = "rounding: no step does better"


def compare_times(coarse: Trace, middle: Trace, fine: Trace, *, order: int) -> Comparison:
    """The error of the crossing times of the finest of three runs [s].

    Where the differences shrink with the order, it is the last one over 2^order - 1.
    """
    if _unstable(middle, fine):
        return Comparison(None, None, False, UNSTABLE, True)
    first, second = _time_gap(coarse, middle), _time_gap(middle, fine)
    if second is None:
        return Comparison(None, None, False, DIFFERENT)
    if not fine.crossings:
        return Comparison(None, None, False, "no border was crossed: ask for an error in m", True)
    # a slow handle stays within the rounding of a border for long
    slowest = max(min(abs(c.speed) for c in fine.crossings), PASSED)
    floor = ROUNDING_LEFT + PASSED / slowest
    sharp = second / (2.0**order - 1.0)
    if sharp <= floor:
        return Comparison(floor, None, True, AT_ROUNDING, True)
    if not first:
        return Comparison(second, None, False, "")
    seen = math.log2(first / second)
    confirmed = abs(seen - order) <= ORDER_GAP and not _bounces(fine)
    return Comparison(sharp if confirmed else max(first, second), seen, confirmed, "")


def compare_positions(coarse: Trace, middle: Trace, fine: Trace, *, order: int) -> Comparison:
    """The error of the positions of the coarsest of three runs at its samples [m].

    The first sample after a hit has a larger error than others. Its size depends on where in a
    step the border lies, so the differences do not shrink evenly. The finest run has all samples of
    the coarsest, and 4^-order of its error.
    """
    if _unstable(coarse, fine):
        return Comparison(None, None, False, UNSTABLE, True)
    first, second = _position_gap(coarse, fine), _position_gap(middle, fine)
    if first is None or second is None:
        return Comparison(None, None, False, DIFFERENT)
    if first <= ROUNDING_LEFT:
        return Comparison(ROUNDING_LEFT, None, True, AT_ROUNDING, True)
    seen = math.log2(first / second - 1.0) if first > second > 0.0 else None
    confirmed = second <= CLOSER * first
    sharp = first / (1.0 - 4.0**-order)
    finest = second / (FINEST_GAP if confirmed else 1.0)
    return Comparison(
        sharp if confirmed else max(first, second), seen, confirmed, "", False, finest
    )


def _unstable(a: Trace, b: Trace) -> bool:
    return {a.code, b.code} <= {"diverged", "limit cycle"}


def _bounces(trace: Trace) -> bool:
    """Whether a border is crossed again within a step, which the step hardly resolves."""
    last: dict[tuple[str, float], float] = {}
    found = False
    for c in trace.crossings:
        found |= c.time - last.get((c.axis, c.border), -math.inf) < trace.dt
        last[c.axis, c.border] = c.time
    return found


def hides_events(coarse: Trace, _: Trace, fine: Trace) -> bool:
    """Whether all runs make the same step from a border to the next sample, with one error."""
    return any((-c.time) % coarse.dt < fine.dt for c in fine.crossings)


def _time_gap(a: Trace, b: Trace) -> float | None:
    """Largest difference of crossing times [s]; None if other borders were crossed."""
    same = [(c.axis, c.border) for c in a.crossings] == [(c.axis, c.border) for c in b.crossings]
    if not same or a.code != b.code:
        return None
    return max(
        (abs(c.time - d.time) for c, d in zip(a.crossings, b.crossings, strict=True)), default=0.0
    )


def _position_gap(a: Trace, b: Trace) -> float | None:
    """Largest distance at the common samples [m]; None if the ends differ."""
    n = min(len(a.t), len(b.t))
    both = np.abs(a.t[:n] - b.t[:n]) <= 1e-12 * (1.0 + a.t[:n])  # the last sample may be short
    away = np.linalg.norm(a.p[:n] - b.p[:n], axis=1)[both]
    return float(away.max(initial=0.0)) if a.code == b.code else None
