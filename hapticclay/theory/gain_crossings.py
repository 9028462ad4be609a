"""The largest stable gain: in continuous time, with delayed motors, and in the sampled loop.

In every loop K multiplies one signal, so a pole lies at s on the border of stability where

    1 = K h(s),        s = j omega, or z = exp(j omega Ts) in the sampled loop.

The gains at which a pole can cross are therefore 1/h at the frequencies where h is real and
positive. Between two of them no pole crosses, so one test per interval decides whether the loop is
stable there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from ..errors import number
from ..model.compensator import Compensator
from . import linear_loop, roots
from .linear_loop import LinearLoop

PHASE_STEP = 1.01  # the frequency grid grows by this factor ...
NEAR_AXIS = 10.0 ** np.arange(-9.0, 0.0, 0.25)  # ... and closes in on every resonance
LEAST_GAIN = 1e-60  # no pole crosses at a lower gain, and products of such numbers underflow
SMALL_ANGLE = 1e-6  # eigenvalues below this share of the largest are computed from the inverse


def critical_gain(loop: LinearLoop) -> tuple[float, float]:
    """The gain limit and the frequency of oscillation at that gain.

    Args:
        loop: the loop, its K ignored.

    Returns:
        (K, omega [rad/s]).
    """
    if loop.Ts is not None or loop.delay:
        return first_instability(loop_family(loop))
    denominator, passive, driven = linear_loop.loop_polynomials(loop)
    return roots.first_crossing(denominator + passive, driven)


def is_stable(loop: LinearLoop) -> bool:
    """Whether the loop is stable at its K, whether or not it is stable at lower K.

    Args:
        loop: the loop with its K > 0.
    """
    K = number("K", loop.gain, 0.0, above=True)
    if loop.Ts is not None:
        return _within_circle(*_acting_map(loop)[:3], K)
    if loop.delay:
        return loop_family(loop).stable(K)
    return linear_loop.stable(loop)


def loop_family(loop: LinearLoop) -> LoopFamily:
    """The sampled or delayed loop for every gain.

    Args:
        loop: the loop, sampled or delayed, its K ignored.
    """
    return delayed_loop(loop) if loop.Ts is None else sampled_loop(loop)


def no_poles() -> int:
    """Number of right-half-plane poles of an h that has none: 0."""
    return 0


@dataclass(frozen=True)
class LoopFamily:
    """A loop for every gain.

    Attributes:
        h: complex function of omega [rad/s], (n,) to (n,); a pole lies on the border of stability
            where 1 = K h(omega).
        grid: frequencies dense enough to follow h [rad/s], ascending.
        stable: whether the loop is stable at K.
        ends: further frequencies at which a pole may cross, where h is real by symmetry [rad/s].
        most: gain from which poles of arbitrarily high frequency lie right of the axis; inf for
            none.
        order: multiplicity of the pole of h at 0, or at z = 1.
        right: number of poles of h right of the axis, or outside the unit circle.
    """

    h: Callable[[np.ndarray], np.ndarray]
    grid: np.ndarray
    stable: Callable[[float], bool]
    ends: tuple[float, ...] = ()
    most: float = math.inf
    order: int = 0
    right: Callable[[], int] = no_poles


def first_instability(loop: LoopFamily) -> tuple[float, float]:
    """Smallest K > 0 at which the loop stops being stable, and its frequency.

    Args:
        loop: the loop for every gain.

    Returns:
        (K, omega [rad/s]); (inf, nan) if it is always stable.
    """
    found = gain_crossings(loop)
    found = sorted(found + [(loop.most, math.inf)] if loop.most < math.inf else found)
    if not loop.stable(0.5 * found[0][0] if found else 1.0):
        return 0.0, math.nan
    for i, (K, omega) in enumerate(found):
        following = found[i + 1][0] if i + 1 < len(found) else 4.0 * K
        if following > (1.0 + 1e-9) * K and not loop.stable(math.sqrt(K * following)):
            return K, omega
    return math.inf, math.nan


def gain_crossings(loop: LoopFamily) -> list[tuple[float, float]]:
    """Every (K, omega) with 1 = K h(omega), K > 0.

    Two crossings closer than the grid appear as a dip of Im h without a change of sign, so the
    search also minimises every dip.

    Args:
        loop: the loop for every gain.
    """

    def phase_sine(x: float) -> float:
        z = loop.h(np.array([math.exp(x)]))[0]
        return z.imag / abs(z)

    z = loop.h(loop.grid)
    if not np.any(z):  # the compensator has no input
        return []
    omega = _zeros(phase_sine, np.log(loop.grid), z.imag / np.abs(z), z.real > 0.0)
    omega += loop.ends
    with np.errstate(divide="ignore"):
        K = 1.0 / loop.h(np.array(omega)).real if omega else np.empty(0)
    return [(float(k), float(w)) for k, w in zip(K, omega, strict=True) if 0.0 < k < math.inf]


def unit_crossings(loop: LoopFamily, K: float) -> list[float]:
    """Every frequency of the grid's range at which |K h| = 1 [rad/s], found as `gain_crossings`.

    Args:
        loop: the loop for every gain.
        K: compensator gain, > 0.
    """

    def level(x: float) -> float:
        return math.log(K * abs(loop.h(np.array([math.exp(x)]))[0]))

    size = np.abs(loop.h(loop.grid))
    if not np.all(size):
        return []
    return _zeros(level, np.log(loop.grid), np.log(K * size), np.full(len(size), True))


def _zeros(
    f: Callable[[float], float], x: np.ndarray, y: np.ndarray, where: np.ndarray
) -> list[float]:
    """exp of the zeros of f between points x, with y = f(x), next to a point of the mask."""
    from scipy.optimize import brentq, minimize_scalar

    y[y == 0.0] = 1e-300  # a grid point on a crossing is found from one side
    spans = [
        (x[i], x[i + 1]) for i in np.flatnonzero((y[:-1] * y[1:] < 0.0) & (where[:-1] | where[1:]))
    ]
    dip = (np.abs(y[1:-1]) <= np.minimum(np.abs(y[:-2]), np.abs(y[2:]))) & (y[:-2] * y[1:-1] > 0.0)
    for i in np.flatnonzero(dip & (y[1:-1] * y[2:] > 0.0) & where[1:-1]) + 1:
        sign = math.copysign(1.0, y[i])
        bottom = minimize_scalar(
            lambda x, s=sign: s * f(x), bounds=(x[i - 1], x[i + 1]), method="bounded"
        )
        if bottom.fun < 0.0:  # type: ignore[union-attr]
            spans += [(x[i - 1], bottom.x), (bottom.x, x[i + 1])]  # type: ignore[union-attr]

    def zero(a: float, c: float) -> float:
        fa, fc = f(a), f(c)
        if fa * fc > 0.0:  # one is a zero up to rounding: arrays and scalars round differently
            return a if abs(fa) < abs(fc) else c
        return brentq(f, a, c, xtol=1e-15, rtol=1e-14)  # type: ignore[return-value]

    return [math.exp(zero(a, c)) for a, c in spans]


def frequency_grid(low: float, high: float, resonances: np.ndarray) -> np.ndarray:
    """Logarithmic frequency grid, refined around resonances.

    Args:
        low: lowest [rad/s].
        high: highest [rad/s].
        resonances: real or complex, used by magnitude [rad/s], shape (n,).
    """
    base = np.geomspace(low, high, 2 + int(math.log(high / low) / math.log(PHASE_STEP)))
    near = np.multiply.outer(
        np.abs(resonances), np.concatenate((1.0 - NEAR_AXIS, [1.0], 1.0 + NEAR_AXIS))
    ).ravel()
    return np.unique(np.concatenate((base, near[(near > low) & (near < high)])))


def delayed_loop(loop: LinearLoop) -> LoopFamily:
    """The continuous loop in which every action of the motors is delayed.

    Suppose Th has a mass, and C has direct feedthrough (numerator and denominator of equal order)
    or the force shapes the inertia. Then acceleration is fed back with delay and with constant gain
    at high frequency. That gain must stay below one (a neutral delay system: Hale, Verduyn Lunel,
    Introduction to Functional Differential Equations, 1993, ch. 9).

    Args:
        loop: the loop, in continuous time, its K ignored.
    """
    parts, delay = linear_loop.delayed_polynomials(loop), loop.delay
    while all(p.coef[0] == 0.0 for p in parts):  # the integrator that moves the handle
        parts = tuple(p // roots.VARIABLE for p in parts)
    physical, motors, driven = parts
    own, straight, more = (p.coef[physical.degree() :] for p in parts)
    straight, more = (float(np.sum(x) / own[0]) for x in (straight, more))
    order = roots.multiplicity_of_zero(physical + motors)
    neutral, most = bool(straight or more), math.inf
    if abs(straight) >= 1.0:
        most = 0.0
    elif more:
        most = (1.0 - math.copysign(straight, straight * more)) / abs(more)
    resonances = np.concatenate([roots.roots(p) for p in (physical, physical + motors, driven)])
    resonances = resonances[np.abs(resonances) > 0.0]
    size = np.abs(resonances)

    def h(omega: np.ndarray) -> np.ndarray:
        s = 1j * omega
        late = np.exp(-s * delay)
        return -driven(s) * late / (physical(s) + motors(s) * late)

    def right(K: float) -> float:
        """Number of poles right of the axis, for K = 0 those of h, none of which lies at 0."""
        acting, share = motors + K * driven, 0.5 * (1.0 + abs(straight + K * more))
        a, high = float(np.exp(np.mean(np.log(size)))), (100.0 if neutral else 1.0) * size.max()
        bound = Polynomial(np.abs(acting.coef))
        while bound(high) > share * abs(physical(1j * high)):
            high *= 2.0
        turns = np.linspace(0.0, high, min(100 + int(4.0 * delay * high), 100_000))

        def F(omega: np.ndarray) -> np.ndarray:
            s = 1j * omega
            return (physical(s) + acting(s) * np.exp(-s * delay)) / (s + a) ** physical.degree()

        # Each zero right of the axis turns F by -pi between 0 and infinity; beyond 1e3 high hardly
        # anything is left, and what is, turns it by less than a quarter.
        end = high if neutral else 1e3 * high
        omega = np.union1d(turns, frequency_grid(1e-3 * size.min(), end, resonances))
        at_zero = order if K == 0.0 else 0
        if at_zero:  # s^order/(s + a)^order turns F by a quarter each
            omega[0] = 1e-6 * omega[1]
        left = np.angle(F(omega[-1:])[0])
        return -(phase_change(F, omega) - left) / np.pi - 0.5 * at_zero

    def stable(K: float) -> bool:
        return K < most and bool(abs(right(K)) < 0.5)

    low, top = 1e-3 * size.min(), max(40.0 / delay, 2.0 * np.abs(resonances.imag).max())
    top = max(top, 10.0 * size.max()) if neutral else top  # where |h| is nearly constant
    turns = np.linspace(low, top, min(int(4.0 * delay * top), 100_000))
    grid = np.union1d(turns, frequency_grid(low, top, resonances))
    rest = physical.coef[0] + motors.coef[0]
    ends = (0.0,) if rest and driven.coef[0] / rest < 0.0 else ()
    return LoopFamily(h, grid, stable, ends, most, order, lambda: round(right(0.0)))


def phase_change(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> float:
    """Change of arg f along x [rad]; points are inserted until no step changes it by more than 0.5.

    Args:
        f: complex function, (n,) to (n,).
        x: ascending, shape (n,).

    Returns:
        NaN if that needs over a million points: so long a delay makes any loop unstable.
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


def sampled_loop(loop: LinearLoop) -> LoopFamily:
    """The sampled loop (`control="sampled"`) as x(k+1) = (M + K beta gamma) x(k), exact at samples.

    See `linear_loop.sampled_differences`. A loop is stable if every eigenvalue lies within the unit
    circle. The exception is one at z = 1, the free motion of the handle where C integrates and Th
    has no spring. Clay of 1e9 N.s/m, or K = 1e-12, puts other eigenvalues within rounding of z = 1.
    The map is therefore one of differences, M - 1. Its states are relative to the rest, or steady
    motion, that the present states of C's integrators would give. The integrators' columns are then
    zero except for their own chain.

    Args:
        loop: the loop, sampled, its K ignored.
    """
    less, beta, gamma, free, integrators, unseen = _acting_map(loop)
    t, Ts, n = loop.environment, loop.Ts, len(less)
    assert Ts is not None

    def h(omega: np.ndarray) -> np.ndarray:
        out = np.empty(len(omega), dtype=complex)
        for i in range(0, len(omega), 256):
            # exp(j omega Ts) - 1, without the loss of digits at slow frequencies
            z1 = np.expm1(1j * omega[i : i + 256] * Ts)
            resolvent = z1[:, None, None] * np.eye(n) - less
            out[i : i + 256] = np.linalg.solve(resolvent, beta[:, None])[:, :, 0] @ gamma
        return out

    def stable(K: float) -> bool:
        return _within_circle(less, beta, gamma, K)

    z1 = eigenvalues(free).astype(complex)
    poles = np.log1p(z1[np.abs(1.0 + z1) > 1e-6]) / Ts
    resonances = np.concatenate((poles, roots.nonzero_roots(t)))
    top = np.pi / Ts
    low = min(1e-2 * np.abs(resonances).min(), 0.1 * top)
    near = frequency_grid(low, top * (1.0 - 1e-9), resonances.imag)
    grid = np.union1d(np.linspace(low, top, 20 * n)[:-1], near)
    still = not integrators and h(np.zeros(1))[0].real > 0.0
    outside = int(np.sum(2.0 * z1.real + np.abs(z1) ** 2 > 0.0))
    ends = (0.0, top) if still else (top,)
    return LoopFamily(h, grid, stable, ends, math.inf, integrators - unseen, lambda: outside)


def _within_circle(less: np.ndarray, beta: np.ndarray, gamma: np.ndarray, K: float) -> bool:
    """Whether every eigenvalue of the sampled loop lies within the unit circle."""
    z1 = eigenvalues(less + max(K, LEAST_GAIN) * np.outer(beta, gamma))
    return bool(np.all(2.0 * z1.real + np.abs(z1) ** 2 < 0.0))  # |1 + z1| < 1


def _acting_map(
    loop: LinearLoop,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int, int]:
    """The sampled loop without the states that do not affect the force.

    Returns:
        M - 1, beta and gamma; M - 1 without C's integrators; number of these; number of omitted
        states.
    """
    loop = replace(loop, compensator=linear_loop.reduced(loop.compensator))
    less, beta, gamma = linear_loop.sampled_differences(loop)
    less, beta, gamma = _from_rest(loop, less, beta[:, 0], gamma[0])
    t, integrators = loop.environment, _integrators(loop.compensator)
    # A state that only offsets position or speed of the handle does not affect the force.
    unseen = min(integrators, roots.multiplicity_of_zero(t)) if np.any(t.coef) else integrators
    kept = np.delete(np.arange(len(less)), np.arange(2, 2 + unseen))
    free = np.delete(np.arange(len(less)), np.arange(2, 2 + integrators))
    free = less[np.ix_(free, free)]
    return less[np.ix_(kept, kept)], beta[kept], gamma[kept], free, integrators, unseen


def _integrators(compensator: Compensator) -> int:
    return roots.multiplicity_of_zero(compensator.fraction[1])


def _from_rest(
    loop: LinearLoop, less: np.ndarray, beta: np.ndarray, gamma: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The map with the other states relative to their equilibrium under C's integrators.

    The first m states of a compensator with m integrators are a chain of integrators, independent
    of the motion of the other states. Under the first alone the loop is at rest; under the second
    it moves at constant speed, and so on.
    """
    m, n = _integrators(loop.compensator), loop.compensator.order
    if not m:
        return less, beta, gamma
    s, spring, g = loop.servo.S, loop.environment.coef[0], loop.servo.G
    chain = np.arange(2, 2 + m)
    others = np.delete(np.arange(len(less)), chain)
    rest = np.zeros((len(less), m))
    rest[2 + n, 0] = loop.compensator.state_space()[2][0] * (g.gain / g.stiffness)
    rest[0, 0] = s.stiffness / (s.stiffness + s.gain * spring) * rest[2 + n, 0]
    motors = spring - (loop.k if loop.render == "held" else 0.0)  # hold what is physical
    rest[4 + n :, 0] = motors * rest[0, 0]
    own, theirs = np.triu(less[np.ix_(chain, chain)], 1), less[np.ix_(others, others)]
    for j in range(1, m):
        needed = rest[others, :j] @ own[:j, j] - less[others, chain[j]]
        rest[others, j] = np.linalg.solve(theirs, needed)
    read = gamma @ rest
    read[0] = -spring * rest[0, 0]
    less, beta = less - rest @ less[chain], beta - rest @ beta[chain]
    less[:, chain], gamma[chain] = 0.0, read
    less[np.ix_(chain, chain)] = own
    return less, beta, gamma


def eigenvalues(a: np.ndarray) -> np.ndarray:
    """Eigenvalues, small ones as accurate as large ones: the small are computed from the inverse.

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
