"""Stamps of time: rate, jitter, gaps, stamps that repeat or go back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .log import Log

EVEN = 0.05  # largest deviation of a step from the usual one, as a share, that counts as even
GAP, FAR = 1.5, 5.0  # a gap is longer than so many usual steps, and deviations of the steps
NORMAL = 1.4826  # standard deviation of normal noise over its median absolute value
DATES = 9.4e8, 4.2e9  # [s] since 1970, of the years 2000 to 2100
TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # of clocks that count since 1970
DIGITS = range(12)  # decimal places of stamps that are rounded


def times_of(log: Log, name: str) -> tuple[np.ndarray, list[str]]:
    """A column of time [s], dates from the first one on; and what was done, one sentence each."""
    place = log.place(name)
    size, powers = log.size(place, ("s",))
    raw = log.table.numbers(place)
    for unit, tick in TICKS.items() if len(raw) else ():
        tick = tick if powers is None else size
        if DATES[0] <= raw[0] * tick <= DATES[1]:
            stated = "" if powers is not None else f" in {unit}"
            return tick * (raw - raw[0]), [
                f"{name} counts{stated} since 1970: taken from its start"
            ]
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
        """The usual step [s]: the median of those that go ahead; NaN without any."""
        ahead = self.steps[self.steps > 0.0]
        return float(np.median(ahead)) if len(ahead) else float("nan")

    @property
    def duration(self) -> float:
        """From the first to the last stamp [s]."""
        return float(self.t[-1] - self.t[0]) if len(self.t) else 0.0

    @property
    def rate(self) -> float:
        """Rows in a second, between gaps [Hz]."""
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
        ahead = self.steps[self.steps > 0.0]
        usual = NORMAL * float(np.median(np.abs(ahead - self.step))) if len(ahead) else 0.0
        return max(GAP * self.step, self.step + FAR * usual)

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
