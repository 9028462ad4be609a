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
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked, named
from ..errors import ParameterError, choice, number, numbers_of
from ..files import versions
from ..model.constants import AXES
from ..model.flow import N_MAX, N_MIN, Flow
from ..results import Result
from ..simulation.record import Record
from .measurement import Measurement
from .trajectory import (
    FIT_RANGES,
    LEAST_PER_KNOT,
    Flowing,
    Joint,
    Minimum,
    Motion,
    Series,
    Stretch,
    chosen_spacing,
    correlation_time,
)

FIT_SCHEMA = "hapticclay-fit-1"
FLOW_LAWS: dict[str, Flowing] = {  # from simple to rich, named as `Flow.kind`
    "viscous": Flowing(("b",)),
    "Coulomb": Flowing(("Fy",)),
    "Bingham": Flowing(("Fy", "b")),
    "power law": Flowing(("K", "n")),
    "Herschel-Bulkley": Flowing(("Fy", "K", "n")),
}
FLOW_UNITS = {"Fy": "N", "K": "N/(m/s)^n", "n": "", "b": "N.s/m"}
PARSIMONY = 6.0  # of AICc: a law needs odds of 20 to 1, exp(6/2), before a simpler one is given up
LEAST_SLIDING = 50  # samples that slide ...
LEAST_INDEPENDENT = 10  # ... of which so many are independent
FEW_SLIDING = 300
NARROW = 3.0  # ratio of speeds below which n says little
MIDDLE = 0.96  # share of the samples whose speeds are compared
FAST = 10.0  # [m/s]: no hand is as fast
LEAST_SIGNAL = 5.0  # deviations of its own that a velocity must have to be motion ...
DEVIATIONS = 60  # samples from which the usual deviation is told
COUNTS = 3.0  # ... and counts of the encoder between knots
LEAST_STRETCH = 3 * LEAST_PER_KNOT  # samples of a stretch
EXACT = 1e-4  # of the force: what is left below this is the error of splines or steps, no noise
STEADY_STEP = 0.05  # largest change of a known velocity in a step; a force is the mean over one
MISFIT = 1.25  # variance beside a law over that beside a free curve: then none explains the force
CORRELATED = 2.0  # samples that count as one
UNDITHERED = 0.4  # counts: rounding alone leaves 0.29, noise of 0.3 beside it 0.42
TRIAL_INDICES = (0.15, 0.3, 0.5, 0.75, 1.0, 1.5, 2.2)  # flow indices from which fits start


@named
@dataclass(frozen=True)
class FlowParameter:
    """One parameter of a law.

    Attributes:
        name: Fy, K, n or b, as in `Flow`.
        unit: its unit.
        value: fitted value.
        low: lower end of the confidence interval; nan in a law that was not chosen.
        high: upper end of the confidence interval; nan in a law that was not chosen.
    """

    name: str
    unit: str
    value: float
    low: float = math.nan
    high: float = math.nan


@named
@dataclass(frozen=True)
class FittedLaw:
    """One candidate.

    Attributes:
        law: its name, in FLOW_LAWS.
        parameters: its parameters.
        deviation: standard deviation of a force from the law [N].
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
        t: time of the samples that slide [s], (n,).
        v: their velocity [m/s], (n,).
        f: resisting force, of the sign of v [N], (n,).
        covariance: of the parameters, (k, k), the logarithm of K in its place.
        force_noise: standard deviation of a force [N].
        position_noise: standard deviation of a position [m]; 0 where velocities were given.
        correlation: samples that count as one independent one.
        samples: of the record, in the span.
        spacing: of the knots of the motion [s]; 0 where velocities were given.
        warnings: what limits the claim, a sentence each.
        axis: "x", "y", or "path" for along the motion.
        source: name of the data.
    """

    drawn_by = "hapticclay.views.fit_plots:fit_plot"

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

    def headline(self) -> str:
        """The law and its parameters with their intervals, in one line."""
        told = (
            f"{p.name} {p.value:.4g} ({p.low:.4g} to {p.high:.4g}) {p.unit}".rstrip()
            for p in self.parameters
        )
        return f"{self.law}: {', '.join(told)}"

    @property
    def flow(self) -> Flow:
        """The law as clay: `hc.slab(fitted.flow)`."""
        return Flow(**{p.name: p.value for p in self.parameters})

    @property
    def residuals(self) -> np.ndarray:
        """Force less that of the law [N], (n,)."""
        return self.f - self.flow.force(self.v)

    def band(self, v: Any) -> np.ndarray:
        """Half the interval of the law's force at some velocities, at the level [N].

        Args:
            v: velocities [m/s], (m,), none of them 0.
        """
        law, theta = FLOW_LAWS[self.law], _to_theta([p.value for p in self.parameters], self.law)
        J = law.slopes(theta, np.abs(np.asarray(v, dtype=float)))[2]
        quantile = _quantile(self.level, len(self.v) / self.correlation - len(theta))
        return quantile * np.sqrt(np.einsum("ij,jk,ik->i", J, self.covariance, J))

    def tables(self) -> dict[str, dict[str, Any]]:
        """Returns what a figure of the fit shows: its samples, and the law over the velocity."""
        law = [self.flow.force(v) for v in self.v]
        return {
            "parameters": {
                "name": [p.name for p in self.parameters],
                "unit": [p.unit for p in self.parameters],
                "value": [p.value for p in self.parameters],
                "low": [p.low for p in self.parameters],
                "high": [p.high for p in self.parameters],
            },
            "samples": {
                "time [s]": self.t,
                "velocity [m/s]": self.v,
                "force [N]": self.f,
                "force of the law [N]": law,
                f"half the {100 * self.level:g} % band [N]": self.band(self.v),
                "residual [N]": self.residuals,
            },
        }

    def summary(self) -> dict[str, Any]:
        """Everything but the samples, ready for JSON."""
        speed = np.abs(self.v)
        return {
            "schema": FIT_SCHEMA,
            "source": self.source,
            "axis": self.axis,
            "law": self.law,
            "level": self.level,
            "parameters": [dataclasses.asdict(p) for p in self.parameters],
            "candidates": [dataclasses.asdict(c) for c in self.candidates],
            "samples": self.samples,
            "sliding": len(self.v),
            "correlation": self.correlation,
            "speed": [float(speed.min()), float(speed.max())],
            "force_noise": self.force_noise,
            "position_noise": self.position_noise,
            "spacing": self.spacing,
            "warnings": list(self.warnings),
            "units": {
                "parameters": FLOW_UNITS,
                "speed": "m/s",
                "force_noise": "N",
                "position_noise": "m",
                "spacing": "s",
                "correlation": "samples",
            },
            "versions": versions(),
        }


class _Met(NamedTuple):
    """Clay at the samples of a record."""

    flows: np.ndarray  # b, Fy, K and n at each, (n, 4)
    dented: dict[str, np.ndarray]  # where a law resists a tool at rest that has gone into it


class _Sliding(NamedTuple):
    """Samples that slide."""

    t: np.ndarray
    sign: np.ndarray  # of the velocity
    f: np.ndarray  # against the motion
    p: np.ndarray  # and of those between them; empty where speeds are known
    v: np.ndarray  # speeds, or the coefficients of the motion
    slowest: float  # speed of any
    motion: Motion | None
    spacing: float
    force_variance: float  # beside a free curve [N^2]; nan without
    position_variance: float  # [m^2]
    position_correlation: float


@checked
def fit_flow(
    data: Measurement | Record | str | os.PathLike[str],
    axis: str | None = None,
    laws: Sequence[str] | str = tuple(FLOW_LAWS),
    level: float = 0.95,
    *,
    time: tuple[float, float] | None = None,
    place: tuple[float, float] | None = None,
) -> Fitted:
    """Fits a law of resistance, f = (Fy + K |v|^n) v/|v| + b v, and chooses which of its terms.

    Positions and forces may carry white noise and be quantised. Samples at rest say no more than
    |f| <= Fy and are left out. Chosen is the simplest law whose AICc is within 6 of the least.

    Args:
        data: a Measurement with the force of the clay on the tool, counted as resistance, as its
            input [N] and the position as its output [m]; or a Record, or its folder, of which
            the samples inside clay are taken, with the velocities as simulated.
        axis: "x" or "y"; "path" for the force along the motion in a Record. None for "path" in
            clay that is isotropic, else "x". Of a Measurement it is a name alone.
        laws: candidates, names in FLOW_LAWS.
        level: confidence level of the intervals, 0.5 to 0.999.
        time: first and last time to take [s]; None for all.
        place: lowest and highest position along the axis to take [m]; None for all.

    Raises:
        ParameterError: an argument is wrong; too few samples slide; the force does not resist; or
            the samples of a Record lie in clays of several laws, or in clay that springs back or
            is turned.
    """
    names = _law_names(laws)
    level = number("level", level, 0.5, 0.999)
    if isinstance(data, Measurement):
        axis = choice("axis", "x" if axis is None else axis, AXES)
        t, p, v, f = data.t, data.output, None, data.input
        inside, source = np.ones(len(t), dtype=bool), data.name
        met = None
    else:
        if not isinstance(data, Record | str | os.PathLike):
            raise ParameterError("data", data, "must be a Measurement, a Record or its folder")
        source = "record" if isinstance(data, Record) else Path(data).name
        record = data if isinstance(data, Record) else Record.load(data)
        axis, p, v, f, inside, met = _of_record(record, axis)
        t = record.t
    for name, span, x in (("time", time, t), ("place", place, p)):
        if span is not None:
            low, high = numbers_of(name, span, ("low", "high"))
            if not low < high:
                raise ParameterError(name, (low, high), "must ascend")
            inside = inside & (low <= x) & (x <= high)
    count = int(np.count_nonzero(inside))
    if count < LEAST_SLIDING:
        bound = f"must leave {LEAST_SLIDING} samples or more inside clay"
        raise ParameterError("data", f"{count} samples", bound)
    if met is not None:
        _check_met(met, inside)
    try:
        s = _sliding(t, p, f, inside) if v is None else _known(t, v, f, inside)
    except np.linalg.LinAlgError:
        bound = "must be a motion that splines can follow"
        raise ParameterError("position", f"{count} samples", bound) from None
    if float(np.sum(s.f)) <= 0.0:
        bound = "must resist the motion: of the sign of the velocity, and not 0"
        raise ParameterError("force", float(f"{np.mean(s.f):.4g}"), bound)
    return _fitted(s, names, level, count, axis, source, f[inside])


def _law_names(laws: Sequence[str] | str) -> list[str]:
    """Laws from simple to rich; upper and lower case, hyphens and spaces are alike."""
    known = {_plain_name(x): x for x in FLOW_LAWS}
    if not isinstance(laws, Sequence):
        raise ParameterError("laws", laws, "must be names of laws")
    laws = (laws,) if isinstance(laws, str) else tuple(laws)
    names = {known.get(_plain_name(x)) or choice("laws", x, tuple(FLOW_LAWS)) for x in laws}
    if not names:
        raise ParameterError("laws", laws, f"must name one of {', '.join(FLOW_LAWS)}")
    return [x for x in FLOW_LAWS if x in names]


def _plain_name(law: str) -> str:
    return str(law).lower().replace("-", " ")


def _of_record(r: Record, axis: str | None) -> tuple[str, Any, Any, Any, Any, Any]:
    """Axis, position, velocity, force, which samples lie inside clay, and the clay at them."""
    clay = r.scenario.clay
    if clay is None:
        raise ParameterError("data", r.scenario.name, "must be a record with clay")
    if clay.blocks:
        bound = "must be a record without clay that stays cut, which has no law of speed"
        raise ParameterError("data", r.scenario.name, bound)
    axis = choice("axis", axis or ("path" if clay.along_motion else "x"), (*AXES, "path"))
    if clay.angle and axis != "path":
        raise ParameterError("axis", axis, 'must be "path" in clay with rotated axes')
    yielding = [x for x in clay.kinds if x.of_velocity and not x.viscous]
    if axis == "path" and not all(x.along_motion for x in yielding):
        raise ParameterError("axis", axis, "must be x or y in clay whose axes yield by themselves")
    index = AXES.index(axis) if axis in AXES else 0
    law, places = clay.laws[index], tuple(r.p.T)
    at = law.index(*places)
    inside = law.some[at]
    still = {x.name: x.force(law, 0.0, 1.0) for x in clay.kinds if x.force and not x.of_velocity}
    dented = {name: force[at] > 0.0 for name, force in still.items() if np.any(force)}
    met = _Met(np.array([r.b[:, index], *law.flows_at(*places)]).T, dented)
    if axis in AXES:
        return axis, places[index], r.v[:, index], r.fe[:, index], inside, met
    if not np.array_equal(*r.b.T):
        raise ParameterError("axis", axis, "must be x or y in clay that damps them differently")
    speed = np.hypot(*r.v.T)
    force = np.sum(r.fe * r.v, axis=1)
    force = np.divide(force, speed, out=np.zeros(len(speed)), where=speed > 0.0)
    along = np.cumsum(np.append(0.0, np.hypot(*np.diff(r.p, axis=0).T)))
    return axis, along, speed, force, inside, met


def _check_met(met: _Met, inside: np.ndarray) -> None:
    """Refuse samples that lie in clays of several laws, or in clay whose force depends on more."""
    for name, where in met.dented.items():
        if np.any(where[inside]):
            bound = "must lie in clay whose force follows from the velocity alone"
            raise ParameterError("data", f"samples in clay with {name}", bound)
    kinds = met.flows[inside]
    if np.any(np.ptp(kinds, axis=0) > 1e-9 * np.max(np.abs(kinds), axis=0)):
        low, high = kinds.min(axis=0).tolist(), kinds.max(axis=0).tolist()
        told = ", ".join(
            f"{name} {a:g} to {b:g}"
            for name, a, b in zip(("b", "Fy", "K", "n"), low, high, strict=True)
            if a < b
        )
        bound = "must lie in clay of one law: choose a part of them by time or place"
        raise ParameterError("data", f"samples with {told}", bound)


def _known(t: np.ndarray, v: np.ndarray, f: np.ndarray, inside: np.ndarray) -> _Sliding:
    """Samples of known velocity that move, and whose velocity changes little in a step."""
    change = np.abs(np.diff(v, prepend=v[:1]))
    change = np.maximum(change, np.append(change[1:], 0.0))
    speed = np.abs(v)
    at = inside & (change <= STEADY_STEP * speed) & (speed > 1e-4 * np.max(speed[inside]))
    if np.count_nonzero(at) < LEAST_SLIDING:
        raise _too_few(int(np.count_nonzero(at)))
    sign = np.sign(v[at])
    speed, none = speed[at], np.zeros(0)
    slowest = float(speed.min())
    return _Sliding(t[at], sign, sign * f[at], none, speed, slowest, None, 0.0, math.nan, 0.0, 1.0)


def _too_few(count: int) -> ParameterError:
    bound = f"must have {LEAST_SLIDING} samples or more that slide, faster than the noise"
    return ParameterError("data", f"{count} samples", bound)


def _sliding(t: np.ndarray, p: np.ndarray, f: np.ndarray, inside: np.ndarray) -> _Sliding:
    """Stretches that slide, and the splines along them."""
    p = p - p.mean()
    runs = [(a, b) for a, b in _runs(inside) if b - a >= LEAST_STRETCH]
    if not runs:
        raise _too_few(0)
    stretches = [Stretch(t[a:b]) for a, b in runs]
    at = np.concatenate([np.arange(a, b) for a, b in runs])
    spacing, (variance,) = chosen_spacing([Series(stretches, p[at])])
    motion = Motion(stretches, spacing)
    v = np.zeros(len(t))
    v[at] = motion.velocity(motion.follow(p[at]))
    margin = math.ceil(spacing / float(np.median(np.diff(t))))
    slow = _slowest(motion, runs, margin, LEAST_SIGNAL * math.sqrt(variance))
    slow = np.maximum(slow, COUNTS * quantum(p) / spacing)
    direction = np.zeros(len(t))
    direction[at] = np.where(np.abs(v[at]) > slow, np.sign(v[at]), 0.0)
    pieces = [x for a, b in runs for x in _between_rests(direction, a, b, margin)]
    # of each piece, where it slides one way
    slides = [
        sorted((c + a, d + a) for way in (1.0, -1.0) for c, d in _runs(direction[a:b] == way))
        for a, b in pieces
    ]
    slides = [[x for x in some if x[1] - x[0] >= LEAST_PER_KNOT] for some in slides]
    pieces = [x for x, some in zip(pieces, slides, strict=True) if some]
    slides = [some for some in slides if some]
    single = [x for some in slides for x in some]
    if sum(b - a for a, b in single) < LEAST_SLIDING:
        raise _too_few(sum(b - a for a, b in single))
    stretches = [
        Stretch(
            t[a:b], [0.5 * float(t[x[1]] + t[y[0]]) for x, y in zip(some, some[1:], strict=False)]
        )
        for (a, b), some in zip(pieces, slides, strict=True)
    ]
    at, sliding = (np.concatenate([np.arange(*x) for x in some]) for some in (pieces, single))
    sign, place = direction[sliding], p[at]
    force = sign * f[sliding]
    one_way = [Stretch(t[a:b]) for a, b in single]
    spacing, (of_p, of_f) = chosen_spacing([Series(stretches, place), Series(one_way, force)])
    motion = Motion(stretches, spacing, np.searchsorted(at, sliding), sign)
    c = motion.follow(place)
    correlation = correlation_time(place - motion.place(c))
    of_p = max(of_p, (1e-12 * float(np.ptp(p))) ** 2)  # rounding
    return _Sliding(
        t[sliding],
        sign,
        force,
        place,
        c,
        float(slow.min()),
        motion,
        spacing,
        of_f,
        of_p,
        correlation,
    )


def _slowest(motion: Motion, runs: list[tuple[int, int]], margin: int, sigma: float) -> np.ndarray:
    """Speed that counts as motion at each sample of the runs; larger near their ends [m/s]."""
    pieces = np.cumsum([0] + [b - a for a, b in runs])
    some = np.unique(np.linspace(0, pieces[-1] - 1, DEVIATIONS).astype(int))
    out = np.full(pieces[-1], np.median(motion.deviation(some)))
    for a, b in zip(pieces[:-1].tolist(), pieces[1:].tolist(), strict=True):
        first, last = motion.deviation(np.array([a, b - 1]))
        out[a : min(a + margin, b)] = max(first, out[a])
        out[max(b - margin, a) : b] = max(last, out[b - 1])
    return sigma * out


def _between_rests(
    direction: np.ndarray, start: int, stop: int, margin: int
) -> list[tuple[int, int]]:
    """Parts of a run without rests, which last longer than a knot's width, and its like around."""
    rests = [(a + start, b + start) for a, b in _runs(direction[start:stop] == 0.0)]
    out, begin = [], start
    for a, b in rests:
        if b - a > margin or a == start or b == stop:
            out.append((begin, a - margin if b - a > margin else a))
            begin = b + margin if b - a > margin else b
    out.append((begin, stop))
    return [(a, b) for a, b in out if b - a >= LEAST_STRETCH]


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Where a mask holds: (start, stop) of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def quantum(x: np.ndarray) -> float:
    """Step of which all differences are multiples, of quantised samples; 0 for others.

    Args:
        x: samples, (n,).
    """
    steps = np.diff(np.unique(x))
    steps = steps[steps > 1e-9 * np.max(np.abs(x), initial=0.0)]  # rounding of the numbers
    if not len(steps):
        return 0.0
    whole = steps / steps.min()
    return 0.0 if np.any(np.abs(whole - np.round(whole)) > 0.02) else float(steps.min())


def _to_theta(values: Sequence[float], law: str) -> np.ndarray:
    """Parameters as `Flowing` takes them."""
    pairs = zip(FLOW_LAWS[law].names, values, strict=True)
    return np.array([math.log(max(x, 1e-300)) if name == "K" else x for name, x in pairs])


def _of_theta(theta: np.ndarray, law: str) -> list[float]:
    pairs = zip(FLOW_LAWS[law].names, theta.tolist(), strict=True)
    return [math.exp(min(x, 700.0)) if name == "K" else x for name, x in pairs]


def _starts(law: str, v: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Parameters from which a fit starts: linear ones solved for, over some flow indices."""
    names, best = FLOW_LAWS[law].names, None
    for n in TRIAL_INDICES if "n" in names else (1.0,):
        columns = {"Fy": np.ones(len(v)), "b": v, "K": v**n}
        linear = [x for x in names if x != "n"]
        X = np.stack([columns[x] for x in linear], axis=1)
        found = np.linalg.lstsq(X, f, rcond=None)[0]
        a = dict(zip(linear, found.tolist(), strict=True), n=n)
        if a.get("K", 1.0) <= 0.0:  # the force falls with the speed: almost flat then
            a["K"] = 1e-3 * float(np.mean(np.abs(f))) / float(np.mean(v)) ** n
            a["Fy"] = float(np.mean(f))
            found = np.array([a[x] for x in linear])
        left = float(np.sum((f - X @ found) ** 2))
        if best is None or left < best[0]:
            best = left, [a[x] for x in names]
    assert best is not None
    return _to_theta(best[1], law)


def _joint(s: _Sliding, ratio: float) -> Joint:
    return Joint(s.f, s.p, s.motion, s.v, ratio, 0.5 * s.slowest)


def _best(joint: Joint, law: str, start: np.ndarray) -> tuple[Minimum, Minimum]:
    """Least sum of squares with Fy and b of 0 or more, and of any sign."""
    flowing = FLOW_LAWS[law]
    free = found = joint.least(flowing, start)
    held = np.zeros(len(start), dtype=bool)
    signed = np.array([x in ("Fy", "b") for x in flowing.names])
    while (bad := signed & (found.theta < 0.0)).any():
        held |= bad
        found = joint.least(flowing, np.where(held, 0.0, found.theta), held.tolist())
    return found, free


def _nested(joint: Joint, found: dict[str, tuple[Minimum, Minimum]]) -> None:
    """Fit the richest law again from a simpler one that it holds, if that explains more."""
    rich = "Herschel-Bulkley"
    for law in found:
        a, least = (
            dict(zip(FLOW_LAWS[law].names, found[law][0].theta, strict=True)),
            found[law][0].sum,
        )
        if rich not in found or found[rich][0].sum <= least:
            continue
        values = a.get("Fy", 0.0), a.get("K", math.log(max(a.get("b", 0.0), 1e-6))), a.get("n", 1.0)
        again = _best(joint, rich, np.array(values))
        if again[0].sum < found[rich][0].sum:
            found[rich] = again


def _fitted(
    s: _Sliding,
    names: list[str],
    level: float,
    samples: int,
    axis: str,
    source: str,
    raw: np.ndarray,
) -> Fitted:
    n = len(s.f)
    v = s.v if s.motion is None else np.maximum(s.motion.velocity(s.v), 0.5 * s.slowest)
    least = EXACT**2 * float(np.mean(s.f**2))  # variance
    of_place = s.position_variance * s.position_correlation
    variance, tau = max(s.force_variance, least), 1.0
    starts = {law: _starts(law, v, s.f) for law in names}
    joint, found = _joint(s, 0.0), {}
    for _ in range(4):  # weights and fit; they settle in two
        joint = _joint(s, variance * tau / of_place if s.motion else 0.0)
        found = {law: _best(joint, law, starts[law]) for law in names}
        _nested(joint, found)
        starts = {law: a.theta for law, (a, _) in found.items()}
        before = variance * tau
        variances = {x: max(a.sum / (n - len(a.theta)), least) for x, (a, _) in found.items()}
        richest = min(names, key=lambda x: variances[x])
        variance = variances[richest]
        tau = correlation_time(found[richest][0].rest) if variance > least else 1.0
        if not s.motion or abs(variance * tau / before - 1.0) < 0.05:
            break
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
    sizes = variance * tau, _quantile(level, count - k)
    result = Fitted(
        law,
        _intervals(joint, law, best, free, *sizes),
        candidates,
        level,
        s.t,
        s.sign * np.maximum(best.v, 0.5 * s.slowest),
        s.sign * s.f,
        variance * tau * free.spread,
        math.sqrt(variance),
        math.sqrt(s.position_variance),
        tau,
        samples,
        s.spacing,
        (),
        axis,
        source,
    )
    return dataclasses.replace(result, warnings=_warnings(result, s, quantum(raw)))


def _compared(
    names: list[str], found: dict[str, tuple[Minimum, Minimum]], least: float, count: float
) -> tuple[FittedLaw, ...]:
    """The candidates with their AICc and weights; `count` independent samples."""
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
            for name, value in zip(FLOW_LAWS[law].names, _of_theta(a.theta, law), strict=True)
        )
        deviation = math.sqrt(a.sum / (len(a.v) - len(parameters)))
        weight = odds[law] / sum(odds.values())
        out.append(FittedLaw(law, parameters, deviation, aicc[law] - lowest, weight))
    return tuple(out)


def _quantile(level: float, freedom: float) -> float:
    from scipy.stats import t

    return float(t.ppf(0.5 + 0.5 * level, max(freedom, 1.0)))


def _intervals(
    joint: Joint, law: str, best: Minimum, free: Minimum, variance: float, quantile: float
) -> tuple[FlowParameter, ...]:
    """Where the profile of the sum of squares rises by quantile^2 variance, within the bounds."""
    names, out = FLOW_LAWS[law].names, []
    values = _of_theta(best.theta, law)
    for j, (name, value) in enumerate(zip(names, values, strict=True)):
        ends = [_crossing(joint, law, free, j, side * quantile, variance) for side in (-1.0, 1.0)]
        if name == "K":
            ends = [math.exp(x) for x in ends]
        low, high = max(min(ends[0], value), 0.0), max(ends[1], value)
        out.append(FlowParameter(name, FLOW_UNITS[name], value, low, high))
    return tuple(out)


def _crossing(
    joint: Joint,
    law: str,
    free: Minimum,
    j: int,
    target: float,
    variance: float,
) -> float:
    """Value of parameter j at which the root of the sum's rise, over its noise, is |target|."""
    spread, theta = free.spread, free.theta
    if not spread[j, j] > 0.0:  # at a limit, or without effect
        return float(theta[j])
    limits = FIT_RANGES[FLOW_LAWS[law].names[j]]
    held = [i == j for i in range(len(theta))]
    step = target * math.sqrt(variance * spread[j, j])
    for _ in range(8):
        x = float(np.clip(theta[j] + step, *limits))
        step = x - float(theta[j])
        start = theta + spread[:, j] * (step / spread[j, j])
        start[j] = x
        rise = joint.least(FLOW_LAWS[law], start, held, free.c).sum - free.sum
        ratio = math.sqrt(max(rise, 0.0) / variance) / abs(target)
        if abs(ratio - 1.0) < 0.01 or (x in limits and ratio < 1.0):
            break
        step *= float(np.clip(1.0 / max(ratio, 1e-9), 0.3, 2.0))
    return float(theta[j]) + step


def _warnings(r: Fitted, s: _Sliding, count: float) -> tuple[str, ...]:
    """What limits the claim; `count` is the step of the force's converter [N]."""
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
            "hardly be told apart"
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
