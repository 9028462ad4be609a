"""Which joints an arm has: those before its handle, those tied to them; all others are locked.

Joints are numbers of a compiled model, of any kind. A joint that is free (a floating base, a loose
object) ends a chain, as the world does.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError
from . import geometry, limbs

DEPENDENT = 1e-9  # of the largest singular value: smaller ones belong to redundant constraints


class Tie(NamedTuple):
    """An equality constraint.

    Attributes:
        number: its index in the model.
        joints: joints that it ties.
        follower: the joint that it moves by the file's word; None for none.
        leader: the joint by which it moves that one; None for a fixed place.
        target: mocap body to which it pulls; "" for none.
    """

    number: int
    joints: frozenset[int]
    follower: int | None = None
    leader: int | None = None
    target: str = ""


# ---- what ties joints ----------------------------------------------------------------------------


def ties(model: Any) -> list[Tie]:
    """The equality constraints that act in a model."""
    from ..physics import mujoco

    bits = mujoco.mjtDisableBit
    if model.opt.disableflags & int(bits.mjDSBL_EQUALITY | bits.mjDSBL_CONSTRAINT):
        return []
    return [_tie(model, i) for i in np.flatnonzero(model.eq_active0).tolist()]


def _tie(model: Any, i: int) -> Tie:
    from ..physics import mujoco

    kind, of = mujoco.mjtEq(model.eq_type[i]), mujoco.mjtEq
    first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    if kind == of.mjEQ_JOINT:
        tied = frozenset(j for j in (first, second) if j >= 0)
        return Tie(i, tied, first, None if second < 0 else second)
    if kind == of.mjEQ_TENDON:
        tied = {j for t in (first, second) if t >= 0 for j in tendon_joints(model, t)}
        return Tie(i, frozenset(tied))
    if kind not in (of.mjEQ_CONNECT, of.mjEQ_WELD):
        return Tie(i, frozenset())
    bodies = [first, second]
    if model.eq_objtype[i] == int(mujoco.mjtObj.mjOBJ_SITE):
        bodies = [int(model.site_bodyid[x]) for x in bodies]
    roots = [int(model.body_rootid[x]) for x in bodies]
    targets = [model.body(x).name or "a body" for x in roots if model.body_mocapid[x] >= 0]
    return Tie(i, frozenset(between(model, *bodies)), target="".join(targets[:1]))


def tendon_joints(model: Any, tendon: int) -> set[int]:
    """Joints that change the length of a tendon."""
    from ..physics import mujoco

    start, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    kinds = [mujoco.mjtWrap(x) for x in model.wrap_type[start : start + count]]
    objects = model.wrap_objid[start : start + count].tolist()
    out, bodies = set[int](), []
    for kind, number in zip(kinds, objects, strict=True):
        if kind == mujoco.mjtWrap.mjWRAP_JOINT:
            out.add(number)
        elif kind == mujoco.mjtWrap.mjWRAP_SITE:
            bodies.append(int(model.site_bodyid[number]))
        elif kind != mujoco.mjtWrap.mjWRAP_PULLEY:
            bodies.append(int(model.geom_bodyid[number]))
    for one, other in zip(bodies, bodies[1:], strict=False):
        out |= between(model, one, other)
    return out


def between(model: Any, one: int, other: int) -> set[int]:
    """Joints that move one body against another."""
    return set(limbs.joints_to_root(model, one)) ^ set(limbs.joints_to_root(model, other))


# ---- the arm's joints ----------------------------------------------------------------------------


def driven(model: Any, chain: Sequence[int]) -> list[int]:
    """Of the joints of a chain and those tied to them, the ones that drive the rest.

    A joint that follows another by the file's word is left out, and its leader stands for it; of a
    closed chain those with actuators drive, in their order, or without any the first that can.
    """
    acting = [tie for tie in ties(model) if not tie.target]
    island = set(_island(acting, chain))
    here = [tie for tie in acting if tie.joints & island]
    leaders = {tie.follower: tie.leader for tie in here if tie.follower is not None}
    loops = {j for tie in here if tie.follower is None for j in tie.joints}
    out = _unique(_leader(j, leaders) for j in chain)
    if not loops:
        return out
    actuated = [j for j in _actuated(model) if j in island and j not in leaders]
    if not actuated:
        return _independent(model, here, [j for j in out if j not in leaders], sorted(island))
    return [*actuated, *(j for j in out if j not in loops and j not in actuated)]


def loop_on_base(model: Any) -> list[int]:
    """Joints of a closed chain that stands on the base with two or more of them; none without."""
    acting = [tie for tie in ties(model) if not tie.target]
    firsts = limbs.first_joints(model)
    for tie in acting:
        island = _island(acting, tie.joints) if tie.follower is None else set[int]()
        if len(firsts & island) > 1:
            return sorted(island)
    return []


def _leader(joint: int, leaders: dict[int, int | None]) -> int | None:
    """The joint that moves one, through joints that follow in turn; None for one held in place."""
    seen = set[int]()
    place: int | None = joint
    while place is not None and place in leaders and place not in seen:
        seen.add(place)
        place = leaders[place]
    return place


def _unique(joints: Iterable[int | None]) -> list[int]:
    return list(dict.fromkeys(j for j in joints if j is not None))


def island(model: Any, joints: Iterable[int]) -> set[int]:
    """Joints, and those that constraints tie to them."""
    return _island([tie for tie in ties(model) if not tie.target], joints)


def _island(acting: Sequence[Tie], joints: Iterable[int]) -> set[int]:
    """Joints, and those that ties lead to."""
    island, before = set(joints), -1
    while len(island) > before:
        before = len(island)
        for tie in acting:
            if tie.joints & island:
                island |= tie.joints
    return island


def _actuated(model: Any) -> list[int]:
    """Joints that actuators drive, in the order of the actuators."""
    first = [i for i in range(model.nactuator) if model.actuator_trntype[i] in _at_joints()]
    return _unique(int(model.actuator_trnid[i, 0]) for i in first)


def _independent(
    model: Any, here: Sequence[Tie], chain: Sequence[int], island: Sequence[int]
) -> list[int]:
    """The first joints of a chain that constraints leave to move each by itself."""
    from ..physics import mujoco

    model = copy.copy(model)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    data.eq_active[:] = 0
    data.eq_active[[tie.number for tie in here]] = 1
    mujoco.mj_forward(model, data)
    dense = np.reshape(data.efc_J, (-1, model.nv))[: data.nefc]
    equal = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    rows = dense[equal][:, [int(model.jnt_dofadr[j]) for j in island]]
    _, sizes, turned = np.linalg.svd(rows)
    rank = int(np.sum(sizes > DEPENDENT * sizes.max(initial=0.0)))
    moves, out = turned[rank:].T, list[int]()  # a row a joint of the island
    for j in chain:
        tried = moves[[island.index(x) for x in [*out, j]]]
        if np.linalg.matrix_rank(tried, 1e-6) == len(out) + 1:
            out.append(j)
    return out


def check_kinds(model: Any, joints: Iterable[int]) -> None:
    """Refuses an arm with a joint that has more than one degree of freedom.

    Raises:
        ParameterError: a joint of the arm, or one tied to it, is a ball.
    """
    from ..physics import mujoco

    for j in sorted(island(model, joints)):
        if not limbs.is_scalar(model, j):
            kind = mujoco.mjtJoint(model.jnt_type[j]).name.removeprefix("mjJNT_").lower()
            body = model.body(model.jnt_bodyid[j]).name
            bound = f"must be a hinge or a slide, is {kind}: name others by joints or site"
            raise ParameterError(f"joint of {body or 'a body'}", model.joint(j).name, bound)


# ---- all others ----------------------------------------------------------------------------------


def release(model: Any, joints: Sequence[int]) -> Iterator[str]:
    """Switches off constraints and tendons that are not of an arm; sentences on targets."""
    own = island(model, joints)
    for tie in ties(model):
        if tie.target or not tie.joints & own:
            model.eq_active0[tie.number] = 0
        if tie.target and tie.joints & own:
            yield f"a constraint to {tie.target}, which is moved by hand (mocap), takes no part"
    _still(model, own)
    moved = _moved_bodies(model, own)
    still = [i for i in range(model.nbody) if i not in moved]
    if moved:  # weight that moves nothing is not compensated differently
        model.body_gravcomp[still] = model.body_gravcomp[moved[-1]]


def _still(model: Any, own: set[int]) -> None:
    """Takes what is passive off tendons and joints that are locked, and their actuators."""
    from ..physics import mujoco

    tendons = [i for i in range(model.ntendon) if not tendon_joints(model, i) & own]
    joints = [j for j in range(model.njnt) if j not in own]
    for name in (
        "stiffness",
        "stiffnesspoly",
        "damping",
        "dampingpoly",
        "armature",
        "frictionloss",
    ):
        getattr(model, f"tendon_{name}")[tendons] = 0.0
    model.jnt_stiffnesspoly[joints] = model.dof_dampingpoly[joints] = 0.0
    of = {int(mujoco.mjtTrn.mjTRN_TENDON): tendons}
    of |= dict.fromkeys(_at_joints(), joints)
    for i in range(model.nactuator):
        if int(model.actuator_trnid[i, 0]) in of.get(int(model.actuator_trntype[i]), ()):
            for name in ("damping", "dampingpoly", "armature"):
                getattr(model, f"actuator_{name}")[i] = 0.0


def _at_joints() -> tuple[int, int]:
    """MuJoCo's numbers of actuators that drive a joint."""
    from ..physics import mujoco

    return int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)


def _moved_bodies(model: Any, joints: set[int]) -> list[int]:
    """Bodies that joints move."""
    return [i for i in range(1, model.nbody) if joints.intersection(limbs.joints_to_root(model, i))]


def hold(
    spec: Any, model: Any, position: np.ndarray, handle: tuple[str, int] | None
) -> tuple[Any, dict[int, int], list[str]]:
    """Locks joints with several degrees of freedom, which are of no arm, by deleting them.

    Args:
        spec: of the model; changed.
        model: compiled of it.
        position: of all joints, as in qpos.
        handle: kind and number of a site or body; None for none.

    Returns:
        The model without them, compiled again; the number of each joint in it, by that before;
        sentences about what is held.
    """
    from ..physics import mujoco, warnings_caught

    kept = [j for j in range(model.njnt) if limbs.is_scalar(model, j)]
    numbers = {j: i for i, j in enumerate(kept)}
    if len(kept) == model.njnt:
        return model, numbers, []
    data = mujoco.MjData(model)
    data.qpos[:] = position
    mujoco.mj_kinematics(model, data)
    held = [j for j in range(model.njnt) if j not in numbers]
    by_number = {x.id: x for x in spec.joints}
    bodies = {x.id: x for x in spec.bodies}
    for j in held:
        geometry.delete(spec, bodies[int(model.jnt_bodyid[j])], [by_number[j]])
    for body in sorted({int(model.jnt_bodyid[j]) for j in held}):
        _put(bodies[body], model, data, body)
    kind, number = handle or ("body", 0)
    tip = int(model.site_bodyid[number]) if kind == "site" else number
    words = list(_held_words(model, held, tip))
    with warnings_caught(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they were heard when it was compiled first
        return spec.compile(), numbers, words


def _put(body: Any, model: Any, data: Any, number: int) -> None:
    """Puts a body of a spec where it is in the data, in a frame of its own."""
    from ..physics import mujoco

    parent = int(model.body_parentid[number])
    back, place, turn = np.zeros(4), np.zeros(3), np.zeros(4)
    mujoco.mju_negQuat(back, data.xquat[parent])
    mujoco.mju_rotVecQuat(place, data.xpos[number] - data.xpos[parent], back)
    mujoco.mju_mulQuat(turn, back, data.xquat[number])
    body.set_frame(body.parent.add_frame())
    body.pos, body.quat = place, turn
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


def _held_words(model: Any, held: Sequence[int], tip: int) -> Iterator[str]:
    """Sentences about a floating base, loose objects, and balls."""
    from ..physics import mujoco

    bases = set(limbs.bodies_to_root(model, tip))
    loose, balls = [], []
    for j in held:
        body = int(model.jnt_bodyid[j])
        name = model.body(body).name or "a body"
        if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_BALL):
            balls.append(model.joint(j).name or name)
        elif body in bases:
            yield f"{name} (a floating base) is held where it is"
        else:
            loose.append(f"{name} (free)")
    if loose:
        yield (
            f"{', '.join(loose)} takes no part"
            if len(loose) == 1
            else (f"{', '.join(loose)} take no part")
        )
    if balls:
        yield f"locked (ball joints): {', '.join(balls)}"
