"""Where MuJoCo's own integrators put the largest gain of an arm, beside the exact limit.

    python -m benchmarks.arm_integrators

The leader of mjcf/arms under its gains, 500 Hz, filtered rates, gravity held.
A bisection on the common factor of all Kp asks of each integrator and step whether a run grows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

import hapticclay as hc

FILE = Path(__file__).parents[1] / "mjcf" / "arms" / "leader_7.xml"
TS, CUTOFF, SECONDS = 2e-3, 90.0, 2.0
KP = np.array([240.0, 240.0, 240.0, 240.0, 24.0, 31.0, 25.0])
KD = np.array([3.0, 3.0, 3.0, 3.0, 0.2, 0.2, 0.2])
HALVINGS = 9
CASES = [
    *(("Euler", "mjINT_EULER", n) for n in (1, 4, 16, 64)),
    *(("implicitfast", "mjINT_IMPLICITFAST", n) for n in (1, 4, 16)),
    *(("RK4", "mjINT_RK4", n) for n in (1, 4)),
]


def grows(
    arm: hc.MjcfArm,
    Kp: np.ndarray,
    integrator: str,
    substeps: int,
    late: bool,
    seconds: float = SECONDS,
) -> bool:
    """Whether a run from a small deviation grows."""
    model = mujoco.MjModel.from_xml_path(str(FILE))
    model.dof_frictionloss[:], model.jnt_limited[:] = 0.0, 0
    model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
    model.opt.timestep = TS / substeps
    data, static = mujoco.MjData(model), mujoco.MjData(model)
    data.qpos[:] = arm.q + 1e-7 * np.random.default_rng(0).normal(size=model.nv)
    rate, last, sizes, held = np.zeros(model.nv), data.qpos.copy(), [], None
    for _ in range(round(seconds / TS)):
        q = data.qpos.copy()
        rate, last = (rate + CUTOFF * (q - last)) / (1.0 + CUTOFF * TS), q
        static.qpos[:] = q
        mujoco.mj_fwdPosition(model, static)
        mujoco.mj_fwdVelocity(model, static)
        torque = static.qfrc_bias - Kp * (q - arm.q) - KD * rate
        data.qfrc_applied[:] = held if late and held is not None else torque
        mujoco.mj_step(model, data, substeps)
        held = torque
        sizes.append(np.abs(data.qpos - arm.q).max())
        if not sizes[-1] < 1e-2:
            return True
    return outgrows(np.array(sizes))


def outgrows(sizes: np.ndarray) -> bool:
    """Whether deviations are larger in the last quarter of a run than in the one before."""
    n = len(sizes) // 4
    return bool(sizes[-n:].max() > sizes[-2 * n : -n].max())


def limit(arm: hc.MjcfArm, integrator: str, substeps: int, late: bool, guess: float) -> float:
    """Factor of all Kp at which runs begin to grow; inf above 8 times the guess."""
    low, high = 0.5 * guess, 8.0 * guess
    if not grows(arm, high * KP, integrator, substeps, late):
        return np.inf
    return bisected(lambda x: grows(arm, x * KP, integrator, substeps, late), low, high)


def bisected(is_over: Callable[[float], bool], low: float, high: float) -> float:
    """Factor between two at which runs begin to grow."""
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if is_over(middle) else (middle, high)
    return math.sqrt(low * high)


def step_words(substeps: int) -> str:
    """A step as a part of the sample."""
    return "Ts" if substeps == 1 else f"Ts/{substeps}"


def main() -> None:
    """Prints the table of docs/arm.md."""
    arm = hc.MjcfArm(FILE)
    law = hc.JointPD(tuple(KP), tuple(KD), velocity="filter", cutoff=CUTOFF)
    print("| integrator | step | a sample late | no delay |\n|---|---|---|---|")
    for name, integrator, substeps in CASES:
        cells = []
        for late in (True, False):
            exact = hc.theory.joint_limits(arm, law, TS, TS if late else 0.0).scale
            found = limit(arm, integrator, substeps, late, exact)
            cells.append(
                "no limit found" if np.isinf(found) else f"{100 * (found / exact - 1):+.1f} %"
            )
        print(f"| {name} | {step_words(substeps)} | {cells[0]} | {cells[1]} |", flush=True)


if __name__ == "__main__":
    main()
