"""Outliers of measured columns: spikes, lost packets, repeated values, steps that never return.

A handle has mass: its position cannot jump. An increment that continues neither the increments
before it nor those after it is a jump; a velocity that jumps, as at a hit, continues one of them.
Between a jump away and the jump back lie outliers. Scales are medians, which outliers hardly move
(F. R. Hampel, The influence curve and its role in robust estimation, J. Am. Stat. Assoc. 69 (1974)
383).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

NORMAL = 1.4826  # standard deviation of normal noise over its median absolute value
BEFORE = 4  # increments that predict the next one
JUMP = 8.0  # deviations of the prediction that make a jump; white noise reaches 7.4 in 1e6 samples
COUNT = 0.5  # least deviation, in counts of a quantised column ...
MOVING = 0.04  # ... and as a share of the increments around
BLOCK = 200  # samples over which the deviation of the prediction is measured
LONGEST = 24  # samples from a jump to the jump back
SIDES = (8, 3)  # samples on each side that bridge a gap; fewer where another gap is near
FAR = 4.0  # outliers lie so much farther from the bridge than the samples that carry it
LOST = "jumps away and back, or values that repeat before a jump: lost packets?"
NAMED = 3  # times that a sentence names


class Cleaned(NamedTuple):
    """A column without its outliers."""

    x: np.ndarray  # with a curve through the samples around in place of outliers, (n,)
    bad: np.ndarray  # mask of the outliers, (n,)
    steps: np.ndarray  # indices of the samples after a jump that does not return, (m,)


def robust_deviation(x: np.ndarray) -> float:
    """Standard deviation of normal noise that has the same median absolute value."""
    return NORMAL * float(np.median(np.abs(x)))


def cleaned(x: np.ndarray, count: float = 0.0) -> Cleaned:
    """An evenly sampled column, smooth but for noise; `count`: its quantum, 0 for none."""
    given, bad = np.asarray(x, dtype=float), np.zeros(len(x), dtype=bool)
    now, at = given, _jumps(given, count)
    for _ in range(5):  # small outliers stand beside large ones
        more = bad.copy()
        for first, stop in _gaps(now, at):
            more[first:stop] = True
        if np.array_equal(more, bad):
            break
        bad = more
        now = bridged(given, bad)
        at = _jumps(now, count)
    lasting = at[~(bad[at] | bad[at + 1])]
    return Cleaned(now, bad, lasting + 1)


def bridged(x: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """The column with outliers replaced by the cubic through the good samples on both sides."""
    out, good = x.copy(), np.flatnonzero(~bad)
    for first, stop in runs_of(bad):
        i = int(np.searchsorted(good, first))
        around = good[max(i - SIDES[0], 0) : i + SIDES[0]]
        both = 0 < i < len(good)
        out[first:stop] = _curve(around, x, 3 if both else 1)(np.arange(first, stop))
    return out


def runs_of(mask: np.ndarray) -> list[tuple[int, int]]:
    """(start, stop) of each run of True in a mask."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def sentence(column: str, t: Sequence[float] | np.ndarray, samples: int, why: str) -> str:
    """A warning about samples that are left out, at times t [s]."""
    are = "are" if len(t) > 1 else "is"
    return f"{len(t)} of {samples} {column}s {are} left out, at t = {times(t)} s: {why}"


def times(t: Sequence[float] | np.ndarray) -> str:
    """The first of some times, in words."""
    more = ", ..." if len(t) > NAMED else ""
    return ", ".join(f"{x:.6g}" for x in t[:NAMED]) + more


def _jumps(x: np.ndarray, count: float) -> np.ndarray:
    """Indices i of increments from x[i] to x[i + 1] that continue neither side."""
    d = np.diff(x)
    ahead = np.linalg.pinv(np.vander(np.arange(-BEFORE, 0), 2))[1]  # a line, at the next increment
    left, right = np.full((2, len(d)), np.inf)
    left[BEFORE:] = np.convolve(d, ahead[::-1], "valid")[:-1]
    right[:-BEFORE] = np.convolve(d, ahead, "valid")[1:]
    off = np.minimum(np.abs(d - left), np.abs(d - right))
    size = np.abs(d)
    around = np.max([np.roll(size, k) for k in (-2, -1, 1, 2)], axis=0)
    least = np.maximum(COUNT * count, MOVING * around) + 1e-14 * float(np.max(np.abs(x)))
    return np.flatnonzero(off > JUMP * np.maximum(_local_deviation(off), least))


def _local_deviation(off: np.ndarray) -> np.ndarray:
    """Deviation of normal noise at each value, from the median over the blocks around it."""
    count = max(len(off) // BLOCK, 1)
    size, longer = divmod(len(off), count)  # that many blocks have a sample more
    at = longer * (size + 1)
    blocks = off[:at].reshape(longer, size + 1), off[at:].reshape(count - longer, size)
    each = NORMAL * np.concatenate([np.median(np.abs(x), axis=1) for x in blocks])
    wide = np.concatenate((each[:1], each, each[-1:]))
    each = np.max([wide[:-2], each, wide[2:]], axis=0)
    return np.repeat(each, size + (np.arange(count) < longer))


def _gaps(x: np.ndarray, at: np.ndarray) -> list[tuple[int, int]]:
    """(start, stop) of samples between a jump away and a jump back, or frozen before a jump."""
    out, end = [], -1
    for i, found in zip(at.tolist(), _jumps_back(x, at).tolist(), strict=True):
        if i <= end:
            continue
        if i < SIDES[0] or i >= len(x) - 1 - SIDES[0]:  # the end of the column
            out.append((0, i + 1) if i < SIDES[0] else (i + 1, len(x)))
            continue
        if found >= 0:
            out.append((i + 1, found + 1))
            end = found
            continue
        first = _first_repeat(x, i)
        if first < i and _stand_out(x, np.array([first + 1]), i - first).any():
            out.append((first + 1, i + 1))
    return out


def _jumps_back(x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """For each jump the next one after which the samples between stand out; -1 for none, (n,)."""
    more = np.searchsorted(at, at + LONGEST, "right") - np.arange(len(at)) - 1
    away = np.repeat(np.arange(len(at)), more)
    back = at[away + 1 + np.arange(len(away)) - np.repeat(np.cumsum(more) - more, more)]
    length, found = back - at[away], np.full(len(at), -1)
    out = np.zeros(len(away), dtype=bool)
    for gap in np.unique(length):
        mine = length == gap
        out[mine] = _stand_out(x, at[away[mine]] + 1, int(gap)).all(axis=1)
    first, which = np.unique(away[out], return_index=True)
    found[first] = back[out][which]
    return found


def _first_repeat(x: np.ndarray, i: int) -> int:
    """Index of the first sample that has the value of sample i without a change in between."""
    first = i
    while first > 0 and x[first - 1] == x[i]:
        first -= 1
    return first


def _stand_out(x: np.ndarray, first: np.ndarray, gap: int) -> np.ndarray:
    """Whether gaps of a length have ends far from a curve that both sides follow, (n, 2)."""
    far, zero = np.zeros((len(first), 2), dtype=bool), x[first, None]
    ends = x[first[:, None] + np.array([0, gap - 1])] - zero
    for side in SIDES:
        left, right = np.minimum(side, first), np.minimum(side, len(x) - gap - first)
        for sides in set(zip(left.tolist(), right.tolist(), strict=True)):
            mine = (left == sides[0]) & (right == sides[1]) & ~far.any(axis=1)
            if sum(sides) < 2 * SIDES[-1] or not mine.any():
                continue
            places = np.concatenate((np.arange(-sides[0], 0), gap + np.arange(sides[1])))
            around = x[first[mine, None] + places] - zero[mine]
            rest, bridge = _bridge(sides[0], gap, sides[1], 3 if side > SIDES[-1] else 2)
            deviation = np.abs(around @ rest.T).max(axis=1, keepdims=True)
            far[mine] = np.abs(ends[mine] - around @ bridge.T) > FAR * deviation
    return far


@functools.lru_cache(maxsize=1000)  # a gap is short, and only near the ends has fewer samples
def _bridge(left: int, gap: int, right: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """What the samples around a gap are multiplied by, for the polynomial of least squares.

    To get their distances from it, and its values at first and last sample of the gap.
    """
    around = np.concatenate((np.arange(-left, 0), np.arange(gap, gap + right)))
    powers, at_ends = (
        np.vander(2.0 * (x + left) / (left + gap + right - 1) - 1.0, degree + 1)  # from -1 to 1
        for x in (around, np.array([0, gap - 1]))
    )
    solved = np.linalg.pinv(powers)
    return np.eye(len(around)) - powers @ solved, at_ends @ solved


def _curve(around: np.ndarray, x: np.ndarray, degree: int) -> np.polynomial.Polynomial:
    return np.polynomial.Polynomial.fit(around, x[around], min(degree, len(around) - 1))
