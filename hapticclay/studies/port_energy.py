"""Passivity of a virtual wall by runs: the energy it delivers to the worst passive hand.

A hand moves the device along a periodic path. If the device delivers net energy over a period, some
passive hand is driven into growing motion, and the wall is active (Colgate, Schenkel, J. Robotic
Systems 14, 1997). Among all paths with the same sampled positions, the damper dissipates least at
constant speed between samples. The worst path is therefore a polygon for any mass.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real
from ..formulas import hardware
from ..model.hardware import Hardware
from ..model.samples import Samples
from ..model.spring import STIFFNESS_MAX
from ..scene.scenario import Scenario
from ..scene.virtual_wall import LEVER, UPRIGHT, VirtualWall, wall_law
from ..simulation import record
from ..simulation.simulate import simulate
from ..theory import wall_limits

PATH_STEPS = 32  # engine steps per sample: a corner takes one and loses its share of the damping
LEAST_STEP = 1e-6  # [s] of a scenario
LARGE = 5e-3  # [m] of a path that hides friction and quantum
TOP_SPEED = 9.0  # [m/s] along it
ARC_LOSS = 55.0  # measured: link 1's arc costs this (A/lever)^4 m/(b Ts) of the damper's energy
ARC_SHARE = 1e-3  # upper bound of that cost, which limits the size of such a path
SMALL = 0.01  # of the quantum: amplitude of a path over a single encoder edge
LEAST_SPEED = 1.5e-5  # [m/s] along it: a run slower than 1e-5 m/s counts as stalled
LEAST_SHARE = 2e-3  # of the damper's loss in that of friction, along such a path
TRIED_TURNS = [(1, 1), (2, 3), (1, 2), (1, 4), (1, 12)]  # (p, q): paths tried at omega Ts = pi p/q
SLOW_TURN = 48  # q of the slowest path tried
K_FACTOR = 1.3  # factor on K in the search for an active wall
K_SHARE = 2e-4  # relative accuracy of limits
FILTER_TIMES = 12.0  # time constants of the filter before energy is counted


@part("path.")
class Path:
    """A path that a hand imposes on the device: a periodic polygon through the samples.

    Attributes:
        places: positions of the device at the samples of a period [m], shape (n,).
        middles: positions of the device where a delayed force changes between two samples [m],
            shape (n,); empty if it does not.
    """

    places: Annotated[tuple[Real, ...], Bound(-0.1, 0.1, "m")]
    middles: Annotated[tuple[Real, ...], Bound(-0.1, 0.1, "m")] = ()

    def __post_init__(self):
        if len(self.places) < 2:
            raise ParameterError("path.places", self.places, "must be two places or more")
        if self.middles and len(self.middles) != len(self.places):
            bound = f"must be {len(self.places)} places, one per sample"
            raise ParameterError("path.middles", self.middles, bound)


Amplitude = Annotated[Real, Bound(0.0, 0.1, "m", above=True)]
Turn = Annotated[tuple[float, float], Bound(1.0, 1e6, names=("p", "q"))]
Periods = Annotated[int, Bound(1, 10_000)]
Steps = Annotated[int, Bound(2, 10_000)]


@checked
def zigzag(amplitude: Amplitude, about: Annotated[Real, Bound(-0.1, 0.1, "m")] = 0.0) -> Path:
    """The path at half the sampling frequency, synchronous with the samples: a triangle.

    Per sample a wall K with damper B delivers 2 A^2 (K + 2 B/Ts) along it, and a damper b
    dissipates 4 b A^2/Ts.

    Args:
        amplitude: A [m], > 0, at most 0.1.
        about: its middle [m], -0.1 to 0.1.
    """
    return Path((about + amplitude, about - amplitude))


@checked
def polygon(wall: VirtualWall, turn: Turn, amplitude: Amplitude = 1e-4) -> Path:
    """The path of least dissipation through a sine of the samples.

    If a delayed force changes between two samples, the path has a corner there too, where the
    damper's dissipation and the wall's work balance (docs/equations.md, section 7).

    Args:
        wall: the wall with its K, of a device with a damper.
        turn: omega Ts as (p, q) of pi p/q, 1 <= p <= q.
        amplitude: of the sine [m], > 0, at most 0.1.
    """
    p, q = map(int, turn)
    if p > q:
        raise ParameterError("turn", turn, "must be (p, q) with 1 <= p <= q")
    angle = math.pi * p / q * np.arange(2 * q)
    places = amplitude * np.cos(angle)
    middle = wall_limits.worst_middle(wall, math.pi * p / q)
    if middle is None:
        return Path(tuple(places.tolist()))
    return Path(
        tuple(places.tolist()), tuple((amplitude * middle * np.exp(1j * angle)).real.tolist())
    )


def imposed(wall: VirtualWall, path: Path, periods: int, steps: int) -> tuple[Scenario, int]:
    """The run in which a hand supplies the force that a path requires, and the first step to count.

    The wall's force is its law applied to the path as measured by encoder and difference.
    """
    d, Ts = wall.device, wall.Ts
    if wall.operator is not None:
        raise ParameterError("wall.operator", wall.operator, "must be None: the path is the hand")
    if wall.unilateral:
        raise ParameterError("wall.unilateral", True, "must be False: the wall acts along the path")
    steps = min(steps, max(2, int(Ts / LEAST_STEP)))
    n, h = len(path.places), Ts / steps
    memory = wall.velocity_window + math.ceil(wall.delay / Ts) + 2.0
    if wall.velocity_filter is not None:
        memory += FILTER_TIMES / (2.0 * math.pi * wall.velocity_filter * Ts)
    first = math.ceil(memory / n)
    samples, corner = n * (first + periods) + 1, 0
    at, place = np.arange(samples + 1) * Ts, np.resize(path.places, samples + 1)
    if path.middles:
        corner = h * min(max(round(math.fmod(wall.delay, Ts) / h), 1), steps - 1)
        at = np.stack((at, at + corner), axis=1).ravel()[:-1]
        place = np.stack((place, np.resize(path.middles, samples + 1)), axis=1).ravel()[:-1]
    off = 2 if corner == h else 1  # energy is counted between corners
    t = h * np.arange((samples - 1) * steps + off + 1)
    x = np.interp(t, at, place)
    v = np.diff(x) / h
    before, after = np.append(v[0], v), np.append(v, v[-1])  # of each kick
    mean = 0.5 * (before + after)
    wanted = d.mass * (after - before) / h + d.damper * mean
    wanted += d.friction * np.sign(after)  # where it turns round, friction helps to stop it
    wanted += _wall_force(wall, x[::steps], t, h)
    force = np.column_stack((wanted, np.zeros(len(wanted))))
    edges = np.append(0.0, t[1:] - 0.5 * h)
    muscle = Samples(tuple(edges.tolist()), tuple(map(tuple, force.tolist())), between="hold")
    scenario = wall.scenario(
        float(t[-1]), push=float(v[0]), start=float(x[0]), muscle=muscle, steps=steps
    )
    return scenario, n * first * steps + off


def _wall_force(wall: VirtualWall, place: np.ndarray, t: np.ndarray, h: float) -> np.ndarray:
    """Mean force of the wall over the kicks at t, for given positions at the samples."""
    scenario, Ts, window = wall.scenario(wall.Ts), wall.Ts, wall.velocity_window
    (count, *_) = (scenario.hardware or Hardware()).count_sizes([True])
    assert scenario.controller is not None
    params, state = scenario.controller.params, (0.0, 0.0)
    lever = params[3]
    rate = -(place[1] - place[0]) / Ts / lever  # at which the joint has turned so far, see Sampled
    q = UPRIGHT - np.arcsin(place / lever)
    q = np.concatenate((q[0] + Ts * rate * np.arange(-window, 0), q))
    q = [hardware.encode(x, count) for x in q.tolist()]
    w, held = rate, []
    for k in range(len(place)):
        if wall.velocity == "difference":
            mean = (q[window + k] - q[k]) / (window * Ts)
            cutoff = wall.velocity_filter
            w = mean if cutoff is None else hardware.low_pass(w, mean, cutoff, Ts)
        else:
            w = rate if not k else (q[window + k] - q[window + k - 1]) / Ts
        (torque, _), state = wall_law(0.0, (q[window + k], 0.0), (w, 0.0), (), state, params)
        held.append(torque / lever)
    begins = wall.delay + Ts * np.arange(len(place) + 1)
    work = np.append(0.0, np.cumsum(held)) * Ts
    low, high = np.maximum(t - 0.5 * h, 0.0), np.minimum(t + 0.5 * h, t[-1])
    return (np.interp(high, begins, work) - np.interp(low, begins, work)) / (high - low)


@checked
def taken_energy(
    wall: VirtualWall, path: Path, periods: Periods = 3, steps: Steps = PATH_STEPS
) -> float:
    """Energy that the device absorbs from the hand over a period of a path, by a run [J].

    It is the integral of fh v over the run, minus the negligible energy stored in the mass. A
    negative one proves that the wall is active.

    Args:
        wall: the wall with its K, without a hand of its own; not "exact" in velocity with B or M.
        path: path imposed by the hand.
        periods: number of periods in the mean.
        steps: engine steps per sample, with steps of at least 1e-6 s; along a zigzag damping and
            friction are too low by one part in this number.
    """
    scenario, first = imposed(wall, path, periods, steps)
    found = simulate(scenario)
    d, v = wall.device, found.v[first:, 0]
    if found.outcome.code != "time limit":
        raise ParameterError("path", path, f"cannot be imposed: {found.status}")
    # the record attributes the device's damper to the hand
    force = found.fh.copy()
    force[:, 0] += d.damper * found.v[:, 0]
    given = record.port_energy(replace(found, fh=force))[:, 0]
    stored = 0.5 * d.mass * (v[-1] ** 2 - v[0] ** 2)
    return float(given[-1] - given[first] - stored) / periods


@checked
def passivity_limit(wall: VirtualWall, steps: Steps = PATH_STEPS) -> float:
    """Largest K at which no path of a hand takes energy from the wall, by runs [N/m].

    The paths are polygons at several frequencies up to pi/Ts and at the worst frequency by theory.
    With friction or an encoder a large and a small zigzag are added, which isolate the damper and
    one encoder edge. For each path the sign of the energy determines K; 0 stands for a wall that is
    active at any K, inf for one that no path shows active up to 1e9 N/m. Other paths may draw
    energy at a lower K, so the result is an upper bound of the true limit.

    Args:
        wall: all but K, without a hand of its own; not "exact" in velocity with B or M, nor with a
            surface.
        steps: engine steps per sample, see `taken_energy`.

    Raises:
        ParameterError: the wall has a hand, a surface, or B or M on an exact velocity, where the
            energy of a path is inconclusive.
    """
    if wall.velocity == "exact" and (wall.B or wall.M):
        bound = "must be 'difference' for a wall with B or M: a hand can fake an exact velocity"
        raise ParameterError("wall.velocity", wall.velocity, bound)
    d = wall.device
    if not (d.friction or d.damper):
        return 0.0  # nothing dissipates energy
    if not (d.friction or d.quantum):
        paths = [(lambda w, x=x: polygon(w, x), max(8, 2 * steps // x[1])) for x in _turns_of(wall)]
        return _least_limit(wall, paths)
    paths = [(lambda w: zigzag(_large(wall)), steps)]
    if d.quantum:
        small = min(SMALL * d.quantum, _large(wall))
        if d.damper and d.friction:
            small = min(small, LEAST_SHARE * 0.5 * d.friction * wall.Ts / d.damper)
        small = max(small, 0.5 * LEAST_SPEED * wall.Ts)
        paths.insert(0, (lambda w: zigzag(small, 0.5 * d.quantum), steps))
    return _least_limit(wall, paths)


def _large(wall: VirtualWall) -> float:
    """Amplitude A of a zigzag large enough that the damper dominates friction and quantum [m]."""
    d, quantum, large = wall.device, wall.device.quantum, min(LARGE, 0.5 * TOP_SPEED * wall.Ts)
    if d.damper:
        large = min(large, LEVER * (ARC_SHARE * d.damper * wall.Ts / (ARC_LOSS * d.mass)) ** 0.25)
    return round(large / quantum) * quantum if 0.0 < quantum < large else large


def _turns_of(wall: VirtualWall) -> list[tuple[int, int]]:
    """omega Ts/pi of the tested paths, as fractions: the worst by theory and others."""
    limit = wall_limits.colgate_schenkel_limit(wall)
    every = {(p, q) for q in range(1, 17) for p in range(1, q + 1) if math.gcd(p, q) == 1}
    tried = [*sorted(every), (1, SLOW_TURN), (SLOW_TURN - 1, SLOW_TURN)]
    index = wall_limits.passivity_index(
        replace(wall, K=limit), [math.pi * p / (q * wall.Ts) for p, q in tried]
    )
    return [tried[int(np.argmin(index))], *TRIED_TURNS]


def _least_limit(wall: VirtualWall, paths: list[tuple[Callable, int]]) -> float:
    """Least K at which the energy along a path of the wall changes its sign."""
    from scipy.optimize import brentq

    def energy(K: float, path: Callable, steps: int) -> float:
        stiff = replace(wall, K=K)
        return taken_energy(stiff, path(stiff), 1, steps)

    least, d = math.inf, wall.device
    guess = (d.damper + d.friction + abs(wall.B)) / (wall.Ts + wall.delay) or 1.0
    for way in paths:
        if least < math.inf and energy(least, *way) >= 0.0:
            continue
        if energy(0.0, *way) < 0.0:
            return 0.0
        low, high = 0.0, min(0.1 * guess, least)
        while high < least and energy(high, *way) >= 0.0:
            low, high = high, min(K_FACTOR * high, least)
            if high > STIFFNESS_MAX:
                return math.inf
        found: Any = brentq(energy, low, high, way, xtol=0.5 * K_SHARE * high, rtol=K_SHARE)  # type: ignore[arg-type]
        least = float(found)
    return least
