"""Titles and labels of figures of runs."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..model.arm import PAPER
from ..model.compensator import PRINTED
from ..model.controller import SERVO
from ..scene.scenario import Scenario
from ..simulation.record import Record
from .style import (
    add_legend,
    set_title,
)

MOST_TITLED = 8  # that a title lists


def in_math(text: str) -> str:
    """Typesets a text on clay with letters and units as formulas; K is the consistency here."""
    for plain, formula in _FORMULAS.items():
        text = text.replace(plain, formula)
    return text


_FORMULAS = {
    "Fy =": "F$_y$ =",
    "K =": "K$_c$ =",
    "k1 =": "k$_1$ =",
    "N.s": "N$\\cdot$s",
    "^2": "$^2$",
    "(m/s)^n": "(m/s)$^n$",
}


def scenario_parts(s: Scenario) -> list[str]:
    """Phrases that describe a scenario in a title."""

    def pair(x: tuple[float, float]) -> str:
        return f"({x[0]:.3g}, {x[1]:.3g})"

    how = f"K = {pair(s.gain)}" if s.controller is None else "own controller"
    out = [f"{s.name}: {how}"]
    if s.muscle is None:
        out.append(f"u$_h$ = {pair(s.force)} N")
    if s.clay:
        out += [in_math(x.text(MOST_TITLED)) for x in s.clay.words]
    printed = {"arm": PAPER, "servo": SERVO, "compensator": (PRINTED, PRINTED)}
    own = {"arm": s.arm, "servo": s.servo, "compensator": s.compensators}
    out += [f"another {name}" for name, part in own.items() if part != printed[name]]
    return out + ["T$_h$ in the loop"] * any(s.operators) + ["inertia shaped"] * s.inertia_shaping


def finish(figure: Figure, panels: list[Axes], record: Record) -> None:
    """Adds the legend, and the title of a run."""
    add_legend(figure, panels[0])
    set_title(panels[0], *scenario_parts(record.scenario))
