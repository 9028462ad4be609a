"""Borders of renderable parts found by runs against the exact ones."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.studies import mbk, wall_runs
from hapticclay.studies.boundary import PushedLoop
from hapticclay.views import impedance_plots

WALL = hc.VirtualWall(1000.0, 2.0, device=hc.Device(0.1, 0.5))
CLOSE = 4e-3  # the brackets of the search, 2e-3, about the growth that a run of 0.8 s tells


@pytest.mark.parametrize(
    "plane, x",
    [
        ("mass-damper", -0.06),  # both borders
        ("mass-damper", 0.11),
        ("mass-stiffness", 0.109),  # where a run fades at once below the border
        ("damper-stiffness", 180.0),
    ],
)
def test_runs_stop_being_stable_where_theory_says(plane, x):
    found = mbk.wall_borders(WALL, plane, x)
    assert [b.end for b in found] == (["high", "low"] if x == -0.06 else ["high"])
    for b in found:
        assert b.y == pytest.approx(b.exact, rel=CLOSE)


def test_growth_of_a_pushed_device():
    limit = hc.walls.stiffness_band(WALL)[1]
    below, above = wall_runs.growth_rates([replace(WALL, K=x * limit) for x in (0.99, 1.01)])
    assert below < 0.0 < above
    assert wall_runs.growth_rates([replace(WALL, B=80.0)])[0] < -10.0  # faded to rounding


def test_least_mass_of_the_arm_by_runs():
    loop = PushedLoop(b=0.0, operator=hc.Operator(), Ts=1e-3)
    found = mbk.arm_mbk(loop, columns=2, points=3, samples=0)
    assert len(found.found) == 2 and found.gap < CLOSE
    assert np.all(found.worst[0] > found.nominal[0])
    figure = impedance_plots.least_mass_plot(found)
    assert len(figure.axes[0].lines) == 3
    assert found.tables()["runs"]["least M [kg]"] == [x.y for x in found.found]


def test_a_device_without_runs():
    wall = replace(WALL, device=hc.Device(0.1, 0.5, 0.1, 1e-5), unilateral=True)
    found = mbk.device_mbk(wall, columns=0, points=7)
    assert math.isnan(found.gap) and found.wall.device.friction == 0.0
    assert len(impedance_plots.mbk_plot(found).axes) == 3
    assert len(impedance_plots.dynamic_range_plot(found).axes) == 1
    for table in found.tables().values():
        assert len({len(x) for x in table.values()}) == 1


def test_what_is_no_wall_is_refused():
    with pytest.raises(ParameterError, match="VirtualWall"):
        mbk.device_mbk(hc.Device())  # type: ignore[arg-type]


def test_the_command_prints_and_writes(tmp_path, capsys):
    words = ["mbk", "--quick", "--columns", "1", "--dpi", "50", "--out", str(tmp_path)]
    assert app.main(words) == 0
    assert "dynamic range" in capsys.readouterr().out
    assert json.loads((tmp_path / "mbk.json").read_text())["gap"] < CLOSE
    assert app.main([*words, "--arm", "x", "--Ts", "1e-3"]) == 0
    assert "hand box: least M" in capsys.readouterr().out
    names = {f.name for f in tmp_path.iterdir()}
    assert {"mbk.json", "mbk.png", "range.png", "mass.png"} <= names


@pytest.mark.parametrize(
    "words, told",
    [
        (["--box", "0", "1", "0", "1", "0", "1"], "give --arm too"),
        (["--arm", "x", "--K", "3"], "leave it out with --arm"),
        (["--mass", "-1"], "device.mass"),
        (["--columns", "0"], "columns"),
        (["--quick", "--columns", "101"], "columns"),
    ],
)
def test_the_command_refuses(words, told, tmp_path, capsys):
    assert app.main(["mbk", *words, "--out", str(tmp_path)]) == 2
    assert told in capsys.readouterr().err
