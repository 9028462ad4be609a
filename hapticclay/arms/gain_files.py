"""Gains of joints in files, under the names that projects give them."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..errors import ParameterError, needing
from ..files import MOST_SETTINGS, parse_json, parse_toml, read_text

SUFFIXES = (".toml", ".json", ".yaml", ".yml")
PAIRS = (  # names of stiffness and damping
    ("Kp", "Kd"),
    ("kp", "kd"),
    ("position_kp", "position_kd"),
    ("position_p_coefficient", "position_d_coefficient"),
)
OPENARM = ("LeaderArmParam", "FollowerArmParam")
OPENARM_JOINTS = 7  # and a gripper
OPENARM_SLOPE = 0.1  # its friction torque is Fc tanh(0.1 k w)
MISSPELT = 0.86  # likeness from which an unknown field is one of these, as frictoin; others pass
OTHERS = (
    "velocity", "cutoff", "runs", "friction", "gravity", "reference", "velocity_bits",
    "velocity_range",
)  # fmt: skip


def read_gains(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Fields of a JointPD in a file.

    Raises:
        ParameterError: the file cannot be read, or holds no gains or two sets of them.
    """
    found = list(_tables(_settings(Path(path)), ""))
    if len(found) != 1:
        names = " or ".join(f"{p}, {d}" for p, d in PAIRS)
        some = f"holds {', '.join(name for name, _, _ in found)}" if found else "holds none"
        raise ParameterError("gains", str(path), f"must hold one table of gains ({names}); {some}")
    name, table, (stiffness, damping) = found[0]
    fields = {"Kp": table[stiffness], "Kd": table[damping]}
    if name in OPENARM:
        return _openarm(fields, table)
    for key in table:
        near = difflib.get_close_matches(str(key), OTHERS, n=1, cutoff=MISSPELT)
        if key not in OTHERS and near:
            bound = f"no such field; did you mean {near[0]!r}?"
            raise ParameterError(f"{name}.{key}", table[key], bound)
    return fields | {key: table[key] for key in OTHERS if key in table}


def _settings(file: Path) -> Any:
    if file.suffix.lower() not in SUFFIXES:
        raise ParameterError("gains", str(file), f"must be a file {', '.join(SUFFIXES)}")
    try:
        text = read_text(file, MOST_SETTINGS)
        if file.suffix.lower() == ".toml":
            return parse_toml(text)
        return parse_json(text) if file.suffix.lower() == ".json" else _yaml(text)
    except ParameterError:
        raise
    except OSError as error:
        bound = f"must be a file that can be read ({error.strerror})"
        raise ParameterError("gains", str(file), bound) from None
    except ValueError as error:
        fault = " ".join(str(error).split())
        raise ParameterError("gains", str(file), f"cannot be read: {fault}") from None


def _yaml(text: str) -> Any:
    with needing("a YAML file", "pyyaml", "yaml"):
        import yaml
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from None


def _tables(data: Any, name: str) -> Iterator[tuple[str, Mapping[str, Any], tuple[str, str]]]:
    """Tables with gains, their names and the names of both gains."""
    if not isinstance(data, Mapping):
        return
    for stiffness, damping in PAIRS:
        if stiffness in data and damping in data:
            yield name or "gains", data, (stiffness, damping)
            return
    for key, inner in data.items():
        yield from _tables(inner, str(key))


def _openarm(fields: dict[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """The law of OpenArm's teleoperation: filtered rate, friction and gravity fed forward."""
    out = {name: list(x)[:OPENARM_JOINTS] for name, x in fields.items()}
    if all(key in table for key in ("Fc", "k", "Fv")):
        rows = zip(table["Fc"], table["k"], table["Fv"], strict=True)
        out["friction"] = [(Fc, OPENARM_SLOPE * k, Fv) for Fc, k, Fv in rows][:OPENARM_JOINTS]
    return out
