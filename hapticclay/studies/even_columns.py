"""Columns at even times, from stamps as logs have them.

Clocks that wrap are unwrapped, rows that came out of order are sorted, rows that repeat are left
out. Where the stamps differ from an even grid by their rounding alone, the grid replaces them;
where the position is smoother over the number of the row than over the stamps, the rows were
sampled evenly and stamped on arrival. All else is resampled by cubic splines. What is done is said.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .. import matrices
from ..columns.stamps import EVEN, Stamps
from ..errors import ParameterError
from .outliers import robust_deviation, times

MODULI = (2.0**16, 2.0**32)  # at which counters of clocks and of encoders begin again
LEAST_MODULUS = 100.0  # usual steps
MOST_ACROSS = 20.0  # usual steps over the turn of a counter
TICKS = (1.0, 1e-3, 1e-6, 1e-9)  # of clocks [s]
DISORDER = 0.02, 20.0  # share of rows that may be out of order, and usual steps by which
LEAST_JUDGED = 50  # rows by which it is judged where a stamp comes from
LATE = 20.0  # steps by which stamps may part from an even clock
BUNCH = 0.1, 0.01  # of a step: stamps nearer than that come in bunches, if so large a share does
CLOSE = 0.25  # of a step: rows nearer than that are averaged
SMOOTHER = 0.7  # ratio of deviations from cubics below which rows were sampled evenly
BRIDGED = 24  # rows missing in a gap that is bridged ...
LOST = 0.05  # ... if no larger share of all rows is missing
SIDES = (8, 4)  # rows on each side of a long step by which it is known whether one is missing, ...
SURE = 3.0  # ... and the logarithm of how much likelier it is that decides
TICK = 0.02  # of the duration: stamps of a coarser clock are no times of rows
TURNS = (math.tau, 360.0)  # at which angles begin again [rad, deg]
WIDEST = 64  # bits of a counter
WRAP = 0.1  # of a turn: jumps at a wrap differ from the turn by less ...
HELD_SPANS = 20  # between changes of a column by which one that is held is known
INSIDE, SLACK = 0.5, 1e-3  # ... all steps that go on are smaller, and like those around to this
Between = Literal["spline", "linear", "hold"]
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Even:
    """Columns at even times, and what was done to the rows, one sentence each."""

    columns: Columns
    notes: tuple[str, ...]


def even_columns(columns: Mapping[str, np.ndarray], input: Between = "spline") -> Even:
    """Columns, t among them, at even times; `input`: how that column is between the rows."""
    rows = dict(columns)
    notes: list[str] = []
    rows["t"], note = _unwrapped_clock(rows["t"])
    notes += note
    rows, note = _in_order(rows)
    notes += note
    stamps = Stamps(rows["t"])
    if len(stamps.t) < 3 or not stamps.step > 0.0 or _is_even(stamps.t):
        return Even(_without_last(rows), tuple(notes))
    if (grid := _on_grid(stamps, rows["output"])) is not None:
        rows["t"] = grid
        if _is_even(grid):
            where = f"{1.0 / Stamps(grid).step:.6g} Hz"
            notes.append(f"stamps are rounded to {stamps.rounding:g} s: rows are even, at {where}")
            return Even(_without_last(rows), tuple(notes))
    elif _stamped_late(rows):
        step = float(np.polyfit(np.arange(len(stamps.t)), stamps.t, 1)[0])
        rows["t"] = stamps.t[0] + step * np.arange(len(stamps.t))
        notes.append(
            f"stamps jitter by {stamps.jitter:.3g} s, and come in bunches or make the position "
            f"rougher: rows were sampled evenly and stamped later; taken at {1.0 / step:.6g} Hz"
        )
        return Even(rows, tuple(notes))
    rows, note = _longest_part(rows, Stamps(rows["t"]))
    if _is_even(rows["t"]):
        return Even(_without_last(rows), (*notes, *note))
    made, more = _resampled(rows, input)
    return Even(made, (*notes, *note, *(more if grid is None else ())))


def unwrapped(x: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """A position without the jumps of an encoder that begins again: it, the turn, and the rows."""
    if not np.all(np.abs(x) < 2.0 ** (WIDEST + 1)):
        return x, 0.0, np.zeros(0, dtype=int)
    steps = np.diff(x)
    size = np.abs(steps)
    span = float(np.ptp(x)) if len(x) else 0.0
    if not span > 0.0:
        return x, 0.0, np.zeros(0, dtype=int)
    for turn in (*TURNS, *_powers(span)):
        jumps = np.abs(size - turn) < WRAP * turn
        on = steps - turn * np.where(jumps, np.sign(steps), 0.0)  # steps as they go on
        if jumps.any() and span <= turn * (1.0 + 1e-6) and _go_on(on, jumps, turn):
            return _along(x, steps - on), turn, np.flatnonzero(jumps) + 1
    return x, 0.0, np.zeros(0, dtype=int)


def unwrapped_where(x: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """As `unwrapped`, with NaN where a cell is missing."""
    there = np.flatnonzero(np.isfinite(x))
    out, (known, turn, at) = x.copy(), unwrapped(x[there])
    out[there] = known
    return out, turn, there[at]


def held_rows(x: np.ndarray) -> int:
    """Rows over which a column is held, where it changes only every so many; 1 for any other."""
    spans = np.diff(np.flatnonzero(np.diff(x)))
    if len(spans) < HELD_SPANS or (shortest := int(spans.min())) < 2:
        return 1
    whole = np.all(spans % shortest == 0) and np.mean(spans == shortest) > 0.5
    return shortest if whole else 1


def _along(x: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """A column less its jumps."""
    return x - np.concatenate(([0.0], np.cumsum(jumps)))


def _go_on(steps: np.ndarray, at: np.ndarray, turn: float) -> bool:
    """Whether steps are small, and those at some places like those around."""
    wide = np.pad(np.where(at, np.nan, steps), 3, constant_values=np.nan)
    around = np.stack([wide[i : i + len(steps)] for i in range(7)])[:, at]
    if np.abs(steps).max() > INSIDE * turn or np.isnan(around).all(axis=0).any():
        return False
    low, high = np.nanmin(around, axis=0), np.nanmax(around, axis=0)
    room = 0.5 * (high - low) + 0.1 * np.maximum(np.abs(low), np.abs(high)) + SLACK * turn
    return bool(np.all((steps[at] >= low - room) & (steps[at] <= high + room)))


def _powers(span: float) -> list[float]:
    """The power of two at which a counter with this span can begin again."""
    n = math.ceil(math.log2(span)) if span > 1.0 else 0
    return [2.0**n] if n >= 8 else []


# ---- rows


def _unwrapped_clock(t: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Times of a counter that begins again."""
    stamps = Stamps(t)
    if not len(stamps.backward) or not stamps.step > 0.0:
        return t, []
    for modulus in (m * tick for m in MODULI for tick in TICKS):
        if modulus > LEAST_MODULUS * stamps.step and _wraps(stamps, modulus):
            turns = np.zeros(len(t))
            turns[stamps.backward] = modulus
            words = f"the clock begins again after {modulus:.8g} s, at row {stamps.backward[0] + 1}"
            return t + np.cumsum(turns), [f"{words}: unwrapped"]
    return t, []


def _wraps(stamps: Stamps, modulus: float) -> bool:
    """Whether stamps that go back go on by a step as others, had they a modulus.

    Some rows may be missing there, but not where the clock begins with the first stamp again, as
    that of another run does, or where steps are uneven and nearly any would be as others.
    """
    ahead = stamps.steps[(stamps.steps > 0.0) & (stamps.steps <= stamps.longest)]
    spread = float(np.max(np.abs(ahead - stamps.step)))
    across = stamps.steps[stamps.backward - 1] + modulus
    count = np.round(across / stamps.step)
    restarts = stamps.t[stamps.backward] == stamps.t[0]
    most = np.where(restarts | (spread > EVEN * stamps.step), 1.0, MOST_ACROSS)
    near = np.where(restarts, spread + 1e-6 * stamps.step, max(spread, EVEN * stamps.step))
    on = np.abs(across - count * stamps.step) <= near
    return bool(np.all(on & (count >= 1.0) & (count <= most)))


def begins_again(t: np.ndarray) -> bool:
    """Whether the time goes back for long, and is no counter that begins again."""
    try:
        _in_order({"t": _unwrapped_clock(t)[0]})
    except Restarted:
        return True
    return False


class Restarted(ParameterError):
    """The time goes back for long.

    Args:
        field: name for the error.
        value: the time.
        bound: what is accepted, in words.
    """

    def told_apart_by(self, where: str) -> ParameterError:
        """The same error with the rows to choose, as "episode=0"; with "" as it is."""
        hint = f" read one of them by where (--where {shlex.quote(where)})" if where else ""
        return ParameterError(self.field, self.value, self.bound + hint)


def _in_order(rows: Columns) -> tuple[Columns, list[str]]:
    """Rows in the order of their stamps, each once."""
    notes = []
    stamps = Stamps(rows["t"])
    if len(back := stamps.backward):
        far = float(-np.min(stamps.steps))
        if len(back) > DISORDER[0] * len(stamps.t) or far > DISORDER[1] * stamps.step:
            row = int(back[0])
            bound = (
                f"must ascend; it goes back by {-stamps.steps[row - 1]:.6g} s at row {row + 1}: "
                "two logs in one file?"
            )
            raise Restarted(f"t[{row}]", float(stamps.t[row]), bound)
        notes.append(f"rows that came out of order are sorted by their stamps: {len(back)}")
        order = np.argsort(stamps.t, kind="stable")
        rows = {key: x[order] for key, x in rows.items()}
    same = np.ones(len(rows["t"]), dtype=bool)
    same[0:1] = False
    for x in rows.values():
        same[1:] &= x[1:] == x[:-1]
    if same.any():
        notes.append(f"rows that repeat the row before are left out: {np.count_nonzero(same)}")
        rows = {key: x[~same] for key, x in rows.items()}
    return rows, notes


def _without_last(rows: Columns) -> Columns:
    """The rows without a last one after a shorter step: a run ends between two samples."""
    steps = np.diff(rows["t"])
    if len(steps) > 1 and 0.0 < steps[-1] < (1.0 - EVEN) * float(np.median(steps)):
        return {key: x[:-1] for key, x in rows.items()}
    return rows


def _is_even(t: np.ndarray) -> bool:
    """Whether all steps, but perhaps a shorter last one, are within 5 % of their mean."""
    t = _without_last({"t": t})["t"]
    mean = (t[-1] - t[0]) / (len(t) - 1)
    return bool(np.all(np.abs(np.diff(t) / mean - 1.0) <= EVEN))


# ---- grids


def _on_grid(stamps: Stamps, x: np.ndarray) -> np.ndarray | None:
    """Times of an even grid on which the rows lie, some perhaps missing; None if they lie on none.

    Rounding alone, or 5 % of a step, parts them from it. Where a lost row and the rounding of a
    slower clock explain the same stamps, the position x decides.
    """
    by_row, by_step = _even_grid(stamps), _grid_with_gaps(stamps)
    if by_row is None or by_step is None or by_step[1][-1] == len(stamps.t) - 1:
        return by_row if by_row is not None else by_step and by_step[0]
    return by_step[0] if _rows_are_lost(by_step[1], x) else by_row


def _even_grid(stamps: Stamps) -> np.ndarray | None:
    """Times of rows of which none is missing, whose stamps are rounded; None for other stamps."""
    t, n, tick = stamps.t, np.arange(len(stamps.t), dtype=float), 1.01 * stamps.rounding
    if tick > TICK * stamps.duration:
        return None
    step, start = np.polyfit(n, t, 1)
    off = np.max(np.abs(t - start - step * n)), np.max(np.abs(stamps.steps - step))
    return start + step * n if max(off) <= tick else None


def _grid_with_gaps(stamps: Stamps) -> tuple[np.ndarray, np.ndarray] | None:
    """Times of rows of which some may be missing, and their numbers; None if they lie on none."""
    t, tick = stamps.t, 1.01 * stamps.rounding
    k = np.concatenate(([0.0], np.cumsum(np.round(stamps.steps / stamps.step))))
    step, start = np.polyfit(k, t, 1)
    whole = np.all(np.diff(k) > 0.0)
    off = np.max(np.abs(t - start - step * k))
    near = off <= max(min(tick, 0.5 * step), EVEN * step)
    return (start + step * k, k) if whole and near else None


def _rows_are_lost(k: np.ndarray, x: np.ndarray) -> bool:
    """Whether rows are missing where their numbers k jump; else their clock is slower than k.

    By the cubics around the jumps that the position x follows better; where noise hides it, by how
    many jumps there are and whether they come evenly, as those of a slower clock do.
    """
    at = np.flatnonzero(np.diff(k) > 1.0)
    evidence = max((_evidence(at, k, x, side) for side in SIDES), key=abs)
    if abs(evidence) > SURE:
        return evidence > 0.0
    spacing = np.diff(at)
    comes_evenly = len(at) > 2 and np.ptp(spacing) <= 1
    return len(at) <= LOST * len(k) and not comes_evenly


def _evidence(at: np.ndarray, k: np.ndarray, x: np.ndarray, side: int) -> float:
    """Logarithm of how much likelier a position is with missing rows than without."""
    n, values = np.arange(len(k), dtype=float), []
    for i in at[(at >= side - 1) & (at < len(k) - side)].tolist():
        rows = slice(i + 1 - side, i + 1 + side)
        values.append([_off_cubic(times[rows], x[rows]) for times in (n, k)])
    if not values:
        return 0.0
    without, with_gaps = np.sum(values, axis=0) + 1e-300
    return 0.5 * len(values) * (2 * side - 4) * math.log(without / with_gaps)


def _off_cubic(t: np.ndarray, x: np.ndarray) -> float:
    """Sum of squares of what a cubic leaves of some rows."""
    powers = np.vander((t - t[0]) / (t[-1] - t[0]), 4)
    return float(np.sum((x - powers @ matrices.least_squares(powers, x)) ** 2))


def _stamped_late(rows: Columns) -> bool:
    """Whether rows were sampled evenly and stamped later.

    Their stamps then come in bunches, and the position is not smoother over them, or else it is
    smoother over the number of the row.
    """
    x, stamps = rows["output"], Stamps(rows["t"])
    n = np.arange(float(len(x)))
    if len(x) < LEAST_JUDGED or np.ptp(stamps.t - np.polyval(np.polyfit(n, stamps.t, 1), n)) > (
        LATE * stamps.step
    ):
        return False
    in_bunches = np.mean(stamps.steps < BUNCH[0] * stamps.step) > BUNCH[1]
    if len(stamps.repeats):
        return bool(in_bunches)
    by_stamp, by_row = (_roughness(x, s) for s in (stamps.t, n))
    if in_bunches:  # of which each row is a reading at another time, or all are of one time
        return by_stamp >= SMOOTHER * by_row
    return by_row < SMOOTHER * by_stamp


def _roughness(x: np.ndarray, t: np.ndarray) -> float:
    """Deviation of rows from the cubic through two neighbours on each side."""
    at = t[2:-2]
    around = np.stack([t[i : len(t) - 4 + i] for i in (0, 1, 3, 4)])
    values = np.stack([x[i : len(x) - 4 + i] for i in (0, 1, 3, 4)])
    guess = np.zeros_like(at)
    for i in range(4):
        others = [j for j in range(4) if j != i]
        weight = np.prod([(at - around[j]) / (around[i] - around[j]) for j in others], axis=0)
        guess += weight * values[i]
    return robust_deviation(x[2:-2] - guess)


def _longest_part(rows: Columns, stamps: Stamps) -> tuple[Columns, list[str]]:
    """All rows if their gaps are few and short, else those between two long gaps."""
    lengths = np.round(stamps.steps / stamps.step) - 1.0
    gaps = stamps.gaps
    if not len(gaps):
        return rows, []
    t = stamps.t
    missing = int(np.sum(lengths[gaps]))
    share = missing / (missing + len(t))
    where = f"{len(gaps)} gap{'s' * (len(gaps) > 1)}, at t = {times(t[gaps])} s"
    told = f"{missing} row{'s are' if missing > 1 else ' is'} missing in {where}"
    if np.max(lengths) <= BRIDGED and share <= LOST:
        return rows, [f"{told}: bridged by cubics"]
    ends = gaps[lengths[gaps] > (BRIDGED if share <= LOST else 1.0)]
    if not len(ends):
        return rows, [f"{told}: bridged by cubics"]
    edges = np.concatenate(([0], ends + 1, [len(t)]))
    i = int(np.argmax(np.diff(edges)))
    part = slice(int(edges[i]), int(edges[i + 1]))
    kept = {key: x[part] for key, x in rows.items()}
    words = f"{told}: the longest part without is used, {part.stop - part.start} of {len(t)} rows"
    return kept, [words]


def _resampled(rows: Columns, input: Between) -> tuple[Columns, list[str]]:
    """Columns at even times, by cubic splines; an input that is held or jumps in its own way."""
    from scipy.interpolate import CubicSpline

    stamped, held = rows["t"], rows.get("input")
    rows, notes = _one_each(rows)
    t = rows["t"]
    stamps = Stamps(t)
    if len(t) < 4:
        return rows, notes
    step = float(np.mean(stamps.steps[stamps.steps <= stamps.longest]))
    count = math.floor((t[-1] - t[0]) / step + 1e-9) + 1
    even = t[0] + step * np.arange(count)
    even[-1] = min(even[-1], t[-1])
    made = {"t": t[0] + step * np.arange(count)}
    for key, x in rows.items():
        if key == "input" and input == "hold" and held is not None:
            made[key] = _held(stamped, held, even, step)
        elif key == "input" and input == "linear":
            made[key] = np.interp(even, t, x)
        elif key != "t":
            made[key] = CubicSpline(t, x)(even)
    way = {"spline": "cubic splines", "linear": "cubic splines, the force linearly"}
    way["hold"] = "cubic splines, the held input by its means"
    share = 100.0 * (1.0 - stamps.even)
    notes.append(
        f"{share:.3g} % of the steps differ from the usual one by more than 5 %: resampled by "
        f"{way[input]} onto {1.0 / step:.6g} Hz"
    )
    return made, notes


def _one_each(rows: Columns) -> tuple[Columns, list[str]]:
    """Rows that lie apart: a spline through noise would swing where they do not."""
    stamps = Stamps(rows["t"])
    apart = np.concatenate(([True], stamps.steps >= CLOSE * stamps.step))
    if apart.all():
        return rows, []
    place = np.cumsum(apart) - 1
    count = np.bincount(place)
    note = f"rows within a quarter of a step of another are averaged: {np.count_nonzero(~apart)}"
    return {key: np.bincount(place, x) / count for key, x in rows.items()}, [note]


def _held(t: np.ndarray, x: np.ndarray, even: np.ndarray, step: float) -> np.ndarray:
    """Values that, held over even steps, act as an input held from stamp to stamp.

    The means over the steps, sharpened: to be averaged and held again multiplies a frequency by
    sinc(f step)^2, of which 1 - d^2/12, with d^2 the second difference, is the inverse to fourth
    order.
    """
    edges = np.append(even, even[-1] + step)
    total = np.concatenate(([0.0], np.cumsum(x[:-1] * np.diff(t))))
    at = np.interp(edges, t, total) + x[-1] * np.maximum(edges - t[-1], 0.0)
    means = np.diff(at) / step
    wide = np.concatenate((means[:1], means, means[-1:]))
    return means - np.diff(wide, 2) / 12.0


def wrap_note(turn: float, rows: Sequence[int] | np.ndarray, t: np.ndarray) -> str:
    """What is said of a position that was unwrapped."""
    return (
        f"the position begins again after {turn:.6g}, {len(rows)} times, first at "
        f"t = {times(t[rows])} s: unwrapped"
    )
