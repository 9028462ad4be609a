"""Identification of G, Sh and Th on the simulated arm, as the paper did it on the real one (Sec. 4, Figs. 4-6).

A multisine drives the handle, input and output are recorded every sample, the frequency response is estimated over
whole periods, and the printed form is fitted to it. Method and what limits it: docs/identify.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from . import arm
from .errors import ParameterError, choice, integer, number, numbers_of, pair
from .params import AXES, L1, L2, TS, G, Multisine, Operator, S, Scenario
from .record import Record, versions
from .signals import Signal
from .sim import simulate

SCHEMA = "hapticclay-identify-1"
KINDS = ("G", "S", "Th")
NOMINAL = (L2, L1)  # world position of the handle where the elbow is square [m]
NAMES = {
    "G": ("gain", "damping", "stiffness"),
    "S": ("gain", "damping", "stiffness"),
    "Th": ("mass", "damper", "spring"),
}
UNITS = {"G": ("1/s^2", "1/s", "1/s^2"), "S": ("1/kg", "1/s", "1/s^2"), "Th": ("kg", "N.s/m", "N/m")}
BAND = {"G": (0.2, 20.0), "S": (0.2, 20.0), "Th": (0.1, 3.0)}  # [Hz], of Figs. 4 to 6 and beyond the corner
PERIOD = {"G": 5.0, "S": 5.0, "Th": 10.0}  # [s]
AMPLITUDE = {"G": 1e-3, "S": 1e-3, "Th": 1e-2}  # [m]: the pose stays; Th needs no pose, but forces above the noise
LINES = 40
TRUST = 1e-4  # no line counts as known to better than this share of itself: about (omega dt)^2/12 at 20 Hz
NEIGHBOURS = 5  # lines over which the scatter of the response is averaged
COVER = 0.95  # of the confidence intervals


@dataclass(frozen=True)
class Noise:
    """What the sensors add; no figure is printed.

    Attributes:
        encoder_counts: of each joint's quadrature encoder, a turn. force: rms of the force sensor, white [N].
    """

    encoder_counts: int = 65_536
    force: float = 0.02

    def __post_init__(self):
        object.__setattr__(self, "encoder_counts", integer("noise.encoder_counts", self.encoder_counts, 100, 2**40))
        object.__setattr__(self, "force", number("noise.force", self.force, 0.0, 1e3, unit="N"))


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


@dataclass(frozen=True, eq=False)
class Identified:
    """A frequency response and what was fitted to it.

    Attributes:
        what, axis: "G" [m/m], "S" (Sh) [m/N] or "Th" [N/m], of "x" or "y".
        frequency: lines of the multisine [Hz], (n,). response: complex, (n,), in the unit of what.
        deviation: standard deviation of response, by its scatter over the runs, (n,).
        coherence: of measured input and output over all periods, (n,).
        coefficients: of gain/(s^2 + damping s + stiffness), or of mass s^2 + damper s + spring.
        scenario: of the first run. noise: what was added to its record. seed: of phases and noise.
        periods, realisations: kept in each run; runs.
    """

    what: str
    axis: str
    frequency: np.ndarray
    response: np.ndarray
    deviation: np.ndarray
    coherence: np.ndarray
    coefficients: tuple[Coefficient, ...]
    scenario: Scenario
    noise: Noise | None
    seed: int
    periods: int
    realisations: int

    @property
    def values(self) -> tuple[float, ...]:
        """The fitted coefficients, in order."""
        return tuple(c.value for c in self.coefficients)

    def summary(self) -> dict[str, Any]:
        """Everything there is, ready for JSON."""
        return {
            "schema": SCHEMA,
            "what": self.what,
            "axis": self.axis,
            "coefficients": [{**asdict(c), "error": c.error} for c in self.coefficients],
            "frequency": self.frequency.tolist(),
            "real": self.response.real.tolist(),
            "imaginary": self.response.imag.tolist(),
            "deviation": self.deviation.tolist(),
            "coherence": self.coherence.tolist(),
            "scenario": asdict(self.scenario),
            "noise": asdict(self.noise) if self.noise else None,
            "seed": self.seed,
            "periods": self.periods,
            "realisations": self.realisations,
            "units": {"frequency": "Hz", "response": {"G": "m/m", "S": "m/N", "Th": "N/m"}[self.what]},
            "versions": versions(),
        }


def printed(what: str, axis: str) -> tuple[float, ...]:
    """The printed coefficients of G (Eqs. 15, 16), Sh (Eqs. 17, 18) or Th (Eq. 19), in the order of NAMES."""
    i = AXES.index(axis)
    block = {"G": G[i], "S": S[i], "Th": Operator()}[what]
    return tuple(getattr(block, name) for name in NAMES[what])


def response(what: str, coefficients: tuple[float, ...] | np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Complex response at frequency [Hz], (n,), of what with these coefficients."""
    s = 2j * np.pi * frequency
    a, b, c = coefficients
    return a * s**2 + b * s + c if what == "Th" else a / (s**2 + b * s + c)


def measured(record: Record, noise: Noise | None, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Handle position [m] and hand force [N] as the sensors show them, each (n, 2).

    Args:
        record: what was. noise: None for sensors without fault. rng: of the force sensor.
    """
    if noise is None:
        return record.p, record.fh
    count = 2.0 * np.pi / noise.encoder_counts
    q = count * np.round(record.q / count)
    a = q[:, 0] + q[:, 1]
    u1x, u1y, u2x, u2y = arm.columns(np.sin(q[:, 0]), np.cos(q[:, 0]), np.sin(a), np.cos(a))  # type: ignore[arg-type]
    p = np.column_stack((u1y + u2y, -u1x - u2x)) - record.scenario.origin
    return p, record.fh + rng.normal(0.0, noise.force, record.fh.shape)


def identify(
    axis: str = "x",
    what: str = "G",
    *,
    origin: tuple[float, float] = NOMINAL,
    shaping: bool = False,
    noise: Noise | None = None,
    seed: int = 0,
    band: tuple[float, float] | None = None,
    period: float | None = None,
    periods: int = 2,
    realisations: int = 4,
    lines: int = LINES,
    amplitude: float | None = None,
    control: str = "continuous",
    dt: float = TS,
    progress: Callable[[int, int], None] | None = None,
) -> Identified:
    """Identifies one block of the loop on one axis; the compensator is off (K = 0).

    G is driven by a command and Sh by a muscle force; for Th the operator's arm holds the handle that a command moves.

    Args:
        axis: "x" or "y". what: "G", "S" (Sh) or "Th".
        origin: world position about which the handle moves [m].
        shaping: True lets the servo shape the inertia, so that Sh holds at every pose.
        noise: of the sensors; None for none.
        seed: of the phases and of the noise.
        band: lowest and highest frequency [Hz], to 0.1/dt; None for (0.2, 20), Th (0.1, 3).
        period: of the multisine [s], rounded to a number of samples that is quick to transform; None for 5 s, Th 10 s.
        periods: kept in each run, after one that is discarded.
        realisations: runs, each with phases of its own.
        lines: of the multisine, spread over the logarithm of frequency; fewer where the period is too short.
        amplitude: rms of the motion of the handle that is aimed at [m]; None for 1 mm, Th 10 mm.
        control: "continuous" or "sampled" (slow: a minute for 30 s). dt: physics and control step [s].
        progress: called after each run with (runs made, runs in all).

    Returns:
        The frequency response and the fitted coefficients.

    Raises:
        ParameterError: a value is out of its bounds, the handle cannot be there, or a run did not last, or met the
            limits of its motors.
    """
    from scipy.fft import next_fast_len

    i = AXES.index(choice("axis", axis, AXES))
    choice("what", what, KINDS)
    if not isinstance(noise, Noise | None):
        raise ParameterError("noise", noise, "must be a Noise or None")
    seed = integer("seed", seed, 0, 2**32 - 1)
    runs = integer("realisations", realisations, 1, 1000)
    keep = integer("periods", periods, 1 if runs > 1 else 2, 1000)
    size = number("amplitude", AMPLITUDE[what] if amplitude is None else amplitude, 0.0, 1.0, above=True, unit="m")
    length = number("period", PERIOD[what] if period is None else period, 0.1, 1000.0, unit="s")
    base = Scenario(
        name=f"identify {what}{axis}", gain=(0.0, 0.0), force=(0.0, 0.0), origin=pair("origin", origin, unit="m"),
        operator=Operator() if what == "Th" else None, shaping=shaping, control=control, dt=dt, length=None,
        stop=False,
    )  # fmt: skip
    low, high = numbers_of("band", band or BAND[what], ("low", "high"), 0.0, 0.1 / base.dt, above=True, unit="Hz")
    n = int(next_fast_len(max(round(length / base.dt), 1)))
    rms = size * S[i].stiffness / S[i].gain if what == "S" else size
    drive = Multisine((rms, 0.0) if i == 0 else (0.0, rms), low, high, n * base.dt)
    most = len(Signal(drive).omega)
    if most < 3:
        bound = f"must hold 3 multiples of 1/period = {1.0 / drive.period:.4g} Hz or more, not {most}"
        raise ParameterError("band", (low, high), bound)
    count = min(integer("lines", lines, 3, 100_000), most)
    signals = []
    seeds = np.random.SeedSequence(seed).generate_state(2 * runs).tolist()
    first = base
    for m in range(runs):
        wave = Multisine(drive.rms, low, high, drive.period, count, seeds[m])
        driven = {"muscle" if what == "S" else "command": wave}
        scenario = _replace(base, t_max=(1 + keep) * drive.period, **driven)
        first = scenario if m == 0 else first
        record = simulate(scenario)
        if record.outcome.code != "time limit" or record.outcome.cause or len(record.t) < (1 + keep) * n:
            bound = f"the handle must move, and the motors stay within their limits: {record.status}"
            raise ParameterError("amplitude", size, bound)
        rng = np.random.default_rng(seeds[runs + m])
        signals.append(_signals(what, record, *measured(record, noise, rng), Signal(wave), slice(n, (1 + keep) * n), i))
        if progress:
            progress(m + 1, runs)
    bins = np.round(Signal(first.muscle or first.command or drive).omega / (2.0 * np.pi) * drive.period).astype(int)
    frequency = bins / drive.period
    H, deviation, coherence = _estimate(np.array(signals), n, bins, 1.0 / base.dt)
    return Identified(
        what, axis, frequency, H, deviation, coherence, _coefficients(what, axis, frequency, H, deviation),
        first, noise, seed, keep, runs,
    )  # fmt: skip


def _replace(scenario: Scenario, **changes: Any) -> Scenario:
    from dataclasses import replace

    return replace(scenario, **changes)


def _signals(what: str, record: Record, p, fh, wave: Signal, part: slice, i: int) -> np.ndarray:
    """Reference, input and output of axis i over part of a record, shape (3, samples)."""
    reference = wave(record.t[part])[:, i]
    p, fh, delta = p[part, i], fh[part, i], record.delta[part, i]
    given, out = {"G": (delta, p), "S": (fh, p), "Th": (p, -fh)}[what]
    return np.array((reference, given, out))


def _estimate(signals: np.ndarray, n: int, bins: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Response, its standard deviation and coherence at the lines of the multisine, each (lines,).

    The reference is free of noise, and so is the estimate S_ry/S_ru of bias, noise on the input or not, in closed
    loop or not (Pintelon, Schoukens, System Identification, 2012, sec. 2.6). Windows of whole periods do not leak.

    Args:
        signals: reference, input, output, (runs, 3, periods n). n: samples in a period. bins: of the lines.
        rate: samples per second [Hz].
    """
    from scipy.signal import csd

    r, u, y = np.moveaxis(signals, 1, 0)
    if len(r) == 1:  # scatter over periods then
        r, u, y = (x.reshape(-1, n) for x in (r, u, y))

    def spectrum(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return csd(a, b, rate, "boxcar", n, 0, detrend=False)[1][:, bins]

    ru, ry = spectrum(r, u), spectrum(r, y)
    H = ry.mean(axis=0) / ru.mean(axis=0)
    scatter = np.sum(np.abs(ry / ru - H) ** 2, axis=0) / (len(r) - 1) / len(r)
    window = np.ones(NEIGHBOURS)
    weight = np.convolve(np.ones(len(bins)), window, "same")[: len(bins)]
    share = np.convolve(scatter / np.abs(H) ** 2, window, "same")[: len(bins)] / weight
    uu, yy, uy = (spectrum(a, b).mean(axis=0) for a, b in ((u, u), (y, y), (u, y)))
    coherence = np.minimum(np.abs(uy) ** 2 / (uu.real * yy.real), 1.0)
    return H, np.sqrt(share) * np.abs(H), coherence


def _coefficients(what: str, axis: str, frequency, H, deviation) -> tuple[Coefficient, ...]:
    known = printed(what, axis)
    value, half = fit(what, frequency, H, deviation)
    ends = zip(NAMES[what], UNITS[what], known, value.tolist(), (value - half).tolist(), (value + half).tolist())
    return tuple(Coefficient(*x) for x in ends)


def fit(what: str, frequency: np.ndarray, H: np.ndarray, deviation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients that fit a response best, and half their 95 % confidence intervals, each (3,), in order of NAMES.

    Least squares of the complex misfit, each line weighted by its deviation; the intervals come from the Jacobian
    and the misfit that is left (Pintelon, Schoukens 2012, sec. 1.4).

    Args:
        what: which form. frequency: [Hz], (n,), n >= 3. H: response, complex, (n,). deviation: of H, (n,).
    """
    from scipy.optimize import least_squares
    from scipy.special import stdtrit

    sigma = np.hypot(deviation, TRUST * np.abs(H))
    start = _linear(what, 2j * np.pi * frequency, H)

    def misfit(x: np.ndarray) -> np.ndarray:
        e = (H - response(what, x * start, frequency)) / sigma
        return np.concatenate((e.real, e.imag))

    found = least_squares(misfit, np.ones(3), method="lm", xtol=1e-14, ftol=1e-14)
    freedom = 2 * len(H) - 3
    covariance = np.linalg.inv(found.jac.T @ found.jac) * 2.0 * found.cost / freedom
    half = stdtrit(freedom, 0.5 + 0.5 * COVER) * np.sqrt(np.diag(covariance))
    return found.x * start, half * np.abs(start)


def _linear(what: str, s: np.ndarray, H: np.ndarray) -> np.ndarray:
    """Where the fit starts: the same form made linear in its coefficients (Levy 1959), each line weighted by 1/H."""
    if what == "Th":
        A, b = np.stack((s**2, s, np.ones_like(s)), axis=1) / H[:, None], np.ones_like(H)
    else:
        A, b = np.stack((1.0 / H, -s, -np.ones_like(s)), axis=1), s**2
        A, b = A / np.abs(b)[:, None], b / np.abs(b)
    real = np.concatenate((A.real, A.imag)), np.concatenate((b.real, b.imag))
    return np.linalg.lstsq(*real, rcond=None)[0]
