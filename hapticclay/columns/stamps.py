"""Stamps of time: rate, jitter, gaps, stamps that repeat or go back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .log import Log

EVEN = 0.05  # largest deviation of a step from the usual one, as a share, that counts as even
GAP, FAR = 1.5, 5.0  # a gap is longer than so many usual steps, and deviations of the steps
LEAST_BURSTS = 10  # by which it is known that rows come in bursts ...
ALIKE = 0.9  # ... if such a share has one size, ...
PAUSE = 0.5  # ... and a burst takes a smaller share of the time from one to the next
NORMAL = 1.4826  # standard deviation of normal noise over its median absolute value
DATES = 9.4e8, 4.2e9  # [s] since 1970, of the years 2000 to 2100
TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # of clocks that count since 1970
DIGITS = range(12)  # decimal places of stamps that are rounded


def times_of(log: Log, name: str, holes: bool = False) -> tuple[np.ndarray, list[str]]:
    """A column of time [s], dates from the first one on; and what was done, one sentence each."""
    place = log.place(name)
    size, powers = log.size(place, ("s",))
    raw = log.table.numbers(place, holes)
    start = next(iter(raw[np.isfinite(raw)].tolist()), math.nan)
    for unit, tick in TICKS.items():
        tick = tick if powers is None else size
        if DATES[0] <= start * tick <= DATES[1]:
            stated = "" if powers is not None else f" in {unit}"
            return tick * (raw - start), [f"{name} counts{stated} since 1970: taken from its start"]
    return size * raw if size != 1.0 else raw, []


@dataclass(frozen=True)
class Stamps:
    """Times of the rows of a log.

    Attributes:
        t: times [s], (n,), as they are in the file.
    """

    t: np.ndarray

    @cached_property
    def steps(self) -> np.ndarray:
        """From stamp to stamp [s], (n - 1,)."""
        return np.diff(self.t)

    @cached_property
    def step(self) -> float:
        """The usual step [s]: the median of those that go ahead, of bursts their mean; else NaN."""
        return self._burst_step or self._median_step

    @cached_property
    def _median_step(self) -> float:
        ahead = self.steps[self.steps > 0.0]
        return float(np.median(ahead)) if len(ahead) else float("nan")

    @cached_property
    def burst(self) -> int:
        """Rows that come at once, where they come in bursts of one size; else 1."""
        starts = np.concatenate(([0], np.flatnonzero(self.steps > self._longest_step) + 1))
        sizes = np.diff(starts)
        if len(sizes) < LEAST_BURSTS:
            return 1
        size = int(np.median(sizes))
        period = float(np.median(np.diff(self.t[starts])))
        alike = np.mean(sizes == size) >= ALIKE
        return size if alike and size * self._median_step < PAUSE * period else 1

    @cached_property
    def _burst_step(self) -> float:
        """Mean step of rows in bursts [s]; 0 where they do not come so."""
        if self.burst == 1:
            return 0.0
        starts = np.flatnonzero(self.steps > self._longest_step) + 1
        return float(np.median(np.diff(self.t[starts]))) / self.burst

    @property
    def duration(self) -> float:
        """From the first to the last stamp [s]."""
        return float(self.t[-1] - self.t[0]) if len(self.t) else 0.0

    @property
    def rate(self) -> float:
        """Rows in a second, between gaps [Hz]."""
        if self.burst > 1:
            return 1.0 / self.step
        usual = self.steps[(self.steps >= 0.0) & (self.steps <= self.longest)]
        mean = float(np.mean(usual)) if len(usual) else 0.0
        return 1.0 / mean if mean > 0.0 else 1.0 / self.step

    @property
    def even(self) -> float:
        """Share of the steps that lie within 5 % of the usual one."""
        off = np.abs(self.steps / self.step - 1.0)
        return float(np.mean(off <= EVEN)) if len(off) else 1.0

    @property
    def jitter(self) -> float:
        """Standard deviation of the steps, without gaps [s]."""
        usual = self.steps[np.abs(self.steps) <= self.longest]
        return float(np.std(usual)) if len(usual) else 0.0

    @cached_property
    def gaps(self) -> np.ndarray:
        """Numbers of the rows before a gap, (m,)."""
        return np.flatnonzero(self.steps > self.longest)

    @cached_property
    def longest(self) -> float:
        """The longest step that is no gap [s]."""
        return GAP * self.burst * self.step if self.burst > 1 else self._longest_step

    @cached_property
    def _longest_step(self) -> float:
        ahead, step = self.steps[self.steps > 0.0], self._median_step
        usual = NORMAL * float(np.median(np.abs(ahead - step))) if len(ahead) else 0.0
        return max(GAP * step, step + FAR * usual)

    @cached_property
    def repeats(self) -> np.ndarray:
        """Numbers of the rows whose stamp is that of the row before, (m,)."""
        return np.flatnonzero(self.steps == 0.0) + 1

    @cached_property
    def backward(self) -> np.ndarray:
        """Numbers of the rows whose stamp is before that of the row before, (m,)."""
        return np.flatnonzero(self.steps < 0.0) + 1

    @cached_property
    def rounding(self) -> float:
        """Tick of a clock whose stamps repeat, or decimal place of all stamps [s]; 0 for none."""
        ahead = self.steps[self.steps > 0.0]
        if len(self.repeats) and len(ahead):
            ticks = ahead / ahead.min()
            if np.all(np.abs(ticks - np.round(ticks)) < 0.02 * ticks):
                return float(ahead.min())
        for digits in DIGITS:
            scaled = self.t * 10.0**digits
            if np.all(np.abs(scaled - np.round(scaled)) < 1e-4):
                return 10.0**-digits
        return 0.0
