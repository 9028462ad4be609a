"""Lawrence 1993: four channels, transparency, and what it costs in robustness."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from ...scene.pair import Contact
from ...studies.chart import Chart, curve
from ...theory.roots import positive_roots, squared_magnitude
from ..ledger import Row, row
from .bilateral import Bilateral, Push, Signals
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Progress, holds
from .sampled_pair import Seen, delay_limit, growth
from .yokokohji1994 import ARM, HAND, KD, KP, OBJECT, sampled

ARM_P = np.poly1d([ARM.mass, ARM.damper, 0.0])  # N/m, of position
PD = np.poly1d([KD, KP])
NONE = np.poly1d([0.0])
OMEGAS = np.array([1.0, 3.0, 10.0, 30.0])  # rad/s at which runs are felt
SWEPT = np.geomspace(0.3, 100.0, 241)  # rad/s of the figure
SETTLES, SHOWN = 300.0, 20  # [s] of a run before it is felt, and periods felt
BY_FIT = 1e-6  # share: what is left of the start, e^-30, and the fit
SAMPLES = (1e-3, 5e-4)  # [s] of runs whose limits are extrapolated to none
QUICK_SAMPLES = (4e-3, 2e-3)  # [s]
BY_RUNS = 2e-3  # share: the limit at no sample, of the first order, from two samples
STIFF, FINE, SOON = 1000.0, (2e-4, 1e-4), 20.0  # N/m, s, s
STIFFNESSES = np.geomspace(10.0, 1e5, 81)  # N/m of the object, in the figure
LATE, HARD = 1e-3, 1e4  # s, N/m: late by little, a hard object
EVEN = 1e-9  # of a number that is 1 by its formula


@dataclass(frozen=True)
class Channels:
    """A law in four channels, per position: C1, C4 of position, C2, C3 of force; local C_m, C_s.

    The leader is driven by -C_m x_l - C4 x_f - C2 f_e, the follower by -C_s x_f + C1 x_l + C3 f_h,
    f_h the force of the hand, f_e that on the object.
    """

    name: str
    C1: np.poly1d
    C2: float
    C3: float
    C4: np.poly1d
    Cm: np.poly1d
    Cs: np.poly1d


LAWS = (
    Channels("position-position", PD, 0.0, 0.0, -PD, PD, PD),
    Channels("position-force", PD, 1.0, 0.0, NONE, NONE, PD),
    Channels("four-channel", PD, 1.0, 1.0, -PD, PD, PD),
    Channels("transparent", ARM_P + PD, 1.0, 1.0, -(ARM_P + PD), PD, PD),
)
TRANSPARENT = LAWS[3]


def impedance(thing: Contact) -> np.poly1d:
    """Force per position of an object."""
    return np.poly1d([thing.mass, thing.B, thing.K])


HAND_P = np.poly1d([HAND.mass, HAND.damper, HAND.spring])


def felt_impedance(law: Channels, s: np.ndarray, thing: Contact = OBJECT) -> np.ndarray:
    """Force of the hand per leader's position [N/m].

    ((Z_m + C_m)(Z_s + C_s + Z_e) + C1 (C4 + C2 Z_e)) / (Z_s + C_s + Z_e - C3 (C4 + C2 Z_e)).
    """
    leader, follower = ARM_P + law.Cm, ARM_P + law.Cs + impedance(thing)
    back = law.C4 + law.C2 * impedance(thing)
    above, below = leader * follower + law.C1 * back, follower - law.C3 * back
    return np.asarray(above(s) / below(s))


def around(law: Channels, thing: Contact) -> tuple[np.poly1d, np.poly1d]:
    """What goes around hand, link and object without delay: (C4 + C2 Z_e)(C1 - C3 Z_h) over ...

    The pair's poles with a delay T each way are where it is -exp(2 s T).
    """
    E = impedance(thing)
    above = (law.C4 + law.C2 * E) * (law.C1 - law.C3 * HAND_P)
    return above, (ARM_P + law.Cm + HAND_P) * (ARM_P + law.Cs + E)


def largest_delay(law: Channels, thing: Contact = OBJECT) -> float:
    """Largest one-way delay in continuous time [s]: 0 if unstable without, inf for any."""
    above, below = around(law, thing)
    if np.roots((above + below).coeffs).real.max() >= 0.0:
        return 0.0
    sizes = [squared_magnitude(Polynomial(p.coeffs[::-1])) for p in (above, below)]
    omega = np.sqrt(positive_roots(sizes[0] - sizes[1]))
    turned = np.angle(-above(1j * omega) / below(1j * omega)) % (2.0 * math.pi)
    return float(min(turned / (2.0 * omega), default=math.inf))


def continuous_law(law: Channels) -> Callable[[Signals], tuple[np.ndarray, np.ndarray]]:
    """The law as a sum of signals."""

    def both(s: Signals) -> tuple[np.ndarray, np.ndarray]:
        def of(poly: np.poly1d, i: int) -> np.ndarray:
            return poly[2] * s.a[i] + poly[1] * s.v[i] + poly[0] * s.x[i]

        leader = -of(law.Cm, 0) - of(law.C4, 1) - law.C2 * s.f[1]
        return leader, -of(law.Cs, 1) + of(law.C1, 0) + law.C3 * s.f[0]

    return both


def sampled_ends(law: Channels):
    """The law at samples, each host with what it saw and what arrived."""

    def of(c: tuple[float, ...], seen: Seen) -> float:
        return c[2] * seen.a + c[1] * seen.v + c[0] * seen.x

    polys = (law.C1, law.C4, law.Cm, law.Cs)
    C1, C4, Cm, Cs = (tuple(float(poly[k]) for k in range(3)) for poly in polys)

    def leader(own: Seen, other: Seen) -> tuple[float, Seen]:
        return -of(Cm, own) - of(C4, other) - law.C2 * other.F, own

    def follower(own: Seen, other: Seen) -> tuple[float, Seen]:
        pushed = -law.C3 * other.F  # the arm pushes the hand with F, the hand the arm with -F
        return -of(Cs, own) + of(C1, other) + pushed, own

    return leader, follower


def felt_in_run(law: Channels, omega: float) -> complex:
    """Force of the hand per leader's position in a run, once its start is forgotten [N/m]."""
    pair = Bilateral((ARM, ARM), HAND, OBJECT, continuous_law(law))
    step = 2.0 * math.pi / omega / 64.0
    first = round(SETTLES / step)
    run = pair.run(Push(0.0, 1.0, omega), step * np.arange(first + 64 * SHOWN))
    wave = np.exp(-1j * omega * run.t[first:])
    return complex(np.sum(run.f[first:, 0] * wave) / np.sum(run.x[first:, 0] * wave))


def _felt(progress: Progress) -> tuple[list[Row], list[np.ndarray]]:
    rows, runs = [], []
    for law in LAWS:
        progress(f"felt impedance, {law.name}")
        ours = np.array([felt_in_run(law, omega) for omega in OMEGAS])
        runs.append(ours)
        transparent = law is TRANSPARENT
        expected = (
            impedance(OBJECT)(1j * OMEGAS) if transparent else felt_impedance(law, 1j * OMEGAS)
        )
        rows.append(
            row(
                f"{law.name}: largest gap of the impedance felt in runs, over its size | "
                f"transparency | {'Z_to = Z_e' if transparent else 'Z_to of the four channels'} | "
                "1",
                (0.0, float(np.abs(ours / expected - 1.0).max()), BY_FIT),
                FORMULA,
                f"at {', '.join(f'{x:g}' for x in OMEGAS)} rad/s; felt over the object's: "
                + ", ".join(f"{x:.3g}" for x in np.abs(ours / impedance(OBJECT)(1j * OMEGAS))),
            )
        )
    return rows, runs


def limit_in_runs(law: Channels, thing: Contact, near: float, samples, settled: float) -> float:
    """Largest one-way delay by growth of runs, extrapolated to no sample [s]."""
    found = []
    for Ts in samples:
        pair = replace(sampled("four-channel"), Ts=Ts, follower_clay=thing)
        found.append(delay_limit(pair, near, settled, sampled_ends(law)))
    return 2.0 * found[1] - found[0]


Marks = list[tuple[Channels, Contact, float]]  # limits that runs have found


def _delays(quick: bool, progress: Progress) -> tuple[list[Row], Marks]:
    rows, marks = [], []
    laws, samples = ((LAWS[0], TRANSPARENT), QUICK_SAMPLES) if quick else (LAWS, SAMPLES)
    cases = [(law, OBJECT, samples, 60.0) for law in laws]
    if not quick:
        cases.append((TRANSPARENT, replace(OBJECT, K=STIFF), FINE, SOON))
    for law, thing, samples, settled in cases:
        progress(f"delay, {law.name}")
        expected = largest_delay(law, thing)
        found = limit_in_runs(law, thing, expected, samples, settled)
        marks.append((law, thing, found))
        rows.append(
            row(
                f"{law.name}: largest one-way delay, an object of {thing.K:g} N/m | none | "
                "(C4 + C2 Z_e)(C1 - C3 Z_h) exp(-2 s T) | s",
                (expected, found, BY_RUNS),
                BESIDE,
                "expected: its crossings of size 1; ours: growth of runs at "
                f"{1e3 * samples[0]:g} and {1e3 * samples[1]:g} ms, extrapolated to none",
            )
        )
    return rows, marks


def two_port(law: Channels, omega: np.ndarray, T: float) -> tuple[np.ndarray, ...]:
    """h11, h12, h21, h22 of (f_h, -v_f) per (v_l, f_e), with a delay T each way."""
    s = 1j * omega
    late = np.exp(-s * T)
    leader, follower = (ARM_P + law.Cm)(s) / s, (ARM_P + law.Cs)(s) / s
    c1, c4 = law.C1(s) / s * late, law.C4(s) / s * late
    c2, c3 = law.C2 * late, law.C3 * late
    det = c3 * c4 - follower

    def solved(p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f_h and v_f of f_h - c4 v_f = p, c3 f_h - follower v_f = q."""
        return (c4 * q - follower * p) / det, (q - c3 * p) / det

    one = np.ones_like(s)
    f1, v1 = solved(leader, -c1)
    f2, v2 = solved(c2 * one, one)
    return f1, f2, -v1, -v2


def llewellyn(law: Channels, omega: np.ndarray, T: float = 0.0) -> np.ndarray:
    """Llewellyn's number: absolutely stable where it is 1 or more, Re h11 and Re h22 not negative.

    2 Re h11 Re h22/|h12 h21| - cos arg(h12 h21); Llewellyn, Some fundamental properties of
    transmission systems, Proc. IRE 40 (1952) 271-283.
    """
    h11, h12, h21, h22 = two_port(law, omega, T)
    through = h12 * h21
    return 2.0 * h11.real * h22.real / np.abs(through) - np.cos(np.angle(through))


def for_all(law: Channels, omega: np.ndarray, T: float) -> bool:
    """Whether Llewellyn's conditions hold: stable with every passive hand and object."""
    h11, _, _, h22 = two_port(law, omega, T)
    own = min(float(h11.real.min()), float(h22.real.min()))
    return own >= 0.0 and float(llewellyn(law, omega, T).min()) >= 1.0


def _robustness(progress: Progress) -> list[Row]:
    progress("absolute stability")
    omega = np.geomspace(0.1, 500.0, 4001)
    hard = replace(OBJECT, K=HARD)
    pair = replace(sampled("four-channel"), Ts=2e-4, follower_clay=hard)
    late = round(LATE / pair.Ts)
    rates = {law.name: growth(pair, late, 4.0, sampled_ends(law)) for law in LAWS}
    ideal = llewellyn(TRANSPARENT, omega)
    return [
        row(
            "transparent, without delay: largest gap of Llewellyn's number from 1 | none | no "
            "margin at any frequency | 1",
            (0.0, float(np.abs(ideal - 1.0).max()), EVEN),
            BESIDE,
            "the hand holds the object itself: passive, and no more than that",
        ),
        holds(
            "transparent, 1 ms late: a passive hand and object are found with which it is unstable "
            "| others, 2015 | perfect transparency cannot be realized without compromising "
            "stability",
            not for_all(TRANSPARENT, omega, LATE) and rates["transparent"] > 0.0,
            QUOTED,
            f"least number {llewellyn(TRANSPARENT, omega, LATE).min():.3g}; with an object of "
            f"{1e-3 * HARD:g} N/mm runs grow at {rates['transparent']:.3g} 1/s",
        ),
        holds(
            "position-position, 1 ms late, is stable with every passive hand and object | none | "
            "not in the source",
            for_all(LAWS[0], omega, LATE) and rates["position-position"] < 0.0,
            BESIDE,
            "Llewellyn's conditions hold at all frequencies; with the same object runs decay "
            f"at {-rates['position-position']:.3g} 1/s",
        ),
    ]


def _felt_chart(runs: list[np.ndarray]) -> Chart:
    s, curves = 1j * SWEPT, []
    for law, found in zip(LAWS, runs, strict=True):
        curves.append(curve(law.name, SWEPT, np.abs(felt_impedance(law, s) / s)))
        curves.append(curve("", OMEGAS, np.abs(found) / OMEGAS, "marks"))
    return Chart(
        "felt",
        "What the hand feels of an object",
        "Force per speed at the leader; the object has 3 kg, 1 N.s/m and 50 N/m, the arms 6 kg. "
        "The transparent law shows the object alone, its dip at 4 rad/s too. Lines: formula, "
        "marks: runs.",
        "frequency [rad/s]",
        "impedance felt [N.s/m]",
        tuple(curves),
        "xy",
    )


def _delay_chart(marks: Marks) -> Chart:
    curves = []
    for law in LAWS:
        limits = np.array([largest_delay(law, replace(OBJECT, K=float(K))) for K in STIFFNESSES])
        shown = np.where(np.isfinite(limits) & (limits > 0.0), limits, np.nan)
        curves.append(curve(law.name, STIFFNESSES, 1e3 * shown))
        mine = [(thing.K, 1e3 * limit) for each, thing, limit in marks if each is law]
        if mine:
            curves.append(curve("", [x for x, _ in mine], [y for _, y in mine], "marks"))
    return Chart(
        "delays",
        "How much delay each law carries",
        "By the object's stiffness, with one hand; no line where any delay is stable. The "
        "transparent law carries 327 ms with a soft object and 0.03 ms with a hard one. Marks: "
        "runs.",
        "stiffness of the object [N/m]",
        "largest one-way delay [ms]",
        tuple(curves),
        "xy",
    )


def make(quick: bool, progress: Progress) -> Found:
    delays, marks = _delays(quick, progress)
    felt, runs = _felt(progress)
    rows = (*felt, *delays, *_robustness(progress))
    return Found(rows, (_felt_chart(runs), _delay_chart(marks)))


CLASSIC = Classic(
    "lawrence1993",
    "Four channels: transparency against robustness",
    "D. A. Lawrence, Stability and transparency in bilateral teleoperation, IEEE Trans. Robotics "
    "and Automation 9 (1993) 624-637",
    "The article could not be read. Its law in four channels and the impedance that the hand feels "
    "are stated by many (for one, A. Aziminejad, M. Tavakoli, R. V. Patel, M. Moallem, Transparent "
    "time-delayed bilateral teleoperation using wave variables, IEEE Trans. Control Systems "
    "Technology, 2008, whose abstract calls four channels optimal for transparency); "
    "that perfect transparency compromises stability is quoted from a later article (J. Robotics "
    "2015, 861425). The formulas are derived in equations.md, section 8, the numbers are "
    "ours. The pair is that of yokokohji1994.",
    "In continuous time what the hand feels is fitted to exact runs at one frequency each. Delays "
    "are runs from sample to sample, where growth changes its sign, at two samples and "
    "extrapolated to none.",
    make,
)
