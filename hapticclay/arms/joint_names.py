"""Names of joints that a file leaves without one."""

from __future__ import annotations

from typing import Any


def name_joints(spec: Any) -> None:
    """Names the joints of a spec that have no name: joint 1, joint 2, ... in the file's order."""
    taken = {joint.name for joint in spec.joints}
    for place, joint in enumerate(spec.joints, 1):
        if not joint.name:
            joint.name = _free(f"joint {place}", taken)
            taken.add(joint.name)


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "'"
    return name
