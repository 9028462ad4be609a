"""Prepares the signals of a run, the muscle force and the command, part by part."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..model import pieces
from ..model.signals import Signal
from ..scene.scenario import Scenario
from . import methods

COSINES = 2**22  # cosines that are tabulated at once where a multisine drives the accurate method
NEAR = 1e-6  # of dt: a jump of a signal so close to the end of a step counts as at its end
AHEAD = 64  # steps that are prepared at once, at least: of one alone it takes longer than the step


class Drives:
    """The signals of a run, prepared part by part into the arrays of its row."""

    def __init__(self, scenario: Scenario):
        both = {"muscle": scenario.muscle, "command": scenario.command}
        self.signals = {
            name: Drive(signal, scenario.dt, name == "command")
            for name, signal in both.items()
            if signal is not None and signal.varies
        }
        self._arrays: Any = None  # of the row in which steps are prepared ...
        self._first, self._end = 0, 0  # ... and which steps

    def prepare(self, row: Any, n: int) -> int:
        """Prepares the signals over the next whole steps; returns how many."""
        i = row.s.i
        if row.arrays is self._arrays and self._first <= i and i + n <= self._end:
            return n
        self._end = 0  # none, where this is interrupted
        made = self._prepared(row, n)
        self._arrays, self._first, self._end = row.arrays, i, i + made
        return min(n, made)

    def _prepared(self, row: Any, n: int) -> int:
        """Prepares at least n steps, or as many as may be at once; returns how many."""
        m, i, dt, tables = row.m, row.s.i, row.m.dt, self.signals.values()
        if m.method == methods.ACCURATE:
            counts = row.substeps(i)
            cosines = max(1, *(x.cosines for x in tables))
            n = min(n, max(1, COSINES // (2 * counts * cosines)))
        else:
            n = max(n, min(AHEAD, m.last - i + 1))
        begin, end = max(i - 1, 0) * dt, min((i + n + 2 + m.ratio) * dt, m.t_max)
        for drive in tables:
            drive.prepare(begin, end)
        if m.method == methods.ACCURATE:
            self._accurate(row, i, n, (begin, end))
        elif m.method == methods.SAMPLED:
            self._sampled(row, i, n)
        else:
            self._continuous(row, i, n)
        return n

    def _put(self, row: Any, name: str, i: int, **arrays: np.ndarray) -> None:
        """Puts a signal's table and arrays into a row; their first line is of sample i."""
        arrays["table"] = self.signals[name].table
        row.replace({f"{name}_{what}": x for what, x in arrays.items()})
        setattr(row.m, f"{name}_first", i)

    def _continuous(self, row: Any, i: int, n: int) -> None:
        t, dt = (i + np.arange(n + 1)) * row.m.dt, row.m.dt
        for name, x in self.signals.items():
            if name == "muscle":
                self._put(row, name, i, ahead=x.mean(t[:n], 0.5 * dt))
            else:
                self._put(row, name, i, ahead=np.diff(x.around(t, 0.5 * dt), axis=0))

    def _sampled(self, row: Any, i: int, n: int) -> None:
        dt = row.m.dt
        t = (i + np.arange(n)) * dt
        for name, x in self.signals.items():
            if name == "muscle":
                early, late = x.mean(t - 0.25 * dt, 0.25 * dt), x.mean(t + 0.25 * dt, 0.25 * dt)
                halves = np.column_stack((early, late, x(t)))
                self._put(row, name, i, ahead=0.5 * (early + late), halves=halves)
            else:
                self._put(row, name, i, ahead=x(t + row.m.Ts) - x(t))

    def _accurate(self, row: Any, i: int, n: int, span: tuple[float, float]) -> None:
        m = row.m
        times = stage_times(row, m.dt, i, n)
        for name, x in self.signals.items():
            ahead = x(times) if name == "muscle" else x.since_start(times)
            self._put(row, name, i, ahead=ahead)
        breaks = np.unique(np.concatenate([x.breaks(*span) for x in self.signals.values()]))
        row.replace({"times": times, "breaks": np.append(breaks, math.inf)})
        m.times_count, m.breaks_count, m.slack = len(times), len(breaks) + 1, NEAR * m.dt


def stage_times(row: Any, dt: float, i: int, n: int) -> np.ndarray:
    """Starts and middles of the steps of the accurate method, and the end of the last [s]."""
    k, blocks = i + np.arange(n), []
    counts = np.array([row.substeps(j) for j in k.tolist()])
    for each in np.split(k, np.flatnonzero(np.diff(counts)) + 1):
        count = counts[each[0] - i]
        t, end = each * dt, (each + 1) * dt
        times = np.empty((len(each), 2 * count))
        for j in range(count):
            h = dt / count if j < count - 1 else end - t
            times[:, 2 * j], times[:, 2 * j + 1] = t, t + 0.5 * h
            t = t + h
        blocks.append(times.ravel())
    return np.append(np.concatenate(blocks), (i + n) * dt)


class Drive:
    """A signal, and its pieces over the next part of a run; `table`: both, see model.pieces.

    `from_start`: the pieces count from their value at t = 0.
    """

    def __init__(self, signal: Signal, dt: float, from_start: bool):
        self.signal, self.dt = signal, dt
        lines = signal.cosines
        self.cosines, self._lines = len(lines), lines
        self._slack, self._first = NEAR * dt, np.zeros(2)
        self._pieces = pieces.NO_PIECES
        self.table = pieces.loop_table(lines, self._pieces, self._slack)
        if from_start:
            self.prepare(0.0, dt)
            if len(self._pieces):
                now = np.zeros(1)
                self._first = pieces.pieces_value(self._pieces, now, now + self._slack)[0]

    def prepare(self, begin: float, end: float) -> None:
        """Makes the pieces of the next part of a run, and from them the table."""
        made = self.signal.pieces(begin, end, self.dt)
        if len(made):
            made = made.copy()
            made[:, [1, 5]] -= self._first
            self.table = pieces.loop_table(self._lines, made, self._slack)
        self._pieces = made

    def breaks(self, begin: float, end: float) -> np.ndarray:
        """Times in the prepared part at which a step must end: jumps, and kinks between samples."""
        t = self.signal.breaks(begin, end)
        t = t[(t > begin) & (t < end)]
        if not len(t):
            return t
        before, after = (
            pieces.pieces_value(self._pieces, t, t + s * self._slack) for s in (-1.0, 1.0)
        )
        jumps = np.abs(after - before).max(axis=1) > 1e-12 * np.abs(after + before).max(axis=1)
        off = np.abs(t / self.dt - np.rint(t / self.dt)) > NEAR
        return t[jumps | off]

    def mean(self, t: np.ndarray, h: float) -> np.ndarray:
        """Mean over [t - h, t + h]; for h = 0 the value from t on."""
        out = self.signal.mean_of_multisines(t, h)
        if len(self._pieces):
            if h == 0.0:
                return out + pieces.pieces_value(self._pieces, t, t + self._slack)
            return out + pieces.pieces_mean(self._pieces, t, np.full(len(t), h))
        return out

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Value from each time on."""
        return self.mean(t, 0.0)

    def around(self, t: np.ndarray, h: float) -> np.ndarray:
        """Value at times; of pieces the mean over h before and after, or less next to t = 0."""
        out = self.signal.mean_of_multisines(t, 0.0)
        if len(self._pieces):
            out = out + pieces.pieces_mean(self._pieces, t, np.minimum(h, t))
        return out

    def since_start(self, t: np.ndarray) -> Any:
        """Change since t = 0, of a drive that counts its pieces from there."""
        out = self.signal.mean_of_multisines(t, 0.0)
        out = out - self.signal.mean_of_multisines(np.zeros(1), 0.0)
        if len(self._pieces):
            out = out + pieces.pieces_value(self._pieces, t, t + self._slack)
        return out
