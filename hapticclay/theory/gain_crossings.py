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

from .. import matrices
from ..errors import number
from ..model.compensator import Compensator
from . import exact_roots, late_roots, linear_loop, roots
from .exact_roots import rational
from .linear_loop import LinearLoop

PHASE_STEP = 1.01  # the frequency grid grows by this factor ...
NEAR_AXIS = 10.0 ** np.arange(-9.0, 0.0, 0.25)  # ... and closes in on every resonance
SAME_FREQUENCY = 1e-10  # of a pole's: a crossing as near belongs to K = 0
LOWEST = -200.0  # logarithm of the least frequency of a search
MOST_TURNS = 100_000  # points that follow the turns of a delay
LEAST_GAIN = 1e-60  # no pole crosses at a lower gain, and products of such numbers underflow
SMALL_ANGLE = 1e-6  # eigenvalues below this share of the largest are computed from the inverse


def critical_gain(loop: LinearLoop) -> tuple[float, float]:
    """The gain limit and the frequency of oscillation at that gain."""
    if loop.Ts is not None or loop.delay:
        return first_instability(loop_family(loop))
    denominator, passive, driven = linear_loop.loop_polynomials(loop, rational)
    return roots.first_crossing(denominator + passive, driven)


def is_stable(loop: LinearLoop) -> bool:
    """Whether the loop is stable at its K, whether or not it is stable at lower K."""
    K = number("K", loop.gain, 0.0, above=True)
    if loop.Ts is not None:
        return _within_circle(*_acting_map(loop)[:3], K)
    if loop.delay:
        return loop_family(loop).stable(K)
    return linear_loop.stable(loop)


def loop_family(loop: LinearLoop) -> LoopFamily:
    """The sampled or delayed loop for every gain."""
    return delayed_loop(loop) if loop.Ts is None else sampled_loop(loop)


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
        right: number of poles right of the axis, or outside the unit circle, at K; at 0 those of h,
            without those on the border within rounding. None where nothing asks for it.
        poles: frequencies of poles of h on the border within rounding [rad/s].
        rounding: size of h up to which its sign is rounding, (n,) to (n,).
    """

    h: Callable[[np.ndarray], np.ndarray]
    grid: np.ndarray
    stable: Callable[[float], bool]
    ends: tuple[float, ...] = ()
    most: float = math.inf
    order: int = 0
    right: Callable[[float], int] = lambda K: 0
    poles: tuple[float, ...] = ()
    rounding: Callable[[np.ndarray], np.ndarray] = np.zeros_like


def first_instability(loop: LoopFamily) -> tuple[float, float]:
    """Smallest K > 0 at which the loop stops being stable, and its frequency."""
    found = gain_crossings(loop)
    found = sorted(found + [(loop.most, math.inf)] if loop.most < math.inf else found)
    if not loop.stable(0.5 * found[0][0] if found else 1.0):
        return 0.0, math.nan
    for i, (K, omega) in enumerate(found):
        following = min(found[i + 1][0] if i + 1 < len(found) else math.inf, 4.0 * K)
        if following > (1.0 + 1e-9) * K and not loop.stable(math.sqrt(K * following)):
            return K, omega
    return math.inf, math.nan


def gain_crossings(loop: LoopFamily) -> list[tuple[float, float]]:
    """Every (K, omega) with 1 = K h(omega), K > 0.

    Two crossings closer than the grid appear as a dip of Im h without a change of sign, so the
    search also minimises every dip. Poles and zeros of h on the border of stability are no
    crossings: the loop has them at K = 0 and at infinity.
    """

    def phase_sine(x: np.ndarray) -> np.ndarray:
        z = loop.h(np.exp(x))
        size = np.abs(z)
        return np.divide(z.imag, size, out=np.zeros(len(x)), where=(size > 0.0) & (size < np.inf))

    z = loop.h(loop.grid)
    if not np.any(z):  # the compensator has no input
        return []
    grid, z = loop.grid[z != 0.0], z[z != 0.0]
    beyond = np.append(loop.poles, math.inf)  # at a pole h changes its sign without a zero
    piece = np.searchsorted(beyond, grid)
    found: list[float] = []
    for i in range(len(beyond)):
        x, y = np.log(grid[piece == i]), z[piece == i]
        found += _zeros(phase_sine, x, y.imag / np.abs(y), y.real > 0.0)
    omega = np.array([*found, *loop.ends], dtype=float)
    size = loop.h(omega).real
    kept = size > loop.rounding(omega)
    for pole in loop.poles:
        kept &= np.abs(omega - pole) > SAME_FREQUENCY * pole
    return list(zip((1.0 / size[kept]).tolist(), omega[kept].tolist(), strict=True))


def unit_crossings(loop: LoopFamily, K: float) -> list[float]:
    """Every frequency up to the end of the grid at which |K h| = 1 [rad/s].

    Below the grid |h| is a power of the frequency: the search goes on to where it is past 1.
    """

    def level(x: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore"):  # a zero or a pole on the border
            return np.log(K * np.abs(loop.h(np.exp(x))))

    x = np.log(loop.grid)
    y = level(x)
    if not np.any(np.isfinite(y)):
        return []
    x, y = x[np.isfinite(y)], y[np.isfinite(y)]
    more = [x[0]]
    while more[-1] > LOWEST and y[0] * (slope := _slope(level, more[-1])) > 0.0:
        more.append(more[-1] - max(1.0, 1.1 * y[0] / slope))
        ahead = level(np.array(more[-1:]))[0]
        if not math.isfinite(ahead) or ahead * y[0] <= 0.0:
            break
    below = np.array(more[:0:-1])
    x, y = np.concatenate((below, x)), np.concatenate((level(below), y))
    return _zeros(level, x, y, np.full(len(x), True))


def _slope(f: Callable[[np.ndarray], np.ndarray], x: float) -> float:
    """The slope of a power law f, an integer."""
    low, high = f(np.array([x - 1.0, x]))
    return float(round(high - low)) if math.isfinite(low) else 0.0


def _zeros(
    f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, y: np.ndarray, where: np.ndarray
) -> list[float]:
    """exp of the zeros of f between points x, with y = f(x), next to a point of the mask."""
    from scipy.optimize.elementwise import find_minimum

    y = np.where(y == 0.0, 1e-300, y)  # a grid point on a crossing is found from one side
    i = np.flatnonzero((y[:-1] * y[1:] < 0.0) & (where[:-1] | where[1:]))
    low, high = [x[i]], [x[i + 1]]
    dip = (np.abs(y[1:-1]) <= np.minimum(np.abs(y[:-2]), np.abs(y[2:]))) & (y[:-2] * y[1:-1] > 0.0)
    i = np.flatnonzero(dip & (y[1:-1] * y[2:] > 0.0) & where[1:-1]) + 1
    if len(i):
        sign = np.sign(y[i])
        around = x[i - 1], x[i], x[i + 1]
        with np.errstate(invalid="ignore"):  # a flat dip
            found = find_minimum(lambda x, sign: sign * f(x), around, args=(sign,))
        bottom = np.where(found.success, found.x, x[i])
        through = sign * f(bottom) < 0.0
        i, bottom = i[through], bottom[through]
        low, high = [*low, x[i - 1], bottom], [*high, bottom, x[i + 1]]
    return np.exp(_bracketed(f, np.concatenate(low), np.concatenate(high))).tolist()


def _bracketed(
    f: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """The zeros of f between low and high.

    Where f has one sign at both ends, up to rounding, the zero is the end nearer to it.
    """
    from scipy.optimize.elementwise import find_root

    if not len(low):
        return low
    found = find_root(f, (low, high))
    nearer = np.where(np.abs(found.f_bracket[0]) < np.abs(found.f_bracket[1]), low, high)
    return np.where(found.success, found.x, nearer)


def frequency_grid(low: float, high: float, resonances: np.ndarray) -> np.ndarray:
    """Logarithmic frequency grid, refined around resonances."""
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
    """
    delay, parts = loop.delay, linear_loop.delayed_polynomials(loop, rational)
    while all(p.coef[0] == 0.0 for p in parts):  # the integrator that moves the handle
        parts = tuple(rational(p.coef[1:]) for p in parts)
    exact, (physical, motors, driven) = parts, map(exact_roots.approximate, parts)
    own, straight, more = (p.coef[physical.degree() :] for p in (physical, motors, driven))
    straight, more = (float(np.sum(x) / own[0]) for x in (straight, more))
    most = math.inf
    if abs(straight) >= 1.0:
        most = 0.0
    elif more:
        most = (1.0 - math.copysign(straight, straight * more)) / abs(more)
    resonances = np.concatenate(
        [exact_roots.approximate_roots(p) for p in (exact[0], exact[0] + exact[1], exact[2])]
    )

    def h(omega: np.ndarray) -> np.ndarray:
        s = 1j * omega
        late = np.exp(-s * delay)
        with np.errstate(divide="ignore", invalid="ignore"):  # on a pole
            return -driven(s) * late / (physical(s) + motors(s) * late)

    def rounding(omega: np.ndarray) -> np.ndarray:
        s = 1j * omega
        bound = exact_roots.ROUNDING * Polynomial(np.abs(driven.coef))(omega)
        return bound / np.abs(physical(s) + motors(s) * np.exp(-s * delay))

    def right(K: float) -> int:
        if K:
            now, later = exact[0], exact[1] + rational([K]) * exact[2]
            return late_roots.roots_right(now, later, delay)
        alone = late_roots.roots_right(*linear_loop.delayed_servo(loop, rational), delay)
        return alone + exact_roots.count_right(loop.compensator.fraction[1])

    def stable(K: float) -> bool:
        return K < most and right(K) == 0

    poles = compensator_poles(loop)
    grid = _late_grid(resonances, delay, bool(straight or more))
    grid = _around(grid, poles)
    rest = physical.coef[0] + motors.coef[0]
    ends = (0.0,) if rest and driven.coef[0] / rest < 0.0 else ()
    order = roots.multiplicity_of_zero(exact[0] + exact[1])
    return LoopFamily(h, grid, stable, ends, most, order, right, poles, rounding)


def compensator_poles(loop: LinearLoop) -> tuple[float, ...]:
    """Frequencies of the poles of C on the imaginary axis within rounding [rad/s]."""
    found = exact_roots.axis_roots(loop.compensator.fraction[1])
    return tuple(exact_roots.square_root(x) for x, _ in found)


def _around(grid: np.ndarray, poles: tuple[float, ...]) -> np.ndarray:
    """The grid without its points on poles of h, and with points beside them."""
    for pole in poles:
        grid = grid[np.abs(grid - pole) > SAME_FREQUENCY * pole]
        beside = pole * np.array([1.0 - 2.0 * SAME_FREQUENCY, 1.0 + 2.0 * SAME_FREQUENCY])
        grid = np.union1d(grid, beside[(beside > grid[0]) & (beside < grid[-1])])
    return grid


def _late_grid(resonances: np.ndarray, delay: float, neutral: bool) -> np.ndarray:
    """Frequencies that follow a late h; neutral: up to where |h| is nearly constant."""
    size = np.abs(resonances)
    low, top = 1e-3 * size.min(), max(40.0 / delay, 2.0 * np.abs(resonances.imag).max())
    top = max(top, 10.0 * size.max()) if neutral else top
    turns = np.linspace(low, top, min(int(4.0 * delay * top), MOST_TURNS))
    return np.union1d(turns, frequency_grid(low, top, resonances))


def sampled_loop(loop: LinearLoop) -> LoopFamily:
    """The sampled loop (`control="sampled"`) as x(k+1) = (M + K beta gamma) x(k), exact at samples.

    See `linear_loop.sampled_differences`. A loop is stable if every eigenvalue lies within the unit
    circle. The exception is one at z = 1, the free motion of the handle where C integrates and Th
    has no spring. Clay of 1e9 N.s/m, or K = 1e-12, puts other eigenvalues within rounding of z = 1.
    The map is therefore one of differences, M - 1. Its states are relative to the rest, or steady
    motion, that the present states of C's integrators would give. The integrators' columns are then
    zero except for their own chain.
    """
    less, beta, gamma, free, integrators, unseen = _acting_map(loop)
    t, Ts, n = loop.environment, loop.Ts, len(less)
    assert Ts is not None
    waiting = linear_loop.whole_samples(loop.delay, Ts)[0]

    def states(omega: np.ndarray) -> np.ndarray:
        # exp(j omega Ts) - 1, without the loss of digits at slow frequencies
        parts = np.split(np.expm1(1j * omega * Ts), range(256, len(omega), 256))
        return np.concatenate([_driven(less, beta, waiting, z1) for z1 in parts])

    def h(omega: np.ndarray) -> np.ndarray:
        return states(omega) @ gamma

    def rounding(omega: np.ndarray) -> np.ndarray:
        return exact_roots.ROUNDING * (np.abs(states(omega)) @ np.abs(gamma))

    def stable(K: float) -> bool:
        return _within_circle(less, beta, gamma, K)

    def right(K: float) -> int:
        if K:
            return _outside(less + max(K, LEAST_GAIN) * np.outer(beta, gamma))
        return _outside(_without_compensator(loop)) + exact_roots.count_right(
            loop.compensator.fraction[1]
        )

    z1 = eigenvalues(free).astype(complex)
    resonances = np.log1p(z1[np.abs(1.0 + z1) > 1e-6]) / Ts
    physical, motors = linear_loop.delayed_servo(loop, rational)
    resonances = np.concatenate(
        (resonances, exact_roots.approximate_roots(physical + motors), roots.nonzero_roots(t))
    )
    resonances = resonances[resonances != 0.0]
    top = np.pi / Ts
    low = min(1e-2 * np.abs(resonances).min(), 0.1 * top)
    near = frequency_grid(low, top * (1.0 - 1e-9), resonances.imag)
    poles = compensator_poles(loop)
    grid = _around(np.union1d(np.linspace(low, top, 20 * n)[:-1], near), poles)
    still = integrators == unseen and h(np.zeros(1))[0].real > 0.0
    ends = (0.0, top) if still else (top,)
    order = integrators - unseen
    return LoopFamily(h, grid, stable, ends, math.inf, order, right, poles, rounding)


def _driven(less: np.ndarray, beta: np.ndarray, waiting: int, z1: np.ndarray) -> np.ndarray:
    """The states (z1 - less)^-1 beta, shape (m, n), at z1 = z - 1, shape (m,).

    Each of the last states, which are forces that wait, follows from those before: what is left to
    solve has the order of the loop without them.
    """
    m, n, a = len(z1), len(less), len(less) - waiting
    share = np.zeros((m, n, a + 1), dtype=complex)  # of the first a states, and a constant
    share[:, np.arange(a), np.arange(a)] = 1.0
    for j in range(a, n):
        share[:, j] = less[j, j - 1] * share[:, j - 1]
        if j > a:
            share[:, j, :a] += less[j, :a]
        else:
            share[:, j, : a - 1] += less[j, : a - 1]
        share[:, j, a] += beta[j]
        share[:, j] /= (z1 - less[j, j])[:, None]
    into = less[:a] @ share
    left = z1[:, None, None] * np.eye(a) - into[:, :, :a]
    right = (into[:, :, a] + beta[:a])[:, :, None]
    try:
        first = np.linalg.solve(left, right)
    except np.linalg.LinAlgError:  # on a pole: beside it, by less than its rounding
        beside = np.abs(z1)[:, None, None] * 2.0**-50 * np.eye(a)
        first = np.linalg.solve(left + beside, right)
    return (share[:, :, :a] @ first)[:, :, 0] + share[:, :, a]


def _outside(less: np.ndarray) -> int:
    """Number of eigenvalues of 1 + less outside the unit circle."""
    z1 = eigenvalues(less)
    return int(np.sum(2.0 * z1.real + np.abs(z1) ** 2 > 0.0))


def _without_compensator(loop: LinearLoop) -> np.ndarray:
    """The sampled loop without C and G, as a difference: handle and motors."""
    less = linear_loop.sampled_differences(loop)[0]
    kept = np.delete(np.arange(len(less)), np.arange(2, 4 + loop.compensator.order))
    return less[np.ix_(kept, kept)]


def _within_circle(less: np.ndarray, beta: np.ndarray, gamma: np.ndarray, K: float) -> bool:
    """Whether every eigenvalue of the sampled loop lies within the unit circle."""
    z1 = eigenvalues(less + max(K, LEAST_GAIN) * np.outer(beta, gamma))
    return bool(np.all(2.0 * z1.real + np.abs(z1) ** 2 < 0.0))  # |1 + z1| < 1


def _acting_map(
    loop: LinearLoop,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int, int]:
    """The sampled loop without the states that do not affect the force."""
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

    Of a matrix that is singular in floats the smallest are 0, within its rounding.
    """
    z = matrices.eigenvalues(a)
    z = z[np.argsort(np.abs(z))]
    small = int(np.sum(np.abs(z) < SMALL_ANGLE * np.abs(z[-1])))
    if small:
        try:
            large = matrices.eigenvalues(np.linalg.inv(a))
        except np.linalg.LinAlgError:
            return z
        z = z.astype(np.result_type(z, large))  # a pair that floats took for two real ones
        z[:small] = 1.0 / large[np.argsort(-np.abs(large))][:small]
    return z
