"""Identification of G, Sh and Th on the simulated arm, as the paper did it on the real one (Sec. 4, Figs. 4-6).

A multisine drives the handle, input and output are recorded every sample, the frequency response is estimated over
whole periods, and the printed form is fitted to it. Method and what limits it: docs/identify.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..errors import ParameterError, choice, flag, integer, number, numbers_of, pair
from ..model import arm
from ..model.scenario import AXES, L1, L2, TS, Multisine, Operator, S, Scenario
from ..model.signals import Signal
from ..simulation.record import Record, versions
from ..simulation.simulate import simulate
from . import estimation
from .estimation import Coefficient

SCHEMA = "hapticclay-identify-1"
NOMINAL = (L2, L1)  # world position of the handle where the elbow is square [m]
BAND = {"G": (0.15, 20.0), "S": (0.15, 20.0), "Th": (0.08, 3.0)}  # [Hz], either side of the corner
PERIOD = {"G": 5.0, "S": 5.0, "Th": 10.0}  # [s]
AMPLITUDE = {"G": 2e-3, "S": 2e-3, "Th": 1e-2}  # [m]: small, so that the pose stays; Th is the same at every pose
LINES = 40
LEFT = {"G": 5e-9, "S": 5e-5, "Th": 2e-7}  # between loop and fitted form at AMPLITUDE, by runs without noise ...
SHAPED = 5e-9  # ... of Sh where it holds at every pose


@dataclass(frozen=True)
class Noise:
    """What the sensors add. The paper prints no figure; these are ours.

    Attributes:
        encoder_counts: of each joint's quadrature encoder, a turn. force: rms of the force sensor, white [N].
    """

    encoder_counts: int = 65_536
    force: float = 0.02

    def __post_init__(self):
        object.__setattr__(self, "encoder_counts", integer("noise.encoder_counts", self.encoder_counts, 100, 2**40))
        object.__setattr__(self, "force", number("noise.force", self.force, 0.0, 1e3, unit="N"))


@dataclass(frozen=True, eq=False)
class Identified:
    """A frequency response and what was fitted to it.

    Attributes:
        what, axis: "G" [m/m], "S" (Sh) [m/N] or "Th" [N/m], of "x" or "y".
        frequency: lines of the multisine [Hz], (n,). response: complex, (n,), in the unit of what.
        deviation: standard deviation of response, by its scatter over the runs, (n,).
        coherence: of measured input and output over all periods, (n,).
        coefficients: of gain/(s^2 + damping s + stiffness), or of mass s^2 + damper s + spring, with 95 % intervals
            from the scatter of the runs.
        scenario: of the first run. noise: what was added to the records. seed: of phases and noise.
        periods: kept of each run. realisations: number of runs.
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


def mobility(x: float, y: float) -> tuple[float, float]:
    """Wxx and Wyy of the arm with its handle at world (x, y) [1/kg]."""
    q1, q2 = arm.inverse(x, y)
    wxx, _, wyy = arm.mobility(*arm.columns(np.sin(q1), np.cos(q1), np.sin(q1 + q2), np.cos(q1 + q2)))
    return float(wxx), float(wyy)


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
    u1x, u1y, u2x, u2y = arm.columns(*(f(x) for x in (q[:, 0], a) for f in (np.sin, np.cos)))  # type: ignore[arg-type]
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

    A command drives G and a muscle force Sh; for Th the operator's arm holds a handle that a command moves.

    Args:
        axis: "x" or "y". what: "G", "S" (Sh) or "Th".
        origin: world position about which the handle moves [m].
        shaping: True lets the servo shape the inertia, so that Sh holds at every pose.
        noise: of the sensors; None for none.
        seed: of the phases and of the noise.
        band: lowest and highest frequency [Hz], to 0.1/dt; None for (0.15, 20), Th (0.08, 3).
        period: of the multisine [s], rounded up to a number of samples that is quick to transform; None for 5, Th 10.
        periods: kept of each run, after one that is discarded.
        realisations: number of runs, each with phases of its own.
        lines: of the multisine, spread over the logarithm of frequency; fewer where the period is too short for them.
        amplitude: rms of the handle's motion that is aimed at [m]; None for 2e-3, Th 1e-2.
        control: "continuous", or "sampled" (slow, about real time). dt: physics and control step [s].
        progress: called after each run with (runs made, runs in all).

    Raises:
        ParameterError: a value is out of its bounds, the handle cannot be there, or a run did not last or met the
            limits of the motors.
    """
    from scipy.fft import next_fast_len

    i = AXES.index(choice("axis", axis, AXES))
    choice("what", what, estimation.KINDS)
    if not isinstance(noise, Noise | None):
        raise ParameterError("noise", noise, "must be a Noise or None")
    seed = integer("seed", seed, 0, 2**32 - 1)
    realisations = integer("realisations", realisations, 1, 1000)
    periods = integer("periods", periods, 1 if realisations > 1 else 2, 1000)
    size = number("amplitude", AMPLITUDE[what] if amplitude is None else amplitude, 0.0, 1.0, above=True, unit="m")
    length = number("period", PERIOD[what] if period is None else period, 0.1, 1000.0, unit="s")
    base = Scenario(
        name=f"identify {what} {axis}", gain=(0.0, 0.0), force=(0.0, 0.0), origin=pair("origin", origin, unit="m"),
        operator=Operator() if what == "Th" else None, shaping=flag("shaping", shaping), control=control, dt=dt,
        length=None,
    )  # fmt: skip
    n = int(next_fast_len(math.ceil(length / base.dt - 1e-9)))  # type: ignore[arg-type]
    gain = S[i].gain if shaping or what != "S" else mobility(*base.origin)[i]
    rms = size * S[i].stiffness / gain if what == "S" else size
    wave = _multisine((rms, 0.0) if i == 0 else (0.0, rms), band or BAND[what], n * base.dt, lines, 0.1 / base.dt)
    base = replace(base, t_max=(1 + periods) * wave.period)
    phases, noises = np.random.SeedSequence(seed).generate_state(2 * realisations).reshape(2, -1).tolist()
    scenarios = [replace(base, **{"muscle" if what == "S" else "command": replace(wave, seed=x)}) for x in phases]
    signals = []
    for made, (scenario, x) in enumerate(zip(scenarios, noises, strict=True), 1):
        record = simulate(scenario)
        if record.outcome.code != "time limit" or record.outcome.cause:
            bound = f"the handle must move for all of the run, its motors within their limits: {record.status}"
            raise ParameterError("amplitude", size, bound)
        shown = measured(record, noise, np.random.default_rng(x))
        signals.append(_signals(what, i, record, *shown, slice(n, (1 + periods) * n)))
        if progress:
            progress(made, realisations)
    bins = np.round(Signal(wave).omega / (2.0 * np.pi) * wave.period).astype(int)
    frequency = bins / wave.period
    found = estimation.estimate(np.array(signals), n, bins)
    step = base.dt if control == "continuous" else None  # no difference equation of second order holds the hold
    least = (SHAPED if what == "S" and shaping else LEFT[what]) * (size / AMPLITUDE[what]) ** 2
    fitted = estimation.coefficients(what, axis, frequency, found, step, least)
    return Identified(what, axis, frequency, *found[:3], fitted, scenarios[0], noise, seed, periods, realisations)


def _multisine(rms, band: object, period: float, lines: int, limit: float) -> Multisine:
    """A multisine in band, of so many lines or as many as the period has room for, three at least."""
    low, high = numbers_of("band", band, ("low", "high"), 0.0, limit, above=True, unit="Hz")
    lines = integer("lines", lines, 3, 100_000)
    most = math.floor(high * period + 1e-9) - math.ceil(low * period - 1e-9) + 1
    if most < 3:
        raise ParameterError("band", (low, high), f"must hold 3 multiples of 1/period = {1.0 / period:.4g} Hz or more")
    return Multisine(rms, low, high, period, min(lines, most))


def _signals(what: str, i: int, record: Record, p: np.ndarray, fh: np.ndarray, part: slice) -> np.ndarray:
    """Reference, input and output of axis i over part of a record, (3, samples)."""
    wave = record.scenario.muscle or record.scenario.command
    assert wave is not None
    given, out = {"G": (record.delta, p), "S": (fh, p), "Th": (p, -fh)}[what]
    return np.array((Signal(wave)(record.t[part])[:, i], given[part, i], out[part, i]))
