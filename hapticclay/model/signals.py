"""Signals that drive a run: multisines, their values and their exact means."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError, integer, number, pair


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

    def mean(self, begin: Any, end: Any) -> np.ndarray:
        """Mean over intervals; the value where an interval has no length.

        Args:
            begin: start [s], a number or shape (n,).
            end: end [s], as begin.

        Returns:
            Shape (2,) or (n, 2).
        """
        begin, end = np.asarray(begin), np.asarray(end)
        t, h = 0.5 * (begin + end)[..., None], 0.5 * (end - begin)[..., None]
        lines = (multisine_line(self.omega, self.phase[:, i], t, h).sum(-1) for i in (0, 1))
        return np.stack([x * self.amplitude[i] for i, x in enumerate(lines)], -1)

    def __call__(self, t: Any) -> np.ndarray:
        """Value at a time.

        Args:
            t: time [s], a number or shape (n,).

        Returns:
            Shape (2,) or (n, 2).
        """
        return self.mean(t, t)


@dataclass(frozen=True)
class Multisine:
    """A periodic signal of random phases: sum of cosines at multiples of 1/period between low and high.

    All lines have one amplitude; the phases follow from the seed (Pintelon, Schoukens, System Identification,
    2012, sec. 2.3).

    Attributes:
        rms: root mean square on each axis, in the unit of what the signal adds to.
        low, high: band [Hz]. period: [s].
        lines: number of lines, spread evenly over the logarithm of frequency; None for every multiple.
        seed: of the phases.
    """

    rms: tuple[float, float] = (1.0, 0.0)
    low: float = 0.1
    high: float = 2.0
    period: float = 20.0
    lines: int | None = None
    seed: int = 0

    def __post_init__(self):
        put = lambda field, value: object.__setattr__(self, field, value)  # noqa: E731
        put("rms", pair("multisine.rms", self.rms, 0.0, 1e6))
        put("period", number("multisine.period", self.period, 1e-3, 1e5, unit="s"))
        put("low", number("multisine.low", self.low, 0.0, above=True, unit="Hz"))
        put("high", number("multisine.high", self.high, self.low, 1e6, unit="Hz"))
        put("seed", integer("multisine.seed", self.seed, 0, 2**32 - 1))
        most = (
            math.floor(self.high * self.period + 1e-9)
            - math.ceil(self.low * self.period - 1e-9)
            + 1
        )
        if not 1 <= most <= 100_000:
            bound = f"the band must hold 1 to 100000 multiples of 1/period = {1.0 / self.period:g} Hz, not {most}"
            raise ParameterError("multisine.high", self.high, bound)
        if self.lines is not None:
            put("lines", integer("multisine.lines", self.lines, 1, most))
