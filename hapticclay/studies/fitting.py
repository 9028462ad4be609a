"""Fits the law by which clay resists to time, position and force.

Laws of Herschel and Bulkley's family are fitted by total least squares along the motion
(`trajectory`) and compared by Akaike's criterion (K. P. Burnham, D. R. Anderson, Model Selection
and Multimodel Inference, 2nd ed., Springer 2002); intervals come from profiles of the sum of
squares. Method and limits: docs/fit.md.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from ..arguments import checked, named
from ..display import fields_of, table_of
from ..errors import Bound, ParameterError, choice
from ..model.constants import AXES
from ..model.flow import N_MAX, N_MIN, Flow
from ..results import Result, figure_of
from ..simulation.record import Record
from .flow_models import (
    FLOW_LAWS,
    FLOW_UNITS,
    OUTLYING,
    PARSIMONY,
    FlowParameter,
    best_fit,
    first_guesses,
    outlying_forces,
    parameter_intervals,
    parameters_of,
    refit_nested,
    student_quantile,
    theta_of,
)
from .measurement import Measurement
from .outliers import LOST, Cleaned, cleaned, robust_deviation, sentence, times
from .plausibility import FLOW, OF_DAMPER, YIELD, Number, doubts
from .sliding import (
    FAST,
    LEAST_SLIDING,
    ROUNDED,
    UNDITHERED,
    Sliding,
    check_one_law,
    driving_forces,
    quantum,
    recorded_motion,
    sliding_along_positions,
    sliding_at_known_speed,
)
from .trajectory import JointFit, Minimum, correlation_time

LEAST_INDEPENDENT = 10  # independent sliding samples
FEW_SLIDING = 300  # independent sliding samples, below which a warning is given
NARROW = 3.0  # ratio of speeds below which n is hardly identifiable
MIDDLE = 0.96  # share of the samples whose speeds are compared
EXACT = 1e-4  # of the force: smaller residuals are errors of splines or steps, not noise
MISFIT = 1.25  # variance about a law over that about a free curve: above this no law fits
SCREENINGS = 3  # of the forces, each with splines that the one before has freed of outliers
TAILS = 1.5  # ratio of a noise by squares to that by the median, above which a warning is given
CORRELATED = 2.0  # samples per independent sample, above which a warning is given


@named
@dataclass(frozen=True)
class FittedLaw:
    """A law fitted to a motion, beside other candidates.

    Attributes:
        law: its name, in FLOW_LAWS.
        parameters: its parameters.
        deviation: standard deviation of the force about the law [N].
        aicc: Akaike's criterion, corrected for few samples, above that of the best.
        weight: its Akaike weight among the candidates.
    """

    law: str
    parameters: tuple[FlowParameter, ...]
    deviation: float
    aicc: float
    weight: float


@named
@dataclass(frozen=True, eq=False, repr=False)
class Fitted(Result):
    """A law of resistance fitted to a motion.

    Attributes:
        law: the chosen law, in FLOW_LAWS.
        parameters: its parameters, with intervals.
        candidates: every law that was tried, from simple to rich.
        level: confidence level of the intervals.
        t: time of the sliding samples [s], (n,).
        v: their velocity [m/s], (n,).
        f: resisting force, of the sign of v [N], (n,).
        covariance: covariance of the parameters, (k, k), with log K in place of K.
        force_noise: standard deviation of a force [N].
        position_noise: standard deviation of a position [m]; 0 where velocities were given.
        correlation: samples that count as one independent one.
        samples: number of samples of the record in the span.
        spacing: of the knots of the motion [s]; 0 where velocities were given.
        warnings: limits of the result, one sentence each.
        axis: "x", "y", or "path" for the direction of motion.
        source: name of the data.
        position_outliers: times of positions that were left out [s], (m,): spikes, lost packets,
            repeated values.
        force_outliers: times of forces that were left out [s], (m,): far from any law.
    """

    drawn_by = "hapticclay.views.fit_plots:fit_plot"
    written_as = "fit"
    printed = {"candidates": ()}
    formats = {"AICc": ".1f", "weight": ".3f", "left [N]": ".3g", "fitted": ".6g"}
    summary_units = {
        "parameters": FLOW_UNITS,
        "speed": "m/s",
        "force_noise": "N",
        "position_noise": "m",
        "spacing": "s",
        "correlation": "samples",
        "position_outliers": "s",
        "force_outliers": "s",
    }

    law: str
    parameters: tuple[FlowParameter, ...]
    candidates: tuple[FittedLaw, ...]
    level: float
    t: np.ndarray
    v: np.ndarray
    f: np.ndarray
    covariance: np.ndarray
    force_noise: float
    position_noise: float
    correlation: float
    samples: int
    spacing: float
    warnings: tuple[str, ...]
    axis: str
    source: str
    position_outliers: tuple[float, ...] = ()
    force_outliers: tuple[float, ...] = ()

    def headline(self) -> str:
        """The law and its parameters with their intervals, in one line."""
        parameters = (
            f"{p.name} {p.value:.4g} ({p.low:.4g} to {p.high:.4g}) {p.unit}".rstrip()
            for p in self.parameters
        )
        return f"{self.law}: {', '.join(parameters)}"

    @property
    def flow(self) -> Flow:
        """The law as clay: `hc.slab(fitted.flow)`."""
        return Flow(**{p.name: p.value for p in self.parameters})

    @property
    def residuals(self) -> np.ndarray:
        """Force less that of the law [N], (n,)."""
        return self.f - self.flow.force(self.v)

    def band(self, v: Any) -> np.ndarray:
        """Half width of the confidence interval of the law's force at given velocities [N].

        Args:
            v: velocities [m/s], (m,), none of them 0.
        """
        law, theta = FLOW_LAWS[self.law], theta_of([p.value for p in self.parameters], self.law)
        J = law.slopes(theta, np.abs(np.asarray(v, dtype=float)))[2]
        quantile = student_quantile(self.level, len(self.v) / self.correlation - len(theta))
        return quantile * np.sqrt(np.einsum("ij,jk,ik->i", J, self.covariance, J))

    def tables(self) -> dict[str, dict[str, Any]]:
        """The numbers of the figure, and the candidates: the chosen one, then the most likely."""
        rows = []
        for c in sorted(self.candidates, key=lambda c: (c.law != self.law, c.aicc)):
            first = [c.law, c.aicc, c.weight, c.deviation]
            for p in self.parameters if c.law == self.law else c.parameters:
                name = f"{p.name} [{p.unit}]" if p.unit else p.name
                span = "" if math.isnan(p.low) else f"{p.low:.6g} to {p.high:.6g}"
                rows.append([*first, name, p.value, span])
                first = [None] * len(first)
        interval = f"{100.0 * self.level:g} % interval"
        head = ("law", "AICc", "weight", "left [N]", "parameter", "fitted", interval)
        return {
            "parameters": table_of(("name", "unit", "value", "low", "high"), self.parameters),
            "samples": {
                "time [s]": self.t,
                "velocity [m/s]": self.v,
                "force [N]": self.f,
                "force of the law [N]": [self.flow.force(v) for v in self.v],
                f"half the {100 * self.level:g} % band [N]": self.band(self.v),
                "residual [N]": self.residuals,
            },
            "candidates": table_of(head, rows),
        }

    def remarks(self) -> list[str]:
        """Sliding samples, noise and warnings."""
        low, high = (1e3 * x for x in self.speed)
        line = (
            f"{self.law}: {len(self.v)} of {self.samples} samples slide, at {low:.3g} to "
            f"{high:.3g} mm/s; noise {self.force_noise:.3g} N"
        )
        if self.position_noise:
            line += f", {1e6 * self.position_noise:.3g} um"
        return [line, *(f"warning: {x}" for x in self.warnings)]

    def figures(self) -> dict[str, Any]:
        tables = self.tables()
        shown = {name: tables[name] for name in ("samples", "parameters")}  # fit.csv: samples
        return {"fit": figure_of(self, tables=shown)}

    @property
    def speed(self) -> tuple[float, float]:
        """Least and largest speed of the sliding samples [m/s]."""
        speed = np.abs(self.v)
        return float(speed.min()), float(speed.max())

    def contents(self) -> dict[str, Any]:
        """All but the sliding samples."""
        data = fields_of(self, "t", "v", "f", "covariance")
        return {**data, "sliding": len(self.v), "speed": self.speed}


Level = Annotated[float, Bound(0.5, 0.999)]
Span = Annotated[tuple[float, float] | None, Bound(names=("low", "high"))]


@checked
def fit_flow(
    data: Measurement | Record | str | os.PathLike[str],
    axis: str | None = None,
    laws: Sequence[str] | str = tuple(FLOW_LAWS),
    level: Level = 0.95,
    *,
    time: Span = None,
    place: Span = None,
) -> Fitted:
    """Fits a law of resistance, f = (Fy + K |v|^n) v/|v| + b v, and selects its terms.

    Positions and forces may carry white noise and be quantised. Samples at rest only imply |f| <=
    Fy and are left out. The simplest law whose AICc is within 6 of the least is chosen.

    Args:
        data: a Measurement with the force of the clay on the tool, counted as resistance, as its
            input [N] and the position as its output [m]; or a Record, or its folder: its samples
            inside clay are used with the simulated velocities.
        axis: "x" or "y"; "path" for the force along the motion in a Record. None for "path" in
            isotropic clay, else "x". For a Measurement it is only a name.
        laws: candidates, names in FLOW_LAWS.
        level: confidence level of the intervals, 0.5 to 0.999.
        time: first and last time to take [s]; None for all.
        place: lowest and highest position along the axis to take [m]; None for all.

    Raises:
        ParameterError: an argument is wrong; too few samples slide; the force does not resist; or
            the samples of a Record lie in clays of several laws, or in elastic or rotated clay.
    """
    names = _law_names(laws)
    if isinstance(data, Measurement):
        if data.rotary:
            bound = "must be of a motion along a line, in m and N, not about an axis"
            raise ParameterError("data", data.name, bound)
        axis = choice("axis", "x" if axis is None else axis, AXES)
        t, p, v, f = data.t, data.output, None, data.input
        inside, source = np.ones(len(t), dtype=bool), data.name
        met = None
    else:
        if not isinstance(data, Record | str | os.PathLike):
            raise ParameterError("data", data, "must be a Measurement, a Record or its folder")
        source = "record" if isinstance(data, Record) else Path(data).name
        record = data if isinstance(data, Record) else Record.load(data)
        axis, p, v, f, inside, met = recorded_motion(record, axis)
        t = record.t
    for name, span, x in (("time", time, t), ("place", place, p)):
        if span is not None:
            low, high = span
            if not low < high:
                raise ParameterError(name, (low, high), "must ascend")
            inside = inside & (low <= x) & (x <= high)
    count = int(np.count_nonzero(inside))
    if count < LEAST_SLIDING:
        bound = f"must leave {LEAST_SLIDING} samples or more inside clay"
        raise ParameterError("data", f"{count} samples", bound)
    if met is not None:
        check_one_law(met, inside)
    position = cleaned(p, quantum(p)) if v is None else None
    try:
        fitted = _fitted(_Columns(t, position, v, f, inside), names, level, axis, source)
    except np.linalg.LinAlgError:
        bound = "must be a motion that splines can follow"
        raise ParameterError("position", f"{count} samples", bound) from None
    if not isinstance(data, Measurement):
        return fitted
    return dataclasses.replace(
        fitted, warnings=(*data.notes, *fitted.warnings, *doubts(_numbers(fitted), data, "clay"))
    )


def _numbers(fitted: Fitted) -> list[Number]:
    """Yield force and damping of a law, to be judged."""
    kinds = {"Fy": (YIELD, (0.0, 1.0, 0.0)), "b": (FLOW, OF_DAMPER)}
    out = []
    for p in fitted.parameters:
        if p.name in kinds:
            span = (p.value, p.value) if math.isnan(p.low) else (p.low, p.high)
            out.append(Number(p.name, p.unit, p.value, span, *kinds[p.name]))
    return out


def _law_names(laws: Sequence[str] | str) -> list[str]:
    """Laws from simple to rich; case, hyphens and spaces are ignored."""
    known = {_plain_name(x): x for x in FLOW_LAWS}
    if not isinstance(laws, Sequence):
        raise ParameterError("laws", laws, "must be names of laws")
    laws = (laws,) if isinstance(laws, str) else tuple(laws)
    names = {
        (isinstance(x, str) and known.get(_plain_name(x))) or choice("laws", x, tuple(FLOW_LAWS))
        for x in laws
    }
    if not names:
        raise ParameterError("laws", laws, f"must name one of {', '.join(FLOW_LAWS)}")
    return [x for x in FLOW_LAWS if x in names]


def _plain_name(law: str) -> str:
    return str(law).lower().replace("-", " ")


class _Columns(NamedTuple):
    """What is fitted, (n,) each; `place` is None where velocities are known."""

    t: np.ndarray
    place: Cleaned | None
    v: np.ndarray | None
    f: np.ndarray
    inside: np.ndarray

    def sliding(self, out: np.ndarray) -> Sliding:
        """The sliding samples without outliers of the force, a mask."""
        if self.place is None:
            assert self.v is not None
            return sliding_at_known_speed(self.t, self.v, self.f, self.inside & ~out)
        return sliding_along_positions(self.t, self.place, self.f, self.inside, out)


class _Laws(NamedTuple):
    """Every candidate fitted."""

    joint: JointFit
    found: dict[str, tuple[Minimum, Minimum]]  # best within bounds; with Fy and b of any sign
    least: float  # variance of a force: smaller ones are errors of splines or steps
    tau: float  # samples per independent sample


def _joint(s: Sliding, ratio: float) -> JointFit:
    return JointFit(s.f, s.p, s.motion, s.v, ratio, 0.5 * s.slowest)


def _without_outliers(data: _Columns) -> tuple[Sliding, np.ndarray]:
    """The sliding samples without outliers of the force, and the mask of these."""
    out = np.zeros(len(data.t), dtype=bool)
    s = data.sliding(out)
    for _ in range(SCREENINGS):
        some = outlying_forces(s)
        if not some.any():
            break
        out[s.at[some]] = True
        s = data.sliding(out)
    return s, out


def _check_resisting(f: np.ndarray) -> None:
    """Refuse forces that drive the motion; clipping keeps a few outliers from deciding."""
    limit = float(np.quantile(np.abs(f), MIDDLE))
    if float(np.sum(np.clip(f, -limit, limit))) <= 0.0:
        bound = "must resist the motion: of the sign of the velocity, and not 0"
        raise ParameterError("force", float(f"{np.mean(f):.4g}"), bound)


def _fit_laws(s: Sliding, names: list[str]) -> _Laws:
    """Every candidate fitted, with weights from the best of them."""
    n = len(s.f)
    v = s.speeds
    least = EXACT**2 * float(np.mean(s.f**2))
    position_variance = s.position_variance * s.position_correlation
    variance, tau = max(s.force_variance, least), 1.0
    starts = {law: first_guesses(law, v, s.f) for law in names}
    joint, found = _joint(s, 0.0), {}
    for _ in range(4):  # weights and fit; they settle in two
        joint = _joint(s, variance * tau / position_variance if s.motion else 0.0)
        found = {law: best_fit(joint, law, starts[law]) for law in names}
        refit_nested(joint, found)
        starts = {law: a.theta for law, (a, _) in found.items()}
        before = variance * tau
        variances = {x: max(a.sum / (n - len(a.theta)), least) for x, (a, _) in found.items()}
        richest = min(names, key=lambda x: variances[x])
        variance = variances[richest]
        tau = correlation_time(found[richest][0].rest) if variance > least else 1.0
        if not s.motion or abs(variance * tau / before - 1.0) < 0.05:
            break
    return _Laws(joint, found, least, tau)


def _fitted(
    data: _Columns,
    names: list[str],
    level: float,
    axis: str,
    source: str,
) -> Fitted:
    s, out = _without_outliers(data)
    _check_resisting(s.f)
    joint, found, least, tau = _fit_laws(s, names)
    n = len(s.f)
    count = n / tau
    if count < LEAST_INDEPENDENT:
        bound = f"must be {LEAST_INDEPENDENT} or more; what a law leaves of the force is correlated"
        raise ParameterError("data", f"{count:.1f} independent samples", bound)
    candidates = _compared(names, found, least * n, count)
    lowest = min(c.aicc for c in candidates)
    close = [c for c in candidates if c.aicc <= lowest + PARSIMONY]
    law = min(close, key=lambda c: (len(c.parameters), c.aicc)).law
    best, free = found[law]
    k = len(best.theta)
    variance = max(best.sum / (n - k), least)
    sizes = variance * tau, student_quantile(level, count - k)
    bad = data.place.bad & data.inside if data.place else np.zeros_like(out)
    result = Fitted(
        law,
        parameter_intervals(joint, law, best, free, *sizes),
        candidates,
        level,
        s.t,
        s.sign * np.maximum(best.v, 0.5 * s.slowest),
        s.sign * s.f,
        variance * tau * free.spread,
        math.sqrt(variance),
        math.sqrt(s.position_variance),
        tau,
        int(np.count_nonzero(data.inside)),
        s.spacing,
        (),
        axis,
        source,
        tuple(data.t[bad].tolist()),
        tuple(data.t[out].tolist()),
    )
    warnings = _left_out(result, data, out) + _warnings(result, s, quantum(data.f[data.inside]))
    return dataclasses.replace(result, warnings=warnings)


def _left_out(r: Fitted, data: _Columns, out: np.ndarray) -> tuple[str, ...]:
    """Warnings about outliers."""
    warnings, n = [], r.samples
    if len(r.position_outliers):
        warnings.append(sentence("position", r.position_outliers, n, LOST))
    steps = data.place.steps if data.place else ()
    steps = [i for i in steps if data.inside[i]]
    if steps:
        warnings.append(
            f"the position jumps and does not return at t = {times(data.t[steps])} s: the motion "
            "is fitted in parts"
        )
    if len(r.force_outliers):
        why = f"more than {OUTLYING:g} deviations from any law"
        if n_wrong := np.count_nonzero(driving_forces(data.f, data.place, data.v)[out]):
            why += (
                f"; {n_wrong} of them drive the motion: wrong signs, or a delay between the columns"
            )
        warnings.append(sentence("force", r.force_outliers, n, why))
    return tuple(warnings)


def _compared(
    names: list[str], found: dict[str, tuple[Minimum, Minimum]], least: float, count: float
) -> tuple[FittedLaw, ...]:
    """The candidates with their AICc and weights, for `count` independent samples."""
    aicc = {}
    for law in names:
        a = found[law][0]
        k = len(a.theta) + 1  # and the variance
        aicc[law] = count * math.log(max(a.sum, least)) + 2.0 * k * count / (count - k - 1.0)
    lowest = min(aicc.values())
    odds = {law: math.exp(0.5 * (lowest - aicc[law])) for law in names}
    out = []
    for law in names:
        a = found[law][0]
        parameters = tuple(
            FlowParameter(name, FLOW_UNITS[name], value)
            for name, value in zip(FLOW_LAWS[law].names, parameters_of(a.theta, law), strict=True)
        )
        deviation = math.sqrt(a.sum / (len(a.v) - len(parameters)))
        weight = odds[law] / sum(odds.values())
        out.append(FittedLaw(law, parameters, deviation, aicc[law] - lowest, weight))
    return tuple(out)


def _warnings(r: Fitted, s: Sliding, count: float) -> tuple[str, ...]:
    """Limits of the result; `count` is the step of the force's converter [N]."""
    out = []
    n, speed = len(r.v), np.abs(r.v)
    slow, fast = np.quantile(speed, (0.5 - 0.5 * MIDDLE, 0.5 + 0.5 * MIDDLE)).tolist()
    independent = n / r.correlation
    if independent < FEW_SLIDING:
        out.append(
            f"{independent:.0f} independent samples slide, fewer than {FEW_SLIDING}: intervals "
            "rest on a small sample"
        )
    if fast < NARROW * slow:
        out.append(
            f"speeds of the middle {100 * MIDDLE:g} % of samples range over a factor of "
            f"{fast / slow:.2g} only, less than {NARROW:g}: terms of the law, n above all, can "
            "hardly be distinguished"
        )
    if s.motion and fast > FAST:
        out.append(
            f"speeds reach {fast:.3g} m/s, more than {FAST:g}: the columns may not be in SI units"
        )
    if r.correlation > CORRELATED:
        out.append(
            f"what the law leaves is correlated over {r.correlation:.1f} samples: the force has "
            "causes that it does not know; intervals are wider for it"
        )
    least = EXACT**2 * float(np.mean(s.f**2))
    curve = max(s.force_variance, least) if s.motion else r.force_noise**2
    if r.force_noise**2 > MISFIT * curve:
        ratio = r.force_noise / math.sqrt(curve)
        out.append(
            f"no candidate explains the force: what is left is {ratio:.2f} times the noise "
            "beside a free curve"
        )
    if r.force_noise < UNDITHERED * count:
        out.append(
            f"the force is rounded to {count:.3g} N, more than its noise, {r.force_noise:.2g} N: "
            "rounding may bias the fit by a part of that"
        )
    out += _tail_warnings(r, s, count)
    for p in r.parameters:
        if p.name == "n" and (p.low <= N_MIN or p.high >= N_MAX):
            out.append(f"the interval of n ends at its bound, {N_MIN:g} or {N_MAX:g}")
    both = [r.residuals[r.v * way > 0.0] * way for way in (1.0, -1.0)]
    if min(map(len, both)) >= LEAST_SLIDING:
        gap = float(both[0].mean() - both[1].mean())
        noise = math.sqrt(curve * sum(1.0 / len(x) for x in both))
        if abs(gap) > max(5.0 * noise, 0.2 * r.force_noise):
            out.append(
                f"resistance forward and backward differs by {gap:.3g} N: the zero of the force "
                "is off, or the clay is not alike both ways"
            )
    return tuple(out)


def _tail_warnings(r: Fitted, s: Sliding, count: float) -> list[str]:
    """Warnings about errors that are too large for noise and yet were not left out."""
    left = r.residuals - np.median(r.residuals)
    usual = max(robust_deviation(left), ROUNDED * count)
    tails = {"forces": float(np.std(left)) / usual if usual > 0.0 else 1.0}
    tails["positions"] = s.position_tails
    return [
        f"the {name} have errors that are no noise: their deviation is {x:.3g} times that of "
        "normal noise with the same median"
        for name, x in tails.items()
        if x > TAILS
    ]
