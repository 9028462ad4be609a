"""The ledger: numbers printed or implied in the paper, compared with the simulator row by row.

Every number in a row, and in its reason, comes from a run or from the linear loop. The printed
numbers are taken by name from model/constants.py; none is typed here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..formulas import arm as arm_law
from ..kernel.engine import arm_at
from ..model.arm import Arm
from ..model.constants import (
    AXES,
    B_CONSTANT,
    B_STABILITY,
    B_VARIABLE,
    BORDER,
    C_POLE,
    CLAY_X,
    CM,
    GAIN_LIMIT_PRINTED,
    GAINS_FIG11,
    L1,
    L2,
    NOMINAL,
    TS,
    G,
    S,
)
from ..model.operator import Operator
from ..model.signals import Multisine
from ..scene.experiments import GROWTHS, free
from ..simulation.record import out_of_band_ratio
from ..theory import gain_limits, linear_loop, stability_margins
from ..theory.loops import Loop
from .ledger import TH, Row, Runs, rightmost, row, steady

CUT_EVENTS = ("enters the clay", "leaves the clay", "ends")


def ledger_rows(runs: Runs | None = None) -> list[Row]:
    """All rows, in the paper's order."""
    runs = runs or Runs()
    parts = (machine, blocks, constant, variable, largest_gains, maneuver)
    return [each for part in parts for each in part(runs)]


def machine(runs: Runs) -> Iterator[Row]:
    """The arm and its sampling (Secs. 2, 4, Eq. 14)."""
    straight, folded = (arm_at((0.0, q2))[0][0] for q2 in (0.0, math.pi))
    yield row(
        f"l1 | Sec. 4 | {L1:g} m | m",
        (L1, 0.5 * (straight + folded), 1e-12),
        "given",
        "half the sum of the handle's distances from the shoulder with the arm stretched and "
        "folded, in the MuJoCo model",
    )
    yield row(
        f"l2 | Sec. 4 | {L2:g} m | m",
        (L2, 0.5 * (straight - folded), 1e-12),
        "given",
        "half the difference of these two distances",
    )
    q = (1.2, -0.9)
    links = Arm().links
    u1x, u1y, u2x, u2y = arm_law.jacobian(*q, links)
    eq14 = np.array([[u1x + u2x, u2x], [u1y + u2y, u2y]])
    yield row(
        "Jacobian J(q) | Eq. 14 | four entries | m",
        (0.0, float(np.abs(arm_at(q)[1] - eq14).max()), 1e-14),
        "given",
        "largest difference between the printed formula and MuJoCo's Jacobian at q = (1.2, -0.9) "
        "rad",
    )
    _, J, M = arm_at(arm_law.inverse_kinematics(*NOMINAL, links))
    Lambda = np.linalg.inv(J @ np.linalg.inv(M) @ J.T)
    for i, axis in enumerate(AXES):
        yield row(
            f"handle inertia Λ{axis} at the nominal pose | Eqs. 17, 18 | not printed | kg",
            (1.0 / S[i].gain, float(Lambda[i, i]), 1e-9),
            "inferred",
            "Sh at high frequency is 1/(Λ s²), so its numerators give the inertias of both links",
        )
    yield row(
        "coupling Λxy at the nominal pose | Sec. 2 | decoupled in its nominal configuration | kg",
        (0.0, float(Lambda[0, 1]), 1e-9),
        "given",
        "the elbow is at a right angle, and link 2 is balanced about it",
    )
    ends = [_lambda_x(x, NOMINAL[1]) for x in (NOMINAL[0] - 0.1, NOMINAL[0] + 0.1)]
    yield row(
        "Λx at the ends of a 20 cm path | Sec. 4 | not stated | kg",
        (None, float(max(ends)), None),
        "not recoverable",
        f"the printed Sh holds at one pose: Λx is {Lambda[0, 0]:.4g} kg there and "
        f"{min(ends):.4g} to {max(ends):.4g} kg at the ends of the path; "
        "inertia_shaping=True keeps Λx at its nominal value",
    )
    yield row(
        "sampling period | Sec. 4 | 0.36 ms | s",
        (TS, float(np.diff(runs.constant().t[:2])[0]), 1e-12),
        "given",
        "time between two samples of the run",
    )
    yield row(
        "torque limits | Sec. 4 | not stated | N.m",
        (None, free().torque_limit[0], None),
        "not recoverable",
        "the paper has two direct-drive motors and does not state their size; we use a size that "
        "suits these inertias, and no cut reaches the limits",
    )


def _lambda_x(x: float, y: float) -> float:
    """Inertia of the arm along x, with the handle at world (x, y) [kg]."""
    links = Arm().links
    q1, q2 = arm_law.inverse_kinematics(x, y, links)
    xx, xy, yy = arm_law.mobility(arm_law.jacobian(q1, q2, links), links)
    return float(np.linalg.inv(np.array([[xx, xy], [xy, yy]]))[0, 0])


def blocks(runs: Runs) -> Iterator[Row]:
    """G, Sh and Th as identified on the simulated arm (Eqs. 15 to 19)."""
    symbols = {"gain": "numerator", "damping": "s", "stiffness": "constant term"}
    for what, places, tolerance, unit in (
        ("G", (15, 16), 5e-3, "m/m"),
        ("S", (17, 18), 2e-2, "m/N"),
    ):
        for i, axis in enumerate(AXES):
            found = runs.identified(what, axis)
            for c in found.coefficients:
                value = c.printed
                scale = CM if (what, c.name) == ("S", "gain") else 1.0
                term = (
                    f"coefficient of {symbols[c.name]}" if c.name == "damping" else symbols[c.name]
                )
                yield row(
                    f"{what}{axis}: {term} | Eq. {places[i]} | {value / scale:g} | {c.unit}",
                    (value, c.value, tolerance),
                    "given",
                    f"fitted to the simulated arm's response at the nominal pose, in {unit}"
                    + ("; printed in cm/N" if scale != 1.0 else ""),
                )
    found = runs.identified("Th", "x")
    for c, power in zip(found.coefficients, ("s²", "s", "constant"), strict=True):
        yield row(
            f"Th: {power} term | Eq. 19 | {c.printed:g} | {c.unit}",
            (c.printed, c.value, 5e-3),
            "given",
            "fitted to hand force over handle position, while a command moves the handle",
        )
    corner = _corner(TH)
    yield row(
        "crossover of Th | Sec. 4, Fig. 6 | around 3 rad/s | rad/s",
        (3.0, TH.spring / TH.damper, 1e-9),
        "inferred",
        "frequency at which spring and damper contribute equally; |Th| is 3 dB above its static "
        f"value at {corner:.3g} rad/s",
    )
    for i, axis in enumerate(AXES):
        ratio = S[i].gain / S[i].stiffness
        yield row(
            f"static S{axis} | Sec. 3.1 | Sh much smaller than G | m/N",
            (None, ratio, None),
            "contradicted",
            f"{ratio:.3g} m/N and 1 m/m have different units and cannot be compared; Sec. 4 calls "
            f"Sh significant beside G. G and Sh have different denominators (coefficients of s "
            f"{G[i].damping:g} and {S[i].damping:g} 1/s), so no single PD loop has both; the "
            "simulator therefore separates reference model and feedback",
        )


def _corner(th: Operator) -> float:
    """Where |Th| has grown to sqrt(2) of its static value [rad/s]."""
    omega = np.geomspace(0.1, 100.0, 100_001)
    size = np.abs(th.mass * (1j * omega) ** 2 + th.damper * 1j * omega + th.spring)
    return float(omega[np.argmax((size > math.sqrt(2.0) * th.spring) & (omega > 1.0))])


def largest_gains(runs: Runs) -> Iterator[Row]:
    """The gain limit and the conditions for stability (Secs. 3, 4.3)."""
    text = "; ".join(
        f"{axis}, b = {b:g}: {gain_limits.gain_limit(axis, b, TH):.4g} with Th, "
        f"{gain_limits.gain_limit(axis, b):.4g} without"
        for axis in AXES
        for b in (B_VARIABLE[0], B_CONSTANT, B_STABILITY)
    )
    yield row(
        "limit of K | Sec. 4.3 | should not exceed 5C | 1",
        (GAIN_LIMIT_PRINTED, gain_limits.gain_limit("x", B_STABILITY, TH), None),
        "contradicted",
        f"exact limits of the printed loop: {text}. The printed 5 is closest to the limit of x at "
        "b = 50",
    )
    y = gain_limits.gain_limit("y", B_STABILITY, TH)
    yield row(
        "limit of K on y, from which the paper derives 5C | Sec. 4.3, Eqs. 16, 19 | should not "
        "exceed 5C | 1",
        (GAIN_LIMIT_PRINTED, y, None),
        "contradicted",
        "Eq. 16 describes the y axis, whose exact limit is below 1",
    )
    for axis in AXES:
        verdict = stability_margins.small_gain(axis, 1.0, B_STABILITY, TH, equation=11)
        tiny = stability_margins.small_gain(axis, 1e-3, B_STABILITY, TH, equation=11)
        bands = ", ".join(f"{a:.3g} to {b:.3g}" for a, b in verdict.fails)
        yield row(
            f"inequality (11) on {axis}, K = 1 | Eq. 11 | satisfied below 5C | 1",
            (None, verdict.margin, None),
            "contradicted",
            f"fails from {bands} rad/s, and with K = 0.001 still below "
            f"{tiny.fails[0][1]:.3g} rad/s: C integrates and Th(0) = {TH.spring:g} N/m, so for "
            "every K |GC(Te + Th)| grows without bound at low frequency. The condition is "
            "sufficient, not necessary",
        )
    stiff = [
        gain_limits.gain_limit("x", B_STABILITY, Operator(0.25 * n, 2.0 * n, 6.0 * n))
        for n in (1.0, 10.0, 100.0)
    ]
    yield row(
        "a more rigid operator needs a smaller C | Sec. 3.2 | stated | 1",
        (None, stiff[0], None),
        "given" if stiff[0] > stiff[1] > stiff[2] else "contradicted",
        "limit of K on x with Th, 10 Th, 100 Th: "
        + ", ".join(f"{k:.4g}" for k in stiff)
        + (
            "; the zeros of GC + Sh lie in the left half-plane, so with a rigid hand the loop is "
            "stable for every K"
            if math.isinf(stiff[-1])
            else ""
        ),
    )


def constant(runs: Runs) -> Iterator[Row]:
    """The constant cut (Sec. 4.1, Figs. 7, 8)."""
    r = runs.constant()
    edges = [c.border for c in r.crossings]
    yield row(
        "clay begins | Sec. 4.1 | 5 cm in front | m",
        (CLAY_X[0], float(r.p[np.argmax(r.b[:, 0] > 0.0), 0]), 5e-4),
        "given",
        "position of the first sample in the clay",
    )
    yield row(
        "length of the clay | Sec. 4.1 | 10 cm | m",
        (CLAY_X[1] - CLAY_X[0], edges[1] - edges[0], 1e-9),
        "given",
        "distance between the two borders that the tool crosses",
    )
    yield row(
        "force/velocity in the clay | Sec. 4.1, Fig. 8 | 90 (N-s/m) | N.s/m",
        (B_CONSTANT, steady(r, "x", 1, "steady_fe_over_v"), 1e-3),
        "given",
        "fe/v at steady speed; the paper's results are in N·s/m",
    )
    odd = runs.constant(b=B_CONSTANT / CM, t_max=20.0)
    yield row(
        "b2, as printed among the assumptions | Sec. 4.1 | 90 N-s/cm | N.s/m",
        (B_CONSTANT, steady(r, "x", 1, "steady_fe_over_v"), 1e-3),
        "corrected",
        f"we read N·s/m: with N·s/cm fe/v is {steady(odd, 'x', 1, 'fe_over_v'):.0f} N·s/m, a "
        "hundred times what Sec. 4.1 then reports, and at "
        f"{steady(odd, 'x', 1, 'steady_speed'):.2g} m/s the tool is only "
        f"{100 * odd.p[-1, 0] - 100 * CLAY_X[0]:.2g} cm deep in the clay after 20 s",
    )
    yield row(
        "b1, damper before the clay | Sec. 4.1, Eq. 20 | 10 N-s/cm | N.s/m",
        (C_POLE, steady(runs.free(length=0.2, t_max=8.0), "x", 0, "steady_fh_over_v"), 1e-2),
        "corrected",
        "fh/v in free space, which is 10/K, the damper of the compensator; here too we read N·s/m",
    )
    yield row(
        "force/velocity outside | Sec. 4.1, Fig. 8 | approach zero | N.s/m",
        (0.0, float(np.nanmax(np.abs(r.ratio(r.fe)[r.b[:, 0] == 0.0, 0]))), 1e-12),
        "given",
        "largest fe/v outside the clay; fh/v is 10 N·s/m there",
    )
    inside = r.steady()[:, 0] & (r.b[:, 0] > 0.0)
    v = r.v[inside, 0]
    yield row(
        "speed in the clay | Sec. 4.1 | approximately constant | m/s",
        (linear_loop.steady_speed(1.0, 1.0, B_CONSTANT), float(v.mean()), 1e-3),
        "inferred",
        f"expected: K f/(10 + K b) with f = 1 N; the speed of the run varies by "
        f"{100 * np.ptp(v) / v.mean():.1g} % over the steady part",
    )
    first = runs.constant(inertia_shaping=True)
    dampings = (0.0, B_CONSTANT, 0.0)
    exact = linear_loop.crossing_times(Loop(K=1.0), r.scenario.force[0], edges, dampings)
    for c, when, name in zip(first.crossings, exact, CUT_EVENTS, strict=True):
        plain = next(x for x in r.crossings if x.border == c.border)
        yield row(
            f"time at which the constant cut {name} | Sec. 4.1 | not printed | s",
            (when, c.time, 1e-5),
            "inferred",
            "expected: exact solution with the printed transfer functions; ours: with inertia "
            f"shaping, and {plain.time:.5f} s without",
        )
    yield row(
        "fe/fh in the clay | Eq. 7 | a transfer function | 1",
        (
            abs(complex(stability_margins.transparency("x", 1.0, B_CONSTANT, np.array([1e-6]))[0])),
            steady(r, "x", 1, "steady_fe_over_v") / steady(r, "x", 1, "steady_fh_over_v"),
            1e-3,
        ),
        "given",
        "expected: Eq. 7 at zero frequency; ours: the run at steady speed",
    )
    double = runs.constant(gain=(2.0, 0.5))
    yield row(
        "influence of C on the response | Sec. 4.1 | unaffected by the choice of the controller C "
        "| N.s/m",
        (B_CONSTANT, steady(double, "x", 1, "steady_fe_over_v"), 1e-3),
        "contradicted",
        f"with K = 2, fe/v is still b, but the cut takes {double.t[-1]:.2f} s instead of "
        f"{r.t[-1]:.2f} s and enters the clay at {double.crossings[0].speed:.4f} instead of "
        f"{r.crossings[0].speed:.4f} m/s",
    )
    yield row(
        "free region behind the clay | Sec. 4.1 | 18-20 cm | m",
        (CLAY_X[1], edges[1], 1e-9),
        "corrected",
        "start of the free region: the clay ends at 15 cm, so 15 to 18 cm is free as well",
    )
    yield row(
        "maneuver of the constant cut | Sec. 4.1 | not printed | N",
        (None, r.scenario.force[0], None),
        "not recoverable",
        "we use a constant muscle force of 1 N; the force ratios do not depend on it",
    )


def variable(runs: Runs) -> Iterator[Row]:
    """The variable cut (Sec. 4.2, Figs. 9, 10)."""
    r, shaped = runs.variable("none"), runs.variable("none", inertia_shaping=True)
    yield row(
        "input force | Sec. 4.2 | 1 N at 45 degrees | N",
        (1.0, math.hypot(*r.scenario.force), 1e-12),
        "given",
    )
    for axis in AXES:
        i = AXES.index(axis)
        for k, b in enumerate(B_VARIABLE):
            yield row(
                f"b in {axis}, {'before' if k == 0 else 'beyond'} 5 cm | Eqs. "
                f"{'23, 24' if k == 0 else '25, 26'} | {b:g} | N.s/m",
                (b, steady(r, axis, k, "steady_fe_over_v"), 1e-3),
                "given",
                "fe/v at steady speed, in clay that does not grow",
            )
        for k, b in enumerate(B_VARIABLE):
            speed = linear_loop.steady_speed(r.scenario.gain[i], r.scenario.force[i], b)
            yield row(
                f"speed in {axis}, {'before' if k == 0 else 'beyond'} 5 cm | Fig. 10 | not printed "
                "| m/s",
                (speed, steady(r, axis, k, "steady_speed"), 1e-3),
                "inferred",
                f"expected: K f/(10 + K b) with K = {r.scenario.gain[i]:g}; with inertia shaping "
                f"the run gives {steady(shaped, axis, k, 'steady_speed'):.6f} m/s",
            )
    for i, axis in enumerate(AXES):
        (exact,) = linear_loop.crossing_times(
            Loop.of(r.scenario, axis, 0.0), r.scenario.force[i], (BORDER,), B_VARIABLE[:1]
        )
        mine, other = (
            next(c.time for c in x.crossings if (c.axis, c.border) == (axis, BORDER))
            for x in (r, shaped)
        )
        yield row(
            f"time at which {axis} passes 5 cm | Fig. 10 | not printed | s",
            (exact, mine, 1e-3),
            "inferred",
            "expected: exact solution with the printed transfer functions; with inertia shaping "
            f"the run gives {other:.5f} s. Without it, Λ(q) couples the motions along x and y",
        )
    grown = runs.variable()
    t0 = next(c.time for c in grown.crossings if (c.axis, c.border) == ("x", BORDER))
    late = grown.t > t0 + 2.0
    v, b = grown.v[late, 0], grown.b[late, 0]
    quasi = linear_loop.steady_speed(1.0, grown.scenario.force[0], b)
    yield row(
        "speed in x beyond 5 cm, with growth | Sec. 4.2, Fig. 10 | drops abruptly and decreases "
        "slowly | 1",
        (1.0, float((v / quasi).mean()), 1e-2),
        "given",
        "mean of speed over K f/(10 + K b(t)), from 2 s after the border on. The speed is "
        f"{grown.v[np.searchsorted(grown.t, t0), 0]:.5f} m/s at the border; after these 2 s it "
        f"falls {'monotonically' if np.all(np.diff(v) < 0.0) else 'not monotonically'} from "
        f"{v[0]:.5f} to {v[-1]:.5f} m/s",
    )
    readings = {
        "30/s": '"100 + 30t", t in s since entry',
        "0.15/s": '"100 + 0.15t", t in s (Eq. 25)',
        "0.15/sample": '"100 + 0.15t", t in samples',
    }
    for reading, words in readings.items():
        rate = GROWTHS[reading]
        x = runs.variable(reading)
        rate_found = float((x.b[-1, 0] - B_VARIABLE[1]) / (x.t[-1] - t0))
        yield row(
            f"growth of the clay, reading {reading} | Sec. 4.2, Eq. 25 | {words} | N.s/m per s",
            (rate, rate_found, 1e-3),
            "corrected" if reading == "30/s" else "contradicted",
            f"at the end of the run, b is {x.b[-1, 0]:.1f} N·s/m and the speed in x "
            f"{x.v[-1, 0]:.5f} m/s; status: {x.status}"
            + (
                ". We use this reading: only with it does the speed fall slowly, and visibly"
                if reading == "30/s"
                else ""
            ),
        )
    bad = runs.variable(as_printed=True)
    pole = rightmost("y", 1.0, B_STABILITY, None)
    held = rightmost("y", 1.0, B_STABILITY, TH)
    yield row(
        "y with K = 1 and b = 100 | Sec. 4.2, Eqs. 22, 26 | a steady cut | 1/s",
        (None, pole.real, None),
        "contradicted",
        f"the printed model is unstable: poles {pole.real:+.3g} ± {pole.imag:.3g}j 1/s "
        f"({held.real:+.3g} ± {held.imag:.3g}j with Th); status of the run: {bad.status}. We use "
        "K = 0.5 on y",
    )
    cm = runs.variable("none", b=tuple(x / CM for x in B_VARIABLE), t_max=20.0)
    yield row(
        "variable cut in N-s/cm | Sec. 4.1 beside 4.2 | N-s/cm in one, N-s/m in the other | m/s",
        (None, float(cm.v[-1, 0]), None),
        "corrected",
        f"we read N·s/m; with N·s/cm the tool is at x = {100 * cm.p[-1, 0]:.2g} cm after 20 s and "
        f"has not reached the border; status: {cm.status}",
    )


def maneuver(runs: Runs) -> Iterator[Row]:
    """The maneuver of the stability test (Sec. 4.3, Fig. 11)."""
    where = {
        GAINS_FIG11[0]: "2 in the caption, 3 in the text",
        GAINS_FIG11[1]: "3 in the text, 2 in the caption",
        GAINS_FIG11[2]: "25",
    }
    for K in GAINS_FIG11:
        r, stable = runs.stability(K), K < gain_limits.gain_limit("x", B_STABILITY, TH)
        pole = rightmost("x", K, B_STABILITY, TH)
        rms = float(np.sqrt(np.mean(r.fh[:, 0] ** 2)))
        yield row(
            f"share of the force above the band, K = {K:g} | Sec. 4.3, Fig. 11 | {where[K]} | 1",
            (0.0 if stable else 1.0, out_of_band_ratio(r), 0.05),
            "given",
            "share of the hand force's rms above the frequencies of the maneuver, 0 if the loop is "
            f"stable and linear; rms {rms:.3g} N; rightmost pole {pole.real:+.3g} ± "
            f"{abs(pole.imag):.3g}j 1/s; status: {r.status}",
        )
    small, large = (runs.stability(K) for K in (GAINS_FIG11[1], GAINS_FIG11[2]))
    ratio = float(np.abs(large.fh[:, 0]).max() / np.abs(small.fh[:, 0]).max())
    yield row(
        "largest force with K = 25, over that with K = 3 | Sec. 4.3 | much smaller in magnitude "
        "| 1",
        (None, ratio, None),
        "given",
        "only the torque limits bound the force, and they are not printed",
    )
    other = runs.stability(GAINS_FIG11[1], axis="y", inertia_shaping=True)
    yield row(
        "axis of Fig. 11 | Fig. 11 | force in x, position y | 1",
        (None, out_of_band_ratio(other, "y"), None),
        "contradicted",
        "we run the test in x: in y K = 3 is unstable as well, so the two cases of the figure "
        f"differ in x only; status in y: {other.status}",
    )
    muscle = small.scenario.muscle
    yield row(
        "maneuver of the stability test | Sec. 4.3 | arbitrary, random | N",
        (None, muscle.rms[0] if isinstance(muscle, Multisine) else 0.0, None),
        "not recoverable",
        "we use a seeded multisine of 0.1 to 2 Hz; the value is the rms of its muscle force",
    )
