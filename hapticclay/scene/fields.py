"""Fields of a part by dotted name, and parts from and as plain data.

A part is a frozen dataclass whose fields `errors.check_fields` checks; parts lie within parts. The
field "servo.x.G.damping" of a scenario is a number three parts down. Files, the command line and
sweeps all change a scenario here.

Plain data of a part is a dictionary of its fields: numbers, words, lists of numbers, and
dictionaries for the parts within. A pair of parts has the keys x and y. Where a field takes parts
of several classes, the key "kind" holds the name of the class in lower case. None, or the word
"none", stands for nothing.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import UnionType
from typing import (
    Any,
    Literal,
    NamedTuple,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from ..arguments import checked, function_name, known_names
from ..errors import Bound, ParameterError, choice, field_types, quantity
from ..model.constants import AXES, each_axis
from ..model.hardware import JOINTS

P = ParamSpec("P")
T = TypeVar("T")
R = TypeVar("R")
KIND = "kind"  # key of the class, where a field takes several
USUAL_KIND = "multisine"  # the class without that key, where none of its own is usual
UNSET = dataclasses.MISSING
MOST_TOLD = 8  # names that an error lists beside the nearest one
HAND = ["mass", "damper", "spring"]  # what a hand is added by
ENTIRE = None  # key of the value of a whole field, beside those of its entries


@checked
def with_fields(part: T, changes: Mapping[str, Any]) -> T:
    """A part with some fields changed, all at once.

    Args:
        part: the part, as a scenario.
        changes: values by dotted name, as in {"arm.l1": 0.3, "gain.x": 2.0}: numbers, "5 cm",
            parts, or plain data of parts. What changes an entry goes before what changes the whole.

    Returns:
        A part of the same class. One number for a pair, and one part for a pair of parts, is that
        of both axes. A part that was None begins as its defaults; but a hand is added whole, by
        its mass, damper and spring.

    Raises:
        ParameterError: part is none, there is no such field, a value was refused, or a hand is
            added in part.
    """
    if not dataclasses.is_dataclass(part) or isinstance(part, type):
        raise ParameterError("part", part, "must be a part, as a Scenario")
    data, values = nested(changes), values_of(part)
    check_added_hand(values.get("operator"), data)
    return make_part(type(part), data, values)


def check_added_hand(old: Any, *changes: Mapping[Any, Any]) -> None:
    """Refuses a mass, damper or spring alone where there is no hand, which would add the others.

    Args:
        old: the operator before.
        *changes: plain data from `nested`, the later ones on top.

    Raises:
        ParameterError: a hand is added in part.
    """
    given = functools.reduce(laid_over, changes, {}).get("operator")
    _check_hand(given, old, "operator")


def _check_hand(given: Any, old: Any, path: str) -> None:
    if not isinstance(given, Mapping):
        return
    if ENTIRE in given:
        old = given[ENTIRE]
    both = {n: given[n] for n in HAND if n in given}
    for i, axis in enumerate(AXES):
        if isinstance(given.get(axis), Mapping):
            before = old[i] if isinstance(old, tuple) else old
            _check_hand(both | given[axis], before, f"{path}.{axis}")
    named = list(both)
    if named and (old is None or isinstance(old, tuple) and None in old) and named != HAND:
        more = " and ".join(join_names(path, n) for n in HAND if n not in named)
        bound = f"adds a hand to a scene without one: give {more} as well, 0 for none"
        raise ParameterError(join_names(path, named[0]), given[named[0]], bound)


def make_part(
    kind: type[T], data: Mapping[Any, Any], start: Mapping[str, Any] = {}, path: str = ""
) -> T:
    """A part of its plain data.

    Args:
        kind: its class.
        data: values by name; may be deep.
        start: values of the fields that data leaves out; those left out here have their defaults.
        path: dotted name of the part, for errors.

    Raises:
        ParameterError: a field is unknown, missing, or was refused.
    """
    values = merged_values(kind, data, start, path)
    lacking = [n for n in field_types(kind) if n not in values and _default(kind, n) is UNSET]
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
    """Values of the fields of a part, changed by plain data; arguments of its class.

    Args:
        kind: its class.
        data: the changes.
        start: the values before; defaults where left out.
        path: dotted name of the part, for errors.

    Raises:
        ParameterError: a field is unknown, or was refused.
    """
    types, out = field_types(kind), dict(start)
    for name, value in data.items():
        if name not in types:
            raise no_field(join_names(path, name), value, dotted_names(kind, path))
        hint, bound = types[name]
        old = start.get(name, _default(kind, name))
        out[name] = _taken(hint, bound or Bound(), value, join_names(path, name), old)
    return out


def values_of(part: Any) -> dict[str, Any]:
    """Fields of a part by name.

    Args:
        part: the part.
    """
    return {name: getattr(part, name) for name in field_types(type(part))}


def nested(changes: Mapping[str, Any]) -> dict[Any, Any]:
    """Plain data of values by dotted name; the key None holds what is given for a whole field.

    Args:
        changes: values by dotted name, or by name and deep.

    Raises:
        ParameterError: one value is given in both ways, or lies too deep.
    """
    out: dict[Any, Any] = {}
    for name, value in changes.items():
        try:
            _plant(out, str(name).split("."), value)
        except KeyError as twice:
            bound = f"must be given once, and {twice.args[0]!r} is given twice"
            raise ParameterError(str(name), value, bound) from None
        except RecursionError:
            raise ParameterError(str(name), ..., "must not lie so deep") from None
    return out


def _plant(tree: dict[Any, Any], names: Sequence[Any], value: Any) -> None:
    name, rest = names[0], names[1:]
    if rest or isinstance(value, Mapping):
        below = tree.get(name)
        if not isinstance(below, dict):
            below = tree[name] = {ENTIRE: below} if name in tree else {}
        if rest:
            _plant(below, rest, value)
        elif isinstance(value, Mapping):
            for key, inner in value.items():
                _plant(below, [key] if key is ENTIRE else str(key).split("."), inner)
    elif isinstance(tree.get(name), dict):
        tree[name][ENTIRE] = value
    elif name in tree:
        raise KeyError(name)
    else:
        tree[name] = value


def named_values(field: str, words: Iterable[str]) -> dict[str, Any]:
    """Reads the words "arm.l1=0.3", "gain=1,0.5", "inertia_shaping=true", "dt=0.1ms".

    Args:
        field: name for the error.
        words: the words.

    Returns:
        Values by dotted name.

    Raises:
        ParameterError: a word is not name=value, or a name stands twice.
    """
    out: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        name = name.strip()
        if not equals or not name or name in out:
            raise ParameterError(field, word, "must be name=value, each name once")
        out[name] = _value_of(value.strip())
    return out


def _value_of(text: str) -> Any:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    items = text.split(",")
    parts = [_number_or_text(x) for x in items]
    if len(parts) > 1 and all(x.strip()[:1] in tuple("+-.0123456789") for x in items):
        return parts
    return parts[0] if len(parts) == 1 else text


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _taken(hint: Any, bound: Bound, value: Any, path: str, old: Any) -> Any:
    """What a field takes of plain data; old: its value before, UNSET for none."""
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
    if isinstance(value, Mapping):  # below a number
        name, inner = next(iter(value.items()), ("", value))
        raise ParameterError(join_names(path, name), inner, f"no such field: {path} has no parts")
    return _taken_one(kinds, bound, value, path)


def _taken_one(kinds: Sequence[Any], bound: Bound, value: Any, path: str) -> Any:
    """A number, a flag or a word; the class of the part refuses what is none of its own."""
    if isinstance(value, str):
        words = [w for k in kinds if get_origin(k) is Literal for w in get_args(k)]
        if value in words or not {float, int} & set(kinds):
            return value
        number = quantity(path, value, bound.unit)
        return value if number is None else number
    if isinstance(value, float):  # sweeps and words give floats alone
        if bool in kinds and value in (0.0, 1.0):
            return bool(value)
        if int in kinds and value.is_integer():
            return int(value)
    return value


def _taken_numbers(kind: Any, bound: Bound, value: Any, path: str, old: Any) -> Any:
    """Numbers of a tuple: all, entries by name or index, or one for each."""
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
    one = _taken_one((float,), bound, value, path)
    if isinstance(one, int | float) and not isinstance(one, bool) and get_origin(item) is not tuple:
        return (one,) * (1 if open_ else len(bound.names))
    return one


def _taken_pair(pair: Any, alone: list[Any], value: Any, path: str, old: Any) -> Any:
    """A part for both axes, or one for each; what names no axis goes to both."""
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
    """Plain data on top of other plain data.

    Args:
        below: the other; a dictionary.
        above: goes before what is below.
    """
    if not isinstance(above, Mapping) or not isinstance(below, Mapping):
        return above
    return {**below, **{k: laid_over(below.get(k), v) for k, v in above.items()}}


def _taken_by_name(
    hint: Any, classes: dict[str, type], value: Mapping[Any, Any], path: str, old: Any
) -> Any:
    """A part, or some of several parts by their indices."""
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


def terms_field(kind: type) -> str:
    """The field of a class that needs nothing but a tuple of parts, as a sum; "" for others.

    Args:
        kind: the class.
    """
    hints = {name: hint for name, (hint, _) in field_types(kind).items()}
    name, hint = next(iter(hints.items()), ("", None))
    row = get_origin(hint) is tuple and get_args(hint)[1:] == (...,) and part_classes(hint)
    alone = all(_default(kind, x) is not UNSET for x in hints if x != name)
    return name if row and alone else ""


def union_members(hint: Any) -> tuple[Any, ...]:
    """Types of a union; a tuple of the type itself where it is none.

    Args:
        hint: the type.
    """
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def is_pair(hint: Any) -> bool:
    """Whether a type is a pair of parts, one an axis.

    Args:
        hint: the type.
    """
    items = get_args(hint)
    return (
        get_origin(hint) is tuple
        and len(items) == 2
        and items[1] is not ...
        and bool(part_classes(items[0]))
    )


def part_classes(hint: Any) -> dict[str, type]:
    """Classes of the parts that a type takes, alone or in a tuple, by name in lower case.

    Args:
        hint: the type; its subclasses count.
    """
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
    """A class and its subclasses, where they are parts; not one that is there for them alone."""
    below = kind.__subclasses__()
    if dataclasses.is_dataclass(kind) and (dataclasses.fields(kind) or not below):
        yield kind
    for sub in below:
        yield from _family(sub)


def usual_class(hint: Any, classes: Mapping[str, type]) -> type | None:
    """The class of a part without a kind; None if it must have one.

    Args:
        hint: the type of the field.
        classes: those it takes, from `part_classes`.
    """
    if len(classes) == 1:
        return next(iter(classes.values()))
    own = [m for m in union_members(hint) if m in classes.values()]
    return own[0] if own else classes.get(USUAL_KIND)


def entry_names(kind: Any, bound: Bound, old: Any = UNSET) -> dict[str, int]:
    """Names of the numbers of a tuple, and their places.

    Args:
        kind: the type of the tuple.
        bound: its bound, which has the names.
        old: the tuple itself, where its length is not fixed.
    """
    if get_args(kind)[1:] == (...,):
        return {str(i): i for i in range(len(old) if isinstance(old, tuple | list) else 0)}
    out = {name: i for i, name in enumerate(bound.names)}
    if bound.names == JOINTS:
        out |= {axis: i for i, axis in enumerate(AXES)}
    return out | {str(i): i for i in range(len(bound.names))}


def join_names(path: str, name: object) -> str:
    """A dotted name.

    Args:
        path: the part, "" for the outermost.
        name: of its field.
    """
    return f"{path}.{name}" if path else str(name)


def no_field(name: str, value: Any, known: Sequence[str]) -> ParameterError:
    """The error for an unknown field; it suggests the nearest one.

    Args:
        name: dotted name that was given.
        value: its value.
        known: dotted names that there are.
    """
    if not known:
        whole = name.rpartition(".")[0]
        bound = f"{whole} is not given: give it whole, in a file as [[{whole}]], a table a part"
        return ParameterError(name, value, bound)
    depth = name.count(".")
    level = list(dict.fromkeys(".".join(k.split(".")[: depth + 1]) for k in known))
    near = difflib.get_close_matches(name, level, n=1)
    if not near:  # another part may have it
        last, ends = name.rpartition(".")[2], {k.rpartition(".")[2]: k for k in reversed(known)}
        near = [ends[n] for n in difflib.get_close_matches(last, ends, n=1)]
    path, _, _ = name.rpartition(".")
    told = ", ".join(k.removeprefix(f"{path}.") for k in level)
    bound = (
        "no such field" if near and len(level) > MOST_TOLD else f"no such field; there are {told}"
    )
    while isinstance(value, Mapping) and len(value) == 1:  # what was given of it
        inner, value = next(iter(value.items()))
        name = name if inner is ENTIRE else join_names(name, inner)
    return ParameterError(name, value, f"{bound}; did you mean {near[0]!r}?" if near else bound)


class Field(NamedTuple):
    """A field that takes numbers or words.

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
    """The fields of a class that take numbers or words, those of the parts within included.

    Args:
        kind: the class.
        path: dotted name of the part.
        part: the part whose values are the defaults.
    """
    out: list[Field] = []
    about = field_descriptions(kind)
    for name, (hint, bound) in field_types(kind).items():
        default = _default(kind, name) if part is UNSET else getattr(part, name)
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
            continue  # made of its like
        part = default if type(default) is kind else UNSET
        for field in fields_of(kind, path, part):
            told = f"of {kind.__name__.lower()}: {field.about}" if len(classes) > 1 else field.about
            yield field._replace(about=told)


def dotted_names(kind: type, path: str = "") -> list[str]:
    """Names of all fields of a class, in the order of `fields_of`; and of the parts that have none.

    Args:
        kind: the class.
        path: dotted name of the part.
    """
    names = [f.name for f in fields_of(kind, path)]
    heads = {n[len(path) + 1 if path else 0 :].partition(".")[0] for n in names}
    return names + [join_names(path, n) for n in field_types(kind) if n not in heads]


def bounds_at(hint: Any, bound: Bound | None, names: Sequence[str]) -> list[Bound]:
    """Bounds of what lies at a dotted name below a field; empty if nothing does.

    Args:
        hint: type of the field.
        bound: its bound.
        names: parts of the name below the field.
    """
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


def plain_data(
    part: Any,
    full: bool = True,
    units: dict[str, str] | None = None,
    left_out: list[str] | None = None,
) -> dict[str, Any]:
    """A part as plain data, from which `make_part` makes it again.

    Args:
        part: the part.
        full: whether fields that have their default values are written too.
        units: takes the unit of each field by dotted name; None for none.
        left_out: takes the names of fields that are no data, such as a function; they are then
            written as None.

    Raises:
        ParameterError: it holds what is no data, and left_out is None.
    """
    return _as_data(part, UNSET if full else None, "", {} if units is None else units, left_out)


def _as_data(
    part: Any, than: Any, path: str, units: dict[str, str], left_out: list[str] | None = None
) -> dict[str, Any]:
    """than: the part to differ from; None for the defaults, UNSET to write all fields."""
    kind, out = type(part), {}
    for name, (hint, bound) in field_types(kind).items():
        value, old, inner = getattr(part, name), UNSET, join_names(path, name)
        if than is not UNSET:
            old = getattr(than, name) if type(than) is kind else _default(kind, name)
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
        if terms and len(classes) > 1 and all(getattr(value, x) == _default(kind, x) for x in rest):
            return _value_as_data(
                field_types(kind)[terms][0], getattr(value, terms), none, path, units
            )
        usual = usual_class(hint, classes) is kind and type(old) not in classes.values()
        if len(classes) == 1 or (usual and old is not UNSET) or KIND in field_types(kind):
            return _as_data(value, old, path, units)
        return {KIND: kind.__name__.lower(), **_as_data(value, old, path, units)}
    if hint is Any and callable(value):  # a function is its name, where others find it by that
        name = function_name(value)
        if name:
            return name
    raise ParameterError(path, value, "cannot be written to a file")


def _default(kind: type, name: str) -> Any:
    return _defaults(kind)[name]


@functools.cache
def _defaults(kind: type) -> dict[str, Any]:
    return {
        f.name: f.default_factory() if f.default_factory is not UNSET else f.default
        for f in dataclasses.fields(kind)
    }


@functools.cache
def function_of(
    kind: Callable[P, T], name: str, answer: Callable[[T], R], refused: str
) -> Callable[P, R]:
    """A function with the fields of a dataclass as its arguments, and its description.

    Args:
        kind: the dataclass.
        name: of the function, in the module of `answer`.
        answer: what the function returns, of an instance; its return annotation is the function's.
        refused: why the function raises ParameterError.
    """
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
    """What the docstrings of a dataclass and its bases say of each field, on one line.

    Args:
        kind: the class.
    """
    out: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        _, _, section = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")
        for name, text in re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", section, re.M):
            out[name] = " ".join(text.split())
    return dict.fromkeys(field_types(kind), "") | out
