"""Hulin et al. 2006: stability boundary over damping, delay and hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...model.operator import Operator
from ...scene.virtual_wall import Device, VirtualWall
from ...studies.chart import Chart, curve
from ...studies.wall_runs import PRESS, stiffest, unshown
from ...theory import wall_limits
from ..ledger import Row, row
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Progress, holds

MASS, TS = 1.0, 1e-3  # kg, s
RULE = 0.01  # share: the rule is first-order in (b + B) Ts/mass, see docs/equations.md
GROWTH = 3e-3  # relative accuracy of a search by growth
SMALL = 4.0  # [N.s/m] b + B at which the rule holds to 1 %
DELAYS, QUICK_DELAYS = (0.0, 0.5, 1.0, 2.0), (0.0, 1.0)  # samples


def _wall(b: float, delay: float, hand: Operator | None = None) -> VirtualWall:
    return VirtualWall(device=Device(MASS, b), Ts=TS, delay=delay * TS, operator=hand)


def rule(b: float, B: float, delay: float) -> float:
    """K = (b + B)/(Ts/2 + delay) [N/m]."""
    return (b + B) / (TS * (0.5 + delay))


def _by_runs(wall: VirtualWall, *B: float) -> list[float]:
    """Largest stable K at each B, from the growth of runs [N/m]; searches start at the rule."""
    b, samples = wall.device.damper + wall.hand.damper, wall.delay / wall.Ts
    around = [rule(b, x, samples) for x in B]
    return stiffest([replace(wall, B=x) for x in B], around, min(around), PRESS, unshown)


def _rule_rows(quick: bool, progress: Progress) -> list[Row]:
    rows = []
    for delay in QUICK_DELAYS if quick else DELAYS:
        for b, B in ((SMALL, 0.0), (0.5 * SMALL, 0.5 * SMALL)):
            if quick and B:
                continue
            progress(f"stable K: delay of {delay:g} samples, b = {b:g}, B = {B:g} N.s/m")
            rows.append(
                row(
                    f"largest stable K, delay {delay:g} Ts, b = {b:g}, B = {B:g} N.s/m | linear "
                    "condition | K < (b + B)/(Ts/2 + td) | N/m",
                    (rule(b, B, delay), _by_runs(_wall(b, delay), B)[0], RULE),
                    FORMULA,
                    f"mass {MASS:g} kg, Ts = {1e3 * TS:g} ms; from the growth of runs",
                )
            )
    return rows


def _hand_row(progress: Progress) -> Row:
    """A hand adds its damping to the device; its mass hardly moves the boundary."""
    progress("stable K in a hand")
    hand = Operator(0.5, 3.0, 0.0)
    return row(
        "largest stable K, in a hand of 0.5 kg and 3 N.s/m, b = 1 N.s/m, delay Ts | linear "
        "condition | the hand's damping counts as the device's | N/m",
        (rule(1.0 + hand.damper, 0.0, 1.0), _by_runs(_wall(1.0, 1.0, hand), 0.0)[0], RULE),
        FORMULA,
        "b of the rule is that of device and hand together; no mass is in it",
    )


def _boundary(quick: bool, progress: Progress) -> tuple[list[Row], Chart]:
    """The whole boundary, including where the rule fails."""
    rows, curves, unit = [], [], MASS / TS
    shares = (0.1, 0.4) if quick else (0.1, 0.4, 0.8)
    for delay in (0.0, 1.0) if quick else (0.0, 1.0, 2.0):
        progress(f"boundary at a delay of {delay:g} samples")
        B, K = wall_limits.hulin_boundary(MASS, 0.0, TS, delay)
        curves.append(curve(f"delay {delay:g} Ts: exact", B / unit, K * TS / unit))
        tried = np.array([x for x in shares if x * unit < 0.9 * B.max()])
        found = _by_runs(_wall(0.0, delay), *(tried * unit))
        curves.append(curve("", tried, np.array(found) * TS / unit, "marks"))
        expected = [float(np.interp(x * unit, B, K)) for x in tried]
        gap = max(abs(a / e - 1.0) for a, e in zip(found, expected, strict=True))
        rows.append(
            row(
                f"largest gap between runs and the exact boundary, delay {delay:g} Ts | boundary "
                "in the plane of B and K | a curve | 1",
                (0.0, gap, GROWTH),
                FORMULA,
                f"B Ts/m of {', '.join(f'{x:g}' for x in tried)}; poles at exp(±j omega Ts), "
                "derived in equations.md, section 7",
            )
        )
        tangent = np.linspace(0.0, 0.25 * B.max() / unit, 2)
        line = np.array([rule(0.0, x * unit, delay) for x in tangent])
        curves.append(curve("", tangent, line * TS / unit, "dashed"))
    chart = Chart(
        "boundary",
        "Boundary of stability",
        "Without physical damping, in the units of mass and sample: lines are exact, dashed lines "
        "the linear rule, marks runs.",
        "virtual damping B Ts/m",
        "virtual stiffness K Ts^2/m",
        tuple(curves),
    )
    return rows, chart


def make(quick: bool, progress: Progress) -> Found:
    rows = _rule_rows(quick, progress)
    if not quick:
        rows.append(_hand_row(progress))
    far = 0.4 * MASS / TS
    boundary, chart = _boundary(quick, progress)
    progress("where the rule ends")
    ours = _by_runs(_wall(0.0, 0.0), far)[0]
    rows.append(
        holds(
            "far from low damping the boundary is no line | abstract of Gil et al. 2009 | the "
            "shape is quite complex; relatively low damping is assumed",
            ours < 0.8 * rule(0.0, far, 0.0),
            QUOTED,
            f"B Ts/m = 0.4, no delay: runs end at {ours:.4g} N/m, the rule at "
            f"{rule(0.0, far, 0.0):.4g}",
        )
    )
    c = 0.4
    rows.append(
        row(
            "largest stable K without delay and physical damping, B Ts/m = 0.4 | none | "
            "2 c (2 - c)/(2 + c) m/Ts², c = B Ts/m | N/m",
            (2.0 * c * (2.0 - c) / (2.0 + c) * MASS / TS**2, ours, GROWTH),
            BESIDE,
            "Jury's conditions for this case, in closed form; replaces the linear rule",
        )
    )
    return Found((*rows, *boundary), (chart,))


CLASSIC = Classic(
    "hulin2006",
    "Stability with delay, damping and a hand",
    "T. Hulin, C. Preusche, G. Hirzinger, Stability boundary for haptic rendering: influence of "
    "physical damping, IEEE/RSJ Int. Conf. Intelligent Robots and Systems (2006) 1570-1575; "
    "J. J. Gil, E. Sanchez, T. Hulin, C. Preusche, G. Hirzinger, Stability boundary for haptic "
    "rendering: influence of damping and delay, J. Computing and Information Science in "
    "Engineering 9 (2009) 011005",
    "The abstract of 2009 could be read (asmedigitalcollection.asme.org): boundaries of quite "
    "complex shape, and a new linear condition for short delays, fast sampling and relatively low "
    "damping. The figures of both and their numbers could not; the condition "
    "K < (b + B)/(Ts/2 + td) and the exact boundary are derived in equations.md, section 7.",
    "A wall is stable if the oscillation of a run decays. A search finds the K at which its growth "
    "rate is zero; of rule and boundary it uses a starting point alone.",
    make,
)
