"""The impedance at the hand, measured with a multisine in simulation, and the computed one.

The muscle force is a multisine small enough that the arm stays linear. After the transient the
response is evaluated at its lines over whole periods, as in `identification`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named
from ..errors import Bound, ParameterError, Real
from ..model.constants import AXES
from ..model.signals import Multisine
from ..results import Result, figure_of
from ..scene.scenario import Scenario
from ..simulation.simulate import simulate
from ..theory.impedance import Impedance
from .identification import _multisine, estimate_response
from .wall import Port, Subject, Wall, as_wall

IMPEDANCE_BAND = (0.5, 30.0)  # [Hz]
IMPEDANCE_PERIOD = 4.0  # [s]
IMPEDANCE_LINES = 24
MOTION = 1e-5  # [m] rms: the pose changes the mobility by 4e-5 of it
LONGEST_STEP = 1e-4  # [s] of the engine: its error is (omega dt)^2/6, 6e-5 at 30 Hz
STEPS_TRIED = 24  # step numbers per sample to try, until the delay falls on a step
SETTLING_PERIODS = (2, 6, 22)  # periods discarded until the response has settled
STEADY_RESPONSE = 1e-4  # relative deviation of the impedance from period to period
LINEAR_MOTION = "must leave the motion linear: "


@named
@dataclass(frozen=True, eq=False, repr=False)
class MeasuredImpedance(Result):
    """An impedance measured on a run, with the computed one at the same frequencies.

    Attributes:
        subject: the loop or wall that was run.
        measured: by the run, at the lines.
        computed: by theory, at the lines.
        deviation: relative change of the measured Z from period to period, shape (n,): the residual
            transient.
        scenario: the run.
        notes: effects in the run that theory neglects.
    """

    drawn_by = "hapticclay.views.impedance_plots:impedance_plot"
    written_as = "impedance"
    printed = {
        "measured": (
            "f [Hz]",
            "effective stiffness [N/m]",
            "effective damping [N.s/m]",
            "effective mass [kg]",
            "off theory",
            "|fe/fh|",
        )
    }
    formats = {"off theory": ".4f %"}

    subject: Subject
    measured: Impedance
    computed: Impedance
    deviation: np.ndarray
    scenario: Scenario
    notes: tuple[str, ...] = ()

    def headline(self) -> str:
        """Band and deviation of measured from computed impedance, in one line."""
        f = self.measured.frequency
        return f"{f[0]:.3g} to {f[-1]:.3g} Hz, {100.0 * self.gap:.2g} % from the computed one"

    @property
    def gap(self) -> float:
        """Largest relative difference of the measured Z from the computed one."""
        return float(np.max(np.abs(self.measured.Z / self.computed.Z - 1.0)))

    @property
    def felt_gap(self) -> float:
        """Largest relative difference of the measured fe/fh from the computed; NaN without fe."""
        there = self.computed.transparency != 0.0
        if not np.any(there):
            return math.nan
        ratio = self.measured.transparency[there] / self.computed.transparency[there]
        return float(np.max(np.abs(ratio - 1.0)))

    def over(self, frequency: np.ndarray) -> Impedance:
        """The computed impedance at other frequencies, for lines between the markers.

        Args:
            frequency: [Hz], > 0, shape (n,).
        """
        return computed_impedance(self.subject, 2.0 * math.pi * np.asarray(frequency, dtype=float))

    def tables(self) -> dict[str, dict[str, list[float]]]:
        """The numbers of the figures, by table, columns headed with their units."""
        (measured,), (computed,) = (x.tables().values() for x in (self.measured, self.computed))
        off = np.abs(self.measured.Z / self.computed.Z - 1.0).tolist()
        measured = measured | {"deviation": self.deviation.tolist(), "off theory": off}
        return {"measured": measured, "computed": computed}

    def remarks(self) -> list[str]:
        """How far theory is off, and what it neglects."""
        line = f"measured against computed: Z within {100.0 * self.gap:.2g} %"
        if not math.isnan(self.felt_gap):
            line += f", fe/fh within {100.0 * self.felt_gap:.2g} %"
        return [line, *self.notes]

    def figures(self) -> dict[str, Any]:
        """Impedance and transparency."""
        by = "hapticclay.views.impedance_plots:transparency_bode_plot"
        return {"impedance": figure_of(self), "transparency": figure_of(self, by)}

    def contents(self) -> dict[str, Any]:
        """Subject, differences from theory, tables and notes."""
        gaps = {"gap": self.gap, "felt_gap": self.felt_gap, "tables": self.tables()}
        names = {"kind": type(self.subject).__name__, "subject": self.subject}
        return {**names, **gaps, "notes": self.notes}


def computed_impedance(subject: Subject, omega: np.ndarray) -> Impedance:
    """The computed impedance of a loop or a wall, at the nominal pose."""
    return as_wall(subject).response(omega)


@checked
def measure_impedance(
    subject: Subject | Scenario,
    axis: str = "x",
    *,
    band: tuple[float, float] = IMPEDANCE_BAND,
    lines: int = IMPEDANCE_LINES,
    period: Annotated[Real, Bound(0.1, 1000.0, "s")] = IMPEDANCE_PERIOD,
    amplitude: Annotated[Real, Bound(0.0, 0.1, "m", above=True)] = MOTION,
    seed: Annotated[int, Bound(0, 2**32 - 1)] = 0,
) -> MeasuredImpedance:
    """Measure the impedance of a loop or a wall by a run, and compute it.

    The run begins at the nominal pose. Agreement is limited by the engine's step, (omega dt)^2/6,
    by the amplitude over the length of a link, and by the residual transient.

    Args:
        subject: a `Scenario`; a `PushedLoop`, its push and pose ignored; or a `VirtualWall` that
            acts everywhere.
        axis: axis of a scenario, "x" or "y".
        band: lowest and highest frequency [Hz].
        lines: number of lines of the multisine, spread over the logarithm of frequency.
        period: length of the multisine [s], rounded up to samples that are quick to transform.
        amplitude: target rms of the motion [m].
        seed: seed of the phases.

    Raises:
        ParameterError: a value is out of its bounds; the loop is unstable with this hand; or the
            run ends early, meets the limits of the motors, or does not settle.
    """
    wall = as_wall(subject, axis)
    wall.check_steady()
    Ts, n, steps = _steps_of(wall, period)
    dt = (Ts or LONGEST_STEP) / steps
    i = AXES.index(wall.axis)
    along = (1.0, 0.0) if i == 0 else (0.0, 1.0)
    wave = replace(_multisine(along, band, n * dt, lines, 0.1 / dt), seed=seed)
    omega = wave.omega
    computed = wall.response(omega)
    th, s = wall.hand, 1j * omega
    place = 1.0 / (s * computed.Z + th.mass * s * s + th.damper * s + th.spring)
    rms = amplitude / math.sqrt(np.mean(np.abs(place) ** 2))
    wave = replace(wave, rms=(rms * along[0], rms * along[1]))
    deviation, settling = np.array([math.inf]), 0
    for settling in SETTLING_PERIODS:
        scenario = wall.driven(wave, (settling + 2) * wave.period, dt)
        record = simulate(scenario)
        if record.outcome.code != "time limit" or record.outcome.cause:
            raise ParameterError("amplitude", amplitude, LINEAR_MOTION + record.status)
        part = slice(settling * n, (settling + 2) * n)
        port, reference = wall.port(record, part, steps), wave(record.t[part])[:, i]
        measured, deviation = _measured(port, reference, n, wave)
        if deviation.max() <= STEADY_RESPONSE or not wall.linear:
            seen = replace(measured, rendered=computed.rendered)
            notes = _notes(wall, dt)
            return MeasuredImpedance(wall.subject, seen, computed, deviation, scenario, notes)
    bound = (
        f"must settle: from period to period its impedance differs by {deviation.max():.2g}, "
        f"after {settling} periods of {wave.period:.3g} s; give a longer period"
    )
    raise ParameterError("period", period, bound)


def _steps_of(wall: Wall, length: float) -> tuple[float | None, int, int]:
    """Control sample; engine steps per period, in whole samples; engine steps per sample."""
    from scipy.fft import next_fast_len

    if wall.Ts is None:
        n = int(next_fast_len(math.ceil(length / LONGEST_STEP - 1e-9)))  # type: ignore[arg-type]
        return None, n, 1
    least = max(1, math.ceil(wall.Ts / LONGEST_STEP - 1e-9))
    late = wall.delay / wall.Ts
    tried = range(least, least + STEPS_TRIED)
    steps = next((x for x in tried if abs(x * late - round(x * late)) < 1e-9), least)
    samples = int(next_fast_len(math.ceil(length / wall.Ts - 1e-9)))  # type: ignore[arg-type]
    return wall.Ts, samples * steps, steps


def _measured(
    port: Port, reference: np.ndarray, n: int, wave: Multisine
) -> tuple[Impedance, np.ndarray]:
    """The impedance over two whole periods of a record, and its relative deviation.

    A row of the record holds velocity and hand force at the sample, with the force interpolated
    between the kicks on both sides. A held motor force forms a staircase: its fundamental is that
    of the rows times that of a hold.
    """
    bins = np.round(wave.omega / (2.0 * math.pi) * wave.period).astype(int)
    Z = estimate_response(np.array([[reference, port.v, port.fh]]), n, bins)
    transparency = np.zeros_like(Z.response)
    if np.any(port.fe):
        rows = np.array([[reference, port.fh, port.fe]])
        transparency = estimate_response(rows, n, bins).response
    if port.held:
        turn = 1j * wave.omega * wave.period / n
        transparency = transparency * -np.expm1(-turn) / turn
    found = Impedance(wave.omega, Z.response, transparency, np.zeros_like(transparency))
    return found, Z.deviation / np.abs(Z.response)


def _notes(wall: Wall, dt: float) -> tuple[str, ...]:
    notes = []
    if wall.left_out:
        notes.append(
            "friction and encoder make the response depend on the amplitude: measured is the best "
            "linear one at this amplitude, computed leaves them out"
        )
    late = wall.delay / dt
    if abs(late - round(late)) > 1e-6:
        notes.append(
            "the delay is not a multiple of a step: measured fe/fh is late by up to a step"
        )
    return tuple(notes)
