"""Rows of the ledger on the machine and its model: Secs. 2, 3, 4 and Eqs. 1 to 19."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..model import arm
from ..model.experiments import free
from ..model.scenario import (
    AXES,
    B_CONSTANT,
    B_STABILITY,
    B_VARIABLE,
    CM,
    GAIN_LIMIT_PRINTED,
    L1,
    L2,
    NOMINAL,
    TS,
    G,
    Operator,
    S,
)
from ..stepping.engine import mujoco
from ..stepping.scene import build
from ..theory import linear_loop, margins
from .ledger import Row, Runs


def machine(runs: Runs) -> Iterator[Row]:

    model = build(free())
    data = mujoco.MjData(model)
    handle = model.site("handle").id

    def at(q1: float, q2: float) -> np.ndarray:
        data.qpos[:] = q1, q2
        mujoco.mj_forward(model, data)
        return data.site_xpos[handle].copy()

    straight, folded = at(0.0, 0.0)[0], at(0.0, math.pi)[0]
    yield Row(
        "l1",
        "Sec. 4",
        f"{L1:g} m",
        "m",
        L1,
        0.5 * (straight + folded),
        1e-12,
        "given",
        "half the sum of the handle's distance with the arm stretched and folded, in the engine's model",
    )
    yield Row("l2", "Sec. 4", f"{L2:g} m", "m", L2, 0.5 * (straight - folded), 1e-12, "given", "half the difference")
    q = (1.2, -0.9)
    at(*q)
    engine = np.zeros((3, 2))
    mujoco.mj_jacSite(model, data, engine, None, handle)
    u1x, u1y, u2x, u2y = arm.columns(math.sin(q[0]), math.cos(q[0]), math.sin(sum(q)), math.cos(sum(q)))
    eq14 = np.array([[u1x + u2x, u2x], [u1y + u2y, u2y]])
    yield Row(
        "Jacobian J(q)",
        "Eq. 14",
        "four entries",
        "m",
        0.0,
        float(np.abs(engine[:2] - eq14).max()),
        1e-14,
        "given",
        "largest difference between the printed formula and the engine's own at q = (1.2, -0.9)",
    )
    at(*arm.inverse(*NOMINAL))
    mujoco.mj_jacSite(model, data, engine, None, handle)
    M = np.zeros((2, 2))
    mujoco.mj_fullM(model, data, M)
    Lambda = np.linalg.inv(engine[:2] @ np.linalg.inv(M) @ engine[:2].T)
    for i, axis in enumerate(AXES):
        yield Row(
            f"handle inertia Λ{axis} at the nominal pose",
            "Eqs. 17, 18",
            "not printed",
            "kg",
            1.0 / S[i].gain,
            float(Lambda[i, i]),
            1e-9,
            "inferred",
            "Sh at high frequency is 1/(Λ s²): the inertias of both links follow from its numerators",
        )
    yield Row(
        "coupling Λxy at the nominal pose",
        "Sec. 2",
        "decoupled in its nominal configuration",
        "kg",
        0.0,
        float(Lambda[0, 1]),
        1e-9,
        "given",
        "elbow square, link 2 balanced about it",
    )
    w = np.array([1.0 / lam[0, 0] for lam in (Lambda,)])
    ends = [np.linalg.inv(_mobility(x, NOMINAL[1]))[0, 0] for x in (NOMINAL[0] - 0.1, NOMINAL[0] + 0.1)]
    yield Row(
        "Λx at the ends of a 20 cm path",
        "Sec. 4",
        "not said",
        "kg",
        None,
        float(max(ends)),
        None,
        "not recoverable",
        f"the printed Sh holds at one pose: Λx is {1 / w[0]:.4g} kg there and "
        f"{min(ends):.4g} to {max(ends):.4g} kg at the ends; shaping=True keeps it",
    )
    yield Row("sampling period", "Sec. 4", "0.36 ms", "s", TS, float(np.diff(runs.constant().t[:2])[0]), 1e-12, "given")
    yield Row(
        "torque limits",
        "Sec. 4",
        "not said",
        "N.m",
        None,
        free().torque_limit[0],
        None,
        "not recoverable",
        "two direct-drive motors of unnamed size; ours is of the class that carries such inertias, and no run "
        "of the cuts meets it",
    )


def _mobility(x: float, y: float) -> np.ndarray:
    q1, q2 = arm.inverse(x, y)
    w = arm.mobility(*arm.columns(math.sin(q1), math.cos(q1), math.sin(q1 + q2), math.cos(q1 + q2)))
    return np.array([[w[0], w[1]], [w[1], w[2]]])


def blocks(runs: Runs) -> Iterator[Row]:
    symbols = {"gain": "numerator", "damping": "s", "stiffness": "constant term"}
    for what, places, tolerance, unit in (("G", (15, 16), 5e-3, "m/m"), ("S", (17, 18), 2e-2, "m/N")):
        for i, axis in enumerate(AXES):
            found = runs.identified(what, axis)
            for c in found.coefficients:
                value = c.printed
                scale = CM if (what, c.name) == ("S", "gain") else 1.0
                term = f"coefficient of {symbols[c.name]}" if c.name == "damping" else symbols[c.name]
                yield Row(
                    f"{what}{axis}: {term}",
                    f"Eq. {places[i]}",
                    f"{value / scale:g}",
                    c.unit,
                    value,
                    c.value,
                    tolerance,
                    "given",
                    f"fitted to the response of the simulated arm at the nominal pose, "
                    f"{unit}" + ("; printed in cm/N" if scale != 1.0 else ""),
                )
    found = runs.identified("Th", "x")
    for c, power in zip(found.coefficients, ("s²", "s", "constant"), strict=True):
        yield Row(
            f"Th: {power} term",
            "Eq. 19",
            f"{c.printed:g}",
            c.unit,
            c.printed,
            c.value,
            5e-3,
            "given",
            "fitted to hand force over position, the handle moved by a command",
        )
    th = Operator()
    corner = _corner(th)
    yield Row(
        "crossover of Th",
        "Sec. 4, Fig. 6",
        "around 3 rad/s",
        "rad/s",
        3.0,
        th.spring / th.damper,
        1e-9,
        "inferred",
        f"where spring and damper are equal; |Th| has left its static value by 3 dB at {corner:.3g} rad/s",
    )
    for i, axis in enumerate(AXES):
        ratio = S[i].gain / S[i].stiffness
        yield Row(
            f"static S{axis}",
            "Sec. 3.1",
            "Sh much smaller than G",
            "m/N",
            None,
            ratio,
            None,
            "contradicted",
            f"{ratio:.3g} m/N and 1 m/m cannot be compared; Sec. 4 calls Sh significant beside G; "
            f"with {G[i].damping:g} and {S[i].damping:g} 1/s they are not even one servo's two answers: "
            "no plain PD loop gives both, so reference model and feedback are separate here",
        )


def _corner(th: Operator) -> float:
    """Where |Th| has grown to sqrt(2) of its static value [rad/s]."""
    omega = np.geomspace(0.1, 100.0, 100_001)
    size = np.abs(th.mass * (1j * omega) ** 2 + th.damper * 1j * omega + th.spring)
    return float(omega[np.argmax((size > math.sqrt(2.0) * th.spring) & (omega > 1.0))])


def limits(runs: Runs) -> Iterator[Row]:
    text = "; ".join(
        f"{axis}, b = {b:g}: {linear_loop.gain_limit(axis, b, Operator()):.4g} with Th, {linear_loop.gain_limit(axis, b):.4g} without"
        for axis in AXES
        for b in (B_VARIABLE[0], B_CONSTANT, B_STABILITY)
    )
    yield Row(
        "limit of K",
        "Sec. 4.3",
        "should not exceed 5C",
        "1",
        GAIN_LIMIT_PRINTED,
        linear_loop.gain_limit("x", B_STABILITY, Operator()),
        None,
        "contradicted",
        f"exact limits of the printed loop: {text}. The printed 5 is nearest x at b = 50",
    )
    y = linear_loop.gain_limit("y", B_STABILITY, Operator())
    yield Row(
        "limit of K on y, from which the 5C is derived",
        "Sec. 4.3, Eqs. 16, 19",
        "should not exceed 5C",
        "1",
        GAIN_LIMIT_PRINTED,
        y,
        None,
        "contradicted",
        "Eq. 16 is the y axis, whose exact limit is below 1",
    )
    for axis in AXES:
        verdict = margins.small_gain(axis, 1.0, B_STABILITY, equation=11)
        tiny = margins.small_gain(axis, 1e-3, B_STABILITY, equation=11)
        bands = ", ".join(f"{a:.3g} to {b:.3g}" for a, b in verdict.fails)
        yield Row(
            f"inequality (11) on {axis}, K = 1",
            "Eq. 11",
            "satisfied below 5C",
            "1",
            None,
            verdict.margin,
            None,
            "contradicted",
            f"fails at {bands} rad/s, and at K = 0.001 still below "
            f"{tiny.fails[0][1]:.3g} rad/s: C integrates and Th(0) = {Operator().spring:g} N/m, so |GC(Te + Th)| has "
            "no bound at low frequency, whatever K. The condition is sufficient, not necessary",
        )
    stiff = [linear_loop.gain_limit("x", B_STABILITY, Operator(0.25 * n, 2.0 * n, 6.0 * n)) for n in (1.0, 10.0, 100.0)]
    yield Row(
        "a more rigid operator needs a smaller C",
        "Sec. 3.2",
        "said",
        "1",
        None,
        stiff[0],
        None,
        "given" if stiff[0] > stiff[1] > stiff[2] else "contradicted",
        "limit of K on x with Th, 10 Th, 100 Th: "
        + ", ".join(f"{k:.4g}" for k in stiff)
        + ("; the zeros of GC + Sh lie left of the axis, so a rigid hand bears any K" if math.isinf(stiff[-1]) else ""),
    )
