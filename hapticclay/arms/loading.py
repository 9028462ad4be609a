"""From a file to a mechanism: joints, handle, pose and values per joint; what is refused."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from ..display import names_words
from ..errors import ParameterError, is_series, number
from . import actuators, content, handles, islands, limbs, model_file, passive, poses
from .joint_ranges import outside_words
from .mechanism import Mechanism
from .servo_gains import ServoGains, servo_gains

MOST_LOCKED = 400  # characters of their names; arm.pose has all
LIGHTEST = 1e-12  # [kg.m^2] least eigenvalue of M of a mechanism with an inverse
BOUNDS = {  # least and largest value, units at a hinge and at a slide
    "pose": (-1e3, 1e3, "rad", "m"),
    "armature": (0.0, 1e3, "kg.m^2", "kg"),
    "damping": (0.0, 1e6, "N.m.s/rad", "N.s/m"),
    "friction": (0.0, 1e6, "N.m", "N"),
    "torque_limit": (0.0, 1e6, "N.m", "N"),
}
OPEN = 1e-3  # [rad or m] by which a pose may miss a closed chain
SLIDE = 2  # MuJoCo's number of a joint that slides
IN_MODEL = {  # fields of the model with a value per degree of freedom
    "armature": "dof_armature",
    "damping": "dof_damping",
    "friction": "dof_frictionloss",
}


class Loaded(NamedTuple):
    """An arm's model, and what was chosen in it.

    Attributes:
        name: name of the model.
        mechanism: joints, inertia, Jacobian.
        fields: fields of the arm, as resolved.
        ranges: range of each joint [rad or m], shape (n, 2).
        notes: what the file leaves open.
        handles: sites and bodies that may be the handle, where there is none.
        servo: gains of the file's actuators.
    """

    name: str
    mechanism: Mechanism
    fields: dict[str, Any]
    ranges: np.ndarray
    notes: tuple[str, ...]
    handles: tuple[str, ...]
    servo: ServoGains


def load(arm: Any) -> Loaded:
    """Loads the file of an arm, and resolves its fields.

    Raises:
        ParameterError: the file cannot be loaded, or holds no arm of this kind.
    """
    from ..physics import warnings_caught

    with warnings_caught():  # of locked links without mass; those of the file are notes
        return _loaded(arm)


def _loaded(arm: Any) -> Loaded:
    file = model_file.opened(arm.file)
    grip = handles.handle(file.model, arm.site, _named_joints(file.model, arm.joints))
    joints = _arm_joints(file.model, arm.joints, grip.chain)
    without = _without_mass(file, joints)
    wanted, position = poses.placed(file.model, poses.wanted(arm.pose, joints))
    floating = poses.floating(file.model, position, joints)
    model, numbers, locked = islands.hold(file.spec, file.model, position, grip.site)
    file.finish(model)
    whole = copy.copy(file.model)  # as the file's own simulation has it
    joints, site = [numbers[j] for j in joints], grip.site
    outside = [*locked, *islands.release(model, joints), *content.off(model)]
    passive.settle(model)
    content.refuse(model)
    pose = _pose(model, wanted, joints)
    names = tuple(model.joint(j).name for j in joints)
    dofs = [int(model.jnt_dofadr[j]) for j in joints]
    fields: dict[str, Any] = {
        "file": model_file.kept(arm.file),
        "joints": names,
        "site": None if site is None else handles.name(model, site),
    }
    mechanism = Mechanism(model, dofs, site, pose)
    _check_joints(mechanism, names)
    passive.carry_friction(model, dofs, mechanism.following, mechanism.follow())
    for field, of in IN_MODEL.items():
        values = getattr(model, of)
        values[dofs] = _per_joint(model, field, getattr(arm, field), joints, values[dofs])
        _refuse_negative(field, values, model)
        fields[field] = tuple(values[dofs].tolist())
    limits = actuators.torque_limits(model, joints)
    given = _per_joint(model, "torque_limit", arm.torque_limit, joints, limits)
    _refuse_no_torque(names, given)
    fields["torque_limit"] = tuple(given)
    _check_inertia(mechanism, names)
    at = {model.joint(j).name: float(q) for j, q in enumerate(mechanism.pose)}
    fields["pose"] = at | floating
    own = _notes(model, arm, mechanism, joints, wanted)
    return Loaded(
        file.name,
        mechanism,
        fields,
        _ranges(model, joints),
        (
            *_guessed(file, without),
            *own,
            *grip.notes,
            *outside,
            *_moved(model, wanted, mechanism, pose),
            *file.notes,
        ),
        grip.names,
        _servo(whole, position, numbers, mechanism, names),
    )


def _servo(
    whole: Any,
    start: np.ndarray,
    numbers: dict[int, int],
    mechanism: Mechanism,
    names: Sequence[str],
) -> ServoGains:
    """Gains of the file's actuators at the arm's pose, from the model of the whole file."""
    position, follow = np.array(start), np.zeros((whole.nv, len(names)))
    moves = mechanism.follow()
    for before, now in numbers.items():
        position[whole.jnt_qposadr[before]] = mechanism.pose[now]
        follow[whole.jnt_dofadr[before]] = moves[now]
    return servo_gains(whole, position, follow, names)


def _guessed(file: model_file.Opened, without: Sequence[str]) -> Iterator[str]:
    """Sentences about mass that the file does not state."""
    if links := [x for x in file.guessed if x not in without]:
        names = ", ".join(links)
        yield f"no inertia in the file, computed from geometry at 1000 kg/m^3: {names}"
    if without:
        names = ", ".join(without)
        yield f"no inertia in the file, nor the mesh that gives it, counted as none: {names}"


def _without_mass(file: model_file.Opened, joints: Sequence[int]) -> list[str]:
    """What an arm carries whose inertia is in a mesh that is not there.

    Raises:
        ParameterError: it is a link of the arm itself.
    """
    model, carried = file.model, []
    island = islands.island(model, joints)
    links = {int(model.jnt_bodyid[j]) for j in island}
    for link, mesh in file.lacking.items():
        body = model.body(link).id
        if not island.intersection(limbs.joints_to_root(model, body)):
            continue
        weld = int(model.body_weldid[body])
        if body in links or (
            weld in links and not model.body_mass[model.body_weldid == weld].sum() > LIGHTEST
        ):
            bound = (
                f"must be there, as STL, OBJ or MSH: the inertia of {link} comes from it; or state "
                f"<inertial> for {link}"
            )
            raise ParameterError("mesh", mesh, bound)
        carried.append(link)
    return carried


# ---- joints --------------------------------------------------------------------------------------


def _named_joints(model: Any, wanted: Any) -> list[int] | None:
    """Joints that are named; None if none are."""
    if wanted is None:
        return None
    every = {model.joint(j).name: j for j in range(model.njnt)}
    if not is_series(wanted) or not len(list(wanted)):
        raise ParameterError("joints", wanted, "must be a list of names of joints")
    chosen = [every[full_name("joints", word, list(every))] for word in wanted]
    if len(set(chosen)) < len(chosen):
        raise ParameterError("joints", list(wanted), "must name each joint once")
    return chosen


def _arm_joints(model: Any, wanted: Any, chain: Sequence[int]) -> list[int]:
    """The arm's joints: those named, or those that drive the chain before the handle."""
    islands.check_kinds(model, chain if wanted is None else ())
    chosen = _named_joints(model, wanted)
    if chosen is None:
        chosen = islands.driven(model, chain)
    if not model.njnt:
        raise ParameterError("joints", None, "must be some that move: the file has none")
    if not chosen:
        raise ParameterError("joints", None, "must be named: no joint moves the handle")
    islands.check_kinds(model, chosen)
    return chosen


# ---- values --------------------------------------------------------------------------------------


def _per_joint(
    model: Any, field: str, given: Any, joints: Sequence[int], old: np.ndarray
) -> list[float]:
    """A value for each joint: given by name, or one for each; `old` for those not given."""
    names = [model.joint(j).name for j in joints]
    if given is None:
        pairs: dict[int, Any] = {}
    elif _is_one(given):
        pairs = dict.fromkeys(range(len(names)), given)
    elif isinstance(given, Mapping):
        pairs = {names.index(full_name(field, word, names)): x for word, x in given.items()}
    elif is_series(given) and len(list(given)) == len(names):
        pairs = dict(enumerate(given))
    else:
        bound = f"must be a number for each joint ({', '.join(names)}), for all, or by name"
        raise ParameterError(field, given, bound)
    low, high, *units = BOUNDS[field]
    out = [float(x) for x in old]
    for i, x in pairs.items():
        if field == "torque_limit" and x == math.inf:
            out[i] = math.inf
            continue
        unit = units[int(model.jnt_type[joints[i]]) == SLIDE]
        out[i] = number(f"{field}[{names[i]}]", x, low, high, unit=unit)
    return out


def _is_one(given: Any) -> bool:
    """Whether a value is one number, or text of one, for all joints."""
    return isinstance(given, str) or (isinstance(given, Real) and not isinstance(given, bool))


def full_name(field: str, word: Any, names: Sequence[str]) -> str:
    """The joint that a word names, in full or by the only ending behind _ or /, as joint4.

    Raises:
        ParameterError: there is no such joint; the error suggests the nearest name.
    """
    ends = [n for n in names if isinstance(word, str) and n.endswith((f"_{word}", f"/{word}"))]
    if word in names:
        return word
    if len(ends) != 1:
        raise handles.unknown(field, word, names, "a joint")
    return ends[0]


def _refuse_negative(field: str, values: np.ndarray, model: Any) -> None:
    """MuJoCo loads a file whose joints have less than no damping, friction or rotor inertia."""
    for j in np.flatnonzero(values < 0.0).tolist():
        name = model.joint(model.dof_jntid[j]).name
        bound = f"must be >= 0 in the file ({IN_MODEL[field].removeprefix('dof_')})"
        raise ParameterError(f"{field}[{name}]", float(values[j]), bound)


def _pose(model: Any, given: Any, joints: list[int]) -> np.ndarray:
    """Positions of all joints [rad or m]."""
    key = poses.keyframe(model, given)
    start = np.array(model.qpos0 if key is None else model.key_qpos[key], float)
    if isinstance(given, str | int):
        return start
    which = range(model.njnt) if isinstance(given, Mapping) else joints
    start[which] = _per_joint(model, "pose", given, which, start[which])
    return start


def _refuse_no_torque(names: Sequence[str], limits: Sequence[float]) -> None:
    """A motor pushes to both sides: a file's range (0, 5) leaves it nothing to one of them."""
    for name, limit in zip(names, limits, strict=True):
        if not limit > 0.0:
            bound = "must be > 0; the range of a file (actfrcrange) counts to both sides of 0"
            raise ParameterError(f"torque_limit[{name}]", limit, bound)


def _ranges(model: Any, joints: list[int]) -> np.ndarray:
    free = np.array([-math.inf, math.inf])
    return np.array([model.jnt_range[j] if model.jnt_limited[j] else free for j in joints])


# ---- what is refused, and what is noted ----------------------------------------------------------


def _check_joints(mechanism: Mechanism, names: Sequence[str]) -> None:
    """Refuses constraints that leave the arm free or stuck."""
    if mechanism.overclosed():
        bound = "must be free to move each by itself: constraints of the file tie them"
        raise ParameterError("joints", list(names), bound)
    if free := mechanism.freedom():
        bound = (
            f"must be those that are driven, at a pose that is not singular: beside them {free} "
            "more can move under the constraints of the file"
        )
        raise ParameterError("joints", list(names), bound)


def _check_inertia(mechanism: Mechanism, names: Sequence[str]) -> None:
    """Refuses joints without inertia."""
    inertia = mechanism.at(mechanism.pose[mechanism.dofs]).inertia
    if not np.linalg.eigvalsh(inertia).min() > LIGHTEST:
        light = names[int(np.diag(inertia).argmin())]
        bound = (
            "must have an inertia: the links behind it have none along its axis, nor has a rotor: "
            f"state <inertial> in the file, or armature of {light} [kg.m^2]"
        )
        raise ParameterError("joint", light, bound)


def _anchors(model: Any) -> Iterator[str]:
    """Where bodies are connected: MuJoCo takes the second point from the pose of the drawing."""
    from ..physics import mujoco

    for i in range(model.neq):
        bodies = model.eq_objtype[i] == int(mujoco.mjtObj.mjOBJ_BODY)
        if bodies and model.eq_type[i] == int(mujoco.mjtEq.mjEQ_CONNECT):
            points = [_shown(x) for x in np.array(model.eq_data[i][:6]).reshape(2, 3)]
            first, second = (model.body(x[i]).name for x in (model.eq_obj1id, model.eq_obj2id))
            yield f"{points[0]} of {first} is {points[1]} of {second} [m]"


def _shown(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in np.round(point, 9) + 0.0) + ")"


def _moved(model: Any, wanted: Any, mechanism: Mechanism, pose: np.ndarray) -> Iterator[str]:
    """A sentence if the pose of the file does not close the arm's chain."""
    if wanted is None and mechanism.following:
        i = max(mechanism.following, key=lambda i: abs(mechanism.pose[i] - pose[i]))
        gap = float(mechanism.pose[i] - pose[i])
        if abs(gap) > OPEN:
            name = model.joint(i).name
            yield f"the pose of the file does not close the chain: {name} was moved by {gap:.3g}"


def _pose_notes(model: Any, wanted: Any, mechanism: Mechanism, joints: list[int]) -> Iterator[str]:
    """Whose the pose is, unless it is given, and whether the arm can take it."""
    by_key = wanted is None or isinstance(wanted, str | int)
    key = poses.keyframe(model, wanted) if by_key else None
    whose = (
        "zero position of the file"
        if key is None
        else f"key frame {_key_name(model, key)} of the file"
    )
    whose = whose if by_key else "as given"
    names, q = [model.joint(j).name for j in joints], mechanism.pose[mechanism.dofs]
    if beyond := outside_words(q, _ranges(model, joints), names):
        yield f"pose: {whose}, at which {beyond}"
    elif by_key:
        yield f"pose: {whose}"


def _key_name(model: Any, key: int) -> str:
    return model.key(key).name or str(key)


def _notes(model: Any, arm: Any, mechanism: Mechanism, joints: list[int], wanted: Any) -> list[str]:
    """Sentences about what the file leaves open, and what of it takes no part."""
    names = [model.joint(j).name for j in joints]
    rotors = model.dof_armature[mechanism.dofs]
    bare = [name for name, x in zip(names, rotors, strict=True) if not x]
    whose = "given" if arm.armature is not None else "of the file"
    notes = [f"rotor inertia (armature): {whose}"]
    if bare:
        notes[0] = (
            f"no rotor inertia (armature) at {', '.join(bare)}: limits of geared joints are then "
            "far too low"
        )
    notes += _pose_notes(model, wanted, mechanism, joints)
    used = {*mechanism.dofs, *mechanism.following}
    locked = [model.joint(j).name for j in range(model.njnt) if j not in used]
    if locked:
        notes.append(f"locked: {names_words(locked, MOST_LOCKED)}")
    if mechanism.following:
        tied = [model.joint(j).name for j in mechanism.following]
        notes.append(f"constraints, taken as rigid, move {', '.join(tied)}")
        notes += _anchors(model)
    if model.nactuator:
        notes.append(f"{model.nactuator} actuators of the file give no torque beside the law")
    if np.any(model.geom_contype | model.geom_conaffinity):
        notes.append("contacts of the file take no part")
    if arm.torque_limit is None:
        notes += actuators.limit_notes(model, joints, names)
    by_joint = {j: model.joint(j).name for j in range(model.njnt)}
    return [*notes, *content.noted(model, by_joint, mechanism.dofs, mechanism.following)]
