"""A block identified from columns: spectra of input and output, and the fit to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from .. import matrices
from ..arguments import checked
from ..errors import Bound, ParameterError, Real, numbers_of
from ..fields import Axis
from .even_columns import held_rows
from .identification import (
    COEFFICIENT_NAMES,
    COHERENT,
    CONFIDENCE,
    IDENTIFICATION_BAND,
    LINE_FLOOR,
    MULTISINE_LINES,
    Band,
    Block,
    Coefficient,
    Identified,
    coefficients_of,
    moving_mean,
    real_and_imaginary,
    response,
)
from .measurement import Measurement
from .outliers import LOST, Cleaned, bridged, cleaned, runs_of, sentence, times
from .plausibility import device_numbers, doubts
from .sliding import quantum

LEAST_LINES = 20  # of the spectrum in the band, without a period
# half intervals of a delay that is seen, rows, and half intervals of a coefficient that it moves
LATE = 1.3, 0.02, 0.1
LAG_ROUNDS = 4  # of fit and delay
LAG_LEFT = 0.05  # half intervals of a delay that is left to itself
MOST_LATE = 1.0  # [s]
INPUTS = {"G": "command", "S": "force", "Th": "force"}
LEAST_EXCITED = 5  # lines of a periodic input, ...
LEAST_STRONG = 12  # ... and of another one, beside the terms of start and end
EXCITED = 1e-6  # least power of a line, as a share of the strongest in the band
PERIODIC = 3e-5  # largest share of a periodic input's power in the band between its lines
REPEATED = 0.95  # least autocorrelation at a period
TRANSIENT_TERMS = 4  # two of a second-order block's start and end, two of sampling

USUAL, FAR_BEYOND = 0.99, 2.0  # quantile of a column, and times that an impossible value is of it
NEIGHBOURS = 20  # lines to each side over which noise is averaged, at most
WEIGHT_ROUNDS = 4  # of fit and noise; the weights settle in two

Delay = Annotated[Real, Bound(-1.0, 1.0, "s")]
HELD = "the input changes only every {} rows, as a computer holds it: state it by held (--held)"
Timing = tuple[bool, float]  # whether the input is held, and the delay of the position [s]
# frequency [Hz], response, its deviation, coherence
Averaged = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@checked
def identify_data(
    data: Measurement,
    what: Block = "G",
    axis: Axis = "x",
    *,
    band: Band = None,
    held: bool = False,
    delay: Delay = 0.0,
) -> Identified:
    """Identify one block from measured columns.

    Any excitation is suitable. Of a periodic one with two or more whole periods after the first,
    these periods are used; otherwise the whole record is used, and its start and end are fitted
    too. Other forces on the handle, and for Th the muscle force uh, must be independent of the
    input, or of the reference if there is one. Outliers of the position, and of other columns
    where the block then explains more, are left out and named in `warnings`.

    Args:
        data: the columns.
        what: "G" (input: command), "S" (Sh; input: force) or "Th" (input: force).
        axis: "x" or "y", the axis of the printed equation to compare with.
        band: lowest and highest frequency [Hz], to 0.1/dt; None for the part of (0.15, 20), Th
            (0.08, 3), that the record covers.
        held: True for an input that a computer holds from each sample to the next; not for Th.
        delay: of the position behind the other columns [s], which is removed.

    Returns:
        As `identify`, without scenario; `realisations` is 1 and `periods` 0 without a period.

    Raises:
        ParameterError: the record is too short for the band, the input has no power in it, the
            output does not follow, or no such block fits.
    """
    if held and what == "Th":
        raise ParameterError("held", held, 'must be False for "Th", whose input is a position')
    columns, warnings = _Columns(data.input, data.output, data.reference), [*data.notes]
    place = cleaned(columns.output, quantum(columns.output))
    if place.bad.any():
        warnings.append(sentence("position", data.t[place.bad], len(data.t), LOST))
    if len(place.steps):
        warnings.append(
            f"the position jumps and does not return at t = {times(data.t[place.steps])} s: "
            "identify the parts one by one"
        )
    if not held and what != "Th" and (rows := held_rows(columns.input)) > 1:
        warnings.append(HELD.format(rows))
    columns = columns._replace(output=place.x)
    timing = held, delay
    found, left_out = _without_wrong_readings(what, columns, data, band, timing)
    left_out += _lag_warning(what, found, data.dt, data.reference is not None)
    value, half, rotary = found.fitted.value, found.fitted.half, data.rotary
    coefficients = coefficients_of(what, axis, value, half, rotary)
    if all(c.high < 0.0 for c in coefficients[: 3 if what == "Th" else 1]):
        bound = "must not be negative: input or output has the wrong sign (fh is on the handle)"
        raise ParameterError(coefficients[0].name, float(f"{coefficients[0].value:.4g}"), bound)
    return Identified(
        what, axis, *found.averaged, coefficients, None, None, 0, found.periods, 1, data.name,
        (*warnings, *left_out, *_doubts(what, coefficients, data)), rotary,
    )  # fmt: skip


def _doubts(what: str, found: Sequence[Coefficient], data: Measurement) -> tuple[str, ...]:
    """What no hand or device has."""
    if what == "G" or data.rotary:  # the inertias of arms and knobs span seven decades
        return ()
    values, spans = [c.value for c in found], [(c.low, c.high) for c in found]
    if what == "S":  # 1/mass, damper/mass, spring/mass
        gain, (low, high) = values[0], spans[0]
        mass = (1.0 / high, 1.0 / low if low > 0.0 else math.inf)
        values = [1.0 / gain, values[1] / gain, values[2] / gain]
        spans = [mass, *((x / gain, y / gain) for x, y in spans[1:])]
    return doubts(device_numbers(values, spans), data, "hand or device")


class _Columns(NamedTuple):
    """Columns of a measurement, (n,) each."""

    input: np.ndarray
    output: np.ndarray
    reference: np.ndarray | None


class _Estimate(NamedTuple):
    """A block fitted to columns, its response averaged over bands, and the periods used."""

    spectrum: _Spectrum
    fitted: _Fitted
    averaged: Averaged
    periods: int

    @property
    def unexplained(self) -> float:
        """Share of the output's power that the block does not explain."""
        power = float(np.sum(np.abs(self.spectrum.y) ** 2))
        return float(np.sum(np.abs(self.fitted.left) ** 2)) / max(power, 1e-300)


def _without_wrong_readings(
    what: str, columns: _Columns, data: Measurement, band: object, timing: Timing
) -> tuple[_Estimate, list[str]]:
    """The better fit, with or without outliers of input and reference, and warnings about these.

    A force may jump away and back, as in a blow: the motion then follows it. It does not follow a
    wrong reading, without which the block explains more.
    """
    names = {"input": "command" if what == "G" else "force", "reference": "reference"}
    values = {name: getattr(columns, name) for name in names}
    found = {name: cleaned(x, quantum(x)) for name, x in values.items() if x is not None}
    found = {name: clean for name, clean in found.items() if clean.bad.any()}
    best: _Estimate | ParameterError | None = None
    warnings: list[str] = []
    for extreme in (None, True, False) if found else (None,):
        bad = {} if extreme is None else {k: _far(values[k], x, extreme) for k, x in found.items()}
        other = {k: bridged(values[k], x) for k, x in bad.items() if x.any()}
        if extreme is not None and (not other or min(map(np.ptp, other.values())) == 0.0):
            continue
        try:
            made = _estimate(what, columns._replace(**other), data, band, timing)
        except ParameterError as error:
            best = best or error
            continue
        if isinstance(best, _Estimate) and best.unexplained <= made.unexplained:
            continue
        best = made
        why = "jumps away and back that the position does not follow: lost packets, wrong signs?"
        warnings = [sentence(names[k], data.t[bad[k]], len(data.t), why) for k in other]
    if not isinstance(best, _Estimate):
        assert best is not None
        raise best
    return best, warnings


def _far(x: np.ndarray, clean: Cleaned, extreme: bool) -> np.ndarray:
    """The outliers of a column, or only those that lie far beyond all its other values."""
    if not extreme:
        return clean.bad
    size = np.abs(x - np.median(x))
    peaks = [np.max(size[first:stop]) for first, stop in runs_of(clean.bad)]
    usual = max(float(np.quantile(size, USUAL)), float(np.median(peaks)))
    return clean.bad & (size > FAR_BEYOND * usual)


def _estimate(
    what: str, columns: _Columns, data: Measurement, band: object, timing: Timing
) -> _Estimate:
    """Fit a block to columns."""
    u, y = columns.input, columns.output
    if what == "Th":
        u, y = y, -u
    signals = np.array((u if columns.reference is None else columns.reference, u, y))
    low, high = _band(what, band, data.dt, len(u))
    n = _period(signals[0], high * data.dt)
    periods = len(u) // n - 1 if n else 0
    spectrum = _spectrum(signals[:, -periods * n :], data.dt, (low, high), periods, timing[0])
    spectrum = _without_delay(what, spectrum, timing[1])
    _check_coherence(spectrum)
    try:
        with np.errstate(all="ignore"):  # of what cannot be fitted
            fitted = _fit_spectrum(what, spectrum, columns.reference is not None)
            averaged = _averaged_response(spectrum, fitted)
        if not np.all(np.isfinite(np.concatenate((fitted.value, fitted.half, averaged[2])))):
            raise np.linalg.LinAlgError("no bounded intervals")
    except (np.linalg.LinAlgError, ValueError) as error:
        bound = f"must be that of a block of the form of {what}; none fits ({error})"
        raise ParameterError("output", f"{len(spectrum.y)} lines", bound) from None
    return _Estimate(spectrum, fitted, averaged, periods)


def _band(what: str, band: object, dt: float, n: int) -> tuple[float, float]:
    """The requested band, or the part of the default band that the samples cover."""
    limit = 0.1 / dt
    if band is None:
        low, high = IDENTIFICATION_BAND[what]
        low, high = max(low, 1.0 / (n * dt)), min(high, limit)
    else:
        low, high = numbers_of("band", band, ("low", "high"), 0.0, limit, above=True, unit="Hz")
    if (high - low) * n * dt < LEAST_LINES:
        bound = (
            f"must hold {LEAST_LINES} multiples of 1/duration = {1.0 / (n * dt):.3g} Hz or more: "
            "the record is too short, or its step too long"
        )
        raise ParameterError("band", (float(f"{low:.4g}"), float(f"{high:.4g}")), bound)
    return low, high


def _period(u: np.ndarray, high: float) -> int:
    """Samples per period of u, if it has at least three; else 0. `high`: in lines of a sample."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(u)
    x = (u - u.mean()) / np.ptp(u)
    size = next_fast_len(2 * n, real=True)
    power = np.concatenate(([0.0], np.cumsum(x * x)))
    lag = np.arange(n // 3 + 2)
    both = np.sqrt(power[n - lag] * (power[n] - power[lag]))  # of u before and after
    power_of_lines = np.abs(np.asarray(rfft(x, size))) ** 2
    share = np.asarray(irfft(power_of_lines, size))[: len(lag)] / np.maximum(both, 1e-9 * power[n])
    peaks = (share[1:-1] > share[:-2]) & (share[1:-1] > share[2:]) & (share[1:-1] >= REPEATED)
    for peak in (1 + np.flatnonzero(peaks)[:20]).tolist():
        near = [k for k in (peak - 1, peak, peak + 1) if k <= n // 3]
        left, period = min((_between_lines(x, k, high), k) for k in near)
        if left <= PERIODIC:
            return period
    return 0


def _between_lines(x: np.ndarray, period: int, high: float) -> float:
    """Share of the power up to `high`, after the first period, that does not have this period."""
    count = len(x) // period - 1
    samples = count * period
    power = np.abs(np.fft.rfft(x[-samples:])[: math.floor(high * samples) + 1]) ** 2
    power[0] = 0.0
    return float(1.0 - power[::count].sum() / max(power.sum(), 1e-300))


class _Spectrum(NamedTuple):
    """Discrete Fourier transforms of reference, input and output at the excited lines, (n,)."""

    frequency: np.ndarray  # [Hz]
    r: np.ndarray
    u: np.ndarray
    y: np.ndarray
    dt: float  # mean step [s]
    terms: int  # of start and end


def _spectrum(
    signals: np.ndarray, dt: float, band: tuple[float, float], periods: int, held: bool
) -> _Spectrum:
    """Spectra of reference, input and output at the lines of a band that the reference excites."""
    samples = signals.shape[1]
    every, duration = max(periods, 1), samples * dt
    first, last = math.ceil(band[0] * duration - 1e-9), math.floor(band[1] * duration + 1e-9)
    bins = np.arange(first, last + 1)
    bins = bins[bins % every == 0]
    r, u, y = np.fft.rfft(signals - signals.mean(axis=1, keepdims=True))[:, bins] / samples
    rms = float(np.std(signals[0]))
    power = np.abs(r) ** 2
    strong = power > EXCITED * max(power.max(initial=0.0), LINE_FLOOR * rms**2 / max(len(bins), 1))
    least = LEAST_EXCITED if periods else LEAST_STRONG
    if np.count_nonzero(strong) < least:
        bound = (
            f"must have power at {least} lines or more from {band[0]:.3g} to {band[1]:.3g} Hz; "
            f"it has at {np.count_nonzero(strong)}"
        )
        raise ParameterError("input", f"rms {rms:.3g}", bound)
    frequency = bins[strong] / duration
    if held:
        u = u * np.exp(-1j * np.pi * bins / samples) * np.sinc(bins / samples)
    terms = 0 if periods else TRANSIENT_TERMS
    return _Spectrum(frequency, r[strong], u[strong], y[strong], dt, terms)


def _check_coherence(x: _Spectrum) -> None:
    """Refuse an output coherent with the reference at few lines only, before any fit."""
    uu, yy = (_near(np.abs(a) ** 2) for a in (x.r, x.y))
    coherence = np.abs(_near(x.y * x.r.conj())) ** 2 / (uu * np.maximum(yy, 1e-300))
    seen = np.count_nonzero(coherence >= COHERENT)
    if seen < LEAST_EXCITED:
        worst = int(np.argmin(coherence))
        bound = (
            f"must follow the input: coherence must be {COHERENT:g} at {LEAST_EXCITED} lines or "
            f"more, is at {seen}; the lowest is {coherence[worst]:.2g} at "
            f"{x.frequency[worst]:.3g} Hz"
        )
        raise ParameterError("output", f"coherence {np.median(coherence):.2g}", bound)


class _Fitted(NamedTuple):
    """Coefficients, half of their intervals, and the residual of the output at each line."""

    value: np.ndarray
    half: np.ndarray
    model: np.ndarray  # response of the fitted form
    known: np.ndarray  # the part of the input that the reference causes
    left: np.ndarray
    noise: np.ndarray  # standard deviation of the residual
    theta: np.ndarray  # coefficients, and terms of start and end


def _fit_spectrum(what: str, x: _Spectrum, instrument: bool) -> _Fitted:
    """Fit a block, and the terms of start and end, to an output; LinAlgError where nothing fits.

    Least squares of the output, each line weighted by its noise; instrumental variables with a
    reference. Intervals from the residual at each line (HC3 of MacKinnon, White 1985) hold for
    inexact weights; Student's t with the degrees of freedom of Satterthwaite (1946).
    """
    known = x.u if not instrument else x.r * (_near(x.u * x.r.conj()) / _near(np.abs(x.r) ** 2))
    theta, left = _first_guess(what, x), x.y
    noise = np.full(len(x.y), float(np.std(x.y)))
    for _ in range(WEIGHT_ROUNDS):
        theta = _least_squares(what, x, theta, noise)
        if instrument:
            theta = _orthogonal(what, x, known, theta, noise)
        if not np.all(np.isfinite(theta)) or (what != "Th" and min(theta[1:3]) <= 0.0):
            raise np.linalg.LinAlgError("no stable block")
        left = _misfit(what, x, theta)
        spent = len(left) / (len(left) - 0.5 * len(theta))
        floor = LINE_FLOOR * np.abs(x.y)
        noise = np.sqrt(spent * _near(np.abs(left) ** 2) + floor**2)
    columns, tools = (_slopes(what, x, u, theta) for u in (x.u, known))
    gain, half = _intervals(columns, tools, left, noise)
    # the motion between samples is unknown
    lost = response(what, theta[:3], x.frequency) * x.u * (2.0 * np.pi * x.frequency * x.dt) ** 2
    half = np.hypot(half, gain @ real_and_imaginary(lost / 6.0 / noise))[:3]
    model = response(what, theta[:3], x.frequency)
    return _Fitted(theta[:3], half, model, known, left, noise, theta)


def _intervals(
    columns: np.ndarray, tools: np.ndarray, left: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Influence of the residual at each line on the unknowns, (p, 2 lines), and half intervals."""
    from scipy.special import stdtrit

    J, Z = (real_and_imaginary(c.T / noise).T for c in (columns, tools))
    size = np.linalg.norm(J, axis=0)
    gain = np.linalg.solve(Z.T @ J / size, Z.T) / size[:, None]
    hat = np.einsum("lp,pl->l", J, gain).reshape(2, -1).mean(axis=0)
    own = 0.5 * (np.abs(left) / noise / (1.0 - np.minimum(hat, 0.9))) ** 2
    shares = np.square(gain).reshape(len(gain), 2, -1).sum(axis=1) * own
    variance = shares.sum(axis=1)
    freedom = 2.0 * variance**2 / np.maximum(np.sum(shares**2, axis=1), 1e-300)
    half = stdtrit(np.maximum(freedom, 1.0), 0.5 + 0.5 * CONFIDENCE) * np.sqrt(variance)
    return gain, half


def _lag(what: str, x: _Spectrum, found: _Fitted) -> tuple[float, float, np.ndarray]:
    """Delay of the output that the residual shows [s], half its interval, and what it changes."""
    s = 2j * np.pi * x.frequency
    late, tool = (-s * found.model * u for u in (x.u, found.known))
    columns = np.column_stack((_slopes(what, x, x.u, found.theta), late))
    tools = np.column_stack((_slopes(what, x, found.known, found.theta), tool))
    gain, half = _intervals(columns, tools, found.left, found.noise)
    step = gain @ real_and_imaginary(found.left / found.noise)
    return float(step[-1]), float(half[-1]), step[:3]


class _Lag(NamedTuple):
    """Delay of the position [s], half its interval, and by how much it moves the coefficients."""

    late: float
    half: float
    change: np.ndarray


def _position_lag(what: str, found: _Estimate, instrument: bool) -> _Lag:
    """The delay with which block and delay together explain the output best.

    The block is fitted again without the delay, until no delay is left: its own misfit would
    otherwise count as noise and hide it.
    """
    spectrum, fitted, total = found.spectrum, found.fitted, 0.0
    sign = -1.0 if what == "Th" else 1.0  # whose input is the position
    lag, half, change = _lag(what, spectrum, fitted)
    for _ in range(LAG_ROUNDS):
        total += lag
        spectrum = _without_delay(what, found.spectrum, sign * total)
        fitted = _fit_spectrum(what, spectrum, instrument)
        change = found.fitted.value - fitted.value
        lag, half, _ = _lag(what, spectrum, fitted)
        if abs(lag) < LAG_LEFT * half:
            break
    return _Lag(sign * (total + lag), half, change)


def _without_delay(what: str, x: _Spectrum, delay: float) -> _Spectrum:
    """Spectra of which the position comes earlier by a delay [s]."""
    ahead = np.exp(2j * np.pi * x.frequency * delay)
    return x._replace(u=x.u * ahead) if what == "Th" else x._replace(y=x.y * ahead)


def _lag_warning(what: str, found: _Estimate, dt: float, instrument: bool) -> list[str]:
    """A sentence about a delay between the columns, if it matters."""
    with np.errstate(all="ignore"):
        try:
            lag = _position_lag(what, found, instrument)
        except (np.linalg.LinAlgError, ValueError):
            return []
    moved = np.abs(lag.change) / found.fitted.half
    seen = LATE[0] * lag.half < abs(lag.late) < MOST_LATE and abs(lag.late) > LATE[1] * dt
    if not seen or not np.any(moved > LATE[2]):
        return []
    worst, way = int(np.argmax(moved)), "later" if lag.late > 0.0 else "earlier"
    share = 100.0 * abs(float(lag.change[worst] / found.fitted.value[worst]))
    return [
        f"the {INPUTS[what]} acts {abs(lag.late) / dt:.3g} rows ({1e3 * abs(lag.late):.3g} ms, +- "
        f"{1e3 * lag.half:.2g}) {way} than it is logged: a delay between the columns, a filter in "
        f"one, or an input held from row to row (half a row); it moves "
        f"{COEFFICIENT_NAMES[what][worst]} by {share:.2g} %. With the delay of {lag.late:.3g} s it "
        "goes"
    ]


def _near(a: np.ndarray) -> np.ndarray:
    """Mean of each value and its neighbours, fewer where there are few lines."""
    return moving_mean(a, min(max(len(a) // 4, 2), NEIGHBOURS))


def _edge_terms(x: _Spectrum) -> np.ndarray:
    """Powers of s of the terms of start and end, scaled, (lines, terms)."""
    return (1j * x.frequency / x.frequency[-1])[:, None] ** np.arange(x.terms)


def _denominator(what: str, theta: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Denominator of the block, scaled to the highest line."""
    s = 2j * np.pi * f
    return (
        np.ones_like(s) if what == "Th" else (s * s + theta[1] * s + theta[2]) / np.abs(s[-1]) ** 2
    )


def _misfit(what: str, x: _Spectrum, theta: np.ndarray) -> np.ndarray:
    """Output minus the block's output and minus the terms of start and end, (lines,)."""
    edge = _edge_terms(x) @ theta[3:] / _denominator(what, theta, x.frequency)
    return x.y - response(what, theta[:3], x.frequency) * x.u - edge


def _slopes(what: str, x: _Spectrum, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Derivatives of the output for an input u by the coefficients, (lines, 3 + terms)."""
    s = 2j * np.pi * x.frequency
    edge = _edge_terms(x) / _denominator(what, theta, x.frequency)[:, None]
    if what == "Th":
        return np.column_stack((s * s * u, s * u, u, edge))
    A = s * s + theta[1] * s + theta[2]
    out = theta[0] / A * u + edge @ theta[3:]
    return np.column_stack((u / A, -s * out / A, -out / A, edge))


def _first_guess(what: str, x: _Spectrum) -> np.ndarray:
    """Start of the fit: linear least squares, for G and S at the best of some denominators."""
    f = x.frequency
    s = 2j * np.pi * f
    if what == "Th":
        return _solve(np.column_stack((s * s * x.u, s * x.u, x.u, _edge_terms(x))), x.y)[0]
    best, least = np.zeros(3 + x.terms), math.inf
    for omega in 2.0 * np.pi * np.geomspace(f[0], f[-1], 12):
        for ratio in (0.3, 0.7, 2.0):
            theta = np.array((0.0, 2.0 * ratio * omega, omega**2) + x.terms * (0.0,))
            columns = _slopes(what, x, x.u, theta)[:, [0, *range(3, 3 + x.terms)]]
            (theta[0], *theta[3:]), cost = _solve(columns, x.y)
            if cost < least:
                best, least = theta, cost
    return best


def _solve(columns: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Real least squares of complex equations: unknowns, and the squared residual."""
    A = real_and_imaginary(columns.T).T
    size = np.linalg.norm(A, axis=0)
    A = A / size
    found = matrices.least_squares(A, real_and_imaginary(y))
    return found / size, float(np.sum((real_and_imaginary(y) - A @ found) ** 2))


def _least_squares(what: str, x: _Spectrum, theta: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Least squares of the residual, each line weighted by its noise."""
    from scipy.optimize import least_squares

    size = 1.0 / np.linalg.norm(_slopes(what, x, x.u, theta) / noise[:, None], axis=0)

    def slope(z: np.ndarray) -> np.ndarray:
        return -real_and_imaginary((_slopes(what, x, x.u, z * size) * size).T / noise).T

    derivative: Any = slope
    found = least_squares(
        lambda z: real_and_imaginary(_misfit(what, x, z * size) / noise),
        theta / size,
        derivative,
        method="lm",
        xtol=1e-12,
        ftol=1e-14,
    )
    return found.x * size


def _orthogonal(
    what: str, x: _Spectrum, known: np.ndarray, theta: np.ndarray, noise: np.ndarray
) -> np.ndarray:
    """Iterate until the residual is orthogonal to the columns of the known part of the input."""
    for _ in range(100):
        J, Z = (real_and_imaginary(_slopes(what, x, u, theta).T / noise).T for u in (x.u, known))
        size = np.linalg.norm(Z, axis=0)
        left = real_and_imaginary(_misfit(what, x, theta) / noise)
        step = matrices.least_squares((Z / size).T @ J / size, (Z / size).T @ left) / size
        theta = theta + step
        if np.all(np.abs(step[:3]) <= 1e-9 * np.abs(theta[:3])):
            break
    return theta


def _averaged_response(x: _Spectrum, found: _Fitted) -> Averaged:
    """Frequency, response, its deviation and coherence, averaged over up to 40 bands.

    The residual is projected on the block's output, so curvature within a band has no effect.
    """
    edges = np.geomspace(x.frequency[0], x.frequency[-1], MULTISINE_LINES + 1)
    place = np.clip(np.searchsorted(edges, x.frequency, "right") - 1, 0, MULTISINE_LINES - 1)
    if x.terms == 0:  # of a period, each line by itself
        place = np.arange(len(x.frequency))
    _, place = np.unique(place, return_inverse=True)

    def total(a: np.ndarray) -> np.ndarray:
        out = np.zeros(place[-1] + 1, dtype=a.dtype)
        np.add.at(out, place, a)
        return out

    count = total(np.ones(len(place)))
    frequency = total(x.frequency) / count
    made = found.model * found.known
    size = total(np.abs(made) ** 2)
    middle = np.interp(frequency, x.frequency, found.model.real) + 1j * np.interp(
        frequency, x.frequency, found.model.imag
    )
    response_ = middle * (1.0 + total(made.conj() * found.left) / size)
    deviation = np.abs(middle) * np.sqrt(total(np.abs(made * found.noise) ** 2)) / size
    coherence = size / (size + total(found.noise**2))
    return frequency, response_, deviation, coherence
