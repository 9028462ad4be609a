"""From a file to a mechanism: joints, handle, pose and values per joint; what is refused."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..display import one_line
from ..errors import ParameterError, choice, is_series, nearest, number
from . import actuators, content, passive
from .joint_names import name_joints
from .joint_ranges import outside_words
from .mechanism import Mechanism

LIGHTEST = 1e-12  # [kg.m^2] least eigenvalue of M of a mechanism with an inverse
BOUNDS = {  # least and largest value, units at a hinge and at a slide
    "pose": (-1e3, 1e3, "rad", "m"),
    "armature": (0.0, 1e3, "kg.m^2", "kg"),
    "damping": (0.0, 1e6, "N.m.s/rad", "N.s/m"),
    "friction": (0.0, 1e6, "N.m", "N"),
    "torque_limit": (0.0, 1e6, "N.m", "N"),
}
OPEN = 1e-3  # [rad or m] by which a pose may miss a closed chain
UNNAMED = "MuJoCo Model"  # MuJoCo's name of a model without one
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
    """

    name: str
    mechanism: Mechanism
    fields: dict[str, Any]
    ranges: np.ndarray
    notes: tuple[str, ...]


def load(arm: Any) -> Loaded:
    """Loads the file of an arm, and resolves its fields.

    Raises:
        ParameterError: the file cannot be loaded, or holds no arm of this kind.
    """
    model, name = compiled(arm.file)
    _refuse_joints(model)
    off = tuple(content.off(model))
    passive.settle(model)
    content.refuse(model)
    site = _handle(model, arm.site)
    joints = _arm_joints(model, arm.joints, site)
    pose = _pose(model, arm.pose, joints)
    names = tuple(model.joint(j).name for j in joints)
    dofs = [int(model.jnt_dofadr[j]) for j in joints]
    fields: dict[str, Any] = {
        "file": _kept(arm.file),
        "joints": names,
        "site": None if site is None else _name(model, site),
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
    fields["pose"] = {model.joint(j).name: float(q) for j, q in enumerate(mechanism.pose)}
    return Loaded(
        name,
        mechanism,
        fields,
        _ranges(model, joints),
        (*_notes(model, arm, mechanism, joints), *off, *_moved(model, arm, mechanism, pose)),
    )


# ---- the file ------------------------------------------------------------------------------------


def compiled(file: Any) -> tuple[Any, str]:
    """The model of a file or spec, and its name."""
    from ..physics import warnings_caught

    with warnings_caught() as caught:
        try:
            spec, name = spec_of(file)
            name_joints(spec)
            model = spec.compile()
        except ValueError as error:
            if isinstance(error, ParameterError):
                raise
            raise _bad_file(file, one_line(error, 200)) from None
    if caught:
        raise _bad_file(file, one_line(caught[0], 200))
    for array in ("body_mass", "body_inertia", "dof_armature", "dof_damping", "jnt_axis"):
        if not np.isfinite(getattr(model, array)).all():
            raise _bad_file(file, f"{array} is not finite")
    return model, name


def spec_of(file: Any) -> tuple[Any, str]:
    """The spec of a file, or a copy of a spec, and the name of its model."""
    from ..physics import mujoco

    path = None if isinstance(file, mujoco.MjSpec) else _path(file)
    if path is None:
        spec = file.copy()
        return spec, spec.modelname
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.fusestatic = False  # a URDF's tool keeps its name
    return spec, spec.modelname if spec.modelname != UNNAMED else path.stem


def _kept(file: Any) -> Any:
    """A path as text, which files can hold; of a spec, which its owner may change, a copy."""
    if isinstance(file, os.PathLike):
        return os.fspath(file)
    return file if isinstance(file, str) else file.copy()


def _path(file: Any) -> Path:
    """The path of a file, or of an arm of the package by its name."""
    from ..physics import mjcf_folder

    if not isinstance(file, str | os.PathLike):
        raise ParameterError("file", file, "must be an MJCF or URDF file, or an mujoco.MjSpec")
    path = Path(file)
    is_name = isinstance(file, str) and not path.suffix and os.sep not in file
    if is_name and not os.path.isdir(path):  # one of the package's
        own = {x.stem: x for x in sorted((mjcf_folder() / "arms").glob("*.xml"))}
        path = own[choice("file", file, tuple(own))]
    if not os.path.isfile(path):
        bound = f"must be an MJCF or URDF file ({_lacks(path)})"
        raise ParameterError("file", one_line(path, 200), bound)
    return path


def _lacks(path: Path) -> str:
    """Why a path is no file."""
    if str(path).lstrip().startswith("<"):
        return "this is a model's text: give mujoco.MjSpec.from_string of it"
    return "this is a folder" if os.path.isdir(path) else "there is none"


def _bad_file(file: Any, why: str) -> ParameterError:
    shown = str(file) if isinstance(file, str | os.PathLike) else "MjSpec"
    return ParameterError("file", shown, f"must be a file that MuJoCo loads ({why})")


def _refuse_joints(model: Any) -> None:
    """Refuses joints that have more than one degree of freedom."""
    from ..physics import mujoco

    scalar = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
    for j in range(model.njnt):
        if model.jnt_type[j] not in scalar:
            kind = mujoco.mjtJoint(model.jnt_type[j]).name.removeprefix("mjJNT_").lower()
            body = model.body(model.jnt_bodyid[j]).name
            bound = f"must be a hinge or a slide, is {kind}: an arm stands on the world"
            raise ParameterError(f"joint of {body or 'a body'}", model.joint(j).name, bound)


# ---- handle and joints ---------------------------------------------------------------------------


def _name(model: Any, site: tuple[str, int]) -> str:
    kind, index = site
    return (model.site if kind == "site" else model.body)(index).name


def _handle(model: Any, wanted: str | None) -> tuple[str, int] | None:
    """The site or body of the handle; None if the file has no site on a moving body."""
    sites = {model.site(i).name: i for i in range(model.nsite)}
    if wanted is None:
        moving = [i for i in sites.values() if model.body_weldid[model.site_bodyid[i]]]
        if len(moving) > 1:
            bound = f"must be named: there are {', '.join(model.site(i).name for i in moving)}"
            raise ParameterError("site", None, bound)
        return ("site", moving[0]) if moving else None
    bodies = {model.body(i).name: i for i in range(1, model.nbody)}
    if not isinstance(wanted, str):
        raise ParameterError("site", wanted, "must be the name of a site or body, or None")
    if wanted in sites:
        return "site", sites[wanted]
    if wanted in bodies:
        return "body", bodies[wanted]
    raise _unknown("site", wanted, [*sites, *bodies], "a site or body")


def _unknown(field: str, word: Any, names: Sequence[str], kind: str) -> ParameterError:
    near = nearest(word, names) if isinstance(word, str) else []
    hint = f"; did you mean {near[0]!r}?" if near else f": {one_line(', '.join(names), 200)}"
    return ParameterError(field, word, f"must be {kind} of the file{hint}")


def _arm_joints(model: Any, wanted: Any, site: tuple[str, int] | None) -> list[int]:
    """The arm's joints: those named, or those between the handle and the world."""
    every = {model.joint(j).name: j for j in range(model.njnt)}
    if wanted is not None:
        if not is_series(wanted) or not len(list(wanted)):
            raise ParameterError("joints", wanted, "must be a list of names of joints")
        chosen = [every[full_name("joints", word, list(every))] for word in wanted]
        if len(set(chosen)) < len(chosen):
            raise ParameterError("joints", list(wanted), "must name each joint once")
    else:
        chosen = _driven(model, _chain(model, site))
    if not chosen:
        raise ParameterError("joints", None, "must be named: no joint moves the handle")
    return chosen


def _chain(model: Any, site: tuple[str, int] | None) -> list[int]:
    """Joints between the handle and the world, from the base on; all without a handle."""
    if site is None:
        return list(range(model.njnt))
    kind, index = site
    body, out = int(model.site_bodyid[index]) if kind == "site" else index, []
    while body:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        out = [*range(first, first + count), *out]
        body = int(model.body_parentid[body])
    return out


def _driven(model: Any, chain: list[int]) -> list[int]:
    """Joints that a closed chain's actuators drive; those of the chain if it is open."""
    if not model.neq:
        return chain
    from ..physics import mujoco

    at_joints = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
    return [int(j) for j in model.actuator_trnid[at_joints, 0]] or chain


# ---- values --------------------------------------------------------------------------------------


def _per_joint(
    model: Any, field: str, given: Any, joints: Sequence[int], old: np.ndarray
) -> list[float]:
    """A value for each joint: given by name, or one for each; `old` for those not given."""
    names = [model.joint(j).name for j in joints]
    if given is None:
        pairs: dict[int, Any] = {}
    elif isinstance(given, Mapping):
        pairs = {names.index(full_name(field, word, names)): x for word, x in given.items()}
    elif is_series(given) and len(list(given)) == len(names):
        pairs = dict(enumerate(given))
    else:
        bound = f"must be a number for each joint ({', '.join(names)}), or by name"
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


def full_name(field: str, word: Any, names: Sequence[str]) -> str:
    """The joint that a word names, in full or by the only ending behind _ or /, as joint4.

    Raises:
        ParameterError: there is no such joint; the error suggests the nearest name.
    """
    ends = [n for n in names if isinstance(word, str) and n.endswith((f"_{word}", f"/{word}"))]
    if word in names:
        return word
    if len(ends) != 1:
        raise _unknown(field, word, names, "a joint")
    return ends[0]


def _refuse_negative(field: str, values: np.ndarray, model: Any) -> None:
    """MuJoCo loads a file whose joints have less than no damping, friction or rotor inertia."""
    for j in np.flatnonzero(values < 0.0).tolist():
        name = model.joint(model.dof_jntid[j]).name
        bound = f"must be >= 0 in the file ({IN_MODEL[field].removeprefix('dof_')})"
        raise ParameterError(f"{field}[{name}]", float(values[j]), bound)


def _pose(model: Any, given: Any, joints: list[int]) -> np.ndarray:
    """Positions of all joints [rad or m]."""
    start = np.array(model.qpos0, float)
    keys = {model.key(i).name: i for i in range(model.nkey)}
    if "home" in keys:
        start = np.array(model.key_qpos[keys["home"]], float)
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
            "must have an inertia: the links behind it have none along its axis, nor has a rotor"
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


def _moved(model: Any, arm: Any, mechanism: Mechanism, pose: np.ndarray) -> Iterator[str]:
    """A sentence if the pose of the file does not close the arm's chain."""
    if arm.pose is None and mechanism.following:
        i = max(mechanism.following, key=lambda i: abs(mechanism.pose[i] - pose[i]))
        gap = float(mechanism.pose[i] - pose[i])
        if abs(gap) > OPEN:
            name = model.joint(i).name
            yield f"the pose of the file does not close the chain: {name} was moved by {gap:.3g}"


def _pose_notes(model: Any, arm: Any, mechanism: Mechanism, joints: list[int]) -> Iterator[str]:
    """Whose the pose is, unless it is given, and whether the arm can take it."""
    homes = [model.key(i).name for i in range(model.nkey)]
    whose = "key frame home of the file" if "home" in homes else "zero position of the file"
    whose = whose if arm.pose is None else "as given"
    names, q = [model.joint(j).name for j in joints], mechanism.pose[mechanism.dofs]
    if beyond := outside_words(q, _ranges(model, joints), names):
        yield f"pose: {whose}, at which {beyond}"
    elif arm.pose is None:
        yield f"pose: {whose}"


def _notes(model: Any, arm: Any, mechanism: Mechanism, joints: list[int]) -> list[str]:
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
    notes += _pose_notes(model, arm, mechanism, joints)
    used = {*mechanism.dofs, *mechanism.following}
    locked = [model.joint(j).name for j in range(model.njnt) if j not in used]
    if locked:
        notes.append(f"locked: {', '.join(locked)}")
    if mechanism.following:
        tied = [model.joint(j).name for j in mechanism.following]
        notes.append(f"constraints, taken as rigid, move {', '.join(tied)}")
        notes += _anchors(model)
    if model.nactuator:
        notes.append(f"{model.nactuator} actuators of the file take no part")
    if np.any(model.geom_contype | model.geom_conaffinity):
        notes.append("contacts of the file take no part")
    if arm.torque_limit is None:
        notes += actuators.limit_notes(model, joints, names)
    by_joint = {j: model.joint(j).name for j in range(model.njnt)}
    return [*notes, *content.noted(model, by_joint, mechanism.dofs, mechanism.following)]
