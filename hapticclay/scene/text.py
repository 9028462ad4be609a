"""Short description of a scenario for prompts, notebooks and `hapticclay info`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..display import one_line
from ..model.constants import AXES
from ..model.hardware import hardware_words

if TYPE_CHECKING:
    from ..model.clay import Clay
    from ..model.operator import Operator


def scenario_rows(scenario: Any) -> list[tuple[str, str]]:
    """Names and values, with units, that characterise a scenario."""
    s = scenario
    rows = [("K", f"{_pair(s.gain)} 1/kg")]
    if s.controller is not None:
        rows = [("controller", one_line(s.controller.words))]
    if s.muscle is None or any(s.force):
        rows.append(("force", f"{_pair(s.force)} N"))
    rows += [
        (name, one_line(type(x).__name__))
        for name, x in (("muscle", s.muscle), ("command", s.command))
        if x is not None
    ]
    rows.append(("clay", clay_text(s.clay)))
    if any(s.operators):
        x, y = map(_hand, s.operators)
        rows.append(("operator", x if x == y else f"x: {x}; y: {y}"))
    rows.append(("control", _control(s)))
    goal = "" if s.length is None else f"p_x = {s.length:g} m, or "
    rows.append(("ends at", f"{goal}{s.t_max:g} s"))
    defaults = {f: type(s).__dataclass_fields__[f].default for f in ("arm", "servo", "compensator")}
    if not s.is_closed_form:
        rows.insert(0, ("arm", one_line(f"{s.arm.name}: {', '.join(s.arm.names)}")))
        if s.axes[:2] != AXES:
            rows.insert(1, ("x and y", f"{' and '.join(s.axes[:2])} of the world"))
        del defaults["arm"]
    replaced = [name for name, default in defaults.items() if getattr(s, name) != default]
    if replaced:
        rows.append(("replaced", ", ".join(replaced)))
    if s.hardware is not None:
        rows.append(("hardware", hardware_words(s)))
    return rows


def clay_text(clay: Clay | None) -> str:
    """Resistance of clay, with the ranges of its quantities."""
    return "none" if clay is None else ", ".join(x.text() for x in clay.words)


def _pair(x: tuple[float, ...]) -> str:
    return f"({', '.join(f'{part:.4g}' for part in x)})"


def _hand(th: Operator | None) -> str:
    if th is None:
        return "none"
    return f"{th.mass:.4g} kg, {th.damper:.4g} N.s/m, {th.spring:.4g} N/m"


def _control(s: Any) -> str:
    if s.control == "continuous":
        return f"continuous, {s.integrator}, dt = {s.dt:g} s"
    return f"sampled, {s.render}, Ts = {s.Ts or s.dt:g} s, dt = {s.dt:g} s"
