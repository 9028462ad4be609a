"""The largest gain of an arm in runs: its error against run time, beside other packages.

    python -m benchmarks.arms [--out DIR]

The seven-joint leader under its gains, 500 Hz, torques a sample late, filtered rates, gravity held:
runs of hapticclay, of MuJoCo's own integrators, of Drake and of Pinocchio. The reference is the
exact map over a sample (`hc.theory.joint_limits`), whose own time is measured as well. Writes
arms.json; benchmarks.pages makes the page.
"""

from __future__ import annotations

import dataclasses
import importlib
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc

from . import arm_integrators as engine
from . import common, diagrams
from .peers.arm_mujoco import MujocoArm

OURS = (1, 2, 4)  # steps in a sample
PEERS = ("arm_drake", "arm_pinocchio")  # modules of benchmarks.peers
TIMED, REPEATS = 2000, 5  # steps of a run that is timed
POSES, POSES_QUICK = 300, 20  # of a map of the workspace
SECOND = ("RK4", "runge_kutta3")  # dashed
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
    record = hc.simulate(scenario(arm, factor, substeps, engine.SECONDS))
    last = record.scenario.controller.reference  # type: ignore[union-attr]
    size = np.abs(record.q - np.array(last)).max(axis=1)
    return record.outcome.code == "diverged" or engine.outgrows(size)


def limit(arm: hc.MjcfArm, substeps: int, guess: float) -> float:
    """Factor of all Kp at which runs begin to grow."""
    return engine.bisected(lambda x: grows(arm, x, substeps), 0.5 * guess, 2.0 * guess)


# ---- run time ------------------------------------------------------------------------------------


def spent(job: Callable[[], Any]) -> float:
    """Processor time of a job [s]."""
    begin = time.process_time()
    job()
    return time.process_time() - begin


def own_time(arm: hc.MjcfArm, substeps: int) -> float:
    """Processor time of a simulated second, law and hardware with it [s]."""
    seconds = TIMED * engine.TS / substeps
    scene = scenario(arm, 0.5, substeps, seconds)
    return spent(lambda: hc.simulate(scene)) / seconds


def peer_time(peer: Any, home: np.ndarray) -> float:
    """Processor time of a simulated second of the steps alone, at rest under held torques [s]."""
    samples = max(1, TIMED // peer.substeps)
    peer.start(home)
    weight = peer.weight()
    return spent(lambda: peer.hold(weight, samples)) / (samples * engine.TS)


def theory_times(arm: hc.MjcfArm, law: hc.JointPD, poses: int) -> list[dict[str, Any]]:
    """Processor time of the exact answers [s]."""
    TS = engine.TS
    jobs = {
        "all limits of the arm at a pose": (
            lambda: hc.theory.joint_limits(arm, law, TS, TS), REPEATS,
        ),
        f"the common limit at {poses} poses": (
            lambda: hc.theory.over_poses(arm, law, TS, TS, poses=poses), 1,
        ),
    }  # fmt: skip
    return [
        {"question": name, "time": statistics.median(spent(job) for _ in range(rounds))}
        for name, (job, rounds) in jobs.items()
    ]


# ---- rows ----------------------------------------------------------------------------------------


def row(
    package: str, method: str, substeps: int, found: float, exact: float, times: list[float]
) -> dict[str, Any]:
    """Error of the limit and run time of one method and step."""
    error = None if np.isinf(found) else found / exact - 1.0
    return {
        "package": package, "method": method, "steps": substeps, "error": error,
        "time": statistics.median(times),
    }  # fmt: skip


def own_rows(arm: hc.MjcfArm, exact: float) -> list[dict[str, Any]]:
    """Those of hapticclay."""
    return [
        row(
            "hapticclay", "sampled", n, limit(arm, n, exact), exact,
            [own_time(arm, n) for _ in range(REPEATS)],
        )
        for n in OURS
    ]  # fmt: skip


def peer_rows(
    package: str, make: Any, cases: list[tuple[str, int]], arm: hc.MjcfArm, exact: float
) -> list[dict[str, Any]]:
    """Those of another package.

    Args:
        package: its name.
        make: (file, method, Ts, substeps) to the arm.
        cases: method and steps in a sample.
        arm: the same in hapticclay.
        exact: the limit.
    """
    rows = []
    for method, n in cases:
        peer = make(engine.FILE, method, engine.TS, n)
        found = engine.run_limit(peer, arm.q, True, exact)
        times = [peer_time(peer, arm.q) for _ in range(REPEATS)]
        rows.append(row(package, method, n, found, exact, times))
    return rows


def mujoco_arm(file: Path, method: str, Ts: float, substeps: int) -> MujocoArm:
    """MuJoCo's, by the name of a method."""
    return MujocoArm(file, f"mjINT_{method.upper()}", Ts, substeps)


def installed() -> tuple[list[Any], list[str]]:
    """Modules of the peers, and what is left out and why."""
    modules, omissions = [], []
    for name in PEERS:
        try:
            modules.append(importlib.import_module(f".peers.{name}", __package__))
        except ImportError as error:
            omissions.append(f"{name.removeprefix('arm_').capitalize()}: {error}")
    return modules, omissions


def main(out: Path = Path("out/bench"), quick: bool = False) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    common.warm()
    arm = hc.MjcfArm(engine.FILE)
    arm = dataclasses.replace(arm, friction=(0.0,) * len(arm.names), torque_limit=None)
    law = hc.JointPD(tuple(engine.KP), tuple(engine.KD), velocity="filter", cutoff=engine.CUTOFF)
    exact = hc.theory.joint_limits(arm, law, engine.TS, engine.TS).scale
    every = 4 if quick else 1
    modules, omissions = installed()
    rows = own_rows(arm, exact)
    cases = [(name, n) for name, _, n in engine.CASES]
    rows += peer_rows("MuJoCo", mujoco_arm, cases[::every], arm, exact)
    for x in modules:
        rows += peer_rows(x.NAME, x.make, x.CASES[::every], arm, exact)
    found = {
        "exact": exact, "resolution": resolution(), "seconds": engine.SECONDS, "rows": rows,
        "theory": theory_times(arm, law, POSES_QUICK if quick else POSES), "omissions": omissions,
    }  # fmt: skip
    return common.write(out, "arms", found)


def resolution() -> float:
    """Share of a limit to which the bisection of a peer's runs finds it."""
    return float((8.0 / 0.5) ** (0.5 / 2**engine.HALVINGS) - 1.0)


# ---- page ----------------------------------------------------------------------------------------


def error_words(error: float | None) -> str:
    """An error in per cent."""
    return "no limit found" if error is None else f"{100.0 * error:+.2f} %"


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    cells = [
        [
            r["package"],
            r["method"],
            engine.step_words(r["steps"]),
            error_words(r["error"]),
            common.milliseconds(r["time"]),
        ]
        for r in data["rows"]
    ]
    head = ["package", "method", "step", "error of the limit", "run time [ms/s]"]
    times = [[r["question"], common.milliseconds(r["time"])] for r in data["theory"]]
    return [
        "The seven-joint leader of `mjcf/arms` under its gains at 500 Hz, torques a sample late, "
        "rates filtered at 90 rad/s, gravity held, without friction. All Kp are multiplied by a "
        "factor until a run from a deviation of 1e-7 rad grows. By the exact map over a sample "
        f"that is at {data['exact']:.4f}; the bisection finds it to "
        f"{100.0 * data['resolution']:.2f} %, where runs have {data['seconds']:g} s to grow. Run "
        "time: processor time of a simulated second, of hapticclay with law, hardware and record, "
        "of the others the steps alone. Pinocchio has no integrator of its own for this: its `aba` "
        "is called from a loop in Python, which is part of its run time.",
        "![Error of the gain limit over run time, a line a method](arms.png)",
        common.table(cells, head),
        "Semi-implicit steps, of MuJoCo, Drake and Pinocchio alike, move positions by the rates at "
        "the end of a step: half a step of the hold's lag is missing, and a gain that buzzes on "
        "the arm is stable in such a run ([why](../mujoco_stable.md)).",
        "## The exact answer",
        "Without runs, processor time:",
        common.table(times, ["question", "time [ms]"]),
    ]


def figures(data: dict[str, Any]) -> dict[str, Any]:
    """Error of the limit over run time, both in logarithms."""
    import matplotlib

    from hapticclay.views.style import STYLE

    with matplotlib.rc_context(STYLE):
        return {"arms.png": drawn(data)}


def drawn(data: dict[str, Any]) -> Any:
    """The diagram in the present style."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    ax = figure.add_subplot()
    lines: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for r in data["rows"]:
        if r["error"] is not None:
            lines.setdefault((r["package"], r["method"]), []).append(r)
    packages = list(dict.fromkeys(package for package, _ in lines))
    floor = 100.0 * data["resolution"]
    for k, ((package, method), rows) in enumerate(lines.items()):
        ax.loglog(
            [1e3 * r["time"] for r in rows],
            [max(floor, 100.0 * abs(r["error"])) for r in rows],
            marker=diagrams.MARKERS[k % len(diagrams.MARKERS)],
            color=diagrams.COLORS[packages.index(package)],
            ls="--" if method in SECOND else "-",
            lw=2.0 if k == 0 else 1.2,
            ms=5,
            label=f"{package}, {method}",
        )
    ax.axhspan(0.5 * floor, floor, color="0.92", zorder=0)
    ax.text(0.02, 0.02, "found no closer", transform=ax.transAxes, color="0.35", fontsize=8)
    ax.set(xlabel="processor time per simulated second [ms]", ylim=(0.5 * floor, 100.0))
    ax.set(ylabel="error of the largest gain [%]")
    ax.grid(color="0.9")
    ax.legend(frameon=False, fontsize=8)
    return figure


def conclusions(data: dict[str, Any]) -> list[str]:
    """How far runs are off at one step in a sample, and what the exact answer takes."""
    at_one = {(r["package"], r["method"]): r for r in data["rows"] if r["steps"] == 1}
    ours = at_one.pop(("hapticclay", "sampled"))
    said = f"hapticclay's runs are {error_words(ours['error'])} off"
    shown = {"Euler", "discrete", "semi-implicit Euler"}
    for (package, method), r in at_one.items():
        if method in shown:
            said += f", {package}'s ({method}) {error_words(r['error'])}"
    exact = common.milliseconds(data["theory"][0]["time"])
    return [
        f"Gain limits of arms. With one step in a control sample {said}; the exact map gives all "
        f"limits of the arm in {exact} ms."
    ]


if __name__ == "__main__":
    parser = common.parser(__doc__)
    print("\n\n".join(sections(main(parser.parse_args().out))))
