"""A step of an arm from a file over `mj_step` of the same file, both compiled.

    python -m benchmarks.arm_speed [leader_7]

The two take turns on one processor; the median of their ratios is shown. `mj_step` has the file's
friction, limits and no controller; a step of a run also has its law, held torques, hand and record.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import mujoco
import numpy as np

import hapticclay as hc
from hapticclay.simulation.run import Run

STEPS, TURNS = 4000, 15
TS = 1e-3
HAND = hc.Operator(0.25, 2.0, 6.0)


def scene(arm: hc.MjcfArm, ratio: int, hand: hc.Operator | None) -> hc.Scenario:
    """A run that holds a pose near the arm's own."""
    n = len(arm.names)
    law = hc.JointPD(
        (5.0,) * n, (0.1,) * n, velocity="filter", cutoff=90.0, reference=tuple(arm.q + 0.05)
    )
    return hc.Scenario(
        arm=arm, controller=law, Ts=TS, dt=TS / ratio, t_max=1e4, operator=hand,
        force=(0.0, 0.0), stop_when_unstable=False,
    )  # fmt: skip


def ours(scenario: hc.Scenario) -> Callable[[], None]:
    """Makes steps of a run; samples fill one buffer again and again."""
    run = Run(scenario, 1, "native")

    def go() -> None:
        run.row.s.row = 0
        run.row.advance(STEPS)

    return go


def engine(arm: hc.MjcfArm, dt: float) -> Callable[[], None]:
    """Makes steps of the engine alone, from the arm's pose."""
    model = arm.mechanism.model
    model.opt.timestep = dt
    data = mujoco.MjData(model)

    def go() -> None:
        data.qpos[:], data.qvel[:] = arm.mechanism.pose, 0.0
        mujoco.mj_step(model, data, nstep=STEPS)

    return go


def seconds(go: Callable[[], None]) -> float:
    """Processor time of a step [s]."""
    begin = time.process_time()
    go()
    return (time.process_time() - begin) / STEPS


def compared(card: str, ratio: int, hand: hc.Operator | None, rubs: bool) -> tuple[float, float]:
    """Median time of a step of a run [s], and median of its ratio to one of the engine."""
    arm = hc.MjcfArm(card)
    if not rubs:
        arm = hc.MjcfArm(card, friction=[0.0] * len(arm.names))
    a, b = ours(scene(arm, ratio, hand)), engine(hc.MjcfArm(card), TS / ratio)
    pairs = np.array([(seconds(a), seconds(b)) for _ in range(TURNS)])
    return statistics.median(pairs[:, 0]), statistics.median(pairs[:, 0] / pairs[:, 1])


def main(card: str = "leader_7") -> None:
    """Prints the table."""
    print(f"{card}, {STEPS} steps, median of {TURNS} turns")
    print("| friction | steps a sample | hand | step [us] | over mj_step |\n|---|---|---|---|---|")
    for rubs in (False, True):
        for ratio in (1, 4):
            for hand in (None, HAND):
                step, times = compared(card, ratio, hand, rubs)
                row = "yes" if rubs else "no", ratio, "yes" if hand else "no"
                print(f"| {row[0]} | {row[1]} | {row[2]} | {1e6 * step:.2f} | {times:.2f} |")


if __name__ == "__main__":
    main(*sys.argv[1:2])
