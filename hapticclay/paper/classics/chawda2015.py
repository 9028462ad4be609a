"""Chawda, Celik and O'Malley 2015: cut-off of the velocity filter and Z-width."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...scene.virtual_wall import Device, VirtualWall
from ...studies.chart import Chart, Curve, curve
from ...studies.port_energy import passivity_limit
from ...studies.wall_runs import PRESS, stiffest, unshown
from ...theory import wall_limits
from ..ledger import Row, row
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Tell, holds

MASS, DAMPER, FRICTION, QUANTUM, TS = 0.1, 0.5, 0.05, 2e-5, 1e-3  # kg, N.s/m, N, m, s
ROUGH = VirtualWall(device=Device(MASS, DAMPER, FRICTION, QUANTUM), Ts=TS)
SMOOTH = VirtualWall(device=Device(MASS, DAMPER), Ts=TS)
Cutoffs = tuple[float | None, ...]
CUTOFFS: Cutoffs = (10.0, 30.0, 100.0, 300.0, None)  # [Hz]
QUICK_CUTOFFS: Cutoffs = (10.0, 30.0, None)
NYQUIST = 0.5 / TS  # [Hz] at which "no filter" is drawn
AROUND, SOFTEST = 3000.0, 100.0  # [N/m] start of searches
AT_B = 10.0  # [N.s/m] damping at which K is compared
B = (0.0, 1.0, 3.0, AT_B, 20.0, 30.0)
FOUND = 5e-3  # share: test paths are not infinitely slow
MARGIN = 1.05  # ratio that separates an optimum from the irregular limit of a rough device


def _names(cutoffs: Cutoffs) -> str:
    return ", ".join("none" if f is None else f"{f:g} Hz" for f in cutoffs)


def _stiffest(wall: VirtualWall, cutoffs: Cutoffs, B: tuple[float, ...]) -> list[list[float]]:
    """Largest stable K for each cut-off and B, from runs [N/m]."""
    families = ([replace(wall, velocity_filter=f, B=x) for x in B] for f in cutoffs)
    return [stiffest(walls, [AROUND] * len(B), SOFTEST, PRESS, unshown) for walls in families]


def _words(cutoffs: Cutoffs, K: list[float]) -> str:
    numbers = ", ".join(f"{x:.4g}" for x in K)
    return f"K at B = {AT_B:g} N.s/m for cut-offs of {_names(cutoffs)}: {numbers} N/m"


def _trade_off(quick: bool, tell: Tell) -> tuple[list[Row], tuple[Curve, ...]]:
    """The trade-off of a filter: phase lag alone, and phase lag with noise."""
    cutoffs, dampings = (QUICK_CUTOFFS, (AT_B,)) if quick else (CUTOFFS, B)
    tell("cut-offs, exact position")
    smooth = [K[0] for K in _stiffest(SMOOTH, cutoffs, (AT_B,))]
    tell("cut-offs, encoder and friction")
    regions = _stiffest(ROUGH, cutoffs, dampings)
    rough = [K[dampings.index(AT_B)] for K in regions]
    best = max(range(len(rough)), key=rough.__getitem__)
    rows = [
        holds(
            "a filter delays: with an exact position a higher cut-off is always better | text of "
            "the introduction | the cut-off determines the phase distortion",
            smooth == sorted(smooth),
            QUOTED,
            _words(cutoffs, smooth),
        ),
        holds(
            "at B = 10 N.s/m, with an encoder, a middle cut-off is best | abstract | "
            "there exists such an ideal cut-off frequency",
            rough[best] > MARGIN * max(rough[0], rough[-1]),
            QUOTED,
            f"{_words(cutoffs, rough)}; fc = {FRICTION:g} N, Delta = {1e6 * QUANTUM:g} um; the "
            "edge is ragged",
        ),
    ]
    if not quick:
        areas = [float(np.trapezoid(K, dampings)) for K in regions]
        rows.append(
            row(
                "area of the Z-width at the best cut-off over that without a filter | abstract | "
                "not in what could be read | 1",
                (None, max(areas[:-1]) / areas[-1], None),
                BESIDE,
                f"areas for {_names(cutoffs)}: "
                + ", ".join(f"{a:.3g}" for a in areas)
                + f" N².s/m², B up to {B[-1]:g} N.s/m: the optimum is flat, and moves with B",
            )
        )
    shown = [NYQUIST if f is None else f for f in cutoffs]
    return rows, (
        curve("exact position", shown, smooth, "dashed"),
        curve("runs: encoder and friction", shown, rough, "marks"),
    )


def make(quick: bool, tell: Tell) -> Found:
    """Makes the runs.

    Args:
        quick: three cut-offs at one damping.
        tell: called with the name of each step.
    """
    rows, curves = _trade_off(quick, tell)
    for cutoff in (50.0,) if quick else (20.0, 50.0, 200.0):
        tell(f"passive K behind a filter of {cutoff:g} Hz")
        wall = replace(SMOOTH, B=0.3, velocity_filter=cutoff)
        rows.append(
            row(
                f"largest passive K, B = {wall.B:g} N.s/m behind a filter of {cutoff:g} Hz | Brown "
                "1995, appendix A | passivity with a filtered velocity | N/m",
                (wall_limits.colgate_schenkel_limit(wall), passivity_limit(wall, 8), FOUND),
                FORMULA,
                "criterion of Colgate and Schenkel with the filter in H(z), beside energy of runs",
            )
        )
    chart = Chart(
        "cutoff",
        "Stiffest wall over the cut-off of the velocity filter",
        f"B = {AT_B:g} N.s/m; the last point is without a filter.",
        "cut-off [Hz]",
        "largest stable stiffness K [N/m]",
        curves,
        "xy",
    )
    return Found(tuple(rows), (chart,))


CLASSIC = Classic(
    "chawda2015",
    "Velocity filters and the Z-width",
    "V. Chawda, O. Celik, M. K. O'Malley, A method for selecting velocity filter cut-off frequency "
    "for maximizing impedance width performance in haptic interfaces, J. Dynamic Systems, "
    "Measurement, and Control 137 (2015) 024503",
    "Abstract and introduction could be read (studylib.net): a finite difference behind a low-pass "
    "filter has an ideal cut-off that maximizes the Z-width, and a simulation predicts it. The "
    "identified parameters of their interface and the cut-off they found could not; the device "
    "here is ours.",
    "A wall is stable if it comes to rest, to 1 um, after a push of 50 mm/s and under 1 N; without "
    "encoder and friction, if the oscillation of a run decays. K is searched for at each B and "
    "cut-off.",
    make,
)
