"""The files of a figure: formats, styles and numbers."""

import csv
import re
import xml.etree.ElementTree as ET
import zlib

import matplotlib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.views import palette, style
from hapticclay.views.captions import unit_text
from hapticclay.views.figure import FORMATS, UNDATED, csv_text, curves_drawn
from hapticclay.views.style import figure_size, figure_style, points

X = np.linspace(0.0, 1.0, 7)
TABLES = {"curve": {"x [m]": X, "y [N]": X**2 / 3.0}, "marks": {"x [m]": [0.5], "kind": ["run"]}}


def parabola():
    with figure_style():
        figure = Figure(figsize=figure_size(1, 3.0))
        ax = figure.add_subplot()
        ax.plot(X, X**2 / 3.0, label="a curve")
        ax.axhline(0.1)
        ax.set(xlabel="x [m]", ylabel="y [N]")
        ax.text(0.5, 0.5, "small", fontsize=points(7))
    return figure


def pdf_streams(data):
    """The objects of a PDF, unpacked, as one text."""
    parts = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.S)
    packed = b"\n".join(zlib.decompress(x) for x in parts if x[:1] == b"x")
    return data + packed


def test_each_format_is_what_it_says(tmp_path):
    made = hc.Figure(parabola, TABLES).save(tmp_path / "a", FORMATS, style="print", data=True)
    names = ["a.png", "a.svg", "a.pdf", "a.csv", "a-marks.csv"]
    assert [p.name for p in made] == names
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(names)
    png, svg, pdf = ((tmp_path / f"a.{kind}").read_bytes() for kind in FORMATS)
    assert png[:4] == b"\x89PNG"
    wide, high = (int.from_bytes(png[i : i + 4], "big") for i in (16, 20))
    assert wide == int(300 * 8.5 / 2.54) and high == int(300 * 0.75 * 3.0)
    root = ET.fromstring(svg)
    assert root.tag.endswith("svg") and float(root.get("width")[:-2]) == pytest.approx(
        72 * 8.5 / 2.54
    )
    assert b"<text" not in svg  # outlines: no font is needed to show it
    assert pdf[:5] == b"%PDF-" and b"/FontFile2" in pdf_streams(pdf)  # TrueType, embedded
    assert b"/Type3" not in pdf_streams(pdf)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.layout
def test_the_same_figure_gives_the_same_bytes(tmp_path, kind):
    figure = hc.Figure(parabola)
    for name in ("a", "b"):
        assert figure.save(tmp_path / f"{name}.{kind}") == [tmp_path / f"{name}.{kind}"]
    assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()


@pytest.mark.layout
@pytest.mark.parametrize("name, kind", [("screen", "png"), *(("print", k) for k in FORMATS)])
def test_a_file_is_that_of_the_plot_function(tmp_path, name, kind):
    """To the byte: laid out for the format, at its resolution and in the style; all as before."""
    with style.styled(name) as look:
        ours, plain = parabola(), parabola()
        plain.savefig(tmp_path / f"plain.{kind}", dpi=look.dpi, metadata=UNDATED[kind])
    before = ours.canvas, ours.dpi
    (made,) = hc.Figure(lambda: ours).save(tmp_path / f"ours.{kind}", style=name)
    assert made.read_bytes() == (tmp_path / f"plain.{kind}").read_bytes()
    assert (ours.canvas, ours.dpi) == before


@settings(max_examples=50)
@given(st.lists(st.floats(allow_nan=False), min_size=1))
def test_numbers_read_back_as_the_same_bits(values):
    text = csv_text({"a [m]": np.array(values), "told": ["x, y"] * len(values)})
    head, *rows = csv.reader(text.splitlines())
    assert head == ["a [m]", "told"] and [float(r[0]) for r in rows] == values
    assert {r[1] for r in rows} == {"x, y"}


def test_without_tables_the_numbers_are_the_curves():
    table = curves_drawn(parabola())
    assert list(table) == ["panel1"]  # the level line is no curve
    np.testing.assert_array_equal(table["panel1"]["y [N]"], X**2 / 3.0)
    assert set(table["panel1"]["curve"]) == {"a curve"}
    assert hc.Figure(parabola).tables() == table


def test_columns_of_different_length_are_refused_and_nothing_is_written(tmp_path):
    wrong = hc.Figure(parabola, {"a": {"x": [1, 2], "y": [1]}})
    with pytest.raises(ParameterError, match="equal length"):
        wrong.save(tmp_path / "a", FORMATS, data=True)
    with pytest.raises(ParameterError, match="no numbers"):
        hc.Figure(parabola, {}).save(tmp_path / "a", data=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong,told", [
    (dict(formats=("pgn",)), "png"), (dict(style="prnt"), "print"), (dict(dpi=1.0), "dpi"),
])  # fmt: skip
def test_wrong_words_are_refused(tmp_path, wrong, told):
    with pytest.raises(ParameterError, match=told):
        hc.Figure(parabola).save(tmp_path / "a", **wrong)
    with pytest.raises(ParameterError, match="png, svg, pdf"):
        hc.Figure(parabola).save(tmp_path / "a.jpg")
    assert not list(tmp_path.iterdir())


def test_a_figure_that_does_not_apply_has_no_files(tmp_path):
    nothing = hc.Figure(lambda: None)
    assert nothing.save(tmp_path / "a", FORMATS, data=True) == [] and nothing.draw() is None
    assert nothing._repr_svg_() is None and nothing.tables() == {}


def test_a_style_ends_with_its_context():
    before = dict(matplotlib.rcParams)
    with style.styled("print") as look:
        assert style.look() is look and style.narrow() and points(4.0) == style.LEAST_TEXT
        assert figure_size(2, 4.0) == (8.5 / 2.54, 3.0)
    assert style.look() is style.STYLES["screen"] and figure_size(2, 4.0) == (9.6, 4.0)
    assert dict(matplotlib.rcParams) == before


def test_printed_colours_differ_in_grey():
    """Luminance of the curves, by the CIE: each of a figure's first four apart by 5 of 100, and
    where not, their dashes differ."""
    rgb = np.array([palette.rgb(color) for color, _ in palette.CURVE_STYLES])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    light = 116.0 * np.cbrt(linear @ (0.2126, 0.7152, 0.0722)) - 16.0
    dashes = [str(dash) for _, dash in palette.CURVE_STYLES]
    for i in range(len(light)):
        for j in range(i):
            assert abs(light[i] - light[j]) > 5.0 or dashes[i] != dashes[j]


def test_a_draft_for_a_notebook():
    assert hc.Figure(parabola)._repr_svg_().lstrip().startswith("<?xml")


def test_heads_of_curves_have_units_as_files_have_them(tmp_path):
    """Labels are typeset; the CSV file made from the curves has N.s/m and s^2."""
    drawn = Figure()
    ax = drawn.add_subplot()
    ax.plot([1.0, 2.0], [3.0, 4.0])
    ax.set(xlabel=unit_text("b [N.s/m]"), ylabel=unit_text("a [m/s^2]"))
    hc.Figure(lambda: drawn).save(tmp_path / "curve", data=True)
    head = (tmp_path / "curve.csv").read_text().splitlines()[0]
    assert head == "curve,b [N.s/m],a [m/s^2]"
