"""The largest gain that keeps a margin, in continuous time.

A margin is a region around -1 which the Nyquist curve must not enter: a segment of the real axis
(gain margin), an arc of the unit circle (phase and delay margin), a disk (disk margin). At each
frequency L = p + K a runs along a straight line as K rises. So the gain at which it meets the
region is the root of a quadratic, and the largest gain that keeps the margin is the least such gain
over all frequencies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from . import gain_crossings, linear_loop, roots, stability_margins
from .loops import Loop

BEYOND = 1e6  # the search for a frequency extends so far beyond every pole and zero
SLOWEST = 1e-30  # share of the largest of them below which one counts as an integrator
NEAR_BEST = 1.5  # minima on the grid up to this factor above the least one are refined

Region = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]  # of omega, p and a: least K


def first_gain(loop: Loop, at: str, gain: float, phase: float, disk: float, late: float) -> float:
    """Least K > 0 at which one of the margins is used up."""
    blank, passive, driven = linear_loop.loop_polynomials(loop)
    if at == "compensator":
        fixed, driven, below = Polynomial([0.0]), driven, blank + passive
    else:
        fixed, below = passive, blank
    if not np.any(driven.coef):
        return math.inf
    if at == "force":  # the servo alone, without compensator
        m = stability_margins.margins(replace(loop, K=0.0), at=at)
        if m.gain[1] < gain or m.phase < phase or m.disk < disk or m.delay < late:
            return 0.0
    touching = roots.crossings(below + gain * fixed, gain * driven) if at == "force" else []
    best = min((K for K, _ in touching), default=math.inf)  # L = -1/gain, the end of the segment
    omega = _frequencies(fixed, driven, below, late)
    ends = [_limits(fixed, driven, below, end) for end in (0, -1)]
    pole = roots.multiplicity_of_zero(below) > roots.multiplicity_of_zero(driven)
    for region, whole in _regions(gain if at == "force" else 1.0, phase, disk, late):

        def least(omega: np.ndarray, region: Region = region) -> np.ndarray:
            s = 1j * omega
            return region(omega, fixed(s) / below(s), driven(s) / below(s))

        K = least(omega)
        if pole and K[0] < math.inf:  # L grows without bound towards 0, where it is in the region
            return 0.0
        best = min(best, _refined(least, omega, K))
        for p, a in ends if whole else ():
            best = min(best, float(region(np.zeros(1), p, a)[0]))
    if late:  # a loop that does not roll off tolerates no delay
        p, a = ends[1]
        best = min(best, 0.0 if abs(p[0]) >= 1.0 else float(_on_circle(p, a)[1][0]))
    return best


def _regions(gain: float, phase: float, disk: float, late: float) -> Iterator[tuple[Region, bool]]:
    """The least K in each region, and whether this holds at the frequencies 0 and infinity, too."""
    if gain > 1.0:
        yield lambda omega, p, a: _in_segment(p, a, gain), False
    if disk:
        yield lambda omega, p, a: _in_disk(p, a, 2.0 / disk), True
    for branch in (0, 1):
        if phase:
            yield lambda omega, p, a, i=branch: _in_arc(p, a, i, phase), False
        if late:
            yield lambda omega, p, a, i=branch: _within_delay(omega, p, a, i, late), False


def _on_circle(p: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The gains at which |p + K a| = 1, the lower first; nan or inf for none."""
    with np.errstate(all="ignore"):
        size, turn, rest = np.abs(a) ** 2, (p.conj() * a).real, np.abs(p) ** 2 - 1.0
        root = np.sqrt(turn**2 - size * rest)
        far = -(turn + np.copysign(root, turn))
        ends = np.array([far / size, rest / far])
    return tuple(np.sort(ends, axis=0))  # type: ignore[return-value]


def _in_arc(p: np.ndarray, a: np.ndarray, branch: int, phase: float) -> np.ndarray:
    K = _on_circle(p, a)[branch]
    with np.errstate(invalid="ignore"):
        near = np.abs(np.angle(-(p + K * a))) <= phase
    return np.where(near & (K > 0.0), K, math.inf)


def _within_delay(
    omega: np.ndarray, p: np.ndarray, a: np.ndarray, branch: int, late: float
) -> np.ndarray:
    K = _on_circle(p, a)[branch]
    with np.errstate(invalid="ignore"):
        ahead = np.angle(-(p + K * a)) % (2.0 * np.pi)
        near = ahead < late * omega
    return np.where(near & (K > 0.0), K, math.inf)


def _in_segment(p: np.ndarray, a: np.ndarray, gain: float) -> np.ndarray:
    """The K at which L is real, where L then lies between -1 and -1/gain.

    At both ends of the segment the gains are exact, as the gain limits of two loops. This finds
    where the curve comes to lie on it in between.
    """
    with np.errstate(all="ignore"):
        K = -p.imag / a.imag
        real = p.real + K * a.real
        near = (real >= -1.0) & (real < -1.0 / gain)
    return np.where(near & (K > 0.0), K, math.inf)


def _in_disk(p: np.ndarray, a: np.ndarray, most: float) -> np.ndarray:
    """The first K at which |1 - L| > most |1 + L|, most >= 1."""
    less, more = most * most - 1.0, most * most + 1.0
    A = less * np.abs(a) ** 2
    B = less * (p.conj() * a).real + more * a.real
    C = less * np.abs(p) ** 2 + 2.0 * more * p.real + less
    with np.errstate(all="ignore"):  # A K^2 + 2 B K + C < 0
        K = C / (np.sqrt(B * B - A * C) - B)
    K = np.where((B < 0.0) & np.isfinite(K), K, math.inf)
    return np.where(C < 0.0, 0.0, K)


def _frequencies(
    fixed: Polynomial, driven: Polynomial, below: Polynomial, late: float
) -> np.ndarray:
    """Frequencies beyond every pole and zero on both sides [rad/s].

    They are dense around poles and zeros, and where a pole can cross the axis: -1 lies in every
    region, so there the gains of the regions begin.
    """
    found = np.concatenate([roots.nonzero_roots(p) for p in (below + fixed, driven, below)])
    resonant = found[found.imag > 0.0]
    around = resonant.imag + np.abs(resonant.real) * np.linspace(-5.0, 5.0, 41)[:, None]
    size = np.abs(found)
    if late:
        size = np.append(size, 1.0 / late)
    crossed = [w for _, w in roots.crossings(below + fixed, driven) if 0.0 < w < math.inf]
    size = np.append(size, crossed)
    size = size[size > SLOWEST * size.max(initial=0.0)]
    low, high = size.min(initial=1.0) / BEYOND, size.max(initial=1.0) * BEYOND
    return np.union1d(gain_crossings.frequency_grid(low, high, size), around[around > 0.0])


def _refined(least: Callable[[np.ndarray], np.ndarray], omega: np.ndarray, K: np.ndarray) -> float:
    """The least value of a function, given on a grid, refined around its minima there."""
    best = float(K.min())
    if not 0.0 < best < math.inf:
        return best
    around = np.concatenate(([math.inf], K, [math.inf]))
    low = (K <= around[:-2]) & (K <= around[2:]) & (K < NEAR_BEST * best)
    for i in np.flatnonzero(low).tolist():
        best = min(best, roots.refined_minimum(least, omega, K, i)[0])
    return best


def _limits(
    fixed: Polynomial, driven: Polynomial, below: Polynomial, end: int
) -> tuple[np.ndarray, np.ndarray]:
    """p and a at the frequency 0 (end 0) or infinity (end -1); nan where one is infinite."""

    def limit(p: Polynomial) -> float:
        if not np.any(p.coef):
            return 0.0
        p, q = p.trim(), below.trim()
        if end == 0:
            n, d = roots.multiplicity_of_zero(p), roots.multiplicity_of_zero(q)
        else:
            n, d = p.degree(), q.degree()
        vanishes = n > d if end == 0 else n < d
        if n != d:
            return 0.0 if vanishes else math.nan
        return float(p.coef[n] / q.coef[d])

    p, a = np.array([limit(fixed)], complex), np.array([limit(driven)], complex)
    return (p, a) if np.isfinite(p + a).all() else (p * math.nan, a * math.nan)
