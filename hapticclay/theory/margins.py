"""Is the loop with this hand stable, and by how much? Verdicts on one axis at the nominal pose.

Frequency responses are ratios of polynomials, so their extremes and crossings are roots of polynomials: exact.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError, choice, flag, integer, number, numbers_of
from ..model.controller import PRINTED, Compensator
from ..model.operator import Operator
from . import gain_limit, linear_loop

BREAKS = ("force", "compensator")
LINEAR = "one axis at the nominal pose, linear, motors within their torque limits"


@dataclass(frozen=True)
class Verdict:
    """An answer and how far it is from the other one; true if the verdict is.

    Attributes:
        verdict: whether the property holds.
        margin: how far it is from changing; what it measures, and its unit, says `measures`.
        omega: limiting frequency [rad/s]; NaN if there is none.
        assumptions: what has to be so for the verdict to be one about the machine.
        method: how it was found, and whether that is exact, sufficient or sampled.
        measures: what `margin` is.
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


@dataclass(frozen=True)
class Margins:
    """What a stable loop bears before it is not; all zero (gain: 1) for an unstable one.

    Attributes:
        stable: whether the closed loop is.
        gain: factors on the loop's gain that it bears, (less, more): (0, inf) for any.
        phase: rad. delay: s, in the loop where it is broken.
        disk: alpha, the largest at which every complex factor (1 + d/2)/(1 - d/2), |d| < alpha, is borne
            (Seiler, Packard, Gahinet, An Introduction to Disk Margins, IEEE CSM 2020; skew 0). From 2 up every
            positive gain and every phase short of a half turn is among them.
        gain_omega, phase_omega, delay_omega, disk_omega: where each is reached [rad/s]; NaN if nowhere.
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


@dataclass(frozen=True, eq=False)
class Nyquist:
    """L along the positive frequencies, and what the whole contour encloses.

    Attributes:
        omega: [rad/s], shape (n,). L: complex, shape (n,).
        N: clockwise encirclements of -1 by the image of the contour. P: poles of L right of the axis.
        Z: N + P, the closed-loop poles right of the axis.
    """

    omega: np.ndarray
    L: np.ndarray
    N: int
    P: int

    @property
    def Z(self) -> int:
        return self.N + self.P


def open_loop(
    axis: str,
    K: float,
    b: float,
    *,
    impedance: bool = True,
    operator: Operator | None = None,
    at: str = "force",
    compensator: Compensator = PRINTED,
) -> tuple[np.ndarray, np.ndarray]:
    """The loop's transfer function as (numerator, denominator), an s common to both taken out.

    Args:
        axis: "x" or "y". K: gain. b: clay [N.s/m].
        impedance, operator: the hand, as in `gain_limit`.
        at: where the loop is broken: at the net "force", L = (G C + Sh)(Te + Th) (Eq. 8), or at the
            "compensator", G C (Te + Th)/(1 + Sh (Te + Th)) (Eq. 12), whose gain margin is that of K.
        compensator: shape of C.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    blank, passive, driven = linear_loop.loop_polynomials(
        axis, b, gain_limit.hand(impedance, operator), compensator
    )
    driven = number("K", K, 0.0) * driven
    if choice("at", at, BREAKS) == "force":
        n, d = np.polyadd(passive, driven), blank
    else:
        n, d = driven, np.polyadd(blank, passive)
    return (n[:-1], d[:-1]) if n[-1] == 0.0 == d[-1] else (n, d)


def nyquist(axis: str, K: float, b: float, *, at: str = "force", **kw) -> Nyquist:
    """The Nyquist curve and its count; arguments as `open_loop`."""
    n, d = open_loop(axis, K, b, at=at, **kw)
    size = np.abs(np.concatenate((np.roots(np.trim_zeros(n)), np.roots(np.trim_zeros(d)))))
    omega = gain_limit.frequency_grid(1e-2 * size.min(), 1e2 * size.max(), np.empty(0))
    return Nyquist(
        omega, np.polyval(n, 1j * omega) / np.polyval(d, 1j * omega), *encirclements(n, d)
    )


def encirclements(n: np.ndarray, d: np.ndarray) -> tuple[int, int]:
    """N and P of the loop n/d, counted along its curve and never from the closed-loop poles.

    The contour passes a pole at s = 0 on its right, in an arc so small that |L| is large all over it; the arc turns L
    by -pi for each such pole. Beyond the largest frequency L is constant.

    Args:
        n, d: polynomials, n of no higher degree than d; no root of d on the imaginary axis but at s = 0.

    Returns:
        (N, clockwise encirclements of -1; P, roots of d right of the axis).
    """
    n, d = np.trim_zeros(n, "f"), np.trim_zeros(d, "f")
    if not len(n):
        return 0, int(np.sum(np.roots(d).real > 0.0))
    poles, zeros = np.roots(np.trim_zeros(d, "b")), np.roots(np.trim_zeros(n, "b"))
    order = (len(d) - len(np.trim_zeros(d, "b"))) - (len(n) - len(np.trim_zeros(n, "b")))
    size = np.abs(np.concatenate((poles, zeros, [] if len(poles) + len(zeros) else [1.0])))
    low, high = 1e-3 * size.min(), 1e6 * size.max()

    def near(s: complex) -> float:
        return float(np.abs(np.polyval(n, s) / np.polyval(d, s)))

    while order > 0 and near(low) < 1e3:
        low *= 0.1
    while order < 0 and near(low) > 1e-3:
        low *= 0.1
    while len(n) < len(d) and near(1j * high) > 1e-3:
        high *= 10.0
    omega = gain_limit.frequency_grid(low, high, np.concatenate((poles, zeros)))
    if order <= 0:
        omega = np.concatenate(([1e-9 * low], omega))
    turned = 2.0 * gain_limit.phase_change(
        lambda w: 1.0 + np.polyval(n, 1j * w) / np.polyval(d, 1j * w), omega
    )
    return round((max(order, 0) * math.pi - turned) / (2.0 * math.pi)), int(
        np.sum(poles.real > 0.0)
    )


def margins(axis: str, K: float, b: float, *, at: str = "compensator", **kw) -> Margins:
    """Gain, phase, delay and disk margins of the continuous loop; arguments as `open_loop`.

    All from roots of polynomials. at="compensator": a factor on K, a delay of the compensator alone;
    at="force": a factor on, or a delay of, everything the net force does.
    """
    n, d = open_loop(axis, K, b, at=at, **kw)
    if not linear_loop.hurwitz(np.polyadd(n, d)):
        nan = math.nan
        return Margins(False, (1.0, 1.0), 0.0, 0.0, 0.0, (nan, nan), nan, nan, nan)
    n_, d_ = linear_loop.on_axis(n), linear_loop.on_axis(d)
    nd = np.convolve(n_, d_.conj())
    omega = linear_loop.positive_roots(nd.imag)
    with np.errstate(divide="ignore"):
        factor = -(np.abs(np.polyval(d_, omega)) ** 2) / np.polyval(nd, omega).real
    more, more_at = _nearest(factor, omega, factor > 1.0, np.argmin, math.inf)
    less, less_at = _nearest(factor, omega, (factor > 0.0) & (factor < 1.0), np.argmax, 0.0)
    omega = np.sqrt(linear_loop.positive_roots(np.polysub(square(n), square(d))))
    lag = np.angle(np.polyval(nd, omega)) + np.pi  # how far L is ahead of -1, 0 to 2 pi
    phase, phase_at = _nearest(
        np.minimum(lag, 2.0 * np.pi - lag), omega, lag > -1.0, np.argmin, math.inf
    )
    delay, delay_at = _nearest(lag / omega, omega, lag > -1.0, np.argmin, math.inf)
    if len(n) == len(d) and abs(n[0]) >= abs(
        d[0]
    ):  # L does not fall off: any delay turns it round -1
        delay, delay_at = 0.0, math.inf
    worst, disk_at = least_value(-square(np.polysub(d, n)), square(np.polyadd(d, n)))
    disk = 2.0 / math.sqrt(-worst)
    return Margins(
        True, (less, more), phase, delay, disk, (less_at, more_at), phase_at, delay_at, disk_at
    )


def _nearest(
    value: np.ndarray, omega: np.ndarray, mine: np.ndarray, pick: Callable, none: float
) -> tuple[float, float]:
    if not np.any(mine):
        return none, math.nan
    i = np.flatnonzero(mine)[pick(value[mine])]
    return float(value[i]), float(omega[i])


def square(poly: np.ndarray) -> np.ndarray:
    """|poly(j omega)|^2 as a polynomial in omega^2."""
    return real(poly, poly)


def real(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Re p(j omega) q(j omega)* as a polynomial in omega^2."""
    return np.convolve(linear_loop.on_axis(p), linear_loop.on_axis(q).conj()).real[::-1][::2][::-1]


def least_value(R: np.ndarray, Q: np.ndarray) -> tuple[float, float]:
    """Smallest value of R/Q over all frequencies, 0 and infinity included, and where [rad/s].

    Args:
        R, Q: polynomials in omega^2, Q >= 0.
    """
    R, Q = np.concatenate(([0.0], R)), np.concatenate(([0.0], Q))  # a constant has a slope, too
    slope = np.polysub(np.convolve(np.polyder(R), Q), np.convolve(R, np.polyder(Q)))
    x = np.concatenate(([0.0], linear_loop.positive_roots(slope)))
    R, Q = np.trim_zeros(R, "f"), np.trim_zeros(Q, "f")
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.nan_to_num(
            np.polyval(R, x) / np.polyval(Q, x), nan=math.inf, posinf=math.inf, neginf=-math.inf
        )
    end = (
        0.0
        if len(R) < len(Q)
        else R[0] / Q[0]
        if len(R) == len(Q)
        else math.copysign(math.inf, R[0])
    )
    i = int(np.argmin(value))
    return (float(value[i]), math.sqrt(x[i])) if value[i] <= end else (float(end), math.inf)


def bands(poly: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Bands of omega [rad/s] in which a polynomial in omega^2 is positive."""
    x = np.concatenate(([0.0], np.sort(linear_loop.positive_roots(poly))))
    inside = np.concatenate((0.5 * (x[1:] + x[:-1]), [2.0 * x[-1] + 1.0]))
    up = np.concatenate(([False], np.polyval(poly, inside) > 0.0, [False]))
    edges = np.concatenate((np.sqrt(x), [math.inf]))
    start, stop = np.flatnonzero(up[1:] & ~up[:-1]), np.flatnonzero(up[:-1] & ~up[1:])
    return tuple((float(edges[i]), float(edges[j])) for i, j in zip(start, stop, strict=True))


def coupled_stability(
    axis: str,
    K: float,
    b: float,
    *,
    impedance: bool = True,
    operator: Operator | None = None,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
) -> Verdict:
    """Whether the loop with this hand is stable; arguments as `gain_limit`.

    The margin is the gain limit over K. A loop that is stable again above its first limit has a verdict
    of True beside a margin below 1.
    """
    th = gain_limit.hand(impedance, operator)
    limit, omega = gain_limit.critical_gain(axis, b, th, Ts, delay, render)
    good = gain_limit.is_stable(axis, K, b, th, Ts, delay, render)
    how = (
        "eigenvalues of the exact sampled model"
        if Ts
        else "argument principle on the loop with its delay"
        if delay
        else "roots of the closed-loop polynomial"
    )
    hand = (
        f"the hand is {th.mass:g} s^2 + {th.damper:g} s + {th.spring:g} N/m"
        if th
        else "no hand at the handle"
    )
    return Verdict(good, limit / K, omega, (LINEAR, hand), f"{how}: exact", "gain limit over K")


def small_gain(axis: str, K: float, b: float, *, equation: int = 13, **kw) -> Verdict:
    """The paper's conditions for stability (Eqs. 9 to 13), with the bands where they fail; hand as in `open_loop`.

    (11), the same as (10), asks for |L| < 1 and (13), the same as (12), for |G C| < |1/(Te + Th) + Sh|: each
    sufficient, none necessary. (9) asks only that |1 + L| has no zero on the axis, which unstable loops fulfil too.

    Args:
        equation: 9, 10, 11, 12 or 13.

    Returns:
        Verdict whose margin is the least ratio of right to left side; for (9), the least |1 + L|.
    """
    if equation not in (9, 10, 11, 12, 13):
        raise ParameterError("equation", equation, "must be 9, 10, 11, 12 or 13")
    if equation == 9:
        n, d = open_loop(axis, K, b, **kw)
        worst, omega = least_value(square(np.polyadd(n, d)), square(d))
        how = "extreme of a ratio of polynomials: exact. Necessary for stability, not sufficient"
        return Verdict(
            worst > 0.0, math.sqrt(max(worst, 0.0)), omega, (LINEAR,), how, "least |1 + L|"
        )
    n, d = open_loop(axis, K, b, at="force" if equation < 12 else "compensator", **kw)
    worst, omega = least_value(-square(n), square(d))
    margin = 1.0 / math.sqrt(-worst) if worst else math.inf
    how = "extreme of a ratio of polynomials: exact. Sufficient for stability, not necessary"
    fails = bands(np.polysub(square(n), square(d)))
    return Verdict(
        margin > 1.0, margin, omega, (LINEAR,), how, "least right side over left side", fails
    )


def transparency(
    axis: str, K: float, b: float, omega: np.ndarray, *, compensator: Compensator = PRINTED
) -> np.ndarray:
    """fe/fh, the share of the hand's force that is the clay's (Eq. 7); the hand does not matter.

    Args:
        axis: "x" or "y". K: gain. b: clay [N.s/m]. omega: [rad/s], shape (n,). compensator: shape of C.

    Returns:
        Complex, shape (n,). At omega = 0 it is K b/(10 + K b) with the printed compensator.
    """
    e, d = linear_loop.device_admittance(axis, K, compensator)
    s = 1j * np.asarray(omega, dtype=float)
    felt = number("b", b, 0.0, unit="N.s/m") * np.polyval(e, s)
    return felt / (felt + np.polyval(d[:-1], s))


FIELDS = ("mass", "damper", "spring")


@dataclass(frozen=True)
class Box:
    """Ranges (low, high) of the hand's mass [kg], damper [N.s/m], spring [N/m]; rigid puts Th = infinity among them."""

    mass: tuple[float, float] = (0.25, 0.25)
    damper: tuple[float, float] = (2.0, 2.0)
    spring: tuple[float, float] = (6.0, 6.0)
    rigid: bool = False

    def __post_init__(self):
        for field in FIELDS:
            low, high = numbers_of(f"box.{field}", getattr(self, field), ("low", "high"), 0.0)
            if high < low:
                raise ParameterError(f"box.{field}", (low, high), "must have low <= high")
            object.__setattr__(self, field, (low, high))
            Operator(**{field: high})
        flag("box.rigid", self.rigid)

    def corners(self) -> list[Operator]:
        """The eight corners, each once."""
        return [
            Operator(*x)
            for x in sorted(set(itertools.product(self.mass, self.damper, self.spring)))
        ]

    def sample(self, n: int, seed: int = 0) -> list[Operator]:
        """n members, uniform within the box."""
        x = np.random.default_rng(seed).uniform(size=(n, 3))
        ranges = np.array([self.mass, self.damper, self.spring])
        return [
            Operator(*row) for row in (ranges[:, 0] + x * (ranges[:, 1] - ranges[:, 0])).tolist()
        ]


@dataclass(frozen=True)
class WorstCase:
    """What a box of hands does to the loop.

    Attributes:
        verdict: whether every hand of the box is stable, its margin the worst gain limit over K.
        limit: largest K up to which every hand is stable.
        hand: one that stops being stable there; None if it is the rigid arm.
    """

    verdict: Verdict
    limit: float
    hand: Operator | None


def critical_hand(
    axis: str, K: float, b: float, box: Box, compensator: Compensator = PRINTED
) -> tuple[Operator, float] | None:
    """A hand of the box that puts a pole on the imaginary axis, and where [rad/s]; None if there is none.

    Exact (zero exclusion; Barmish, New Tools for Robustness of Linear Systems, 1994). The closed-loop polynomial is
    A + E Th, so the pole s = j omega asks for one value Th = -A/E. The values of the box at omega are a rectangle,
    spring - mass omega^2 by omega damper: -A/E lies in it where four polynomials in omega^2 have the right sign.
    """
    blank, passive, driven = linear_loop.loop_polynomials(axis, b, None, compensator)
    A = np.polyadd(np.polyadd(blank, passive), K * driven)
    E = linear_loop.device_admittance(axis, K, compensator)[0]
    R, Q = real(-A, E), square(E)  # -A/E = R/Q + j omega X/Q
    X = np.convolve(linear_loop.on_axis(-A), linear_loop.on_axis(E).conj()).imag[::-1][1::2][::-1]
    (m0, m1), (d0, d1), (k0, k1) = box.mass, box.damper, box.spring
    tests = [
        np.polysub(X, d0 * Q),
        np.polysub(d1 * Q, X),
        np.polysub(R, np.convolve([-m1, k0], Q)),
        np.polysub(np.convolve([-m0, k1], Q), R),
    ]
    edges = np.unique(np.concatenate([linear_loop.positive_roots(t) for t in tests]))
    for x in np.concatenate((edges, 0.5 * (edges[1:] + edges[:-1]))).tolist():
        # where an edge of the box is met, to 1e-9 of the terms that cancel there
        if all(np.polyval(t, x) >= -1e-9 * np.polyval(np.abs(t), x) for t in tests):
            q = np.polyval(Q, x)
            return _member(box, float(np.polyval(R, x) / q), float(np.polyval(X, x) / q), x)
    return None


def _member(box: Box, real: float, damper: float, x: float) -> tuple[Operator, float]:
    """The hand of the box whose value at omega^2 = x is real + j omega damper."""
    low, high = (
        max(box.mass[0], (box.spring[0] - real) / x),
        min(box.mass[1], (box.spring[1] - real) / x),
    )
    mass = min(max(0.5 * (low + high), box.mass[0]), box.mass[1])
    spring = min(max(real + mass * x, box.spring[0]), box.spring[1])
    return Operator(mass, min(max(damper, box.damper[0]), box.damper[1]), spring), math.sqrt(x)


def rigid_limit(axis: str, compensator: Compensator = PRINTED) -> tuple[float, float]:
    """Largest K that is stable with an arm that cannot move, Th to infinity, and where [rad/s].

    The closed-loop poles tend to the zeros of G C + Sh, so the limit is that of its numerator, whatever the clay. The
    paper says below Eq. 13 that no compensator serves a rigid arm; that is what its sufficient condition says, not
    what the loop does.
    """
    driven = linear_loop.device_admittance(axis, 1.0, compensator)[0]
    passive = linear_loop.device_admittance(axis, 0.0, compensator)[0]
    return linear_loop.first_crossing(passive, np.polysub(driven, passive))


def worst_case(
    axis: str,
    K: float,
    b: float,
    box: Box,
    *,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
    compensator: Compensator = PRINTED,
    samples: int = 56,
) -> WorstCase:
    """The lowest gain limit over a box of hands.

    In continuous time without delay it is exact: K rises from zero until `critical_hand` finds one. With
    sampling or delay it is the least over the corners and random members, and the verdict's method says so.

    Args:
        axis: "x" or "y". K: gain. b: clay [N.s/m]. box: the hands.
        Ts, delay, render: as in `gain_limit`. compensator: shape of C, in continuous time.
        samples: random members tried with sampling or delay, 0 to 10000.
    """
    K = number("K", K, 0.0, above=True)
    if not isinstance(box, Box):
        raise ParameterError("box", box, "must be a Box")
    if Ts is None and not delay:
        limit, omega, hand = _exact_worst_case(axis, b, box, compensator)
        how = "zero exclusion, its value set a rectangle at every frequency: exact"
    else:
        if compensator != PRINTED:
            raise ParameterError(
                "compensator", compensator, "must be the printed one with sampling or delay"
            )
        members = box.corners() + box.sample(integer("samples", samples, 0, 10_000))
        found = [(*gain_limit.critical_gain(axis, b, th, Ts, delay, render), th) for th in members]
        limit, omega, hand = min(found, key=lambda x: x[0])
        how = f"sampled: the corners and {samples} random members, no proof for those between"
    if box.rigid:
        stiff, at = rigid_limit(axis, compensator)
        if stiff < limit:
            limit, omega, hand = stiff, at, None
        how += "; the rigid arm by the zeros of G C + Sh" + (
            ", in continuous time" if Ts or delay else ", exact"
        )
    verdict = Verdict(
        K < limit, limit / K, omega, (LINEAR, f"hand in {box}"), how, "worst gain limit over K"
    )
    return WorstCase(verdict, limit, hand)


def _exact_worst_case(
    axis: str, b: float, box: Box, compensator: Compensator
) -> tuple[float, float, Operator | None]:
    def unstable(K: float) -> bool:
        return not linear_loop.stable(axis, K, b, corners[0], compensator) or bool(
            critical_hand(axis, K, b, box, compensator)
        )

    corners = box.corners()
    limit, worst = min(
        ((linear_loop.continuous_gain_limit(axis, b, th, compensator), th) for th in corners),
        key=lambda x: x[0],
    )
    top = min(limit, 1e6)
    low, high = 0.0, (1.0 + 1e-6) * top
    if limit == math.inf and not unstable(top):
        return limit, math.nan, worst
    for K in np.geomspace(1e-4 * top, top, 49)[
        :-1
    ].tolist():  # a window narrower than 20 % in K may be jumped ...
        if unstable(K):
            high = K
            break
        low = K
    while high - low > 1e-12 * high:
        K = 0.5 * (low + high)
        low, high = (low, K) if unstable(K) else (K, high)
        if K in (low, high) and high - low <= 4.0 * math.ulp(high):
            break
    if high < (1.0 - 1e-7) * limit:  # ... but no limit of a corner; `critical_hand` is that sharp
        found = critical_hand(axis, high, b, box, compensator)
        return high, found[1] if found else math.nan, found[0] if found else worst
    blank, passive, driven = linear_loop.loop_polynomials(axis, b, worst, compensator)
    return limit, linear_loop.first_crossing(np.polyadd(blank, passive), driven)[1], worst
