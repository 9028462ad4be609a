"""Functions without the parts that a scene lacks, for machine code."""

import inspect

import pytest

from hapticclay.heart import lacking


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


NONE, GIVEN = frozenset({"part"}), frozenset({"x"})


def test_a_function_that_asks_for_nothing_is_itself():
    assert lacking.without(plain, NONE, GIVEN) is plain
    assert lacking.without(one, frozenset(), GIVEN) is one


def test_the_question_is_answered_by_what_is_none():
    absent = lacking.without(one, NONE, GIVEN)
    present = lacking.without(one, frozenset(), NONE | GIVEN)
    assert absent(None, 5) == 5 and absent("never looked at", 5) == 5
    assert present(2, 5) == 7
    with pytest.raises(TypeError, match="NoneType"):
        present(None, 5)
    assert len(inspect.signature(absent).parameters) == 2 and absent.__name__ == "one"


def test_an_answer_may_have_several_statements_and_ends_the_function():
    x = frozenset({"x"})
    assert lacking.without(several, NONE, x | {"other"})(None, 1, 4) == 9
    both = lacking.without(several, frozenset(), x | {"part", "other"})
    assert both(1, 2, 4) == (9, 2)
    assert lacking.without(several, frozenset({"other"}), x | {"part"})(1, None, 4) == (9, None)


@pytest.mark.parametrize("x", [1, 5])
def test_what_is_asked_beside_the_part_stays(x):
    given = lacking.without(either, frozenset(), frozenset({"part", "x"}))
    assert given(10, x) == either(10, x)
    assert lacking.without(either, NONE, GIVEN)(None, x) == x


def test_lines_are_those_of_the_file():
    present = lacking.without(several, frozenset(), frozenset({"part", "other", "x"}))
    assert present.__code__.co_firstlineno == several.__code__.co_firstlineno
    assert present.__code__.co_filename == __file__
