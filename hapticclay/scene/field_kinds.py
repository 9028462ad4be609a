"""Types of fields: parts of one or several classes, pairs, numbers, and their defaults."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping, Sequence
from types import UnionType
from typing import Any, Union, get_args, get_origin

from ..errors import Bound, ParameterError, field_types, nearest
from ..model.constants import AXES
from ..model.hardware import JOINTS

KIND = "kind"  # key of the class, for a field of several classes
USUAL_KIND = "multisine"  # the class without that key, where none of its own is usual
UNSET = dataclasses.MISSING
MOST_TOLD = 8  # names that an error lists besides the nearest one
ENTIRE = None  # key of the value of a whole field, besides those of its entries


def terms_field(kind: type) -> str:
    """The field of a class that only needs a tuple of parts, such as a sum; "" for others."""
    hints = {name: hint for name, (hint, _) in field_types(kind).items()}
    name, hint = next(iter(hints.items()), ("", None))
    row = get_origin(hint) is tuple and get_args(hint)[1:] == (...,) and part_classes(hint)
    alone = all(default_of(kind, x) is not UNSET for x in hints if x != name)
    return name if row and alone else ""


def union_members(hint: Any) -> tuple[Any, ...]:
    """Members of a union; for another type, a tuple of the type itself."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def is_pair(hint: Any) -> bool:
    """Whether a type is a pair of parts, one per axis."""
    items = get_args(hint)
    return (
        get_origin(hint) is tuple
        and len(items) == 2
        and items[1] is not ...
        and bool(part_classes(items[0]))
    )


def part_classes(hint: Any) -> dict[str, type]:
    """Classes of parts that a type accepts, single or in a tuple, by lower-case name."""
    out: dict[str, type] = {}
    for member in union_members(hint):
        items = get_args(member) if get_origin(member) is tuple else (member,)
        for item in items:
            if item is not member and item is not ...:
                out |= part_classes(item)
            elif isinstance(item, type) and item.__module__ != "builtins":
                out |= {k.__name__.lower(): k for k in _family(item)}
    return out


def _family(kind: type) -> Iterator[type]:
    """A class and its subclasses that are parts, except bases without fields."""
    below = kind.__subclasses__()
    if dataclasses.is_dataclass(kind) and (dataclasses.fields(kind) or not below):
        yield kind
    for sub in below:
        yield from _family(sub)


def usual_class(hint: Any, classes: Mapping[str, type]) -> type | None:
    """The class of a part without a kind; None if the kind is required."""
    if len(classes) == 1:
        return next(iter(classes.values()))
    own = [m for m in union_members(hint) if m in classes.values()]
    return own[0] if own else classes.get(USUAL_KIND)


def entry_names(kind: Any, bound: Bound, old: Any = UNSET) -> dict[str, int]:
    """Names of the numbers of a tuple, and their places."""
    if get_args(kind)[1:] == (...,):
        return {str(i): i for i in range(len(old) if isinstance(old, tuple | list) else 0)}
    out = {name: i for i, name in enumerate(bound.names)}
    if bound.names == JOINTS:
        out |= {axis: i for i, axis in enumerate(AXES)}
    return out | {str(i): i for i in range(len(bound.names))}


def join_names(path: str, name: object) -> str:
    """A dotted name."""
    return f"{path}.{name}" if path else str(name)


def no_field(name: str, value: Any, known: Sequence[str]) -> ParameterError:
    """The error for an unknown field; it suggests the nearest one."""
    if not known:
        whole = name.rpartition(".")[0]
        bound = f"{whole} is not given: give it as a whole, in a file as [[{whole}]]"
        return ParameterError(name, value, bound)
    depth = name.count(".")
    level = list(dict.fromkeys(".".join(k.split(".")[: depth + 1]) for k in known))
    near = nearest(name, level)
    if not near:  # another part may have this field
        last, ends = name.rpartition(".")[2], {k.rpartition(".")[2]: k for k in reversed(known)}
        near = [ends[n] for n in nearest(last, ends)]
    path, _, _ = name.rpartition(".")
    told = ", ".join(k.removeprefix(f"{path}.") for k in level)
    bound = (
        "no such field" if near and len(level) > MOST_TOLD else f"no such field; there are {told}"
    )
    while isinstance(value, Mapping) and len(value) == 1:  # what was given of it
        inner, value = next(iter(value.items()))
        name = name if inner is ENTIRE else join_names(name, inner)
    return ParameterError(name, value, f"{bound}; did you mean {near[0]!r}?" if near else bound)


def default_of(kind: type, name: str) -> Any:
    """The default of a field; UNSET if it has none."""
    return _defaults(kind)[name]


@functools.cache
def _defaults(kind: type) -> dict[str, Any]:
    return {
        f.name: f.default_factory() if f.default_factory is not UNSET else f.default
        for f in dataclasses.fields(kind)
    }
