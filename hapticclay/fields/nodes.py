"""Nodes of numbers, words, rows, pairs and unions, and the names of what lies below them."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import operator
import os
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from .. import errors
from ..errors import Bound, ParameterError
from ..units import is_quantity

AXES = ("x", "y")
Axis = Literal["x", "y"]
Seed = Annotated[int, Bound(0, 2**32 - 1)]
JOINTS = ("shoulder", "elbow")  # also named x and y
KIND = "kind"  # key of the class, for a field of several classes
ENTIRE = None  # key of the value of a whole field, besides those of its entries
UNSET = dataclasses.MISSING
MOST_LISTED = 8  # names that an error lists besides the nearest one


class Node:
    """A type of values: this one takes anything.

    Attributes:
        hint: its type hint, without annotations.
        bound: bounds and unit of its numbers.
        none: whether it takes None, in text "none".
        words: words that it takes.
        takes_numbers: whether it takes a number, which may have a unit.
        arity: words of a command line that make a value; infinite for any number of them.
        members: nodes within it, whose parts are its parts.
    """

    hint: Any = Any
    bound, none, takes_numbers = Bound(), False, False
    words: tuple[str, ...] = ()
    arity: float = 1
    members: Sequence[Node] = ()

    def wants(self) -> str:
        """What it takes, in words that follow "must be"."""
        return "a value"

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        """The value as the field keeps it; owner has the fields that bounds name."""
        if not self.fits(value):
            raise ParameterError(field, value, f"must be {self.wants()}")
        return value

    def fits(self, value: Any, old: Any = UNSET) -> bool:
        """Whether this member of a union is the one to check, read or write a value."""
        return True

    def read(self, value: Any, path: str, old: Any = UNSET) -> Any:
        """A value from plain data, not yet checked; old: the value before."""
        if isinstance(value, Mapping) and ENTIRE in value:
            old = self.read(value[ENTIRE], path, old)
            value = {k: v for k, v in value.items() if k is not ENTIRE}
            if not value:
                return old
        if self.none and isinstance(value, str) and value.lower() == "none":
            return None
        return self._read(value, path, old)

    def _read(self, value: Any, path: str, old: Any) -> Any:
        if isinstance(value, Mapping):
            name, inner = next(iter(value.items()), ("", value))
            bound = f"no such field: {path} has no parts"
            raise ParameterError(join_names(path, name), inner, bound)
        return value

    def write(self, value: Any, old: Any, path: str, units: dict[str, str]) -> Any:
        """Plain data of a value; old: what to differ from, UNSET writes all, None the defaults."""
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if hasattr(value, "tolist"):
            return value.tolist()
        if isinstance(value, tuple | list):
            return [self.write(x, old, join_names(path, i), units) for i, x in enumerate(value)]
        if self.hint is Any and callable(value) and (name := function_name(value)):
            return name
        raise ParameterError(path, value, "cannot be written to a file")

    def classes(self) -> dict[str, type]:
        """Classes of the parts that it takes, by lower-case name."""
        return {name: kind for node in self.members for name, kind in node.classes().items()}

    def bounds_at(self, names: Sequence[str]) -> list[Bound]:
        """Bounds of the values at a dotted name below; none where there is no such name."""
        if not names:
            return [self.bound]
        return [bound for node, rest in self.below(*names) for bound in node.bounds_at(rest)]

    def below(self, name: str, *rest: str) -> Iterable[tuple[Node, Sequence[str]]]:
        """Nodes of a name, and the names below each."""
        return ()

    def leaves(self, path: str, default: Any, about: str) -> Iterator[Field]:
        """The fields below it that take numbers or words; itself if it has no parts."""
        yield Field(path, self, default, about)


class Field(NamedTuple):
    """A field that takes numbers or words.

    Attributes:
        name: its dotted name.
        node: its type.
        default: its default value; UNSET if it must be given.
        about: its description.
    """

    name: str
    node: Node
    default: Any
    about: str

    @property
    def unit(self) -> str:
        """Its unit; "" for none."""
        return self.node.bound.unit


def limits(bound: Bound, owner: Any) -> dict[str, Any]:
    """Arguments of `number`; owner has the field that the bound names."""
    low = getattr(owner, bound.low, -math.inf) if isinstance(bound.low, str) else bound.low
    return {"low": low, "high": bound.high, "above": bound.above, "unit": bound.unit}


class Number(Node):
    """A finite float."""

    takes_numbers = True

    def __init__(self, bound: Bound):
        self.bound, self.high = bound, bound.high
        self.low = math.inf if isinstance(bound.low, str) else bound.low

    def wants(self) -> str:
        return self.bound.number_words()

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        if type(value) is float and self.low < value < self.high:
            return value
        return errors.number(field, value, **limits(self.bound, owner))

    def _read(self, value: Any, path: str, old: Any) -> Any:
        if isinstance(value, str):
            x = errors.quantity(path, value, self.bound.unit)
            return value if x is None else x
        return super()._read(value, path, old)


class Whole(Number):
    """A whole number; a float stands for it in sweeps and words."""

    def wants(self) -> str:
        return self.bound.integer_words()

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        low = limits(self.bound, owner)["low"]
        return errors.integer(field, value, low, self.high)

    def _read(self, value: Any, path: str, old: Any) -> Any:
        x = super()._read(value, path, old)
        return int(x) if isinstance(x, float) and x.is_integer() else x


class Flag(Node):
    """True or False; 1.0 and 0.0 stand for them in sweeps."""

    arity = 0

    def wants(self) -> str:
        return "True or False"

    def fits(self, value: Any, old: Any = UNSET) -> bool:
        return isinstance(value, bool)

    def _read(self, value: Any, path: str, old: Any) -> Any:
        if isinstance(value, float) and value in (0.0, 1.0):
            return bool(value)
        return super()._read(value, path, old)


class Word(Node):
    """One of some words."""

    def __init__(self, words: tuple[str, ...]):
        self.words = words

    def wants(self) -> str:
        return f"one of {', '.join(self.words)}"

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        return errors.choice(field, value, self.words)

    def fits(self, value: Any, old: Any = UNSET) -> bool:
        return isinstance(value, str) and not is_quantity(value)


class Text(Node):
    """A text, which may be empty where the default is."""

    def __init__(self, empty: bool = False):
        self.empty = empty

    def wants(self) -> str:
        return "a string" if self.empty else "a non-empty string"

    def fits(self, value: Any, old: Any = UNSET) -> bool:
        return isinstance(value, str) and (self.empty or value != "")


@functools.lru_cache(maxsize=64)
def place_names(n: int) -> tuple[str, ...]:
    """Names of n values that have none."""
    return tuple(map(str, range(n)))


class Row(Node):
    """A tuple of numbers, as many as have names or any number; or of rows of them, or of parts."""

    def __init__(self, item: Node, any_length: bool):
        self.item, self.members, self.any_length = item, (item,), any_length
        self.bound, self.takes_numbers = item.bound, item.takes_numbers
        self.arity = math.inf if any_length else len(self.bound.names)

    def wants(self) -> str:
        names = self.bound.names
        if isinstance(self.item, Row):
            return "rows of numbers, all of one length"
        if not self.takes_numbers:
            return f"a sequence, each {self.item.wants()}"
        named = f"{len(names)} numbers ({', '.join(names)})"
        return "a sequence of numbers" if self.any_length else named

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        bounds, names = limits(self.bound, owner), self.bound.names
        if isinstance(self.item, Row):
            return errors.table_of(field, value, **bounds)
        if self.any_length:
            if not errors.is_series(value) or not hasattr(value, "__len__"):
                raise ParameterError(field, value, f"must be {self.wants()}")
            names = place_names(len(value))
        if self.takes_numbers:
            return errors.numbers_of(field, value, names, **bounds)
        items = (self.item.check(f"{field}[{i}]", x, owner) for i, x in enumerate(value))
        return _as_tuple(value, items)

    def fits(self, value: Any, old: Any = UNSET) -> bool:
        return isinstance(old, tuple) if isinstance(value, Mapping) else errors.is_series(value)

    def is_as_long(self, value: Any, old: Any) -> bool:
        """Whether a row that fits has as many items."""
        row = old if isinstance(value, Mapping) else value
        sized = hasattr(row, "__len__") and getattr(row, "shape", None) != ()
        return self.any_length or not sized or len(row) == self.arity

    def _read(self, value: Any, path: str, old: Any) -> Any:
        if isinstance(value, Mapping):
            return self._with_entries(value, path, old)
        if isinstance(value, list | tuple):
            alike = isinstance(old, tuple) and len(old) == len(value)
            before = old if alike else (UNSET,) * len(value)
            rows = enumerate(zip(value, before, strict=True))
            return tuple(self.item.read(x, join_names(path, i), part) for i, (x, part) in rows)
        if self.any_length and isinstance(value, str) and value.lower() in ("", "none"):
            return ()
        one = self.item.read(value, path) if isinstance(self.item, Number) else None
        if isinstance(one, bool) or not isinstance(one, int | float):
            return value
        return (one,) * (1 if self.any_length else len(self.bound.names))

    def _with_entries(self, given: Mapping[Any, Any], path: str, old: Any) -> Any:
        """The old values with some changed, by name or place."""
        out = list(old) if isinstance(old, tuple | list) else []
        known = self._places(len(out))
        for name, x in given.items():
            inner = join_names(path, name)
            beyond = self.takes_numbers and self.any_length and name.isdecimal()
            if name not in known and not beyond:
                raise no_field(inner, x, [join_names(path, n) for n in known])
            i = known.get(name, len(out))
            if i >= len(out):
                count = f"has {len(out)} entries" if out else "is not given"
                raise ParameterError(inner, x, f"no such entry: {path} {count}")
            out[i] = self.item.read(x, inner, out[i])
        return tuple(out)

    def _places(self, n: int) -> dict[str, int]:
        """Places of its values by name; of n, if it is of any length."""
        names = self.bound.names
        also = AXES if names == JOINTS else ()
        rows = (place_names(n),) if self.any_length else (names, also, place_names(len(names)))
        return {name: i for row in rows for i, name in enumerate(row)}

    def write(self, value: Any, old: Any, path: str, units: dict[str, str]) -> Any:
        if not isinstance(value, tuple | list):
            return super().write(value, old, path, units)
        old = UNSET if old is UNSET else None
        return [self.item.write(x, old, join_names(path, i), units) for i, x in enumerate(value)]

    def below(self, name: str, *rest: str) -> Iterable[tuple[Node, Sequence[str]]]:
        found = name.isdecimal() if self.any_length else name in self._places(0)
        return [(self.item, rest)] * found

    def leaves(self, path: str, default: Any, about: str) -> Iterator[Field]:
        if not self.classes():
            return super().leaves(path, default, about)
        parts = enumerate(default if isinstance(default, tuple) else ())
        return (x for i, p in parts for x in self.item.leaves(join_names(path, i), p, about))


class Pair(Node):
    """A pair (x, y) of parts; in plain data also one for both axes."""

    def __init__(self, items: tuple[Node, Node], alone: bool):
        self.members, self.alone = items, alone  # alone: in no union with one part for both axes

    def wants(self) -> str:
        return f"a pair (x, y) of {' or '.join(k.__name__ for k in self.classes().values())}"

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        if not isinstance(value, tuple | list) or len(value) != 2:
            raise ParameterError(field, value, f"must be {self.wants()}")
        pairs = zip(AXES, self.members, value, strict=True)
        return _as_tuple(value, (n.check(f"{field}.{axis}", x, owner) for axis, n, x in pairs))

    def fits(self, value: Any, old: Any = UNSET) -> bool:
        if isinstance(value, Mapping):
            return isinstance(old, tuple) or any(axis in value for axis in AXES)
        return isinstance(value, tuple | list)

    def _read(self, value: Any, path: str, old: Any) -> Any:
        if isinstance(value, Mapping):
            shared = {k: v for k, v in value.items() if k not in AXES}
            given = [
                laid_over(shared, value[axis]) if axis in value else shared or UNSET
                for axis in AXES
            ]
            before = _each_axis(old)
        elif isinstance(value, list | tuple):
            if len(value) != 2:
                raise ParameterError(path, value, f"must be {self.wants()}")
            given, before = value, (UNSET, UNSET)
        else:
            return (value, value) if self.alone and dataclasses.is_dataclass(value) else value
        out = []
        for axis, node, x, part in zip(AXES, self.members, given, before, strict=True):
            inner = join_names(path, axis)
            if x is UNSET and part is UNSET:
                raise ParameterError(path, value, f"lacks {inner}")
            out.append(part if x is UNSET else node.read(x, inner, part))
        return tuple(out)

    def write(self, value: Any, old: Any, path: str, units: dict[str, str]) -> Any:
        rows = zip(AXES, self.members, value, _each_axis(old), strict=True)
        axes = {a: node.write(x, o, join_names(path, a), units) for a, node, x, o in rows}
        return {a: x for a, x in axes.items() if x != {}} if isinstance(old, tuple) else axes

    def below(self, name: str, *rest: str) -> Iterable[tuple[Node, Sequence[str]]]:
        return [(self.members[0], rest if name in AXES else (name, *rest))]

    def leaves(self, path: str, default: Any, about: str) -> Iterator[Field]:
        for axis, node, part in zip(AXES, self.members, _each_axis(default), strict=True):
            yield from node.leaves(join_names(path, axis), part, about)


class Either(Node):
    """A value of one of several types; the last one takes what fits none."""

    def __init__(self, members: Sequence[Node], none: bool, bound: Bound):
        self.members, self.none, self.bound = members, none, bound
        self.words = tuple(word for node in members for word in node.words)
        self.takes_numbers = any(node.takes_numbers for node in members)
        self.arity = max(node.arity for node in members)

    def wants(self) -> str:
        also = self.none and not self.members[-1].none
        return " or ".join([*(node.wants() for node in self.members[::-1]), *["None"] * also])

    def member(self, value: Any, old: Any = UNSET) -> Node:
        """The type that a value is meant to be of."""
        meant = [m for m in self.members if m.fits(value, old)] or [self.members[-1]]
        if not isinstance(meant[0], Row):
            return meant[0]
        rows = [m for m in meant if isinstance(m, Row)]
        return next((m for m in rows if m.is_as_long(value, old)), rows[0])

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        if value is None and self.none:
            return None
        member = self.member(value)
        if isinstance(member, Word) and self.takes_numbers:
            return errors.choice(field, value, self.words, self.wants())
        return member.check(field, value, owner)

    def _read(self, value: Any, path: str, old: Any) -> Any:
        return self.member(value, old).read(value, path, old)

    def write(self, value: Any, old: Any, path: str, units: dict[str, str]) -> Any:
        return self.member(value).write(value, old, path, units)

    def below(self, name: str, *rest: str) -> Iterable[tuple[Node, Sequence[str]]]:
        return [found for node in self.members for found in node.below(name, *rest)]

    def leaves(self, path: str, default: Any, about: str) -> Iterator[Field]:
        parts = [node for node in self.members if node.classes()]
        return (parts[-1] if parts else super()).leaves(path, default, about)


def _as_tuple(value: Any, items: Iterable[Any]) -> tuple[Any, ...]:
    """The items of a sequence as a tuple; the sequence itself if it is that tuple."""
    made = tuple(items)
    same = isinstance(value, tuple) and all(map(operator.is_, made, value))
    return value if same else made


def _each_axis(value: Any) -> tuple[Any, Any]:
    return value if isinstance(value, tuple) else (value, value)


def laid_over(below: Any, above: Any) -> Any:
    """Overrides plain data by other plain data."""
    if not isinstance(above, Mapping) or not isinstance(below, Mapping):
        return above
    return {**below, **{k: laid_over(below.get(k), v) for k, v in above.items()}}


CLASS_WORDS: dict[Any, str] = {
    Callable: "a function",
    Iterable: "an iterable, as a list",
    Mapping: "a dictionary",
    dict: "a dictionary",
    bool: "True or False",
    os.PathLike: "a path",
    str: "a path",  # where PathLike stands beside it
    type(None): "None",
}
WIDER: dict[Any, Any] = {Sequence: Iterable, Path: os.PathLike}  # an array is not a Sequence


def class_words(kind: Any) -> str:
    """A class in words, with its article."""
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    return CLASS_WORDS.get(kind) or f"{article} {kind.__name__}"


def join_names(path: str, name: object) -> str:
    """A dotted name."""
    return f"{path}.{name}" if path else str(name)


def no_field(name: str, value: Any, known: Sequence[str]) -> ParameterError:
    """The error for an unknown field; it suggests the nearest one."""
    path, _, last = name.rpartition(".")
    if not known:
        bound = f"{path} is not given: give it as a whole, in a file as [[{path}]]"
        return ParameterError(name, value, bound)
    depth = name.count(".")
    level = list(dict.fromkeys(".".join(k.split(".")[: depth + 1]) for k in known))
    near = errors.nearest(name, level)
    if not near:  # another part may have this field
        ends = {k.rpartition(".")[2]: k for k in reversed(known)}
        near = [ends[n] for n in errors.nearest(last, ends)]
    bound = "no such field"
    if not near or len(level) <= MOST_LISTED:
        bound += f"; there are {', '.join(k.removeprefix(f'{path}.') for k in level)}"
    while isinstance(value, Mapping) and len(value) == 1:  # what was given of it
        inner, value = next(iter(value.items()))
        name = name if inner is ENTIRE else join_names(name, inner)
    return ParameterError(name, value, f"{bound}; did you mean {near[0]!r}?" if near else bound)


def function_name(function: Any) -> str:
    """The name "package.module:name" by which a function can be imported; "" for none."""
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', '')}"
    with contextlib.suppress(ImportError, AttributeError, ValueError):
        if not name.startswith("__main__") and pkgutil.resolve_name(name) is function:
            return name
    return ""
