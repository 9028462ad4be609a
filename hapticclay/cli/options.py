"""The options of a command, as the fields of its dataclass, of its parts and of its experiment."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from ..errors import ParameterError
from ..scene.field_kinds import union_members
from ..scene.fields import field_descriptions
from .shim_fields import Node, node_of, of_words

if TYPE_CHECKING:
    from ..scene.experiments import Experiment

T = TypeVar("T")
LOOSE, SCENARIO, RECORD = "loose", "scenario", "record"
Loose = Annotated[T, LOOSE]  # a word without a name
ScenarioWord = Annotated[Any, SCENARIO]  # an experiment, or a scenario file
RecordWord = Annotated[Any, RECORD]  # or a saved record
MISSING = dataclasses.MISSING
RAW = {str: "a word", Path: "a path"}  # types of words that are taken as they stand
SET = "set"  # the option for the fields of a scenario
SET_HELP = (
    "Any field of the scenario, part by part, as in --set arm.l1=0.3 servo.x.G.damping=50 "
    "compensator.den=1,40,0 operator=true operator.mass=500g; hapticclay fields lists the names."
)


@dataclass(frozen=True)
class Option:
    """A word, or words behind a name, that a command takes.

    Attributes:
        part: field of the command in which the option lies; SCENARIO for those of an experiment, ""
            for the command's own.
        note: LOOSE, SCENARIO or RECORD for a word without a name; "" for others.
    """

    name: str
    hint: Any
    about: str
    default: Any
    part: str = ""
    note: str = ""

    @property
    def word(self) -> str:
        """The name on the command line."""
        return self.name.replace("_", "-")

    @property
    def label(self) -> str:
        """The name as an error shows it."""
        return self.name if self.note else f"--{self.word}"

    @cached_property
    def kind(self) -> Any:
        """The type without None where words are taken as they stand; the hint elsewhere."""
        members = [x for x in union_members(self.hint) if x is not type(None)]
        item = get_args(members[0])[0] if get_origin(members[0]) is tuple else members[0]
        return members[0] if item in RAW or get_origin(item) is Annotated else self.hint

    @cached_property
    def entries(self) -> tuple[Node, ...]:
        """The numbers of a tuple whose units differ; () for other types."""
        items = get_args(self.kind) if get_origin(self.kind) is tuple else ()
        return tuple(map(node_of, items)) if items and get_origin(items[0]) is Annotated else ()

    @cached_property
    def node(self) -> Node:
        """The type in the field tree, where it is there."""
        return node_of(self.hint)

    @property
    def raw(self) -> Any:
        """The type of a word that is taken as it stands; None for others."""
        item = get_args(self.kind)[0] if get_origin(self.kind) is tuple else self.kind
        return item if item in RAW else None

    @property
    def arity(self) -> float:
        """The most words that the option takes; 0 for a flag, infinite for any number."""
        if self.raw:
            return math.inf if get_origin(self.kind) is tuple else 1
        return len(self.entries) or self.node.arity

    @property
    def wants(self) -> str:
        """What the option takes, in words."""
        if self.raw:
            return RAW[self.raw] if self.arity == 1 else f"one or more, each {RAW[self.raw]}"
        return f"{len(self.entries)} numbers" if self.entries else self.node.wants()

    @property
    def metavar(self) -> str:
        """What stands for the words of the option on a help page."""
        if self.raw:
            one = "PATH" if self.raw is Path else "TEXT"
        else:
            nodes = self.entries or (self.node,)
            one = "|".join(["NUMBER"] * nodes[0].takes_numbers + list(nodes[0].words))
        return f"{one} ..." if self.arity == math.inf else " ".join([one] * int(self.arity))

    @property
    def has_default(self) -> bool:
        """Whether the help page shows a default."""
        return self.default not in (None, (), False, MISSING)

    def default_text(self, _: Any = None) -> str:
        """The default on a help page."""
        value = self.default() if callable(self.default) else self.default
        items = value if isinstance(value, tuple) else (value,)
        return " ".join(f"{x:g}" if isinstance(x, float) else str(x) for x in items)

    @property
    def fills_pair(self) -> bool:
        """Whether one word stands for two: as in --set, for the pairs of an experiment."""
        return self.part == SCENARIO and self.arity == 2

    def value(self, texts: tuple[str, ...]) -> Any:
        """The value that words stand for."""
        if self.raw:
            values = tuple(map(self.raw, texts))
            return values if self.arity == math.inf else values[0]
        if self.entries:
            named = zip(self.entries, texts, strict=True)
            return tuple(of_words(node, self.label, [text]) for node, text in named)
        if texts == ("none",) and "none" in self.node.words:  # a word here, no lack of a value
            return "none"
        return of_words(self.node, self.label, texts)

    def refused(self, texts: Sequence[str]) -> ParameterError:
        """The error for a number of words that the option does not take."""
        return ParameterError(self.label, " ".join(texts), f"must be {self.wants}")


def options_of(kind: type, part: str = "") -> dict[str, Option]:
    """The options of a dataclass, and of dataclasses among its fields, by name."""
    hints, about = get_type_hints(kind, include_extras=True), field_descriptions(kind)
    out: dict[str, Option] = {}
    for field in dataclasses.fields(kind):
        hint = hints[field.name]
        if dataclasses.is_dataclass(hint):
            out |= options_of(hint, field.name)  # type: ignore[arg-type]
            continue
        notes = getattr(hint, "__metadata__", ())
        note = next((x for x in (LOOSE, SCENARIO, RECORD) if x in notes), "")
        default = field.default
        if field.default_factory is not MISSING:
            default = field.default_factory
        hint = get_args(hint)[0] if note else hint
        out[field.name] = Option(field.name, hint, about[field.name], default, part, note)
    return out


def experiment_options(kind: type[Experiment]) -> dict[str, Option]:
    """The parameters of an experiment, as options."""
    from ..scene.experiments import parameter_fields

    return {
        f.name: Option(f.name, Annotated[f.hint, f.bound], f.about, f.default, SCENARIO)
        for f in parameter_fields(kind)
    }
