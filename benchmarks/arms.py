"""The largest gain of an arm in runs: its error against run time, beside MuJoCo's own integrators.

    python -m benchmarks.arms [--out DIR]

The seven-joint leader under its gains, 500 Hz, torques a sample late, filtered rates, gravity held.
The reference is the exact map over a sample (`hc.theory.joint_limits`). Writes arms.json;
benchmarks.pages makes the page.
"""

from __future__ import annotations

import copy
import dataclasses
import statistics
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import hapticclay as hc

from . import arm_integrators as engine
from . import common

OURS = (1, 2, 4)  # steps in a sample
SECONDS, TIMED, REPEATS = 2.0, 20_000, 5
DEVIATION = 1e-7  # [rad] from which a run grows or decays


def scenario(arm: hc.MjcfArm, factor: float, substeps: int, seconds: float) -> hc.Scenario:
    """A run from a small deviation, all Kp times a factor."""
    away = DEVIATION * np.random.default_rng(0).normal(size=len(arm.names))
    law = hc.JointPD(
        tuple(factor * engine.KP), tuple(engine.KD), velocity="filter", cutoff=engine.CUTOFF,
        reference=tuple(arm.q + away),
    )  # fmt: skip
    return hc.Scenario(
        arm=arm, controller=law, Ts=engine.TS, dt=engine.TS / substeps, t_max=seconds,
        hardware=hc.Hardware(delay=engine.TS), stop_when_unstable=False,
    )  # fmt: skip


def grows(arm: hc.MjcfArm, factor: float, substeps: int) -> bool:
    """Whether such a run grows."""
    record = hc.simulate(scenario(arm, factor, substeps, SECONDS))
    last = record.scenario.controller.reference  # type: ignore[union-attr]
    size = np.abs(record.q - np.array(last)).max(axis=1)
    return record.outcome.code == "diverged" or engine.outgrows(size)


def limit(arm: hc.MjcfArm, substeps: int, guess: float) -> float:
    """Factor of all Kp at which runs begin to grow."""
    return engine.bisected(lambda x: grows(arm, x, substeps), 0.5 * guess, 2.0 * guess)


# ---- run time ------------------------------------------------------------------------------------


def own_time(arm: hc.MjcfArm, substeps: int) -> float:
    """Processor time of a simulated second, law and hardware with it [s]."""
    seconds = TIMED * engine.TS / substeps / 10.0
    scene = scenario(arm, 0.5, substeps, seconds)
    begin = time.process_time()
    hc.simulate(scene)
    return (time.process_time() - begin) / seconds


def engine_time(arm: hc.MjcfArm, integrator: str, substeps: int) -> float:
    """Processor time of a simulated second of the engine's steps alone [s]."""
    model = copy.copy(arm.mechanism.model)
    model.dof_frictionloss[:] = 0.0
    model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
    model.opt.timestep = engine.TS / substeps
    data = mujoco.MjData(model)
    data.qpos[:] = arm.mechanism.pose
    begin = time.process_time()
    mujoco.mj_step(model, data, TIMED // 10)
    return (time.process_time() - begin) / (TIMED // 10 * model.opt.timestep)


def row(arm: hc.MjcfArm, name: str, integrator: str, substeps: int, exact: float) -> dict[str, Any]:
    """Error of the limit and run time of one method and step; MuJoCo's: `integrator` not ""."""
    found = (
        engine.limit(arm, integrator, substeps, True, exact)
        if integrator
        else limit(arm, substeps, exact)
    )
    times = [
        engine_time(arm, integrator, substeps) if integrator else own_time(arm, substeps)
        for _ in range(REPEATS)
    ]
    error = None if np.isinf(found) else found / exact - 1.0
    return {
        "method": name, "steps": substeps, "error": error, "time": statistics.median(times),
    }  # fmt: skip


def main(out: Path = Path("out/bench"), quick: bool = False) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    common.warm()
    arm = hc.MjcfArm(engine.FILE)
    arm = dataclasses.replace(arm, friction=(0.0,) * len(arm.names), torque_limit=None)
    law = hc.JointPD(tuple(engine.KP), tuple(engine.KD), velocity="filter", cutoff=engine.CUTOFF)
    exact = hc.theory.joint_limits(arm, law, engine.TS, engine.TS).scale
    cases = [*(("hapticclay", "", n) for n in OURS), *engine.CASES]
    rows = [row(arm, *case, exact) for case in (cases[::4] if quick else cases)]
    return common.write(out, "arms", {"exact": exact, "resolution": resolution(), "rows": rows})


def resolution() -> float:
    """Share of a limit to which the bisection of MuJoCo's runs finds it."""
    return float((8.0 / 0.5) ** (0.5 / 2**engine.HALVINGS) - 1.0)


def error_words(error: float | None) -> str:
    """An error in per cent."""
    return "no limit found" if error is None else f"{100.0 * error:+.2f} %"


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    cells = [
        [
            r["method"],
            engine.step_words(r["steps"]),
            error_words(r["error"]),
            common.milliseconds(r["time"]),
        ]
        for r in data["rows"]
    ]
    head = ["method", "step", "error of the limit", "run time [ms/s]"]
    return [
        "The seven-joint leader of `mjcf/arms` under its gains at 500 Hz, torques a sample late, "
        "rates filtered at 90 rad/s, gravity held, without friction. All Kp are multiplied by a "
        "factor until a run from a deviation of 1e-7 rad grows. By the exact map over a sample "
        f"that is at {data['exact']:.4f}; the bisection finds it to "
        f"{100.0 * data['resolution']:.1f} %, where runs have {SECONDS:g} s to grow. Run time: "
        "processor time of a simulated second, of hapticclay with law, hardware and record, of "
        "MuJoCo the steps alone.",
        common.table(cells, head),
        "Euler and implicitfast of MuJoCo act on the rates half a step late, which damps: a gain "
        "that buzzes on the arm is stable in such a run ([why](../mujoco_stable.md)).",
    ]


def conclusions(data: dict[str, Any]) -> list[str]:
    """How far runs are off at one step in a sample."""
    of = {(r["method"], r["steps"]): r for r in data["rows"]}
    ours, theirs = of["hapticclay", 1], of.get(("Euler", 1))
    said = f"hapticclay's runs are {error_words(ours['error'])} off"
    if theirs is not None:
        said += f", MuJoCo's Euler {error_words(theirs['error'])}"
    return [f"Gain limits of arms. With one step in a control sample {said}."]


if __name__ == "__main__":
    parser = common.parser(__doc__)
    print("\n\n".join(sections(main(parser.parse_args().out))))
