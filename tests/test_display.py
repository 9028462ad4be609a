"""Tables of text: columns by heading, with formats."""

import math

import numpy as np
import pytest

from hapticclay.display import cell_text, text_table, time_words


@pytest.mark.parametrize(
    "value, form, text",
    [
        (None, ".3g", ""), ("a", ".3g", "a"), (True, "", "yes"), (False, "", "no"), (7, "", "7"),
        (np.int64(30919), "", "30919"), (math.nan, ".3g", "-"), (math.inf, "", "any"),
        (0.123456, "", "0.1235"), (56334.4, "", "56334"), (1.23456e8, "", "1.235e+08"),
        (-56334.4, "", "-56334"), (0.00123, "+.2f %", "+0.12 %"), (-1e-9, "z.2f", "0.00"),
        (np.float64(2.5), ".3f", "2.500"),
    ],
)  # fmt: skip
def test_a_value_is_shown_by_its_format(value, form, text):
    assert cell_text(value, form) == text


def test_numbers_stand_to_the_right_and_words_to_the_left():
    table = text_table({"name": ["a", "bcd"], "K [N/m]": [None, 12.0], "ok": [True, None]})
    assert table.splitlines() == [
        "name      K [N/m]  ok",
        "------  ---------  ----",
        "a                  yes",
        "bcd            12",
    ]


@pytest.mark.parametrize(
    "cells, right",
    [
        (["4000 N/m", "1"], True), (["0.6 to 0.9", ""], True), (["< 3e-12", "-"], True),
        (["100 - 903.9", "50"], True), (["+0.230 %"], True), (["1 up, 2 down"], False),
        (["yes"], False), (["", None], False), (["1", "one"], False),
    ],
)  # fmt: skip
def test_texts_that_are_numbers_stand_to_the_right_too(cells, right):
    line = text_table({"a long heading": cells}).splitlines()[2]
    assert line.startswith(" ") == right or not line


def test_units_stand_below_the_names_where_a_table_is_wide():
    columns = {f"quantity number {i} [N.s/m]": [float(i)] for i in range(5)}
    lines = text_table(columns).splitlines()
    assert "[N.s/m]" not in lines[0] and lines[1].split() == ["[N.s/m]"] * 5
    assert "[N.s/m] |" in text_table(columns, form="pipe").splitlines()[0]


def test_a_table_without_rows_has_its_head():
    assert text_table({"a": [], "b [m]": []}).splitlines()[0].split() == ["a", "b", "[m]"]


@pytest.mark.parametrize(
    "x, words",
    [(0.0, "0 ms"), (4e-3, "4 ms"), (0.5, "500 ms"), (0.9996, "1 s"), (4.0, "4 s")],
)
def test_a_time_is_in_ms_below_a_second(x, words):
    assert time_words(x) == time_words(x, 4.0) == words


def test_a_time_beyond_what_was_looked_for_has_no_number():
    assert time_words(float("inf"), 2.0) == time_words(2.1, 2.0) == "more than 2 s"
