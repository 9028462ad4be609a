"""Wave variables: Anderson and Spong 1989, Niemeyer and Slotine 1991."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from ...scene.link import Link
from ...studies.chart import Chart, curve
from ..ledger import Row, row
from .classic import BESIDE, FORMULA, QUOTED, Classic, Found, Progress, holds
from .sampled_pair import Seen, follower_wave, free_run, leader_wave, wave_ends
from .yokokohji1994 import KD, TS, sampled

DELAYS, QUICK_DELAYS = (1, 50, 500, 3000), (1, 500)  # samples, one way
MOST = 200  # samples: more than the pair carries without waves
IMPEDANCES = (5.0, 500.0)  # N.s/m: far from the follower's Kd
T_MAX, TRIPS = 60.0, 100  # [s] of a run, and delays more
ROUNDING = 1e-9  # share: of sums over ten thousand samples
THERE, BACK, SAMPLES = 37, 53, 5000  # of a link between any two ends
SEED = 1991
SPRING, SPEED, PERIOD, LATE = 400.0, 0.1, 1000, 100  # N/m, m/s, samples, samples
PERIODS = 5
ROUND_TRIPS, ONE_WAY = 6, 50  # of a step in speed, and samples
SHARES = (1.0 / 3.0, 1.0, 3.0)  # wave impedance over the follower's Kd
DECAYS = 0.95  # ratio of motion from quarter to quarter of a run that counts as decay
BY_SUMS = 1e-5  # share: the spring's force over a sample at the mean of its ends


def energies(b: float) -> tuple[np.ndarray, np.ndarray]:
    """Energy that a link of waves has taken at its ends, and that of the waves on their way [J].

    Any speed at the leader, any force at the follower.
    """
    random = np.random.default_rng(SEED)
    there, back = deque([0.0] * THERE), deque([0.0] * BACK)
    taken, stored, total = [], [], 0.0
    for v, F in zip(*random.normal(size=(2, SAMPLES)).tolist(), strict=True):
        force, u = leader_wave(b, v, back.popleft())
        rate, w = follower_wave(b, F, there.popleft())
        there.append(u)
        back.append(w)
        total += TS * (force * v - F * rate)
        taken.append(total)
        stored.append(0.5 * TS * (sum(x * x for x in there) + sum(x * x for x in back)))
    return np.array(taken), np.array(stored)


def spring_over(waves: float | None) -> np.ndarray:
    """Energy taken by a late link between a leader that is swung and a spring [J].

    waves: the wave impedance; None for speed and force sent as they are.
    """
    there, back = deque([0.0] * LATE), deque([0.0] * LATE)
    omega = 2.0 * math.pi / PERIOD
    x, total, out = 0.0, 0.0, [0.0]
    for k in range(PERIODS * PERIOD):
        v, arrived, returned = SPEED * math.cos(omega * k), there.popleft(), back.popleft()
        if waves is None:
            rate, force, sent, F = arrived, returned, v, SPRING * (x + 0.5 * TS * arrived)
            answer = F
        else:
            force, sent = leader_wave(waves, v, returned)
            F = SPRING * x
            rate, answer = follower_wave(waves, F, arrived)
        there.append(sent)
        back.append(answer)
        x += TS * rate
        total += TS * (force * v - F * rate)
        out.append(total)
    return np.array(out)


def given_in_a_period() -> float:
    """What the link gives in a period where speed and force are sent as they are [J]."""
    omega = 2.0 * math.pi / (PERIOD * TS)
    return math.pi * SPRING * (SPEED / omega) ** 2 * math.sin(2.0 * omega * LATE * TS)


def felt(b: float) -> np.ndarray:
    """Force at a leader that moves off at a constant speed, with its follower blocked [N]."""
    leader, follower = wave_ends(0.0, KD, b, TS)
    there, back = deque([0.0] * ONE_WAY), deque([0.0] * ONE_WAY)
    out = []
    for _ in range(ROUND_TRIPS * 2 * ONE_WAY):
        force, u = leader(Seen(0.0, SPEED, 0.0, 0.0), back.popleft())
        _, w = follower(Seen(0.0, 0.0, 0.0, 0.0), there.popleft())
        there.append(u)
        back.append(w)
        out.append(-force)
    return np.array(out)


def reflection(b: float) -> float:
    """Share of a wave that the follower's damper sends back: (b - Kd)/(b + Kd)."""
    return (b - KD) / (b + KD)


def steps(b: float) -> np.ndarray:
    """The same force after each round trip: a wave is reflected at both ends [N]."""
    G, root = reflection(b), math.sqrt(2.0 * b)
    out, w = [], 0.0
    for _ in range(ROUND_TRIPS):
        out.append(b * SPEED - root * w)
        w = G * (root * SPEED - w)
    return np.array(out)


def _link(progress: Progress) -> list[Row]:
    progress("energy of the link")
    taken, stored = energies(3.0)
    plain = spring_over(None)
    ends = plain[::PERIOD][-2:]
    waves = spring_over(KD)
    return [
        row(
            "largest gap between the energy taken at both ends and that of the waves on their way, "
            "over the largest | energy of a wave link | (u² + w²)/2 over the delay | 1",
            (0.0, float(np.abs(taken - stored).max() / stored.max()), ROUNDING),
            FORMULA,
            f"{SAMPLES} samples of random speeds at the leader and forces at the follower, "
            f"{THERE} samples there and {BACK} back",
        ),
        holds(
            "a link of waves never gives more than it took, at any constant delay | 2004, abstract "
            "| passive transmission procedures guarantee system stability",
            bool(taken.min() >= 0.0),
            QUOTED,
            f"least energy of these runs {1e3 * taken.min():.3g} mJ",
        ),
        row(
            "energy taken in a period, speed and force sent as they are, a spring at the follower "
            "| none | -pi K (V/omega)² sin(2 omega T) | J",
            (-given_in_a_period(), float(ends[1] - ends[0]), BY_SUMS),
            BESIDE,
            f"K = {SPRING:g} N/m, V = {SPEED:g} m/s, {1.0 / (PERIOD * TS):g} Hz, T = "
            f"{LATE * TS:g} s: the late link drives the hand",
        ),
        holds(
            "waves between the same ends take energy, and keep what they took | none | not in the "
            "source",
            bool(waves.min() >= 0.0),
            BESIDE,
            f"after {PERIODS} periods {waves[-1]:.3g} J taken, against {plain[-1]:.3g} J",
        ),
    ]


def _reflections(progress: Progress) -> list[Row]:
    progress("reflections")
    rows = []
    for share in SHARES:
        b = share * KD
        ours, expected = felt(b)[:: 2 * ONE_WAY], steps(b)
        rows.append(
            row(
                f"force felt after {ROUND_TRIPS - 1} round trips, b = {share:.3g} Kd | reflection "
                "| (b - Kd)/(b + Kd) a reflection | N",
                (float(expected[-1]), float(ours[-1]), ROUNDING),
                FORMULA,
                f"a leader at {SPEED:g} m/s, a blocked follower of Kd = {KD:g} N.s/m: "
                f"{KD * SPEED:g} N in the end; first b v = {b * SPEED:.3g} N",
            )
        )
    matched = felt(KD)
    rows.append(
        row(
            "with b = Kd: largest change of the force after the first | wave impedance | no wave "
            "is reflected | N",
            (0.0, float(np.ptp(matched)), ROUNDING),
            FORMULA,
            "the damper of the follower takes the whole wave",
        )
    )
    other = felt(SHARES[2] * KD)
    rows.append(
        holds(
            "without a match the force rings at the round trip | 2004, abstract | wave reflections "
            "may interfere with normal operation",
            bool(np.ptp(other[:: 2 * ONE_WAY]) > 0.2 * KD * SPEED),
            QUOTED,
            f"b = 3 Kd: from {other.max():.3g} N over {other.min():.3g} N to {KD * SPEED:g} N",
        )
    )
    return rows


def decay(kind: str, delay: int, b: float | None = None) -> float:
    """Ratio of the motion in the last quarter of a run to that in the quarter before.

    The leader is let go. Waves carry speeds: the pair may come to rest anywhere.
    """
    pair = sampled(kind)
    if b is not None:
        pair = replace(pair, link=Link("waves", impedance=b))
    x = free_run(pair, delay, round(T_MAX / TS) + TRIPS * delay)
    quarters = [np.ptp(part, axis=0).max() for part in np.array_split(x, 4)]
    return float(quarters[3] / quarters[2])


def _stability(quick: bool, progress: Progress) -> list[Row]:
    rows = []
    cases = [(delay, None) for delay in (QUICK_DELAYS if quick else DELAYS)]
    cases += [] if quick else [(500, b) for b in IMPEDANCES]
    words = "motion in the last quarter of the run over that in the quarter before: "
    for delay, b in cases:
        progress(f"waves, {delay} samples late")
        found = decay("waves", delay, b)
        matched = "b = Kd" if b is None else f"b = {b:g} N.s/m"
        rows.append(
            holds(
                f"waves are stable {1e3 * delay * TS:g} ms late each way, {matched} | 2004, "
                "abstract | unknown but constant delays, up to several seconds",
                found < DECAYS,
                QUOTED,
                f"{words}{found:.2g}",
            )
        )
    progress("positions, 200 samples late")
    found = decay("position-position", MOST)
    rows.append(
        holds(
            f"positions sent both ways are not, {1e3 * MOST * TS:g} ms late | none | not in the "
            "source",
            found > 1.0 / DECAYS,
            BESIDE,
            f"{words}{found:.2g}",
        )
    )
    return rows


def make(quick: bool, progress: Progress) -> Found:
    rows = (*_link(progress), *_reflections(progress), *_stability(quick, progress))
    t = TS * np.arange(ROUND_TRIPS * 2 * ONE_WAY)
    trips = TS * 2 * ONE_WAY * np.arange(ROUND_TRIPS)
    curves = []
    for share, name in zip(SHARES, ("b = Kd/3", "b = Kd, matched", "b = 3 Kd"), strict=True):
        curves.append(curve(name, 1e3 * t, felt(share * KD)))
        curves.append(curve("", 1e3 * trips, steps(share * KD), "marks"))
    force = Chart(
        "force",
        "Force at a leader that moves off",
        "The follower is blocked and its damper should be felt: 5 N at 0.1 m/s. The leader first "
        "feels the wave impedance; what the follower reflects comes back after 100 ms, and is "
        "reflected again. Marks: the reflections summed up.",
        "time [ms]",
        "force [N]",
        tuple(curves),
    )
    whole = np.arange(PERIODS + 1)
    t = np.arange(PERIODS * PERIOD + 1)
    shown = slice(None, None, 20)
    energy = Chart(
        "energy",
        "Energy taken by a late link",
        "A leader is swung at 1 Hz, a spring of 400 N/m at the follower, 100 ms each way. Marks: "
        "-pi K (V/omega)² sin(2 omega T) in a period, from the second one on.",
        "time [s]",
        "energy taken by the link [J]",
        (
            curve("waves, b = Kd", TS * t[shown], spring_over(KD)[shown]),
            curve("speed and force", TS * t[shown], spring_over(None)[shown], "dashed"),
            curve(
                "",
                TS * PERIOD * whole[1:],
                spring_over(None)[PERIOD] - given_in_a_period() * (whole[1:] - 1.0),
                "marks",
            ),
        ),
    )
    return Found(rows, (force, energy))


CLASSIC = Classic(
    "niemeyer1991",
    "Wave variables: a link that no constant delay makes active",
    "R. J. Anderson, M. W. Spong, Bilateral control of teleoperators with time delay, IEEE Trans. "
    "Automatic Control 34 (1989) 494-501; G. Niemeyer, J.-J. E. Slotine, Stable adaptive "
    "teleoperation, IEEE J. Oceanic Engineering 16 (1991) 152-162; the same, Telemanipulation with "
    "time delays, Int. J. Robotics Research 23 (2004) 873-890",
    "The abstract of 2004 could be read (ijrr.org): passive transmission guarantees stability at "
    "unknown but constant delays of up to several seconds, while wave reflections may interfere. "
    "The articles could not. The wave transformation, u = (b v + F)/sqrt(2 b) and w = (b v - F)/"
    "sqrt(2 b), is stated in many places; what follows from it is derived in equations.md, section "
    "8, and the numbers are ours. The pair is that of yokokohji1994.",
    "Runs from sample to sample at 1 kHz: the arms move exactly under held forces, messages wait "
    "in a queue. The energy of a link is summed up at its ends, force by speed.",
    make,
)
