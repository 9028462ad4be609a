"""The largest stable gain: in continuous time, with late motors, and in the sampled loop.

However the loop is built, K multiplies one signal in it, so a pole lies at s on the border of
stability where

    1 = K h(s),        s = j omega, or z = exp(j omega Ts) in the sampled loop.

The gains at which a pole can cross are therefore 1/h at the frequencies where h is real and
positive. Between two of them no pole crosses, so one test in each interval tells where the loop is
stable.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from ..errors import ParameterError, choice, number
from ..model.constants import AXES, B_MAX, S
from ..model.controller import PRINTED, Compensator
from ..model.operator import Operator
from ..model.scenario import RENDERS
from . import linear_loop, roots

PHASE_STEP = 1.01  # the frequency grid grows by this factor ...
NEAR_AXIS = 10.0 ** np.arange(-9.0, 0.0, 0.25)  # ... and closes in on every resonance
LEAST_GAIN = 1e-60  # nothing crosses at a lower gain, and products of such numbers vanish
SMALL_ANGLE = 1e-6  # an eigenvalue below this share of the largest is better known from the inverse


def gain_limit(
    axis: str,
    b: float,
    operator: Operator | None = None,
    *,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
    compensator: Compensator = PRINTED,
) -> float:
    """Largest compensator gain K up to which the loop of one axis is stable at the nominal pose.

    Every gain between 0 and the limit is stable. In continuous time without delay the limit is the
    first crossing of the closed-loop polynomial (Eq. 8); otherwise see `sampled_loop` (sampled) and
    `delayed_loop` (continuous, the motors late).

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        operator: arm at the handle; None for no hand (Th = 0).
        Ts: control sample [s]; None for continuous time.
        delay: from a measurement to the torque computed from it [s]. Everything the motors do is
            late by it: the servo's feedback, what the compensator commands, and clay that is held.
        render: the clay is "held" (a force of the motors) or "implicit" (physical, never late).
        compensator: shape of C; the printed one with sampling.

    Returns:
        K; inf if there is no limit, 0 if the loop is unstable at any gain.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    return critical_gain(axis, b, operator, Ts, delay, render, compensator)[0]


def critical_gain(
    axis: str,
    b: float,
    operator: Operator | None = None,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
    compensator: Compensator = PRINTED,
) -> tuple[float, float]:
    """The gain limit and the frequency at which the loop then rings.

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        operator: arm at the handle; None for no hand (Th = 0).
        Ts: control sample [s]; None for continuous time.
        delay: as in `gain_limit` [s].
        render: as in `gain_limit`.
        compensator: as in `gain_limit`.

    Returns:
        (K, omega [rad/s]).
    """
    loop = loop_family(axis, b, operator, Ts, delay, render, compensator)
    if loop:
        return first_instability(loop)
    denominator, passive, driven = linear_loop.loop_polynomials(axis, b, operator, compensator)
    return roots.first_crossing(denominator + passive, driven)


def is_stable(
    axis: str,
    K: float,
    b: float,
    operator: Operator | None = None,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
    compensator: Compensator = PRINTED,
) -> bool:
    """Whether the loop is stable at this very K, whatever it is below.

    Args:
        axis: "x" or "y".
        K: compensator gain.
        b: clay [N.s/m].
        operator: arm at the handle; None for no hand (Th = 0).
        Ts: control sample [s]; None for continuous time.
        delay: as in `gain_limit` [s].
        render: as in `gain_limit`.
        compensator: as in `gain_limit`.
    """
    K = number("K", K, 0.0, above=True)
    loop = loop_family(axis, b, operator, Ts, delay, render, compensator)
    return loop.stable(K) if loop else linear_loop.stable(axis, K, b, operator, compensator)


def loop_family(
    axis: str,
    b: float,
    operator: Operator | None,
    Ts: float | None,
    delay: float,
    render: str,
    compensator: Compensator = PRINTED,
) -> LoopFamily | None:
    """The sampled or late loop for every gain; None for the loop that is a polynomial.

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        operator: arm at the handle; None for no hand (Th = 0).
        Ts: control sample [s]; None for continuous time.
        delay: as in `gain_limit` [s].
        render: as in `gain_limit`.
        compensator: as in `gain_limit`.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    choice("axis", axis, AXES)
    b = number("b", b, 0.0, B_MAX, unit="N.s/m")
    delay = number("delay", delay, 0.0, 1.0, unit="s")
    choice("render", render, RENDERS)
    if Ts is None:
        return delayed_loop(axis, b, operator, delay, render, compensator) if delay else None
    Ts = number("Ts", Ts, 1e-6, 1.0, unit="s")
    number("delay", delay, 0.0, 100.0 * Ts, unit="s")
    if compensator != PRINTED:
        raise ParameterError("compensator", compensator, "must be the printed one with sampling")
    return sampled_loop(axis, b, operator, Ts, delay, render)


@dataclass(frozen=True)
class LoopFamily:
    """A loop for every gain.

    Attributes:
        h: complex function of omega [rad/s], (n,) to (n,); a pole lies on the border of stability
            where 1 = K h(omega).
        grid: frequencies dense enough to follow h [rad/s], ascending.
        stable: whether the loop is stable at K.
        last: highest frequency, where h is real by symmetry [rad/s]; None if there is none.
    """

    h: Callable[[np.ndarray], np.ndarray]
    grid: np.ndarray
    stable: Callable[[float], bool]
    last: float | None = None


def first_instability(loop: LoopFamily) -> tuple[float, float]:
    """Smallest K > 0 at which the loop stops being stable, and its frequency.

    Args:
        loop: the loop for every gain.

    Returns:
        (K, omega [rad/s]); (inf, nan) if it never does.
    """
    found = sorted(gain_crossings(loop))
    if not loop.stable(0.5 * found[0][0] if found else 1.0):
        return 0.0, math.nan
    for i, (K, omega) in enumerate(found):
        following = found[i + 1][0] if i + 1 < len(found) else 4.0 * K
        if following > (1.0 + 1e-9) * K and not loop.stable(math.sqrt(K * following)):
            return K, omega
    return math.inf, math.nan


def gain_crossings(loop: LoopFamily) -> list[tuple[float, float]]:
    """Every (K, omega) with 1 = K h(omega), K > 0.

    A pair of crossings closer than the grid shows as a dip of Im h that keeps its sign; every dip
    is followed to its bottom.

    Args:
        loop: the loop for every gain.
    """
    from scipy.optimize import brentq, minimize_scalar

    def phase_sine(x: float) -> float:
        z = loop.h(np.array([math.exp(x)]))[0]
        return z.imag / abs(z)

    x, z = np.log(loop.grid), loop.h(loop.grid)
    if not np.any(z):  # nothing drives the compensator
        return []
    y, ahead = z.imag / np.abs(z), z.real > 0.0
    y[y == 0.0] = 1e-300  # a grid point on a crossing: found from one side
    spans = [
        (x[i], x[i + 1]) for i in np.flatnonzero((y[:-1] * y[1:] < 0.0) & (ahead[:-1] | ahead[1:]))
    ]
    dip = (np.abs(y[1:-1]) <= np.minimum(np.abs(y[:-2]), np.abs(y[2:]))) & (y[:-2] * y[1:-1] > 0.0)
    for i in np.flatnonzero(dip & (y[1:-1] * y[2:] > 0.0) & ahead[1:-1]) + 1:
        sign = math.copysign(1.0, y[i])
        bottom = minimize_scalar(
            lambda x, s=sign: s * phase_sine(x), bounds=(x[i - 1], x[i + 1]), method="bounded"
        )
        if bottom.fun < 0.0:  # type: ignore[union-attr]
            spans += [(x[i - 1], bottom.x), (bottom.x, x[i + 1])]  # type: ignore[union-attr]
    omega = [math.exp(brentq(phase_sine, a, c, xtol=1e-15, rtol=1e-14)) for a, c in spans]  # type: ignore[arg-type]
    omega += [] if loop.last is None else [loop.last]
    with np.errstate(divide="ignore"):
        K = 1.0 / loop.h(np.array(omega)).real if omega else np.empty(0)
    return [(float(k), float(w)) for k, w in zip(K, omega, strict=True) if 0.0 < k < math.inf]


def frequency_grid(low: float, high: float, resonances: np.ndarray) -> np.ndarray:
    """Frequencies dense in ratio, and denser around resonances.

    Args:
        low: lowest [rad/s].
        high: highest [rad/s].
        resonances: shape (n,), real or complex; their magnitudes count [rad/s].
    """
    base = np.geomspace(low, high, 2 + int(math.log(high / low) / math.log(PHASE_STEP)))
    near = np.multiply.outer(
        np.abs(resonances), np.concatenate((1.0 - NEAR_AXIS, [1.0], 1.0 + NEAR_AXIS))
    ).ravel()
    return np.unique(np.concatenate((base, near[(near > low) & (near < high)])))


def delayed_loop(
    axis: str,
    b: float,
    operator: Operator | None,
    delay: float,
    render: str = "held",
    compensator: Compensator = PRINTED,
) -> LoopFamily:
    """The continuous loop in which everything the motors do is late.

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
        delay: of the motors [s].
        render: the clay is "held" by the motors or "implicit".
        compensator: shape of C.
    """
    parts = linear_loop.delayed_polynomials(axis, b, operator, render, compensator)
    if not linear_loop.hand_or_none(operator).spring:  # the integrator that moves the handle
        parts = tuple(p // roots.VARIABLE for p in parts)
    physical, motors, driven = parts
    resonances = np.concatenate([roots.roots(p) for p in (physical, physical + motors, driven)])
    resonances = resonances[np.abs(resonances) > 0.0]
    size = np.abs(resonances)

    def h(omega: np.ndarray) -> np.ndarray:
        s = 1j * omega
        late = np.exp(-s * delay)
        return -driven(s) * late / (physical(s) + motors(s) * late)

    def stable(K: float) -> bool:
        acting = motors + K * driven
        a, high = float(np.exp(np.mean(np.log(size)))), float(size.max())
        bound = Polynomial(np.abs(acting.coef))
        while bound(high) > 0.5 * abs(physical(1j * high)):
            high *= 2.0
        turns = np.linspace(0.0, high, min(100 + int(4.0 * delay * high), 100_000))

        def F(omega: np.ndarray) -> np.ndarray:
            s = 1j * omega
            return (physical(s) + acting(s) * np.exp(-s * delay)) / (s + a) ** physical.degree()

        # Each zero right of the axis turns F by -pi between 0 and infinity; beyond 1e3 high hardly
        # anything is left.
        near = frequency_grid(1e-3 * size.min(), 1e3 * high, resonances)
        return abs(phase_change(F, np.union1d(turns, near))) < 0.5 * np.pi

    low, top = 1e-3 * size.min(), max(40.0 / delay, 2.0 * np.abs(resonances.imag).max())
    turns = np.linspace(low, top, min(int(4.0 * delay * top), 100_000))
    return LoopFamily(h, np.union1d(turns, frequency_grid(low, top, resonances)), stable)


def phase_change(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> float:
    """Change of arg f along x [rad]; points are inserted until no step changes it by more than 0.5.

    Args:
        f: complex function, (n,) to (n,).
        x: ascending, shape (n,).

    Returns:
        NaN if that takes over a million points: a delay of so many turns that no loop survives it.
    """
    z = f(x)
    while len(x) < 1_000_000:
        wide = np.flatnonzero(np.abs(np.angle(z[1:] / z[:-1])) > 0.5)
        middle = 0.5 * (x[wide] + x[wide + 1])
        new = (middle > x[wide]) & (middle < x[wide + 1])
        if not np.any(new):
            return float(np.sum(np.angle(z[1:] / z[:-1])))
        x, z = np.insert(x, wide[new] + 1, middle[new]), np.insert(z, wide[new] + 1, f(middle[new]))
    return math.nan


def sampled_loop(
    axis: str,
    b: float,
    operator: Operator | None,
    Ts: float,
    delay: float = 0.0,
    render: str = "held",
) -> LoopFamily:
    """The sampled loop (`control="sampled"`) as x(k+1) = (M + K beta gamma) x(k), exact at samples.

    See `linear_loop.sampled_differences`. A loop is stable if every eigenvalue lies within the unit
    circle, except the one at z = 1 that moves the handle where Th has no spring. Clay of 1e9 N.s/m,
    or K = 1e-12, puts others within rounding of z = 1, so the map is of differences, M - 1, with
    place and forces counted from where handle and motors would rest under this delta: the column of
    delta is then exactly zero, and its entry in gamma is that of the hand's spring.

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
        Ts: control sample [s].
        delay: from the sample to the torque computed from it [s].
        render: the clay is "held" by the motors or "implicit".
    """
    less, beta, gamma = linear_loop.sampled_differences(axis, b, operator, Ts, delay, render)
    beta, gamma = beta[:, 0], gamma[0]
    s, spring = S[AXES.index(axis)], linear_loop.hand_or_none(operator).spring
    rest = np.zeros(len(less))
    rest[0] = s.stiffness / (s.stiffness + s.gain * spring)
    rest[4], rest[6:] = 1.0, spring * rest[0]
    less, beta = less - np.outer(rest, less[2]), beta - rest * beta[2]
    less[:, 2], gamma[2] = 0.0, -spring * rest[0]
    free = np.delete(np.delete(less, 2, 0), 2, 1)  # without the integrator
    if not spring:
        less, beta, gamma = free, np.delete(beta, 2), np.delete(gamma, 2)
    n = len(less)

    def h(omega: np.ndarray) -> np.ndarray:
        out = np.empty(len(omega), dtype=complex)
        for i in range(0, len(omega), 256):
            # exp(j omega Ts) - 1, without the loss of digits at slow frequencies
            z1 = np.expm1(1j * omega[i : i + 256] * Ts)
            resolvent = z1[:, None, None] * np.eye(n) - less
            out[i : i + 256] = np.linalg.solve(resolvent, beta[:, None])[:, :, 0] @ gamma
        return out

    def stable(K: float) -> bool:
        z1 = eigenvalues(less + max(K, LEAST_GAIN) * np.outer(beta, gamma))
        return bool(np.all(2.0 * z1.real + np.abs(z1) ** 2 < 0.0))  # |1 + z1| < 1

    z1 = eigenvalues(free)
    poles = np.log1p(z1[np.abs(1.0 + z1) > 1e-6]) / Ts
    zeros = roots.nonzero_roots(linear_loop.environment_polynomial(b, operator))
    resonances = np.concatenate((poles, zeros))
    top = np.pi / Ts
    low = min(1e-2 * np.abs(resonances).min(), 0.1 * top)
    near = frequency_grid(low, top * (1.0 - 1e-9), resonances.imag)
    return LoopFamily(h, np.union1d(np.linspace(low, top, 20 * n)[:-1], near), stable, top)


def eigenvalues(a: np.ndarray) -> np.ndarray:
    """Eigenvalues, the small ones as exact as the large: from the inverse, where they are large.

    Args:
        a: matrix, shape (n, n).
    """
    z = np.linalg.eigvals(a)
    z = z[np.argsort(np.abs(z))]
    small = int(np.sum(np.abs(z) < SMALL_ANGLE * np.abs(z[-1])))
    if small:
        large = np.linalg.eigvals(np.linalg.inv(a))
        z[:small] = 1.0 / large[np.argsort(-np.abs(large))][:small]
    return z
