"""Stability of one axis at the nominal pose: verdicts, margins, and the worst case over hands.

Frequency responses are ratios of polynomials, so their extremes and crossings are roots of
polynomials: exact. An uncertain hand is a box of Th; the loop is judged over the whole box.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from ..arguments import named
from ..display import brief, html_table
from ..errors import (
    ParameterError,
    array_of,
    choice,
    integer,
)
from . import gain_crossings, linear_loop, roots
from .loops import Loop, of_loop

BREAKS = ("force", "compensator")
ON_AXIS = 1e-9  # poles this near the axis, as a share of their size, count as on it
ARC = 1e-6  # radius of the arc around one, as a share of its frequency
DIPS = 20  # dips of |1 + L| that are refined, the deepest ones on the grid
LINEAR = "one axis at the nominal pose, linear, motors within their torque limits"


@named
@dataclass(frozen=True)
class Verdict:
    """A verdict and its margin; true if the verdict is.

    Attributes:
        verdict: whether the property holds.
        margin: distance from a change of the verdict; `measures` names its quantity and unit.
        omega: limiting frequency [rad/s]; NaN if there is none.
        assumptions: conditions under which the verdict applies to the machine.
        method: how it was found, and whether that is exact, sufficient or sampled.
        measures: quantity and unit of margin.
        fails: bands of frequency in which the condition fails [rad/s].
    """

    verdict: bool
    margin: float
    omega: float
    assumptions: tuple[str, ...]
    method: str
    measures: str
    fails: tuple[tuple[float, float], ...] = ()

    def __bool__(self) -> bool:
        return self.verdict

    def __repr__(self) -> str:
        at = "" if math.isnan(self.omega) else f" at {self.omega:.4g} rad/s"
        return f"<Verdict {self.verdict}: {self.measures} {self.margin:.4g}{at}>"

    def _repr_html_(self) -> str:
        rows = [(self.measures, f"{self.margin:.6g}")]
        rows += [("at", f"{self.omega:.6g} rad/s")] * (not math.isnan(self.omega))
        bands = [f"{low:.4g} to {high:.4g} rad/s" for low, high in self.fails]
        rows += [("fails from", "\n".join(bands))] * bool(bands)
        rows += [("method", self.method), ("assumes", "\n".join(self.assumptions))]
        return html_table(f"Verdict: {'it holds' if self.verdict else 'it fails'}", rows)


@named
@dataclass(frozen=True)
class Margins:
    """Stability margins of a loop; all zero (gain: 1) for an unstable one.

    Attributes:
        stable: whether the closed loop is.
        gain: tolerated factors on the loop gain, (less, more); (0, inf) for any.
        phase: phase margin [rad].
        delay: delay margin at the point where the loop is opened [s].
        disk: alpha, the largest at which the loop tolerates every complex factor (1 + d/2)/(1 -
            d/2), |d| < alpha (Seiler, Packard, Gahinet, An Introduction to Disk Margins, IEEE CSM
            2020; skew 0). From 2 up these include every positive gain and every phase below a half
            turn.
        gain_omega: frequencies at which the gain margins are reached [rad/s]; NaN for none.
        phase_omega: the same for the phase margin.
        delay_omega: the same for the delay margin.
        disk_omega: the same for the disk margin.
    """

    stable: bool
    gain: tuple[float, float]
    phase: float
    delay: float
    disk: float
    gain_omega: tuple[float, float]
    phase_omega: float
    delay_omega: float
    disk_omega: float


NO_MARGINS = Margins(
    False, (1.0, 1.0), 0.0, 0.0, 0.0, (math.nan, math.nan), math.nan, math.nan, math.nan
)


@named
@dataclass(frozen=True, eq=False)
class Nyquist:
    """L along the positive frequencies, and the encirclements of its whole contour.

    Attributes:
        omega: [rad/s], shape (n,).
        L: complex, shape (n,).
        N: clockwise encirclements of -1 by the image of the contour.
        P: poles of L right of the axis.
    """

    def __repr__(self) -> str:
        return brief(self)

    omega: np.ndarray
    L: np.ndarray
    N: int
    P: int

    @property
    def Z(self) -> int:
        """Closed-loop poles right of the axis, N + P."""
        return self.N + self.P


@of_loop("K", "b", "operator")
def open_loop(loop: Loop, *, at: str = "force") -> tuple[Polynomial, Polynomial]:
    """The loop's transfer function as (numerator, denominator), common factors s removed.

    Args:
        loop: the loop with its K; or axis, K, b, operator, and other parts by name.
        at: where the loop is opened: at the net "force", L = (G C + Sh)(Te + Th) (Eq. 8), or at the
            "compensator", G C (Te + Th)/(1 + Sh (Te + Th)) (Eq. 12), whose gain margin is that of
            K.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    blank, passive, driven = linear_loop.loop_polynomials(loop)
    driven = loop.gain * driven
    if choice("at", at, BREAKS) == "force":
        n, d = passive + driven, blank
    else:
        n, d = driven, blank + passive
    while n.coef[0] == 0.0 == d.coef[0]:
        n, d = n // roots.VARIABLE, d // roots.VARIABLE
    return n, d


@of_loop("K", "b", "operator", timing=True)
def nyquist(loop: Loop, *, at: str = "force") -> Nyquist:
    """The Nyquist curve and its encirclements.

    With sampling the contour is the unit circle, z = exp(j omega Ts), and P and Z count poles
    outside it.

    Args:
        loop: the loop with its K; or axis, K, b, operator, and other parts by name.
        at: where the loop is opened, as in `open_loop`; "compensator" with sampling or delay.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    if _is_timed(loop, at):
        return _response_nyquist(gain_crossings.loop_family(loop), loop.gain)
    n, d = open_loop(loop, at=at)
    size = np.abs(np.concatenate((roots.nonzero_roots(n), roots.nonzero_roots(d))))
    omega = gain_crossings.frequency_grid(1e-2 * size.min(), 1e2 * size.max(), np.empty(0))
    return Nyquist(omega, n(1j * omega) / d(1j * omega), *encirclements(n, d))


def encirclements(n: Polynomial, d: Polynomial) -> tuple[int, int]:
    """N and P of the loop n/d, counted along its curve, not from the closed-loop poles.

    The contour passes poles on the axis on their right, in arcs so small that |L| is large all over
    them; such an arc turns L by -pi for each such pole. Beyond the largest frequency L is constant.

    Args:
        n: numerator, of no higher degree than d.
        d: denominator.

    Returns:
        (N, clockwise encirclements of -1; P, roots of d right of the axis).
    """
    n, d = n.trim(), d.trim()
    poles, zeros = roots.nonzero_roots(d), roots.nonzero_roots(n)
    on = np.abs(poles.real) <= ON_AXIS * np.abs(poles)
    P = int(np.sum((poles.real > 0.0) & ~on))
    if not np.any(n.coef):
        return 0, P
    order = roots.multiplicity_of_zero(d) - roots.multiplicity_of_zero(n)
    size = np.abs(np.concatenate((poles, zeros, [] if len(poles) + len(zeros) else [1.0])))
    low, high = 1e-3 * size.min(), 1e6 * size.max()

    def magnitude(s: complex) -> float:
        return float(np.abs(n(s) / d(s)))

    while order > 0 and magnitude(low) < 1e3:
        low *= 0.1
    while order < 0 and magnitude(low) > 1e-3:
        low *= 0.1
    while n.degree() < d.degree() and magnitude(1j * high) > 1e-3:
        high *= 10.0
    omega = gain_crossings.frequency_grid(low, high, np.concatenate((poles, zeros)))
    if order <= 0:
        omega = np.concatenate(([1e-9 * low], omega))
    arcs = np.sort(np.abs(poles[on & (poles.imag > 0.0)]))
    turned = -math.pi * len(arcs)
    for start, end in itertools.pairwise((0.0, *arcs.tolist(), math.inf)):
        gap = ARC if start < math.inf else 0.0
        piece = omega[(omega > start * (1.0 + gap)) & (omega < end * (1.0 - gap))]
        turned += gain_crossings.phase_change(lambda w: 1.0 + n(1j * w) / d(1j * w), piece)
    return round((max(order, 0) * math.pi - 2.0 * turned) / (2.0 * math.pi)), P


@of_loop("K", "b", "operator", timing=True)
def margins(loop: Loop, *, at: str = "compensator") -> Margins:
    """Gain, phase, delay and disk margins, in continuous time from roots of polynomials.

    With sampling or delay the margins follow from the frequency response at the compensator, up to
    half the sampling frequency: crossings as in `gain_limit`, the disk margin on a refined grid.

    Args:
        loop: the loop with its K; or axis, K, b, operator, and other parts by name.
        at: "compensator": a factor on K, a delay of the compensator alone; "force": a factor on, or
            a delay of, all effects of the net force, in continuous time without delay.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    if _is_timed(loop, at):
        return _response_margins(gain_crossings.loop_family(loop), loop.gain)
    n, d = (p.trim() for p in open_loop(loop, at=at))
    if not roots.hurwitz(n + d):
        return NO_MARGINS
    nd = roots.cross_spectrum(n, d)
    omega = roots.positive_roots(Polynomial(nd.coef.imag))
    with np.errstate(divide="ignore"):
        factor = -(np.abs(roots.on_axis(d)(omega)) ** 2) / nd(omega).real
        ends = [-d.coef[0] / n.coef[0]]  # L is real at 0 and, if it does not roll off, at infinity
        ends += [-d.coef[-1] / n.coef[-1]] if n.degree() == d.degree() else []
    factor = np.concatenate((factor, ends))
    omega = np.concatenate((omega, [0.0, math.inf][: len(ends)]))
    more, more_at = _extreme(factor, omega, factor > 1.0, np.argmin, math.inf)
    less, less_at = _extreme(factor, omega, (factor > 0.0) & (factor < 1.0), np.argmax, 0.0)
    n2, d2 = roots.squared_magnitude(n), roots.squared_magnitude(d)
    omega = np.sqrt(roots.positive_roots(n2 - d2))
    lag = np.angle(nd(omega)) + np.pi  # phase of L ahead of -1, 0 to 2 pi
    every = lag > -1.0
    turn = np.minimum(lag, 2.0 * np.pi - lag)
    phase, phase_at = _extreme(turn, omega, every, np.argmin, math.inf)
    delay, delay_at = _extreme(lag / omega, omega, every, np.argmin, math.inf)
    if n.degree() == d.degree() and abs(n.coef[-1]) >= abs(d.coef[-1]):
        delay, delay_at = 0.0, math.inf  # L does not roll off: any delay makes it encircle -1
    worst, disk_at = roots.peak_ratio(d - n, d + n)
    disk = 2.0 / worst
    return Margins(
        True, (less, more), phase, delay, disk, (less_at, more_at), phase_at, delay_at, disk_at
    )


def _is_timed(loop: Loop, at: str) -> bool:
    """Whether the loop is sampled or delayed; it can then be opened at the compensator only."""
    timed = loop.Ts is not None or loop.delay > 0.0
    if choice("at", at, BREAKS) != "compensator" and timed:
        raise ParameterError("at", at, "must be 'compensator' with sampling or delay")
    return timed


def _response_nyquist(family: gain_crossings.LoopFamily, K: float) -> Nyquist:
    """The curve of L = -K h, counted as in `encirclements`."""
    if K >= family.most:
        bound = f"must be < {family.most:g}: above, poles without number lie on the right"
        raise ParameterError("K", K, bound)

    def back(omega: np.ndarray) -> np.ndarray:
        return 1.0 - K * family.h(omega)

    omega, low = family.grid, float(family.grid[0])
    while family.order and K and abs(back(np.array([low]))[0]) < 1e3:
        low *= 0.1
    last = [w for w in family.ends if w > omega[-1]]  # the Nyquist frequency
    if not last:  # L rolls off, or its absolute value stays below 1
        top = float(omega[-1])
        while abs(back(np.array([top]))[0] - 1.0) > max(0.5, 0.5 * (1.0 + K / family.most)):
            top *= 2.0
        omega = np.append(omega, top) if top > omega[-1] else omega
    path = np.concatenate(([low] if low < omega[0] else [], omega, last))
    turned = gain_crossings.phase_change(back, path)
    if not last:
        turned -= np.angle(back(path[-1:])[0])
    N = round((family.order * (K > 0.0) * math.pi - 2.0 * turned) / (2.0 * math.pi))
    return Nyquist(family.grid, -K * family.h(family.grid), N, family.right())


def _response_margins(family: gain_crossings.LoopFamily, K: float) -> Margins:
    """Margins of L = -K h."""
    if not family.stable(K):
        return NO_MARGINS
    found = [*gain_crossings.gain_crossings(family), (family.most, math.inf)]
    factor, omega = np.array(found).T / [[K or 1e-300], [1.0]]
    more, more_at = _extreme(factor, omega, (factor > 1.0) & (factor < np.inf), np.argmin, math.inf)
    less, less_at = _extreme(factor, omega, factor < 1.0, np.argmax, 0.0)
    omega = np.array(gain_crossings.unit_crossings(family, K) if K else [])
    lag = np.angle(-family.h(omega)) + np.pi if len(omega) else omega
    every = lag > -1.0
    turn = np.minimum(lag, 2.0 * np.pi - lag)
    phase, phase_at = _extreme(turn, omega, every, np.argmin, math.inf)
    delay, delay_at = _extreme(lag / omega, omega, every, np.argmin, math.inf)

    disk, disk_at = _response_disk(family, K, [w for _, w in found])
    return Margins(
        True, (less, more), phase, delay, disk, (less_at, more_at), phase_at, delay_at, disk_at
    )


def _response_disk(
    family: gain_crossings.LoopFamily, K: float, crossed: Sequence[float]
) -> tuple[float, float]:
    """The disk margin of L = -K h, and its frequency.

    Near a frequency at which a pole can cross the axis, |1 + L| may dip between two points of any
    grid. So those frequencies are points of it, and the deepest dips are refined.
    """

    def near(omega: np.ndarray) -> np.ndarray:
        L = -K * family.h(omega)
        return np.abs((1.0 + L) / (1.0 - L))

    inner = [w for w in crossed if family.grid[0] < w < math.inf]
    omega = np.unique(np.concatenate((family.grid, family.ends, inner)))
    size = near(omega)
    around = np.concatenate(([math.inf], size, [math.inf]))
    dips = np.flatnonzero((size <= around[:-2]) & (size <= around[2:]))
    places = dips[np.argsort(size[dips])][:DIPS].tolist()
    least, at = min(roots.refined_minimum(near, omega, size, i) for i in places)
    if family.most < math.inf:  # L does not roll off: it comes as near to -1 again and again
        far = abs(1.0 - K / family.most) / (1.0 + K / family.most)
        least, at = min((least, at), (far, math.inf))
    return 2.0 * least, at


def _extreme(
    value: np.ndarray, omega: np.ndarray, mask: np.ndarray, pick: Callable, none: float
) -> tuple[float, float]:
    """The value that `pick` selects within the mask, and its omega; (none, nan) if it is empty."""
    if not np.any(mask):
        return none, math.nan
    i = np.flatnonzero(mask)[pick(value[mask])]
    return float(value[i]), float(omega[i])


@of_loop("K", "b", "operator", timing=True)
def coupled_stability(loop: Loop) -> Verdict:
    """Whether the loop with this hand is stable.

    The margin is the gain limit over K. A loop that is stable again above its first limit has the
    verdict True with a margin below 1.

    Args:
        loop: the loop with its K > 0; or axis, K, b, operator, and other parts by name.
    """
    good = gain_crossings.is_stable(loop)
    limit, omega = gain_crossings.critical_gain(loop)
    if loop.Ts:
        how = "eigenvalues of the exact sampled model"
    elif loop.delay:
        how = "argument principle on the loop with its delay"
    else:
        how = "roots of the closed-loop polynomial"
    hand = "no hand at the handle"
    if loop.operator:
        th = loop.operator
        th = f"{th.mass:g} s^2 + {th.damper:g} s + {th.spring:g}"
        hand = f"the hand is {th} N/m"
    return Verdict(
        good, limit / loop.gain, omega, (LINEAR, hand), f"{how}: exact", "gain limit over K"
    )


@of_loop("K", "b", "operator")
def small_gain(loop: Loop, *, equation: int = 13) -> Verdict:
    """The paper's conditions for stability (Eqs. 9 to 13), with the bands where they fail.

    (11), the same as (10), requires |L| < 1 and (13), the same as (12), |G C| < |1/(Te + Th) + Sh|:
    each is sufficient, none is necessary. (9) requires only that |1 + L| has no zero on the axis,
    which holds for unstable loops too.

    Args:
        loop: the loop with its K; or axis, K, b, operator, and other parts by name.
        equation: 9, 10, 11, 12 or 13.

    Returns:
        Verdict whose margin is the least ratio of right to left side; for (9), the least |1 + L|.
    """
    equation = integer("equation", equation, 9, 13)
    at = "force" if equation < 12 else "compensator"
    n, d = open_loop(loop, at=at)
    n2, d2 = roots.squared_magnitude(n), roots.squared_magnitude(d)
    how = "extreme of a ratio of polynomials: exact. "
    if equation == 9:
        peak, omega = roots.peak_ratio(d, n + d)
        margin = 1.0 / peak
        how += "Necessary for stability, not sufficient"
        return Verdict(margin > 0.0, margin, omega, (LINEAR,), how, "least |1 + L|")
    peak, omega = roots.peak_ratio(n, d)
    margin = 1.0 / peak if peak else math.inf
    how += "Sufficient for stability, not necessary"
    fails = roots.positive_bands(n2 - d2)
    measures = "least right side over left side"
    return Verdict(margin > 1.0, margin, omega, (LINEAR,), how, measures, fails)


@of_loop("K", "b", "omega")
def transparency(loop: Loop, omega: np.ndarray) -> np.ndarray:
    """fe/fh, the clay's share of the hand's force (Eq. 7), independent of the hand.

    Args:
        loop: the loop with its K; or axis, K, b, omega, and other parts by name.
        omega: [rad/s], shape (n,).

    Returns:
        Complex, shape (n,). At omega = 0 it is K b/(10 + K b) with the printed compensator.
    """
    z, e = linear_loop.device_impedance(loop)
    s = 1j * array_of("omega", omega)
    clay, device = loop.b * e(s), z(s)
    if loop.k:
        clay, device = (loop.b * s + loop.k) * e(s), s * device
    return clay / (clay + device)
