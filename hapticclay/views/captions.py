"""Titles and labels of figures: units typeset, and phrases that describe a run or a loop."""

from __future__ import annotations

from ..arms.joint_law import JointPD
from ..model.arm import PAPER
from ..model.compensator import PRINTED
from ..model.controller import SERVO
from ..model.operator import Operator
from ..scene.scenario import Scenario
from ..theory.linear_loop import LinearLoop

MOST_KINDS = 8  # kinds of clay that a title lists
UNITS = {"N.m.s": "N·m·s", "N.s": "N·s", "N.m": "N·m", "^2": "²", "(m/s)^n": "(m/s)ⁿ"}
LETTERS = {"Fy =": "F$_y$ =", "K =": "K$_c$ =", "k1 =": "k$_1$ ="}  # K: consistency


def unit_text(text: str) -> str:
    """Typesets units: N.s/m with a centred dot, s^2 with an exponent."""
    for plain, typeset in UNITS.items():
        text = text.replace(plain, typeset)
    return text


def plain_text(text: str) -> str:
    """A label with its units as in files: N.s/m, s^2."""
    for plain, typeset in UNITS.items():
        text = text.replace(typeset, plain)
    return text


def clay_text(text: str) -> str:
    """Typesets a text on clay, with its letters."""
    for plain, typeset in LETTERS.items():
        text = text.replace(plain, typeset)
    return unit_text(text)


def hand_name(operator: Operator | None | tuple[Operator | None, Operator | None]) -> str:
    """Names the hand in a title."""
    if operator is None or operator == (None, None):
        return "no hand"
    return "nominal hand" if operator == Operator() else "given hand"


def scenario_parts(s: Scenario) -> list[str]:
    """Phrases that describe a scenario in a title."""

    def pair(x: tuple[float, ...]) -> str:
        return f"({', '.join(f'{part:.3g}' for part in x)})"

    how = f"K = {pair(s.gain)}" if s.controller is None else "own controller"
    if isinstance(s.controller, JointPD):
        how = s.controller.words
    out = [f"{s.name}: {how}"]
    if s.muscle is None and (s.is_closed_form or any(s.force)):
        out.append(f"u$_h$ = {pair(s.force)} N")
    if s.clay:
        out += [clay_text(x.text(MOST_KINDS)) for x in s.clay.words]
    if not s.is_closed_form:
        return out + ["hand at the handle"] * any(s.operators)
    printed = {"arm": PAPER, "servo": SERVO, "compensator": (PRINTED, PRINTED)}
    own = {"arm": s.arm, "servo": s.servo, "compensator": s.compensators}
    out += [f"another {name}" for name, part in own.items() if part != printed[name]]
    return out + ["T$_h$ in the loop"] * any(s.operators) + ["inertia shaped"] * s.inertia_shaping


def loop_parts(loop: LinearLoop, *names: str) -> list[str]:
    """Phrases that describe a loop in a title: those named, where they apply."""
    phrases = {
        "axis": f"{loop.axis} axis",
        "K": "" if loop.K is None else f"K = {loop.K:g} 1/kg",
        "b": f"b = {loop.b:g} N.s/m",
        "hand": hand_name(loop.operator),
        "Ts": f"Ts = {1e3 * loop.Ts:g} ms" if loop.Ts else "continuous time",
        "delay": f"delay = {1e3 * loop.delay:g} ms" if loop.delay else "",
        "shaping": "inertia shaped" if getattr(loop, "inertia_shaping", False) else "not shaped",
    }
    return [phrases[name] for name in names if phrases.get(name)]
