"""Sliding samples in clay: of a record, or of noisy columns."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError, choice
from ..model.constants import AXES
from ..simulation.record import Record, in_plane
from .outliers import Cleaned, robust_deviation, runs_of
from .trajectory import (
    LEAST_PER_KNOT,
    Motion,
    Series,
    Stretch,
    chosen_spacing,
    correlation_time,
)

LEAST_SLIDING = 50  # samples that slide
FAST = 10.0  # [m/s]: no hand is as fast
LEAST_SIGNAL = 5.0  # standard deviations above which a velocity counts as motion ...
DEVIATIONS = 60  # samples for the estimate of the usual deviation
COUNTS = 3.0  # ... and counts of the encoder between knots
LEAST_STRETCH = 3 * LEAST_PER_KNOT  # samples of a stretch
STEADY_STEP = 0.05  # largest change of a known velocity in a step; a force is the mean over one
ROUNDED = 0.29  # counts: standard deviation of rounding
UNDITHERED = 0.4  # counts: rounding alone leaves 0.29, noise of 0.3 beside it 0.42


class SampledClay(NamedTuple):
    """The clay at the samples of a record."""

    flows: np.ndarray  # b, Fy, K and n at each, shape (n, 4)
    dented: dict[str, np.ndarray]  # by law: where it resists an indented tool at rest


class Sliding(NamedTuple):
    """Samples that slide; positions and their splines where speeds are not known."""

    t: np.ndarray  # [s]
    sign: np.ndarray  # of the velocity
    f: np.ndarray  # against the motion [N]
    v: np.ndarray  # speeds [m/s], or the coefficients of the motion
    slowest: float  # least speed of a sliding sample [m/s]
    at: np.ndarray  # indices in the data
    p: np.ndarray = np.zeros(0)  # positions of these samples and of those between them [m]
    motion: Motion | None = None  # splines through the positions
    spacing: float = 0.0  # of their knots [s]
    force_variance: float = math.nan  # about a free curve [N^2]
    position_variance: float = 0.0  # [m^2]
    position_correlation: float = 1.0  # samples per independent one
    position_tails: float = 1.0  # deviation over that of normal noise with the same median

    @property
    def speeds(self) -> np.ndarray:
        """Speeds of the sliding samples, by the positions alone where they are not known [m/s]."""
        if self.motion is None:
            return self.v
        return np.maximum(self.motion.velocity(self.v), 0.5 * self.slowest)


def recorded_motion(r: Record, axis: str | None) -> tuple[str, Any, Any, Any, Any, Any]:
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
    r = in_plane(r)
    law, places = clay.laws[index], tuple(r.p.T)
    at = law.index(*places)
    inside = law.some[at]
    still = {x.name: x.force(law, 0.0, 1.0) for x in clay.kinds if x.force and not x.of_velocity}
    dented = {name: force[at] > 0.0 for name, force in still.items() if np.any(force)}
    met = SampledClay(np.array([r.b[:, index], *law.flows_at(*places)]).T, dented)
    if axis in AXES:
        return axis, places[index], r.v[:, index], r.fe[:, index], inside, met
    if not np.array_equal(*r.b.T):
        raise ParameterError("axis", axis, "must be x or y in clay that damps them differently")
    speed = np.hypot(*r.v.T)
    force = np.sum(r.fe * r.v, axis=1)
    force = np.divide(force, speed, out=np.zeros(len(speed)), where=speed > 0.0)
    along = np.cumsum(np.append(0.0, np.hypot(*np.diff(r.p, axis=0).T)))
    return axis, along, speed, force, inside, met


def check_one_law(met: SampledClay, inside: np.ndarray) -> None:
    """Refuse samples in clays of several laws, or in clay whose force depends on more variables."""
    for name, where in met.dented.items():
        if np.any(where[inside]):
            bound = "must lie in clay whose force follows from the velocity alone"
            raise ParameterError("data", f"samples in clay with {name}", bound)
    kinds = met.flows[inside]
    if np.any(np.ptp(kinds, axis=0) > 1e-9 * np.max(np.abs(kinds), axis=0)):
        low, high = kinds.min(axis=0).tolist(), kinds.max(axis=0).tolist()
        differing = ", ".join(
            f"{name} {a:g} to {b:g}"
            for name, a, b in zip(("b", "Fy", "K", "n"), low, high, strict=True)
            if a < b
        )
        bound = "must lie in clay of one law: choose a part of them by time or place"
        raise ParameterError("data", f"samples with {differing}", bound)


def sliding_at_known_speed(
    t: np.ndarray, v: np.ndarray, f: np.ndarray, inside: np.ndarray
) -> Sliding:
    """Moving samples whose known velocity changes little in a step."""
    change = np.abs(np.diff(v, prepend=v[:1]))
    change = np.maximum(change, np.append(change[1:], 0.0))
    speed = np.abs(v)
    at = inside & (change <= STEADY_STEP * speed) & (speed > 1e-4 * np.max(speed[inside]))
    if np.count_nonzero(at) < LEAST_SLIDING:
        raise _too_few(int(np.count_nonzero(at)))
    sign, speed = np.sign(v[at]), speed[at]
    return Sliding(t[at], sign, sign * f[at], speed, float(speed.min()), np.flatnonzero(at))


def _too_few(count: int) -> ParameterError:
    bound = f"must have {LEAST_SLIDING} samples or more that slide, faster than the noise"
    return ParameterError("data", f"{count} samples", bound)


def sliding_along_positions(
    t: np.ndarray, p: Cleaned, f: np.ndarray, inside: np.ndarray, out: np.ndarray
) -> Sliding:
    """Samples of sliding stretches, without outliers `out` of the force, and their splines."""
    inside, good, p = _unbroken(inside, p), ~p.bad, p.x - p.x.mean()
    usable, count = good & ~out, quantum(p[good])
    runs = [(a, b) for a, b in runs_of(inside) if b - a >= LEAST_STRETCH]
    if not runs:
        raise _too_few(0)
    stretches = [Stretch(t[a:b], (), good[a:b]) for a, b in runs]
    at = np.concatenate([np.arange(a, b) for a, b in runs])
    spacing, (variance,) = chosen_spacing([Series(stretches, p[at])])
    motion = Motion(stretches, spacing)
    v = np.zeros(len(t))
    v[at] = motion.velocity(motion.follow(p[at]))
    margin = math.ceil(spacing / float(np.median(np.diff(t))))
    slow = _slowest(motion, runs, margin, LEAST_SIGNAL * math.sqrt(variance))
    slow = np.maximum(slow, COUNTS * count / spacing)
    direction = np.zeros(len(t))
    direction[at] = np.where(np.abs(v[at]) > slow, np.sign(v[at]), 0.0)
    pieces = [x for a, b in runs for x in _between_rests(direction, a, b, margin)]
    found = [(x, some) for x in pieces if (some := _one_way_slides(direction, usable, *x))]
    single = [x for _, some in found for x in some]
    if sum(b - a for a, b in single) < LEAST_SLIDING:
        raise _too_few(sum(b - a for a, b in single))
    stretches = [
        Stretch(
            t[a:b],
            [0.5 * float(t[x[1]] + t[y[0]]) for x, y in zip(some, some[1:], strict=False)],
            good[a:b],
        )
        for (a, b), some in found
    ]
    at = np.concatenate([np.arange(*x) for x, _ in found])
    sliding = np.concatenate([np.arange(*x) for x in single])
    place = np.where(good[at], p[at], 0.0)
    one_way = [x for a, b in single for x in _without_gaps(usable, a, b)]
    usable_at = np.concatenate([np.arange(*x) for x in one_way])
    forces = [Stretch(t[a:b], (), usable[a:b]) for a, b in one_way]
    series = [Series(stretches, place), Series(forces, direction[usable_at] * f[usable_at])]
    spacing, (position_variance, force_variance) = chosen_spacing(series)
    sliding = sliding[usable[sliding]]
    sign = direction[sliding]
    motion = Motion(stretches, spacing, np.searchsorted(at, sliding), sign)
    c = motion.follow(place)
    left = (place - motion.place(c))[good[at]]
    position_variance = max(position_variance, (1e-12 * float(np.ptp(p))) ** 2)  # rounding
    usual = max(robust_deviation(left), ROUNDED * count, 1e-12 * float(np.ptp(p)))
    return Sliding(
        t[sliding],
        sign,
        sign * f[sliding],
        c,
        float(slow.min()),
        sliding,
        place,
        motion,
        spacing,
        force_variance,
        position_variance,
        correlation_time(left),
        math.sqrt(position_variance) / usual,
    )


def _one_way_slides(
    direction: np.ndarray, usable: np.ndarray, start: int, stop: int
) -> list[tuple[int, int]]:
    """Parts of a piece that slide one way and have enough usable samples, in order of time."""
    out = [
        (a + start, b + start)
        for way in (1.0, -1.0)
        for a, b in runs_of(direction[start:stop] == way)
    ]
    return sorted(x for x in out if np.count_nonzero(usable[slice(*x)]) >= LEAST_PER_KNOT)


def _unbroken(inside: np.ndarray, p: Cleaned) -> np.ndarray:
    """Samples used, without steps of the position and gaps that no spline should bridge."""
    out = inside.copy()
    out[p.steps] = False
    for first, stop in runs_of(p.bad):
        if stop - first > LEAST_PER_KNOT:
            out[first:stop] = False
    return out


def _without_gaps(kept: np.ndarray, start: int, stop: int) -> list[tuple[int, int]]:
    """Parts of a run that begin and end with kept samples, without long gaps, not too short."""
    good = np.flatnonzero(kept[start:stop]) + start
    parts = np.split(good, np.flatnonzero(np.diff(good) > LEAST_PER_KNOT) + 1)
    return [(int(x[0]), int(x[-1]) + 1) for x in parts if len(x) >= LEAST_PER_KNOT]


def _slowest(motion: Motion, runs: list[tuple[int, int]], margin: int, sigma: float) -> np.ndarray:
    """Least speed that counts as motion at each sample; larger near the ends of runs [m/s]."""
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
    """Parts of a run between rests; a rest longer than a knot's width loses that margin too."""
    rests = [(a + start, b + start) for a, b in runs_of(direction[start:stop] == 0.0)]
    out, begin = [], start
    for a, b in rests:
        if b - a > margin or a == start or b == stop:
            out.append((begin, a - margin if b - a > margin else a))
            begin = b + margin if b - a > margin else b
    out.append((begin, stop))
    return [(a, b) for a, b in out if b - a >= LEAST_STRETCH]


def quantum(x: np.ndarray) -> float:
    """Quantum of quantised samples: all differences are multiples of it; 0 for other samples."""
    steps = np.diff(np.unique(x))
    steps = steps[steps > 1e-9 * np.max(np.abs(x), initial=0.0)]  # rounding of the numbers
    if not len(steps):
        return 0.0
    whole = steps / steps.min()
    return 0.0 if np.any(np.abs(whole - np.round(whole)) > 0.02) else float(steps.min())


def driving_forces(f: np.ndarray, p: Cleaned | None, v: np.ndarray | None) -> np.ndarray:
    """Mask of the forces that drive the motion, (n,), by known velocities or by positions."""
    if v is None:
        assert p is not None
        v = np.gradient(p.x)
    return f * v < 0.0
