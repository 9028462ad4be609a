"""What a part says of itself: its name, which scenes have it, and what refuses it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

from ..errors import ParameterError

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


def present(scene: Any, traits: Iterable[Trait]) -> list[Trait]:
    """The traits that a scene has.

    Args:
        scene: a scenario; or clay, for those of clay.
        traits: to be looked for.
    """
    return [x for x in traits if x.has(scene)]


def check_traits(found: Sequence[Trait], scene: Any, prefix: str = "") -> None:
    """Refuses traits that cannot be combined.

    Args:
        found: the traits that there are.
        scene: a scenario, or clay.
        prefix: of the dotted names of the fields of `scene`.

    Raises:
        ParameterError: two of them cannot.
    """
    names = {x.name for x in found}
    for trait in found:
        for other, why in trait.refuses.items():
            if other in names:
                path = why.field.removeprefix(prefix).split(".")
                raise ParameterError(why.field, reduce(getattr, path, scene), why.bound)
