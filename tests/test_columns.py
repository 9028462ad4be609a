"""CSV files as others write them: each reader reads them rightly, or names the cause in a line."""

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.ports import ButtonScript, Exchanges, Trajectory
from hapticclay.ports.exchanges import COLUMNS

LOGS = 0.25 * np.arange(120)  # exact in any number format below


def table(rows, head, separator=",", comma=False, units=""):
    """A file as a spreadsheet writes it."""
    lines = [separator.join(head), *([units] if units else [])]
    lines += [separator.join(repr(float(x)) for x in row) for row in rows]
    text = "\n".join(lines) + "\n"
    if not comma:
        return text
    first, rest = text.split("\n", 1)
    return first + "\n" + rest.replace(".", ",")


def hand(path):
    x = Trajectory.of_file(path)
    return np.column_stack((x.t, x.points))


def samples(path):
    x = hc.Samples.csv(path, ("t", "x", "y"))
    return np.column_stack((x.t, x.values))


def measured(path):
    x = hc.studies.Measurement.load(path, {"t": "t", "input": "x", "output": "y"})
    return np.column_stack((x.t, x.input, x.output))


READERS = {"hand": hand, "samples": samples, "measured": measured}
NUMBERS = np.column_stack((LOGS, LOGS % 3, LOGS % 7))
HEAD = ("t", "x", "y")
GOOD = {
    "plain": table(NUMBERS, HEAD).encode(),
    "mark": table(NUMBERS, HEAD).encode("utf-8-sig"),
    "Latin-1": table(np.column_stack((NUMBERS, LOGS)), (*HEAD, "Kraft \u00b5N")).encode("latin-1"),
    "UTF-16": table(NUMBERS, HEAD).encode("utf-16"),
    "UTF-16 without a mark": table(NUMBERS, HEAD).encode("utf-16-le"),
    "UTF-16, high byte first": table(NUMBERS, HEAD).encode("utf-16-be"),
    "UTF-32": table(NUMBERS, HEAD).encode("utf-32"),
    "spaces": table(NUMBERS, HEAD, " ").encode(),
    "many spaces": table(NUMBERS, HEAD, "   ").replace("\n", "\n ").encode(),
    "strokes": table(NUMBERS, HEAD, "|").encode(),
    "commas and spaces": table(NUMBERS, HEAD, ", ").encode(),
    "spaces and commas": table(NUMBERS, HEAD, " ", comma=True).encode(),
    "tabs and commas": table(NUMBERS, HEAD, "\t", comma=True).encode(),
    "quoted commas": table(NUMBERS, HEAD, '","', comma=True)
    .replace("\n", '"\n"')
    .removesuffix('"')
    .replace('t","x","y"', '"t","x","y"', 1)
    .encode(),
    "names in a comment": ("# " + table(NUMBERS, HEAD, " ")).encode(),
    "names in a comment of MATLAB": ("% rig 2\n% " + table(NUMBERS, HEAD, "\t")).encode(),
    "names of the comment": ("# t, x, y\n" + table(NUMBERS, HEAD, " ").partition("\n")[2]).encode(),
    "units in a comment": ("# t [s], x [m], y [m]\n" + table(NUMBERS, HEAD)).encode(),
    "title lines": ("Rig 3, test 5\n2024-05-01\n\n" + table(NUMBERS, HEAD)).encode(),
    "lines of settings": ("rate;1000\ngain;2,5\n" + table(NUMBERS, HEAD, ";")).encode(),
    "sep=": ("sep=;\n" + table(NUMBERS, HEAD, ";")).encode(),
    "a last row cut off": (table(NUMBERS, HEAD) + "30.0,1").encode(),
    "no end of the last line": table(NUMBERS, HEAD).rstrip("\n").encode(),
    "minus of typesetters": table(NUMBERS, HEAD).replace("-", "\u2212").encode(),
    "exponents of Fortran": table(NUMBERS, HEAD).replace(".25\n", ".25D+00\n").encode(),
    "semicolons": table(NUMBERS, HEAD, ";").encode(),
    "tabs": table(NUMBERS, HEAD, "\t").encode(),
    "decimal commas": table(NUMBERS, HEAD, ";", comma=True).encode(),
    "row of units": table(NUMBERS, HEAD, units="s,m,m").encode(),
    "row of units in brackets": table(NUMBERS, HEAD, units="[s],[m],[m]").encode(),
    "row of units in part": table(NUMBERS, HEAD, units="s,,").encode(),
    "units and commas": table(NUMBERS, HEAD, ";", comma=True, units="s;m;m").encode(),
    "milliseconds": table(NUMBERS * (1e3, 1, 1), HEAD, units="ms,m,m").encode(),
    "line ends": table(NUMBERS, HEAD).replace("\n", "\r\n").encode(),
    "old line ends": table(NUMBERS, HEAD).replace("\n", "\r").encode(),
    "comments": ("# rig\n\n" + table(NUMBERS, HEAD)).encode(),
    "trailing separators": table(NUMBERS, HEAD).replace("\n", ",\n").encode(),
    "an empty row": (table(NUMBERS, HEAD) + ",,\n").encode(),
    "other columns": table(np.column_stack((NUMBERS, LOGS)), (*HEAD, "Kraft \u00b5N")).encode(),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("kind", GOOD)
def test_files_of_many_kinds_are_read(reader, kind, tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(GOOD[kind])
    # a rounding of the product with 1e-3
    np.testing.assert_allclose(READERS[reader](path), NUMBERS, rtol=2e-16)


def changed(text, row=None, **more):
    """The plain file with something else in its head, or in a row."""
    lines = table(NUMBERS, HEAD, **more).split("\n")
    lines[0 if row is None else row] = text
    return "\n".join(lines).encode()


BAD = {
    "bytes": (bytes(range(256)), "must be a table of text; line 1 holds the byte 0x00"),
    "nothing": (b"", "empty"),
    "no names": (table(NUMBERS, HEAD).partition("\n")[2].encode(), "name its columns"),
    "NaN": (changed("0.75,nan,0", 4), "line 5"),
    "NaN at first": (changed("nan,nan,nan", 1), "line 2"),
    "infinite": (changed("0.75,-inf,0", 4), "line 5"),
    "overflow": (changed("0.75,1e999,0", 4), "line 5"),
    "Python's digits": (changed("0.75,1_000,0", 4), "line 5"),
    "a word": (changed("0.75,stop,0", 4), "'stop'"),
    "a missing cell": (changed("0.75,,0", 4), "line 5"),
    "a short row": (changed("0.75,1", 4), "must have 3 cells"),
    "a long row": (changed("0.75,1,2,3", 4), "must have 3 cells"),
    "decimal commas between commas": (
        table(NUMBERS, HEAD, ",", comma=True).encode(),
        "semicolons",
    ),
    "quoted decimal commas": (changed('"0,75","1,5","2,5"', 4), "'0,75'"),
    "points and commas": (changed("0,75;1;2", 4, separator=";"), "not both"),
    "thousands": (changed("0.75;1.234,5;2", 4, separator=";"), "'1.234,5'"),
    "a name twice": (table(np.column_stack((NUMBERS, LOGS)), (*HEAD, "x")).encode(), "once"),
    "an object of JSON": (b'{"t": [0, 1], "x": [1, 2]}', "JSON is not read"),
    "objects of JSON": (b'[\n {"t": 0, "x": 1}]', "JSON is not read"),
    "lines of JSON": (b'{"t": 0, "x": 1}\n{"t": 1, "x": 1}\n', "JSON is not read"),
    "an unknown unit below": (table(NUMBERS, HEAD, units="s,furlong,m").encode(), "furlong"),
    "another quantity below": (table(NUMBERS, HEAD, units="s,V,V").encode(), "V"),
}


MISSING = ("NaN", "NaN at first", "infinite", "a missing cell")


@pytest.mark.parametrize("kind", MISSING)
def test_a_measurement_takes_missing_cells_as_missing_rows(kind, tmp_path):
    """It is that of the file without the row, in which the note counts it."""
    (tmp_path / "log.csv").write_bytes(BAD[kind][0])
    lines = BAD[kind][0].decode().split("\n")
    row = next(i for i, x in enumerate(lines[1:], 1) if x != table(NUMBERS, HEAD).split("\n")[i])
    (tmp_path / "without.csv").write_text("\n".join(lines[:row] + lines[row + 1 :]))
    names = {"t": "t", "input": "x", "output": "y"}
    with_hole, without = (
        hc.studies.Measurement.load(tmp_path / x, names) for x in ("log.csv", "without.csv")
    )
    for key in names:
        np.testing.assert_array_equal(getattr(with_hole, key), getattr(without, key))
    if kind != "NaN at first":  # where the row has no time either
        assert "1 of 120 rows lack a value of x" in with_hole.notes[0]


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("kind", BAD)
def test_files_that_cannot_be_read_are_refused_in_a_short_line(reader, kind, tmp_path):
    if reader == "measured" and kind in (*MISSING, "a name twice"):
        return  # which it reads, and says so
    path = tmp_path / "log.csv"
    data, told = BAD[kind]
    path.write_bytes(data)
    with pytest.raises(hc.ParameterError) as error:
        READERS[reader](path)
    text = str(error.value)
    assert len(text) < 300 and "\n" not in text and told in text, text


@pytest.mark.parametrize(
    ("names", "size"),
    [
        (("t [ms]", "fx [mN]", "fy [mN]"), (1e-3, 1e-3, 1e-3)),
        (("t (s)", "fx (kN)", "fy [N]"), (1.0, 1e3, 1.0)),
        (("t_ms", "fx_mN", "fy_N"), (1e-3, 1e-3, 1.0)),
        (("t / ms", "F, mN", "F [mN] filtered"), (1e-3, 1e-3, 1e-3)),
        (("time", "force x", "force (2)"), (1.0, 1.0, 1.0)),
    ],
)
def test_units_in_names_are_converted(names, size, tmp_path):
    path = tmp_path / "log.csv"
    quoted = [f'"{name}"' for name in names]
    path.write_text(table(NUMBERS, quoted))
    x = hc.Samples.csv(path, names)
    np.testing.assert_allclose(np.column_stack((x.t, x.values)), NUMBERS * size, rtol=4e-16)


@pytest.mark.parametrize("unit", ["furlong", "raw", "counts", "V", "lb", "%", "N/mm", "kg", "s"])
def test_units_of_no_force_or_length_are_refused(unit, tmp_path):
    path = tmp_path / "log.csv"
    for name in (f"x [{unit}]", f"x ({unit})", f"x [{unit}] filtered"):
        path.write_text(table(NUMBERS, ("t", name, "y")))
        with pytest.raises(hc.ParameterError, match="must be in|not in"):
            hc.Samples.csv(path, ("t", name, "y"))
        with pytest.raises(hc.ParameterError, match="must be in|not in"):
            hc.studies.Measurement.load(path, {"input": name, "output": "y"})
    path.write_text(table(NUMBERS, ("t", f"x [{unit}]", "y")))
    with pytest.raises(hc.ParameterError, match="must be in|not in"):
        Trajectory.of_file(path)


def test_the_places_of_a_hand_are_converted(tmp_path):
    path = tmp_path / "hand.csv"
    path.write_text(table(NUMBERS * (1e3, 1e3, 1e2), ("t [ms]", "x [mm]", "y (cm)")))
    np.testing.assert_allclose(hand(path), NUMBERS, rtol=4e-16)
    path.write_text("t,x\n0,1\n")
    with pytest.raises(hc.ParameterError, match="columns t, x, y; it lacks y and has t, x"):
        Trajectory.of_file(path)


@pytest.mark.parametrize(
    "text",
    [
        "t,a,b,c,home\n0,nan,0,0,0\n",
        "t,a,b,c,home\n0,0.5,0,0,0\n",
        "t,a,b,c,home\n0,2,0,0,0\n",
        "t,a,b,c,home\n0,yes,0,0,0\n",
        "t,a,b,c\n0,1,0,0\n",
        "t [mm],a,b,c,home\n0,1,0,0,0\n",
    ],
)
def test_buttons_are_0_or_1(text, tmp_path):
    path = tmp_path / "buttons.csv"
    path.write_text(text)
    with pytest.raises(hc.ParameterError, match="buttons"):
        ButtonScript.of_file(path)


def test_buttons_are_read_with_mark_and_units(tmp_path):
    path = tmp_path / "buttons.csv"
    path.write_text("t [ms];a;b;c;home\n0;1;0;0;0\n500;0;0;1;1\n", encoding="utf-8-sig")
    found = ButtonScript.of_file(path)
    assert found == ButtonScript((0.0, 0.5), (frozenset("a"), frozenset({"c", "home"})))


@pytest.mark.parametrize("cell", ["nan", "inf", "x", "", "1,2"])
@pytest.mark.parametrize("axes", COLUMNS)
def test_exchanges_that_are_no_numbers_are_refused(axes, cell, tmp_path):
    path, names = tmp_path / "exchanges.csv", COLUMNS[axes]
    row = ["0.0"] * len(names)
    path.write_text("\n".join((",".join(names), ",".join(row), ",".join([cell, *row[1:]]))))
    with pytest.raises(hc.ParameterError, match="line [23]") as error:
        Exchanges.load(path)
    assert len(str(error.value)) < 300
