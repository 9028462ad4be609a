"""Functions without the parts that a scene lacks, for machine code."""

import inspect

import pytest

from hapticclay.stepping import lacking
from hapticclay.stepping.lacking import GIVEN


def plain(part, x):
    """Asks for nothing."""
    return x if part is None else -x


def one(part, x):
    """Asks once."""
    if part is None:
        return x
    return part + x


def several(part, other, x):
    y = 2 * x
    if part is None:
        y += 1
        return y
    y += part
    if other is None:
        return y, None
    return y, other


def either(part, x):
    if part is None or x > 3:
        return x
    return part + x


TWO = 2


def twice(part, x):
    if part is None:
        return TWO * x
    return plain(part, x) - x


def square(x):
    return x * x


def nested(parts, x):
    inner, y = parts.inner, 3 * x
    return one(parts.outer, x), twice(inner, y), square(x + 1), several(parts.outer, inner, x)


def without(f, *lacks, **shapes):
    """A function as it is without some of its arguments, the others given."""
    names = inspect.signature(f).parameters
    told = {x: GIVEN for x in names} | dict.fromkeys(lacks) | shapes
    return lacking.without(f, told, lambda g: g.__module__ == __name__)


def test_a_function_that_asks_for_nothing_stays_as_it_is():
    assert without(plain, "part")(None, 4) == 4
    assert without(plain)(1, 4) == -4


def test_the_question_is_answered_by_what_is_none():
    absent, present = without(one, "part"), without(one)
    assert absent(None, 5) == 5 and absent("never looked at", 5) == 5
    assert present(2, 5) == 7
    with pytest.raises(TypeError, match="NoneType"):
        present(None, 5)
    assert len(inspect.signature(absent).parameters) == 2 and absent.__name__ == "one"


def test_an_answer_may_have_several_statements_and_ends_the_function():
    assert without(several, "part")(None, 1, 4) == 9
    assert without(several)(1, 2, 4) == (9, 2)
    assert without(several, "other")(1, None, 4) == (9, None)


@pytest.mark.parametrize("x", [1, 5])
def test_what_is_asked_beside_the_part_stays(x):
    assert without(either)(10, x) == either(10, x)
    assert without(either, "part")(None, x) == x


class Parts:
    def __init__(self, outer, inner):
        self.outer, self.inner = outer, inner


@pytest.mark.parametrize("outer", [None, 7])
@pytest.mark.parametrize("inner", [None, 9])
def test_calls_of_which_an_expression_is_left_are_replaced_by_it(outer, inner):
    parts = Parts(outer, inner)
    shape = {name: None if x is None else GIVEN for name, x in vars(parts).items()}
    made = without(nested, parts=shape)
    assert made(parts, 5) == nested(parts, 5)
    called = set(made.__code__.co_names)
    assert "one" not in called
    assert ("twice" in called) is False
    # what is worked out once stays so: its argument is an expression, and stands in it twice
    assert "square" in called
    # more than an expression is left of it
    assert "several" in called


def test_what_is_not_known_is_still_asked():
    made = without(nested, parts=GIVEN)
    for parts in (Parts(None, None), Parts(1, None), Parts(2, 3)):
        assert made(parts, 2) == nested(parts, 2)


def test_names_that_change_their_value_are_not_known():
    def changing(part, x):
        part = x
        return one(part, 1)

    assert without(changing, "part")(None, 5) == 6


def test_lines_are_those_of_the_file():
    present = without(several)
    assert present.__code__.co_firstlineno == several.__code__.co_firstlineno
    assert present.__code__.co_filename == __file__
