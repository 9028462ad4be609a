"""`hapticclay stability`: verdicts on one loop, and a map of where it is stable."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from ..errors import ParameterError, choice, number_in
from ..files import versions, writable
from ..model.constants import AXES, B_CONSTANT, C_DEN, C_NUM, GAIN, TS, SecondOrder
from . import console
from .unused import FIGURE_WORDS, Unused

if TYPE_CHECKING:
    from ..model.controller import Servo
    from ..model.flow import Flow
    from ..studies.boundary import PushedLoop
    from ..studies.stability_map import StabilityMap
    from ..studies.yield_map import YieldMap
    from ..theory.stability_margins import Verdict

VERDICTS_SCHEMA = "hapticclay-stability-1"
VERDICTS_UNITS = {
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
ONE_HZ = 2.0 * math.pi  # [rad/s]


@dataclass(frozen=True)
class StabilityCommand:
    """Judge the stability of one loop, and map where it is stable by analysis and by runs.

    Attributes:
        axis: Axis of the loop.
        b: Damping of the clay [N.s/m]; by default 90, or 0 with --clay Fy=5.
        gain: K of the compensator [1/kg]; by default 1 on x and 0.5 on y.
        Ts: Control sample [s]; None for runs in continuous time.
        delay: Latency from a measurement to the torque computed from it [s].
        num: Numerator of the compensator, descending powers of s.
        den: Denominator of the compensator, descending powers of s.
        G: Gain [1/s^2], damping [1/s] and stiffness [1/s^2] of the position loop G; by default as
            printed.
        S: Gain [1/kg], damping [1/s] and stiffness [1/s^2] of Sh; by default as printed. Without
            --inertia-shaping the gain is that of the arm.
        operator: Put the operator's arm Th (Eq. 19) in the loop.
        inertia_shaping: Let the servo of the runs shape the inertia, so that Sh is the same at
            every pose.
        clay: Clay that yields, as Fy=5 K=2 n=0.5 in addition to b, or a material, "stiff clay":
            predict sticking and limit cycles.
        map: Plane of the map: a boundary in K or b over clay, delay or pose; or how a push ends,
            over yield force and gain, in Bingham clay of this b.
        out: Folder for stability.json and the map.
        quick: Draw a coarse map.
        figures: Format and style of the map.
    """

    axis: Literal["x", "y"] = "x"
    b: float | None = None
    gain: float | None = None
    Ts: float | None = TS
    delay: float = 0.0
    num: tuple[float, ...] = C_NUM
    den: tuple[float, ...] = C_DEN
    G: tuple[float, float, float] | None = None
    S: tuple[float, float, float] | None = None
    operator: bool = True
    inertia_shaping: bool = False
    clay: tuple[str, ...] | None = None
    map: Literal["none", "gain-damping", "delay-damping", "gain-pose", "gain-yield"] = "none"
    out: Path = Path("out/stability")
    quick: bool = False
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("quick", *FIGURE_WORDS), "is for a map: give --map too", (), ("map",)),
        Unused(("quick", *FIGURE_WORDS), "is for a map: give another --map", ("map=none",)),
    )

    def __call__(self) -> int:
        from ..model.compensator import Compensator
        from ..model.operator import Operator
        from ..studies.boundary import PushedLoop

        writable(self.out)
        i, b = AXES.index(self.axis), B_CONSTANT if self.b is None else self.b
        flow = None if self.clay is None else clay_of(self.clay, self.b)
        loop = PushedLoop(
            self.axis,
            b=flow.b if flow else b,
            K=GAIN[i] if self.gain is None else self.gain,
            operator=Operator() if self.operator else None,
            servo=self._servo(i),
            compensator=Compensator(self.num, self.den),
            Ts=self.Ts,
            delay=self.delay if self.Ts else 0.0,
            inertia_shaping=self.inertia_shaping,
        )
        rows = verdicts(loop, self.delay)
        if flow:
            print(linear_heading(flow))
        print(verdict_table(rows))
        clay = flow and clay_predictions(loop, flow)
        if clay:
            print(clay_table(clay))
        operator = loop.operator and asdict(loop.operator)
        asked = {"axis": self.axis, "b": loop.b, "K": loop.K, "operator": operator, "Ts": self.Ts,
                 "compensator": asdict(loop.compensator), "servo": asdict(loop.servo),
                 "delay": self.delay, "inertia_shaping": self.inertia_shaping, "map": self.map,
                 "quick": self.quick}  # fmt: skip
        chart = self._map(loop)
        found = {"schema": VERDICTS_SCHEMA, "asked": asked, "units": VERDICTS_UNITS,
                 "verdicts": rows, "clay": clay, "map": chart and asdict(chart),
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

    def _map(self, loop: PushedLoop) -> StabilityMap | YieldMap | None:
        if self.map == "none":
            return None
        if self.map == "gain-yield":
            return self._yield_map(loop)
        from ..studies.stability_map import stability_map
        from ..views import stability_map_plots

        if self.map == "delay-damping":
            loop = replace(loop, delay=0.0)
        chart = stability_map(
            self.map, loop, self.quick, lambda columns: console.progress_bar(columns, desc="map")
        )
        self._save(chart.kind, stability_map_plots.stability_map_plot, chart)
        print(disagreements(chart))
        return chart

    def _yield_map(self, loop: PushedLoop) -> YieldMap:
        from ..studies.yield_map import yield_map
        from ..views import yield_map_plots

        chart = yield_map(loop, self.quick, lambda gains: console.progress_bar(gains, desc="map"))
        self._save(self.map, yield_map_plots.yield_map_plot, chart)
        print(yield_differences(chart))
        return chart

    def _save(self, name: str, plot: Callable[[Any], Any], chart: Any) -> None:
        from ..views.figure import Figure

        figure = Figure(lambda: plot(chart), chart.tables)
        console.save_figures({name: figure}, self.out, self.figures)


def clay_of(words: Sequence[str], b: float | None = None) -> Flow:
    """The law of clay that is given by its numbers, or by the name of a material."""
    from ..fields import field_unit
    from ..model.flow import Flow
    from ..model.materials import material

    text = " ".join(words)
    if not text.strip():
        bound = "must be numbers with their names, Fy=5 b=30, or a material"
        raise ParameterError("clay", text, bound)
    if "=" not in text:
        if b is not None:
            raise ParameterError("b", b, f"must not be given beside {text!r}, which has its own")
        return material(text)
    found = {} if b is None else {"b": b}
    for word in text.split():
        name, equals, value = word.partition("=")
        if not equals:
            raise ParameterError("clay", word, "must be numbers with their names: Fy=5 K=2 n=0.5")
        if choice("clay", name, ("Fy", "K", "n", "b")) in found:
            raise ParameterError(f"clay {name}", value, "must be given once, here or as --b")
        try:
            found[name] = number_in(f"clay {name}", value, field_unit(name, Flow))
        except ParameterError:  # of a unit
            raise
        except ValueError:
            raise ParameterError(f"clay {name}", value, "must be a number") from None
    if "n" in found and not found.get("K"):
        raise ParameterError("clay n", found["n"], "must be given beside K > 0, whose power it is")
    return Flow(**found)


def clay_predictions(loop: PushedLoop, flow: Flow) -> dict[str, Any]:
    """What theory says of a loop in clay that yields, in continuous time."""
    from ..theory import describing, relay_cycle
    from ..theory.loops import TIMING

    linear = replace(loop.linear, **TIMING)
    small, large = describing.push_outcomes(linear, flow=flow)
    cycles = describing.limit_cycles(linear, flow=flow)
    exact = None
    if flow.Fy and (not flow.K or flow.n == 1.0):
        exact = [asdict(x) for x in relay_cycle.exact_cycles(linear, flow=flow)]
    return {
        "flow": asdict(flow),
        "kind": flow.kind,
        "unstable_b": describing.unstable_dampings(linear),
        "small_push": small,
        "large_push": large,
        "predicted": [
            {**asdict(x), "amplitude": x.amplitude, "trusted": x.trusted} for x in cycles
        ],
        "exact": exact,
    }


def linear_heading(flow: Flow) -> str:
    """Says of which clay the verdicts of the linear loop are."""
    parts = [name for name, x in (("yield force", flow.Fy), ("consistency", flow.K)) if x]
    left_out = f" ({' and '.join(parts)} left out)" if parts else ""
    return f"Linear loop in clay of b = {flow.b:g} N.s/m alone{left_out}"


def clay_table(clay: dict[str, Any]) -> str:
    """The predictions, for a terminal."""
    number = console.significant
    bands = ", ".join(
        f"{low:.4g} to {'any' if high == math.inf else f'{high:.4g}'}"
        for low, high in clay["unstable_b"]
    )
    flow = {k: v for k, v in clay["flow"].items() if v and (k != "n" or clay["flow"]["K"])}
    law = "".join(f", {name} = {value:g}" for name, value in flow.items())
    unstable = f"unstable at a damping of {bands} N.s/m" if bands else "stable at any damping"
    lines = [
        "",
        f"{clay['kind']} clay{law}; in continuous time without delay:",
        f"the linear loop is {unstable}",
        f"by the describing function a small push: {clay['small_push']}, "
        f"a large one: {clay['large_push']}",
    ]

    def row(name: str, x: dict[str, Any], third: str, trusted: str) -> list[str]:
        size = [number(1e3 * x["speed"]), number(1e3 * x["amplitude"])]
        return [name, *size, number(x["omega"] / ONE_HZ), third, trusted]

    cells = []
    for x in clay["predicted"]:
        trusted = "yes" if x["trusted"] else f"no, off by {100.0 * x['speed_shift']:+.0f} %"
        cells.append(row(f"{x['kind']}, predicted", x, f"{100.0 * x['third']:.2g} %", trusted))
    for x in clay["exact"] or ():
        name = "limit cycle" if x["multiplier"] < 1.0 else "threshold"
        stuck = f" ({100.0 * x['stuck']:.0f} % stuck)" if x["stuck"] else ""
        cells.append(row(f"{name}, exact{stuck}", x, "", ""))
    if cells:
        head = ["", "mm/s", "mm", "Hz", "3rd", "to be trusted"]
        lines.append(console.text_table(cells, head, "llllll"))
    return "\n".join(lines)


def yield_differences(chart: YieldMap) -> str:
    """How the runs of a map of yield force and gain compare with theory."""
    wrong = [c for c in chart.cells if c.simulated != c.expected]
    gaps = [abs(c.speed / c.exact - 1.0) for c in chart.cells if c.exact > 0.0 and c.speed > 0.0]
    lines = [f"{len(wrong)} of {len(chart.cells)} runs end otherwise than theory says"]
    if gaps:
        lines.append(f"largest speed of the cycles: within {100.0 * max(gaps):.2g} % of the exact")
    if wrong:
        cells = [[f"{c.Fy:.4g}", f"{c.K:.4g}", c.expected, c.simulated] for c in wrong]
        lines.append(console.text_table(cells, ["Fy [N]", "K", "theory", "run"], "llll"))
    return "\n".join(lines)


def verdicts(loop: PushedLoop, delay: float = 0.0) -> list[dict[str, Any]]:
    """Verdicts of the analysis on a loop: question, answer, value, meaning, omega [rad/s].

    Margins and transparency are those of continuous time; NaN where the loop is unstable there.
    """
    import numpy as np

    from ..theory import loop_passivity, stability_margins
    from ..theory.loops import TIMING

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
        v = stability_margins.coupled_stability(replace(linear, **late))
        add(question, v.verdict, v.margin * K, "largest stable K", v.omega)

    stable("stable with this hand")
    stable(f"... sampled every {1e3 * Ts:g} ms", Ts=Ts)
    if delay:
        stable(f"... {1e3 * delay:g} ms late", delay=delay)
        stable(f"... {1e3 * delay:g} ms late, sampled", Ts=Ts, delay=delay)
    m = stability_margins.margins(linear)

    def response(question: str, value: float, what: str, omega: float) -> None:
        # an unstable loop has no steady state
        add(question, None, value if m.stable else math.nan, what, omega if m.stable else math.nan)

    response("gain margin", m.gain[1], "factor on K", m.gain_omega[1])
    response("phase margin", math.degrees(m.phase), "degrees", m.phase_omega)
    response("delay margin of the compensator", 1e3 * m.delay, "ms", m.delay_omega)
    response("disk margin", m.disk, "alpha", m.disk_omega)
    for equation in (11, 13):
        small = stability_margins.small_gain(linear, equation=equation)
        judge(f"small gain, Eq. {equation}", small, "right over left side")
    judge("passive: stable with every hand", loop_passivity.passivity(linear), "least Re Z [N.s/m]")
    for late in (0.0, delay) if delay else (0.0,):
        clay = loop_passivity.clay_passivity(loop.b, Ts, loop.hand.damper, delay=late)
        question = f"... {1e3 * late:g} ms late" if late else "held clay passive with this hand"
        judge(question, clay, "N.s/m to spare")
    transparency = stability_margins.transparency(linear, np.array([ONE_HZ]))[0]
    response("transparency |fe/fh| at 1 Hz", float(abs(transparency)), "1 at best", ONE_HZ)
    return rows


def verdict_table(rows: list[dict[str, Any]]) -> str:
    """The verdicts, for a terminal."""
    said, number = {True: "yes", False: "no", None: ""}, console.significant
    cells = [
        [r["question"], said[r["answer"]], number(r["value"]), r["what"], number(r["omega"])]
        for r in rows
    ]
    return console.text_table(cells, ["", "", "value", "meaning", "at rad/s"], "lllll")


def disagreements(chart: StabilityMap) -> str:
    """The cells in which a run differs from the analysis in continuous time, and the causes."""
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
