"""An arm from a file on the command line: the same options in each command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from ..fields import value_of_text

if TYPE_CHECKING:
    from ..arms.mjcf_arm import MjcfArm


@dataclass(frozen=True)
class ArmOptions:
    """The arm of a file: its handle, its pose, and numbers in place of the file's.

    Attributes:
        site: Site or body at which the hand holds the arm.
        joints: Joints of the arm, in the order of the gains; by default those before the handle.
        pose: Joint positions, a number for each joint or NAME=POSITION [rad or m]; or a key frame
            of the file, by name or number.
        armature: Reflected inertia of the rotors, a number for all joints or for each, or
            NAME=INERTIA [kg.m^2].
        damping: Viscous damping of the joints, likewise [N.m.s/rad].
        friction: Coulomb friction of the joints, likewise [N.m].
        gravity: Whether the controller holds the arm against gravity.
    """

    site: str | None = None
    joints: tuple[str, ...] = ()
    pose: tuple[str, ...] = ()
    armature: tuple[str, ...] = ()
    damping: tuple[str, ...] = ()
    friction: tuple[str, ...] = ()
    gravity: Literal["compensated", "acts"] = "compensated"

    def arm(self, file: str) -> MjcfArm:
        """The arm."""
        from ..arms.mjcf_arm import MjcfArm

        return MjcfArm(
            file,
            site=self.site,
            joints=self.joints or None,
            pose=_pose(self.pose),
            armature=_per_joint("armature", self.armature),
            damping=_per_joint("damping", self.damping),
            friction=_per_joint("friction", self.friction),
            gravity=self.gravity,
        )


def _pose(words: Sequence[str]) -> Any:
    """A key frame, or positions."""
    if len(words) == 1 and "=" not in words[0]:
        return words[0]
    return _per_joint("pose", words)


def _per_joint(name: str, words: Sequence[str]) -> Any:
    """Values in order, one for all, or by the name of the joint, NAME=VALUE; None for none."""
    from ..scene.changes import split_words

    if not any("=" in word for word in words):
        values = [value_of_text(word) for word in words]
        return values[0] if len(values) == 1 else values or None
    pairs = split_words(name, words, "must be numbers, or NAME=NUMBER, each once, not both")
    return {joint: value_of_text(text) for joint, text in pairs.items()}
