"""What all results share: one line, a table, a frame, a figure, a file that tells them exactly."""

import functools
import json

import numpy as np
import pytest
from matplotlib.figure import Figure

import hapticclay as hc
from hapticclay.cli import console
from hapticclay.errors import ParameterError
from hapticclay.results import Result, of_plain, plain
from hapticclay.theory.client_loop import Handle

HAND = hc.Operator()
WALL = hc.VirtualWall(300.0, 2.0, device=hc.Device(0.1, 0.5), Ts=1e-3)


def columns():
    """A mass against Bingham resistance, pushed to and fro."""
    t = 1e-3 * np.arange(4000)
    v = 0.2 * np.sin(2.0 * np.pi * t) + 1e-9
    return hc.studies.Measurement(t, 3.0 * np.sign(v) + 5.0 * v, np.cumsum(v) * 1e-3)


@functools.cache
def pair():
    """A log of a pair without friction."""
    t = 2e-3 * np.arange(1000.0)
    leader = 0.1 * np.sin(9.0 * t)
    follower = leader - 2e-3 * np.sin(20.0 * t)
    return hc.studies.PairLog(t, leader, follower, 12.0 * (leader - follower))


@functools.cache
def result(name):
    """A result, made once: no test changes it."""
    loop = hc.studies.PushedLoop("x", b=0.0, operator=HAND, Ts=3.6e-4)
    trials = hc.studies.Trials(WALL, {"K": hc.studies.Distribution("uniform", 1.0, 9e3)}, runs=20)
    return {
        "ZWidth": lambda: hc.walls.zwidth(WALL, B=(0.0, 5.0)),
        "Impedance": lambda: hc.theory.loop_response(
            hc.theory.Loop("x", 90.0, HAND, K=1.0), [1.0, 9.0, 80.0]
        ),
        "MeasuredImpedance": lambda: hc.studies.measure_impedance(WALL, band=(20.0, 60.0), lines=3),
        "DeviceMBK": lambda: hc.walls.device_mbk(WALL, columns=0, points=7),
        "ArmMBK": lambda: hc.walls.arm_mbk(loop, columns=0, points=3, samples=0),
        "Identified": lambda: hc.studies.identify(
            "x", "G", realisations=2, periods=1, lines=8, period=1.5, band=(0.6, 15.0)
        ),
        "Fitted": lambda: hc.studies.fit_flow(columns()),
        "IdentifiedPair": lambda: hc.studies.identify_pair(pair()),
        "Replayed": lambda: hc.studies.replay(
            hc.Scenario(), hc.studies.Recording([0.0, 0.1], f=np.ones((2, 2)))
        ),
        "Band": lambda: hc.studies.gain_band(
            hc.theory.Loop("x"), hc.studies.Hands.around(HAND, 0.5), [10.0, 90.0],
            hc.studies.Draw(5),
        ),
        "Instability": lambda: hc.studies.monte_carlo(trials),
        "Lab": lambda: hc.studies.lab("jnd", quick=True),
        "StaircaseRun": lambda: hc.studies.run_staircase(
            hc.studies.Staircase(), hc.studies.Observer()
        ),
        "Design": lambda: hc.theory.compare(
            "x", 90.0, [hc.Compensator()], HAND, disk_margin=0.5
        )[0],
    }[name]()  # fmt: skip


NAMES = (
    "ZWidth", "Impedance", "MeasuredImpedance", "DeviceMBK", "ArmMBK", "Identified", "Fitted",
    "IdentifiedPair", "Replayed", "Band", "Instability", "Design", "Lab", "StaircaseRun",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_every_result_has_a_line_a_table_a_frame_a_figure_and_a_file(name, tmp_path):
    found = result(name)
    assert isinstance(found, Result) and type(found).__name__ == name
    assert (
        repr(found).startswith(f"<{name}: ") and "\n" not in repr(found) and len(repr(found)) < 230
    )
    page = found._repr_html_()
    assert page.startswith("<table") and page.endswith("</table>")
    for table, told in found.tables().items():
        frame = found.to_frame(table)
        assert list(frame.columns) == list(told) and len({len(x) for x in told.values()}) == 1
    assert found.to_frame().equals(found.to_frame(next(iter(found.tables()))))
    assert isinstance(found.plot(), Figure)
    again = type(found).load(found.save(tmp_path / "found.json"))
    assert plain(again) == plain(found) and repr(again) == repr(found)
    assert Result.load(tmp_path / "found.json").headline() == found.headline()


@pytest.mark.parametrize("name", NAMES)
def test_every_result_is_printed_and_written_with_schema_and_versions(name):
    found = result(name)
    text, tables = found.text(), found.tables()
    assert "\n---" in text or name == "Lab" and "---" in text
    for shown in found.printed:
        assert shown in tables, shown
        assert all(column in tables[shown] for column in found.printed[shown]), shown
    columns = {column for table in tables.values() for column in table}
    if name != "Lab":
        assert set(found.formats) <= columns
    data = json.loads(json.dumps(found.summary(), allow_nan=False))
    assert data["schema"] == f"hapticclay-{found.written_as}-1"
    assert data["versions"]["hapticclay"] == hc.__version__
    for figure in found.figures().values():
        assert figure.tables()


def test_a_full_disk_does_not_hide_a_result(tmp_path, capsys, monkeypatch):
    def full(*_, **__):
        raise ParameterError("out", "o", "must be writable (No space left on device)")

    found = result("ZWidth")
    monkeypatch.setattr(type(found), "write", full)
    with pytest.raises(ParameterError, match="No space left"):
        console.deliver(found, tmp_path)
    assert found.text() in capsys.readouterr().out and not list(tmp_path.iterdir())


def test_a_result_is_delivered_with_the_question_figures_numbers_and_pages(tmp_path, capsys):
    found = result("ZWidth")
    options = console.FigureOptions(format=("svg",), data=True)
    pages = {"page.md": lambda: found.text("pipe")}
    console.deliver(found, tmp_path, options, pages=pages, asked={"B": (0.0, 5.0)})
    names = ["page.md", "zwidth-lines.csv", "zwidth-regions.csv", "zwidth.csv", "zwidth.json"]
    assert sorted(p.name for p in tmp_path.iterdir()) == [*names, "zwidth.svg"]
    data = json.loads((tmp_path / "zwidth.json").read_text())
    assert data["asked"] == {"B": [0.0, 5.0]} and data["schema"] == "hapticclay-zwidth-1"
    assert (tmp_path / "page.md").read_text().startswith("| region")
    assert capsys.readouterr().out == f"{found.text()}\nwritten to {tmp_path}\n"


def test_a_comparison_is_a_result_too(tmp_path):
    for name, K in (("a", 100.0), ("b", 200.0)):
        hc.VirtualWall(K, 1.0, device=hc.Device(0.1, 1.0)).save(tmp_path / f"{name}.toml")
    from hapticclay.studies.comparison import compare_files

    found = compare_files([tmp_path / "a.toml", tmp_path / "b.toml"])
    assert len(found) == 2 and [x.name for x in found] == ["a", "b"]
    assert list(found.to_frame().file) == ["a", "b"] and isinstance(found.plot(), Figure)
    again = type(found).load(found.save(tmp_path / "found.json"))
    assert plain(again) == plain(found)


def test_numbers_keep_every_bit():
    some = {
        "none": None, "inf": [np.inf, -np.inf], "tuple": (1, 2.5, "x", True), 3: 0.1 + 0.2,
        "whole": np.arange(6).reshape(2, 3), "complex": np.array([1 + 2j, 3 - 1e-300j]),
        "empty": np.zeros((0, 2)), "flags": np.array([True, False]),
        "beyond": np.array([complex(1.0, np.inf), complex(-0.0, -1.0), complex(np.nan, 2.0)]),
        "single": np.array([complex(0.1, 0.2)], np.complex64),
    }  # fmt: skip
    back = of_plain(json.loads(json.dumps(plain(some))))
    assert list(back) == list(some)
    for name, value in some.items():
        if isinstance(value, np.ndarray):
            assert back[name].dtype == value.dtype and back[name].shape == value.shape
            assert back[name].tobytes() == value.tobytes()
        else:
            assert back[name] == value and type(back[name]) is type(value)
    assert np.isnan(of_plain(plain(float("nan"))))


def test_a_file_names_no_class_but_those_of_data_and_runs_nothing(tmp_path):
    file = result("Design").save(tmp_path / "found.json")
    text = file.read_text()
    for name in (
        "os:system",
        "hapticclay.cli.app:main",
        "hapticclay.views.page:Page",
        "x",
        "hapticclay:simulate",
    ):
        file.write_text(text.replace("hapticclay.theory.design:Design", name))
        with pytest.raises(ParameterError, match="must be a saved result"):
            Result.load(file)
    file.write_text(text)
    with pytest.raises(ParameterError, match="must hold a Fitted, has a Design"):
        hc.studies.Fitted.load(file)
    for bad in ("", "[]", "{}", '{"schema": "other"}', text[: len(text) // 2]):
        file.write_text(bad)
        with pytest.raises(ParameterError):
            Result.load(file)
    with pytest.raises(ParameterError, match=r"must be a \.json file"):
        result("Design").save(tmp_path / "found.txt")
    with pytest.raises(ParameterError, match="did you mean 'design'"):
        result("Design").to_frame("desing")
    with pytest.raises(ParameterError, match="must be data"):
        plain(lambda: 0)


@pytest.mark.parametrize(
    "make",
    [
        lambda: hc.studies.Measurement(*(np.arange(500.0) * x for x in (1e-3, 1.0, 2.0))),
        lambda: Handle.of(hc.Scenario(operator=hc.Operator())),
        lambda: hc.theory.nyquist(hc.Scenario(), axis="x", b=50.0),
    ],
)
def test_arrays_are_printed_by_shape_and_range(make):
    """On one line, without a row of numbers."""
    text = str(make())
    assert "\n" not in text and "array(" not in text and len(text) < 500
    assert text.startswith(f"<{type(make()).__name__}")
