"""Pairs in files."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..arms import gain_files
from ..arms.joint_law import JointPD
from ..arms.mjcf_arm import MjcfArm
from ..errors import ParameterError
from ..fields import make_part, nodes_of
from ..model.arm import Arm
from .files import beside, naming_file, read_settings
from .link import ENDS
from .virtual_wall import Device

LAWS = ("law", "follower_law")
OF_ARM = (
    "file",
    "site",
    "joints",
    "pose",
    "armature",
    "damping",
    "friction",
    "gravity",
    "torque_limit",
    "plane",
)


def read_pair(path: str | os.PathLike[str], kind: type) -> Any:
    """The pair of a file.

    Raises:
        ParameterError: the file cannot be read, or holds no pair.
    """
    data = {name: x for name, x in read_settings(path, "pair").items() if name != "name"}
    folder = Path(path).parent
    with naming_file(path, "pair"):
        for name in (*ENDS, *LAWS):
            if name in data and not isinstance(data[name], Mapping):
                raise ParameterError(name, data[name], "must be a table")
        made = {name: _arm(data.pop(name), name, folder) for name in ENDS if name in data}
        made |= {name: _law(data.pop(name), name, folder) for name in LAWS if name in data}
        if "leader" in made:
            made.setdefault("follower", made["leader"])
        return make_part(kind, data, made)


def _arm(table: Mapping[str, Any], name: str, folder: Path) -> Any:
    """The arm of a table, of the class whose fields it has."""
    if "file" in table:
        for key in table:
            if key not in OF_ARM:
                bound = f"no such field: there are {', '.join(OF_ARM)}"
                raise ParameterError(f"{name}.{key}", table[key], bound)
        with _naming(name):
            return MjcfArm(**{**table, "file": beside(str(table["file"]), folder)})
    kind = Arm if any(key in nodes_of(Arm) for key in table) else Device
    return make_part(kind, table, path=name)


def _law(table: Mapping[str, Any], name: str, folder: Path) -> JointPD:
    given = dict(table)
    gains = given.pop("gains", None)
    start = {} if gains is None else gain_files.read_gains(beside(str(gains), folder))
    return make_part(JointPD, given, start, path=name)


@contextlib.contextmanager
def _naming(table: str) -> Iterator[None]:
    """Adds the table to the field of an error."""
    try:
        yield
    except ParameterError as error:
        raise ParameterError(f"{table}.{error.field}", error.value, error.bound) from None
