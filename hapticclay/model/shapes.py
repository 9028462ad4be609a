"""Signals of a given shape: constant, step, ramp, pulses, chirp."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from ..arguments import part
from ..errors import Bound, Real, number
from . import pieces
from .signals import Signal

Size = Annotated[tuple[float, float], Bound(-1e6, 1e6)]
Moment = Annotated[Real, Bound(0.0, 1e5, "s")]
BEFORE = 1.0  # [s] lead of the piece before the first break; any number works


@part("constant.")
class Constant(Signal):
    """A constant signal.

    Attributes:
        value: on each axis, -1e6 to 1e6.
    """

    value: Size

    @property
    def varies(self) -> bool:
        return False

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        return pieces.straight_pieces([0.0], [self.value])


@part("step.")
class Step(Signal):
    """Zero, then constant.

    Attributes:
        value: from `time` on, on each axis, -1e6 to 1e6.
        time: of the jump [s], 0 to 1e5.
    """

    value: Size
    time: Moment

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        return pieces.straight_pieces([self.time - BEFORE, self.time], [(0.0, 0.0), self.value])


@part("ramp.")
class Ramp(Signal):
    """Zero, then growing evenly, then constant.

    Attributes:
        rate: on each axis, a second, -1e6 to 1e6.
        start: when it begins to grow [s], 0 to 1e5.
        end: when it stops growing [s], > start, at most 1e5; None for never.
    """

    rate: Size
    start: Moment
    end: Annotated[Real | None, Bound("start", 1e5, "s", above=True)] = None

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        start, none = [self.start - BEFORE, self.start], (0.0, 0.0)
        if self.end is None:
            return pieces.straight_pieces(start, [none, none], [none, self.rate])
        held = [(self.end - self.start) * x for x in self.rate]
        return pieces.straight_pieces(
            [*start, self.end], [none, none, held], [none, self.rate, none]
        )


@part("pulse.")
class Pulse(Signal):
    """A rectangular pulse, or a train of them.

    Attributes:
        value: within a pulse, on each axis, -1e6 to 1e6.
        start: of the first pulse [s], 0 to 1e5.
        width: of a pulse [s], > 0, at most 1e5.
        period: from pulse to pulse [s], > width, 1e-3 to 1e5; None for a single one.
    """

    value: Size
    start: Moment
    width: Annotated[Real, Bound(0.0, 1e5, "s", above=True)]
    period: Annotated[Real | None, Bound(1e-3, 1e5, "s")] = None

    def __post_init__(self):
        if self.period is not None:
            number("pulse.period", self.period, self.width, above=True, unit="s")

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        k = np.zeros(1)
        if self.period is not None:
            first, last = ((x - self.start) / self.period for x in (begin, end))
            k = np.arange(max(math.floor(first), 0.0), max(math.floor(last), 0.0) + 1.0)
        on = self.start + k * (self.period or 0.0)
        start = np.column_stack((on, on + self.width)).ravel()
        values = np.tile([self.value, (0.0, 0.0)], (len(k), 1))
        values = np.concatenate((np.zeros((1, 2)), values))
        return pieces.straight_pieces(np.append(start[0] - 1e-3 * BEFORE, start), values)

    def _means(self, t: np.ndarray, h: np.ndarray) -> np.ndarray:
        if self.period is None:
            return super()._means(t, h)
        # a train has too many pieces over long intervals: whole periods are counted
        begin, span = t - h - self.start, 2.0 * h
        late = np.maximum(-begin, 0.0)  # part of the interval before the first pulse
        begin, span = np.maximum(begin, 0.0), np.maximum(span - late, 0.0)
        begin -= np.floor(begin / self.period) * self.period
        end = begin + span
        inside = (end <= self.width) & (t >= self.start)
        within = [
            np.floor(x / self.period) * self.width
            + np.minimum(x - np.floor(x / self.period) * self.period, self.width)
            for x in (begin, end)
        ]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = (within[1] - within[0]) / (2.0 * h)
        share = np.where(h > 0.0, share, (begin < self.width) & (t >= self.start))
        share = np.where(inside & (late == 0.0) & (h > 0.0), 1.0, share)
        return share[:, None] * np.array(self.value)


@part("chirp.")
class Chirp(Signal):
    """A sine whose frequency goes from low to high; zero before and after.

    amplitude sin(phase + 2 pi integral of the frequency); at phase 0 it begins without a jump.

    Attributes:
        amplitude: on each axis, -1e6 to 1e6.
        low: frequency at its start [Hz], > 0, at most 1e6.
        high: frequency at its end [Hz], low to 1e6.
        duration: [s], > 0, at most 1e5.
        phase: at its start [rad].
        log: whether the logarithm of the frequency grows evenly; else the frequency does.
        start: when it begins [s], 0 to 1e5.
    """

    amplitude: Size
    low: Annotated[Real, Bound(0.0, 1e6, "Hz", above=True)]
    high: Annotated[Real, Bound("low", 1e6, "Hz")]
    duration: Annotated[Real, Bound(0.0, 1e5, "s", above=True)]
    phase: Annotated[Real, Bound(-1e6, 1e6, "rad")] = 0.0
    log: bool = False
    start: Moment = 0.0

    def _wave(self, t: np.ndarray) -> np.ndarray:
        """The sine, without its ends."""
        x, ratio = (t - self.start) / self.duration, math.log(self.high / self.low)
        if self.log and ratio > 0.0:
            cycles = self.low * np.expm1(ratio * x) / ratio
        else:
            cycles = (self.low + 0.5 * (self.high - self.low) * x) * x
        wave = np.sin(2.0 * np.pi * self.duration * cycles + self.phase)
        return wave[:, None] * np.array(self.amplitude)

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        stop, rows = self.start + self.duration, []
        low, high = max(begin, self.start), min(end, stop)
        if begin < self.start or high <= low:
            rows.append(pieces.straight_pieces([self.start - BEFORE], [(0.0, 0.0)]))
        if low < high:
            edges = np.unique(pieces.cell_edges(low, high, 0.5 * step).clip(self.start, stop))
            rows.append(pieces.interpolate(self._wave, edges))
        if low < high == stop:
            rows.append(pieces.straight_pieces([stop], [(0.0, 0.0)]))
        return np.concatenate(rows)

    def breaks(self, begin: float, end: float) -> np.ndarray:
        return np.array([self.start, self.start + self.duration])

    def _means(self, t: np.ndarray, h: np.ndarray) -> np.ndarray:
        stop = self.start + self.duration
        out = np.where(
            ((t >= self.start) & (t < stop))[:, None], self._wave(t.clip(0.0, stop)), 0.0
        )
        begin, end = ((t + s * h).clip(self.start, stop) for s in (-1.0, 1.0))
        (wide,) = np.nonzero(h > 0.0)
        begin, end = begin[wide], end[wide]
        # at most half an oscillation a panel: Gauss's error is below rounding
        panels = 1 + np.floor(2.0 * self.high * (end - begin)).astype(int)
        out[wide] = pieces.integrals(self._wave, begin, end, panels) / (2.0 * h[wide])[:, None]
        return out
