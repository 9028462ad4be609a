"""Identification of G, Sh and Th on the simulated arm, as in the paper (Sec. 4, Figs. 4-6).

A multisine drives the handle, input and output are recorded at every sample, the frequency response
is estimated over whole periods (R. Pintelon, J. Schoukens, System Identification: A Frequency
Domain Approach, 2nd ed., Wiley 2012), and the printed form is fitted to it by weighted least
squares. Method and limits: docs/identify.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np

from .. import matrices
from ..arguments import function_of, named, part
from ..display import fields_of, table_of
from ..errors import Bound, ParameterError, Real, integer, numbers_of
from ..fields import Axis, Seed
from ..formulas import arm as arm_law
from ..model import arm
from ..model.arm import Arm
from ..model.constants import AXES, L1, L2, TS, G, S
from ..model.operator import Operator
from ..model.signals import Multisine
from ..results import Result
from ..scene.scenario import Control, Position, Scenario
from ..simulation.record import Record
from ..simulation.simulate import simulate

RESPONSE_UNITS = {"G": "m/m", "S": "m/N", "Th": "N/m"}
NOMINAL_POSE = (L2, L1)  # world position of the handle where the elbow is square [m]
Block = Literal["G", "S", "Th"]
BLOCK_KINDS = get_args(Block)
COEFFICIENT_NAMES = {
    "G": ("gain", "damping", "stiffness"),
    "S": ("gain", "damping", "stiffness"),
    "Th": ("mass", "damper", "spring"),
}
COEFFICIENT_UNITS = {
    "G": ("1/s^2", "1/s", "1/s^2"),
    "S": ("1/kg", "1/s", "1/s^2"),
    "Th": ("kg", "N.s/m", "N/m"),
}
ROTARY_UNITS = {"kg": "kg.m^2", "1/kg": "1/(kg.m^2)", "N.s/m": "N.m.s/rad", "N/m": "N.m/rad"}
ROTARY_UNITS |= {"m/N": "rad/(N.m)", "m/m": "rad/rad"}  # in place of those along a line
IDENTIFICATION_BAND = {"G": (0.15, 20.0), "S": (0.15, 20.0), "Th": (0.08, 3.0)}  # [Hz]
PERIOD = {"G": 5.0, "S": 5.0, "Th": 10.0}  # [s]
AMPLITUDE = {"G": 2e-3, "S": 2e-3, "Th": 1e-2}  # [m]: small enough to keep the pose; none for Th
MULTISINE_LINES = 40
REALISATIONS = 8  # runs; rounding errors of one run are flat-topped, and t over four is too short
COHERENT = 0.5  # least coherence of a usable line
# Relative deviation of the loop from the fitted form at AMPLITUDE, in runs without noise; SHAPED
# for Sh where it holds at every pose.
SETTLING = {"G": 5e-9, "S": 5e-5, "Th": 2e-7}
SHAPED = 5e-9
LINE_FLOOR = 1e-6  # least relative deviation of a line in the fit
SMOOTHED_LINES = 5  # lines over which the scatter of the response is averaged
NOISE_ROUNDS = 3  # of a fit of the noise, each weighted by the one before; two settle
CONFIDENCE = 0.95


Band = Annotated[tuple[Real, Real] | None, Bound(0.0, unit="Hz", above=True, names=("low", "high"))]


@part("noise.")
class Noise:
    """Noise of the sensors. The paper prints no figure; these are ours.

    Attributes:
        encoder_counts: counts per turn of each joint's quadrature encoder.
        force: rms of the force sensor, white [N].
    """

    encoder_counts: Annotated[int, Bound(100, 2**40)] = 65_536
    force: Annotated[Real, Bound(0.0, 1e3, "N")] = 0.02


@named
@dataclass(frozen=True)
class Coefficient:
    """One coefficient of a fit.

    Attributes:
        name: one of COEFFICIENT_NAMES.
        unit: its unit.
        printed: value in the paper.
        value: fitted value.
        low: lower end of the 95 % confidence interval.
        high: upper end of the 95 % confidence interval.
    """

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


class Estimate(NamedTuple):
    """A frequency response estimated from runs, (lines,) each."""

    response: np.ndarray  # complex
    deviation: np.ndarray  # of the response
    coherence: np.ndarray  # of measured input and output
    errors: np.ndarray | None  # contribution of each run, (runs, lines); None for a single run


@named
@dataclass(frozen=True, eq=False, repr=False)
class Identified(Result):
    """A frequency response and the coefficients fitted to it.

    Attributes:
        what: "G" [m/m], "S" (Sh) [m/N] or "Th" [N/m].
        axis: "x" or "y".
        frequency: lines of the multisine, or middles of bands of a measured spectrum [Hz], (n,).
        response: complex, (n,), in the unit of what.
        deviation: standard deviation of response, by its scatter over the runs, (n,).
        coherence: of measured input and output over all periods, (n,).
        coefficients: of gain/(s^2 + damping s + stiffness), or of mass s^2 + damper s + spring,
            with 95 % intervals from the scatter of the runs.
        scenario: of the first run; None for measured columns.
        noise: noise added to the records; None for none.
        seed: of phases and noise.
        periods: periods kept of each run; 0 for a measured record without a period.
        realisations: number of runs.
        source: name of the measured columns; empty for the simulated arm.
        warnings: limits of the result, one sentence each.
        rotary: whether the position is an angle and the force a torque.
    """

    drawn_by = "hapticclay.views.identification_plots:identified_plot"
    written_as = "identify"

    what: str
    axis: str
    frequency: np.ndarray
    response: np.ndarray
    deviation: np.ndarray
    coherence: np.ndarray
    coefficients: tuple[Coefficient, ...]
    scenario: Scenario | None
    noise: Noise | None
    seed: int
    periods: int
    realisations: int
    source: str = ""
    warnings: tuple[str, ...] = ()
    rotary: bool = False

    def headline(self) -> str:
        """Block, axis or source, and coefficients with their intervals, in one line."""
        coefficients = (
            f"{c.name} {c.value:.5g} ({c.low:.5g} to {c.high:.5g}) {c.unit}"
            for c in self.coefficients
        )
        return f"{self.what} of {self.source or self.axis}: {', '.join(coefficients)}"

    def tables(self) -> dict[str, dict[str, Any]]:
        """Coefficients, and the response beside those of the fit and of the paper."""
        names = ("name", "unit", "printed", "value", "low", "high")
        return {
            "coefficients": table_of(names, self.coefficients),
            "response": response_tables([self])[self.axis],
        }

    @property
    def estimate(self) -> str:
        """How the response was estimated, in words."""
        if self.periods:
            return f"lines of {self.periods} whole periods"
        return "whole record, with its start and end"

    @property
    def response_unit(self) -> str:
        """Unit of the response."""
        return unit_of(RESPONSE_UNITS[self.what], self.rotary)

    @property
    def device(self) -> tuple[float, float, float]:
        """Mass [kg], damper [N.s/m] and spring [N/m] of what moves: a device, or an arm at a pose.

        Of a rotary one inertia [kg.m^2], damper [N.m.s/rad] and spring [N.m/rad].

        Raises:
            ParameterError: of G, whose input is no force.
        """
        if self.what == "G":
            raise ParameterError("what", self.what, 'must be "S" or "Th": their input is a force')
        a, b, c = self.values
        return (a, b, c) if self.what == "Th" else (1.0 / a, b / a, c / a)

    @property
    def values(self) -> tuple[float, ...]:
        """The fitted coefficients, in order."""
        return tuple(c.value for c in self.coefficients)

    def contents(self) -> dict[str, Any]:
        """Everything, with the scenario or the source."""
        data = fields_of(self, "response", "source", "scenario")
        if self.scenario:
            data["scenario"] = self.scenario
        else:
            data |= {"source": self.source, "estimate": self.estimate}
        return data | {
            "coefficients": [{**fields_of(c), "error": c.error} for c in self.coefficients],
            "real": self.response.real,
            "imaginary": self.response.imag,
            "units": {"frequency": "Hz", "response": self.response_unit},
        }


def response_tables(results: Sequence[Identified], paper: bool = True) -> dict[str, dict[str, Any]]:
    """The response of a block by axis, beside those of its fit and, with `paper`, of the paper."""
    unit = results[0].response_unit
    out: dict[str, dict[str, Any]] = {}
    for r in results:
        table: dict[str, Any] = {"frequency [Hz]": r.frequency}
        curves = {
            "measured": r.response,
            "printed": response(r.what, printed_form(r.what, r.axis), r.frequency),
            "fitted": response(r.what, r.values, r.frequency),
        }
        if not paper:
            del curves["printed"]
        for name, H in curves.items():
            table |= {f"{name}, real [{unit}]": H.real, f"{name}, imaginary [{unit}]": H.imag}
        table |= {f"deviation [{unit}]": r.deviation, "coherence": r.coherence}
        out[r.axis] = table
    return out


def endpoint_mobility(x: float, y: float) -> tuple[float, float]:
    """Diagonal of the arm's mobility, Wxx and Wyy [1/kg]."""
    links = Arm().links
    q1, q2 = arm_law.inverse_kinematics(x, y, links)
    wxx, _, wyy = arm_law.mobility(arm.jacobians(q1, q2, links), links)
    return float(wxx), float(wyy)


def measured(
    record: Record, noise: Noise | None, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Handle position [m] and hand force [N], (n, 2) each, as measured by the sensors."""
    if noise is None:
        return record.p, record.fh
    count = 2.0 * np.pi / noise.encoder_counts
    q = count * np.round(record.q / count)
    u1x, u1y, u2x, u2y = arm.jacobians(q[:, 0], q[:, 1], record.scenario.arm.links)
    p = np.column_stack((u1y + u2y, -u1x - u2x)) - record.scenario.origin
    return p, record.fh + rng.normal(0.0, noise.force, record.fh.shape)


@part()
class Identification:
    """Identify one block of the loop on one axis; the compensator is off (K = 0).

    G is excited by a command, Sh by a muscle force. For Th the operator's arm holds a handle moved
    by a command.

    Attributes:
        axis: "x" or "y".
        what: "G", "S" (Sh) or "Th".
        origin: world position about which the handle moves [m].
        inertia_shaping: True lets the servo shape the inertia, so that Sh holds at every pose.
        noise: of the sensors; None for none.
        seed: of the phases and of the noise.
        band: lowest and highest frequency [Hz], to 0.1/dt; None for (0.15, 20), Th (0.08, 3).
        period: of the multisine [s], rounded up to a number of samples that is quick to transform;
            None for 5, Th 10.
        periods: kept of each run, after one that is discarded.
        realisations: number of runs, each with its own phases. With coarse encoders, intervals of
            fewer than eight hold the truth less often than stated (docs/intervals.md).
        lines: of the multisine, spread over the logarithm of frequency; fewer where the period is
            too short for them.
        amplitude: rms of the handle's motion to aim at [m]; None for 2e-3, Th 1e-2.
        control: "continuous", or "sampled" (slow, about real time).
        dt: physics and control step [s].
        progress: called after each run with (runs made, runs in all).
    """

    axis: Axis = "x"
    what: Block = "G"
    _: KW_ONLY
    origin: Position = NOMINAL_POSE
    inertia_shaping: bool = False
    noise: Noise | None = None
    seed: Seed = 0
    band: Band = None
    period: Annotated[Real | None, Bound(0.1, 1000.0, "s")] = None
    periods: Annotated[int, Bound(1, 1000)] = 2
    realisations: Annotated[int, Bound(1, 1000)] = REALISATIONS
    lines: Annotated[int, Bound(3, 100_000)] = MULTISINE_LINES
    amplitude: Annotated[Real | None, Bound(0.0, 1.0, "m", above=True)] = None
    control: Control = "continuous"
    dt: float = TS
    progress: Callable[[int, int], None] | None = None

    def scenario(self) -> Scenario:
        """The run without its signal."""
        return Scenario(
            name=f"identify {self.what} {self.axis}",
            gain=(0.0, 0.0),
            force=(0.0, 0.0),
            origin=self.origin,
            operator=Operator() if self.what == "Th" else None,
            inertia_shaping=self.inertia_shaping,
            control=self.control,
            dt=self.dt,
            length=None,
        )

    def identified(self) -> Identified:
        """Makes the runs, and fits the block to them."""
        from scipy.fft import next_fast_len

        what, noise = self.what, self.noise
        i, seed, realisations = AXES.index(self.axis), self.seed, self.realisations
        periods = integer("periods", self.periods, 1 if realisations > 1 else 2, 1000)
        size = AMPLITUDE[what] if self.amplitude is None else self.amplitude
        length = PERIOD[what] if self.period is None else self.period
        base = self.scenario()
        n = int(next_fast_len(math.ceil(length / base.dt - 1e-9)))  # type: ignore[arg-type]
        gain = (
            S[i].gain if self.inertia_shaping or what != "S" else endpoint_mobility(*base.origin)[i]
        )
        rms = size * S[i].stiffness / gain if what == "S" else size
        along = (rms, 0.0) if i == 0 else (0.0, rms)
        band = IDENTIFICATION_BAND[what] if self.band is None else self.band
        wave = _multisine(along, band, n * base.dt, self.lines, 0.1 / base.dt)
        base = replace(base, t_max=(1 + periods) * wave.period)
        seeds = np.random.SeedSequence(seed).generate_state(2 * realisations).reshape(2, -1)
        drive = "muscle" if what == "S" else "command"
        scenarios = [replace(base, **{drive: replace(wave, seed=x)}) for x in seeds[0].tolist()]
        signals = []
        for made, (scenario, x) in enumerate(zip(scenarios, seeds[1].tolist(), strict=True), 1):
            record = simulate(scenario)
            if record.outcome.code != "time limit" or record.outcome.cause:
                bound = "the handle must move for all of the run, its motors within their limits"
                raise ParameterError("amplitude", size, f"{bound}: {record.status}")
            shown = measured(record, noise, np.random.default_rng(x))
            signals.append(_signals(what, i, record, *shown, slice(n, (1 + periods) * n)))
            if self.progress:
                self.progress(made, realisations)
        bins = np.round(wave.omega / (2.0 * np.pi) * wave.period).astype(int)
        frequency = bins / wave.period
        found = estimate_response(np.array(signals), n, bins)
        # The difference equation of the continuous loop; no second-order one describes a hold.
        step = base.dt if self.control == "continuous" else None
        settling = SHAPED if what == "S" and self.inertia_shaping else SETTLING[what]
        floor = settling * (size / AMPLITUDE[what]) ** 2
        value, half = fit(
            what, frequency, found.response, noise_deviation(found), found.errors, step
        )
        half = np.hypot(half, floor * np.abs(value))
        return Identified(
            what, self.axis, frequency, *found[:3], coefficients_of(what, self.axis, value, half),
            scenarios[0], noise, seed, periods, realisations,
        )  # fmt: skip


identify = function_of(
    Identification,
    "identify",
    Identification.identified,
    "a value is out of its bounds, the handle cannot be there, or a run ended early or met the "
    "limits of the motors.",
)


def _multisine(
    rms: tuple[float, float], band: object, period: float, lines: int, limit: float
) -> Multisine:
    """A multisine with the requested lines, or as many as the period has, at least three."""
    low, high = numbers_of("band", band, ("low", "high"), 0.0, limit, above=True, unit="Hz")
    most = math.floor(high * period + 1e-9) - math.ceil(low * period - 1e-9) + 1
    if most < 3:
        bound = f"must contain at least 3 multiples of 1/period = {1.0 / period:.4g} Hz"
        raise ParameterError("band", (low, high), bound)
    return Multisine(rms, low, high, period, min(lines, most))


def _signals(
    what: str, i: int, record: Record, p: np.ndarray, fh: np.ndarray, part: slice
) -> np.ndarray:
    """Reference, input and output of axis i over part of a record, (3, samples)."""
    wave = record.scenario.muscle or record.scenario.command
    assert wave is not None
    given, out = {"G": (record.delta, p), "S": (fh, p), "Th": (p, -fh)}[what]
    return np.array((wave(record.t[part])[:, i], given[part, i], out[part, i]))


def format_coefficient(c: Coefficient) -> str:
    """Fitted value and half its interval, to two digits of the latter: "41.793 +- 0.012"."""
    half = 0.5 * (c.high - c.low)
    digits = max(0, 1 - math.floor(math.log10(half))) if half > 0.0 else 6
    return f"{c.value:.{digits}f} \u00b1 {half:.{digits}f}"


def printed_form(what: str, axis: str) -> tuple[float, ...]:
    """The printed coefficients of G (Eqs. 15, 16), Sh (Eqs. 17, 18) or Th (Eq. 19)."""
    i = AXES.index(axis)
    block = {"G": G[i], "S": S[i], "Th": Operator()}[what]
    return tuple(getattr(block, name) for name in COEFFICIENT_NAMES[what])


def response(
    what: str,
    coefficients: tuple[float, ...] | np.ndarray,
    frequency: np.ndarray,
    dt: float | None = None,
) -> np.ndarray:
    """Complex response of a block at frequencies [Hz], (n,); `dt`: that of the stepped loop."""
    s2, s, one = _derivatives(frequency, dt)
    a, b, c = coefficients
    return a * s2 + b * s + c * one if what == "Th" else a / (s2 + b * s + c)


def _slopes(
    what: str, coefficients: np.ndarray, frequency: np.ndarray, dt: float | None
) -> np.ndarray:
    """Derivatives of `response` by the coefficients, (3, n)."""
    s2, s, one = _derivatives(frequency, dt)
    if what == "Th":
        return np.stack((s2, s, one))
    a, b, c = coefficients
    size = 1.0 / (s2 + b * s + c)
    return np.stack((size, -a * s * size**2, -a * size**2))


def _derivatives(
    frequency: np.ndarray, dt: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Responses of second derivative, first derivative and mean at frequencies [Hz].

    With `dt` those of the loop's steps: central differences, and the mean (1, 2, 1)/4 of positions.
    """
    omega = 2.0 * np.pi * frequency
    if dt is None:
        return -(omega**2), 1j * omega, np.ones_like(omega)
    half = 0.5 * omega * dt
    return -((2.0 * np.sin(half) / dt) ** 2), 1j * np.sin(2.0 * half) / dt, np.cos(half) ** 2


def estimate_response(signals: np.ndarray, n: int, bins: np.ndarray) -> Estimate:
    """Response at multiples `bins` of 1/period, from (runs, 3, samples): reference, input, output.

    The reference has no noise, so S_ry/S_ru is unbiased even with noise on the input and in a
    closed loop (Pintelon, Schoukens 2012, sec. 2.6.4). Windows of n samples, a period, do not leak.
    """
    windows = signals[..., : signals.shape[-1] // n * n]
    windows = windows.reshape(*signals.shape[:2], -1, n)
    single = len(windows) == 1
    if single:  # the scatter is that over its periods
        windows = np.swapaxes(windows, 0, 2)
    r, u, y = np.moveaxis(np.fft.rfft(windows)[..., bins], 1, 0)

    def spectrum(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a.conj() * b).mean(axis=1)

    ru, ry = spectrum(r, u), spectrum(r, y)
    H = ry.mean(axis=0) / ru.mean(axis=0)
    errors = (ry - H * ru) / ru.mean(axis=0)
    share = moving_mean(_scatter(errors) / np.abs(H) ** 2, SMOOTHED_LINES // 2)
    uu, yy, uy = (spectrum(a, b).mean(axis=0) for a, b in ((u, u), (y, y), (u, y)))
    coherence = np.minimum(np.abs(uy) ** 2 / (uu.real * yy.real), 1.0)
    return Estimate(H, np.sqrt(share) * np.abs(H), coherence, None if single else errors)


def _scatter(errors: np.ndarray) -> np.ndarray:
    """Variance of the mean response at each line, from the contributions of runs (runs, lines)."""
    return np.sum(np.abs(errors) ** 2, axis=0) / (len(errors) - 1) / len(errors)


def noise_deviation(found: Estimate) -> np.ndarray:
    """Standard deviation of each line under white noise of input and output, (lines,).

    Two parameters are fitted to the scatter of all lines: that of few lines over few runs would
    favour lines with accidentally small errors. Intervals hold for any weights.
    """
    from scipy.optimize import nnls

    if found.errors is None:
        return found.deviation
    power = np.abs(found.response) ** 2
    shapes = np.stack((np.full_like(power, power.mean()), power), axis=1)
    scatter, variance = _scatter(found.errors), found.deviation**2
    for _ in range(NOISE_ROUNDS):
        variance = variance + LINE_FLOOR**2 * power
        variance = shapes @ nnls(shapes / variance[:, None], scatter / variance)[0]
    return np.sqrt(variance)


def moving_mean(x: np.ndarray, half: int) -> np.ndarray:
    """Mean of each value and its `half` neighbours on each side, fewer at the ends."""
    at, total = np.arange(len(x)), np.concatenate(([0.0], np.cumsum(x)))
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, len(x))
    return (total[high] - total[low]) / (high - low)


def real_and_imaginary(z: np.ndarray) -> np.ndarray:
    """Real parts, then imaginary parts, along the last axis."""
    return np.concatenate((z.real, z.imag), axis=-1)


def fit(
    what: str,
    frequency: np.ndarray,
    H: np.ndarray,
    deviation: np.ndarray,
    errors: np.ndarray | None = None,
    dt: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of a block, and half of their 95 % intervals, from a response.

    Least squares of the complex misfit, each line weighted by its deviation. Intervals follow from
    the influence of each run on the coefficients (Student's t, one degree of freedom fewer than
    runs): encoder counts cause errors common to all lines, which leave no misfit. For a single run
    (`errors` None) they follow from the misfit.
    """
    from scipy.optimize import least_squares
    from scipy.special import stdtrit

    sigma = np.hypot(deviation, LINE_FLOOR * np.abs(H))
    start = _linear(what, frequency, H, dt)

    def misfit(x: np.ndarray) -> np.ndarray:
        return real_and_imaginary((H - response(what, x * start, frequency, dt)) / sigma)

    def slope(x: np.ndarray) -> np.ndarray:
        columns = _slopes(what, x * start, frequency, dt) * start[:, None]
        return -real_and_imaginary(columns / sigma).T

    derivative: Any = slope
    found = least_squares(misfit, np.ones(3), derivative, method="lm", xtol=1e-14, ftol=1e-14)
    if errors is None:
        freedom = 2 * len(H) - 3
        variance = np.diag(np.linalg.inv(found.jac.T @ found.jac)) * 2.0 * found.cost / freedom
    else:
        runs = len(errors)
        freedom = runs - 1
        moves = np.linalg.pinv(found.jac) @ real_and_imaginary(errors / sigma).T
        variance = np.sum(moves**2, axis=1) / (runs * freedom)
    half = stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE) * np.sqrt(variance)
    return found.x * start, half * np.abs(start)


def _linear(what: str, frequency: np.ndarray, H: np.ndarray, dt: float | None) -> np.ndarray:
    """Start of the fit: the form made linear in its coefficients (Levy 1959), relative misfit."""
    s2, s, one = _derivatives(frequency, dt)
    if what == "Th":
        A, b = np.stack((s2, s, one), axis=1) / H[:, None], np.ones_like(H)
    else:
        size = np.abs(s2)
        A = np.stack((1.0 / H, -s, -np.ones_like(s)), axis=1) / size[:, None]
        b = s2 / size + 0j
    both = np.concatenate((A.real, A.imag)), np.concatenate((b.real, b.imag))
    return matrices.least_squares(*both)


def unit_of(unit: str, rotary: bool) -> str:
    """A unit along a line, or what stands for it about an axis."""
    return ROTARY_UNITS.get(unit, unit) if rotary else unit


def coefficients_of(
    what: str, axis: str, value: np.ndarray, half: np.ndarray, rotary: bool = False
) -> tuple[Coefficient, ...]:
    """Fitted coefficients and half of their intervals, (3,) each, beside the printed ones."""
    names, units = COEFFICIENT_NAMES[what], [unit_of(x, rotary) for x in COEFFICIENT_UNITS[what]]
    rows = zip(names, units, printed_form(what, axis), value.tolist(), half.tolist(), strict=True)
    return tuple(
        Coefficient(name, unit, known, x, x - h, x + h) for name, unit, known, x, h in rows
    )
