"""Yokokohji and Yoshikawa 1994: laws that make two arms one, and why some simulations diverge."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...arms.joint_law import JointPD
from ...model.operator import Operator
from ...scene.link import Link
from ...scene.pair import Contact, Pair
from ...scene.virtual_wall import Device
from ...studies.chart import Chart, curve
from ...theory.pair_build import Build
from ...theory.pair_delays import Delays
from ...theory.pair_onset import LATEST
from ..ledger import Row, row
from .bilateral import Bilateral, Law, Motion, Push, Signals, poles_of_run
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Progress, holds
from .sampled_pair import delay_limit

ARM = Device(6.0, 0.1)  # kg, N.s/m: leader and follower
HAND = Operator(2.0, 2.0, 10.0)
OBJECT = Contact(50.0, 1.0, 3.0)
SWING = Push(5.0, -5.0, 4.0 * math.pi)  # N, N, rad/s: 5 - 5 cos(4 pi t)
T_MAX, STEP = 4.0, 1e-4  # [s]
LOCAL, REFLECTED = 2.5, 3.5  # case 1: gains of the leader's and of the follower's force
KP, KD = 400.0, 50.0  # case 1: N/m, N.s/m
K1, K2 = 8.0, 70.0  # cases 2 and 3: 1/s, 1/s^2
M_HAT, B_HAT, LAMBDA = 2.0, 1.0, 0.21  # case 3: kg, N.s/m, 1/kg
EXACT = 1e-9  # share: of matrix exponentials over 40,000 steps
BY_PRONY = 1e-6  # share: four poles from twelve samples
SHORT, ROUNDS = 1e-6, 12  # [s] a step in which nothing moves, and how many
TRACED = 1e-4  # share: what moves in them
TS = 1e-3  # [s]
BY_GROWTH = 2e-3  # share: growth of runs is linear in the delay over two samples
FREE = Push(0.0, 0.0, 1.0)


def case1(s: Signals) -> tuple[np.ndarray, np.ndarray]:
    """Force reflection onto a follower under position control."""
    return LOCAL * s.f[0] - REFLECTED * s.f[1], KP * (s.x[0] - s.x[1]) - KD * s.v[1]


def case2(s: Signals, sign: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The ideal response: both arms are led along their mean, and bear the mean force."""
    x, v, a, f = (0.5 * (pair[0] + pair[1]) for pair in s)
    torques = [
        ARM.mass * (a + K1 * (v - s.v[i]) + K2 * (x - s.x[i])) + ARM.damper * s.v[i]
        for i in range(2)
    ]
    return torques[0] - f, torques[1] + sign * f


def case2_as_printed(s: Signals) -> tuple[np.ndarray, np.ndarray]:
    """Case 2 with the sign of Eq. 66 as the re-implementation found it."""
    return case2(s, -1.0)


def case3(s: Signals) -> tuple[np.ndarray, np.ndarray]:
    """Case 2 with an intervenient impedance between hand and object."""
    x, v, a, f = (0.5 * (pair[0] + pair[1]) for pair in s)
    between, apart = 0.5 * (M_HAT * a + B_HAT * v), 0.5 * LAMBDA * ARM.mass * f
    leader, follower = case2(s)
    return leader - between + apart, follower - between - apart


def pair_of(law: Law, thing: Contact = OBJECT) -> Bilateral:
    """The pair of the simulation under a law."""
    return Bilateral((ARM, ARM), HAND, thing, law)


def swung(law: Law) -> Motion:
    """The run of the simulation: at rest, then the muscle swings for 4 s."""
    return pair_of(law).run(SWING, np.linspace(0.0, T_MAX, round(T_MAX / STEP) + 1))


def case1_poles() -> np.ndarray:
    """Poles of case 1, of (Zm + 3.5 Zh)(Zs + Zo + Kd s + Kp) + 3.5 Kp Zo = 0, by real part."""
    arm = np.poly1d([ARM.mass, ARM.damper, 0.0])
    hand = np.poly1d([HAND.mass, HAND.damper, HAND.spring])
    thing = np.poly1d([OBJECT.mass, OBJECT.B, OBJECT.K])
    leader = arm + (1.0 + LOCAL) * hand
    whole = leader * (arm + thing + np.poly1d([KD, KP])) + REFLECTED * KP * thing
    found = np.roots(whole.coeffs)
    return found[np.lexsort((found.imag, found.real))]


def _poles(progress: Progress) -> list[Row]:
    progress("poles of case 1")
    step = 0.2
    start = np.array([0.1, 0.0, 0.0, 0.0])
    run = pair_of(case1).run(FREE, step * np.arange(16), start)
    ours, expected = poles_of_run(run.x[:, 0], step, 4), case1_poles()
    rows = []
    for which, name in ((0, "fast"), (2, "slow")):
        for part, word, unit in (("real", "real part", "1/s"), ("imag", "frequency", "rad/s")):
            value, found = (abs(getattr(x[which + 1], part)) for x in (expected, ours))
            sign = math.copysign(1.0, getattr(expected[which + 1], part))
            found *= math.copysign(1.0, getattr(ours[which + 1], part))
            rows.append(
                row(
                    f"case 1: {word} of the {name} pair of poles | equations of case 1 | none | "
                    f"{unit}",
                    (sign * value, found, BY_PRONY),
                    FORMULA,
                    "expected: roots of the characteristic polynomial; ours: Prony's method on a "
                    "free run",
                )
            )
    slow = expected[3].real
    rows.append(
        holds(
            "case 1 is unstable, and a run of 4 s does not show it | none | not in the source",
            slow > 0.0 and math.exp(slow * T_MAX) < 1.02,
            BESIDE,
            f"the slow pair grows by e in {1.0 / slow:.3g} s, by "
            f"{100.0 * math.expm1(slow * T_MAX):.2g} % in the 4 s of the simulation",
        )
    )
    return rows


def direct() -> Motion:
    """The ideal response: the hand on the object, with nothing between, in closed form."""
    t = np.linspace(0.0, T_MAX, round(T_MAX / STEP) + 1)
    m, b, k = HAND.mass + OBJECT.mass, HAND.damper + OBJECT.B, HAND.spring + OBJECT.K
    decay = 0.5 * b / m
    omega = math.sqrt(k / m - decay**2)
    w = SWING.omega
    forced = SWING.swing / complex(k - m * w**2, b * w)
    still = SWING.steady / k
    p = complex(-decay, omega)
    part = -(still + forced.real)
    free = complex(part, ((1j * w * forced).real - decay * part) / omega)
    wave, ring = np.exp(1j * w * t), np.exp(p * t)
    x = still + (forced * wave + free * ring).real
    v = (1j * w * forced * wave + p * free * ring).real
    a = (-(w**2) * forced * wave + p**2 * free * ring).real
    f = OBJECT.mass * a + OBJECT.B * v + OBJECT.K * x
    return Motion(t, *(np.column_stack([each, each]) for each in (x, v, a, f)))


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values).max())


def _ideal(run: Motion, progress: Progress) -> list[Row]:
    progress("cases 2 and 3")
    ideal = direct()
    gaps = [_largest(x[:, 0] - x[:, 1]) / _largest(x) for x in (run.x, run.f)]
    rows = [
        row(
            f"case 2: largest {name} | ideal response | the hand feels the object | {unit}",
            (_largest(expected[:, 0]), _largest(ours[:, 1]), EXACT),
            FORMULA,
            "expected: hand and object with nothing between them, in closed form",
        )
        for name, unit, expected, ours in (
            ("position", "m", ideal.x, run.x),
            ("force", "N", ideal.f, run.f),
        )
    ]
    rows.append(
        row(
            "case 2: largest difference of positions, over the largest position | ideal response "
            "| x_m = x_s, f_m = f_s | 1",
            (0.0, max(gaps), EXACT),
            FORMULA,
            "and of forces as well; both arms have the same mass",
        )
    )
    printed = swung(case2_as_printed)
    rows.append(
        row(
            "case 2 with the other sign of the mean force at the follower: its largest force | "
            "Eq. 66, by the re-implementation | -f_ms should be +f_ms | N",
            (0.0, _largest(printed.f[:, 1]), EXACT),
            QUOTED,
            "the sum of both arms' equations then reads f_s = 0: the follower never moves; with "
            f"+f_ms it presses with up to {_largest(run.f):.4g} N",
        )
    )
    third = swung(case3)
    mean = [0.5 * (x[:, 0] + x[:, 1]) for x in (third.v, third.a)]
    left = third.f[:, 0] - third.f[:, 1] - M_HAT * mean[1] - B_HAT * mean[0]
    rows.append(
        row(
            "case 3: hand's force less that on the object, less m a + b v of the mean motion | "
            "intervenient impedance | m = 2 kg, b = 1 N.s/m are felt between | N",
            (0.0, _largest(left), EXACT),
            FORMULA,
            f"largest over the run; forces are up to {_largest(third.f):.3g} N",
        )
    )
    return rows


def held(order: str, local: float, dt: float = SHORT) -> np.ndarray:
    """Leader's accelerations, step by step, where the measured force holds the last one.

    order: "arm" solves the arm for its acceleration, with the hand's force by the last
    acceleration; "hand" solves the hand, with the force that moved the arm so far. The leader's
    motor adds `local` times the last force; the hand pushes with 1 N.
    """
    a, v, x, torque, out = 0.0, 0.0, 0.0, 0.0, []
    for _ in range(ROUNDS):
        if order == "arm":
            f = 1.0 - (HAND.mass * a + HAND.damper * v + HAND.spring * x)
            a = (torque + f - ARM.damper * v) / ARM.mass
        else:
            f = ARM.mass * a + ARM.damper * v - torque
            a = (1.0 - f - HAND.damper * v - HAND.spring * x) / HAND.mass
        v += a * dt
        x += v * dt
        torque = local * f
        out.append(a)
    return np.array(out)


def _factor(accelerations: np.ndarray) -> float:
    """By how much a step multiplies the last change."""
    change = np.abs(np.diff(accelerations))
    return float((change[5] / change[1]) ** 0.25)


def _held(progress: Progress) -> tuple[list[Row], Chart]:
    progress("held accelerations")
    ratio = ARM.mass / HAND.mass
    cases = (
        ("hand", 0.0, "arm's equation for the force, hand's for the motion", ratio, "m_m/m_op"),
        ("arm", 0.0, "hand's equation for the force, arm's for the motion", 1 / ratio, "m_op/m_m"),
        ("hand", LOCAL, "the first order, with case 1's motor", ratio + LOCAL, "m_m/m_op + 2.5"),
    )
    rows = [
        row(
            f"factor of the force loop in a step: {what} | none | {formula} | 1",
            (factor, _factor(held(order, local)), TRACED),
            BESIDE,
            f"steps of {1e6 * SHORT:g} us: no step is short enough"
            if factor > 1.0
            else "below 1: it settles",
        )
        for order, local, what, factor, formula in cases
    ]
    rows.append(
        row(
            "acceleration that the second order settles at | none | 1 N/(m_m + m_op) | m/s²",
            (1.0 / (ARM.mass + HAND.mass), float(held("arm", 0.0)[-1]), TRACED),
            BESIDE,
            "a simulator that solves for force and acceleration together has no such loop",
        )
    )
    steps = np.arange(1, ROUNDS)
    curves = []
    for order, name, factor in (("hand", "arm first", ratio), ("arm", "hand first", 1.0 / ratio)):
        change = np.abs(np.diff(held(order, 0.0)))
        curves.append(curve(name, steps, change[0] * factor ** (steps - 1.0)))
        curves.append(curve("", steps, change, "marks"))
    chart = Chart(
        "held",
        "Change of the acceleration from step to step",
        "A step computes the force from the last acceleration: the arm's force first, or the "
        "hand's first. Lines: powers of m_m/m_op = 3 and of 1/3.",
        "step",
        "change of the acceleration [m/s²]",
        tuple(curves),
        "y",
    )
    return rows, chart


def sampled(kind: Any) -> Pair:
    """The pair at 1 kHz, with the gains of case 1 in a joint law and its rates sent."""
    law = JointPD((KP,), (KD,))
    return Pair(ARM, ARM, law, Link(kind), Ts=TS, leader_operator=HAND, follower_clay=OBJECT)


def _delays(quick: bool, progress: Progress) -> list[Row]:
    rows = []
    kinds = ("position-position", "position-force", "four-channel")
    for kind in kinds[:1] if quick else kinds:
        progress(f"delay of {kind}")
        whole = Delays(Build(sampled(kind)).loop((0.0, 0.0)))
        edge = whole.first(2.0 * LATEST / TS)
        expected = 0.5 * TS * edge.samples if edge else math.inf
        rows.append(
            row(
                f"largest one-way delay, {kind}, 1 kHz | none | not in the source | s",
                (expected, delay_limit(sampled(kind), expected), BY_GROWTH),
                BESIDE,
                "expected: crossings in frequency, as in pair_limits, of whole samples; ours: "
                "where the growth of runs from sample to sample changes its sign",
            )
        )
    return rows


def make(quick: bool, progress: Progress) -> Found:
    run = swung(case2)
    first, ideal = swung(case1), direct()
    shown = slice(None, None, 100)
    marks = slice(None, None, 2000)
    motion = Chart(
        "cases",
        "Position of leader and follower",
        "Case 1 reflects forces; its follower lags, and 0.5 Hz hardly decays. In case 2 both arms "
        "move as one, as if the hand held the object (marks).",
        "time [s]",
        "position [m]",
        (
            curve("case 1: leader", first.t[shown], first.x[shown, 0], "dashed"),
            curve("case 1: follower", first.t[shown], first.x[shown, 1], "dashed"),
            curve("case 2: both arms", run.t[shown], run.x[shown, 1]),
            curve("hand on object", ideal.t[marks], ideal.x[marks, 0], "marks"),
        ),
    )
    rows, chart = _held(progress)
    every = (*_poles(progress), *_ideal(run, progress), *rows, *_delays(quick, progress))
    return Found(every, (motion, chart))


CLASSIC = Classic(
    "yokokohji1994",
    "Two arms as one: ideal kinesthetic coupling",
    "Y. Yokokohji, T. Yoshikawa, Bilateral control of master-slave manipulators for ideal "
    "kinesthetic coupling: formulation and experiment, IEEE Trans. Robotics and Automation 10 "
    "(1994) 605-620",
    "The article could not be read. Its laws and the numbers of its simulation (Sec. VI-D, object "
    "2) are those of a public re-implementation (github.com/jaejunlee0538/matlab_ws), whose author "
    "found the sign of f_ms in Eq. 66 wrong and a simulation that diverges when two lines change "
    "places. No number of its figures could be read.",
    "Both arms are linear, so runs are exact: matrix exponentials in which accelerations and "
    "measured forces are solved for together. Poles are found from the samples of a run, and delay "
    "limits at 1 kHz from the growth of runs.",
    make,
)
