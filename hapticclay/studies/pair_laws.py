"""The control law of each side of a measured pair: what a pair's log says about its software."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .. import matrices
from .block_fit import BlockFit, Unknown, block_fit

LATEST = 0.4  # [s] largest delay that is looked for
TRIED = 24  # delays tried, evenly spaced up to a few samples, then in their logarithm
LONGEST = 2.0  # [s] of delay and lag of a follower whose torque is unknown
LINES = 8  # between rows: of a sine of a tenth of the rate they leave (2 pi/80)^2/12 = 5e-4
SETTLES = 0.5  # [s] in which its start is forgotten
LAGS = (0.0, 3.0)  # [samples] tried at the start
EARLY = 2.0  # [samples] by which one column may be ahead of another
ORDER = 4  # of the low-pass ahead of a fit, without phase
EDGE = 1.5  # [1/band] cut off on both sides of what is filtered
STEP = 1e-5  # of differences
RATE = 8.0  # [band] samples per second of what is fitted
ALIKE = 0.02  # of e, e' and e'' of size 1: a smaller singular value is one frequency


class PairLaw(NamedTuple):
    """u = P x + D dx/dt, x the error far(t - link) - near(t) behind a filter or a delay.

    Attributes:
        P: stiffness [N.m/rad].
        D: damping [N.m.s/rad].
        lag: from the error to the torque [s]: mean delay of a first-order filter, or the delay.
        link: delay of the other side's position [s].
        filters: whether the lag is that of a filter.
    """

    P: float
    D: float
    lag: float
    link: float
    filters: bool = True

    def pole(self, Ts: float) -> float:
        """Pole p of the filter x = p x + (1 - p) e, whose mean delay is p/(1 - p) Ts."""
        return self.lag / (self.lag + Ts) if self.filters else 0.0

    @property
    def late(self) -> float:
        """Pure delay from the error to the torque [s]."""
        return 0.0 if self.filters else self.lag

    def torque(self, error: np.ndarray, Ts: float) -> np.ndarray:
        """The torque of a sampled error, without the pure delay, (n,)."""
        from scipy.signal import lfilter

        p = self.pole(Ts)
        x = lfilter([1.0 - p], [1.0, -p], error, zi=[p * error[0]])[0]
        return self.P * x + self.D / Ts * np.diff(x, prepend=x[0])

    def start(self, Ts: float, error: float) -> Callable[[float], float]:
        """The law as a function to call once a sample, begun at a constant error."""
        p, x = self.pole(Ts), error

        def torque(e: float) -> float:
            nonlocal x
            before, x = x, p * x + (1.0 - p) * e
            return self.P * x + self.D / Ts * (x - before)

        return torque


class Motion(NamedTuple):
    """What a law is fitted to: times [s], both positions [rad] and a torque [N.m], (n,) each."""

    t: np.ndarray
    near: np.ndarray
    far: np.ndarray
    torque: np.ndarray

    @property
    def Ts(self) -> float:
        """Mean step [s]."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    def below(self, band: float) -> Motion:
        """The motion without what is above a frequency [Hz]."""
        return self._replace(
            near=low_passed(self.near, self.Ts, band),
            far=low_passed(self.far, self.Ts, band),
            torque=low_passed(self.torque, self.Ts, band),
        )


def low_passed(x: np.ndarray, Ts: float, band: float) -> np.ndarray:
    """A column without what is above a frequency [Hz]; no phase."""
    from scipy.signal import butter, sosfiltfilt

    return sosfiltfilt(butter(ORDER, 2.0 * band * Ts, output="sos"), x)


def fitted_rows(count: int, Ts: float, band: float, delay: float = 0.0) -> slice:
    """The rows of low-passed columns that a fit takes, behind a delay."""
    edge = min(round(EDGE / (band * Ts)), count // 4)
    first = min(edge + math.ceil(delay / Ts), count // 2)
    return slice(first, count - edge, max(1, round(1.0 / (RATE * band * Ts))))


def delayed(t: np.ndarray, x: np.ndarray, delay: float) -> np.ndarray:
    """A sampled signal a time earlier, by cubic splines; its first value before the start."""
    from scipy.interpolate import CubicSpline

    return x if delay == 0.0 else CubicSpline(t, x)(np.clip(t - delay, t[0], t[-1]))


def error_of(law: PairLaw, m: Motion) -> np.ndarray:
    """The error on which a law acts [rad], (n,)."""
    return delayed(m.t, m.far, law.link) - m.near


def predicted(law: PairLaw, m: Motion) -> np.ndarray:
    """The torque that a law makes of a motion, without an offset, (n,)."""
    return delayed(m.t, law.torque(error_of(law, m), m.Ts), law.late)


def fit_law(motion: Motion, band: float, level: float) -> tuple[PairLaw, BlockFit]:
    """The law of a side, with a filter or a delay, whichever leaves less.

    The values of the fit are P, D, lag and link of the law, then an offset of the torque.
    """
    m = motion.below(band)
    found = [_fit(m, band, filters, level) for filters in (True, False)]
    law, fit = min(found, key=lambda x: x[1].rms)
    if apart(law, m, band) < ALIKE:
        fit = replace(fit, covariance=np.full_like(fit.covariance, math.nan))
    return law, fit


def apart(law: PairLaw, m: Motion, band: float) -> float:
    """How far P, D and lag are told apart, from 0 to 1.

    They act on e, e' and e'': P e + D e' - lag (P e' + D e''). Where the error moves at one
    frequency, e'' is -omega^2 e, and many laws make the same torque.
    """
    e, rows = error_of(law, m), fitted_rows(len(m.t), m.Ts, band)
    slope = np.gradient(e, m.Ts)
    columns = np.column_stack([e, slope, np.gradient(slope, m.Ts)])[rows]
    columns -= columns.mean(axis=0)
    sizes = np.linalg.norm(columns, axis=0)
    if not np.all(sizes > 0.0):
        return 0.0
    return float(matrices.singular_values(columns / sizes)[-1])


def _fit(m: Motion, band: float, filters: bool, level: float) -> tuple[PairLaw, BlockFit]:
    first, T = _first_guess(m, band, filters), m.Ts
    rows = fitted_rows(len(m.t), T, band, 1.5 * first.link)
    P, D = max(abs(first.P), 1e-9), max(abs(first.D), 1e-3 * abs(first.P), 1e-12)
    unknowns = (
        Unknown(first.P, -100.0 * P, 100.0 * P, P),
        Unknown(first.D, -100.0 * D, 100.0 * D, D),
        Unknown(max(first.lag, 0.3 * T), 0.0, LATEST, T),
        Unknown(first.link, -EARLY * T, LATEST, T),
        Unknown(0.0, -math.inf, math.inf, float(np.std(m.torque)) or 1.0),
    )

    def rest(x: np.ndarray) -> np.ndarray:
        law = PairLaw(*x[:4].tolist(), filters=filters)
        return (predicted(law, m) + x[4] - m.torque)[rows]

    found = block_fit(rest, unknowns, level, STEP)
    return PairLaw(*found.values[:4].tolist(), filters=filters), found


def _first_guess(m: Motion, band: float, filters: bool) -> PairLaw:
    """The best of a grid of delays and lags, each by linear least squares."""
    best, law, T = math.inf, PairLaw(0.0, 0.0, 0.0, 0.0, filters), m.Ts
    links = _delays(m.t)
    rows = fitted_rows(len(m.t), T, band, links[-1])
    y = m.torque[rows]
    for link in links:
        error = delayed(m.t, m.far, link) - m.near
        for lag in LAGS:
            one = PairLaw(1.0, 0.0, lag * T, 0.0, filters)
            x = delayed(m.t, one.torque(error, T), one.late)
            columns = (x[rows], np.gradient(x, T)[rows], np.ones_like(y))
            gains, left = _solved(columns, y)
            if left < best:
                best, law = left, PairLaw(gains[0], gains[1], lag * T, link, filters)
    return law


def fit_reflection(
    t: np.ndarray, force: np.ndarray, torque: np.ndarray, band: float, level: float
) -> BlockFit:
    """A force reflected to the leader: torque = -scale force(t - delay) + offset."""
    T = float(t[-1] - t[0]) / (len(t) - 1)
    delays = _delays(t)
    rows = fitted_rows(len(t), T, band, delays[-1])
    f, u = low_passed(force, T, band), low_passed(torque, T, band)
    ones = np.ones_like(u[rows])
    tries = [(_solved((delayed(t, f, d)[rows], ones), u[rows])[1], d) for d in delays]
    sized = float(np.std(u)) or 1.0
    scale = sized / (float(np.std(f)) or sized)
    unknowns = (
        Unknown(scale, -1e3 * scale, 1e3 * scale, scale),
        Unknown(min(tries)[1], -EARLY * T, LATEST, T),
        Unknown(0.0, -math.inf, math.inf, sized),
    )

    def rest(x: np.ndarray) -> np.ndarray:
        return (x[2] - x[0] * delayed(t, f, x[1]) - u)[rows]

    return block_fit(rest, unknowns, level, STEP)


def followed(
    t: np.ndarray, leader: np.ndarray, delay: float, lag: float, start: float, parts: int = 0
) -> np.ndarray:
    """A first-order lag behind a delayed leader, (n,); it begins at a position.

    As a filter that is computed once a row, where the leader at t - delay acts for the row up to t;
    or in continuous time, behind a leader that moves in that many lines from row to row.
    """
    from scipy.interpolate import CubicSpline
    from scipy.signal import lfilter

    n, fine = len(t), max(parts, 1)
    times = np.interp(np.arange(fine * (n - 1) + 1) / fine, np.arange(n), t)
    T, u = float(t[-1] - t[0]) / (n - 1) / fine, leader
    if delay or fine > 1:
        u = CubicSpline(t, leader)(np.clip(times - delay, t[0], t[-1]))
    a = math.exp(-T / lag) if lag > 0.0 else 0.0
    now = 1.0 - (lag / T * (1.0 - a) if parts else a)
    return lfilter([now, 1.0 - a - now], [1.0, -a], u, zi=[start - now * u[0]])[0][::fine]


def fit_following(
    t: np.ndarray, leader: np.ndarray, follower: np.ndarray, level: float
) -> tuple[np.ndarray, BlockFit]:
    """A follower as a delayed, lagged and scaled leader: it, and delay, lag, scale and offset.

    By row or in continuous time, whichever leaves less.
    """
    tries = [_following(t, leader, follower, level, parts) for parts in (0, LINES)]
    return min(tries, key=lambda x: x[1].rms)


def _following(
    t: np.ndarray, leader: np.ndarray, follower: np.ndarray, level: float, parts: int
) -> tuple[np.ndarray, BlockFit]:
    T, begin = float(t[-1] - t[0]) / (len(t) - 1), float(follower[0])
    delays, lags = [*_delays(t), *_later(t)], [0.0, *_delays(t)[1:]]
    rows = slice(min(math.ceil(SETTLES / T), len(t) // 4), None)
    y = follower[rows]

    def model(delay: float, lag: float, scale: float, offset: float) -> np.ndarray:
        start = (begin - offset) / scale if scale else begin
        return offset + scale * followed(t, leader, delay, lag, start, parts)

    def solved(delay: float, lag: float) -> tuple[np.ndarray, float]:
        x = followed(t, leader, delay, lag, begin, min(parts, 1))[rows]
        return _solved((x, np.ones_like(x)), y)

    delay, lag = min(((d, k) for d in delays for k in lags), key=lambda x: solved(*x)[1])
    scale, offset = solved(delay, lag)[0].tolist()
    unknowns = (
        Unknown(delay, 0.0, LONGEST, T),
        Unknown(max(lag, 0.1 * T), 0.0, LONGEST, T),
        Unknown(scale, -100.0, 100.0, 1.0),
        Unknown(offset, -math.inf, math.inf, float(np.std(follower))),
    )
    found = block_fit(lambda v: model(*v.tolist())[rows] - y, unknowns, level, STEP)
    return model(*found.values.tolist()), found


def _later(t: np.ndarray) -> list[float]:
    """Delays beyond those of a control loop, as those of networks and cameras [s]."""
    return [x for x in (0.5, 0.65, 0.8, 1.0) if x < (t[-1] - t[0]) / 8.0]


def _delays(t: np.ndarray) -> list[float]:
    """Delays to try at the start [s]."""
    T = float(t[-1] - t[0]) / (len(t) - 1)
    far = np.unique(np.round(np.geomspace(1.0, max(LATEST / T, 2.0), TRIED)))
    return [0.0, *(T * far[far < len(t) / 8]).tolist()]


def _solved(columns: tuple[np.ndarray, ...], y: np.ndarray) -> tuple[np.ndarray, float]:
    """Linear least squares, and the sum of squares that is left."""
    A = np.column_stack(columns)
    gains = matrices.least_squares(A, y)
    return gains, float(np.sum((y - A @ gains) ** 2))
