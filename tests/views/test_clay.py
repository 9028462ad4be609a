"""Clay of any kind is drawn, measured and described as it is."""

import dataclasses
import re
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from matplotlib.text import Text

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.studies.removal import removed
from hapticclay.views import run_figures, run_plots, stage
from hapticclay.views.palette import clay_color

DOCS = Path(__file__).parents[2] / "docs"


def grid(values, edges=(0.05, 0.1, 0.15), across=(-0.05, 0.0, 0.05)):
    return hc.Grid(edges, across, np.pad(np.asarray(values, float), 1))


def cut(law, angle=0.0, **more):
    s = hc.constant_cut(**{"t_max": 2.0, "dt": 1e-3, **more})
    return hc.simulate(dataclasses.replace(s, clay=hc.Clay(law, law, angle)))


@pytest.mark.parametrize("kind", ["gray", "color", "alpha", "deep"])
def test_an_image_is_read_as_it_looks(tmp_path, kind):
    """Black, white, and colours by their brightness (ITU-R BT.601)."""
    colors = np.array([[[0, 0, 0], [255, 255, 255]], [[255, 0, 0], [0, 255, 0]]], np.uint8)
    luma = np.array([[0.0, 1.0], [0.299, 0.587]])
    image = {
        "gray": np.round(255 * luma).astype(np.uint8),
        "color": colors,
        "alpha": np.concatenate((colors, np.full((2, 2, 1), 9, np.uint8)), axis=2),
        "deep": np.round(65535 * luma).astype(np.uint16),
    }[kind]
    iio.imwrite(tmp_path / "clay.png", image)
    gray = hc.gray_image(tmp_path / "clay.png")
    np.testing.assert_allclose(gray, luma, atol=0.5 / 255)
    law = hc.Grid.of_image(gray, (0.0, 0.1), (0.0, 0.1), (0.0, 100.0))
    assert law.within((0.01, 0.09), (0.02, 0.09)) == [0.0]  # black lies top left
    assert law.within((0.09, 0.09), (0.09, 0.09)) == [pytest.approx(100.0)]


def test_what_is_no_image_is_refused(tmp_path):
    (tmp_path / "clay.png").write_text("no picture")
    for path in (tmp_path / "clay.png", tmp_path / "none.png", tmp_path):
        with pytest.raises(ParameterError, match="image = .*: must be an image file"):
            hc.gray_image(path)


def test_removed_volume_of_cells():
    """The block is the slab's; in a chequerboard, the tool along its middle meets half of it."""
    s = hc.constant_cut(b=90.0, t_max=2.0)
    path = np.column_stack((np.linspace(0.0, 0.2, 2000), np.zeros(2000)))
    like = dataclasses.replace(
        hc.simulate(s), t=0.36e-3 * np.arange(2000), p=path, v=np.zeros((2000, 2))
    )

    def volume(law):
        clay = dataclasses.replace(s, clay=hc.Clay(law, law))
        return removed(dataclasses.replace(like, scenario=clay))[0][-1]

    whole = volume(hc.Profile((0.05, 0.15), (0.0, 90.0, 0.0)))
    assert volume(grid([[9.0, 9.0], [9.0, 9.0]])) == pytest.approx(whole, rel=1e-9)
    assert volume(grid([[9.0, 0.0], [0.0, 9.0]])) == pytest.approx(0.5 * whole, rel=3e-3)
    assert whole == pytest.approx(0.1 * 0.02 * 0.01, rel=3e-3)  # length, width and depth


FINE = np.random.default_rng(2).uniform(10.0, 90.0, (40, 30))
LAWS = {
    "cells": grid([[90.0, 30.0], [0.0, 60.0]]),
    "fine": hc.Grid(np.linspace(0.02, 0.15, 41), np.linspace(-0.05, 0.05, 31), np.pad(FINE, 1)),
    "smooth": hc.Smooth((0.02, 0.15), (-0.05, 0.05), FINE),
}


@pytest.mark.parametrize(
    "name, angle", [("cells", 0.0), ("cells", 0.4), ("fine", 0.0), ("smooth", 0.4)]
)
def test_any_clay_is_drawn(name, angle):
    record = cut(LAWS[name], angle, force=(1.0, 0.3), t_max=1.2)
    assert record.b[-1, 0] > 0.0  # in the clay
    drawn = run_figures.figures(record)
    assert set(drawn) == {"velocity", "path"}
    told = " ".join(x.get_text() for x in drawn["path"].findobj(Text))
    assert ("axes rotated by 22.92 degrees" in told) == bool(angle)


def test_a_velocity_plot_shades_the_cells_that_the_path_met():
    record = cut(grid([[90.0, 20.0], [30.0, 20.0]]), force=(1.0, -0.05))
    figure = run_plots.velocity_plot(record, "x")
    spans = [p for p in figure.axes[0].patches if p.get_x() > 0.0]
    assert spans[0].get_x() == pytest.approx(5.0, abs=0.01)
    assert figure.axes[0].lines[0].get_label() == "measured"


def test_the_stage_shades_each_cell_by_its_damping():
    record = cut(grid([[90.0, 30.0], [0.0, 60.0]]))
    shown = stage.Stage(record.scenario)
    colors, block = shown._colors()[::-1], shown.removal
    for x, y, b in ((0.07, -0.02, 90.0), (0.07, 0.02, 30.0), (0.12, 0.02, 60.0)):
        here = (np.abs(block.x - x) < 0.01)[None, :] & (np.abs(block.y - y) < 0.01)[:, None]
        mean = colors[here].mean(axis=0)
        np.testing.assert_allclose(mean, 255.0 * clay_color(b / 90.0), rtol=0.01)
    assert np.all(block.clay[np.ix_(block.y < -0.01, block.x > 0.11)] == 0.0)  # no clay
    assert np.all(block.clay[np.ix_(block.y > 0.01, block.x < 0.09)] == 1.0)


def test_smooth_clay_is_measured_and_shaded_by_the_place():
    """No clay beyond the knots; the volume of clay that is everywhere is that of the path."""
    law = hc.Smooth((0.0, 0.15), (-0.15, 0.15), np.pad([[60.0, 30.0]] * 2, 1))
    record = cut(law, force=(1.0, 0.3))
    assert record.regions()[0]["x"]["expected_speed"] is None and len(record.regions()) == 1
    shown = stage.Stage(record.scenario)
    block = shown.removal
    np.testing.assert_allclose((block.x[0], block.x[-1]), (-0.05, 0.2), atol=2e-3)
    assert block.clay.min() == 1.0
    colors = shown._colors()[::-1]
    for x, y in ((0.05, -0.05), (0.1, 0.05)):  # grain of 3 % over 64 places
        here = (np.abs(block.x - x) < 8e-3)[None, :] & (np.abs(block.y - y) < 8e-3)[:, None]
        want = 255.0 * clay_color(float(law.at(x, y)) / 60.0)
        np.testing.assert_allclose(colors[here].mean(axis=0), want, rtol=0.02)
    spans = run_plots.velocity_plot(record, "x").axes[0].patches
    assert 50 < len(spans) <= 101
    even = cut(hc.Smooth((0.0, 0.1), (0.0, 0.1), [[40.0, 40.0]] * 2))
    layer = cut(hc.Profile((), (40.0,)))
    assert removed(even)[0][-1] == pytest.approx(removed(layer)[0][-1], rel=1e-9)
    assert removed(even)[0][-1] > 0.0


def test_smooth_clay_in_files_sweeps_and_sessions(tmp_path):
    law = hc.Smooth((0.0, 0.1), (0.0, 0.1), [[1.0 / 3.0, 2.0], [3.0, 9e2]])
    record = cut(law, 0.3)
    record.save(tmp_path)
    assert hc.Record.load(tmp_path).scenario == record.scenario
    record.scenario.save(tmp_path / "clay.toml")
    text = (tmp_path / "clay.toml").read_text()
    assert 'kind = "smooth"' in text and hc.Scenario.load(tmp_path / "clay.toml") == record.scenario
    (tmp_path / "clay.toml").write_text(text.replace("values =", "growth = [[1.0]]\nvalues ="))
    with pytest.raises(ParameterError, match="clay.x.growth"):
        hc.Scenario.load(tmp_path / "clay.toml")
    moved = hc.with_fields(record.scenario, {"clay.x.x": (0.0, 0.2)})
    assert moved.clay.x.x == (0.0, 0.2)
    assert record.scenario.clay.scaled(2.0).y.values == ((2.0 / 3.0, 4.0), (6.0, 1800.0))


def test_a_session_scales_a_grid_and_keeps_the_rest():
    law = hc.Grid((0.0,), (0.1,), [[1.0, 2.0], [3.0, 9e8]], [[0.0, 1.0], [2.0, 3.0]])
    scaled = hc.Clay(law, hc.Profile((), (5.0,)), 0.3).scaled(2.0)
    assert scaled.x.values == ((2.0, 4.0), (6.0, 1e9)) and scaled.angle == 0.3
    assert scaled.x.growth == ((0.0, 2.0), (4.0, 6.0)) and scaled.y.values == (10.0,)


def test_records_and_scenario_files_keep_clay_to_the_last_bit(tmp_path):
    record = cut(
        hc.Grid((0.05,), (0.01,), [[1.0 / 3.0, 2.0], [3.0, 4.0]], [[0.0, 1.0], [0.1, 0]]), 0.3
    )
    record.save(tmp_path)
    assert hc.Record.load(tmp_path).scenario == record.scenario
    record.scenario.save(tmp_path / "clay.toml")
    assert hc.Scenario.load(tmp_path / "clay.toml") == record.scenario


PAGES = "".join((DOCS / f"{name}.md").read_text() for name in ("clay", "yielding", "springs"))
BLOCKS = re.findall(r"```python\n(.*?)```", PAGES, re.S)
PRINTED = ("finished at", "finished at", "0.0856", "4.9999")


@pytest.mark.parametrize("block,said", list(zip(BLOCKS, PRINTED, strict=True)))
def test_the_example_runs(block, said, capsys):
    assert len([line for line in block.splitlines() if line]) <= 10
    exec(compile(block, str(DOCS), "exec"), {})  # noqa: S102
    assert capsys.readouterr().out.startswith(said)
