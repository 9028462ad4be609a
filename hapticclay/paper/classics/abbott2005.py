"""Abbott and Okamura 2005: passive walls depend on damping, friction and encoder."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...scene.virtual_wall import Device, VirtualWall
from ...studies.chart import Chart, curve
from ...studies.port_energy import passivity_limit, taken_energy, zigzag
from ..ledger import Row, row
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Progress, holds

MASS, DAMPER, FRICTION, TS = 0.1, 5.0, 0.05, 1e-3  # kg, N.s/m, N, s
QUANTA = (4e-6, 1e-5, 2e-5, 4e-5)  # [m]
QUICK_QUANTA = (4e-6, 2e-5)
LIMIT_ERROR = 0.01  # share: friction along the large path, damping along the small one
ENERGY = 0.02  # share: friction that reverses in one of 32 steps, relative to the remainder
LARGE, SMALL_SHARE = 2e-3, 0.01  # [m] and of the quantum: amplitudes of the two zigzags


def _wall(quantum: float, K: float = 0.0) -> VirtualWall:
    return VirtualWall(K=K, device=Device(MASS, DAMPER, FRICTION, quantum), Ts=TS)


def bound(quantum: float) -> float:
    """K = min(2 b/Ts, 2 fc/Delta) [N/m]."""
    return min(2.0 * DAMPER / TS, 2.0 * FRICTION / quantum)


def _energies(wall: VirtualWall) -> tuple[float, float]:
    """Energy absorbed per period in runs along a large and a small zigzag [J]."""
    quantum = wall.device.quantum
    large = zigzag(round(LARGE / quantum) * quantum)
    small = zigzag(SMALL_SHARE * quantum, 0.5 * quantum)  # around an encoder edge
    return taken_energy(wall, large), taken_energy(wall, small)


def _modes(progress: Progress) -> list[Row]:
    """The two modes; each can be active while the other is passive."""
    progress("the two modes")
    damped, rubbed = _wall(4e-6, 1.2 * 2.0 * DAMPER / TS), _wall(4e-5, 1.2 * 2.0 * FRICTION / 4e-5)
    rows = []
    for wall, name, active in (
        (damped, "K above 2 b/Ts, below 2 fc/Delta: large motions alone are active", 0),
        (rubbed, "K above 2 fc/Delta, below 2 b/Ts: small motions alone are active", 1),
    ):
        energy = _energies(wall)
        rows.append(
            holds(
                f"{name} | abstract | nonpassive behavior in two decoupled modes",
                energy[active] < 0.0 < energy[1 - active],
                QUOTED,
                f"K = {wall.K:g} N/m, Delta = {1e6 * wall.device.quantum:g} um: energy along a "
                f"large zigzag {energy[0]:.3g} J, about an edge of the encoder {energy[1]:.3g} J",
            )
        )
        a = SMALL_SHARE * wall.device.quantum
        edge = 2.0 * (4.0 * DAMPER * a * a / TS + 2.0 * FRICTION * a - wall.K * 2.0 * a * 0.5
                      * wall.device.quantum)  # fmt: skip
        rows.append(
            row(
                f"energy about an edge of the encoder, K = {wall.K:g} N/m, Delta = "
                f"{1e6 * wall.device.quantum:g} um | none | 4 b a²/Ts + 2 a fc - K Delta a a "
                "sample | J",
                (edge, energy[1], ENERGY),
                BESIDE,
                "derived in equations.md, section 7: the wall's force jumps by K Delta",
            )
        )
    return rows


def make(quick: bool, progress: Progress) -> Found:
    rows, found = [], []
    for quantum in QUICK_QUANTA if quick else QUANTA:
        progress(f"largest passive K: Delta = {1e6 * quantum:g} um")
        found.append(passivity_limit(_wall(quantum)))
        rows.append(
            row(
                f"largest passive K, Delta = {1e6 * quantum:g} um | main result | "
                "min(2 b/Ts, 2 fc/Delta) | N/m",
                (bound(quantum), found[-1], LIMIT_ERROR),
                FORMULA,
                f"b = {DAMPER:g} N.s/m, fc = {FRICTION:g} N, Ts = {1e3 * TS:g} ms; searched for "
                "by runs along a large and a small zigzag of a hand",
            )
        )
    rows += _modes(progress)
    if not quick:
        progress("without an encoder")
        exact = passivity_limit(replace(_wall(1e-5), device=Device(MASS, DAMPER)))
        rows.append(
            row(
                "largest passive K without encoder and friction | main result | 2 b/Ts | N/m",
                (2.0 * DAMPER / TS, exact, LIMIT_ERROR),
                FORMULA,
                "the limit of Colgate and Schenkel",
            )
        )
    tried = QUICK_QUANTA if quick else QUANTA
    line = np.geomspace(2e-6, 8e-5, 81)
    chart = Chart(
        "quantum",
        "Passive walls over the encoder's quantum",
        "Left of the corner physical damping decides, right of it friction.",
        "quantum Delta [um]",
        "largest passive stiffness K [N/m]",
        (
            curve("min(2 b/Ts, 2 fc/Delta)", 1e6 * line, [bound(x) for x in line]),
            curve("runs: worst of two paths", 1e6 * np.array(tried), found, "marks"),
        ),
        "xy",
    )
    return Found(tuple(rows), (chart,))


CLASSIC = Classic(
    "abbott2005",
    "Encoder, friction and the stiffness of a wall",
    "J. J. Abbott, A. M. Okamura, Effects of position quantization and sampling rate on virtual-"
    "wall passivity, IEEE Trans. Robotics 21 (2005) 952-964",
    "Its abstract could be read (fdocuments.in, manuscript.isc.ac): a necessary and sufficient "
    "condition that relies on Coulomb friction and encoder resolution, and two decoupled modes in "
    "experiments. Figures and device parameters could not; the condition K <= min(2 b/Ts, "
    "2 fc/Delta) is derived in equations.md, section 7. The device here is ours.",
    "A hand moves the device along a zigzag far larger than the quantum, and along one of a "
    "hundredth of it about an edge of the encoder; the energy of each run is integrated, and K is "
    "searched for at which it changes its sign.",
    make,
)
