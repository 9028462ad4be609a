"""Virtual walls on a bare device: the exact linear loop and published limits.

The device (mass, damper) and the hand are linear between samples, so the sampled loop is exactly a
matrix. It has no friction, encoder or wall surface: for a wall with a surface the results hold
while the wall is pressed. `docs/equations.md`, section 7, has the derivations.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from numpy.polynomial import Polynomial

from .. import matrices
from ..arguments import checked
from ..errors import Bound, ParameterError, array_of, number
from ..model.operator import Operator
from ..scene.virtual_wall import Device, VirtualWall
from . import gain_crossings, linear_loop, roots
from .hand_boxes import Box, lattice

MOST_STATES = 600  # largest order of a map whose eigenvalues are computed
SLOWEST_TURN = 1e-7  # [rad] least omega Ts at which the passivity condition is evaluated
ANGLES = 4000  # values of omega Ts in this grid, used twice
TOP_OMEGA = 1e7  # [rad/s]
HUGE = 1e30  # [N/m] replaces infinity, which a search cannot subtract
REFINED = 3  # rounds of the search within a box of hands


# ---- the sampled loop ----------------------------------------------------------------------------


@checked
def stable_wall(wall: VirtualWall) -> bool:
    """Whether the linear loop of wall, device and hand is stable.

    Every eigenvalue of the sampled loop lies within the unit circle. Without springs (K = 0, none
    in the hand) the eigenvalue at z = 1, free motion of the handle, does not count.

    The verdict ignores friction, encoder and surface. With these a wall may never come to rest
    though its linear loop is stable: `settles` judges it by a run.

    Args:
        wall: the wall with its K; friction, quantum and surface are ignored.

    Raises:
        ParameterError: window and delay together exceed 600 samples.
    """
    less = wall_differences(wall)
    if not np.any(less[:, 0]):  # nothing depends on the place
        less = less[1:, 1:]
    return _within(less)


@checked
def stiffness_band(wall: VirtualWall) -> tuple[float, float]:
    """Band of stiffness K in which the linear wall is stable at its own B and M [N/m].

    K multiplies one signal of the loop, so a pole crosses the unit circle at K = 1/h(omega) where h
    is real and positive (see `gain_limit`): exact to rounding. Eigenvalues decide which of the
    intervals between two such K are stable. Large delays give several stable intervals; the lowest
    is returned.

    Args:
        wall: all but K, which is ignored.

    Returns:
        (low, high), low mostly 0; high is 0 if no K is stable, inf if there is no limit.

    Raises:
        ParameterError: window and delay together exceed 600 samples.
    """
    family, typical = _every_stiffness(wall), (wall.device.mass + wall.hand.mass) / wall.Ts**2
    edges = [0.0, *sorted(K for K, _ in gain_crossings.gain_crossings(family)), math.inf]
    low = None
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        if b <= (1.0 + 1e-9) * a:
            continue
        inside = 0.5 * min(b, typical) if not a else math.sqrt(a * b)
        if b == math.inf and a:
            inside = 4.0 * max(a, typical)
        if family.stable(inside):
            low = a if low is None else low
        elif low is not None:
            return low, a
    return (0.0, 0.0) if low is None else (low, math.inf)


def wall_differences(wall: VirtualWall) -> np.ndarray:
    """The sampled loop x(k+1) = (1 + D) x(k) of wall, device and hand, x at the sample.

    x holds position and velocity, then, if the wall needs them: the displacements between the last
    `window` samples, the filtered velocity and the measured velocity of the previous sample, and
    the delayed forces, newest first. A fraction of a sample in the delay splits the hold in two.
    """
    change, soon, late, whole = linear_loop.split_motion(*_moving(wall))
    part = _split_delay(wall)[1]
    Ts, moves = wall.Ts, wall.B != 0.0 or wall.M != 0.0
    differs = moves and wall.velocity == "difference"
    window = wall.velocity_window if differs else 0
    filtered = int(differs and wall.velocity_filter is not None)
    queue = whole + (part > 0.0)
    at = np.cumsum([2, window, filtered, int(wall.M != 0.0), queue])
    n = int(at[-1])
    if n > MOST_STATES:
        raise ParameterError(
            "wall.velocity_window", wall.velocity_window, f"must lie below {MOST_STATES - whole}"
        )
    steps, smooth, last, first = (int(x) for x in at[:-1])  # where each kind of state begins
    unit = np.eye(n)
    speed = unit[1]
    if differs:
        speed = unit[steps:smooth].sum(axis=0) / (window * Ts)
    if filtered:
        keep = _kept(wall)
        speed = keep * unit[smooth] + (1.0 - keep) * speed
    force = wall.K * unit[0] + wall.B * speed
    if wall.M:
        force = force + wall.M / Ts * (speed - unit[last])
    forces = [-force, *unit[first:]]  # on the handle: of this sample, of the one before, ...
    less = np.zeros((n, n))
    less[:2, :2] = change
    less[:2] += np.outer(soon, forces[whole])
    if part:
        less[:2] += np.outer(late, forces[whole + 1])
    if window:
        less[steps] = less[0]
        less[range(steps + 1, smooth), range(steps, smooth - 1)] = 1.0
    if filtered:
        less[smooth] = speed
    if wall.M:
        less[last] = speed
    for j in range(queue):
        less[first + j] = forces[j]
    less[range(2, n), range(2, n)] -= 1.0
    return less


def _kept(wall: VirtualWall) -> float:
    """Decay factor of the velocity filter over a sample."""
    f = wall.velocity_filter
    return 0.0 if f is None else math.exp(-2.0 * math.pi * f * wall.Ts)


def _split_delay(wall: VirtualWall) -> tuple[int, float]:
    """Whole samples of the delay, and the rest as a share of a sample."""
    return linear_loop.whole_samples(wall.delay, wall.Ts)


def _within(less: np.ndarray) -> bool:
    """Whether every eigenvalue of 1 + less lies within the unit circle."""
    if not np.all(np.any(less, axis=0)):  # a state without effect: an eigenvalue at z = 1
        return False
    z1 = gain_crossings.eigenvalues(less)
    return bool(np.all(2.0 * z1.real + np.abs(z1) ** 2 < 0.0))


def _moving(wall: VirtualWall) -> tuple[float, float, float, float, float]:
    """Mass, damper and spring of device and hand, sample and delay."""
    d, hand = wall.device, wall.hand
    return d.mass + hand.mass, d.damper + hand.damper, hand.spring, wall.Ts, wall.delay


def _held(wall: VirtualWall, turn: np.ndarray) -> linear_loop.HeldArm:
    """Device and hand under the delayed, held wall force; turn is omega Ts."""
    return linear_loop.held_arm(*_moving(wall), turn / wall.Ts)


def wall_law(wall: VirtualWall, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force of the wall per measured position, without K, and per exact velocity, without delay."""
    back = -np.expm1(-1j * turn)  # 1 - 1/z
    law = wall.B + wall.M / wall.Ts * back
    if wall.velocity == "exact":
        return 0.0 * back, law
    keep = _kept(wall)
    smooth = (1.0 - keep) / ((1.0 - keep) + keep * back)
    rate = -np.expm1(-1j * turn * wall.velocity_window) / (wall.velocity_window * wall.Ts)
    return law * smooth * rate, 0.0 * back


def _every_stiffness(wall: VirtualWall) -> gain_crossings.LoopFamily:
    """The wall for every K."""
    wall = replace(wall, K=0.0)
    free = wall_differences(wall)
    spring = wall_differences(replace(wall, K=1.0)) - free
    n, Ts, top = len(free), wall.Ts, math.pi / wall.Ts

    def h(omega: np.ndarray) -> np.ndarray:
        arm, (by_place, by_speed) = _held(wall, omega * Ts), wall_law(wall, omega * Ts)
        return -arm.held_place / (1.0 + by_place * arm.held_place + by_speed * arm.held_speed)

    z1 = matrices.eigenvalues(free).astype(complex)
    poles = np.log1p(z1[(np.abs(1.0 + z1) > 1e-6) & (z1 != 0.0)]) / Ts
    size = np.abs(poles[poles != 0.0])
    low = max(1e-3 * min(size.min(initial=math.inf), 1e-3 * top), 1e-12 * top)
    near = gain_crossings.frequency_grid(low, top * (1.0 - 1e-9), poles.imag[poles.imag > 0.0])
    grid = np.union1d(np.linspace(low, top, 40 * n)[:-1], near)
    return gain_crossings.LoopFamily(h, grid, lambda K: _within(free + K * spring), ends=(top,))


@checked
def hand_box_limit(wall: VirtualWall, box: Box) -> float:
    """Least stable K over a box of hands at the wall [N/m].

    The search covers the 27 hands at ends and middles of the box, then the lines through the worst
    of them along each side. It is no proof for the other hands.

    Args:
        wall: all but K and the hand, which are ignored.
        box: the hands; a rigid arm is ignored, because it holds every wall at rest.

    Returns:
        The least `high` of `stiffness_band`; 0 if no K is stable for all of these hands.
    """
    from scipy.optimize import minimize_scalar

    known: dict[Operator, tuple[float, float]] = {}

    def high(hand: Operator) -> float:
        if hand not in known:
            known[hand] = stiffness_band(replace(wall, operator=hand))
        return known[hand][1]

    worst = min(lattice(box), key=high)
    for _ in range(REFINED):
        before = worst
        for side in ("mass", "damper", "spring"):
            bounds = getattr(box, side)
            if bounds[0] == bounds[1]:
                continue

            def along(x: float, side=side, hand=worst) -> float:
                return high(replace(hand, **{side: float(x)}))

            found: Any = minimize_scalar(along, bounds=bounds, method="bounded")
            worst = min(worst, replace(worst, **{side: float(found.x)}), key=high)
        if worst == before:
            break
    return high(worst) if all(low < top for low, top in known.values()) else 0.0


# ---- passivity -----------------------------------------------------------------------------------


@checked
def colgate_schenkel_limit(wall: VirtualWall) -> float:
    """Largest K at which the wall is passive at its own B and M [N/m].

    Colgate, Schenkel (J. Robotic Systems 14, 1997): necessary and sufficient for a sampled object
    behind a mass and a damper b, with any passive hand. With window 1 and without filter, delay and
    M it is 2 (b - |B|)/Ts. Otherwise it is the minimum over the frequencies up to pi/Ts: for a
    delay of whole samples by their condition with H delayed; for a fraction of a sample, where the
    force changes between two samples, by the condition of `passivity_index`.

    Args:
        wall: all but K; hand, friction and quantum are ignored.

    Returns:
        K; 0 if no K > 0 is passive: without damper, and where B or M act on an exact velocity,
        because a hand can give the handle a velocity at the sampling instants only, at no cost of
        energy.
    """
    b, Ts = wall.device.damper, wall.Ts
    if wall.velocity == "exact" and (wall.B or wall.M):
        return 0.0
    plain = (
        not wall.delay and not wall.M and (wall.velocity == "exact" or wall.velocity_window == 1)
    )
    if plain and wall.velocity_filter is None:
        return max(0.0, 2.0 * (b - abs(wall.B)) / Ts)
    whole, part = _split_delay(wall)

    def limits(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest passive K; none for nan."""
        late = np.exp(-1j * turn * whole)
        rest = wall_law(wall, turn)[0] * late
        needed, more = _damping_needed(wall, turn, rest), _damping_needed(wall, turn, late)
        q = 0.25 * part * (1.0 - part) * Ts * Ts
        p = b * more + 2.0 * q * (late.conj() * rest).real
        c = b * needed + q * np.abs(rest) ** 2 - b * b  # q K^2 + p K + c <= 0
        with np.errstate(all="ignore"):
            if not q:
                edge = -c / p
                least, most = np.where(p < 0.0, edge, -math.inf), np.where(p > 0.0, edge, math.inf)
                flat = (p == 0.0) & (c > 0.0)
                return np.where(flat, math.nan, least), np.where(flat, math.nan, most)
            root = np.sqrt(p * p - 4.0 * q * c)
            far = -0.5 * (p + np.copysign(root, p))
            ends = np.sort([far / q, np.where(far != 0.0, c / far, 0.0)], axis=0)
        return ends[0], ends[1]

    turn = _turns(wall)
    least, most = limits(turn)
    if b == 0.0 or np.any(np.isnan(most)):
        return 0.0
    high = _lowest(lambda x: limits(x)[1], turn, most)
    low = -_lowest(lambda x: -limits(x)[0], turn, -least)
    return high if high > max(low, 0.0) else 0.0


@checked
def passive_damping_limit(wall: VirtualWall) -> float:
    """Largest B at which a wall of damping alone is passive [N.s/m], by `passivity_index`.

    The damper that it needs is proportional to B.
    """
    unit = replace(wall, K=0.0, B=1.0, M=0.0)

    def excess(turn: np.ndarray) -> np.ndarray:
        return passivity_index(unit, turn / wall.Ts)

    turn, b = _turns(unit), wall.device.damper
    needed = b - _lowest(excess, turn, excess(turn))
    return b / needed if needed > 0.0 else math.inf


@checked
def passivity_index(wall: VirtualWall, omega: Any) -> np.ndarray:
    """Excess physical damping at each frequency: the wall is passive if it is never negative.

    That is b less

        Ts Re{(1 - 1/z) H(z)}/(2 (1 - cos omega Ts)),    z = exp(j omega Ts)

    (Colgate, Schenkel 1997), with H delayed by the whole samples of the delay. If the delay has a
    further fraction T' of a sample, it is b less (r + sqrt(r^2 + T' (Ts - T') |H|^2))/2 with r =
    Re{(1 - 1/z) (Ts - T' + T'/z) H}/(2 (1 - cos omega Ts)), necessary and sufficient as well.

    Args:
        wall: the wall with its K; hand, friction and quantum are ignored.
        omega: frequencies, > 0 and up to pi/Ts, beyond which the condition repeats itself [rad/s],
            shape (n,).

    Returns:
        [N.s/m], shape (n,); -inf where B or M act on an exact velocity.
    """
    omega = _frequencies(omega)
    turn = omega * wall.Ts
    whole, part = _split_delay(wall)
    by_place, by_speed = wall_law(wall, turn)
    if np.any(by_speed):
        return np.full(turn.shape, -math.inf)
    H = (wall.K + by_place) * np.exp(-1j * turn * whole)
    needed = _damping_needed(wall, turn, H)
    if part:
        q = part * (1.0 - part) * wall.Ts**2
        needed = 0.5 * (needed + np.sqrt(needed**2 + q * np.abs(H) ** 2))
    return wall.device.damper - needed


def worst_middle(wall: VirtualWall, turn: float) -> complex | None:
    """Position of the device under the worst hand when a delayed force changes between samples.

    For samples cos(k turn) the position is Re{middle exp(j k turn)}, the one with the least excess
    damping.
    """
    b = number("device.damper", wall.device.damper, 0.0, above=True, unit="N.s/m")
    whole, part = _split_delay(wall)
    if not part:
        return None
    back = np.exp(-1j * np.array([turn]))
    H = (wall.K + wall_law(wall, np.array([turn]))[0]) * back**whole
    straight = (1.0 - part) + part / back
    late = part * (1.0 - part) * wall.Ts * H * (1.0 - back)
    return complex((straight + late / (2.0 * b))[0])


def _damping_needed(wall: VirtualWall, turn: np.ndarray, H: np.ndarray) -> np.ndarray:
    """Re{(1 - 1/z) (Ts - T' + T'/z) H}/(2 (1 - cos omega Ts)) [N.s/m], T' the delay's fraction."""
    part = _split_delay(wall)[1] * wall.Ts
    shape = (wall.Ts - part) + part * np.exp(-1j * turn)
    # (1 - 1/z)/(2 (1 - cos)) without the loss of digits of slow turns
    return (0.5j * np.exp(-0.5j * turn) / np.sin(0.5 * turn) * shape * H).real


def _turns(wall: VirtualWall) -> np.ndarray:
    """omega Ts, dense enough for window and delay."""
    n = ANGLES + 40 * (wall.velocity_window + _split_delay(wall)[0])
    slow = np.geomspace(SLOWEST_TURN, math.pi, ANGLES)[:-1]
    return np.union1d(slow, np.linspace(0.0, math.pi, n)[1:])


def _lowest(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, y: np.ndarray) -> float:
    """Refined minimum of f near its least value y on a grid x."""
    from scipy.optimize import minimize_scalar

    i = int(np.argmin(y))
    if math.isinf(y[i]):
        return float(y[i])
    around = float(x[max(i - 1, 0)]), float(x[min(i + 1, len(x) - 1)])
    found: Any = minimize_scalar(
        lambda a: min(float(f(np.array([a]))[0]), HUGE), bounds=around, method="bounded"
    )
    return min(float(y[i]), float(found.fun))


@checked
def abbott_okamura_limit(wall: VirtualWall) -> float:
    """Largest passive K of a wall behind damper, friction and encoder [N/m].

    min(2 b/Ts, 2 fc/Delta): necessary and sufficient for a wall of K alone (Abbott, Okamura, IEEE
    Trans. Robotics 21, 2005). Without an encoder (Delta = 0) it is 2 b/Ts.

    Args:
        wall: all but K, with B = M = 0 and delay = 0; the hand is ignored.

    Raises:
        ParameterError: B, M or delay is not zero.
    """
    for field in ("B", "M", "delay"):
        if getattr(wall, field):
            bound = "must be 0: the condition is one of a spring alone, without delay"
            raise ParameterError(f"wall.{field}", getattr(wall, field), bound)
    d = wall.device
    rough = 2.0 * d.friction / d.quantum if d.quantum else math.inf
    return min(2.0 * d.damper / wall.Ts, rough)


# ---- delay ---------------------------------------------------------------------------------------


@checked
def hulin_limit(wall: VirtualWall) -> float:
    """Largest stable K by the linear rule (b + B)/(Ts/2 + delay) [N/m].

    Hulin, Preusche, Hirzinger (IROS, 2006); Gil, Sanchez, Hulin, Preusche, Hirzinger (J.
    Computing and Information Science in Engineering 9, 2009). It holds for (b + B) Ts/mass and
    K Ts^2/mass far below 1: see docs/equations.md, section 7, for the ranges of 1 % and 5 %.

    Args:
        wall: all but K; b is the damping of device and hand together; M, window, filter and the
            hand's mass and spring are ignored.
    """
    b = wall.device.damper + wall.hand.damper
    return max(0.0, (b + wall.B) / (0.5 * wall.Ts + wall.delay))


@checked
def jury_limit(wall: VirtualWall) -> float:
    """Largest stable K of the held wall with delay 0 or Ts, in closed form [N/m].

    Jury's conditions on the characteristic polynomial, of order 3 or 4, are polynomials in K of
    order 2 at most.

    Args:
        wall: all but K, with delay 0 or Ts, window 1, no filter, M = 0, a difference for velocity,
            and no spring in the hand.

    Returns:
        K, the high end of `stiffness_band`.

    Raises:
        ParameterError: the wall has other parts.
    """
    whole, part = _split_delay(wall)
    if part or whole > 1:
        raise ParameterError("wall.delay", wall.delay, "must be 0 or Ts")
    plain = VirtualWall()
    for field in ("M", "velocity", "velocity_window", "velocity_filter"):
        if getattr(wall, field) != getattr(plain, field):
            bound = f"must be {getattr(plain, field)} here"
            raise ParameterError(f"wall.{field}", getattr(wall, field), bound)
    if wall.hand.spring:
        raise ParameterError("wall.operator.spring", wall.hand.spring, "must be 0 here")
    ((_, travel), (_, slowing)), soon, *_ = linear_loop.split_motion(*_moving(wall))
    # place per force: (n1 z + n0)/((z - 1)(z - e))
    e, beta = 1.0 + slowing, wall.B / wall.Ts
    n1, n0 = float(soon[0]), float(travel * soon[1] - soon[0] * e)
    g = Polynomial([beta, 1.0])  # K + B/Ts
    one = Polynomial([1.0])
    a = [-n0 * beta * one, n0 * g - n1 * beta, n1 * g - (1.0 + e)]
    if whole:
        a = [a[0], a[1], a[2] + (1.0 + 2.0 * e), -(1.0 + e) * one]
    else:
        a[1] = a[1] + e
    a.append(one)
    n = len(a) - 1
    signs = [(-1.0) ** (n - i) for i in range(n + 1)]
    conditions = [sum(a, 0.0 * one), sum((x * y for x, y in zip(signs, a, strict=True)), 0.0 * one)]
    row = a
    while len(row) > 2:  # |first| < last, then the next row of the table
        conditions += [row[-1] - row[0], row[-1] + row[0]]
        row = [row[-1] * y - row[0] * x for x, y in zip(row[::-1], row, strict=True)][1:]
    conditions += [row[-1] - row[0], row[-1] + row[0]]
    edges = np.unique(np.concatenate([roots.positive_roots(c) for c in conditions]))
    for low, high in zip([0.0, *edges], [*edges, 2.0 * edges.max(initial=0.0)], strict=True):
        if all(c(0.5 * (low + high)) > 0.0 for c in conditions):
            return float(high)
    return 0.0


@checked
def hulin_boundary(
    mass: float,
    damper: float,
    Ts: float,
    samples: Annotated[float, Bound(0.0, 100.0)] = 0.0,
    n: Annotated[int, Bound(3, 100_001)] = 401,
) -> tuple[np.ndarray, np.ndarray]:
    """Exact stability boundary of the held, delayed wall in the plane of B and K.

    A pair of poles lies at z = exp(+-j omega Ts) where real and imaginary part of the loop's
    equation vanish. These are two lines in that plane. Their intersection moves along the boundary
    with omega, from K = 0 at B = -damper to K = 0 at the largest stable B. A pole at z = -1 cuts it
    by the line K + 2 B/Ts = const.

    Args:
        mass: mass of device and hand [kg], 1e-4 to 1e4.
        damper: damping of device and hand [N.s/m], 0 to 1e9.
        Ts: control sample [s].
        samples: delay in samples, 0 to 100, with a fraction.
        n: number of points, 3 to 100001.

    Returns:
        (B [N.s/m], K [N/m]), shape (m,) each, m <= n; the loop is stable below, for K > 0.
    """
    from scipy.optimize import brentq

    wall = VirtualWall(device=Device(mass=mass, damper=damper), Ts=Ts)
    wall = replace(wall, delay=samples * wall.Ts)

    def crossing(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """B and K that put a pair of poles at z = exp(+-j turn): K + B (1 - 1/z)/Ts = -1/G."""
        needed = -1.0 / _held(wall, turn).held_place
        B = needed.imag * wall.Ts / np.sin(turn)
        return B, needed.real - 2.0 * B / wall.Ts * np.sin(0.5 * turn) ** 2

    def stiffness(turn: float) -> float:
        return float(crossing(np.array([turn]))[1][0])

    turn = np.linspace(0.0, math.pi, 2 + 100 * (1 + math.ceil(samples)))[1:-1]
    gone = np.flatnonzero(crossing(turn)[1] <= 0.0)
    last = float(turn[-1])
    if len(gone):
        i = int(gone[0])
        last = float(brentq(stiffness, turn[i - 1], turn[i])) if i else last  # type: ignore[arg-type]
    B, K = crossing(np.linspace(0.0, last, n)[1:])
    if (opposite := _held(wall, np.array([math.pi])).held_place.real[0]) < 0.0:
        K = np.minimum(K, -1.0 / opposite - 2.0 * B / wall.Ts)
    kept = K >= -1e-9 * K.max()
    return np.append(-damper, B[kept]), np.append(0.0, np.maximum(K[kept], 0.0))


def _frequencies(omega: Any) -> np.ndarray:
    omega = np.atleast_1d(array_of("omega", omega))
    if omega.ndim != 1 or not np.all((omega > 0.0) & (omega <= TOP_OMEGA)):
        raise ParameterError("omega", omega, f"must be > 0 and <= {TOP_OMEGA:g} rad/s, shape (n,)")
    return omega
