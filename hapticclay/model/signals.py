"""Signals that drive a run: what every signal can do, sums and multiples, and multisines.

`shapes` has steps, ramps, pulses and chirps, `samples` measured and computed signals.
"""

from __future__ import annotations

import math
import numbers
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from ..arguments import part
from ..errors import Bound, ParameterError, Real, integer
from ..fields import Seed
from . import pieces
from .traits import LEFT_OUT, Trait

MOST_LINES = 100_000


def multisine_line(omega: Any, phase: Any, t: Any, h: Any) -> Any:
    """Mean of cos(omega t + phase) over [t - h, t + h], in rad/s, rad and s."""
    return np.sinc(omega * h / np.pi) * np.cos(omega * t + phase)


@dataclass(frozen=True)
class Signal(ABC):
    """A force or a displacement over time, (x, y): `a + b`, `a - b`, `2 * a`, `a(t)`.

    Where it jumps, its value is the one from the jump on. A run takes it as cosines and as pieces
    (`model.pieces`); a new kind of signal is a frozen dataclass that has `pieces`.
    """

    __array_ufunc__ = None  # so that NumPy's numbers leave the product to __rmul__

    @property
    def varies(self) -> bool:
        """Whether it changes with time."""
        return True

    @property
    def cosines(self) -> np.ndarray:
        """Its multisines: omega [rad/s], phase x, y [rad], amplitude x, y; shape (n, 5)."""
        return pieces.NO_LINES

    @abstractmethod
    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        """All of it but multisines, as cubics in time, shape (n, pieces.PIECE), or more of them.

        Args:
            begin: of the interval [s].
            end: of the interval [s]; what has no pieces of its own is not evaluated beyond.
            step: of the run [s]; cubics through single values are half as long.
        """

    def breaks(self, begin: float, end: float) -> np.ndarray:
        """Ascending times [s] at which value or slope may jump, and perhaps others outside.

        Args:
            begin: of the interval [s].
            end: of the interval [s].
        """
        return self.pieces(begin, end, math.inf)[1:, 0]

    def mean(self, t: Any, h: Any) -> np.ndarray:
        """Mean over [t - h, t + h], shape (2,) or (n, 2); the value at t for h = 0.

        Args:
            t: centre of the interval [s], a number or shape (n,).
            h: half its length [s], a number or shape (n,).
        """
        t, h = np.broadcast_arrays(np.asarray(t, float), np.asarray(h, float))
        return self._means(t.ravel(), h.ravel()).reshape(*t.shape, 2)

    def _means(self, t: np.ndarray, h: np.ndarray) -> np.ndarray:
        """As `mean`, for arrays of the same shape (n,)."""
        if not len(t):
            return np.zeros((0, 2))
        low, high = float((t - h).min()), float((t + h).max())
        return pieces.pieces_mean(self.pieces(low, high, math.inf), t, h)

    def mean_of_multisines(self, t: Any, h: Any) -> Any:
        """As `mean`, for the multisines alone; 0 if there are none.

        Args:
            t: centre of the interval [s], a number or shape (n,).
            h: half its length [s], a number or shape (n,).
        """
        return 0.0

    def __call__(self, t: Any) -> np.ndarray:
        """Value at a time, shape (2,) or (n, 2).

        Args:
            t: time [s], a number or shape (n,).
        """
        return self.mean(t, 0.0)

    def __add__(self, other: Any) -> Signal:
        return Sum((self, other)) if isinstance(other, Signal) else NotImplemented

    def __radd__(self, other: Any) -> Signal:
        return self if other == 0 else NotImplemented  # the start of sum(...)

    def __neg__(self) -> Signal:
        return Sum((self,), (-1.0,))

    def __sub__(self, other: Any) -> Signal:
        return self + -other if isinstance(other, Signal) else NotImplemented

    def __mul__(self, factor: Any) -> Signal:
        return (
            Sum((self,), (float(factor),)) if isinstance(factor, numbers.Real) else NotImplemented
        )

    __rmul__ = __mul__


@part("sum.")
class Sum(Signal):
    """Sum of signals: `a + b - 2 * c`.

    Attributes:
        parts: the signals; nested sums are flattened.
        factors: factor on each part, -1e6 to 1e6; None for 1.
    """

    parts: tuple[Signal, ...]
    factors: Annotated[tuple[float, ...] | None, Bound(-1e6, 1e6)] = None

    def __post_init__(self):
        n = len(self.parts)
        factors = (1.0,) * n if self.factors is None else self.factors
        if not n:
            raise ParameterError("sum.parts", self.parts, "must be a sequence of signals")
        if len(factors) != n:
            raise ParameterError("sum.factors", factors, f"must be {n} numbers, one a signal")
        flat = [x for pair in zip(self.parts, factors, strict=True) for x in _scaled_parts(*pair)]
        object.__setattr__(self, "parts", tuple(signal for signal, _ in flat))
        factors = tuple(k for _, k in flat)
        object.__setattr__(self, "factors", factors if set(factors) != {1.0} else None)

    def _terms(self) -> list[tuple[Signal, float]]:
        return list(zip(self.parts, self.factors or (1.0,) * len(self.parts), strict=True))

    @property
    def varies(self) -> bool:
        return any(part.varies for part in self.parts)

    @property
    def cosines(self) -> np.ndarray:
        return np.concatenate([x.cosines * (1.0, 1.0, 1.0, k, k) for x, k in self._terms()])

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        terms = self._terms()
        return pieces.added_pieces(
            [x.pieces(begin, end, step) for x, _ in terms], [k for _, k in terms]
        )

    def breaks(self, begin: float, end: float) -> np.ndarray:
        return np.unique(np.concatenate([x.breaks(begin, end) for x in self.parts]))

    def _means(self, t: np.ndarray, h: np.ndarray) -> np.ndarray:
        out = np.zeros((len(t), 2))
        for signal, k in self._terms():
            out += k * signal.mean(t, h)
        return out

    def mean_of_multisines(self, t: Any, h: Any) -> Any:
        return sum(k * x.mean_of_multisines(t, h) for x, k in self._terms())


def _scaled_parts(part: Signal, factor: float) -> list[tuple[Signal, float]]:
    """Parts of a scaled signal, with their factors."""
    if isinstance(part, Sum):
        return [(x, k * factor) for x, k in part._terms()]
    return [(part, factor)]


@part("multisine.")
class Multisine(Signal):
    """A periodic signal: cosines of random phases at multiples of 1/period between low and high.

    All lines have the same amplitude; the seed determines the phases (Pintelon, Schoukens, System
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
    low: Annotated[Real, Bound(0.0, unit="Hz", above=True)] = 0.1
    high: Annotated[Real, Bound("low", 1e6, "Hz")] = 2.0
    period: Annotated[Real, Bound(1e-3, 1e5, "s")] = 20.0
    lines: Annotated[int | None, Bound(1, MOST_LINES)] = None
    seed: Seed = 0

    def __post_init__(self):
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

    @cached_property
    def omega(self) -> np.ndarray:
        """Angular frequency of each line [rad/s], shape (n,)."""
        low, high = self.low * self.period, self.high * self.period
        k = np.arange(np.ceil(low - 1e-9), np.floor(high + 1e-9) + 1.0)
        if self.lines is not None:
            want = np.geomspace(k[0], k[-1], self.lines)
            k = k[np.unique(np.abs(k[:, None] - want).argmin(axis=0))]
        return 2.0 * np.pi * k / self.period

    @cached_property
    def phase(self) -> np.ndarray:
        """Phase of each line on each axis [rad], shape (n, 2)."""
        return np.random.default_rng(self.seed).uniform(0.0, 2.0 * np.pi, (len(self.omega), 2))

    @property
    def amplitude(self) -> np.ndarray:
        """Amplitude of each line on each axis, shape (2,)."""
        return np.array(self.rms) * np.sqrt(2.0 / len(self.omega))

    @property
    def cosines(self) -> np.ndarray:
        amplitude = np.tile(self.amplitude, (len(self.omega), 1))
        return np.column_stack((self.omega, self.phase, amplitude))

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        return pieces.NO_PIECES

    def mean(self, t: Any, h: Any) -> np.ndarray:
        t, h = np.asarray(t)[..., None], np.asarray(h)[..., None]
        lines = (multisine_line(self.omega, self.phase[:, i], t, h).sum(-1) for i in (0, 1))
        return np.stack([x * self.amplitude[i] for i, x in enumerate(lines)], -1)

    def mean_of_multisines(self, t: Any, h: Any) -> Any:
        return self.mean(t, h)


TRAITS = (Trait("signals", "part", lambda s: s.driven, LEFT_OUT),)
