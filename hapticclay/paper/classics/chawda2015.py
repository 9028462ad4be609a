"""Chawda, Celik and O'Malley 2015: cut-off of the velocity filter and Z-width."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...scene.virtual_wall import Device, VirtualWall
from ...studies.chart import Chart, curve
from ...studies.port_energy import passivity_limit
from ...studies.wall import STILL
from ...studies.wall_runs import Press, stiffest, unshown
from ...theory import wall_limits
from ..ledger import Row, row
from .classic import BESIDE, QUOTED, Classic, Found, Progress, holds

MASS, DAMPER, FRICTION, TS = 0.1, 0.5, 0.05, 1e-3  # kg, N.s/m, N, s
B = 10.0  # [N.s/m] damping at which K is compared
SMOOTH = VirtualWall(B=B, device=Device(MASS, DAMPER), Ts=TS)
Cutoffs = tuple[float | None, ...]
CUTOFFS: Cutoffs = (5.0, 10.0, 20.0, 30.0, 50.0, 70.0, 100.0, 200.0, 300.0, None)  # [Hz]
QUICK_CUTOFFS: Cutoffs = (10.0, 30.0, None)
QUANTA, MIDDLE = (5e-6, 2e-5, 4e-5), 2e-5  # [m] counts of encoders; that of the quick runs
NYQUIST = 0.5 / TS  # [Hz] at which "no filter" is drawn
AROUND, SOFTEST = 3000.0, 100.0  # [N/m] start of searches
PRESSES = (  # a limit cycle is reached after some pushes and not after others
    Press(1.0, 0.05, STILL),
    Press(1.0, 0.02, STILL),
    Press(1.0, 0.1, STILL),
    Press(0.5, 0.05, STILL),
    Press(2.0, 0.05, STILL),
)
AREA_B = (0.0, 2.0, 5.0, B, 20.0, 30.0)  # [N.s/m]
AREA_CUTOFFS: Cutoffs = (10.0, 20.0, 30.0, 50.0, 100.0, None)
GROWTH = 3e-3  # share: bisection of the growth rate, and steps of the engine
LIMIT_ERROR = 5e-3  # share: test paths are not infinitely slow
MARGIN = 1.05  # ratio that separates an optimum from the irregular limit of a rough device


def _name(cutoff: float | None) -> str:
    return "none" if cutoff is None else f"{cutoff:g} Hz"


def _listed(cutoffs: Cutoffs, K: Sequence[float]) -> str:
    pairs = zip(cutoffs, K, strict=True)
    return ", ".join(f"{_name(f)} {x:.4g}" for f, x in pairs)


def _rough(quantum: float) -> VirtualWall:
    return replace(SMOOTH, device=Device(MASS, DAMPER, FRICTION, quantum))


def _resting(wall: VirtualWall, cutoff: float | None, dampings: Sequence[float]) -> list[float]:
    """Largest K at each B that comes to rest after every push of `PRESSES`, from runs [N/m]."""
    walls = [replace(wall, velocity_filter=cutoff, B=x) for x in dampings]
    around = [AROUND] * len(walls)
    tried = [stiffest(walls, around, SOFTEST, press, unshown) for press in PRESSES]
    return [min(K) for K in zip(*tried, strict=True)]


def _exact(cutoff: float | None) -> float:
    """Largest stable K of the linear loop with an exact position, from eigenvalues [N/m]."""
    return wall_limits.stiffness_band(replace(SMOOTH, velocity_filter=cutoff))[1]


def _lag(cutoffs: Cutoffs, progress: Progress) -> tuple[list[Row], list[float]]:
    """Phase lag alone: runs with an exact position, beside the eigenvalues."""
    progress("cut-offs, exact position")
    walls = [replace(SMOOTH, velocity_filter=f) for f in cutoffs]
    found = [stiffest([w], [AROUND], SOFTEST, PRESSES[0], unshown)[0] for w in walls]
    rows = [
        holds(
            "a filter delays: with an exact position a higher cut-off is always better | text of "
            "the introduction | the cut-off determines the phase distortion",
            found == sorted(found),
            QUOTED,
            f"K at B = {B:g} N.s/m: {_listed(cutoffs, found)} N/m",
        )
    ]
    for f, K in zip(cutoffs, found, strict=True):
        rows.append(
            row(
                f"largest stable K, exact position, filter {_name(f)} | none | poles of the "
                "sampled loop with the filter | N/m",
                (_exact(f), K, GROWTH),
                BESIDE,
                "eigenvalues beside the growth of runs",
            )
        )
    return rows, found


def _noise(
    cutoffs: Cutoffs, quanta: Sequence[float], progress: Progress
) -> tuple[list[Row], dict[float, list[float]]]:
    """Phase lag and quantization: largest K over the cut-off, for each encoder."""
    found = {}
    for quantum in quanta:
        progress(f"cut-offs, encoder of {1e6 * quantum:g} um and friction")
        found[quantum] = [_resting(_rough(quantum), f, (B,))[0] for f in cutoffs]
    K = found[MIDDLE]
    rows = [
        holds(
            f"at B = {B:g} N.s/m, with an encoder of {1e6 * MIDDLE:g} um, a middle cut-off is best "
            "| abstract | there exists such an ideal cut-off frequency",
            max(K[1:-1]) > MARGIN * max(K[0], K[-1]),
            QUOTED,
            f"K with fc = {FRICTION:g} N: {_listed(cutoffs, K)} N/m",
        )
    ]
    best = {q: cutoffs[max(range(len(x)), key=x.__getitem__)] for q, x in found.items()}
    if len(best) > 1:
        order = [NYQUIST if f is None else f for f in best.values()]
        words = ", ".join(f"{1e6 * q:g} um: {_name(f)}" for q, f in best.items())
        rows.append(
            holds(
                "the coarser the encoder, the lower the ideal cut-off | none | not in what could "
                "be read",
                all(a > b for a, b in pairwise(order)),
                BESIDE,
                f"best of those tried, at B = {B:g} N.s/m; {words}. Where 2 fc/Delta is above the "
                "limit of the lag (5 um), no filter is best",
            )
        )
    return rows, found


def _area(progress: Progress) -> Row:
    """Area of the Z-width over the cut-off."""
    progress("areas of the Z-width")
    wall = _rough(MIDDLE)
    areas = [float(np.trapezoid(_resting(wall, f, AREA_B), AREA_B)) for f in AREA_CUTOFFS]
    return row(
        f"area of the Z-width at the best cut-off over that without a filter, {1e6 * MIDDLE:g} um "
        "| abstract | not in what could be read | 1",
        (None, max(areas[:-1]) / areas[-1], None),
        BESIDE,
        f"areas up to B = {AREA_B[-1]:g} N.s/m: "
        + ", ".join(f"{_name(f)} {a:.3g}" for f, a in zip(AREA_CUTOFFS, areas, strict=True))
        + " N².s/m². The claim of the source is of the Z-width; by area, up to this B, no cut-off "
        "of this device is clearly better than no filter",
    )


def _passive(cutoff: float) -> Row:
    wall = replace(SMOOTH, B=0.3, velocity_filter=cutoff)
    return row(
        f"largest passive K, B = {wall.B:g} N.s/m behind a filter of {cutoff:g} Hz | none | "
        "criterion of Colgate and Schenkel 1997, with the filter in H(z) | N/m",
        (wall_limits.colgate_schenkel_limit(wall), passivity_limit(wall, 8), LIMIT_ERROR),
        BESIDE,
        "beside energy of runs; the criterion is that of the page colgate1997",
    )


def _chart(cutoffs: Cutoffs, smooth: list[float], rough: dict[float, list[float]]) -> Chart:
    grid = np.geomspace(cutoffs[0] or NYQUIST, NYQUIST, 61)
    shown = [NYQUIST if f is None else f for f in cutoffs]
    curves = [
        curve("eigenvalues, exact position", grid, [_exact(float(f)) for f in grid]),
        curve("runs, exact position", shown, smooth, "marks"),
    ]
    for quantum, K in rough.items():
        if quantum < MIDDLE:
            continue  # its marks lie on those of an exact position
        name, most = f"{1e6 * quantum:g} um", 2.0 * FRICTION / quantum
        curves.append(curve(f"2 fc/Delta, {name}", grid[[0, -1]], [most, most], "dashed"))
        curves.append(curve(f"runs, {name}", shown, K, "marks"))
    return Chart(
        "cutoff",
        "Stiffest wall over the cut-off of the velocity filter",
        f"B = {B:g} N.s/m, fc = {FRICTION:g} N; marks at {NYQUIST:g} Hz are without a filter. Left "
        "the lag of the filter limits the wall, right the encoder: the limit is near 2 fc/Delta, "
        "which Abbott and Okamura give for B = 0, or below it, since B adds jumps of the velocity.",
        "cut-off [Hz]",
        "largest stable stiffness K [N/m]",
        tuple(curves),
        "xy",
    )


def make(quick: bool, progress: Progress) -> Found:
    cutoffs, quanta = (QUICK_CUTOFFS, (MIDDLE,)) if quick else (CUTOFFS, QUANTA)
    lag, smooth = _lag(cutoffs, progress)
    noise, rough = _noise(cutoffs, quanta, progress)
    rows = [*lag, *noise]
    if not quick:
        rows.append(_area(progress))
    for cutoff in (50.0,) if quick else (20.0, 50.0, 200.0):
        progress(f"passive K behind a filter of {cutoff:g} Hz")
        rows.append(_passive(cutoff))
    return Found(tuple(rows), (_chart(cutoffs, smooth, rough),))


CLASSIC = Classic(
    "chawda2015",
    "Velocity filters and the Z-width",
    "V. Chawda, O. Celik, M. K. O'Malley, A method for selecting velocity filter cut-off frequency "
    "for maximizing impedance width performance in haptic interfaces, J. Dynamic Systems, "
    "Measurement, and Control 137 (2015) 024503",
    "Abstract and the beginning of the introduction could be read (asmedigitalcollection.asme.org, "
    "studylib.net): a finite difference behind a low-pass filter has an ideal cut-off that "
    "maximizes the Z-width, and a simulation of an identified model predicts it. Order and form of "
    "their filter, their criterion of stability, the identified mass, damping, friction and "
    "resolution, their figures, and the cut-off they found could not be read, and no formula for "
    "it is in what could be. They are not imitated: the device here is ours and its filter is of "
    "first order. What is compared is that an ideal cut-off exists, and why; not where theirs "
    "lies. Their claim is of the whole Z-width: here it holds at a given damping B, and by area it "
    "is not confirmed (last table).",
    "A wall is stable if it comes to rest, to 1 um, after each of five pushes: at 50 mm/s under "
    "0.5, 1 and 2 N, at 20 and 100 mm/s under 1 N. One push is not enough: whether a limit cycle "
    "of about a count is reached depends on the push. Without encoder and friction it is stable if "
    "the oscillation of a run decays. K is searched for at each cut-off.",
    make,
)
