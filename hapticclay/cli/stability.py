"""`hapticclay stability`: verdicts on one loop, and a map of where it is stable."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..files import versions, writable
from ..model.constants import AXES, B_CONSTANT, C_DEN, C_NUM, GAIN, TS, SecondOrder
from . import console

if TYPE_CHECKING:
    from ..model.controller import Servo
    from ..studies.boundary import PushedLoop
    from ..studies.stability_map import StabilityMap
    from ..theory.margins import Verdict

VERDICTS_SCHEMA = "hapticclay-stability-1"
VERDICTS_UNITS = {
    "b": "N.s/m",
    "operator": "kg, N.s/m, N/m",
    "Ts": "s",
    "delay": "s",
    "omega": "rad/s",
}
ONE_HZ = 2.0 * math.pi  # [rad/s]


@dataclass(frozen=True)
class StabilityCommand:
    """Judge the stability of one loop, and map where it is stable by analysis and by runs.

    Attributes:
        axis: Axis of the loop.
        b: Damping of the clay [N.s/m].
        gain: K of the compensator; by default 1 on x and 0.5 on y.
        Ts: Control sample [s]; None for runs in continuous time.
        delay: From a measurement to the torque computed from it [s].
        num: Numerator of the compensator, descending powers of s.
        den: Denominator of the compensator, descending powers of s.
        G: Gain, damping and stiffness of the position loop G; by default as printed.
        S: Gain, damping and stiffness of Sh, by default as printed; the gain with --shaping, else
            it is that of the arm.
        impedance: Put the operator's arm Th (Eq. 19) in the loop.
        shaping: Let the servo of the runs shape the inertia, so that Sh holds at every pose.
        map: Plane of the map: a boundary in K or b over clay, delay or pose.
        out: Folder for stability.json and the map.
        quick: Draw a coarse map.
    """

    axis: Literal["x", "y"] = "x"
    b: float = B_CONSTANT
    gain: float | None = None
    Ts: float | None = TS
    delay: float = 0.0
    num: tuple[float, ...] = C_NUM
    den: tuple[float, ...] = C_DEN
    G: tuple[float, float, float] | None = None
    S: tuple[float, float, float] | None = None
    impedance: bool = True
    shaping: bool = False
    map: Literal["none", "gain-damping", "delay-damping", "gain-pose"] = "none"
    out: Path = Path("out/stability")
    quick: bool = False

    def __call__(self) -> int:
        from ..model.compensator import Compensator
        from ..model.operator import Operator
        from ..studies.boundary import PushedLoop

        writable(self.out)
        i = AXES.index(self.axis)
        loop = PushedLoop(
            self.axis,
            b=self.b,
            K=GAIN[i] if self.gain is None else self.gain,
            operator=Operator() if self.impedance else None,
            servo=self._servo(i),
            compensator=Compensator(self.num, self.den),
            Ts=self.Ts,
            delay=self.delay if self.Ts else 0.0,
            shaping=self.shaping,
        )
        rows = verdicts(loop, self.delay)
        print(verdict_table(rows))
        operator = loop.operator and asdict(loop.operator)
        asked = {"axis": self.axis, "b": loop.b, "K": loop.K, "operator": operator, "Ts": self.Ts,
                 "compensator": asdict(loop.compensator), "servo": asdict(loop.servo),
                 "delay": self.delay, "shaping": self.shaping, "map": self.map,
                 "quick": self.quick}  # fmt: skip
        chart = self._map(loop)
        found = {"schema": VERDICTS_SCHEMA, "asked": asked, "units": VERDICTS_UNITS,
                 "verdicts": rows, "map": chart and asdict(chart),
                 "versions": versions()}  # fmt: skip
        console.save_json(found, self.out / "stability.json")
        print(f"written to {self.out}")
        return 0

    def _servo(self, i: int) -> Servo:
        from ..model.controller import SERVO

        printed = SERVO[i]
        return replace(
            printed,
            G=SecondOrder(*self.G) if self.G else printed.G,
            S=SecondOrder(*self.S) if self.S else printed.S,
        )

    def _map(self, loop: PushedLoop) -> StabilityMap | None:
        if self.map == "none":
            return None
        from ..studies.stability_map import stability_map
        from ..views import study_plots

        if self.map == "delay-damping":
            loop = replace(loop, delay=0.0)
        chart = stability_map(
            self.map, loop, self.quick, lambda columns: console.progress_bar(columns, desc="map")
        )
        console.save_figures({chart.kind: study_plots.stability_map_plot(chart)}, self.out)
        print(disagreements(chart))
        return chart


def verdicts(loop: PushedLoop, delay: float = 0.0) -> list[dict[str, Any]]:
    """Verdicts of the analysis on a loop: question, answer, value, meaning, omega [rad/s].

    Margins and transparency are those of continuous time; NaN where the loop is unstable there.

    Args:
        loop: the loop.
        delay: of the motors [s].
    """
    import numpy as np

    from ..theory import margins, passivity
    from ..theory.linear_loop import TIMING

    K, Ts = loop.K, loop.Ts or TS
    linear = replace(loop.linear, **TIMING)
    rows: list[dict[str, Any]] = []

    def add(question: str, answer: bool | None, value: float, what: str, omega: float) -> None:
        rows.append(
            {"question": question, "answer": answer, "value": value, "what": what, "omega": omega}
        )

    def judge(question: str, v: Verdict, what: str) -> None:
        add(question, v.verdict, v.margin, what, v.omega)

    def stable(question: str, **late: Any) -> None:
        v = margins.coupled_stability(replace(linear, **late))
        add(question, v.verdict, v.margin * K, "largest stable K", v.omega)

    stable("stable with this hand")
    stable(f"... sampled every {1e3 * Ts:g} ms", Ts=Ts)
    if delay:
        stable(f"... {1e3 * delay:g} ms late", delay=delay)
        stable(f"... {1e3 * delay:g} ms late, sampled", Ts=Ts, delay=delay)
    m = margins.margins(linear)

    def response(question: str, value: float, what: str, omega: float) -> None:
        # an unstable loop has no steady state
        add(question, None, value if m.stable else math.nan, what, omega if m.stable else math.nan)

    response("gain margin", m.gain[1], "factor on K", m.gain_omega[1])
    response("phase margin", math.degrees(m.phase), "degrees", m.phase_omega)
    response("delay margin of the compensator", 1e3 * m.delay, "ms", m.delay_omega)
    response("disk margin", m.disk, "alpha", m.disk_omega)
    for equation in (11, 13):
        small = margins.small_gain(linear, equation=equation)
        judge(f"small gain, Eq. {equation}", small, "right over left side")
    judge("passive: stable with every hand", passivity.passivity(linear), "least Re Z [N.s/m]")
    judge(
        "held clay passive with this hand",
        passivity.clay_passivity(loop.b, Ts, loop.hand.damper),
        "N.s/m to spare",
    )
    felt = margins.transparency(linear, np.array([ONE_HZ]))[0]
    response("transparency |fe/fh| at 1 Hz", float(abs(felt)), "1 at best", ONE_HZ)
    return rows


def verdict_table(rows: list[dict[str, Any]]) -> str:
    """The verdicts, for a terminal.

    Args:
        rows: from `verdicts`.
    """
    said, number = {True: "yes", False: "no", None: ""}, console.significant
    cells = [
        [r["question"], said[r["answer"]], number(r["value"]), r["what"], number(r["omega"])]
        for r in rows
    ]
    return console.text_table(cells, ["", "", "value", "meaning", "at rad/s"], "lllll")


def disagreements(chart: StabilityMap) -> str:
    """The cells in which a run differs from the analysis in continuous time, and the causes.

    Args:
        chart: the map.
    """
    wrong = [c for c in chart.cells if c.cause]
    lines = [
        "boundary found by runs against the exact one of the same loop: "
        f"within {100.0 * chart.gap():.2g} %",
        *chart.notes,
        f"{len(wrong)} of {len(chart.cells)} cells differ from continuous time without delay "
        "at the nominal pose",
    ]
    if wrong:
        cells = [
            [f"{c.x:.4g}", f"{c.y:.4g}", "stable" if c.theory else "unstable", c.simulated, c.cause]
            for c in wrong
        ]
        head = [chart.x_name, chart.y_name, "theory", "run", "cause"]
        lines.append(console.text_table(cells, head, "lllll"))
    return "\n".join(lines)
