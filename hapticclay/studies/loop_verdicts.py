"""Verdicts of the analysis on one loop, in its clay, with a map where one is asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..display import fields_of, table_of, text_table
from ..model.constants import TS
from ..model.flow import Flow
from ..results import Result
from ..theory import describing, loop_passivity, relay_cycle, stability_margins
from ..theory.held_words import hand_words
from ..theory.loops import TIMING, Loop
from .boundary import PushedLoop
from .stability_map import StabilityMap
from .yield_map import YieldMap

ONE_HZ = 2.0 * math.pi  # [rad/s]
FORMATS = {"3rd": ".2g %"}  # harmonic of the velocity


@dataclass(frozen=True)
class Answer:
    """A verdict on a loop.

    Attributes:
        question: the question, in words.
        answer: yes or no; None for a margin.
        value: the margin; NaN where the loop is unstable and has none.
        what: meaning and unit of the margin.
        omega: frequency at which the margin is least [rad/s].
    """

    question: str
    answer: bool | None
    value: float
    what: str
    omega: float


@dataclass(frozen=True)
class YieldingClay:
    """What theory says of a loop in clay that yields, in continuous time without delay.

    Attributes:
        flow: the law of the clay.
        unstable_b: bands of damping in which the linear loop is unstable [N.s/m].
        small_push: how a small push ends.
        large_push: how a large push ends.
        predicted: limit cycles and thresholds of the describing function.
        exact: the exact ones; None where they are not known.
    """

    flow: Flow
    unstable_b: tuple[tuple[float, float], ...]
    small_push: str
    large_push: str
    predicted: tuple[describing.LimitCycle, ...]
    exact: tuple[relay_cycle.ExactCycle, ...] | None

    def cycles(self) -> dict[str, list[Any]]:
        """Predicted and exact cycles as a table."""
        found: list[tuple[str, Any, float | None, str]] = []
        for x in self.predicted:
            trusted = "yes" if x.trusted else f"no, off by {100.0 * x.speed_shift:+.0f} %"
            found.append((f"{x.kind}, predicted", x, x.third, trusted))
        for x in self.exact or ():
            stuck = f" ({100.0 * x.stuck:.0f} % stuck)" if x.stuck else ""
            name = "limit cycle" if x.multiplier < 1.0 else "threshold"
            found.append((f"{name}, exact{stuck}", x, None, ""))
        rows = [
            (name, 1e3 * x.speed, 1e3 * x.amplitude, x.omega / ONE_HZ, *rest)
            for name, x, *rest in found
        ]
        return table_of(("cycle", "mm/s", "mm", "Hz", "3rd", "to be trusted"), rows)

    def lines(self) -> list[str]:
        """Law, unstable dampings and outcomes of pushes."""
        bands = ", ".join(
            f"{low:.4g} to {'any' if high == math.inf else f'{high:.4g}'}"
            for low, high in self.unstable_b
        )
        flow = {k: v for k, v in fields_of(self.flow).items() if v and (k != "n" or self.flow.K)}
        law = "".join(f", {name} = {value:g}" for name, value in flow.items())
        return [
            f"{self.flow.kind} clay{law}; in continuous time without delay:",
            "the linear loop is "
            + (f"unstable at a damping of {bands} N.s/m" if bands else "stable at any damping"),
            f"by the describing function a small push: {self.small_push}, "
            f"a large one: {self.large_push}",
        ]

    def contents(self) -> dict[str, Any]:
        """Everything, for a file."""
        predicted = [
            {**fields_of(x), "amplitude": x.amplitude, "trusted": x.trusted} for x in self.predicted
        ]
        return {**fields_of(self), "kind": self.flow.kind, "predicted": predicted}


@dataclass(frozen=True, repr=False)
class LoopVerdicts(Result):
    """Verdicts on one loop.

    Attributes:
        answers: the verdicts on the linear loop.
        clay: what theory says where the clay yields; None for viscous clay.
        chart: a map; None for none.
        assumed: what the verdicts rest on, a sentence each.
    """

    written_as = "stability"
    summary_units = {
        "b": "N.s/m",
        "operator": "kg, N.s/m, N/m",
        "Ts": "s",
        "delay": "s",
        "omega": "rad/s",
        "speed": "m/s",
        "amplitude": "m",
        "damping": "N.s/m",
        "flow": "N, N/(m/s)^n, 1, N.s/m",
    }

    answers: tuple[Answer, ...]
    clay: YieldingClay | None = None
    chart: StabilityMap | YieldMap | None = None
    assumed: tuple[str, ...] = ()

    def headline(self) -> str:
        """The first verdict."""
        first = self.answers[0]
        word = "yes" if first.answer else "no"
        return f"{first.question}: {word}, {first.what} {first.value:.4g}"

    def tables(self) -> dict[str, dict[str, list[Any]]]:
        """Verdicts, and cycles in clay that yields."""
        answers = table_of(("", "?", "value", "meaning", "at rad/s"), self.answers)
        return {"verdicts": answers} | ({"cycles": self.clay.cycles()} if self.clay else {})

    def text(self, form: str = "") -> str:
        """The verdicts, and what clay that yields changes."""
        tables = self.tables()
        parts = [text_table(tables["verdicts"], form=form)]
        if self.clay:
            flow = self.clay.flow
            left = [name for name, x in (("yield force", flow.Fy), ("consistency", flow.K)) if x]
            left_out = f" ({' and '.join(left)} left out)" if left else ""
            heading = f"Linear loop in clay of b = {flow.b:g} N.s/m alone{left_out}"
            parts = [heading, *parts, "", *self.clay.lines()]
            if tables["cycles"]["cycle"]:
                parts.append(text_table(tables["cycles"], FORMATS, form))
        return "\n".join([*parts, *self.assumed])

    def figures(self) -> dict[str, Any]:
        """The map."""
        return self.chart.figures() if self.chart else {}

    def contents(self) -> dict[str, Any]:
        """Verdicts, clay and map."""
        return {
            "verdicts": self.answers,
            "assumed": self.assumed,
            "clay": self.clay and self.clay.contents(),
            "map": self.chart and fields_of(self.chart),
        }


def loop_verdicts(loop: PushedLoop, delay: float = 0.0, flow: Flow | None = None) -> LoopVerdicts:
    """Judges a loop, also at a delay, and in clay that yields.

    Margins and transparency are those of continuous time.
    """
    linear = replace(loop.linear, **TIMING)
    answers = [*_limits(loop, linear, delay), *_margins(linear)]
    for n in (11, 13):
        found = stability_margins.small_gain(linear, equation=n)
        answers.append(_answer(f"small gain, Eq. {n}", found, "right over left side"))
    found = loop_passivity.passivity(linear)
    answers.append(_answer("stable with every passive hand", found, "least Re Z [N.s/m]"))
    held = "held clay passive" + ", hand's damper" * bool(loop.operator)
    for late in (0.0, delay) if delay else (0.0,):
        question = f"... {1e3 * late:g} ms late" if late else held
        found = loop_passivity.clay_passivity(loop.b, loop.Ts or TS, loop.hand.damper, delay=late)
        answers.append(_answer(question, found, "N.s/m to spare"))
    answers.append(_transparency(linear))
    about = f"{loop.axis} axis, K = {loop.K:g} 1/kg, clay of {loop.b:g} N.s/m"
    assumed = (
        f"{about}, {hand_words(loop.operator)}",
        stability_margins.LINEAR,
        "margins, small gain, Re Z and transparency: continuous time, without delay",
    )
    return LoopVerdicts(tuple(answers), flow and yielding_clay(linear, flow), assumed=assumed)


def _held(loop: PushedLoop) -> str:
    return "with this hand" if loop.operator else "without a hand"


def _answer(question: str, v: Any, what: str, factor: float = 1.0) -> Answer:
    return Answer(question, v.verdict, v.margin * factor, what, v.omega)


def _limits(loop: PushedLoop, linear: Loop, delay: float) -> list[Answer]:
    """Largest stable K, at once and late, in continuous time and sampled."""
    Ts, late = loop.Ts or TS, f"... {1e3 * delay:g} ms late"
    timings = {f"stable {_held(loop)}": {}, f"... sampled every {1e3 * Ts:g} ms": {"Ts": Ts}}
    if delay:
        timings |= {late: {"delay": delay}, f"{late}, sampled": {"Ts": Ts, "delay": delay}}
    out = []
    for question, timing in timings.items():
        found = stability_margins.coupled_stability(replace(linear, **timing))
        out.append(_answer(question, found, "largest stable K", loop.K))
    return out


def _margins(linear: Loop) -> list[Answer]:
    """Margins; none where the loop is unstable and has no steady state."""
    m, nan = stability_margins.margins(linear), math.nan
    rows = (
        ("gain margin", m.gain[1], "factor on K", m.gain_omega[1]),
        ("phase margin", math.degrees(m.phase), "degrees", m.phase_omega),
        ("delay margin of the compensator", 1e3 * m.delay, "ms", m.delay_omega),
        ("disk margin", m.disk, "alpha", m.disk_omega),
    )
    return [
        Answer(name, None, x if m.stable else nan, what, omega if m.stable else nan)
        for name, x, what, omega in rows
    ]


def _transparency(linear: Loop) -> Answer:
    stable = stability_margins.margins(linear).stable
    ratio = abs(stability_margins.transparency(linear, np.array([ONE_HZ]))[0])
    shown = (float(ratio), "1 at best", ONE_HZ) if stable else (math.nan, "1 at best", math.nan)
    return Answer("transparency |fe/fh| at 1 Hz", None, *shown)


def yielding_clay(linear: Loop, flow: Flow) -> YieldingClay:
    """What theory says of a loop in clay that yields, in continuous time."""
    exact = None
    if flow.Fy and (not flow.K or flow.n == 1.0):
        exact = relay_cycle.exact_cycles(linear, flow=flow)
    return YieldingClay(
        flow,
        describing.unstable_dampings(linear),
        *describing.push_outcomes(linear, flow=flow),
        describing.limit_cycles(linear, flow=flow),
        exact,
    )
