"""`hapticclay fields`: the names of all that --set, sweeps and scenario files can change."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ..errors import ParameterError
from ..fields import UNSET, Field, Node, dotted_names, leaves, no_field
from .options import Loose

WIDTH = 96  # characters of a line


@dataclass(frozen=True)
class FieldsCommand:
    """List the fields of a scenario: dotted name, default, unit, bounds, and what it is.

    The names are used by --set, sweeps and scenario files. gain.x is one entry of a pair,
    clay.x.values.1 one of a longer list. operator and compensator may differ by axis, as in
    operator.x.mass.

    Attributes:
        names: Print only names that contain one of these words, as in arm or servo.x. The name of
            an experiment, such as constant, prints its parameters.
    """

    names: Loose[tuple[str, ...]] = ()

    def __call__(self) -> int:
        from ..scene.experiments import EXPERIMENTS, parameters
        from ..scene.scenario import Scenario

        known, shown = leaves(Scenario, part=Scenario()), []
        for name in self.names:
            own = parameters(EXPERIMENTS[name]).values() if name in EXPERIMENTS else ()
            found = list(own) or [f for f in known if name in f.name or _is_entry(name, f.name)]
            if not found:
                refusal = no_field(name, "", [*EXPERIMENTS, *dotted_names(Scenario)])
                raise ParameterError("field", name, refusal.bound)
            shown += [f for f in found if f not in shown]
        print(field_list(shown if self.names else known))
        return 0


def _is_entry(name: str, field: str) -> bool:
    """Whether a name is that of an entry of a field, as gain.x or clay.x.values.1."""
    return name.startswith(f"{field}.") and bool(re.fullmatch(r"[xy]|\d+", name[len(field) + 1 :]))


def field_list(fields: Iterable[Field]) -> str:
    """Fields with their defaults, units, bounds and descriptions, for a terminal."""
    lines = []
    for f in fields:
        unit = f"  [{f.unit}]" if f.unit else ""
        lines.append(f"{f.name} = {_value_in_words(f.default)}{unit}  {_takes(f.node)}".rstrip())
        lines += textwrap.wrap(f.about, WIDTH, initial_indent="    ", subsequent_indent="    ")
    return "\n".join(lines)


def _value_in_words(value: Any) -> str:
    if value is UNSET:
        return "(to be given)"
    if isinstance(value, tuple):
        return ",".join(map(_value_in_words, value)) or "none"
    return f"{value:g}" if isinstance(value, float) else str(value).lower()


def _takes(node: Node) -> str:
    """Bounds of a number, or the words that a field takes."""
    words = list(node.words) or ["true", "false"] * (node.hint is bool)
    words += ["none"] * node.none
    low, high = node.bound.low, node.bound.high
    if not node.takes_numbers:
        return " | ".join(words)
    if isinstance(low, str):  # the name of a field
        words.insert(0, f"{low} to {high:g}")
    elif math.isfinite(low):
        above = "above " if node.bound.above else ""
        words.insert(0, f"{above}{low:g}{f' to {high:g}' if math.isfinite(high) else ' or more'}")
    elif words:
        words.insert(0, "a number")
    return " | ".join(words)
