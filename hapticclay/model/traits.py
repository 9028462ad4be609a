"""What a part says of itself: its name, which scenes have it, and what refuses it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

YES, LEFT_OUT, NO = "yes", "left out", "no"  # what linear theory makes of a part


@dataclass(frozen=True)
class Refusal:
    """Why two parts cannot be combined.

    Attributes:
        field: dotted name of the field that the error is about.
        bound: what that field must be.
    """

    field: str
    bound: str


@dataclass(frozen=True)
class Trait:
    """A part of a scene, or a way to step it.

    Attributes:
        name: in words.
        group: "method", "clay" or "part".
        has: whether a scene has it; that of clay is asked of the clay.
        theory: whether linear theory knows it: "yes"; "left out", so that a gain limit is that of
            the scene without it; or "no", so that the scene is refused.
        refuses: what it cannot be combined with, by name of the other.
    """

    name: str
    group: str
    has: Callable[[Any], bool]
    theory: str = YES
    refuses: Mapping[str, Refusal] = field(default_factory=dict)
