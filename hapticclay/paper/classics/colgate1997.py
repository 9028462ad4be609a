"""Colgate and Schenkel 1997: the stiffest passive sampled wall."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...model.operator import Operator
from ...scene.virtual_wall import Device, VirtualWall
from ...studies.chart import Chart, curve
from ...studies.port_energy import passivity_limit, taken_energy, zigzag
from ...studies.wall_runs import PRESS, stiffest, unshown
from ..ledger import Row, row
from .classic import BESIDE, FORMULA, Classic, Found, Progress, holds

MASS, DAMPER, TS = 0.1, 2.0, 1e-3  # kg, N.s/m, s
WALL = VirtualWall(device=Device(MASS, DAMPER), Ts=TS)
LIMIT_ERROR = 5e-3  # share of K: slowest paths at pi/48 a sample; the line is for pi/infinity
ENERGY = 1e-3  # share: impulses of 2 m v at the corners are summed over engine steps
AMPLITUDE = 1e-4  # [m] of the zigzag
STEPS = 8  # engine steps per sample; the zigzag's energy is exact to one part in this number


def bound(wall: VirtualWall) -> float:
    """K of b = K Ts/2 + |B| [N/m]; 0 where no K is passive."""
    return max(0.0, 2.0 * (wall.device.damper - abs(wall.B)) / wall.Ts)


def _limits(quick: bool, progress: Progress) -> Iterator[tuple[str, VirtualWall, float]]:
    """Walls with the largest passive K, found by runs."""
    cases = {
        "b = 2 N.s/m, Ts = 1 ms": WALL,
        "the same, B = 1 N.s/m": replace(WALL, B=1.0),
        "the same, B = -1 N.s/m": replace(WALL, B=-1.0),
    }
    if not quick:
        cases |= {
            "Ts = 0.5 ms": replace(WALL, Ts=0.5 * TS),
            "b = 4 N.s/m": replace(WALL, device=Device(MASS, 2.0 * DAMPER)),
            "mass of 1 kg": replace(WALL, device=Device(10.0 * MASS, DAMPER)),
        }
    for name, wall in cases.items():
        progress(f"largest passive K: {name}")
        yield name, wall, passivity_limit(wall, STEPS)


def _worst_path() -> Iterator[Row]:
    """Energy that a hand at half the sampling frequency extracts, above and below the bound."""
    for share, sign in ((0.9, "takes"), (1.1, "gives")):
        wall = replace(WALL, K=share * bound(WALL))
        A, b, K = AMPLITUDE, DAMPER, wall.K
        expected = 2.0 * (4.0 * b * A * A / TS - 2.0 * K * A * A)
        yield row(
            f"energy over a period of a zigzag at half the sampling frequency, K = {K:g} N/m, "
            f"which {sign} energy | criterion at omega Ts = pi | 4 b A²/Ts - 2 K A² a sample | J",
            (expected, taken_energy(wall, zigzag(A)), ENERGY),
            FORMULA,
            f"a hand moves the device by ±{1e3 * A:g} mm between samples; energy of the run",
        )


def _passive_is_stable(progress: Progress) -> Row:
    """Stability at the passive limit with a range of hands, from runs."""
    progress("stability in a hand")
    hands = (None, Operator(0.5, 2.0, 200.0))
    walls = [replace(WALL, operator=x) for x in hands]
    found = [stiffest([w], [bound(WALL)], bound(WALL), PRESS, unshown)[0] for w in walls]
    return holds(
        "a passive wall is stable in every passive hand | introduction | passivity "
        "serves coupled stability",
        min(found) >= bound(WALL),
        FORMULA,
        f"largest stable K by runs, without a hand and in one of 0.5 kg, 2 N.s/m, 200 N/m: "
        f"{found[0]:.4g} and {found[1]:.4g} N/m; passive up to {bound(WALL):g} N/m",
    )


def _plane(found: list[tuple[str, VirtualWall, float]]) -> Chart:
    """The passive walls in the plane of B and K."""
    B = np.linspace(-DAMPER, DAMPER, 101)
    same = [(w.B, K) for _, w, K in found if w.device == WALL.device and w.Ts == TS]
    return Chart(
        "plane",
        "Passive walls",
        "The line is b = K Ts/2 + |B|; marks are the largest K at which no path of a hand draws "
        "energy, by runs.",
        "virtual damping B [N.s/m]",
        "virtual stiffness K [N/m]",
        (
            curve("b = K Ts/2 + |B|", B, [bound(replace(WALL, B=x)) for x in B]),
            curve(
                "runs: worst path of a hand", [x for x, _ in same], [K for _, K in same], "marks"
            ),
        ),
    )


def make(quick: bool, progress: Progress) -> Found:
    found = list(_limits(quick, progress))
    rows = [
        row(
            f"largest passive K: {name} | criterion | b > K Ts/2 + abs(B) | N/m",
            (bound(wall), K, LIMIT_ERROR),
            FORMULA,
            "searched for by runs along polygons of a hand",
        )
        for name, wall, K in found
    ]
    rows += _worst_path()
    undamped = taken_energy(replace(WALL, K=10.0, device=Device(MASS)), zigzag(AMPLITUDE))
    rows.append(
        holds(
            "without physical damping no wall is passive | criterion | b > K Ts/2 + abs(B)",
            undamped < 0.0,
            FORMULA,
            f"a wall of 10 N/m on a device without damper gives {-undamped:.3g} J a period",
        )
    )
    if not quick:
        rows.append(_passive_is_stable(progress))
        heavy = next(K for name, _, K in found if name.startswith("mass"))
        rows.append(
            row(
                "the same limit for ten times the mass | none | not in the formula | N/m",
                (found[0][2], heavy, LIMIT_ERROR),
                BESIDE,
                "the worst path has constant speed between samples, whatever the mass",
            )
        )
    return Found(tuple(rows), (_plane(found),))


CLASSIC = Classic(
    "colgate1997",
    "Passivity of a sampled wall",
    "J. E. Colgate, G. G. Schenkel, Passivity of a class of sampled-data systems: application to "
    "haptic interfaces, J. Robotic Systems 14 (1997) 37-47",
    "Its abstract could be read (slideblast.com): conditions for passivity, and a virtual wall on "
    "a device of one degree of freedom as the example. Its figures could not; the criterion "
    "b > K Ts/2 + |B| is derived in equations.md, section 7.",
    "A hand moves the device along polygons in the samples; the energy of each run is integrated, "
    "and K is searched for at which it changes its sign. The search does not know the formula.",
    make,
)
