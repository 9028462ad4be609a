"""The options of a command, as the fields of its dataclass, of its parts and of its experiment."""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Sequence
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from ..fields import Node, field_descriptions, node_of, of_words

if TYPE_CHECKING:
    from ..scene.experiments import Experiment

T = TypeVar("T")
LOOSE, SCENARIO, RECORD, PREFIXED = "loose", "scenario", "record", "prefixed"
Loose = Annotated[T, LOOSE]  # a word without a name
ScenarioWord = Annotated[Any, SCENARIO]  # an experiment, or a scenario file
RecordWord = Annotated[Any, RECORD]  # or a saved record
Prefixed = Annotated[T, PREFIXED]  # a part: --tool-width for the width of a tool
SET = "set"  # the option for the fields of a scenario
SET_HELP = (
    "Any field of the scenario, part by part, as in --set arm.l1=0.3 servo.x.G.damping=50 "
    "compensator.den=1,40,0 operator=true operator.mass=500g; hapticclay fields lists the names."
)


class Verbatim(Node):
    """A text or a path as it was given."""

    def __init__(self, kind: type):
        self.kind = kind

    def wants(self) -> str:
        return "a path" if self.kind is Path else "a word"

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        return self.kind(value)


class Several(Node):
    """Values with a type each, or any number of values of one type."""

    def __init__(self, items: Sequence[Node], many: bool):
        self.items, self.many, self.takes_numbers = items, many, items[0].takes_numbers
        self.arity = math.inf if many else len(items)

    def wants(self) -> str:
        one = self.items[0].wants()
        return f"one or more, each {one}" if self.many else f"{len(self.items)} numbers"

    def check(self, field: str, value: Any, owner: Any = None) -> Any:
        values = value if isinstance(value, list) else [value]
        nodes = [*self.items] * len(values) if self.many else self.items
        pairs = zip(nodes, values, strict=True)
        return tuple(node.check(field, node.read(x, field)) for node, x in pairs)


@dataclass(frozen=True, eq=False)
class Option:
    """A word, or words behind a name, that a command takes."""

    name: str
    node: Node
    about: str
    default: Any
    part: str = ""  # the field in which it lies; SCENARIO for an experiment's, "" for none
    note: str = ""  # LOOSE, SCENARIO or RECORD for a word without a name; "" for others
    field: str = ""  # name of the field, without the prefix of a part

    @property
    def word(self) -> str:
        """The name on the command line."""
        return self.name.replace("_", "-")

    @property
    def usage(self) -> str:
        """What stands for a word without a name in the first line of a help page."""
        also = {SCENARIO: "EXPERIMENT|FILE", RECORD: "EXPERIMENT|FILE|RECORD"}
        many = "..." if self.node.arity == math.inf else ""
        return also.get(self.note) or self.name.upper() + many

    @property
    def label(self) -> str:
        """The name as an error shows it."""
        return self.name if self.note else f"--{self.word}"

    def value(self, texts: Sequence[str]) -> Any:
        """The value that words stand for."""
        return of_words(self.node, self.label, texts)


def parts_of(kind: type) -> dict[str, Any]:
    """Defaults of the fields of a command that are dataclasses."""
    return {f.name: f.default for f in dataclasses.fields(kind) if is_dataclass(f.default)}


def options_of(
    kind: type, part: str = "", start: Any = None, prefix: str = ""
) -> dict[str, Option]:
    """The options of a command by name; of a part of it, with the defaults of `start`."""
    hints, about = get_type_hints(kind, include_extras=True), field_descriptions(kind)
    out: dict[str, Option] = {}
    for field in dataclasses.fields(kind):
        hint, default = hints[field.name], getattr(start, field.name, field.default)
        notes = getattr(hint, "__metadata__", ())
        if is_dataclass(default):
            head = f"{field.name}_" if PREFIXED in notes else ""
            out |= options_of(type(default), field.name, default, head)
            continue
        note = next((x for x in (LOOSE, SCENARIO, RECORD) if x in notes), "")
        node, name = _option_node(get_args(hint)[0] if note else hint), prefix + field.name
        out[name] = Option(name, node, about[field.name], default, part, note, field.name)
    return out


def _option_node(hint: Any) -> Node:
    """The type of an option, as a node of the field tree."""
    node = _node_for(hint)
    node.hint = hint
    if "none" in node.words:  # a word here, not the lack of a value
        node.none = False
    return node


def _node_for(hint: Any) -> Node:
    bare, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    members = get_args(bare) if get_origin(bare) in (Union, types.UnionType) else (bare,)
    kind, *others = (x for x in members if x is not type(None))
    items = get_args(kind) if get_origin(kind) is tuple else ()
    if kind in (str, Path) and not others:
        return Verbatim(kind)
    many = items[1:] == (...,)
    if many or (items and get_origin(items[0]) is Annotated):
        each = [Annotated[(x, *notes)] if notes else x for x in items if x is not ...]
        return Several([_option_node(x) for x in each], many)
    return node_of(hint)


def experiment_options(kind: type[Experiment]) -> dict[str, Option]:
    """The parameters of an experiment, as options."""
    from ..scene.experiments import parameters

    return {
        name: Option(name, f.node, f.about, f.default, SCENARIO, "", name)
        for name, f in parameters(kind).items()
    }
