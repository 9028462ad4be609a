"""The tree of fields: what each field of each public part takes and refuses, from its type."""

import dataclasses
import inspect
import math
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.arguments import argument_nodes
from hapticclay.errors import Bound, ParameterError
from hapticclay.fields import (
    Either,
    Flag,
    Node,
    Number,
    Pair,
    Part,
    Row,
    Whole,
    check_fields,
    field_descriptions,
    nodes_of,
)
from hapticclay.scene.experiments import EXPERIMENTS, Experiment, parameters
from tests.good_values import good_values, required
from tests.public import NAMES

PARTS = {
    name: made
    for name, made in {**NAMES, **EXPERIMENTS}.items()
    if getattr(getattr(made, "__post_init__", None), "__module__", "") == "hapticclay.arguments"
    or made in (hc.Scenario, hc.theory.Loop, *EXPERIMENTS.values())
}
FIELDS = [(name, field) for name, kind in PARTS.items() for field in nodes_of(kind)]
BOUNDED = [(name, x) for name, x in FIELDS if nodes_of(PARTS[name])[x].bound != Bound()]


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return good_values(tmp_path_factory.mktemp("good"))


def made_with(name, good, fields=MappingProxyType({})):
    """A part of this name, with some fields."""
    kind = PARTS[name]
    return kind(**{**required(kind.__name__, kind, good), **fields})


def inner_type(node):
    """The type of a union that takes what the others do not, or the type itself."""
    return node.members[-1] if isinstance(node, Either) else node


def ends_of(node, owner):
    """Numbers on the bounds of a type, whether it takes them, and the next ones beyond."""
    bound, whole = node.bound, isinstance(inner_type(node), Whole)
    low = getattr(owner, bound.low) if isinstance(bound.low, str) else bound.low
    for end, away, taken in ((low, -math.inf, not bound.above), (bound.high, math.inf, True)):
        if math.isfinite(end):
            beyond = int(end + math.copysign(1, away)) if whole else math.nextafter(end, away)
            yield int(end) if whole else float(end), taken
            yield beyond, False


def wrong_values(node, owner):
    """Values that no field of a type takes, made from the type alone."""
    inner = inner_type(node)
    if type(inner) is Node:  # the part itself checks it
        return
    yield object()
    yield b"x"
    for word in node.words:
        yield f"{word}{word[-1]}"
    if isinstance(inner, Number):
        yield from (math.nan, True, 1j, [], "1 furlong", *["1"] * (not node.words))
        yield from (x for x, taken in ends_of(node, owner) if not taken)
    elif isinstance(inner, Row) and inner.takes_numbers:
        yield from (1.0, "x", [None], [[[1.0]]])
        if not inner.any_length:
            yield from ([1.0] * (len(inner.bound.names) + 1), [math.nan] * len(inner.bound.names))
            for x, taken in ends_of(node, owner):
                yield from () if taken else ([x] * len(inner.bound.names),)
    elif isinstance(inner, Flag):
        yield from (1, "true", None)
    elif isinstance(inner, Part | Row | Pair):
        each = isinstance(inner, Part) and Iterable in inner.kinds
        yield from (1.0, *[[object()], (object(), object())] * (not each))
        yield from () if node.none else (None,)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name,field", FIELDS)
def test_what_a_type_does_not_take_is_refused_by_name(good, name, field):
    """For every field of every public part: one line that names the field."""
    node, owner = nodes_of(PARTS[name])[field], made_with(name, good)
    default = PARTS[name].__dataclass_fields__[field].default
    for value in wrong_values(node, owner):
        if value is None and default is None:  # the part itself puts a value there
            continue
        with pytest.raises(ParameterError) as e:
            made_with(name, good, {field: value})
        said = str(e.value)
        assert re.fullmatch(rf"(\w+\.)?{field}([[.].*)?", e.value.field), (value, said)
        assert "must " in said and "\n" not in said and len(said) < 800
        word = isinstance(value, str) and value[:-1] in node.words
        assert not word or f"did you mean {value[:-1]!r}" in said


@pytest.mark.parametrize("name,field", BOUNDED)
def test_a_value_on_a_bound_is_taken_to_the_last_bit(good, name, field):
    node, owner = nodes_of(PARTS[name])[field], made_with(name, good)
    inner, unit = inner_type(node), node.bound.unit
    for x, taken in ends_of(node, owner):
        given, wide = x, np.float64(x) if isinstance(x, float) else np.int64(x)
        if isinstance(inner, Row):
            n = 1 if inner.any_length else len(node.bound.names)
            given, wide = ((z,) * n for z in (x, wide))
            given, wide = ((given,), (wide,)) if isinstance(inner.item, Row) else (given, wide)
        if taken:
            assert node.check(field, given, owner) == given
            assert repr(node.check(field, wide, owner)) == repr(given)
            continue
        with pytest.raises(ParameterError) as e:
            node.check(field, given, owner)
        assert e.value.bound.startswith("must be") and e.value.bound.endswith(unit)


def public_functions():
    """Public functions, and class methods of public classes, by name."""
    for name, made in NAMES.items():
        if inspect.isfunction(made):
            yield name, made
        for inner in dir(made) if inspect.isclass(made) else ():
            if not inner.startswith("_") and inspect.ismethod(getattr(made, inner)):
                yield f"{name}.{inner}", getattr(made, inner)


FUNCTIONS = dict(public_functions())
ARGUMENTS = [
    (name, argument)
    for name, made in FUNCTIONS.items()
    if name != "Compensator.zpk"  # takes single numbers, too
    for argument in argument_nodes(inspect.unwrap(getattr(made, "__func__", made)))
    if (p := inspect.signature(made).parameters.get(argument)) and p.kind is not p.VAR_POSITIONAL
]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name,argument", ARGUMENTS)
def test_what_an_argument_does_not_take_is_refused_by_name(good, tmp_path, name, argument):
    """For every argument that declares its type, of every public function."""
    made = FUNCTIONS[name]
    node = argument_nodes(inspect.unwrap(getattr(made, "__func__", made)))[argument]
    given = required(re.sub(r"^[a-z]+\.(?=\w+\.?\w*$)", "", name), made, good)
    for value in wrong_values(node, None):
        with pytest.raises(ParameterError) as e:
            made(**{**given, argument: value})
        assert re.fullmatch(rf"(\w+\.)?{argument}([[.].*)?", e.value.field), (value, e.value)


@dataclasses.dataclass(frozen=True)
class Mixed:
    way: Literal["up", "down"] = "up"
    other: hc.Operator | None = None
    pair: Annotated[tuple[float, float] | None, Bound(0.0, 1.0, "m", names=("a", "b"))] = None
    mixed: Annotated[float | Literal["auto"], Bound(0.0)] = 0.0
    high: Annotated[float, Bound("mixed", 9.0)] = 5.0
    on: bool = False
    label: str = "x"

    def __post_init__(self):
        check_fields(self, "part.")


@pytest.mark.parametrize(
    "kw,said",
    [
        (dict(way="dwn"), "part.way = 'dwn': must be one of up, down; did you mean 'down'?"),
        (dict(way=None), "part.way = None: must be one of up, down"),
        (dict(other=3), "part.other = 3: must be an Operator or None"),
        (dict(pair=(0.5, 2.0)), "part.pair[b] = 2.0: must be a finite number >= 0 and <= 1 m"),
        (dict(pair=(0.5,)), "part.pair = (0.5,): must be 2 numbers (a, b), got 1"),
        (
            dict(mixed="aut"),
            "part.mixed = 'aut': must be a finite number >= 0 or one of auto; did you mean 'auto'?",
        ),
        (dict(mixed=-1), "part.mixed = -1: must be a finite number >= 0"),
        (dict(mixed=6.0), "part.high = 5.0: must be a finite number >= 6 and <= 9"),
        (dict(on=1), "part.on = 1: must be True or False"),
        (dict(label=""), "part.label = '': must be a non-empty string"),
    ],
)
def test_each_type_has_its_refusal(kw, said):
    with pytest.raises(ParameterError) as e:
        Mixed(**kw)
    assert str(e.value) == said


def test_a_type_without_a_check_is_no_field():
    @dataclasses.dataclass(frozen=True)
    class Strange:
        x: complex = 1j

        def __post_init__(self):
            check_fields(self)

    with pytest.raises(TypeError, match="no check"):
        Strange()


@pytest.mark.parametrize("kind", PARTS.values(), ids=PARTS)
def test_docstrings_name_the_unit_of_every_bound(kind):
    told = field_descriptions(kind)
    for name, node in nodes_of(kind).items():
        unit = node.bound.unit
        assert told[name], name
        assert not unit or f"[{unit}]" in told[name], name


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_parameters_of_an_experiment_make_its_scenario(name):
    known = parameters(EXPERIMENTS[name])
    assert "impedance" not in known and known["operator"].default is (name == "stability")
    assert all(p.about for p in known.values())
    assert issubclass(EXPERIMENTS[name], Experiment) and EXPERIMENTS[name]().scenario().name == name


def test_a_new_field_is_seen_wherever_fields_are_asked(tmp_path):
    """In checks, files, dotted names, options and their help, sweeps and suggestions."""
    words = [sys.executable, "-m", "tests.new_field", str(tmp_path)]
    subprocess.run(words, check=True, cwd=Path(__file__).parents[1])
