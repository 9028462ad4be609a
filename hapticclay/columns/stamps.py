"""Stamps of time: rate, jitter, gaps, stamps that repeat or go back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

EVEN = 0.05  # largest deviation of a step from the usual one, as a share, that counts as even
GAP = 1.5  # usual steps that a gap is longer than
DIGITS = range(12)  # decimal places of stamps that are rounded


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
        """Rows in a second [Hz]; of a log without gaps."""
        return 1.0 / self.step

    @property
    def even(self) -> float:
        """Share of the steps that lie within 5 % of the usual one."""
        off = np.abs(self.steps / self.step - 1.0)
        return float(np.mean(off <= EVEN)) if len(off) else 1.0

    @property
    def jitter(self) -> float:
        """Standard deviation of the steps, without gaps [s]."""
        usual = self.steps[np.abs(self.steps) <= GAP * self.step]
        return float(np.std(usual)) if len(usual) else 0.0

    @cached_property
    def gaps(self) -> np.ndarray:
        """Numbers of the rows before a gap, (m,)."""
        return np.flatnonzero(self.steps > GAP * self.step)

    @cached_property
    def repeats(self) -> np.ndarray:
        """Numbers of the rows whose stamp is that of the row before, (m,)."""
        return np.flatnonzero(self.steps == 0.0) + 1

    @cached_property
    def backward(self) -> np.ndarray:
        """Numbers of the rows whose stamp is before that of the row before, (m,)."""
        return np.flatnonzero(self.steps < 0.0) + 1

    @property
    def rounding(self) -> float:
        """Decimal place to which all stamps are rounded [s]; 0 for none."""
        for digits in DIGITS:
            scaled = self.t * 10.0**digits
            if np.all(np.abs(scaled - np.round(scaled)) < 1e-4):
                return 10.0**-digits
        return 0.0
