"""Gains of joints in files, under the names that projects give them."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import ParameterError, is_series, needing
from ..files import MOST_SETTINGS, parse_json, parse_toml, read_text

SUFFIXES = (".toml", ".json", ".yaml", ".yml")
PAIRS = (  # names of stiffness and damping
    ("Kp", "Kd"),
    ("kp", "kd"),
    ("kps", "kds"),
    ("k_gains", "d_gains"),
    ("position_kp", "position_kd"),
    ("position_p_coefficient", "position_d_coefficient"),
)
PID = ("p", "i", "d")  # of each joint, as ros2_control has them
UNTOLD = ("ros__parameters", "gains", "/**")  # names of tables that name no table of gains
OPENARM = ("LeaderArmParam", "FollowerArmParam")
OPENARM_JOINTS = 7  # and a gripper
OPENARM_SLOPE = 0.1  # its friction torque is Fc tanh(0.1 k w)
MISSPELT = 0.86  # likeness from which an unknown field is one of these, as frictoin; others pass
OTHERS = (
    "velocity", "cutoff", "runs", "friction", "gravity", "reference", "velocity_bits",
    "velocity_range",
)  # fmt: skip


class GainTable(NamedTuple):
    """A table with gains.

    Attributes:
        name: its name in the file, without those of tables that only hold it.
        table: all that it holds.
        gains: Kp and Kd: of each joint in order, or by name.
        order: joints in whose order gains by name are; None if the file does not say.
    """

    name: str
    table: Mapping[str, Any]
    gains: tuple[Any, Any]
    order: Sequence[str] | None = None


def read_gains(path: str | os.PathLike[str], joints: Sequence[str] | None = None) -> dict[str, Any]:
    """Fields of a JointPD in a file.

    Args:
        path: the file; FILE:TABLE for one of several tables of gains.
        joints: an arm's joints, in whose order gains by name are put; None for the file's.

    Raises:
        ParameterError: the file cannot be read, or holds no gains, or several and none is chosen.
    """
    file, name = _split(path)
    found = _chosen(file, name, list(_tables(_settings(file), ())))
    fields: dict[str, Any] = dict(zip(("Kp", "Kd"), _in_order(found, joints), strict=True))
    if found.name.rpartition(".")[2] in OPENARM:
        return _openarm(fields, found.table)
    for key in found.table:
        near = difflib.get_close_matches(str(key), OTHERS, n=1, cutoff=MISSPELT)
        if key not in OTHERS and near:
            bound = f"no such field; did you mean {near[0]!r}?"
            raise ParameterError(f"{found.name}.{key}", found.table[key], bound)
    return fields | {key: found.table[key] for key in OTHERS if key in found.table}


def _split(path: str | os.PathLike[str]) -> tuple[Path, str]:
    """A file, and the name of a table behind a colon."""
    text = os.fspath(path)
    file, colon, name = text.rpartition(":")
    behind = colon and Path(file).suffix.lower() in SUFFIXES and not os.path.isfile(text)
    return (Path(file), name) if behind else (Path(text), "")


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


# ---- tables --------------------------------------------------------------------------------------


def _tables(data: Any, path: tuple[str, ...], order: Any = None) -> Iterator[GainTable]:
    """Tables with gains."""
    if not isinstance(data, Mapping):
        return
    name = ".".join(key for key in path if key not in UNTOLD) or "gains"
    if is_series(data.get("joints")):
        order = data["joints"]
    for stiffness, damping in PAIRS:
        if stiffness in data and damping in data:
            yield GainTable(name, data, (data[stiffness], data[damping]), order)
            return
    if data and all(isinstance(x, Mapping) and {"p", "d"} <= {*x} for x in data.values()):
        yield GainTable(name, {}, _of_pids(data, name), order)
        return
    for key, inner in data.items():
        yield from _tables(inner, (*path, str(key)), order)


def _of_pids(data: Mapping[str, Any], name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Stiffness and damping by joint of a table of p, i and d."""
    for joint, pid in data.items():
        if pid.get("i"):
            bound = "must be 0: the law that is judged has no integral"
            raise ParameterError(f"{name}.{joint}.i", pid["i"], bound)
    return {k: x["p"] for k, x in data.items()}, {k: x["d"] for k, x in data.items()}


def _chosen(file: Path, name: str, found: list[GainTable]) -> GainTable:
    """The table of a name, or the only one."""
    wanted = [x for x in found if name in (x.name, x.name.rpartition(".")[2])] if name else found
    if len(wanted) == 1:
        return wanted[0]
    names = [x.name for x in found]
    if not found:
        pairs = ", ".join(f"{p} and {d}" for p, d in PAIRS)
        bound = f"must hold gains: a table with {pairs}, or with p and d of each joint"
    elif name:
        bound = f"must name one of its tables of gains: {', '.join(names)}"
    else:
        bound = f"holds {len(found)} tables of gains: choose one, as {file.name}:{names[-1]}"
        bound += f" ({', '.join(names)})"
    raise ParameterError("gains", f"{file}:{name}" if name else str(file), bound)


# ---- joints --------------------------------------------------------------------------------------


def _in_order(found: GainTable, joints: Sequence[str] | None) -> tuple[Any, Any]:
    """Kp and Kd in the order of an arm's joints; gains by name in that, or in the file's."""
    by_name = [x for x in found.gains if isinstance(x, Mapping)]
    if not by_name:
        return found.gains
    Kp, Kd = found.gains
    if len(by_name) < 2 or {*Kp} != {*Kd}:
        bound = "must name the same joints as Kp"
        raise ParameterError(f"{found.name}.Kd", Kd, bound)
    order = [str(x) for x in found.order or Kp]
    if joints is not None and any(x in Kp for x in joints):  # else the file has names of its own
        order = list(joints)
    lacking = [x for x in order if x not in Kp]
    if lacking:
        bound = f"must have gains of {', '.join(lacking)}, too; has {', '.join(map(str, Kp))}"
        raise ParameterError(found.name, dict(Kp), bound)
    return [Kp[x] for x in order], [Kd[x] for x in order]


def _openarm(fields: dict[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """The law of OpenArm's teleoperation: filtered rate, friction and gravity fed forward."""
    out = {name: list(x)[:OPENARM_JOINTS] for name, x in fields.items()}
    if all(key in table for key in ("Fc", "k", "Fv")):
        rows = zip(table["Fc"], table["k"], table["Fv"], strict=True)
        out["friction"] = [(Fc, OPENARM_SLOPE * k, Fv) for Fc, k, Fv in rows][:OPENARM_JOINTS]
    return out
