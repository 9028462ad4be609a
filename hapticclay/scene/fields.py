"""Fields of a part by dotted name: "servo.x.G.damping" of a scenario is a number three parts down.

A part is a frozen dataclass whose fields `errors.check_fields` checks; parts lie within parts.
"""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, ParamSpec, TypeVar, get_args, get_origin, get_type_hints

from ..arguments import known_names
from ..errors import Bound, field_types
from ..model.constants import AXES, each_axis
from .field_kinds import (
    KIND,
    UNSET,
    default_of,
    entry_names,
    is_pair,
    join_names,
    part_classes,
    union_members,
)

P = ParamSpec("P")
T = TypeVar("T")
R = TypeVar("R")


class Field(NamedTuple):
    """A field that accepts numbers or words.

    Attributes:
        name: its dotted name.
        hint: its type.
        bound: its bound and unit.
        default: its default value; UNSET if it must be given.
        about: its description.
    """

    name: str
    hint: Any
    bound: Bound
    default: Any
    about: str


def fields_of(kind: type, path: str = "", part: Any = UNSET) -> tuple[Field, ...]:
    """The fields of a class that accept numbers or words, including those of nested parts."""
    out: list[Field] = []
    about = field_descriptions(kind)
    for name, (hint, bound) in field_types(kind).items():
        default = default_of(kind, name) if part is UNSET else getattr(part, name)
        out += _fields_at(hint, bound or Bound(), join_names(path, name), default, about[name])
    return tuple(out)


def _fields_at(hint: Any, bound: Bound, path: str, default: Any, about: str) -> Iterator[Field]:
    kinds, classes = union_members(hint), part_classes(hint)
    if not classes:
        yield Field(path, hint, bound, default, about)
        return
    if all(map(is_pair, kinds)):
        before = each_axis(default)
        for axis, item, part in zip(AXES, get_args(kinds[0]), before, strict=True):
            yield from _fields_at(item, Bound(), join_names(path, axis), part, about)
        return
    if kinds[0] is hint and get_origin(hint) is tuple:  # any number of parts
        for i, part in enumerate(default if isinstance(default, tuple) else ()):
            yield from _fields_at(get_args(hint)[0], Bound(), join_names(path, i), part, about)
        return
    for kind in classes.values():
        if any(kind in part_classes(h).values() for h, _ in field_types(kind).values()):
            continue  # made of parts of its own class
        part = default if type(default) is kind else UNSET
        for field in fields_of(kind, path, part):
            told = f"of {kind.__name__.lower()}: {field.about}" if len(classes) > 1 else field.about
            yield field._replace(about=told)


def dotted_names(kind: type, path: str = "") -> list[str]:
    """Names of all fields of a class, in the order of `fields_of`, then of parts without fields."""
    names = [f.name for f in fields_of(kind, path)]
    heads = {n[len(path) + 1 if path else 0 :].partition(".")[0] for n in names}
    return names + [join_names(path, n) for n in field_types(kind) if n not in heads]


def bounds_at(hint: Any, bound: Bound | None, names: Sequence[str]) -> list[Bound]:
    """Bounds of the value at a dotted name below a field; empty if there is none."""
    if not names:
        return [bound or Bound()]
    first, rest, out = names[0], names[1:], []
    for kind in union_members(hint):
        if is_pair(kind):
            item, _ = get_args(kind)
            out += bounds_at(item, None, rest if first in AXES else names)
        elif get_origin(kind) is tuple and not part_classes(kind):
            known = entry_names(kind, bound or Bound())
            if first in known or (get_args(kind)[1:] == (...,) and first.isdecimal()):
                out += bounds_at(get_args(kind)[0], bound, rest)
        elif get_origin(kind) is tuple:
            out += bounds_at(get_args(kind)[0], None, rest) if first.isdecimal() else []
        else:
            for part in part_classes(kind).values():
                out += [Bound()] if first == KIND and not rest else []
                if first in field_types(part):
                    out += bounds_at(*field_types(part)[first], rest)
    return out


def field_unit(name: str, *kinds: type) -> str:
    """Unit of a number by its dotted name, in the first class that has one there; "" for none."""
    head, *rest = name.split(".")
    for kind in kinds:
        if head in field_types(kind):
            units = [b.unit for b in bounds_at(*field_types(kind)[head], rest)]
            if any(units):
                return next(filter(None, units))
    return ""


@functools.cache
def function_of(
    kind: Callable[P, T], name: str, answer: Callable[[T], R], refused: str
) -> Callable[P, R]:
    """Makes a function with the fields of a dataclass as arguments, and its description."""
    assert isinstance(kind, type)
    signature, told = inspect.signature(kind), field_descriptions(kind)

    def make(*args: P.args, **given: P.kwargs) -> R:
        known_names(name, given, signature.parameters)
        return answer(kind(*args, **given))

    made: Any = make
    made.__name__ = made.__qualname__ = name
    made.__module__ = answer.__module__
    back = get_type_hints(answer)["return"]
    made.__signature__ = signature.replace(return_annotation=back)
    made.__annotations__ = {"return": back}
    summary = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")[0].rstrip()
    about = "\n".join(f"    {name}: {told[name]}" for name in signature.parameters)
    made.__doc__ = f"{summary}\n\nArgs:\n{about}\n\nRaises:\n    ParameterError: {refused}"
    return made


def field_descriptions(kind: type) -> dict[str, str]:
    """Descriptions of fields from the docstrings of a dataclass and its bases, one line each."""
    out: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        _, _, section = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")
        for name, text in re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", section, re.M):
            out[name] = " ".join(text.split())
    return dict.fromkeys(field_types(kind), "") | out
