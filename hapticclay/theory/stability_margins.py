"""Stability of one axis at the nominal pose: verdicts, margins, and the worst case over hands.

Frequency responses are ratios of polynomials, so their extremes and crossings are roots of
polynomials: exact. An uncertain hand is a box of Th; the loop is judged over the whole box.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.polynomial import Polynomial

from ..arguments import named
from ..display import brief, html_table
from ..errors import Bound, ParameterError, array_of
from . import exact_roots, gain_crossings, linear_loop, roots
from .exact_roots import rational
from .held_words import hand_words
from .loops import Loop, of_loop

Break = Literal["force", "compensator"]  # where a loop is opened
BREAKS = get_args(Break)
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
def open_loop(loop: Loop, *, at: Break = "force") -> tuple[Polynomial, Polynomial]:
    """The loop's transfer function as (numerator, denominator), common factors s removed."""
    return _opened(loop, at)


def _opened(
    loop: Loop, at: str, polynomial: Callable[[Any], Polynomial] = Polynomial
) -> tuple[Polynomial, Polynomial]:
    """As `open_loop`, by polynomials of another kind: see `linear_loop.loop_polynomials`."""
    blank, passive, driven = linear_loop.loop_polynomials(loop, polynomial)
    driven = polynomial([loop.gain]) * driven
    if at == "force":
        n, d = passive + driven, blank
    else:
        n, d = driven, blank + passive
    shared = 0
    while shared < min(len(n.coef), len(d.coef)) - 1 and n.coef[shared] == 0.0 == d.coef[shared]:
        shared += 1
    return polynomial(n.coef[shared:]), polynomial(d.coef[shared:])


@of_loop("K", "b", "operator", timing=True)
def nyquist(loop: Loop, *, at: Break = "force") -> Nyquist:
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
    n, d = _opened(loop, at, rational)
    N, P = encirclements(n, d)
    low, high = np.array([exact_roots.root_sizes(p) for p in (n, d) if np.any(p.coef)]).T
    omega = gain_crossings.frequency_grid(1e-2 * low.min(), 1e2 * high.max(), np.empty(0))
    s = 1j * omega
    return Nyquist(omega, exact_roots.approximate(n)(s) / exact_roots.approximate(d)(s), N, P)


def encirclements(n: Polynomial, d: Polynomial) -> tuple[int, int]:
    """N and P of the loop n/d, without its closed-loop poles.

    The contour passes poles on the axis on their right. The phase of 1 + L = (n + d)/d turns by
    half a turn along the axis for each root of n + d on the left and of d on the right, by minus
    half a turn for each of n + d on the right and of d on the left. The turns are counted exactly,
    in rational arithmetic: however near to -1 the curve passes, however sharp its resonances.
    """
    n, d = exact_roots.exact(n), exact_roots.exact(d)
    P = exact_roots.count_right(d)
    return (exact_roots.roots_right(n + d)[0] - P if np.any(n.coef) else 0), P


@of_loop("K", "b", "operator", timing=True)
def margins(loop: Loop, *, at: Break = "compensator") -> Margins:
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
    n, d = (p.trim() for p in _opened(loop, at, rational))
    if not roots.hurwitz(n + d):
        return NO_MARGINS
    factors, crossed = roots.crossings(d, n), exact_roots.unit_crossings(n, d)
    rolls_off = n.degree() < d.degree() or abs(n.coef[-1]) < abs(d.coef[-1])
    n, d = exact_roots.approximate(n), exact_roots.approximate(d)
    worst, disk_at = roots.peak_ratio(d - n, d + n)
    found = _margins(factors, *crossed, (2.0 / worst, disk_at))
    # where L does not roll off, any delay makes it encircle -1
    return found if rolls_off else replace(found, delay=0.0, delay_omega=math.inf)


def _is_timed(loop: Loop, at: str) -> bool:
    """Whether the loop is sampled or delayed; it can then be opened at the compensator only."""
    timed = loop.Ts is not None or loop.delay > 0.0
    if at != "compensator" and timed:
        raise ParameterError("at", at, "must be 'compensator' with sampling or delay")
    return timed


def _response_nyquist(family: gain_crossings.LoopFamily, K: float) -> Nyquist:
    """The curve of L = -K h, and its count N = Z - P: of late loops by the argument principle."""
    if K >= family.most:
        bound = f"must be < {family.most:g}: above, poles without number lie on the right"
        raise ParameterError("K", K, bound)
    P = family.right(0.0)
    N = family.right(K) - P if K and np.any(family.h(family.grid)) else 0
    return Nyquist(family.grid, -K * family.h(family.grid), N, P)


def _response_margins(family: gain_crossings.LoopFamily, K: float) -> Margins:
    """Margins of L = -K h."""
    if not family.stable(K):
        return NO_MARGINS
    found = [*gain_crossings.gain_crossings(family), (family.most, math.inf)]
    factors = [(crossing / (K or 1e-300), omega) for crossing, omega in found]
    omega = np.array(gain_crossings.unit_crossings(family, K) if K else [])
    lag = np.angle(-family.h(omega)) + np.pi if len(omega) else omega
    return _margins(factors, omega, lag, _response_disk(family, K, [w for _, w in found]))


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


def _margins(
    factors: Sequence[tuple[float, float]],
    omega: np.ndarray,
    lag: np.ndarray,
    disk: tuple[float, float],
) -> Margins:
    """Margins of a stable loop.

    They follow from the factors on the gain at which a pole crosses, with their frequencies; the
    frequencies at which |L| = 1, with the phase ahead of -1; and the disk margin.
    """
    none = math.inf, math.nan
    more = min((x for x in factors if 1.0 < x[0] < math.inf), default=none)
    less = max((x for x in factors if 0.0 < x[0] < 1.0), default=(0.0, math.nan))
    turns = zip(np.minimum(lag, 2.0 * np.pi - lag).tolist(), omega.tolist(), strict=True)
    phase, phase_at = min(turns, default=none)
    delays = zip((lag / omega).tolist(), omega.tolist(), strict=True)
    delay, delay_at = min(delays, default=none)
    return Margins(
        True, (less[0], more[0]), phase, delay, disk[0], (less[1], more[1]), phase_at, delay_at,
        disk[1],
    )  # fmt: skip


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
    assumptions = LINEAR, f"{hand_words(loop.operator)} at the handle"
    return Verdict(
        good, limit / loop.gain, omega, assumptions, f"{how}: exact", "gain limit over K"
    )


@of_loop("K", "b", "operator")
def small_gain(loop: Loop, *, equation: Annotated[int, Bound(9, 13)] = 13) -> Verdict:
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
