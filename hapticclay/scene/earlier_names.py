"""Names of release 0.2 in files, and their present names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import ParameterError

NAMES: dict[str, str] = {
    "interface": "hardware",
    "lost": "dropout_probability",
    "window": "velocity_window",
    "surface": "unilateral",
    "shaping": "inertia_shaping",
    "stop": "stop_when_unstable",
    "impedance": "operator",
    "springs_lost": "springs_dissipated",
}
VALUES = {("render", "implicit"): "physical"}


def with_present_names(data: Any) -> Any:
    """Renames the keys of plain data to the present names, in nested tables and dotted names."""
    if isinstance(data, list):
        return [with_present_names(x) for x in data]
    if not isinstance(data, Mapping):
        return data
    out: dict[str, Any] = {}
    for name, value in data.items():
        now = ".".join(NAMES.get(x, x) for x in str(name).split("."))
        value = with_present_names(value)
        if name == "operator" and "impedance" in data and isinstance(value, Mapping):
            pairs = {f"{name}.{k}": v for k, v in value.items()}  # beside the flag
        else:
            pairs = {now: VALUES.get((now, value), value) if isinstance(value, str) else value}
        if twice := out.keys() & pairs.keys():
            raise ParameterError(
                name, value, f"must not stand beside {twice.pop()}: it is the same"
            )
        out |= pairs
    return out
