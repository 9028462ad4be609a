"""Where MuJoCo's own integrators put the largest gain of an arm, beside the exact limit.

    python -m benchmarks.arm_integrators

The leader of mjcf/arms under its gains, 500 Hz, filtered rates, gravity held.
A bisection on the common factor of all Kp asks of each integrator and step whether a run grows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc

from .peers.arm_mujoco import MujocoArm

FILE = Path(__file__).parents[1] / "mjcf" / "arms" / "leader_7.xml"
TS, CUTOFF, SECONDS = 2e-3, 90.0, 4.0
KP = np.array([240.0, 240.0, 240.0, 240.0, 24.0, 31.0, 25.0])
KD = np.array([3.0, 3.0, 3.0, 3.0, 0.2, 0.2, 0.2])
HALVINGS = 11
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
    """Whether a run of MuJoCo from a small deviation grows."""
    return run_grows(MujocoArm(FILE, integrator, TS, substeps), arm.q, Kp, late, seconds)


def run_grows(peer: Any, home: np.ndarray, Kp: np.ndarray, late: bool, seconds: float) -> bool:
    """Whether a run of an arm of a package from a small deviation grows under the law."""
    peer.start(home + 1e-7 * np.random.default_rng(0).normal(size=len(home)))
    rate, last, sizes, held = np.zeros(len(home)), peer.q, [], None
    for _ in range(round(seconds / TS)):
        q = peer.q
        rate, last = (rate + CUTOFF * (q - last)) / (1.0 + CUTOFF * TS), q
        torque = peer.weight() - Kp * (q - home) - KD * rate
        peer.hold(held if late and held is not None else torque)
        held = torque
        sizes.append(np.abs(peer.q - home).max())
        if not sizes[-1] < 1e-2:
            return True
    return outgrows(np.array(sizes))


def outgrows(sizes: np.ndarray) -> bool:
    """Whether deviations are larger in the last quarter of a run than in the one before."""
    n = len(sizes) // 4
    return bool(sizes[-n:].max() > sizes[-2 * n : -n].max())


def limit(arm: hc.MjcfArm, integrator: str, substeps: int, late: bool, guess: float) -> float:
    """Factor of all Kp at which runs of MuJoCo begin to grow; inf above 8 times the guess."""
    return run_limit(MujocoArm(FILE, integrator, TS, substeps), arm.q, late, guess)


def run_limit(peer: Any, home: np.ndarray, late: bool, guess: float) -> float:
    """Factor of all Kp at which runs of an arm of a package begin to grow; inf above 8 guesses."""
    low, high = 0.5 * guess, 8.0 * guess
    if not run_grows(peer, home, high * KP, late, SECONDS):
        return np.inf
    return bisected(lambda x: run_grows(peer, home, x * KP, late, SECONDS), low, high)


def bisected(
    is_over: Callable[[float], bool], low: float, high: float, halvings: int | None = None
) -> float:
    """Factor between two at which runs begin to grow."""
    for _ in range(HALVINGS if halvings is None else halvings):
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
