"""Ryu, Kwon and Hannaford 2004: energy observed at both ends keeps a pair passive."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...model.operator import Operator
from ...scene.virtual_wall import Device
from ...studies.chart import Chart, curve
from ..ledger import Row, row
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Progress, holds
from .hard_contact import WalledArm

LEADER, FOLLOWER = Device(0.3, 1.0), Device(1.0, 1.0)  # kg, N.s/m
HAND = Operator(0.2, 5.0, 100.0)
PUSH, START, SPEED = 2.0, -0.002, 0.05  # N, m, m/s: the wall stands at x = 0
KP, KD, TS = 2000.0, 20.0, 1e-3  # N/m, N.s/m, s
HARD, HARDER = 1.5e5, 3e5  # N/m
OTHERS = ((1e3, SPEED), (1e4, SPEED), (HARD, 0.02), (HARD, 0.2))  # N/m and m/s
MOST_DAMPING = 0.5  # of mass/Ts: a damper halves the speed within a sample, no more
T_MAX, LAST, REST = 2.0, 0.2, 0.1  # s; share of a run by which both arms rest, at this share
PARTS = 16  # of a sample: the energy of dampers is summed up over them
BY_MOTION = 1e-5  # share: Simpson's rule over a sixteenth of a sample
TOO_FAST = 20.0  # [m/s] at which a run has diverged
SOFT, SLACK = 1e3, 500.0  # N/m: wall and follower's gain of late pairs
DELAYS = (50, 100)  # samples, one way
RESERVE, LATE_T = 0.01, 8.0  # J and s
BEFORE_SEEN = 0.1  # share of the reserves that comes out in the samples before it is observed
FAR, AMPLE = -0.05, 0.1  # [m] from the wall, at rest, and J: a reserve for the way
Control = Literal["none", "observer", "sides"]


@dataclass(eq=False)
class Teleoperation:
    """Position-force: the follower follows, the leader feels the wall.

    control: "observer": one observer of both ends, dampers where energy comes out, as published;
    "sides": an observer at each end, which lets out what came in at the other, a delay before, and
    a reserve; "none".
    """

    wall: float
    control: Control
    delay: int = 0
    reserve: float = 0.0
    Kp: float = KP
    start: float = START
    speed: float = SPEED
    time: float = T_MAX
    x: list[tuple[float, float]] = field(default_factory=list)
    v: list[tuple[float, float]] = field(default_factory=list)
    energy: list[float] = field(default_factory=list)  # taken by link and controllers [J]
    motion: list[float] = field(default_factory=list)  # the same, from the motion of both arms

    def __post_init__(self):
        self.arms = (
            WalledArm(LEADER.mass + HAND.mass, LEADER.damper + HAND.damper, HAND.spring),
            WalledArm(FOLLOWER.mass, FOLLOWER.damper, 0.0, self.wall),
        )
        for arm in self.arms:
            arm.x, arm.v = self.start, self.speed
        self.out, self.into, self.total = [0.0, 0.0], [0.0, 0.0], 0.0
        self.spent, self.first = 0.0, self._held()
        self._run()

    def _run(self) -> None:
        arms, forces = self.arms, (0.0, 0.0)
        there = deque([(self.start, self.speed, 0.0)] * self.delay)
        back = deque([(0.0, 0.0)] * self.delay)
        before = tuple(arm.x for arm in arms)
        for _ in range(round(self.time / TS)):
            self._observe(forces, [arm.x - x for arm, x in zip(arms, before, strict=True)])
            before = tuple(arm.x for arm in arms)
            self._record()
            there.append((arms[0].x, arms[0].v, self.into[0]))
            back.append((arms[1].touch, self.into[1]))
            (x, v, into_leader), (touch, into_follower) = there.popleft(), back.popleft()
            wanted = (-touch, self.Kp * (x - arms[1].x) + KD * (v - arms[1].v))
            forces = self._damped(wanted, (into_follower, into_leader))
            self._move(forces)
            if max(abs(arm.v) for arm in arms) > TOO_FAST:
                break

    def _observe(self, forces: tuple[float, float], ways: list[float]) -> None:
        """Energy that comes in at each end over the last sample: held force by way."""
        for i, (force, way) in enumerate(zip(forces, ways, strict=True)):
            come = -force * way
            self.total += come
            self.into[i] += max(come, 0.0)
            self.out[i] += max(-come, 0.0)

    def _damped(
        self, forces: tuple[float, float], came_in: tuple[float, float]
    ) -> tuple[float, float]:
        """Adds a damper at an end from which too much energy has come out."""
        over = [0.0, 0.0]
        if self.control == "sides":
            over = [self.out[i] - came_in[i] - self.reserve for i in range(2)]
        elif self.control == "observer" and self.total < 0.0:
            comes = [-forces[i] * self.arms[i].v < 0.0 for i in range(2)]
            shares = {(True, True): (0.5, 0.5), (False, True): (0.0, 1.0)}
            over = [-self.total * x for x in shares.get((comes[0], comes[1]), (1.0, 0.0))]
        return self._left(0, forces[0], over[0]), self._left(1, forces[1], over[1])

    def _left(self, i: int, force: float, over: float) -> float:
        """A force less a damper's, which takes an energy in a sample as far as it may.

        It may halve the speed. Between observers at both ends it may cancel what drives the arm
        besides, or a slow follower would creep on without end.
        """
        v = self.arms[i].v
        if over <= 0.0 or v == 0.0:
            return force
        driving = max(0.0, force * math.copysign(1.0, v)) if self.control == "sides" else 0.0
        most = driving + MOST_DAMPING * self.arms[i].m / TS * abs(v)
        return force - math.copysign(min(over / (TS * abs(v)), most), v)

    def _held(self) -> float:
        """Energy in motion, the hand's spring and the wall, less the work of the push [J]."""
        leader, follower = self.arms
        kinetic = sum(0.5 * arm.m * arm.v**2 for arm in self.arms)
        springs = 0.5 * leader.k * leader.x**2 + 0.5 * follower.K * max(follower.x, 0.0) ** 2
        return kinetic + springs - PUSH * leader.x

    def _move(self, forces: tuple[float, float]) -> None:
        for arm, force in zip(self.arms, (forces[0] + PUSH, forces[1]), strict=True):
            rates = [arm.v]
            for _ in range(PARTS):
                arm.step(force, TS / PARTS)
                rates.append(arm.v)
            squares = np.array(rates) ** 2
            odd, even = squares[1:-1:2].sum(), squares[2:-1:2].sum()
            weighted = squares[0] + squares[-1] + 4.0 * odd + 2.0 * even
            self.spent += arm.b * TS / PARTS / 3.0 * float(weighted)

    def _record(self) -> None:
        self.x.append((self.arms[0].x, self.arms[1].x))
        self.v.append((self.arms[0].v, self.arms[1].v))
        self.energy.append(self.total)
        self.motion.append(self.first - self._held() - self.spent)

    @property
    def rest(self) -> float:
        """Ratio of the largest speed in the last part of the run to that of all of it."""
        v = np.abs(self.v)
        if len(v) < round(self.time / TS):
            return 1.0
        return float((v[math.floor((1.0 - LAST) * len(v)) :].max(0) / v.max(0)).max())


def _contact(wall: float, speed: float, plain: Teleoperation | None) -> list[Row]:
    damped = Teleoperation(wall, "observer", speed=speed)
    what = f"a wall of {1e-3 * wall:g} kN/m met at {speed:g} m/s"
    printed = "stiffness > 150 kN/m" if wall >= HARD else "a variety of environments and speeds"
    rows = []
    if plain is not None:
        rows.append(
            holds(
                f"{what}: no rest without the controller | abstract | {printed}",
                plain.rest > 0.3 and min(plain.energy) < -0.1,
                QUOTED,
                f"last over largest speed {plain.rest:.2g}; link and controllers have given "
                f"{-min(plain.energy):.3g} J",
            )
        )
    rows.append(
        holds(
            f"{what}: rest with the controller | abstract | stable: {printed}",
            damped.rest < REST,
            QUOTED,
            f"last over largest speed {damped.rest:.2g}; least energy "
            f"{1e3 * min(damped.energy):.3g} mJ",
        )
    )
    return rows


def _observed(run: Teleoperation, name: str) -> Row:
    energy, motion = np.array(run.energy), np.array(run.motion)
    return row(
        f"{name}: largest gap of the observer from the energy of the motion, over its size | "
        "passivity observer | sum of f v dT at both ends | 1",
        (0.0, float(np.abs(energy - motion).max() / np.abs(motion).max()), BY_MOTION),
        FORMULA,
        "held force by way at both ends, beside what kinetic energy, springs, dampers and push of "
        "both arms leave over",
    )


def _late(delay: int) -> tuple[list[Row], dict[str, Teleoperation]]:
    common = {"delay": delay, "Kp": SLACK, "time": LATE_T}
    plain = Teleoperation(SOFT, "none", **common)
    kept = Teleoperation(SOFT, "sides", reserve=RESERVE, **common)
    rows = [
        holds(
            f"{delay * TS * 1e3:g} ms late each way: no rest without a controller | none | not in "
            "the source",
            plain.rest > 0.3,
            BESIDE,
            f"a wall of {1e-3 * SOFT:g} kN/m; last over largest speed {plain.rest:.2g}",
        ),
        holds(
            f"{delay * TS * 1e3:g} ms late each way: rest with an observer at each end | none | "
            "not in the source",
            kept.rest < REST and min(kept.energy) >= -2.0 * RESERVE * (1.0 + BEFORE_SEEN),
            BESIDE,
            "an end lets out what came in at the other one before, and a reserve of "
            f"{1e3 * RESERVE:g} mJ; least energy {1e3 * min(kept.energy):.3g} mJ: two reserves, "
            "and what came out before it was seen",
        ),
    ]
    return rows, {"without": plain, "with": kept}


def _reserve() -> Row:
    common = {"delay": 50, "Kp": SLACK, "start": FAR, "speed": 0.0, "time": LATE_T}
    none, some = (Teleoperation(SOFT, "sides", reserve=each, **common) for each in (0.0, AMPLE))
    ways = [float(np.array(run.x)[-1, 1] - FAR) for run in (none, some)]
    return holds(
        "from rest, without a reserve, the follower stays behind | none | not in the source",
        ways[0] < 0.2 * ways[1] and ways[1] > -FAR,
        BESIDE,
        "a leader in free motion feels nothing and puts nothing in: the follower moves "
        f"{1e3 * ways[0]:.3g} mm in {LATE_T:g} s without, {1e3 * ways[1]:.3g} mm with "
        f"{1e3 * AMPLE:g} mJ and touches the wall",
    )


def make(quick: bool, progress: Progress) -> Found:
    progress("a wall of 150 kN/m")
    plain, damped = (Teleoperation(HARD, control) for control in ("none", "observer"))
    rows = _contact(HARD, SPEED, plain)
    if not quick:
        progress("other walls and speeds")
        rows += _contact(HARDER, SPEED, Teleoperation(HARDER, "none"))
        for wall, speed in OTHERS:
            rows += _contact(wall, speed, None)
    rows += [_observed(plain, "without controller"), _observed(damped, "with controller")]
    late: dict[str, Teleoperation] = {}
    for delay in DELAYS[:1] if quick else DELAYS:
        progress(f"{delay} samples late")
        found, late = _late(delay)
        rows += found
    progress("reserve")
    rows.append(_reserve())
    return Found(tuple(rows), (_energy_chart(plain, damped), _late_chart(late)))


def _energy_chart(plain: Teleoperation, damped: Teleoperation) -> Chart:
    shown, marks = slice(0, 300), slice(0, 300, 15)
    t = 1e3 * TS * np.arange(300)
    curves = []
    for run, name in ((plain, "without controller"), (damped, "with controller")):
        curves.append(curve(name, t, 1e3 * np.array(run.energy)[shown]))
        curves.append(curve("", t[marks], 1e3 * np.array(run.motion)[marks], "marks"))
    return Chart(
        "energy",
        "Energy that link and controllers have taken",
        "The follower meets a wall of 150 kN/m. Below zero the pair is active. Lines: the "
        "observer, marks: the energy of the motion.",
        "time [ms]",
        "energy [mJ]",
        tuple(curves),
    )


def _late_chart(late: dict[str, Teleoperation]) -> Chart:
    with_, without = (1e3 * np.array(late[name].x)[:2500, 1] for name in ("with", "without"))
    return Chart(
        "late",
        "Follower at a wall, over a slow link",
        "A wall of 1 kN/m stands at 0, 100 ms each way; an observer at each end, a reserve of "
        "10 mJ.",
        "time [s]",
        "position of the follower [mm]",
        (
            curve("without controller", TS * np.arange(len(without)), without, "dashed"),
            curve("with controller", TS * np.arange(len(with_)), with_),
        ),
    )


CLASSIC = Classic(
    "ryu2004",
    "Time-domain passivity of leader and follower",
    "J.-H. Ryu, D.-S. Kwon, B. Hannaford, Stable teleoperation with time-domain passivity control, "
    "IEEE Trans. Robotics and Automation 20 (2004) 365-373",
    "An abstract of the method by its authors could be read (benthamscience.com/chapter/5643): "
    "observer and controller of one port are extended to two; stable are hard contact (stiffness "
    "> 150 kN/m), a wide variety of environments and speeds, and following a hard surface. The "
    "figures and the arms of two axes could not; the arms here have one axis and are ours, so no "
    "surface is followed. Observers of late links are of later work (J.-H. Ryu, J. Artigas, C. "
    "Preusche, A passive bilateral control scheme for a teleoperator with time-varying "
    "communication delay, Mechatronics 20, 2010).",
    "The follower follows by a joint law, the leader feels the force on the wall. A hand presses "
    "with 2 N; arms and wall move exactly under held forces, from touch to touch. A pair rests if "
    "both speeds in the last fifth of a run are below a tenth of the largest.",
    make,
)
