"""Five labs for a course on haptics: a wall and its rate, Z-width, delay, a JND, and a pair."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import JointPD
from ..errors import choice
from ..model.shapes import Constant
from ..results import Result, figure_of
from ..scene.link import Link
from ..scene.pair import Pair
from ..scene.scenario import Scenario
from ..scene.virtual_wall import Device, VirtualWall
from ..simulation.batch import simulate_batch
from ..simulation.pair_record import PairRecord
from ..simulation.simulate import simulate
from ..theory import wall_limits
from ..theory.pair_verdict import pair_limits
from .chart import Chart, curve
from .port_energy import passivity_limit
from .staircase import Observer, Staircase, run_staircase, staircase_mean
from .wall_runs import PRESS, stiffest, unshown

MASS, DAMPER, TS = 0.1, 0.5, 1e-3  # kg, N.s/m, s
WALL = VirtualWall(device=Device(MASS, DAMPER), Ts=TS)
RATES = (0.5e-3, 1e-3, 2e-3, 4e-3)  # [s]
DAMPERS = (0.25, 0.5, 1.0)  # [N.s/m]
DAMPINGS = (0.0, 5.0, 20.0, 60.0, 120.0)  # [N.s/m]
DELAYS = (0.0, 0.5, 1.0, 2.0, 4.0)  # samples
STEPS = 8  # engine steps per sample of paths that draw energy
SHOWN = 0.6  # [s] length of the run shown live
BEYOND = 1.05  # K of that run over the limit
PUSH = 0.05  # [m/s] with which it meets the wall

STIFFNESS, FORCE, PRESSED = 500.0, 2.0, 0.4  # N/m, N, s: of the wall whose changes are judged
SETTLED = 0.25  # last share of such a run, over which the indentation is averaged
CHANGES = np.linspace(0.0, 0.4, 9)  # of stiffness at which the indentation is found by runs
ROUGH = Device(MASS, 2.0, quantum=1e-4)  # a device whose encoder hides part of a change
OBSERVER = Observer(0.08, 0.03)
STAIRCASES = (  # the rules, with small steps: large ones shift the point of convergence
    Staircase(down=2, fall=0.004, rise=0.004, reversals=60, skipped=10),
    Staircase(down=3, fall=0.004, rise=0.004, reversals=60, skipped=10),
    Staircase(down=1, fall=0.002, rise=0.006, reversals=60, skipped=10),
)
TRIED, QUICK_TRIED = 100, 30  # staircases whose mean is taken

ARM, ARM_TS = Device(1.0, 1.0), 2e-3  # of leader and follower; s
GAINS, KD = (200.0, 400.0, 800.0, 1600.0), 10.0  # Kp [N/m], and Kd [N.s/m]
SWUNG = 1.5  # [s] of a run of the pair
TRIED_DELAYS = (0.6, 1.1)  # of the rule, between which the largest delay is sought

Tell = Callable[[str], None]


@named
@dataclass(frozen=True, eq=False, repr=False)
class Lab(Result):
    """A lab: task, questions, results of its runs, and a run to watch.

    Attributes:
        name: of the lab.
        title: in a few words.
        task: description of the task.
        questions: questions for the student.
        found: answer to the first question, in one line.
        columns: its table, by column.
        charts: its figures.
        scene: run that shows the effect live, or a pair for the page.
    """

    drawn_by = "hapticclay.views.chart_plots:lab_plot"

    name: str
    title: str
    task: str
    questions: tuple[str, ...]
    found: str
    columns: dict[str, tuple]
    charts: tuple[Chart, ...]
    scene: Scenario | Pair

    def headline(self) -> str:
        """The result, in one line."""
        return f"{self.title}: {self.found}"

    def tables(self) -> dict[str, dict[str, Sequence[Any]]]:
        """The table of the lab and the curves of its figures."""
        out: dict[str, dict[str, Sequence[Any]]] = {self.name: dict(self.columns)}
        for chart in self.charts:
            out |= {f"{chart.name}: {name}": table for name, table in chart.tables().items()}
        return out

    def text(self, form: str = "") -> str:
        return f"{self.title}. {self.task}\n\n{super().text(form)}"

    def remarks(self) -> list[str]:
        """The result and the questions."""
        return ["", self.found, "", *(f"{i}. {q}" for i, q in enumerate(self.questions, 1))]

    def figures(self) -> dict[str, Any]:
        return {chart.name: figure_of(chart) for chart in self.charts}

    def contents(self) -> dict[str, Any]:
        """Name, questions and tables."""
        return {"lab": self.name, "questions": self.questions, "tables": self.tables()}


def _limits(walls: Sequence[VirtualWall]) -> list[float]:
    """Largest stable K of each wall by runs; the search starts from the linear rule [N/m]."""
    around = [wall_limits.hulin_limit(w) for w in walls]
    return [stiffest([w], [K], K, PRESS, unshown)[0] for w, K in zip(walls, around, strict=True)]


def _swinging(wall: VirtualWall, K: float) -> Scenario:
    """A run of a wall just above its limit, for display."""
    return replace(wall, K=BEYOND * K).scenario(SHOWN, push=PUSH)


def wall_lab(quick: bool, tell: Tell) -> Lab:
    """A wall and its rate: the largest stable stiffness over the control sample."""
    rates = RATES[1::2] if quick else RATES
    tell("stable walls")
    walls = [replace(WALL, Ts=T) for T in rates]
    stable = _limits(walls)
    tell("passive walls")
    passive = [passivity_limit(w, STEPS) for w in walls]
    exact = [wall_limits.stiffness_band(w)[1] for w in walls]
    ms = [1e3 * T for T in rates]
    chart = Chart(
        "rate", "Largest stiffness over the control sample",
        "Lines: 2 b/Ts, and b/(Ts/2) of the linear rule, which are the same without delay and B.",
        "control sample Ts [ms]", "largest stiffness K [N/m]",
        (
            curve("2 b/Ts", ms, [2.0 * DAMPER / T for T in rates]),
            curve("runs: stable", ms, stable, "marks"),
            curve("runs: passive", ms, passive, "marks"),
        ),
        "xy",
    )  # fmt: skip
    product = [K * T for K, T in zip(stable, rates, strict=True)]
    return Lab(
        "wall", "A wall and its rate",
        f"A device of {MASS:g} kg and {DAMPER:g} N.s/m renders a spring K without damping.",
        (
            "K Ts is nearly the same for all rates. What is it, and why?",
            "How does the limit change with the mass? Try it, then find the mass in the formula.",
            "Stable without a hand, and passive: why are the two limits so close here?",
        ),
        f"K Ts = {min(product):.4g} to {max(product):.4g} N.s/m, b is {DAMPER:g}",
        {
            "Ts [ms]": tuple(ms), "stable K by runs [N/m]": tuple(stable),
            "exact [N/m]": tuple(exact), "passive K by runs [N/m]": tuple(passive),
        },
        (chart,), _swinging(walls[-1], stable[-1]),
    )  # fmt: skip


def zwidth_lab(quick: bool, tell: Tell) -> Lab:
    """The Z-width: the K and B that a device renders stably."""
    dampers, dampings = (DAMPERS[1:2], DAMPINGS[:4:2]) if quick else (DAMPERS, DAMPINGS)
    rows: list[tuple[float, float, float, float]] = []
    curves, areas = [], []
    for b in dampers:
        tell(f"b = {b:g} N.s/m")
        walls = [replace(WALL, B=B, device=Device(MASS, b)) for B in dampings]
        found, line = _limits(walls), np.linspace(0.0, dampings[-1], 61)
        exact = [wall_limits.stiffness_band(w)[1] for w in walls]
        rows += zip([b] * len(walls), dampings, found, exact, strict=True)
        edge = [wall_limits.stiffness_band(replace(walls[0], B=float(x)))[1] for x in line]
        curves += [
            curve(f"b = {b:g} N.s/m, exact", line, edge),
            curve("", dampings, found, "marks"),
        ]
        areas.append(float(np.trapezoid(found, dampings)))
    chart = Chart(
        "zwidth", "Z-width", "Walls below a line are stable; marks are limits found by runs.",
        "virtual damping B [N.s/m]", "virtual stiffness K [N/m]", tuple(curves),
    )  # fmt: skip
    names = ("b [N.s/m]", "B [N.s/m]", "stable K by runs [N/m]", "exact [N/m]")
    top = max(rows, key=lambda r: r[2])
    return Lab(
        "zwidth", "Z-width",
        "The same device renders a spring K with a damper B whose velocity is a difference.",
        (
            "Virtual damping first helps, then harms. Which part of the loop makes it harm?",
            "Double the physical damper: by how much does the largest K grow, at B = 0 and at its "
            "best B?",
            "Which walls inside the region are passive, b > K Ts/2 + |B|, and which are not?",
        ),
        f"largest K {top[2]:.4g} N/m at B = {top[1]:g} N.s/m; area {max(areas):.3g} N^2.s/m^2",
        dict(zip(names, map(tuple, zip(*rows, strict=True)), strict=True)),
        (chart,), _swinging(replace(WALL, B=top[1]), top[2]),
    )  # fmt: skip


def delay_lab(quick: bool, tell: Tell) -> Lab:
    """Delay and passivity: the effect of a delayed force."""
    delays = DELAYS[::2][:2] if quick else DELAYS
    walls = [replace(WALL, delay=d * TS) for d in delays]
    tell("stable walls")
    stable = _limits(walls)
    tell("passive walls")
    passive = [passivity_limit(w, STEPS) for w in walls]
    line = np.linspace(0.0, delays[-1], 201)
    late = [replace(WALL, delay=float(d) * TS) for d in line]
    chart = Chart(
        "delay", "Largest stiffness over the delay",
        "Stable without a hand, and passive; lines are theory, marks runs.",
        "delay [samples]", "largest stiffness K [N/m]",
        (
            curve("stable: b/(Ts/2 + delay)", line, [wall_limits.hulin_limit(w) for w in late]),
            curve("runs: stable", delays, stable, "marks"),
            curve("passive: Colgate, Schenkel", line,
                  [wall_limits.colgate_schenkel_limit(w) for w in late]),
            curve("runs: passive", delays, passive, "marks"),
        ),
        "y",
    )  # fmt: skip
    return Lab(
        "delay", "Delay and passivity",
        "The force of the wall comes late: a bus, a second computer, a network.",
        (
            "How many samples of delay halve the stable stiffness? Derive it from the rule.",
            "Between whole samples the passive limit lies below the stable one, at whole samples "
            "they meet. What does a force that changes between two samples do to the worst path of "
            "a hand?",
            "Which device would you change to win back one sample: mass, damper or rate?",
        ),
        f"from {delays[0]:g} to {delays[-1]:g} samples: stable K {stable[0]:.4g} to "
        f"{stable[-1]:.4g} N/m, passive K {passive[0]:.4g} to {passive[-1]:.4g} N/m; passive K by "
        "runs is an upper bound, since some paths of a hand are tried and not all",
        {
            "delay [samples]": tuple(delays), "stable K by runs [N/m]": tuple(stable),
            "rule [N/m]": tuple(wall_limits.hulin_limit(w) for w in walls),
            "passive K by runs [N/m]": tuple(passive),
        },
        (chart,), _swinging(walls[-1], stable[-1]),
    )  # fmt: skip


def pressed_wall(change: float, device: Device) -> Scenario:
    """The run in which a hand presses a wall of STIFFNESS (1 + change) with FORCE."""
    K = STIFFNESS * (1.0 + change)
    damping = 0.5 * math.sqrt(K * device.mass)
    wall = VirtualWall(K=K, B=damping, device=device, Ts=TS)
    return wall.scenario(PRESSED, muscle=Constant((FORCE, 0.0)), steps=4)


def felt_changes(device: Device) -> np.ndarray:
    """Change of stiffness at the hand for CHANGES: force over indentation, by runs."""
    depths = []
    for record in simulate_batch(pressed_wall(float(x), device) for x in CHANGES):
        x = record.p[:, 0]
        depths.append(float(np.mean(x[-math.ceil(SETTLED * len(x)) :])))
    return depths[0] / np.array(depths) - 1.0


def jnd_lab(quick: bool, tell: Tell) -> Lab:
    """A just-noticeable difference of stiffness, by staircases on a known observer."""
    tell("rendered stiffness")
    felt = felt_changes(replace(ROUGH, quantum=0.0))
    rough = felt_changes(ROUGH)
    runs = QUICK_TRIED if quick else TRIED
    rows = []
    for s in STAIRCASES:
        tell(s.words)
        mean, error = staircase_mean(s, OBSERVER, runs)
        rows.append((s.words, 100.0 * s.share, OBSERVER.difference(s.share), mean, error))
    one = run_staircase(
        STAIRCASES[0], OBSERVER, stimulus=lambda x: float(np.interp(x, CHANGES, felt))
    )
    trials = np.arange(len(one.levels))
    goal = OBSERVER.difference(STAIRCASES[0].share)
    x = np.linspace(0.0, 0.2, 201)
    staircase = Chart(
        "staircase", "One staircase",
        "The change of stiffness in each trial; dashed: noticed in 70.7 % of trials.",
        "trial", "change of stiffness",
        (
            curve("1 up, 2 down", trials, one.levels, "steps"),
            curve("70.7 % of the observer", trials[[0, -1]], [goal, goal], "dashed"),
        ),
    )  # fmt: skip
    function = Chart(
        "observer", "Psychometric function",
        "The observer's function is known; marks are where the mean staircase ends.",
        "change of stiffness", "share of trials in which it is noticed",
        (
            curve("observer", x, [OBSERVER.notices(float(v)) for v in x]),
            curve("staircases", [r[3] for r in rows], [0.01 * r[1] for r in rows], "marks"),
        ),
    )  # fmt: skip
    names = ("rule", "noticed [%]", "of the observer", "by staircases", "standard error")
    lost = float(np.max(np.abs(rough - felt)))
    return Lab(
        "jnd", "Just-noticeable difference",
        f"A hand presses a wall of {STIFFNESS:g} N/m with {FORCE:g} N and says whether a second "
        f"one is stiffer. The observer is simulated: threshold {100.0 * OBSERVER.threshold:g} %, "
        f"spread {100.0 * OBSERVER.spread:g} %.",
        (
            "Why does '1 up, 2 down' not end at 50 %? Derive 70.7 % and 79.4 %.",
            "Make the steps five times as large. Does the mean still end there?",
            "An encoder of 0.1 mm changes what is felt. Which changes can no rule find?",
        ),
        f"70.7 % at {rows[0][3]:.4f}, known {goal:.4f}; the encoder hides up to "
        f"{100.0 * lost:.2g} % of stiffness",
        dict(zip(names, map(tuple, zip(*rows, strict=True)), strict=True)),
        (staircase, function), pressed_wall(0.0, ROUGH),
    )  # fmt: skip


def pushed_pair(Kp: float, steps: int) -> Pair:
    """A leader, pushed, and a follower, `steps` half samples apart each way."""
    link = Link(delay=0.5 * ARM_TS * steps)
    return Pair(ARM, ARM, JointPD((Kp,), (KD,)), link, Ts=ARM_TS, t_max=SWUNG)


def swings_grow(record: PairRecord) -> bool:
    """Whether both arms swing against each other farther in the last quarter than before it."""
    third, last = np.array_split(np.abs(record.off), 4)[2:]
    return bool(record.ended) or bool(last.max() > third.max())


def delay_rule(Kp: float) -> float:
    """One-way delay at which late stiffness cancels the damping of opposed arms [s]."""
    return (ARM.damper + 2.0 * KD) / Kp - ARM_TS


def latest(Kp: float) -> int:
    """Largest stable one-way delay by runs [half samples]."""
    low, high = (round(x * delay_rule(Kp) / (0.5 * ARM_TS)) for x in TRIED_DELAYS)
    while high - low > 1:
        middle = (low + high) // 2
        grows = swings_grow(simulate(pushed_pair(Kp, middle)))
        low, high = (low, middle) if grows else (middle, high)
    return low


def pair_lab(quick: bool, tell: Tell) -> Lab:
    """Leader and follower: how much delay their link may have, over their gain."""
    gains = GAINS[1::2] if quick else GAINS
    found = []
    for Kp in gains:
        tell(f"Kp = {Kp:g} N/m")
        found.append(latest(Kp))
    limits = [pair_limits(pushed_pair(Kp, 0)) for Kp in gains]
    runs, exact = [0.5e3 * ARM_TS * n for n in found], [1e3 * x.delay for x in limits]
    line = np.geomspace(gains[0], gains[-1], 11 if quick else 41)
    rule = [1e3 * delay_rule(float(Kp)) for Kp in line]
    all_exact = [1e3 * pair_limits(pushed_pair(float(Kp), 0)).delay for Kp in line]
    late = Chart(
        "delay", "Largest delay over the gain",
        "Link one way; stable below. Marks are runs, in steps of half a sample.",
        "gain Kp [N/m]", "largest one-way delay [ms]",
        (
            curve("exact", line, all_exact), curve("runs: stable", gains, runs, "marks"),
            curve("(b + 2 Kd)/Kp - Ts", line, rule, "dashed"),
        ),
        "xy",
    )  # fmt: skip
    steps, Kp = found[-1], gains[-1]
    tell("below and beyond the limit")
    shown = {n: simulate(pushed_pair(Kp, n)) for n in (round(0.7 * steps), round(1.3 * steps))}
    swings = Chart(
        "swings", "Beyond the limit both arms swing against each other",
        f"Follower less leader after a push of the leader; Kp = {Kp:g} N/m.",
        "time [s]", "follower off [mm]",
        tuple(
            curve(f"{0.5e3 * ARM_TS * n:g} ms", x.t, 1e3 * x.off[:, 0]) for n, x in shown.items()
        ),
    )  # fmt: skip
    return Lab(
        "pair", "Leader and follower",
        f"Two devices of {ARM.mass:g} kg and {ARM.damper:g} N.s/m follow each other, Kd = "
        f"{KD:g} N.s/m, at {1.0 / ARM_TS:g} Hz; what one sends comes late to the other.",
        (
            "Opposed arms obey m s^2 + b s + (Kp + Kd s)(1 + exp(-s delay)) = 0. Derive the rule "
            "(b + 2 Kd)/Kp - Ts from it, and say why low gains carry less than the rule says.",
            "Which of limit and frequency changes with the mass? What changes if all of the delay "
            "is on the way back?",
            "Wave variables carry any constant delay. What does the hand pay for it in free "
            "motion, and what at a wall?",
        ),
        f"from Kp = {gains[0]:g} to {Kp:g} N/m: {runs[0]:g} to {runs[-1]:g} ms one way by runs, "
        f"{exact[0]:.4g} to {exact[-1]:.4g} ms exact; they swing at "
        f"{limits[0].frequency:.3g} to {limits[-1].frequency:.3g} Hz",
        {
            "Kp [N/m]": tuple(gains), "delay by runs [ms]": tuple(runs), "exact [ms]": tuple(exact),
            "rule [ms]": tuple(1e3 * delay_rule(Kp) for Kp in gains),
            "frequency [Hz]": tuple(x.frequency for x in limits),
        },
        (late, swings), pushed_pair(Kp, math.ceil(BEYOND * steps)),
    )  # fmt: skip


LABS: dict[str, Callable[[bool, Tell], Lab]] = {
    "wall": wall_lab,
    "zwidth": zwidth_lab,
    "delay": delay_lab,
    "jnd": jnd_lab,
    "pair": pair_lab,
}


@checked
def lab(name: str, quick: bool = False, tell: Tell | None = None) -> Lab:
    """Make the runs of a lab.

    Args:
        name: "wall", "zwidth", "delay", "jnd" or "pair".
        quick: whether to make fewer runs.
        tell: called with the name of each step before it begins; None for nothing.
    """
    return LABS[choice("name", name, tuple(LABS))](quick, tell or (lambda step: None))
