"""--format, --dpi, --style and --data of every command that draws."""

import csv
import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app, commands
from hapticclay.cli.options import options_of
from hapticclay.views.figure import FORMATS
from tests.hunt import HUNTS

ALL = ["--style", "print", "--dpi", "50", "--data"]


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    folder = tmp_path_factory.mktemp("record")
    muscle = hc.Multisine((1.0, 0.0), lines=20, seed=1)
    hc.simulate(hc.Scenario(clay=hc.slab(20.0), muscle=muscle, t_max=2.0, length=None)).save(folder)
    return folder


COMMANDS = {  # words, the figures that come of them, and formats; in a hunt all formats
    "run": (["run", "constant", "--t-max", "0.2"], ("velocity", "force"), FORMATS),
    "accuracy": (["accuracy", "constant", "--t-max", "0.05", "--quick"], ("accuracy",), ("svg",)),
    "stability": (["stability", "--map", "gain-pose", "--quick"], ("gain-pose",), ("pdf",)),
    "identify": (["identify", "--axis", "x", "--quick"], ("fig4", "fig5", "fig6"), ("svg",)),
    "fit": (["fit", "RECORD"], ("fit",), ("png",)),
    "sweep": (
        ["sweep", "--grid", "b=10:100:2 gain=0.5:1:2", "--fixed", "t_max=0.05", "--workers", "1"],
        ("status",),
        ("svg",),
    ),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_writes_its_figures_in_formats(name, record, tmp_path, capsys):
    words, figures, formats = COMMANDS[name]
    formats = FORMATS if HUNTS else formats
    if name == "sweep":
        pytest.importorskip("pyarrow")
    words = [str(record) if w == "RECORD" else w for w in words]
    words += ["--format", *formats, *ALL, "--out", str(tmp_path)]
    assert app.main(words) == 0, capsys.readouterr().err
    for figure in figures:
        for kind in (*formats, "csv"):
            assert (tmp_path / f"{figure}.{kind}").stat().st_size > 50, (figure, kind)
        if "svg" in formats:
            ET.parse(tmp_path / f"{figure}.svg")
        head, *rows = csv.reader((tmp_path / f"{figure}.csv").read_text().splitlines())
        assert rows and all(len(row) == len(head) for row in rows)
        assert any("[" in column for column in head)
    capsys.readouterr()


def test_numbers_of_a_run_are_those_of_its_record(tmp_path, capsys):
    words = ["run", "constant", "--t-max", "0.1", "--dpi", "50", "--data", "--out", str(tmp_path)]
    assert app.main(words) == 0
    record = hc.Record.load(tmp_path)
    with open(tmp_path / "velocity.csv") as f:
        rows = list(csv.DictReader(f))
    for name, array in (("time [s]", record.t), ("v_x [m/s]", record.v[:, 0])):
        np.testing.assert_array_equal([float(r[name]) for r in rows], array)
    assert app.main([*words[:-3], "--format", "pdf", "--out", str(tmp_path)]) == 0
    left = {p.name for p in tmp_path.iterdir()}  # none of the earlier record
    assert left == {
        "force.pdf", "record.npz", "scenario.toml", "summary.json", "velocity.pdf"
    }  # fmt: skip
    capsys.readouterr()


def test_every_command_that_draws_has_the_options():
    for name in commands.COMMANDS:
        kind = commands.load_command(name)
        own = {f.name: f.type for f in dataclasses.fields(kind)}
        if "FigureOptions" in str(own.get("figures")):
            assert {"format", "dpi", "style", "data"} <= options_of(kind).keys()


@pytest.mark.parametrize("words,told", [
    (["--format", "jpg"], "must be one of png, svg, pdf"),
    (["--format", "pdf", "pgn"], "did you mean 'png'"),
    (["--format=pgn"], "did you mean 'png'"),
    (["--style", "prnt"], "did you mean 'print'"),
    (["--dpi", "1"], "dpi = 1.0: must be a finite number >= 10"),
    (["--dpi", "many"], "--dpi = 'many': must be a finite number >= 10"),
])  # fmt: skip
@pytest.mark.parametrize("command", [["run", "constant"], ["stability", "--map", "gain-pose"]])
def test_wrong_words_are_refused_before_any_work(command, words, told, capsys):
    assert app.main([*command, *words]) == 2
    assert told in capsys.readouterr().err


def test_formats_may_stand_before_the_experiment(tmp_path, capsys):
    words = ["run", "--format", "svg", "pdf", "free", "--t-max", "0.01", "--out"]
    assert app.main([*words, str(tmp_path)]) == 0
    assert {p.suffix for p in tmp_path.glob("velocity.*")} == {".svg", ".pdf"}
    capsys.readouterr()
