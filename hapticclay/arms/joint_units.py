"""Units of what joints have: joints that slide have lengths and forces for angles and torques."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

OF_SLIDES = {  # units of joints that turn, and of joints that slide
    "N.m.s/rad": "N.s/m",
    "N.m/rad": "N/m",
    "kg.m^2": "kg",
    "N.m": "N",
    "N·m": "N",
    "mrad": "mm",
    "rad/s": "m/s",
    "rad": "m",
}
UNIT = re.compile("|".join(rf"(?<!\w){re.escape(unit)}(?!\w)" for unit in OF_SLIDES))


class Joints:
    """What a result of joints adds: whether each slides.

    Attributes:
        names: joints.
        slides: whether each slides; then its units are those of forces and lengths. () for none.
    """

    names: tuple[str, ...]
    slides: tuple[bool, ...]

    @property
    def turning(self) -> list[bool]:
        """Whether each joint turns; others slide."""
        return [not slides for slides in self.slides] or [True] * len(self.names)


def of_joint(text: str, turns: bool) -> str:
    """A text with units of a joint that turns, in those of this joint."""
    return text if turns else UNIT.sub(lambda unit: OF_SLIDES[unit[0]], text)


def of_joints(text: str, turning: Sequence[bool]) -> str:
    """A head such as "Kp [N.m/rad]" in the units of joints; of both kinds "[N.m/rad or N/m]"."""
    if all(turning):
        return text
    if not any(turning):
        return of_joint(text, False)
    name, bracket, unit = text.partition("[")
    both = unit.removesuffix("]"), of_joint(unit.removesuffix("]"), False)
    return text if not bracket or both[0] == both[1] else f"{name}[{' or '.join(both)}]"


def table_of(table: Mapping[str, Any], turning: Sequence[bool]) -> dict[str, Any]:
    """A table with such heads; with both kinds of joints the names say which slide."""
    out = {of_joints(head, turning): column for head, column in table.items()}
    if any(turning) and not all(turning) and "joint" in out:
        pairs = zip(out["joint"], turning, strict=True)
        out["joint"] = tuple(name if turns else f"{name} (slides)" for name, turns in pairs)
    return out
