"""Fields of parts and arguments of functions: one tree of their types.

A type hint becomes a node once. The node checks values, reads them from plain data (texts with
units, "none", tables, dotted names), writes them, names what lies below it, and says in words what
it takes. Checks, files, `--set`, sweeps, options and their help ask these nodes.

msgspec 0.22, cattrs 26.2 and pydantic 2.14 were tried for reading and writing. They add 0.05, 0.1
and 0.15 s to each start, which takes 0.09 s; msgspec refuses a union of two dataclasses, and takes
a misspelt field for none. Each would need a hook for all that scenario files have: units in texts,
"none", one part or number for both axes, parts by index, a start from the values there are.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import os
import re
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from ..errors import Bound, ParameterError, choice
from .nodes import (  # noqa: F401
    AXES,
    CLASS_WORDS,
    ENTIRE,
    JOINTS,
    KIND,
    UNSET,
    WIDER,
    Axis,
    Either,
    Field,
    Flag,
    Node,
    Number,
    Pair,
    Row,
    Seed,
    Text,
    Whole,
    Word,
    class_words,
    function_name,
    join_names,
    laid_over,
    no_field,
)

T = TypeVar("T")
NO_BOUND = Bound()
USUAL_KIND = "multisine"  # the class without a kind, where none that is named takes its place


class Part(Node):
    """An object of one of some classes: a part, a function, a path; None is of its own class."""

    def __init__(self, kinds: tuple[Any, ...]):
        self.kinds, self.none = kinds, type(None) in kinds

    def wants(self) -> str:
        return " or ".join(dict.fromkeys(map(class_words, self.kinds)))

    def fits(self, value: Any, old: Any = UNSET) -> bool:
        if isinstance(value, str | bytes) and str not in self.kinds:  # no list of characters
            return False
        if Iterable in self.kinds and getattr(value, "ndim", 1) == 0:
            return False  # NumPy's scalars say they can be iterated over
        return isinstance(value, self.kinds)

    def classes(self) -> dict[str, type]:
        kinds = (k for k in self.kinds if k not in CLASS_WORDS)
        return {k.__name__.lower(): k for kind in kinds for k in _family(kind)}

    def _usual(self, classes: Mapping[str, type]) -> type | None:
        """The class of plain data that names none."""
        if len(classes) == 1:
            return next(iter(classes.values()))
        named = next((k for k in self.kinds if k in classes.values()), None)
        return named or classes.get(USUAL_KIND)

    def _read(self, value: Any, path: str, old: Any) -> Any:
        classes = self.classes()
        if isinstance(value, list | tuple):
            terms = ((k, terms_field(k)) for k in classes.values())
            kind, name = next(((k, name) for k, name in terms if name), (None, ""))
            return value if kind is None else make_part(kind, {name: value}, {}, path)
        if isinstance(value, Mapping) and Mapping in self.kinds:
            return dict(value)
        if not isinstance(value, Mapping) or not classes:
            return super()._read(value, path, old)
        data, kind = dict(value), self._usual(classes)
        if type(old) in classes.values():
            kind = type(old)
        kind = _class_with(data, kind, [x for x in self.kinds if x in classes.values()])
        if KIND in data and not any(KIND in nodes_of(k) for k in classes.values()):
            kind = classes[choice(join_names(path, KIND), data.pop(KIND), tuple(classes))]
        if kind is None:
            raise ParameterError(path, dict(value), f"must name its {KIND}: {', '.join(classes)}")
        return make_part(kind, data, values_of(old) if type(old) is kind else {}, path)

    def write(self, value: Any, old: Any, path: str, units: dict[str, str]) -> Any:
        if isinstance(value, Mapping):
            return {k: super(Part, self).write(x, old, path, units) for k, x in value.items()}
        if not dataclasses.is_dataclass(value):
            return super().write(value, old, path, units)
        kind, classes, terms = type(value), self.classes(), terms_field(type(value))
        rest = {name: getattr(value, name) for name in nodes_of(kind) if name != terms}
        if terms and len(classes) > 1 and all(x == defaults_of(kind)[n] for n, x in rest.items()):
            old = UNSET if old is UNSET else None
            return nodes_of(kind)[terms].write(getattr(value, terms), old, path, units)
        data = _fields_as_data(value, old, path, units)
        before = type(old) if type(old) in classes.values() else kind
        usual = self._usual(classes) is kind is before
        if len(classes) == 1 or (usual and old is not UNSET) or KIND in nodes_of(kind):
            return data
        return {KIND: kind.__name__.lower(), **data}

    def below(self, name: str, *rest: str) -> Iterable[tuple[Node, Sequence[str]]]:
        for kind in self.classes().values():
            if node := nodes_of(kind).get(name, Node() if name == KIND else None):
                yield node, rest

    def leaves(self, path: str, default: Any, about: str) -> Iterator[Field]:
        classes = self.classes()
        if not classes:
            yield from super().leaves(path, default, about)
        for name, kind in classes.items():
            if any(kind in node.classes().values() for node in nodes_of(kind).values()):
                continue  # made of parts of its own class
            for field in leaves(kind, path, default if type(default) is kind else UNSET):
                about = f"of {name}: {field.about}" if len(classes) > 1 else field.about
                yield field._replace(about=about)


def _class_with(data: Mapping[str, Any], kind: Any, named: Sequence[type]) -> Any:
    """The class that plain data without a kind is of: another named one, if that alone fits."""
    names = set(data)
    if kind is None or KIND in names or names <= {*nodes_of(kind)}:
        return kind
    fits = [x for x in named if names <= {*nodes_of(x)}]
    return fits[0] if len(fits) == 1 else kind


# ---- the node of a type hint ---------------------------------------------------------------------

PLAIN = {float: Number, int: Whole}


def node_of(hint: Any, bound: Bound | None = NO_BOUND) -> Node:
    """The node of a type hint, whose numbers have a bound.

    Without one, numbers, texts, tuples and arrays may be anything, as a function checks them.
    """
    node = _node_of(hint, bound)
    node.hint = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    return node


def _node_of(hint: Any, bound: Bound | None) -> Node:
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        inner, *notes = args
        return node_of(inner, next((n for n in notes if isinstance(n, Bound)), bound))
    if origin in (Union, types.UnionType):
        return _union_node(args, bound)
    if origin is Literal:
        return Word(args)
    if hint is bool:
        return Flag()
    kind = class_of(hint)
    if kind not in (None, str):
        return Part((kind,))
    if bound is None or hint is Any or hint is object:
        return Node()
    if origin is tuple:
        return _tuple_node(args, bound)
    if hint in PLAIN:
        return PLAIN[hint](bound)
    if hint is str:
        return Text()
    raise TypeError(f"{hint}: no check for fields of this type")


def class_of(hint: Any) -> Any:
    """The class that values of a type belong to; None if that does not determine them."""
    kind = get_origin(hint) or hint
    kind = WIDER.get(kind, kind)
    if not isinstance(kind, type):
        return None
    known = kind in CLASS_WORDS or kind.__module__ not in ("builtins", "numpy", "typing")
    return kind if known else None


def _union_node(args: tuple[Any, ...], bound: Bound | None) -> Node:
    """Members from the most special to the one that takes the rest; their classes are one."""
    none, pathlike = type(None) in args, any(class_of(x) is os.PathLike for x in args)
    classes = [class_of(x) for x in args if x is not str or pathlike]
    if all(classes) and (len(classes) == len(args)) and set(classes) != {bool, type(None)}:
        return Part(tuple(classes))
    nodes = [node_of(x, bound) for x in args if x is not type(None)]
    if any(type(node) is Node for node in nodes):
        return Node()
    kinds = tuple(k for node in nodes if isinstance(node, Part) for k in node.kinds)
    members = [node for node in nodes if not isinstance(node, Part)]
    if kinds:
        members.append(Part((*kinds, *[type(None)] * none)))
    for node in members:
        if isinstance(node, Pair):
            node.alone = False
    order = (Pair, Word, Row, Part, Flag, Text, Number, Node)
    members.sort(key=lambda node: next(i for i, k in enumerate(order) if isinstance(node, k)))
    return Either(members, none, bound or NO_BOUND)


def _tuple_node(args: tuple[Any, ...], bound: Bound) -> Node:
    any_length, item = args[1:] == (...,), node_of(args[0], bound)
    if any_length or item.takes_numbers:
        return Row(item, any_length)
    return Pair((item, node_of(args[1], bound)), True)


def _family(kind: type) -> Iterator[type]:
    """A class and its subclasses that are parts, except bases without fields."""
    below = kind.__subclasses__()
    if dataclasses.is_dataclass(kind) and (dataclasses.fields(kind) or not below):
        yield kind
    for sub in below:
        yield from _family(sub)


# ---- all fields of a part ------------------------------------------------------------------------


@functools.cache
def nodes_of(kind: type) -> dict[str, Node]:
    """The types of the fields of a dataclass by name."""
    hints = get_type_hints(kind, include_extras=True)
    return {
        field.name: Text(empty=True) if field.default == "" else node_of(hints[field.name])
        for field in dataclasses.fields(kind)
    }


@functools.cache
def _checks_to_make(kind: type, prefix: str) -> list[tuple[str, str, Node, Any]]:
    """Field, name for the error, node, and the default if it needs no check; else UNSET."""
    out = []
    for field in dataclasses.fields(kind):
        node, good, full_name = nodes_of(kind)[field.name], field.default, prefix + field.name
        try:  # not if the bound is another field
            if isinstance(node.bound.low, str) or node.check(full_name, good) is not good:
                good = UNSET
        except ParameterError:
            good = UNSET
        out.append((field.name, full_name, node, good))
    return out


def check_fields(part: Any, prefix: str = "") -> None:
    """Checks each field of a frozen dataclass by its annotation, and keeps it as the field's type.

    Numbers become floats, sequences become tuples. prefix: what errors put before the field.
    """
    for name, full_name, node, good in _checks_to_make(type(part), prefix):
        value = getattr(part, name)
        if value is not good:
            checked = node.check(full_name, value, part)
            if checked is not value:
                object.__setattr__(part, name, checked)


@functools.cache
def defaults_of(kind: type) -> dict[str, Any]:
    """The defaults of the fields of a dataclass; UNSET for those that have none."""
    return {
        f.name: f.default_factory() if f.default_factory is not UNSET else f.default
        for f in dataclasses.fields(kind)
    }


def terms_field(kind: type) -> str:
    """The field of a class that needs nothing but a tuple of parts, as a sum; "" for others."""
    name, node = next(iter(nodes_of(kind).items()), ("", None))
    row = isinstance(node, Row) and node.classes()
    alone = all(defaults_of(kind)[x] is not UNSET for x in nodes_of(kind) if x != name)
    return name if row and alone else ""


def values_of(part: Any) -> dict[str, Any]:
    """Fields of a part by name."""
    return {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}


def leaves(kind: type, path: str = "", part: Any = UNSET) -> tuple[Field, ...]:
    """The fields of a class that take numbers or words, including those of nested parts."""
    out: list[Field] = []
    about = field_descriptions(kind)
    for name, node in nodes_of(kind).items():
        default = defaults_of(kind)[name] if part is UNSET else getattr(part, name)
        out += node.leaves(join_names(path, name), default, about[name])
    return tuple(out)


def dotted_names(kind: type, path: str = "") -> list[str]:
    """Names of all fields of a class, in the order of `leaves`, then of parts without fields."""
    names = [f.name for f in leaves(kind, path)]
    heads = {n[len(path) + 1 if path else 0 :].partition(".")[0] for n in names}
    return names + [join_names(path, n) for n in nodes_of(kind) if n not in heads]


def field_unit(name: str, *kinds: type) -> str:
    """Unit of a number by its dotted name, in the first class that has one there; "" for none."""
    head, *rest = name.split(".")
    nodes = (nodes_of(kind)[head] for kind in kinds if head in nodes_of(kind))
    units = (bound.unit for node in nodes for bound in node.bounds_at(rest))
    return next(filter(None, units), "")


def field_descriptions(kind: type) -> dict[str, str]:
    """Descriptions of fields from the docstrings of a dataclass and its bases, one line each."""
    out = dict.fromkeys((f.name for f in dataclasses.fields(kind)), "")
    for base in reversed(kind.__mro__):
        _, _, section = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")
        for name, text in re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", section, re.M):
            out[name] = " ".join(text.split())
    return out


# ---- plain data ----------------------------------------------------------------------------------
# A dictionary of fields: numbers, words, lists of numbers, and dictionaries for the parts within. A
# pair of parts has the keys x and y. Where a field takes parts of several classes, the key "kind"
# holds the name of the class in lower case. None, or the word "none", means no value.


def make_part(
    kind: type[T], data: Mapping[Any, Any], start: Mapping[str, Any] = {}, path: str = ""
) -> T:
    """Makes a part from plain data, over the values it starts with."""
    values = merged_values(kind, data, start, path)
    lacking = [n for n in nodes_of(kind) if n not in values and defaults_of(kind)[n] is UNSET]
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
    nodes, out = nodes_of(kind), dict(start)
    for name, value in data.items():
        inner = join_names(path, name)
        if name not in nodes:
            raise no_field(inner, value, dotted_names(kind, path))
        out[name] = nodes[name].read(value, inner, start.get(name, defaults_of(kind)[name]))
    return out


def plain_data(
    part: Any,
    full: bool = True,
    units: dict[str, str] | None = None,
    left_out: list[str] | None = None,
) -> dict[str, Any]:
    """Converts a part to plain data, from which `make_part` restores it.

    full: also fields that have their default. units: gets the unit of each field that has one.
    left_out: gets the fields that are no data, as a function; None raises a ParameterError.
    """
    old = UNSET if full else None
    return _fields_as_data(part, old, "", {} if units is None else units, left_out)


def _fields_as_data(
    part: Any, than: Any, path: str, units: dict[str, str], left_out: list[str] | None = None
) -> dict[str, Any]:
    """than: the part to differ from; None for the defaults, UNSET to write all fields."""
    kind, out = type(part), {}
    for name, node in nodes_of(kind).items():
        value, old, inner = getattr(part, name), UNSET, join_names(path, name)
        if than is not UNSET:
            old = getattr(than, name) if type(than) is kind else defaults_of(kind)[name]
            if type(old) is type(value) and _same(old, value):
                continue
            old = None if old is UNSET else old
        try:
            out[name] = node.write(value, old, inner, units)
        except ParameterError:
            if left_out is None:
                raise
            out[name] = left_out.append(name)
        if node.bound.unit:
            units[inner] = node.bound.unit
    return out


def _same(a: Any, b: Any) -> bool:
    """Whether two values are the same to the last bit, signs of zeros included."""
    if type(a) is not type(b):
        return False
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(_same, a, b))
    if dataclasses.is_dataclass(a):
        return _same([*values_of(a).values()], [*values_of(b).values()])
    if hasattr(a, "tobytes"):
        return a.shape == b.shape and a.tobytes() == b.tobytes()
    return repr(a) == repr(b)


def value_of_text(text: str) -> Any:
    """A number, a flag, a list of numbers, or the text itself."""
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


def of_words(node: Node, field: str, words: Sequence[str]) -> Any:
    """The value of words of a command line, as in `--force 1 5N`, `--gain 2`, `--clay 4cm,6cm`."""
    read: Any = value_of_text if node.takes_numbers or not node.arity else str
    values = [read(word) for word in words] or [True]
    one = len(values) == 1 and (node.takes_numbers or node.arity <= 1)
    return node.check(field, node.read(values[0] if one else values, field))
