"""Is the loop with this hand stable, and by how much? Verdicts on one axis at the nominal pose.

Frequency responses are ratios of polynomials, so their extremes and crossings are roots of polynomials: exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError, choice, number
from ..model.scenario import Operator
from . import gain_limit, linear_loop
from .linear_loop import PRINTED, Compensator

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


def loop(
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
    blank, passive, driven = linear_loop.terms(axis, b, gain_limit.hand(impedance, operator), compensator)
    driven = number("K", K, 0.0) * driven
    if choice("at", at, BREAKS) == "force":
        n, d = np.polyadd(passive, driven), blank
    else:
        n, d = driven, np.polyadd(blank, passive)
    return (n[:-1], d[:-1]) if n[-1] == 0.0 == d[-1] else (n, d)


def nyquist(axis: str, K: float, b: float, *, at: str = "force", **kw) -> Nyquist:
    """The Nyquist curve and its count; arguments as `loop`."""
    n, d = loop(axis, K, b, at=at, **kw)
    size = np.abs(np.concatenate((np.roots(np.trim_zeros(n)), np.roots(np.trim_zeros(d)))))
    omega = gain_limit.grid(1e-2 * size.min(), 1e2 * size.max(), np.empty(0))
    return Nyquist(omega, np.polyval(n, 1j * omega) / np.polyval(d, 1j * omega), *encirclements(n, d))


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
    omega = gain_limit.grid(low, high, np.concatenate((poles, zeros)))
    if order <= 0:
        omega = np.concatenate(([1e-9 * low], omega))
    turned = 2.0 * gain_limit.turning(lambda w: 1.0 + np.polyval(n, 1j * w) / np.polyval(d, 1j * w), omega)
    return round((max(order, 0) * math.pi - turned) / (2.0 * math.pi)), int(np.sum(poles.real > 0.0))


def margins(axis: str, K: float, b: float, *, at: str = "compensator", **kw) -> Margins:
    """Gain, phase, delay and disk margins of the continuous loop; arguments as `loop`.

    All from roots of polynomials. at="compensator": a factor on K, a delay of the compensator alone;
    at="force": a factor on, or a delay of, everything the net force does.
    """
    n, d = loop(axis, K, b, at=at, **kw)
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
    phase, phase_at = _nearest(np.minimum(lag, 2.0 * np.pi - lag), omega, lag > -1.0, np.argmin, math.inf)
    delay, delay_at = _nearest(lag / omega, omega, lag > -1.0, np.argmin, math.inf)
    if len(n) == len(d) and abs(n[0]) >= abs(d[0]):  # L does not fall off: any delay turns it round -1
        delay, delay_at = 0.0, math.inf
    worst, disk_at = least(-square(np.polysub(d, n)), square(np.polyadd(d, n)))
    disk = 2.0 / math.sqrt(-worst)
    return Margins(True, (less, more), phase, delay, disk, (less_at, more_at), phase_at, delay_at, disk_at)


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


def least(R: np.ndarray, Q: np.ndarray) -> tuple[float, float]:
    """Smallest value of R/Q over all frequencies, 0 and infinity included, and where [rad/s].

    Args:
        R, Q: polynomials in omega^2, Q >= 0.
    """
    R, Q = np.concatenate(([0.0], R)), np.concatenate(([0.0], Q))  # a constant has a slope, too
    slope = np.polysub(np.convolve(np.polyder(R), Q), np.convolve(R, np.polyder(Q)))
    x = np.concatenate(([0.0], linear_loop.positive_roots(slope)))
    R, Q = np.trim_zeros(R, "f"), np.trim_zeros(Q, "f")
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.nan_to_num(np.polyval(R, x) / np.polyval(Q, x), nan=math.inf, posinf=math.inf, neginf=-math.inf)
    end = 0.0 if len(R) < len(Q) else R[0] / Q[0] if len(R) == len(Q) else math.copysign(math.inf, R[0])
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
    limit, omega = gain_limit.critical(axis, b, th, Ts, delay, render)
    good = gain_limit.is_stable(axis, K, b, th, Ts, delay, render)
    how = (
        "eigenvalues of the exact sampled model"
        if Ts
        else "argument principle on the loop with its delay"
        if delay
        else "roots of the closed-loop polynomial"
    )
    hand = f"the hand is {th.mass:g} s^2 + {th.damper:g} s + {th.spring:g} N/m" if th else "no hand at the handle"
    return Verdict(good, limit / K, omega, (LINEAR, hand), f"{how}: exact", "gain limit over K")


def small_gain(axis: str, K: float, b: float, *, equation: int = 13, **kw) -> Verdict:
    """The paper's conditions for stability (Eqs. 9 to 13), with the bands where they fail; hand as in `loop`.

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
        n, d = loop(axis, K, b, **kw)
        worst, omega = least(square(np.polyadd(n, d)), square(d))
        how = "extreme of a ratio of polynomials: exact. Necessary for stability, not sufficient"
        return Verdict(worst > 0.0, math.sqrt(max(worst, 0.0)), omega, (LINEAR,), how, "least |1 + L|")
    n, d = loop(axis, K, b, at="force" if equation < 12 else "compensator", **kw)
    worst, omega = least(-square(n), square(d))
    margin = 1.0 / math.sqrt(-worst) if worst else math.inf
    how = "extreme of a ratio of polynomials: exact. Sufficient for stability, not necessary"
    fails = bands(np.polysub(square(n), square(d)))
    return Verdict(margin > 1.0, margin, omega, (LINEAR,), how, "least right side over left side", fails)


def transparency(axis: str, K: float, b: float, omega: np.ndarray, *, compensator: Compensator = PRINTED) -> np.ndarray:
    """fe/fh, the share of the hand's force that is the clay's (Eq. 7); the hand does not matter.

    Args:
        axis: "x" or "y". K: gain. b: clay [N.s/m]. omega: [rad/s], shape (n,). compensator: shape of C.

    Returns:
        Complex, shape (n,). At omega = 0 it is K b/(10 + K b) with the printed compensator.
    """
    e, d = linear_loop.device(axis, K, compensator)
    s = 1j * np.asarray(omega, dtype=float)
    felt = number("b", b, 0.0, unit="N.s/m") * np.polyval(e, s)
    return felt / (felt + np.polyval(d[:-1], s))
