"""Poses of a file's joints: key frames, positions, and where a floating base is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import ParameterError, choice, is_series, number
from ..units import is_quantity
from . import limbs

PLACE = ("x", "y", "z", "qw", "qx", "qy", "qz")  # of a free joint
FARTHEST = 1e6  # [m] of a base from the origin


def wanted(pose: Any, joints: Sequence[int]) -> Any:
    """A pose as it is given; of an arm with one joint a text may be its position."""
    if len(joints) > 1 or not isinstance(pose, str):
        return pose
    try:
        return [float(pose)]
    except ValueError:
        return [pose] if is_quantity(pose) else pose


def keyframe(model: Any, pose: Any) -> int | None:
    """The key frame of a pose: the one of this name or number, or "home" if none is wanted.

    Raises:
        ParameterError: there is none of this name or number.
    """
    names = [model.key(i).name for i in range(model.nkey)]
    if not isinstance(pose, str | int) or isinstance(pose, bool):
        return names.index("home") if "home" in names else None
    word = str(pose)
    if word in names:
        return names.index(word)
    if word.isdigit() and int(word) < len(names):
        return int(word)
    if not names:
        bound = "must be positions, by joint or one for each: the file has no key frames"
        raise ParameterError("pose", pose, bound)
    shown = [name or str(i) for i, name in enumerate(names)]
    choice("pose", word, shown, f"a key frame ({', '.join(shown)}), or positions")
    raise AssertionError


def placed(model: Any, wanted: Any) -> tuple[Any, np.ndarray]:
    """A pose without the places of free joints, and positions of all joints with them, as in qpos.

    Raises:
        ParameterError: a place is not seven numbers, or the key frame is none of the file.
    """
    key = keyframe(model, wanted)
    position = np.array(model.qpos0 if key is None else model.key_qpos[key], float)
    if not isinstance(wanted, Mapping):
        return wanted, position
    rest = dict(wanted)
    for j, name in _free_joints(model).items():
        if name in rest:
            at = int(model.jnt_qposadr[j])
            position[at : at + len(PLACE)] = _place(name, rest.pop(name))
    return rest, position


def floating(model: Any, position: np.ndarray, joints: Sequence[int]) -> dict[str, Any]:
    """Places of the bases of an arm's joints by name, where they are not those of the file."""
    start, out = placed(model, None)[1], dict[str, Any]()
    bodies = {x for j in joints for x in limbs.bodies_to_root(model, int(model.jnt_bodyid[j]))}
    for j, name in _free_joints(model).items():
        at = slice(int(model.jnt_qposadr[j]), int(model.jnt_qposadr[j]) + len(PLACE))
        if int(model.jnt_bodyid[j]) in bodies and np.any(position[at] != start[at]):
            out[name] = tuple(position[at].tolist())
    return out


def _free_joints(model: Any) -> dict[int, str]:
    free = limbs.free_joint()
    return {j: model.joint(j).name for j in range(model.njnt) if model.jnt_type[j] == free}


def _place(name: str, place: Any) -> list[float]:
    if not is_series(place) or len(list(place)) != len(PLACE):
        bound = f"must be the place of a base: {len(PLACE)} numbers ({', '.join(PLACE)})"
        raise ParameterError(f"pose[{name}]", place, bound)
    values = [
        number(f"pose[{name}, {axis}]", x, -FARTHEST, FARTHEST)
        for axis, x in zip(PLACE, place, strict=True)
    ]
    if not any(values[3:]):
        raise ParameterError(f"pose[{name}]", place, "must have a quaternion that is not 0")
    return values
