"""Hannaford and Ryu 2002: an energy observer and a damper keep a wall passive."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...formulas.hardware import passivity_controller
from ...model.operator import Operator
from ...model.sampled_controller import Controller
from ...model.shapes import Constant
from ...scene.virtual_wall import UPRIGHT, Device, VirtualWall
from ...simulation.record import Record
from ...simulation.simulate import simulate
from ...studies.chart import Chart, curve
from ..ledger import Row, row
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Progress, holds

MASS, DAMPER, TS = 1.0, 1.0, 1e-3  # kg, N.s/m, s
HAND = Operator(0.2, 5.0, 100.0)
PRESS, SPEED, START = 2.0, 0.05, -0.002  # N, m/s, m: the handle meets the wall at x = 0
STIFF, DELAY, SOFT = 1e5, 15, 1e3  # N/m, samples, and N/m of the delayed wall
T_MAX = 2.0  # [s]
STEPS = 4  # engine steps per sample
PLAIN, PUBLISHED, FREE, OURS = 0.0, 1.0, 2.0, 3.0  # damper: none, bounded, unbounded, ours
MOST_DAMPING = 0.5  # of mass/Ts: the damper halves the speed within a sample
LAST = 0.2  # share of a run by which the handle must rest
REST = 0.1  # ratio of the largest speed there to that of the run
OBSERVED = 1e-3  # share: the hand's spring over a sample is evaluated at the mean of its ends


def observed_wall(t, q, qd, fh, state, params):
    """Control law of a delayed one-sided wall with a passivity observer and controller."""
    K, lever, Ts, damper, W = params
    x, v = lever * (UPRIGHT - q[0]), -lever * qd[0]
    energy = state[0] + state[2] * (x - state[1]) * state[3]
    coming = state[4:] + (K * x if x > 0.0 else 0.0,)
    f = coming[0]
    if damper == 3.0:
        f = passivity_controller(energy, f, v, Ts, W)
    elif damper > 0.0 and energy < 0.0 and v != 0.0:
        alpha = -energy / (Ts * v * v)
        f += (alpha if damper == 2.0 else min(alpha, 0.5 / (W * Ts))) * v
    return (lever * f, 0.0), (energy, x, f, 1.0) + coming[1:]


@dataclass(frozen=True, eq=False)
class Contact:
    """A run against the wall, and the energy seen by its observer."""

    record: Record  # one row per sample
    force: np.ndarray  # [N] of the wall, held, shape (n,)

    @property
    def energy(self) -> np.ndarray:
        """Energy that the wall has taken by each sample, held force by displacement [J], (n,)."""
        return np.append(0.0, np.cumsum(self.force[:-1] * np.diff(self.record.p[:, 0])))

    @property
    def rest(self) -> float:
        """Ratio of the largest speed in the last part of the run to the largest of the run."""
        v = np.abs(self.record.v[:, 0])
        if self.record.outcome.code != "time limit":
            return 1.0
        return float(v[math.floor((1.0 - LAST) * len(v)) :].max() / v.max())


def contact(K: float, damper: float, delay: int = 0) -> Contact:
    """Runs a device and a hand that press against a wall."""
    wall = VirtualWall(device=Device(MASS, DAMPER), Ts=TS, operator=HAND, velocity="exact")
    push = Constant((PRESS, 0.0))
    scenario = wall.scenario(T_MAX, push=SPEED, start=START, steps=STEPS, muscle=push)
    assert scenario.controller is not None
    lever = scenario.controller.params[3]
    params = (K, lever, TS, damper, 1.0 / (MASS + HAND.mass))
    law = Controller(observed_wall, state=(0.0,) * (4 + delay), params=params)
    record = simulate(replace(scenario, controller=law), every=STEPS)
    return Contact(record, _balance(record))


def _balance(record: Record) -> np.ndarray:
    """Force of the wall over each sample, from the change of momentum of device and hand [N].

    It is the force that remains after muscle, springs and dampers. It comes from the motion, not
    from the law, so that the energy balance is independent of the observer's sum.
    """
    x, v = record.p[:, 0], record.v[:, 0]
    way, change = np.diff(x), np.diff(v)
    impulse = PRESS * TS - (DAMPER + HAND.damper) * way - HAND.spring * TS * 0.5 * (x[1:] + x[:-1])
    return np.append((impulse - (MASS + HAND.mass) * change) / TS, 0.0)


def _claims(quick: bool, progress: Progress) -> tuple[list[Row], dict[str, Contact]]:
    rows: list[Row] = []
    shown: dict[str, Contact] = {}
    cases = [(STIFF, 0, "a wall of 100 N/mm", "stiffness > 100 N/mm")]
    if not quick:
        cases += [
            (2.0 * STIFF, 0, "a wall of 200 N/mm", "stiffness > 100 N/mm"),
            (SOFT, DELAY, "a wall of 1 N/mm that is 15 ms late", "time delays of 15 ms"),
            (10.0 * SOFT, DELAY, "a wall of 10 N/mm that is 15 ms late", "time delays of 15 ms"),
        ]
    for K, delay, what, printed in cases:
        progress(what)
        plain, damped, ours = (contact(K, x, delay) for x in (PLAIN, PUBLISHED, OURS))
        if not shown:
            shown = {"without": plain, "with": damped}
        speeds = f"last over largest speed {plain.rest:.2g} without, {damped.rest:.2g} with"
        rows += [
            holds(
                f"{what} does not come to rest without the controller | abstract | {printed}",
                plain.rest > 0.3 and float(plain.energy.min()) < 0.0,
                QUOTED,
                f"{speeds}; it has given {-1e3 * plain.energy.min():.3g} mJ",
            ),
            holds(
                f"{what} is stable with the controller | abstract | totally stable: {printed}",
                damped.rest < REST,
                QUOTED,
                f"{speeds}; the damper is bounded at {MOST_DAMPING:g} m/Ts",
            ),
            holds(
                f"{what} is stable with this package's controller | none | not in the source",
                ours.rest < REST,
                BESIDE,
                f"`Hardware(passivity=True)`, which counts in the hold: last over largest speed "
                f"{ours.rest:.2g}",
            ),
        ]
    return rows, shown


def _observer(plain: Contact) -> Row:
    """The observer's sum compared with the energy balance of the motion."""
    K, x = STIFF, plain.record.p[:, 0]
    held = K * np.maximum(x, 0.0)
    seen = float(np.sum(held[:-1] * np.diff(x)))
    return row(
        "energy by the observer at the end, without controller | passivity observer | sum of f v "
        "dT | J",
        (float(plain.energy[-1]), seen, OBSERVED),
        FORMULA,
        "held force times the way, beside the energy that momentum, muscle, spring and dampers of "
        "the run leave over",
    )


def make(quick: bool, progress: Progress) -> Found:
    rows, shown = _claims(quick, progress)
    plain, damped = shown["without"], shown["with"]
    rows.append(_observer(plain))
    progress("without a bound on the damper")
    free = contact(STIFF, FREE)
    rows.append(
        holds(
            "the damper -E/(dT v²) needs a bound under a hold | none | not in what could be read",
            free.rest > REST,
            BESIDE,
            f"without one it overshoots at low speed: the run ends {free.record.status}",
        )
    )
    t = 1e3 * plain.record.t
    chart = Chart(
        "energy",
        "Energy that a wall of 100 N/mm has taken",
        "Where it is negative the wall has given energy to the hand.",
        "time [ms]",
        "energy taken by the wall [mJ]",
        (
            curve("without controller", t, 1e3 * plain.energy, "dashed"),
            curve("with controller", t, 1e3 * damped.energy),
        ),
    )
    return Found(tuple(rows), (chart,))


CLASSIC = Classic(
    "hannaford2002",
    "Passivity observer and controller",
    "B. Hannaford, J.-H. Ryu, Time-domain passivity control of haptic interfaces, IEEE Trans. "
    "Robotics and Automation 18 (2002) 1-10",
    "Its abstract could be read (scilit.net): totally stable operation at stiffness > 100 N/mm or "
    "delays of 15 ms, on the Excalibur interface. Its figures and the mass of Excalibur could not; "
    "the device here, 1 kg and 1 N.s/m, is ours.",
    "A device in a hand meets a wall at 50 mm/s and is pressed with 2 N. The controller is a "
    "sampled law as published, alpha = -E/(dT v²), with a bound. It is stable if the speed in the "
    "last fifth of the run is below a tenth of the largest; energy is that of the motion.",
    make,
)
