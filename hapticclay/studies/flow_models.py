"""Candidate laws of resistance: fitted one by one, compared, and their intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import matrices
from ..arguments import named
from .outliers import robust_deviation
from .sliding import Sliding
from .trajectory import FIT_RANGES, ForceLaw, JointFit, Minimum

FLOW_LAWS: dict[str, ForceLaw] = {  # from simple to rich, named as `Flow.kind`
    "viscous": ForceLaw(("b",)),
    "Coulomb": ForceLaw(("Fy",)),
    "Bingham": ForceLaw(("Fy", "b")),
    "power law": ForceLaw(("K", "n")),
    "Herschel-Bulkley": ForceLaw(("Fy", "K", "n")),
}
RICHEST = "Herschel-Bulkley"
FLOW_UNITS = {"Fy": "N", "K": "N/(m/s)^n", "n": "", "b": "N.s/m"}
PARSIMONY = 6.0  # of AICc: a richer law needs odds of 20 to 1, exp(6/2), over a simpler one
OUTLYING = 6.0  # deviations from every law that make a force an outlier
SMALLEST_OUTLIER = 1e-2  # of the usual force; smaller ones are errors of splines and steps
PEELED = 0.5  # of the largest residual: outliers go from large to small, which hide behind them
MOST_OUTLIERS = 0.2  # share of the forces; more of them are no outliers
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


def theta_of(values: Sequence[float], law: str) -> np.ndarray:
    """Parameters as the vector theta of a law: log K in place of K."""
    pairs = zip(FLOW_LAWS[law].names, values, strict=True)
    return np.array([math.log(max(x, 1e-300)) if name == "K" else x for name, x in pairs])


def parameters_of(theta: np.ndarray, law: str) -> list[float]:
    """The parameters in a vector theta."""
    pairs = zip(FLOW_LAWS[law].names, theta.tolist(), strict=True)
    return [math.exp(min(x, 700.0)) if name == "K" else x for name, x in pairs]


def first_guesses(law: str, v: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Initial parameters of a fit: linear least squares over a grid of flow indices."""
    names, best = FLOW_LAWS[law].names, None
    for n in TRIAL_INDICES if "n" in names else (1.0,):
        columns = {"Fy": np.ones(len(v)), "b": v, "K": v**n}
        linear = [x for x in names if x != "n"]
        X = np.stack([columns[x] for x in linear], axis=1)
        found = matrices.least_squares(X, f)
        a = dict(zip(linear, found.tolist(), strict=True), n=n)
        if a.get("K", 1.0) <= 0.0:  # the force falls with the speed: start almost flat
            a["K"] = 1e-3 * float(np.mean(np.abs(f))) / float(np.mean(v)) ** n
            a["Fy"] = float(np.mean(f))
            found = np.array([a[x] for x in linear])
        left = float(np.sum((f - X @ found) ** 2))
        if best is None or left < best[0]:
            best = left, [a[x] for x in names]
    assert best is not None
    return theta_of(best[1], law)


def best_fit(joint: JointFit, law: str, start: np.ndarray) -> tuple[Minimum, Minimum]:
    """Least-squares fits with Fy, b >= 0, and with Fy, b of any sign."""
    flowing = FLOW_LAWS[law]
    free = found = joint.solve(flowing, start)
    held = np.zeros(len(start), dtype=bool)
    signed = np.array([x in ("Fy", "b") for x in flowing.names])
    while (bad := signed & (found.theta < 0.0)).any():
        held |= bad
        found = joint.solve(flowing, np.where(held, 0.0, found.theta), held.tolist())
    return found, free


def outlying_forces(s: Sliding) -> np.ndarray:
    """Mask of forces far from the richest law, (n,): spikes, wrong signs.

    The noise is that of the median, and near rest also that of the speed. Where many forces are
    far, the law is wrong, and none counts as an outlier.
    """
    v = s.speeds
    least = SMALLEST_OUTLIER / OUTLYING * float(np.median(np.abs(s.f)))
    out = np.zeros(len(v), dtype=bool)
    for _ in range(40):
        joint = JointFit(s.f[~out], s.p[:0], None, v[~out], 0.0, 0.5 * s.slowest)
        found, _ = best_fit(joint, RICHEST, first_guesses(RICHEST, v[~out], s.f[~out]))
        force, slope, _ = FLOW_LAWS[RICHEST].slopes(found.theta, v)
        rest = np.abs(s.f - force)
        usual = OUTLYING * max(robust_deviation(rest[~out]), least)
        usual = usual + (2.0 * s.slowest * np.abs(slope) if s.motion else 0.0)
        far = rest > np.maximum(usual, PEELED * float(np.max(rest[~out])))
        new = far | (out & (rest > usual))
        if np.count_nonzero(new) > MOST_OUTLIERS * len(v):
            return np.zeros(len(v), dtype=bool)
        if np.array_equal(new, out):
            break
        out = new
    return out


def refit_nested(joint: JointFit, found: dict[str, tuple[Minimum, Minimum]]) -> None:
    """Fit the richest law again from a simpler law that it contains, if that one fits better."""
    if RICHEST not in found:
        return
    for law, (fit, _) in found.items():
        if found[RICHEST][0].sum <= fit.sum:
            continue
        a = dict(zip(FLOW_LAWS[law].names, fit.theta, strict=True))
        values = a.get("Fy", 0.0), a.get("K", math.log(max(a.get("b", 0.0), 1e-6))), a.get("n", 1.0)
        again = best_fit(joint, RICHEST, np.array(values))
        if again[0].sum < found[RICHEST][0].sum:
            found[RICHEST] = again


def student_quantile(level: float, freedom: float) -> float:
    """Student's t quantile of a two-sided interval."""
    from scipy.special import stdtrit

    return float(stdtrit(max(freedom, 1.0), 0.5 + 0.5 * level))


def parameter_intervals(
    joint: JointFit, law: str, best: Minimum, free: Minimum, variance: float, quantile: float
) -> tuple[FlowParameter, ...]:
    """Profile intervals: where the profiled sum of squares rises by quantile^2 variance."""
    names, out = FLOW_LAWS[law].names, []
    values = parameters_of(best.theta, law)
    for j, (name, value) in enumerate(zip(names, values, strict=True)):
        ends = [_crossing(joint, law, free, j, side * quantile, variance) for side in (-1.0, 1.0)]
        if name == "K":
            ends = [math.exp(x) for x in ends]
        low, high = max(min(ends[0], value), 0.0), max(ends[1], value)
        out.append(FlowParameter(name, FLOW_UNITS[name], value, low, high))
    return tuple(out)


def _crossing(
    joint: JointFit,
    law: str,
    free: Minimum,
    j: int,
    target: float,
    variance: float,
) -> float:
    """Value of parameter j at which the root of the sum's rise over the noise is |target|."""
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
        rise = joint.solve(FLOW_LAWS[law], start, held, free.c).sum - free.sum
        ratio = math.sqrt(max(rise, 0.0) / variance) / abs(target)
        if abs(ratio - 1.0) < 0.01 or (x in limits and ratio < 1.0):
            break
        step *= float(np.clip(1.0 / max(ratio, 1e-9), 0.3, 2.0))
    return float(theta[j]) + step
