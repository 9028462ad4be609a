"""From records to coefficients: frequency responses of periodic signals, and the printed forms fitted to them.

Pintelon, Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., Wiley 2012. How it is used here, and
what limits it: docs/identify.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model.scenario import AXES, G, Operator, S

KINDS = ("G", "S", "Th")
NAMES = {
    "G": ("gain", "damping", "stiffness"),
    "S": ("gain", "damping", "stiffness"),
    "Th": ("mass", "damper", "spring"),
}
UNITS = {"G": ("1/s^2", "1/s", "1/s^2"), "S": ("1/kg", "1/s", "1/s^2"), "Th": ("kg", "N.s/m", "N/m")}
TRUST = 1e-6  # no line counts as known to better than this share of itself
NEIGHBOURS = 5  # lines over which the scatter of the response is averaged
COVER = 0.95  # of the confidence intervals


@dataclass(frozen=True)
class Coefficient:
    """One coefficient: as printed, as fitted, and the 95 % confidence interval of the fit."""

    name: str
    unit: str
    printed: float
    value: float
    low: float
    high: float

    @property
    def error(self) -> float:
        """Relative error of the fit against the printed value."""
        return self.value / self.printed - 1.0


def value(c: Coefficient) -> str:
    """Fitted value and half its interval, to two figures of the latter: "41.793 +- 0.012"."""
    half = 0.5 * (c.high - c.low)
    digits = max(0, 1 - math.floor(math.log10(half))) if half > 0.0 else 6
    return f"{c.value:.{digits}f} \u00b1 {half:.{digits}f}"


def printed(what: str, axis: str) -> tuple[float, ...]:
    """The printed coefficients of G (Eqs. 15, 16), Sh (Eqs. 17, 18) or Th (Eq. 19), in the order of NAMES."""
    i = AXES.index(axis)
    block = {"G": G[i], "S": S[i], "Th": Operator()}[what]
    return tuple(getattr(block, name) for name in NAMES[what])


def response(what: str, coefficients: tuple[float, ...] | np.ndarray, frequency: np.ndarray, dt: float | None = None):
    """Complex response of what with these coefficients at frequency [Hz], both (n,).

    Args:
        dt: step of the loop [s], which differentiates by central differences and lets a spring act on (1, 2, 1)/4 of
            three positions; None for the printed form in continuous time.
    """
    s2, s, one = _operators(frequency, dt)
    a, b, c = coefficients
    return a * s2 + b * s + c * one if what == "Th" else a / (s2 + b * s + c)


def _operators(frequency: np.ndarray, dt: float | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What stands for s^2, s and 1 at frequency [Hz]."""
    omega = 2.0 * np.pi * frequency
    if dt is None:
        return -(omega**2), 1j * omega, np.ones_like(omega)
    half = 0.5 * omega * dt
    return -((2.0 * np.sin(half) / dt) ** 2), 1j * np.sin(2.0 * half) / dt, np.cos(half) ** 2


def estimate(
    signals: np.ndarray, n: int, bins: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
    """Response, its standard deviation and the coherence at the lines of a multisine, each (lines,), and the runs' own.

    The reference is free of noise, so S_ry/S_ru is free of bias, with noise on the input and in a closed loop too
    (Pintelon, Schoukens 2012, sec. 2.6.4). Windows of whole periods do not leak.

    Args:
        signals: reference, input and output, (runs, 3, periods n); more than one run, or period.
        n: samples in a period. bins: multiples of 1/period that the lines are, (lines,).

    Returns:
        (response, deviation, coherence, errors): errors, what each run adds to the response, (runs, lines); None for
        a single run.
    """
    from scipy.signal import csd

    r, u, y = np.moveaxis(signals, 1, 0)
    single = len(r) == 1
    if single:  # scatter over its periods then
        r, u, y = (x.reshape(-1, n) for x in (r, u, y))

    keep: Any = False

    def spectrum(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return csd(a, b, window="boxcar", nperseg=n, noverlap=0, detrend=keep)[1][:, bins]

    ru, ry = spectrum(r, u), spectrum(r, y)
    H = ry.mean(axis=0) / ru.mean(axis=0)
    errors = (ry - H * ru) / ru.mean(axis=0)
    scatter = np.sum(np.abs(errors) ** 2, axis=0) / (len(r) - 1) / len(r)
    share = _smooth(scatter / np.abs(H) ** 2)
    uu, yy, uy = (spectrum(a, b).mean(axis=0) for a, b in ((u, u), (y, y), (u, y)))
    coherence = np.minimum(np.abs(uy) ** 2 / (uu.real * yy.real), 1.0)
    return H, np.sqrt(share) * np.abs(H), coherence, None if single else errors


def _smooth(x: np.ndarray) -> np.ndarray:
    """Mean of each value and its NEIGHBOURS - 1 nearest, of those that exist."""
    half = NEIGHBOURS // 2
    total = np.cumsum(np.concatenate(([0.0], x)))
    low, high = np.maximum(np.arange(len(x)) - half, 0), np.minimum(np.arange(len(x)) + half + 1, len(x))
    return (total[high] - total[low]) / (high - low)


def fit(
    what: str,
    frequency: np.ndarray,
    H: np.ndarray,
    deviation: np.ndarray,
    errors: np.ndarray | None = None,
    dt: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients that fit a response best, and half of their 95 % confidence intervals, each (3,), order of NAMES.

    Least squares of the complex misfit, each line weighted by its deviation. The intervals come from how far each run
    alone would move the coefficients (Student's t, of as many degrees of freedom as runs but one): the count of an
    encoder makes errors that lines share, and an error that all share leaves no misfit. A single run has but that
    misfit.

    Args:
        what: which form. frequency: [Hz], (n,), n >= 3. H: response, complex, (n,). deviation: of H, (n,).
        errors: of each run, (runs, n), as `estimate` gives them; None for a single run. dt: as `response`.
    """
    from scipy.optimize import least_squares
    from scipy.special import stdtrit

    sigma = np.hypot(deviation, TRUST * np.abs(H))
    start = _linear(what, frequency, H, dt)

    def parts(e: np.ndarray) -> np.ndarray:
        return np.concatenate((e.real, e.imag), axis=-1)

    def misfit(x: np.ndarray) -> np.ndarray:
        return parts((H - response(what, x * start, frequency, dt)) / sigma)

    found = least_squares(misfit, np.ones(3), method="lm", xtol=1e-14, ftol=1e-14)
    if errors is None:
        freedom = 2 * len(H) - 3
        variance = np.diag(np.linalg.inv(found.jac.T @ found.jac)) * 2.0 * found.cost / freedom
    else:
        runs = len(errors)
        freedom = runs - 1
        variance = np.sum((np.linalg.pinv(found.jac) @ parts(errors / sigma).T) ** 2, axis=1) / (runs * freedom)
    half = stdtrit(freedom, 0.5 + 0.5 * COVER) * np.sqrt(variance)
    return found.x * start, half * np.abs(start)


def _linear(what: str, frequency: np.ndarray, H: np.ndarray, dt: float | None) -> np.ndarray:
    """Where the fit starts: the form made linear in its coefficients (Levy 1959), of relative misfit."""
    s2, s, one = _operators(frequency, dt)
    if what == "Th":
        A, b = np.stack((s2, s, one), axis=1) / H[:, None], np.ones_like(H)
    else:
        A, b = np.stack((1.0 / H, -s, -np.ones_like(s)), axis=1) / np.abs(s2[:, None]), s2 / np.abs(s2) + 0j
    both = np.concatenate((A.real, A.imag)), np.concatenate((b.real, b.imag))
    return np.linalg.lstsq(*both, rcond=None)[0]


def coefficients(what: str, axis: str, frequency: np.ndarray, found: tuple, dt: float | None, least: float):
    """`fit` beside the printed coefficients of what on axis: three of Coefficient.

    Args:
        found: H, deviation, coherence, errors, as `estimate` returns them. dt: as `response`.
        least: share of a coefficient that the fitted form is wrong by, part of the interval.
    """
    H, deviation, _, errors = found
    value, half = fit(what, frequency, H, deviation, errors, dt)
    half = np.hypot(half, least * np.abs(value))
    rows = zip(NAMES[what], UNITS[what], printed(what, axis), value.tolist(), half.tolist(), strict=True)
    return tuple(Coefficient(name, unit, known, x, x - h, x + h) for name, unit, known, x, h in rows)
