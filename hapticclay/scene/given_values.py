"""Parts from plain data: conversion of a given value by each field."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

from ..errors import Bound, ParameterError, choice, field_types, quantity
from ..model.constants import AXES, each_axis
from .field_kinds import (
    ENTIRE,
    KIND,
    UNSET,
    default_of,
    entry_names,
    is_pair,
    join_names,
    no_field,
    part_classes,
    terms_field,
    union_members,
    usual_class,
)
from .fields import dotted_names

T = TypeVar("T")


def make_part(
    kind: type[T], data: Mapping[Any, Any], start: Mapping[str, Any] = {}, path: str = ""
) -> T:
    """Makes a part from plain data."""
    values = merged_values(kind, data, start, path)
    lacking = [n for n in field_types(kind) if n not in values and default_of(kind, n) is UNSET]
    if lacking:
        bound = f"lacks {', '.join(join_names(path, n) for n in lacking)}"
        raise ParameterError(path or kind.__name__.lower(), dict(data), bound)
    try:
        return kind(**values)
    except ParameterError as error:
        if not path:
            raise
        tail = error.field.partition(".")[2] or error.field
        raise ParameterError(join_names(path, tail), error.value, error.bound) from None


def merged_values(
    kind: type, data: Mapping[Any, Any], start: Mapping[str, Any], path: str = ""
) -> dict[str, Any]:
    """Applies plain data to the values of the fields of a part; returns arguments of its class."""
    types, out = field_types(kind), dict(start)
    for name, value in data.items():
        if name not in types:
            raise no_field(join_names(path, name), value, dotted_names(kind, path))
        hint, bound = types[name]
        old = start.get(name, default_of(kind, name))
        out[name] = _taken(hint, bound or Bound(), value, join_names(path, name), old)
    return out


def values_of(part: Any) -> dict[str, Any]:
    """Fields of a part by name."""
    return {name: getattr(part, name) for name in field_types(type(part))}


def _taken(hint: Any, bound: Bound, value: Any, path: str, old: Any) -> Any:
    """Value of a field from plain data; old: its value before, UNSET for none."""
    if isinstance(value, Mapping) and ENTIRE in value:
        old = _taken(hint, bound, value[ENTIRE], path, old)
        value = {k: v for k, v in value.items() if k is not ENTIRE}
    kinds = union_members(hint)
    if type(None) in kinds and isinstance(value, str) and value.lower() == "none":
        return None
    pairs = [k for k in kinds if is_pair(k)]
    if pairs and isinstance(value, Mapping | list | tuple):
        alone = [k for k in kinds if k not in pairs]
        return _taken_pair(pairs[0], alone, value, path, old)
    if pairs == list(kinds) and dataclasses.is_dataclass(value):
        return (value, value)
    classes = part_classes(hint)
    if classes and isinstance(value, Mapping):
        return _taken_by_name(hint, classes, value, path, old)
    if classes and isinstance(value, list | tuple):
        return _taken_parts(hint, classes, value, path, old)
    for kind in kinds:
        if get_origin(kind) is tuple:
            return _taken_numbers(kind, bound, value, path, old)
    if isinstance(value, Mapping):  # a name below a number
        name, inner = next(iter(value.items()), ("", value))
        raise ParameterError(join_names(path, name), inner, f"no such field: {path} has no parts")
    return _taken_one(kinds, bound, value, path)


def _taken_one(kinds: Sequence[Any], bound: Bound, value: Any, path: str) -> Any:
    """A number, a flag or a word; the class of the part refuses invalid values."""
    if isinstance(value, str):
        words = [w for k in kinds if get_origin(k) is Literal for w in get_args(k)]
        if value in words or not {float, int} & set(kinds):
            return value
        number = quantity(path, value, bound.unit)
        return value if number is None else number
    if isinstance(value, float):  # sweeps and words only give floats
        if bool in kinds and value in (0.0, 1.0):
            return bool(value)
        if int in kinds and value.is_integer():
            return int(value)
    return value


def _taken_numbers(kind: Any, bound: Bound, value: Any, path: str, old: Any) -> Any:
    """Numbers of a tuple: all, entries by name or index, or one number for all."""
    item, open_ = get_args(kind)[0], get_args(kind)[1:] == (...,)

    def entry(name: object, x: Any, before: Any = UNSET) -> Any:
        if get_origin(item) is tuple:
            return _taken_numbers(item, bound, x, join_names(path, name), before)
        return _taken_one((float,), bound, x, join_names(path, name))

    if isinstance(value, Mapping):
        known = entry_names(kind, bound, old)
        out = list(old) if isinstance(old, tuple | list) else []
        for name, x in value.items():
            if name not in known and not (open_ and name.isdecimal()):
                raise no_field(join_names(path, name), x, [f"{path}.{n}" for n in known])
            i = known.get(name, len(out))
            if i >= len(out):
                count = f"has {len(out)} entries" if out else "is not given"
                raise ParameterError(join_names(path, name), x, f"no such entry: {path} {count}")
            out[i] = entry(name, x, out[i])
        return tuple(out)
    if isinstance(value, list | tuple):
        return tuple(entry(i, x) for i, x in enumerate(value))
    if open_ and isinstance(value, str) and value.lower() in ("", "none"):
        return ()
    one = _taken_one((float,), bound, value, path)
    if isinstance(one, int | float) and not isinstance(one, bool) and get_origin(item) is not tuple:
        return (one,) * (1 if open_ else len(bound.names))
    return one


def _taken_pair(pair: Any, alone: list[Any], value: Any, path: str, old: Any) -> Any:
    """A part for both axes, or one per axis; values without an axis apply to both."""
    if isinstance(value, Mapping):
        shared = {k: v for k, v in value.items() if k not in AXES}
        if alone and len(shared) == len(value) and not isinstance(old, tuple):
            single: Any = Union[tuple(alone)]  # noqa: UP007
            return _taken(single, Bound(), value, path, old)
        given = [laid_over(shared, value[a]) if a in value else shared or UNSET for a in AXES]
        before = each_axis(old)
    else:
        if len(value) != 2:
            raise ParameterError(path, value, "must be a pair (x, y)")
        given, before = value, (UNSET, UNSET)
    out = []
    for axis, hint, v, part in zip(AXES, get_args(pair), given, before, strict=True):
        if v is UNSET:
            if part is UNSET:
                raise ParameterError(path, value, f"lacks {join_names(path, axis)}")
            out.append(part)
        else:
            out.append(_taken(hint, Bound(), v, join_names(path, axis), part))
    return tuple(out)


def laid_over(below: Any, above: Any) -> Any:
    """Overrides plain data by other plain data."""
    if not isinstance(above, Mapping) or not isinstance(below, Mapping):
        return above
    return {**below, **{k: laid_over(below.get(k), v) for k, v in above.items()}}


def _taken_by_name(
    hint: Any, classes: dict[str, type], value: Mapping[Any, Any], path: str, old: Any
) -> Any:
    """A part, or some of several parts by index."""
    if not isinstance(old, tuple):
        return _taken_part(hint, classes, value, path, old)
    known = {str(i): part for i, part in enumerate(old)}
    for name in value:
        if name not in known:
            raise no_field(join_names(path, name), value[name], [f"{path}.{n}" for n in known])
    parts = [value.get(name, part) for name, part in known.items()]
    return _taken_parts(hint, classes, parts, path, old)


def _taken_part(
    hint: Any, classes: dict[str, type], value: Mapping[Any, Any], path: str, old: Any
) -> Any:
    data = dict(value)
    kind = usual_class(hint, classes)
    if type(old) in classes.values():
        kind = type(old)
    if KIND in data and not any(KIND in field_types(k) for k in classes.values()):
        kind = classes[choice(join_names(path, KIND), data.pop(KIND), tuple(classes))]
    if kind is None:
        bound = f"must name its {KIND}: {', '.join(classes)}"
        raise ParameterError(path, dict(value), bound)
    return make_part(kind, data, values_of(old) if type(old) is kind else {}, path)


def _taken_parts(
    hint: Any, classes: dict[str, type], value: Sequence[Any], path: str, old: Any
) -> Any:
    """Several parts: those of a tuple, or the terms of the class that holds such a tuple."""
    rows = [k for k in union_members(hint) if get_origin(k) is tuple]
    if rows:
        item = get_args(rows[0])[0]
        before = old if isinstance(old, tuple) and len(old) == len(value) else (UNSET,) * len(value)
        return tuple(
            _taken(item, Bound(), v, join_names(path, i), part)
            for i, (v, part) in enumerate(zip(value, before, strict=True))
        )
    for kind in classes.values():
        name = terms_field(kind)
        if name:
            return make_part(kind, {name: value}, {}, path)
    return value
