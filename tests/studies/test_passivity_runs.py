"""Passivity figures: the runs against closed forms, and what the figures draw."""

import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.studies import passivity_runs as study
from hapticclay.views import passivity_plots as plots

WALL = hc.VirtualWall(K=1000.0, device=hc.Device(0.1, 1.0), Ts=1e-3)
STIFF = replace(
    hc.constant_cut(control="sampled", b=8000.0, start=(0.06, 0.0), gain=(1.0, 0.1), t_max=0.012),
    stop_when_unstable=False,
)


@pytest.fixture(scope="module")
def index():
    return study.wall_index(WALL)


@pytest.fixture(scope="module")
def energy():
    return study.energy_over_time(STIFF)


@pytest.fixture(scope="module")
def region():
    return study.passive_region(WALL, (0.0, 1.0), (1e-3,))


def test_a_spring_leaves_b_less_half_k_ts_by_theory_and_by_runs(index):
    """Colgate, Schenkel: b - K Ts/2 at every frequency; the paths of runs to 1e-5, of 64 steps."""
    spare = WALL.device.damper - 0.5 * WALL.K * WALL.Ts
    np.testing.assert_allclose(index.index, spare, rtol=1e-9)
    np.testing.assert_allclose(index.worst, spare, rtol=1e-4)
    assert index.margin == pytest.approx(spare)


def test_sines_find_the_real_part_of_the_impedance(index):
    """To 1 %: near half the sampling frequency the steps of the engine are (omega dt)^2/6 off."""
    expected = hc.walls.wall_impedance(WALL, index.measured_omega).real
    np.testing.assert_allclose(index.measured, expected, rtol=0.01)
    assert (index.damping >= index.index - 1e-9).all()  # one sine is never the worst hand


def test_late_damped_walls_too():
    """A delay of half a sample: the damper is lowered until its worst path takes nothing."""
    wall = replace(WALL, K=500.0, B=0.2, delay=0.5e-3)
    found = study.wall_index(wall)
    edge = found.worst_omega * (1.0 - 1e-12)
    np.testing.assert_allclose(found.worst, hc.walls.passivity_index(wall, edge), rtol=0.01)


def test_arm_is_passive_on_x_and_active_on_y():
    for axis, K, sign in (("x", 1.0, 1.0), ("y", 0.5, -1.0)):
        found = study.arm_index(hc.constant_cut(), axis)
        exact = hc.theory.passivity(axis, K, 90.0).margin
        assert found.margin == pytest.approx(exact, rel=2e-3) and np.sign(exact) == sign
        near = np.interp(found.measured_omega, found.omega, found.damping)
        # large slopes between the points of the line, and 1 % of the largest
        np.testing.assert_allclose(found.measured, near, atol=0.01 * np.abs(near).max())


def test_the_controller_keeps_rendered_clay_from_giving_energy(energy):
    wild, tame = energy.observed
    assert wild.min() < -1e-4 and tame.min() >= -1e-12 * tame.max()
    record = energy.controlled
    assert record.energy["passivity_controller"] < 0.0
    table = energy.tables()["controlled"]
    np.testing.assert_array_equal(table["energy taken by the clay [J]"], tame)


def test_region_is_that_of_the_closed_form(region):
    """2 b/(Ts (1 + 2 d)) with a delay of d samples; runs within 0.5 %, their paths being few."""
    for delay, limits, found in zip(region.delays, region.limits, region.found, strict=True):
        closed = 2.0 * WALL.device.damper / (region.Ts * (1.0 + 2.0 * delay))
        np.testing.assert_allclose(limits, closed, rtol=1e-6)
        assert found[0] == pytest.approx(2000.0 / (1.0 + 2.0 * delay), rel=5e-3)
        assert found[0] >= 0.999 * limits[np.argmin(np.abs(region.Ts - 1e-3))]


def test_figures_show_runs_beside_theory(index, energy, region):
    ax = plots.index_plot(index).axes[0]
    labels = ax.get_legend_handles_labels()[1]
    assert "index (Colgate, Schenkel 1997)" in labels and "runs: worst path of a hand" in labels
    assert "[Hz]" in ax.get_xlabel() and "N·s/m" in ax.get_ylabel()
    assert "passive" in ax.get_title(loc="left")
    top, low = plots.port_energy_plot(energy).axes
    assert len(top.lines) == 3 and "[ms]" in low.get_xlabel()
    assert len(plots.region_plot(region).axes[0].lines) == 4


def test_the_active_half_is_shaded_where_there_is_one(index):
    """A passive wall needs no half plane."""
    for lower, shaded in ((0.0, False), (5.0, True)):
        ax = plots.index_plot(replace(index, index=index.index - lower)).axes[0]
        assert ("active" in ax.get_legend_handles_labels()[1]) == shaded
        assert ax.get_ylim()[0] < 0.0


@pytest.mark.parametrize("wrong,field", [
    (dict(unilateral=True), "wall.unilateral"), (dict(velocity="exact", B=1.0), "wall.velocity"),
])  # fmt: skip
def test_walls_without_an_index_are_refused(wrong, field):
    with pytest.raises(ParameterError) as told:
        study.wall_index(replace(WALL, **wrong))
    assert told.value.field == field


def test_continuous_runs_have_no_controller():
    with pytest.raises(ParameterError, match="sampled"):
        study.energy_over_time(hc.constant_cut())
    with pytest.raises(ParameterError, match="delays"):
        study.passive_region(WALL, (math.nan,))


def test_the_command_writes_all_figures(tmp_path, capsys, monkeypatch):
    few = {"INDEX_TURNS": ((1, 4), (1, 1)), "INDEX_POINTS": 50, "REGION_POINTS": 5}
    for name, value in {**few, "INDEX_LINES": 3, "ARM_BAND": (3.0, 30.0)}.items():
        monkeypatch.setattr(study, name, value)
    words = ["passivity", "--quick", "--delays", "0", "--K", "800", "--damper", "1.5",
             "--delay", "0", "--format", "svg", "--data", "--out", str(tmp_path)]  # fmt: skip
    assert app.main(words) == 0
    names = {p.stem for p in tmp_path.glob("*.svg")}
    assert names == {"index", "arm_x", "arm_y", "energy", "region"}
    assert (tmp_path / "passivity.json").exists() and (tmp_path / "index.csv").exists()
    told = capsys.readouterr().out
    assert "1.1" in told and "3000" in told  # b - K Ts/2, 2 b/Ts
    assert app.main(["passivity", "--dampr", "2", "--out", str(tmp_path)]) == 2
    assert "damper" in capsys.readouterr().err
