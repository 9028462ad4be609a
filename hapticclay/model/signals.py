"""Signals that drive a run: multisines, their values and their exact means."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..errors import Bound, ParameterError, check_fields, integer

MOST_LINES = 100_000


def multisine_line(omega: Any, phase: Any, t: Any, h: Any) -> Any:
    """Mean of cos(omega t + phase) over [t - h, t + h]. Numbers, or arrays of one shape.

    Args:
        omega: angular frequency [rad/s].
        phase: at t = 0 [rad].
        t: centre of the interval [s].
        h: half its length [s].

    Returns:
        The mean; the value at t for h = 0.
    """
    return np.sinc(omega * h / np.pi) * np.cos(omega * t + phase)


def mean_of_lines(lines, t, h):
    """Mean of a multisine over [t - h, t + h], line by line; zero without lines.

    Args:
        lines: from `Signal.lines`.
        t: centre of the interval [s].
        h: half its length [s].

    Returns:
        (x, y).
    """
    x, y = 0.0, 0.0
    for j in range(len(lines)):
        a = lines[j, 0] * h
        share = math.sin(a) / a if a else 1.0
        x += lines[j, 3] * (share * math.cos(lines[j, 0] * t + lines[j, 1]))
        y += lines[j, 4] * (share * math.cos(lines[j, 0] * t + lines[j, 2]))
    return x, y


class Signal:
    """A multisine in a form ready for evaluation.

    Args:
        multisine: the signal.

    Attributes:
        omega: angular frequency of each line [rad/s], shape (n,).
        phase: of each line on each axis [rad], shape (n, 2).
        amplitude: of each line on each axis, shape (2,).
    """

    def __init__(self, multisine: Multisine):
        m = multisine
        k = np.arange(np.ceil(m.low * m.period - 1e-9), np.floor(m.high * m.period + 1e-9) + 1.0)
        if m.lines is not None:
            want = np.geomspace(k[0], k[-1], m.lines)
            k = k[np.unique(np.abs(k[:, None] - want).argmin(axis=0))]
        self.omega = 2.0 * np.pi * k / m.period
        self.phase = np.random.default_rng(m.seed).uniform(0.0, 2.0 * np.pi, (len(k), 2))
        self.amplitude = np.array(m.rms) * np.sqrt(2.0 / len(k))

    @property
    def lines(self) -> np.ndarray:
        """One row a line: omega [rad/s], phase x, y [rad], amplitude x, y; shape (n, 5)."""
        amplitude = np.tile(self.amplitude, (len(self.omega), 1))
        return np.column_stack((self.omega, self.phase, amplitude))

    def mean(self, t: Any, h: Any) -> np.ndarray:
        """Mean over [t - h, t + h]; the value at t for h = 0.

        Args:
            t: centre of the interval [s], a number or shape (n,).
            h: half its length [s], a number or shape (n,).

        Returns:
            Shape (2,) or (n, 2).
        """
        t, h = np.asarray(t)[..., None], np.asarray(h)[..., None]
        lines = (multisine_line(self.omega, self.phase[:, i], t, h).sum(-1) for i in (0, 1))
        return np.stack([x * self.amplitude[i] for i, x in enumerate(lines)], -1)

    def __call__(self, t: Any) -> np.ndarray:
        """Value at a time.

        Args:
            t: time [s], a number or shape (n,).

        Returns:
            Shape (2,) or (n, 2).
        """
        return self.mean(t, 0.0)


@dataclass(frozen=True)
class Multisine:
    """A periodic signal: cosines of random phases at multiples of 1/period between low and high.

    All lines have one amplitude; the phases follow from the seed (Pintelon, Schoukens, System
    Identification, 2012, sec. 2.3).

    Attributes:
        rms: root mean square on each axis, in the unit of what the signal adds to, 0 to 1e6.
        low: lower end of the band [Hz], > 0.
        high: upper end of the band [Hz], low to 1e6.
        period: period of the signal [s], 1e-3 to 1e5.
        lines: number of lines, spread evenly over the logarithm of frequency; None for every
            multiple of 1/period.
        seed: seed of the phases, 0 to 2^32 - 1.
    """

    rms: Annotated[tuple[float, float], Bound(0.0, 1e6)] = (1.0, 0.0)
    low: Annotated[float, Bound(0.0, unit="Hz", above=True)] = 0.1
    high: Annotated[float, Bound("low", 1e6, "Hz")] = 2.0
    period: Annotated[float, Bound(1e-3, 1e5, "s")] = 20.0
    lines: Annotated[int | None, Bound(1, MOST_LINES)] = None
    seed: Annotated[int, Bound(0, 2**32 - 1)] = 0

    def __post_init__(self):
        check_fields(self, "multisine.")
        first = math.ceil(self.low * self.period - 1e-9)
        most = math.floor(self.high * self.period + 1e-9) - first + 1
        if not 1 <= most <= MOST_LINES:
            bound = (
                f"the band must hold 1 to {MOST_LINES} multiples of "
                f"1/period = {1.0 / self.period:g} Hz, not {most}"
            )
            raise ParameterError("multisine.high", self.high, bound)
        if self.lines is not None:
            integer("multisine.lines", self.lines, 1, most)
