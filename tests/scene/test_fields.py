"""The one check of fields: each number of each part has a bound, kept to the last bit."""

import dataclasses
import math
from typing import Annotated, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import Bound, ParameterError
from hapticclay.fields import check_fields, field_descriptions, nodes_of
from hapticclay.scene.experiments import EXPERIMENTS, Experiment, parameters

CLAY = hc.Clay(hc.Profile((0.0,), (0.0, 9.0)), hc.Profile((0.0,), (0.0, 9.0)))
PARTS = {  # a valid one of each, and what its errors put before the field
    "": (hc.Scenario(clay=CLAY), *(kind() for kind in EXPERIMENTS.values())),
    "operator.": (hc.Operator(),),
    "clay.": (hc.Profile((0.05, 0.15), (0.0, 90.0, 0.0), growth=(0.0, 1.0, 0.0)),),
    "multisine.": (hc.Multisine(lines=3),),
    "constant.": (hc.Constant((1.0, 0.0)),),
    "step.": (hc.Step((1.0, 0.0), 1.0),),
    "ramp.": (hc.Ramp((1.0, 0.0), 1.0, 2.0),),
    "pulse.": (hc.Pulse((1.0, 0.0), 1.0, 5e-4, 1.0),),
    "chirp.": (hc.Chirp((1.0, 0.0), 1.0, 2.0, 3.0),),
    "coupling.": (hc.Coupling(100.0, 1.0),),
    "hardware.": (hc.Hardware(),),
    "arm.": (hc.Arm(),),
    "servo.": (
        hc.SecondOrder(910.19, 41.8, 910.19),
        hc.Servo(*[hc.SecondOrder(9.0, 3.0, 4.0)] * 2),
    ),
    "compensator.": (hc.Compensator(),),
}
BOUNDED = [
    (prefix, part, name, node.bound)
    for prefix, parts in PARTS.items()
    for part in parts
    for name, node in nodes_of(type(part)).items()
    if node.bound != Bound()
]
OUTSIDE = {float: math.nextafter, int: lambda x, to: x + (1 if to > x else -1)}


def number_types(node):
    """The type of the numbers of a field, and how many stand in a tuple, 0 for none."""
    return int if node.hint in (int, int | None) else float, 0 if node.arity == 1 else 2


@pytest.mark.parametrize(
    "prefix,part,name,bound", BOUNDED, ids=[f"{type(p).__name__}.{n}" for _, p, n, _ in BOUNDED]
)
def test_a_value_on_a_bound_is_taken_and_the_next_one_is_not(prefix, part, name, bound):
    node = nodes_of(type(part))[name]
    kind, count = number_types(node)
    check = node.check
    low = getattr(part, bound.low) if isinstance(bound.low, str) else bound.low
    for end, away, allowed in ((low, -math.inf, not bound.above), (bound.high, math.inf, True)):
        if math.isinf(end):
            continue
        end = kind(end)
        for x, good in ((end, allowed), (OUTSIDE[kind](end, away), False)):
            value = (x,) * count if count else x
            if good:
                assert check(name, value, part) == value
                continue
            with pytest.raises(ParameterError) as e:
                check(name, value, part)
            assert bound.unit in e.value.bound
            with pytest.raises(ParameterError) as e:  # and so the whole part
                dataclasses.replace(part, **{name: value})
            assert e.value.field.startswith(prefix + name)


@given(st.sampled_from(BOUNDED), st.sampled_from([math.nan, "1", True, 1j, b"", [], object()]))
def test_no_number_field_takes_anything_else(case, value):
    prefix, part, name, _ = case
    if value == [] and name in ("edges", "values", "growth", "Fy", "K", "n"):
        return
    with pytest.raises(ParameterError) as e:
        dataclasses.replace(part, **{name: value})
    assert e.value.field == prefix + name and "\n" not in str(e.value)


@given(st.sampled_from(BOUNDED), st.floats(0.0, 1.0))
def test_numbers_of_other_types_become_floats(case, u):
    prefix, part, name, bound = case
    node = nodes_of(type(part))[name]
    kind, count = number_types(node)
    check = node.check
    low = getattr(part, bound.low) if isinstance(bound.low, str) else bound.low
    x = kind(max(low, -10.0) + u * (min(bound.high, 10.0) - max(low, -10.0)))
    if bound.above and x <= low:
        return
    if kind is int:
        assert type(check(name, np.int64(x), part)) is int
    elif count:
        taken = check(name, np.array([x, x]), part)
        assert taken == (x, x) and all(type(y) is float for y in taken)
        assert check(name, [x, x], part) == (x, x)
    else:
        assert type(check(name, np.float64(x), part)) is float


@dataclasses.dataclass(frozen=True)
class Part:
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
        (dict(mixed="aut"), "part.mixed = 'aut': must be one of auto; did you mean 'auto'?"),
        (dict(mixed=-1), "part.mixed = -1: must be a finite number >= 0"),
        (dict(mixed=6.0), "part.high = 5.0: must be a finite number >= 6 and <= 9"),
        (dict(on=1), "part.on = 1: must be True or False"),
        (dict(label=""), "part.label = '': must be a non-empty string"),
    ],
)
def test_each_type_has_its_refusal(kw, said):
    with pytest.raises(ParameterError) as e:
        Part(**kw)
    assert str(e.value) == said


def test_a_type_without_a_check_is_no_field():
    @dataclasses.dataclass(frozen=True)
    class Strange:
        x: complex = 1j

        def __post_init__(self):
            check_fields(self)

    with pytest.raises(TypeError, match="no check"):
        Strange()


@pytest.mark.parametrize(
    "kind", [type(p) for k in PARTS for p in PARTS[k]], ids=lambda k: k.__name__
)
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
