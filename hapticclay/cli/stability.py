"""`hapticclay stability`: verdicts on one loop, and a map of where it is stable."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..files import atomic, versions, writable
from ..model.constants import AXES, B_CONSTANT, GAIN, TS
from ..model.operator import Operator
from ..studies import boundary, stability_map
from ..studies.stability_map import StabilityMap
from ..theory import margins, passivity

SCHEMA = "hapticclay-stability-1"
UNITS = {"b": "N.s/m", "operator": "kg, N.s/m, N/m", "Ts": "s", "delay": "s", "omega": "rad/s"}
ONE_HZ = 2.0 * math.pi  # [rad/s]


@dataclass(frozen=True)
class Stability:
    """Verdicts on one loop, and a map: analytic boundaries, the one found by runs, and why they differ."""

    axis: Literal["x", "y"] = "x"
    """Axis of the loop."""
    b: float = B_CONSTANT
    """Damping of the clay [N.s/m]."""
    gain: float | None = None
    """K of the compensator; by default 1 on x and 0.5 on y."""
    Ts: float | None = TS
    """Control sample [s]; None for runs in continuous time."""
    delay: float = 0.0
    """From a measurement to the torque computed from it [s]."""
    impedance: bool = True
    """The operator's arm Th (Eq. 19) is in the loop."""
    shaping: bool = False
    """The servo of the runs shapes the inertia, so that Sh holds at every pose."""
    map: Literal["none", "gain-damping", "delay-damping", "gain-pose"] = "none"
    """The plane of the map: a boundary in K or b over clay, delay or pose."""
    out: Path = Path("out/stability")
    """Folder for stability.json and the picture."""
    quick: bool = False
    """A coarse map."""

    def __call__(self) -> int:
        writable(self.out)
        K = GAIN[AXES.index(self.axis)] if self.gain is None else self.gain
        loop = boundary.Loop(self.axis, K, self.b, Operator() if self.impedance else None, self.Ts,
                             self.delay if self.Ts else 0.0, self.shaping)  # fmt: skip
        rows = verdicts(loop, self.delay)
        print(table(rows))
        asked = {"axis": self.axis, "b": loop.b, "K": loop.K, "operator": loop.operator and asdict(loop.operator),
                 "Ts": self.Ts, "delay": self.delay, "shaping": self.shaping, "map": self.map,
                 "quick": self.quick}  # fmt: skip
        found: dict[str, Any] = {
            "schema": SCHEMA, "asked": asked, "units": UNITS, "verdicts": rows, "map": None, "versions": versions(),
        }  # fmt: skip
        if self.map != "none":
            chart = stability_map.stability_map(self.map, replace(loop, delay=0.0 if self.map == "delay-damping" else loop.delay),
                               self.quick, _progress)  # fmt: skip
            found["map"] = asdict(chart)
            self._draw(chart)
            print(disagreements(chart))
        with atomic(self.out / "stability.json") as f:
            f.write((json.dumps(_finite(found), indent=2, allow_nan=False) + "\n").encode())
        print(f"written to {self.out}")
        return 0

    def _draw(self, chart: StabilityMap) -> None:
        from ..views import study_plots

        with atomic(self.out / f"{chart.kind}.png") as f:
            study_plots.boundaries(chart).savefig(f, format="png")


def verdicts(loop: boundary.Loop, delay: float = 0.0) -> list[dict[str, Any]]:
    """What the analysis says of a loop: question, answer, figure, where [rad/s]; `delay` [s] of the motors.

    Margins and transparency are those of continuous time; NaN where the loop is unstable there.
    """
    axis, K, b, Ts = loop.axis, loop.K, loop.b, loop.Ts or TS
    kw: dict[str, Any] = dict(operator=loop.operator)
    rows: list[dict[str, Any]] = []

    def add(question: str, answer: bool | None, value: float, what: str, omega: float) -> None:
        rows.append(
            {"question": question, "answer": answer, "value": value, "what": what, "omega": omega}
        )

    def judge(question: str, v: margins.Verdict, what: str) -> None:
        add(question, v.verdict, v.margin, what, v.omega)

    def stable(question: str, **late: Any) -> None:
        v = margins.coupled_stability(axis, K, b, **late, **kw)
        add(question, v.verdict, v.margin * K, "largest stable K", v.omega)

    stable("stable with this hand")
    stable(f"... sampled every {1e3 * Ts:g} ms", Ts=Ts)
    if delay:
        stable(f"... {1e3 * delay:g} ms late", delay=delay)
        stable(f"... {1e3 * delay:g} ms late, sampled", Ts=Ts, delay=delay)
    m = margins.margins(axis, K, b, **kw)

    def response(
        question: str, value: float, what: str, omega: float
    ) -> None:  # none without a steady state
        add(question, None, value if m.stable else math.nan, what, omega if m.stable else math.nan)

    response("gain margin", m.gain[1], "factor on K", m.gain_omega[1])
    response("phase margin", math.degrees(m.phase), "degrees", m.phase_omega)
    response("delay margin of the compensator", 1e3 * m.delay, "ms", m.delay_omega)
    response("disk margin", m.disk, "alpha", m.disk_omega)
    for equation in (11, 13):
        small = margins.small_gain(axis, K, b, equation=equation, **kw)
        judge(f"small gain, Eq. {equation}", small, "right over left side")
    judge("passive: stable with every hand", passivity.passivity(axis, K, b), "least Re Z [N.s/m]")
    damper = loop.operator.damper if loop.operator else 0.0
    judge(
        "held clay passive with this hand",
        passivity.clay_passivity(b, Ts, damper),
        "N.s/m to spare",
    )
    felt = margins.transparency(axis, K, b, np.array([ONE_HZ]))[0]
    response("transparency |fe/fh| at 1 Hz", float(abs(felt)), "1 at best", ONE_HZ)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """The verdicts for reading."""
    from tabulate import tabulate

    said = {True: "yes", False: "no", None: ""}
    cells = [
        [r["question"], said[r["answer"]], _number(r["value"]), r["what"], _number(r["omega"])]
        for r in rows
    ]
    return tabulate(cells, ["", "", "value", "what it is", "at rad/s"], disable_numparse=True)


def disagreements(chart: StabilityMap) -> str:
    """The cells in which a run does not do what continuous time without delay at the nominal pose says; the cause."""
    from tabulate import tabulate

    wrong = [c for c in chart.cells if c.cause]
    lines = [
        f"boundary found by runs against the exact one of the same loop: within {100.0 * chart.gap():.2g} %"
    ]
    lines += chart.notes
    lines.append(
        f"{len(wrong)} of {len(chart.cells)} cells are not as continuous time says, no delay, nominal pose"
    )
    if wrong:
        cells = [
            [f"{c.x:.4g}", f"{c.y:.4g}", "stable" if c.theory else "unstable", c.simulated, c.cause]
            for c in wrong
        ]
        head = [chart.x_name, chart.y_name, "theory", "run", "cause"]
        lines.append(tabulate(cells, head, disable_numparse=True))
    return "\n".join(lines)


def _number(x: float) -> str:
    return "-" if math.isnan(x) else "any" if x == math.inf else f"{x:.4g}"


def _finite(x: Any) -> Any:
    """x for JSON, which knows neither infinities nor NaN."""
    if isinstance(x, dict):
        return {k: _finite(v) for k, v in x.items()}
    if isinstance(x, list | tuple):
        return [_finite(v) for v in x]
    return None if isinstance(x, float) and not math.isfinite(x) else x


def _progress(columns: Iterable) -> Iterable:
    from tqdm import tqdm

    return tqdm(columns, desc="map", delay=2.0, disable=None, leave=False)
