"""What a scenario is, in a few lines: for prompts, notebooks and `hapticclay info`."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ..display import one_line

if TYPE_CHECKING:
    from ..model.clay import Clay
    from ..model.operator import Operator


def scenario_rows(scenario: Any) -> list[tuple[str, str]]:
    """Name and value, with unit, of what tells a scenario from others.

    Args:
        scenario: the scenario.
    """
    s = scenario
    rows = [("K", f"{_pair(s.gain)} 1/kg")]
    if s.controller is not None:
        rows = [("controller", one_line(getattr(s.controller.law, "__name__", s.controller.law)))]
    if s.muscle is None or any(s.force):
        rows.append(("force", f"{_pair(s.force)} N"))
    rows += [
        (name, one_line(type(x).__name__))
        for name, x in (("muscle", s.muscle), ("command", s.command))
        if x is not None
    ]
    rows.append(("clay", "none" if s.clay is None else clay_text(s.clay)))
    if any(s.operators):
        x, y = map(_hand, s.operators)
        rows.append(("operator", x if x == y else f"x: {x}; y: {y}"))
    rows.append(("control", _control(s)))
    goal = "" if s.length is None else f"p_x = {s.length:g} m, or "
    rows.append(("ends at", f"{goal}{s.t_max:g} s"))
    plain = {f: type(s).__dataclass_fields__[f].default for f in ("arm", "servo", "compensator")}
    own = [name for name, default in plain.items() if getattr(s, name) != default]
    own += ["hardware"] * (s.hardware is not None)
    if own:
        rows.append(("of its own", ", ".join(own)))
    return rows


def clay_text(clay: Clay) -> str:
    """The ranges of what clay resists with.

    Args:
        clay: the clay.
    """
    parts = []
    if clay.groove:
        parts.append(f"stays cut, up to {clay.groove.hardest:.4g} N")
    flows = [[x.ravel().tolist() for x in law.flows] for law in clay.laws]
    for name, unit, k in (("Fy", " N", 0), ("K", " N/(m/s)^n", 1)):
        told = _range(v for law in flows for v in law[k])
        parts += [f"{name} = {told}{unit}"] * bool(told)
    told = _range(n for law in flows for K, n in zip(*law[1:], strict=True) if K)
    parts += [f"n = {told}"] * bool(told)
    told = _range(v for law in clay.laws for v in law.damping.ravel().tolist())
    parts += [f"b = {told or '0'} N.s/m"] * bool(told or not parts)
    parts += ["grows"] * clay.grows + ["springs back"] * bool(clay.springs)
    parts += [f"axes rotated by {math.degrees(clay.angle):.4g} degrees"] * bool(clay.angle)
    return ", ".join(parts)


def _pair(x: tuple[float, float]) -> str:
    return f"({x[0]:.4g}, {x[1]:.4g})"


def _range(values: Iterable[float]) -> str:
    """The values but zero: their range where they are several, "" for none."""
    some = sorted({v for v in values if v})
    if not some:
        return ""
    return f"{some[0]:.4g}" if len(some) == 1 else f"{some[0]:.4g} to {some[-1]:.4g}"


def _hand(th: Operator | None) -> str:
    if th is None:
        return "none"
    return f"{th.mass:.4g} kg, {th.damper:.4g} N.s/m, {th.spring:.4g} N/m"


def _control(s: Any) -> str:
    if s.control == "continuous":
        return f"continuous, {s.integrator}, dt = {s.dt:g} s"
    return f"sampled, {s.render}, Ts = {s.Ts or s.dt:g} s, dt = {s.dt:g} s"
