"""Parts as plain data.

Plain data of a part is a dictionary of its fields: numbers, words, lists of numbers, and
dictionaries for the parts within. A pair of parts has the keys x and y. Where a field takes parts
of several classes, the key "kind" holds the name of the class in lower case. None, or the word
"none", means no value.
"""

from __future__ import annotations

import dataclasses
from typing import Any, get_args, get_origin

import numpy as np

from ..arguments import function_name
from ..errors import ParameterError, field_types
from ..model.constants import AXES, each_axis
from .field_kinds import (
    KIND,
    UNSET,
    default_of,
    is_pair,
    join_names,
    part_classes,
    terms_field,
    union_members,
    usual_class,
)


def plain_data(
    part: Any,
    full: bool = True,
    units: dict[str, str] | None = None,
    left_out: list[str] | None = None,
) -> dict[str, Any]:
    """Converts a part to plain data, from which `make_part` restores it."""
    return _as_data(part, UNSET if full else None, "", {} if units is None else units, left_out)


def _as_data(
    part: Any, than: Any, path: str, units: dict[str, str], left_out: list[str] | None = None
) -> dict[str, Any]:
    """than: the part to differ from; None for the defaults, UNSET to write all fields."""
    kind, out = type(part), {}
    for name, (hint, bound) in field_types(kind).items():
        value, old, inner = getattr(part, name), UNSET, join_names(path, name)
        if than is not UNSET:
            old = getattr(than, name) if type(than) is kind else default_of(kind, name)
            if type(old) is type(value) and _same(old, value):
                continue
            old = None if old is UNSET else old
        try:
            out[name] = _value_as_data(hint, value, old, inner, units)
        except ParameterError:
            if left_out is None:
                raise
            out[name] = left_out.append(name)
        if bound and bound.unit:
            units[inner] = bound.unit
    return out


def _same(a: Any, b: Any) -> bool:
    """Whether two values are the same to the last bit, signs of zeros included."""
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(_same, a, b))
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(
            _same(getattr(a, n), getattr(b, n))
            for n in field_types(type(a))  # type: ignore[arg-type]
        )
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(a, b)
    return type(a) is type(b) and repr(a) == repr(b)


def _value_as_data(hint: Any, value: Any, old: Any, path: str, units: dict[str, str]) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.ndarray):
        return value.tolist()
    kinds = union_members(hint)
    pair = next((k for k in kinds if is_pair(k)), None)
    if isinstance(value, tuple) and pair is not None:
        axes = {
            axis: _value_as_data(item, v, o, join_names(path, axis), units)
            for axis, item, v, o in zip(AXES, get_args(pair), value, each_axis(old), strict=True)
        }
        return {a: v for a, v in axes.items() if v != {}} if isinstance(old, tuple) else axes
    none = UNSET if old is UNSET else None
    if isinstance(value, tuple | list):
        row = next((k for k in kinds if get_origin(k) is tuple), hint)
        item = (get_args(row) or (row,))[0]
        return [
            _value_as_data(item, v, none, join_names(path, i), units) for i, v in enumerate(value)
        ]
    if dataclasses.is_dataclass(value):
        kind, classes = type(value), part_classes(hint)
        terms = terms_field(kind)
        rest = (x for x in field_types(kind) if x != terms)
        if (
            terms
            and len(classes) > 1
            and all(getattr(value, x) == default_of(kind, x) for x in rest)
        ):
            return _value_as_data(
                field_types(kind)[terms][0], getattr(value, terms), none, path, units
            )
        usual = usual_class(hint, classes) is kind and type(old) not in classes.values()
        if len(classes) == 1 or (usual and old is not UNSET) or KIND in field_types(kind):
            return _as_data(value, old, path, units)
        return {KIND: kind.__name__.lower(), **_as_data(value, old, path, units)}
    if hint is Any and callable(value):  # an importable function is its name
        name = function_name(value)
        if name:
            return name
    raise ParameterError(path, value, "cannot be written to a file")
