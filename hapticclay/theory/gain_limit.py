"""The largest stable gain: in continuous time, with the motors late, and in the sampled loop.

However the loop is built, K multiplies one signal in it, so a pole lies at s on the border of stability where

    1 = K h(s),        s = j omega, or z = exp(j omega Ts) in the sampled loop.

The gains at which anything can cross are therefore 1/h at the frequencies where h is real and positive. Between two
of them no pole crosses, so one look in each interval tells where the loop is stable.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError, choice, flag, number
from ..model import controller
from ..model.constants import AXES, B_MAX, C_POLE, G, S
from ..model.operator import NO_HAND, Operator
from ..model.scenario import RENDERS
from . import linear_loop

PHASE_STEP = 1.01  # the frequency grid grows by this factor ...
LEAST_GAIN = 1e-60  # nothing crosses at a lower gain, and products of such numbers vanish
SMALL_ANGLE = 1e-6  # an eigenvalue below this share of the largest is better known from the inverse
NEAR_AXIS = 10.0 ** np.arange(-9.0, 0.0, 0.25)  # ... and closes in on every resonance


def hand(impedance: bool = True, operator: Operator | None = None) -> Operator | None:
    """The arm at the handle: operator if given, else the nominal Th (Eq. 19), or None (Th = 0) without impedance.

    Raises:
        ParameterError: operator together with impedance=False, or of another type.
    """
    if operator is None:
        return Operator() if flag("impedance", impedance) else None
    if not isinstance(operator, Operator):
        raise ParameterError("operator", operator, "must be an Operator or None")
    if not flag("impedance", impedance):
        raise ParameterError("operator", operator, "must be None where impedance is False")
    return operator


def gain_limit(
    axis: str,
    b: float,
    *,
    impedance: bool = True,
    operator: Operator | None = None,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
) -> float:
    """Largest compensator gain K up to which the loop of one axis is stable at the nominal pose.

    Every gain between 0 and the limit is stable. In continuous time without delay that is the first crossing of the
    closed-loop polynomial (Eq. 8); otherwise see `sampled_loop` (sampled) and `delayed_loop` (continuous, the motors late).

    Args:
        axis: "x" or "y". b: clay [N.s/m].
        impedance: True puts the operator's arm at the handle, False leaves the handle to itself (Th = 0).
        operator: the arm, if it is not the nominal one (Eq. 19).
        Ts: control sample [s]; None for continuous time.
        delay: from a measurement to the torque computed from it [s]. Everything the motors do comes late by it: the
            servo's feedback, what the compensator commands, and the clay where it is held.
        render: the clay is "held" (a force of the motors) or "implicit" (physical, never late).

    Returns:
        K; inf if there is no limit, 0 if the loop is unstable at any gain.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    return critical_gain(axis, b, hand(impedance, operator), Ts, delay, render)[0]


def critical_gain(
    axis: str,
    b: float,
    operator: Operator | None,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
) -> tuple[float, float]:
    """The gain limit and the frequency at which the loop then rings [rad/s]; arguments as `gain_limit`."""
    loop = loop_family(axis, b, operator, Ts, delay, render)
    if loop:
        return first_instability(loop)
    blank, passive, driven = linear_loop.loop_polynomials(axis, b, operator)
    return linear_loop.first_crossing(np.polyadd(blank, passive), driven)


def is_stable(
    axis: str,
    K: float,
    b: float,
    operator: Operator | None,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
) -> bool:
    """Whether the loop is stable at this very K, whatever it is below; other arguments as `gain_limit`."""
    K, loop = number("K", K, 0.0, above=True), loop_family(axis, b, operator, Ts, delay, render)
    return loop.stable(K) if loop else linear_loop.stable(axis, K, b, operator)


def loop_family(
    axis: str, b: float, operator: Operator | None, Ts: float | None, delay: float, render: str
) -> LoopFamily | None:
    """The loop for every K; None for the one that is a polynomial. Arguments as `gain_limit`.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    choice("axis", axis, AXES)
    b = number("b", b, 0.0, B_MAX, unit="N.s/m")
    delay = number("delay", delay, 0.0, 1.0, unit="s")
    choice("render", render, RENDERS)
    if Ts is not None:
        Ts = number("Ts", Ts, 1e-6, 1.0, unit="s")
        number("delay", delay, 0.0, 100.0 * Ts, unit="s")
        return sampled_loop(axis, b, operator, Ts, delay, render)
    return delayed_loop(axis, b, operator, delay, render) if delay else None


@dataclass(frozen=True)
class LoopFamily:
    """A loop for every gain.

    Attributes:
        h: 1 = K h(omega) where a pole lies on the border of stability; omega [rad/s], shape (n,), to (n,) complex.
        grid: frequencies that follow every bend of h [rad/s], ascending.
        stable: whether the loop is stable at K.
        last: where h is real of itself, at the end of the frequencies [rad/s]; None if nowhere.
    """

    h: Callable[[np.ndarray], np.ndarray]
    grid: np.ndarray
    stable: Callable[[float], bool]
    last: float | None = None


def first_instability(loop: LoopFamily) -> tuple[float, float]:
    """Smallest K > 0 at which the loop stops being stable, and where [rad/s]; (inf, nan) if it never does."""
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

    A pair of them closer than the grid shows as a dip of Im h that keeps its sign; every dip is followed to its bottom.
    """
    from scipy.optimize import brentq, minimize_scalar

    def lean(x: float) -> float:
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
            lambda x, s=sign: s * lean(x), bounds=(x[i - 1], x[i + 1]), method="bounded"
        )
        if bottom.fun < 0.0:  # type: ignore[union-attr]
            spans += [(x[i - 1], bottom.x), (bottom.x, x[i + 1])]  # type: ignore[union-attr]
    omega = [math.exp(brentq(lean, a, c, xtol=1e-15, rtol=1e-14)) for a, c in spans]  # type: ignore[arg-type]
    omega += [] if loop.last is None else [loop.last]
    with np.errstate(divide="ignore"):
        K = 1.0 / loop.h(np.array(omega)).real if omega else np.empty(0)
    return [(float(k), float(w)) for k, w in zip(K, omega, strict=True) if 0.0 < k < math.inf]


def frequency_grid(low: float, high: float, resonances: np.ndarray) -> np.ndarray:
    """Frequencies from low to high [rad/s], dense in ratio, and denser around |resonances|."""
    base = np.geomspace(low, high, 2 + int(math.log(high / low) / math.log(PHASE_STEP)))
    near = np.multiply.outer(
        np.abs(resonances), np.concatenate((1.0 - NEAR_AXIS, [1.0], 1.0 + NEAR_AXIS))
    ).ravel()
    return np.unique(np.concatenate((base, near[(near > low) & (near < high)])))


def delayed_loop(
    axis: str, b: float, operator: Operator | None, delay: float, render: str = "held"
) -> LoopFamily:
    """The continuous loop in which all that the motors do comes late by `delay` [s].

    With W = 1/mass of the handle (the gain of Sh), T = Te + Th, and the clay among the motors (held) or not (implicit),

        0 = s^2 + W (Th + [implicit] b s) + exp(-s delay) (kd s + kp + [held] W b s + (s^2 + kd s + kp) G C T)
    """
    physical = choice("render", render, RENDERS) == "implicit"
    i = AXES.index(choice("axis", axis, AXES))
    W, th = S[i].gain, operator or NO_HAND
    cg = np.convolve([1.0, C_POLE, 0.0], [1.0, G[i].damping, G[i].stiffness])
    now = np.convolve(cg, [1.0 + W * th.mass, W * (th.damper + physical * b), W * th.spring])
    then = np.convolve(cg, [S[i].damping + W * (not physical) * b, S[i].stiffness])
    driven = linear_loop.loop_polynomials(axis, b, operator)[2]
    if not th.spring:  # the integrator that moves the handle
        now, driven = now[:-1], driven[:-1]
        then = then[:-1]
    if not np.any(driven):
        driven = np.zeros(1)
    roots = np.concatenate([np.roots(p) for p in (now, np.polyadd(now, then), driven) if np.any(p)])
    roots = roots[np.abs(roots) > 0.0]
    size = np.abs(roots)

    def h(omega: np.ndarray) -> np.ndarray:
        s = 1j * omega
        turn = np.exp(-s * delay)
        return -np.polyval(driven, s) * turn / (np.polyval(now, s) + np.polyval(then, s) * turn)

    def stable(K: float) -> bool:
        rest = np.polyadd(then, K * driven)
        a, n, high = float(np.exp(np.mean(np.log(size)))), len(now) - 1, float(size.max())
        while np.polyval(np.abs(rest), high) > 0.5 * abs(np.polyval(now, 1j * high)):
            high *= 2.0
        turns = np.linspace(0.0, high, min(100 + int(4.0 * delay * high), 100_000))

        def F(omega: np.ndarray) -> np.ndarray:
            s = 1j * omega
            return (np.polyval(now, s) + np.polyval(rest, s) * np.exp(-s * delay)) / (s + a) ** n

        # each zero right of the axis turns F by -pi between 0 and infinity; beyond 1e3 high hardly anything is left
        turned = phase_change(
            F, np.union1d(turns, frequency_grid(1e-3 * size.min(), 1e3 * high, roots))
        )
        return abs(turned) < 0.5 * np.pi

    low, top = 1e-3 * size.min(), max(40.0 / delay, 2.0 * np.abs(roots.imag).max())
    turns = np.linspace(low, top, min(int(4.0 * delay * top), 100_000))
    return LoopFamily(h, np.union1d(turns, frequency_grid(low, top, roots)), stable)


def phase_change(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> float:
    """How far arg f turns along x [rad]; points are put in between until no step turns by more than 0.5 rad.

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
    """The sampled loop (`control="sampled"`) as x(k+1) = (M + K beta gamma') x(k), exact at the samples.

    See `sampled_matrices`. A loop is stable if every eigenvalue lies within the unit circle, but for the one at z = 1 that
    moves the handle where Th has no spring. Clay of 1e9 N.s/m, or K = 1e-12, put others within rounding of z = 1, so
    the map is of differences, M - 1, and counted from where handle and motors would rest under this delta: the column
    of delta is then exactly zero, and gamma's share of it that of the hand's spring.
    """
    less, beta, gamma = sampled_differences(axis, b, operator, Ts, delay, render)
    i, spring = AXES.index(axis), (operator or NO_HAND).spring
    rest = np.zeros(len(less))
    rest[0] = S[i].stiffness / (S[i].stiffness + S[i].gain * spring)
    rest[4], rest[6:] = 1.0, spring * rest[0]
    less, beta = less - np.outer(rest, less[2]), beta - rest * beta[2]
    less[:, 2], gamma[2] = 0.0, -spring * rest[0]
    free = np.delete(np.delete(less, 2, 0), 2, 1)  # without the integrator
    if not spring:
        less, beta, gamma = free, np.delete(beta, 2), np.delete(gamma, 2)
    n = len(less)

    def h(omega: np.ndarray) -> np.ndarray:
        out = np.empty(len(omega), dtype=complex)
        for i in range(
            0, len(omega), 256
        ):  # exp(j omega Ts) - 1, without the loss of digits at slow frequencies
            z1 = np.expm1(1j * omega[i : i + 256] * Ts)
            out[i : i + 256] = (
                np.linalg.solve(z1[:, None, None] * np.eye(n) - less, beta[:, None])[:, :, 0]
                @ gamma
            )
        return out

    def stable(K: float) -> bool:
        z1 = eigenvalues(less + max(K, LEAST_GAIN) * np.outer(beta, gamma))
        return bool(np.all(2.0 * z1.real + np.abs(z1) ** 2 < 0.0))  # |1 + z1| < 1

    z1 = eigenvalues(free)
    poles = np.log1p(z1[np.abs(1.0 + z1) > 1e-6]) / Ts
    zeros = np.roots(np.trim_zeros(linear_loop.environment_polynomial(b, operator)))
    resonances = np.concatenate((poles, zeros))
    top = np.pi / Ts
    low = min(1e-2 * np.abs(resonances).min(), 0.1 * top)
    turns = np.linspace(low, top, 20 * n)[:-1]
    return LoopFamily(
        h, np.union1d(turns, frequency_grid(low, top * (1.0 - 1e-9), resonances.imag)), stable, top
    )


def eigenvalues(a: np.ndarray) -> np.ndarray:
    """Eigenvalues of a, shape (n, n), the small ones as exact as the large: from its inverse, where they are large."""
    z = np.linalg.eigvals(a)
    z = z[np.argsort(np.abs(z))]
    small = int(np.sum(np.abs(z) < SMALL_ANGLE * np.abs(z[-1])))
    if small:
        large = np.linalg.eigvals(np.linalg.inv(a))
        z[:small] = 1.0 / large[np.argsort(-np.abs(large))][:small]
    return z


def sampled_matrices(
    axis: str,
    b: float,
    operator: Operator | None,
    Ts: float,
    delay: float = 0.0,
    render: str = "held",
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, beta, gamma of the sampled loop x(k+1) = (M + K beta gamma') x(k), x at the sample before it acts.

    x = (p, v, delta, delta', y, y', u(k-1), ..., u(k-1-n)), u the motors' force on the handle [N], n the whole
    samples in the delay. Between samples handle and hand move under held u (matrix exponential); a fraction of a
    sample in the delay splits the hold in two (Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed., 3.2). As in
    `Sampled`, the net force f = gamma' x that drives the compensator is measured before u changes, so it holds the
    share of the hand's mass under the u that acted until then.

    Args:
        axis: "x" or "y". b: clay [N.s/m]. operator: Th; None for Th = 0. Ts: sample [s].
        delay: from the sample to its u [s]. render: the clay is "held" by the motors or "implicit".

    Returns:
        M, shape (m, m), beta and gamma, shape (m,); m = 7 + n.
    """
    less, beta, gamma = sampled_differences(axis, b, operator, Ts, delay, render)
    return less + np.eye(len(less)), beta, gamma


def sampled_differences(
    axis: str,
    b: float,
    operator: Operator | None,
    Ts: float,
    delay: float = 0.0,
    render: str = "held",
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M - 1, beta, gamma of `sampled_matrices`, M - 1 without the loss of digits of the difference."""
    i = AXES.index(choice("axis", axis, AXES))
    physical = choice("render", render, RENDERS) == "implicit"
    th, g, s = operator or NO_HAND, G[i], S[i]
    n = math.floor(delay / Ts + 1e-9)
    part = max(delay / Ts - n, 0.0) if delay / Ts - n > 1e-9 else 0.0
    m = 7 + n
    w = 1.0 / (1.0 / s.gain + th.mass)
    own = np.array(
        [-w * th.spring, -w * (th.damper + physical * b)]
    )  # of the handle's acceleration
    (rest, new), (head, old) = (
        _moved(own, w, x * Ts) for x in (1.0 - part, part)
    )  # under u(k-n), after u(k-n-1)

    u = np.zeros(m)  # u(k) from x(k)
    u[:6] = [
        -s.stiffness,
        -s.damping,
        g.stiffness,
        0.0,
        s.stiffness - g.stiffness,
        s.damping - g.damping,
    ]
    u /= s.gain
    u[1] -= (not physical) * b
    gamma = np.zeros(m)
    gamma[0], gamma[1] = -th.spring, -th.damper - b
    gamma[:2] -= th.mass * own
    gamma[-1] -= th.mass * w

    A, B = controller.held_compensator(axis, 1.0, Ts)
    less = np.zeros((m, m))
    less[:2, :2] = rest + head + rest @ head
    less[:2, -1] = old + rest @ old
    if n:
        less[:2, 5 + n] += new
    else:
        less[:2] += np.outer(new, u)
    less[2:6, 2:6] = A - np.eye(4)
    less[6] = u
    less[np.arange(7, m), np.arange(6, m - 1)] = 1.0
    less[np.arange(6, m), np.arange(6, m)] -= 1.0
    beta = np.zeros(m)
    beta[2:6] = B
    return less, beta, gamma


def _moved(own: np.ndarray, w: float, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Change of (p, v) over t [s] under p'' = own (p, v) + w u: for p and v before, (2, 2), and for a held u, (2,).

    The response to a pulse, and its integral, are divided differences of exp(s t) at the roots 0, slow and fast,
    written so that nothing cancels however stiff the clay.
    """
    fast = 0.5 * (own[1] - cmath.sqrt(own[1] * own[1] + 4.0 * own[0]))
    slow = -own[0] / fast if fast else 0.0

    def mean(x: complex) -> complex:  # of exp(x u) over u from 0 to 1
        return np.expm1(x) / x if x else 1.0

    pulse = cmath.exp(slow * t) * mean((fast - slow) * t) * t
    if abs(fast) * t > 1.0:
        sums = (pulse - mean(slow * t) * t) / fast
    else:
        sums = controller.matrix_exponential(
            t * np.array([[0.0, 1.0, 0.0], [0.0, slow, 1.0], [0.0, 0.0, fast]])
        )[0, 2]
    pulse, sums = pulse.real, sums.real
    change = [[own[0] * sums, pulse], [own[0] * pulse, own[1] * pulse + own[0] * sums]]
    return np.array(change), w * np.array([sums, pulse])
