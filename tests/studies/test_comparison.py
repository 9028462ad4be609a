"""Controllers and devices side by side: numbers against the analysis of each, and the page."""

import contextlib
import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.figure import Figure

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.paper.comparison import SVG_COLORS, inline_svg
from hapticclay.studies import comparison, published_walls, wall_lines
from hapticclay.views import compare_plots
from hapticclay.views.compare_plots import parts_overlay

SCENES = {
    "printed": 'experiment = "constant"\nt_max = 0.5\n',
    "faster": 'experiment = "constant"\nt_max = 0.5\nb = 60\ngain = [2.0, 0.5]\n',
    "wild": 'experiment = "constant"\nt_max = 0.5\ngain = [30.0, 0.5]\n',
}
WALLS = {
    "near": "K = 500\ndevice.damper = 1.0\n",
    "far": 'K = 300\ndevice.damper = 2.0\nTs = "2 ms"\n',
}


def files(folder, texts):
    paths = []
    for name, text in texts.items():
        paths.append(folder / f"{name}.toml")
        paths[-1].write_text(text)
    return paths


def commanded(folder, texts, *words):
    """A folder that the command writes, what it says, and what it compares."""
    out, said, found = folder / "o", io.StringIO(), []
    compare = comparison.compare_files
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(said):
        # figures are drawn as they are
        patch.setattr(Figure, "get_layout_engine", lambda self: None)
        # lines of theory with few points
        patch.setattr(compare_plots, "CLAY_DAMPINGS", np.geomspace(1.0, 3000.0, 4))
        patch.setattr(comparison, "RANGE_AT", np.geomspace(0.5, 30.0, 5))
        patch.setattr(published_walls, "LIMIT_POINTS", 5)
        for name in ("LIMIT_POINTS", "TOP_POINTS"):
            patch.setattr(wall_lines, name, 5)
        patch.setattr(comparison, "compare_files", lambda *a: found.append(compare(*a)) or found[0])
        assert (
            app.main(["compare", *map(str, files(folder, texts)), *words, "--out", str(out)]) == 0
        )
    return out, said.getvalue(), found[0]


@pytest.fixture(scope="module")
def controllers(tmp_path_factory):
    return commanded(tmp_path_factory.mktemp("c"), SCENES, "--dpi", "40")


@pytest.fixture(scope="module")
def walls(tmp_path_factory):
    return commanded(tmp_path_factory.mktemp("w"), WALLS, "--format", "svg", "--data")


def test_numbers_are_those_of_the_analysis(controllers):
    for x, (K, b) in zip(controllers[-1].files[:2], ((1.0, 90.0), (2.0, 60.0)), strict=True):
        n, m = x.numbers, hc.theory.margins("x", K, b, operator=None)
        assert n["gain K [1/kg]"] == K and n["clay b [N.s/m]"] == b
        # the arm's own mobility differs from the printed gain of Sh by some percent
        assert n["gain margin"] == pytest.approx(m.gain[1], rel=0.05)
        assert n["steady damper [N.s/m]"] == pytest.approx(10.0 / K, rel=1e-4)  # 10/K, the paper's
        assert n["engine steps"] == x.record.steps
        Z = hc.theory.loop_impedance("x", K, b, [2.0 * np.pi], operator=None)[0]
        assert n["effective damping at 1 Hz [N.s/m]"] == pytest.approx(Z.real, rel=0.05)
        # the compensator is 1/(M (s^2 + 10 s)), so the least M is that of the largest gain
        limit = hc.theory.gain_limit(hc.theory.Loop.of(x.subject, "x", 0.0))
        assert n["least mass in free motion [kg]"] == pytest.approx(
            1.0 / limit if limit else np.inf
        )
        assert 0.0 < n["change of position at half the step [m]"] < 1e-6
        assert n["gain limit, worst hand [1/kg]"] <= n["gain limit, as sampled [1/kg]"] * (1 + 1e-9)


def test_numbers_of_walls_are_the_closed_forms(walls):
    for x, (K, b, Ts) in zip(walls[-1], ((500.0, 1.0, 1e-3), (300.0, 2.0, 2e-3)), strict=True):
        assert x.numbers["passive K, at most [N/m]"] == pytest.approx(2.0 * b / Ts)
        assert x.numbers["passivity margin [N.s/m]"] == pytest.approx(b - 0.5 * K * Ts)
        assert x.numbers["stable K, at most [N/m]"] >= 2.0 * b / Ts
        assert x.region.gap() < 3e-3  # runs against eigenvalues, as docs/zwidth.md says
        assert x.numbers["Z-width by runs: largest K [N/m]"] == max(x.region.K)
        assert 20.0 < x.numbers["dynamic range, mean [dB]"] < 100.0
        # at 1 Hz a wall is its spring and damper, but for device and hold: K of 1 %
        assert x.numbers["effective stiffness at 1 Hz [N/m]"] == pytest.approx(K, rel=0.03)
        # a passive hand cannot make a passive wall unstable
        assert x.numbers["stable K, worst hand [N/m]"] >= 2.0 * b / Ts * (1.0 - 1e-6)


def test_only_fields_that_differ_are_told(controllers, walls):
    fields = comparison.differing_fields(controllers[-1])
    layers = [[0.0, 90.0, 0.0], [0.0, 60.0, 0.0], [0.0, 90.0, 0.0]]
    gains = [[1.0, 0.5], [2.0, 0.5], [30.0, 0.5]]
    assert fields == {"gain": gains, "clay.x.values": layers, "clay.y.values": layers}
    told = comparison.differing_fields(walls[-1])
    assert told == {"K": [500.0, 300.0], "device.damper": [1.0, 2.0], "Ts": [1e-3, 2e-3]}


class Page(HTMLParser):
    """Ids, tags and what they point to."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.tags = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            self.ids += [value] * (name == "id")
            self.links += [value] * (name in ("src", "href", "xlink:href"))


@pytest.mark.parametrize("kind", ["controllers", "walls"])
def test_the_page_needs_no_other_file(kind, request):
    out, _, found = request.getfixturevalue(kind)
    text = (out / "compare.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.tags.count("svg") == {"controllers": 6, "walls": 5}[kind]
    assert all(link.startswith("#") for link in page.links)
    assert len(page.ids) == len(set(page.ids))
    assert {link[1:] for link in page.links} <= set(page.ids)
    assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)
    assert "prefers-color-scheme: dark" in text and "@page" in text
    for x in found:
        assert text.count(x.name) >= 3


def test_what_no_file_renders_has_no_panel(controllers):
    """Of the three, the largest gain alone renders a stiffness."""
    found = controllers[-1]
    few = parts_overlay(replace(found, files=found.files[:2]))
    assert [len(x.axes) for x in (few, parts_overlay(found))] == [2, 3]


def test_an_inline_picture_takes_the_colours_of_the_page():
    text = '<?xml?><svg><g id="a" style="fill: #222222"/><use href="#a"/></svg>'
    assert inline_svg(text, "p") == (
        '<svg><g id="p-a" style="fill: var(--ink)"/><use href="#p-a"/></svg>'
    )
    assert all(re.fullmatch("#[0-9a-f]{6}", color) for color in SVG_COLORS)


def test_the_command_writes_page_numbers_and_figures(walls):
    out, said, _ = walls
    names = {p.name for p in out.iterdir()}
    assert {"compare.html", "compare.json", "zwidth.svg", "zwidth.csv"} <= names
    data = json.loads((out / "compare.json").read_text())
    assert data["files"]["near"]["stiffness K [N/m]"] == 500.0
    assert "near" in said


def test_what_does_not_compare_is_refused(tmp_path):
    scene, wall = files(tmp_path, {"a": SCENES["printed"], "b": WALLS["near"]})
    with pytest.raises(ParameterError, match="all scenarios or all walls"):
        comparison.compare_files([scene, wall])
    with pytest.raises(ParameterError, match="2 to 5"):
        comparison.compare_files([wall])
    with pytest.raises(ParameterError, match="is named twice"):
        comparison.compare_files([wall, tmp_path / "." / wall.name])


@pytest.mark.parametrize(
    "words, told",
    [
        ("", "2 to 5 files"),
        ("a.toml", "2 to 5 files"),
        ("a.toml a.toml", "one is named twice"),
        ("a.toml none.toml", "scenario = 'none.toml': must be a file that can be read"),
        ("a.toml wall.toml", "all scenarios or all walls"),
    ],
)
def test_the_command_refuses_in_one_line(words, told, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files(tmp_path, {"a": SCENES["printed"], "wall": WALLS["near"]})
    assert app.main(["compare", *words.split(), "--out", "o"]) == 2
    err = capsys.readouterr().err
    assert told in err and err.count("\n") == 1


def test_what_is_unstable_is_shown_as_such(controllers):
    _, said, _ = controllers
    rows = {line[:38].strip(): line[38:].split() for line in said.splitlines()}
    assert rows["phase margin [degrees]"][2] == "-" and "diverged" in said


def test_the_run_changes_with_the_square_of_the_step():
    """Second order: a quarter at half the step; half the tolerance for the next order."""
    scene = hc.constant_cut(t_max=0.3)
    errors = [comparison.run_and_error(hc.with_fields(scene, {"dt": dt}))[1] for dt in (4e-4, 2e-4)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
