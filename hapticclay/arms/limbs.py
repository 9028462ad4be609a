"""The tree of joints of a model: chains from a body to the world, and the one that is the arm."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple


class Several(Exception):
    """A file has several limbs, none of which is the arm.

    Args:
        tips: bodies at their ends.
    """

    def __init__(self, tips: list[int]):
        super().__init__(tips)
        self.tips = tips


class Limb(NamedTuple):
    """Joints one behind the other, and what they carry.

    Attributes:
        joints: joints up to where the tree of joints branches, from the base on.
        tip: body that the last of them moves.
        branches: limbs behind.
    """

    joints: list[int]
    tip: int
    branches: list[Limb]

    @property
    def depth(self) -> int:
        """Most joints one behind the other."""
        return len(self.joints) + max((limb.depth for limb in self.branches), default=0)


def bodies_to_root(model: Any, body: int) -> Iterator[int]:
    """A body, and those that carry it, without the world."""
    while body:
        yield body
        body = int(model.body_parentid[body])


def free_joint() -> int:
    """MuJoCo's number of a free joint."""
    from ..physics import mujoco

    return int(mujoco.mjtJoint.mjJNT_FREE)


def is_scalar(model: Any, joint: int) -> bool:
    """Whether a joint has one degree of freedom."""
    from ..physics import mujoco

    kinds = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
    return int(model.jnt_type[joint]) in map(int, kinds)


def joints_to_root(model: Any, body: int) -> list[int]:
    """Joints between a body and the nearest free body or the world, from the base on."""
    out, free = list[int](), free_joint()
    for place in bodies_to_root(model, body):
        first, count = int(model.body_jntadr[place]), int(model.body_jntnum[place])
        if count and model.jnt_type[first] == free:
            break
        out = [*range(first, first + count), *out]
    return out


def first_joints(model: Any) -> set[int]:
    """Joints that stand on the world or on a free body."""
    chains = (joints_to_root(model, body) for body in range(1, model.nbody))
    return {chain[0] for chain in chains if chain}


def depth_behind(model: Any, body: int) -> int:
    """Most joints one behind the other that a body carries."""
    before = len(joints_to_root(model, body))
    behind = [
        len(joints_to_root(model, x)) - before
        for x in range(body + 1, model.nbody)
        if body in bodies_to_root(model, x)
    ]
    return max(behind, default=0)


def branches(model: Any, body: int, inner: int) -> list[int]:
    """Depths of what a body carries, but for what carries a body behind it."""
    path = set(bodies_to_root(model, inner))
    out = []
    for child in range(body + 1, model.nbody):
        if int(model.body_parentid[child]) == body and child not in path:
            out.append(int(model.body_jntnum[child]) + depth_behind(model, child))
    return out


def arm_limb(model: Any) -> Limb | None:
    """The arm of a file that names no handle: the limb from the base to where a hand branches.

    A limb goes on where one branch is at least twice as long as all others (a torso with one arm,
    beside a head), and ends where what it carries is no longer than itself (fingers).

    Raises:
        Several: there are several.
    """
    limbs = _limbs(model)
    if not limbs:
        return None
    joints: list[int] = []
    while True:
        first = max(limbs, key=lambda limb: limb.depth)
        rivals = [limb for limb in limbs if 2 * limb.depth > first.depth]
        if len(rivals) > 1:
            raise Several([tip for limb in rivals for tip in _tips(limb)])
        joints += first.joints
        if not first.branches or max(limb.depth for limb in first.branches) <= len(joints):
            return Limb(joints, first.tip, first.branches)
        limbs = first.branches


def _tips(limb: Limb) -> list[int]:
    """Bodies at which a limb, or each of those into which it branches, has its hand."""
    if not limb.branches or max(x.depth for x in limb.branches) <= len(limb.joints):
        return [limb.tip]
    deepest = max(x.depth for x in limb.branches)
    return [tip for x in limb.branches if 2 * x.depth > deepest for tip in _tips(x)]


def _limbs(model: Any) -> list[Limb]:
    """The limbs that stand on the world or on a free body."""
    children = _moving_children(model)
    return [_grown(model, body, children) for body in children.get(0, [])]


def _moving_children(model: Any) -> dict[int, list[int]]:
    """Bodies with joints by the nearest body with joints that carries them; 0 for a base."""
    carrier, out, free = {0: 0}, dict[int, list[int]](), free_joint()
    for body in range(1, model.nbody):
        above = carrier[int(model.body_parentid[body])]
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        if count and model.jnt_type[first] == free:
            carrier[body] = 0
        elif count:
            out.setdefault(above, []).append(body)
            carrier[body] = body
        else:
            carrier[body] = above
    return out


def _grown(model: Any, body: int, children: dict[int, list[int]]) -> Limb:
    """The limb that starts at a body."""
    joints: list[int] = []
    while True:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        joints += range(first, first + count)
        behind = children.get(body, [])
        if len(behind) != 1:
            return Limb(joints, body, [_grown(model, x, children) for x in behind])
        body = behind[0]
