"""Diolaiti et al. 2006: friction stabilises walls that are not passive, for small motions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...scene.virtual_wall import Device, VirtualWall
from ...studies.chart import Chart, curve
from ...studies.port_energy import passivity_limit
from ...studies.wall import STILL
from ...studies.wall_runs import PRESS, Press, come_to_rest
from ...theory import wall_limits
from ...theory.roots import bisect
from ..ledger import Row, row
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Progress, holds

MASS, DAMPER, FRICTION, TS = 0.1, 0.1, 0.05, 1e-3  # kg, N.s/m, N, s
WALL = VirtualWall(device=Device(MASS, DAMPER, FRICTION), Ts=TS)
STIFF, QUICK_STIFF = (1000.0, 2000.0, 4000.0, 8000.0), (8000.0,)  # [N/m]
THRESHOLD = 0.03  # share: harmonics neglected by the describing function, and bisection to 2 %
BRACKET = 1.02  # ratio of two speeds at which a search ends
SPAN = 2.0  # ratio of its ends to the scale 2 fc/(K Ts), independent of the describing function
ROUGH = Device(MASS, 0.5, 0.02, 5e-5)  # a device with an encoder, passive up to 800 N/m
BUZZ = 2.0  # [N.s/m] virtual damping at which ROUGH buzzes by more than 1 um


def damping_needed(wall: VirtualWall) -> float:
    """Physical damping at which the linear wall is marginally stable [N.s/m]."""

    def unstable(b: float) -> bool:
        return not wall_limits.stable_wall(replace(wall, device=Device(wall.device.mass, b)))

    return bisect(unstable, 0.0, 2.0 * wall.K * wall.Ts, 1e-9)[0]


def threshold(wall: VirtualWall) -> float:
    """Speed of an oscillation that friction just balances, by its describing function [m/s].

    For a sine of speed V, Coulomb friction acts as a damper 4 fc/(pi V). The oscillation persists
    if this equals the missing damping of the device.
    """
    d = wall.device
    return 4.0 * d.friction / (math.pi * (damping_needed(wall) - d.damper))


def held_speed(wall: VirtualWall) -> float:
    """Largest initial speed from which a wall comes to rest, from runs [m/s]."""
    around = 2.0 * wall.device.friction / (wall.K * wall.Ts)
    low, high = around / SPAN, around * SPAN
    while high > BRACKET * low:
        middle = math.sqrt(low * high)
        if come_to_rest([wall], Press(0.0, middle, STILL))[0]:
            low = middle
        else:
            high = middle
    return math.sqrt(low * high)


def _thresholds(quick: bool, progress: Progress) -> tuple[list[Row], Chart]:
    rows, found = [], []
    tried = QUICK_STIFF if quick else STIFF
    for K in tried:
        progress(f"speed that friction holds: K = {K:g} N/m")
        wall = replace(WALL, K=K)
        expected = threshold(wall)
        found.append(held_speed(wall))
        rows.append(
            row(
                f"largest speed that comes to rest, K = {K:g} N/m | describing function analysis | "
                "4 fc/(pi V) = damping lacked | m/s",
                (expected, found[-1], THRESHOLD),
                FORMULA,
                f"b = {DAMPER:g} N.s/m, fc = {FRICTION:g} N; {damping_needed(wall):.4g} N.s/m are "
                "needed without friction",
            )
        )
    line = np.geomspace(500.0, 1e4, 41)
    chart = Chart(
        "threshold",
        "Motions that friction holds",
        "Below the line a motion comes to rest though the wall is not passive; above it, it grows.",
        "virtual stiffness K [N/m]",
        "speed at the start [m/s]",
        (
            curve("describing function", line, [threshold(replace(WALL, K=K)) for K in line]),
            curve("runs: largest that comes to rest", tried, found, "marks"),
        ),
        "xy",
    )
    return rows, chart


def _stable_but_active(progress: Progress) -> Row:
    """A wall that is active, since a hand can extract energy, yet comes to rest."""
    progress("a wall that is stable and not passive")
    limit = passivity_limit(VirtualWall(device=ROUGH))
    stiff = VirtualWall(K=1.2 * limit, device=ROUGH)
    return holds(
        "devices operate stably in violation of passivity criteria | abstract | many common "
        "devices do",
        come_to_rest([stiff], PRESS)[0],
        QUOTED,
        f"runs of a hand draw energy above {limit:.4g} N/m; at {stiff.K:.4g} N/m a device of "
        f"b = {ROUGH.damper:g} N.s/m, fc = {ROUGH.friction:g} N, Delta = "
        f"{1e6 * ROUGH.quantum:g} um comes to rest after a push of 50 mm/s",
    )


def _quantum(progress: Progress) -> Row:
    """Friction of half the force of a quantum separates rest from a buzz."""
    progress("quantum and friction")
    edge = 2.0 * ROUGH.friction / ROUGH.quantum
    tried = [
        VirtualWall(K=share * edge, B=BUZZ, device=ROUGH) for share in (0.5, 0.9, 0.98, 1.1, 1.3)
    ]
    rests = come_to_rest(tried, PRESS)
    words = ", ".join(
        f"{w.K:.4g} N/m {'rests' if rest else 'buzzes'}"
        for w, rest in zip(tried, rests, strict=True)
    )
    return holds(
        "nonlinear effects create distinct regions: friction outweighs the quantum up to "
        "K = 2 fc/Delta | abstract | quantization and Coulomb damping interact",
        rests == [True, True, True, False, False],
        QUOTED,
        f"2 fc/Delta = {edge:g} N/m, B = {BUZZ:g} N.s/m: {words}",
    )


def make(quick: bool, progress: Progress) -> Found:
    rows, chart = _thresholds(quick, progress)
    if not quick:
        rows += [_stable_but_active(progress), _quantum(progress)]
        progress("without friction")
        bare = replace(WALL, K=QUICK_STIFF[0], device=Device(MASS, DAMPER))
        rows.append(
            holds(
                "without friction the same wall rests from no speed | none | not stated",
                not come_to_rest([bare], Press(0.0, 1e-3, STILL))[0],
                BESIDE,
                f"K = {bare.K:g} N/m: a push of 1 mm/s grows",
            )
        )
    return Found(tuple(rows), (chart,))


CLASSIC = Classic(
    "diolaiti2006",
    "Quantization, delay and Coulomb friction",
    "N. Diolaiti, G. Niemeyer, F. Barbagli, J. K. Salisbury, Stability of haptic rendering: "
    "discretization, quantization, time delay, and Coulomb effects, IEEE Trans. Robotics 22 (2006) "
    "256-268",
    "Its abstract could be read (search.isc.ac, fdocuments.in): distinct stability regions, "
    "devices that operate stably in violation of passivity criteria, and a describing function "
    "analysis. Its figures and the parameters of its devices could not; the describing function "
    "of Coulomb friction is that of any textbook, 4 fc/(pi V). The devices here are ours.",
    "A device is pushed at a speed without any hand; whether it comes to rest is read from the "
    "run, and the speed is searched for that just does.",
    make,
)
