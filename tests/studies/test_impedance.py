"""Impedance measured by runs against the computed one, and what is refused."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.studies.boundary import PushedLoop
from hapticclay.studies.impedance import computed_impedance, measure_impedance
from hapticclay.views import impedance_plots

TH = hc.Operator()
DEVICE = hc.Device(0.1, 0.5)
# The engine's steps of 0.1 ms cost (omega dt)^2/6 = 6e-5 at 30 Hz, the arm's pose 4e-5 of 1e-5 m,
# what is left of the slow mode of a hand (its damper over its spring) 3e-5.
CLOSE = 3e-4


@pytest.mark.parametrize(
    "parts, operator",
    [
        (dict(), TH),
        (dict(Ts=1e-3), None),
        (dict(Ts=1e-3, delay=1.5e-3, b=40.0, k=200.0), TH),
        (dict(Ts=1e-3, delay=1.5e-3, b=40.0, k=200.0), None),
        (dict(Ts=1e-3, render="physical", axis="y", K=0.5), TH),
    ],
    ids=["continuous-held", "sampled-free", "late-held", "late-free", "physical-held"],
)
def test_the_arm_feels_as_computed(parts, operator):
    found = measure_impedance(PushedLoop(operator=operator, **parts), lines=12, period=2.0)
    assert found.measured.frequency[[0, -1]] == pytest.approx([0.5, 30.0])
    assert found.gap < CLOSE
    assert found.felt_gap < CLOSE
    assert found.deviation.max() < 1e-4


@pytest.mark.parametrize(
    "wall",
    [
        hc.VirtualWall(300.0, 2.0, device=DEVICE),
        hc.VirtualWall(
            2000.0, 3.0, 0.05, DEVICE, TH, delay=1e-3, velocity_window=3, velocity_filter=90.0
        ),
        hc.VirtualWall(100.0, 1.0, -0.02, DEVICE, Ts=4e-3, velocity="exact"),
    ],
)
def test_a_wall_feels_as_computed(wall):
    found = measure_impedance(wall, lines=12, period=2.0)
    assert found.gap < CLOSE
    assert found.felt_gap < CLOSE


def test_the_gap_is_that_of_the_engines_steps():
    """A hold of 4 ms in steps of 0.1 ms: within 1e-3 where the hold itself costs 10 %."""
    wall = hc.VirtualWall(300.0, 2.0, device=DEVICE, Ts=4e-3)
    found = measure_impedance(wall, lines=6, period=2.0)
    slow = replace(wall, Ts=1e-5)
    ideal = found.over(found.measured.frequency).Z
    other = measure_impedance(wall, lines=6, period=2.0, seed=1)
    np.testing.assert_allclose(found.measured.Z, other.measured.Z, rtol=CLOSE)
    gap = np.abs(computed_impedance(slow, found.measured.omega).Z / ideal - 1.0).max()
    assert gap > 0.05 > found.gap


def test_friction_is_measured_and_noted():
    """Friction of 4 fc/(pi v) (describing function) adds damping; theory leaves it out."""
    rough = hc.VirtualWall(300.0, 2.0, device=hc.Device(0.1, 0.5, friction=0.002), operator=TH)
    found = measure_impedance(rough, lines=6, period=2.0, amplitude=1e-3)
    assert 1e-4 < found.gap < 0.1 and "friction" in found.notes[0]
    assert np.all(found.measured.damping > found.computed.damping - 1e-3)


@pytest.mark.parametrize(
    "subject, message",
    [
        (PushedLoop(operator=TH, K=6.0), "K = 6.0: must be stable with this hand"),
        (hc.VirtualWall(3e4, 2.0, device=DEVICE), "wall.K = 30000.0: must leave the wall stable"),
        (hc.VirtualWall(300.0, 2.0, device=DEVICE, unilateral=True), "must be False"),
        (hc.Device(), "must be a PushedLoop or a VirtualWall"),
    ],
)
def test_what_has_no_steady_response_is_refused(subject, message):
    with pytest.raises(ParameterError) as error:
        measure_impedance(subject)
    assert message in str(error.value)


def test_a_run_that_meets_the_limits_of_the_motors_is_refused():
    loop = PushedLoop(operator=TH, torque_limit=(1e-4, 1e-4))
    with pytest.raises(ParameterError, match="amplitude"):
        measure_impedance(loop, lines=3, period=2.0)


def test_what_has_not_settled_is_refused():
    wall = hc.VirtualWall(300.0, 0.2, device=hc.Device(0.1, 1e-3))  # rings for 100 s
    with pytest.raises(ParameterError, match="must settle"):
        measure_impedance(wall, lines=3, period=0.2, band=(5.0, 30.0))


def test_the_loop_of_a_scenario():
    scenario = hc.constant_cut()
    found = PushedLoop.of(scenario, "y", 50.0)
    assert (found.axis, found.b, found.K) == ("y", 50.0, scenario.gain[1])
    assert found.linear == replace(found.linear, b=50.0)
    late = replace(scenario, control="sampled", hardware=hc.Hardware(delay=1e-3))
    assert PushedLoop.of(late).delay == 1e-3
    rough = replace(late, hardware=hc.Hardware(encoder=1000))
    with pytest.raises(ParameterError, match="no hardware but a delay"):
        PushedLoop.of(rough)


def test_figures_and_tables_of_a_wall_and_of_the_arm():
    for subject in (hc.VirtualWall(300.0, 2.0, device=DEVICE), PushedLoop(Ts=1e-3)):
        found = measure_impedance(subject, lines=5, period=2.0)
        figure = impedance_plots.impedance_plot(found)
        labels = {ax.get_ylabel().split(" [")[0] for ax in figure.axes}
        assert "damping" in labels and len(labels) >= 2
        bode = impedance_plots.transparency_bode_plot(found)
        assert [ax.get_ylabel() for ax in bode.axes] == ["magnitude", "phase [degrees]"]
        tables = found.tables()
        assert {len(x) for t in tables.values() for x in t.values()} == {5}
        assert all(name.endswith("]") or name in ("|fe/fh|", "|Z/Ze|", "deviation", "off theory")
                   for t in tables.values() for name in t)  # fmt: skip


def test_the_command_prints_and_writes(tmp_path, capsys):
    words = ["impedance", "--K", "300", "--B", "2", "--damper", "0.5", "--Ts", "1ms"]
    words += ["--dpi", "50"]
    assert app.main([*words, "--lines", "5", "--out", str(tmp_path), "--data"]) == 0
    out = capsys.readouterr().out
    assert "effective stiffness" in out and "measured against computed: Z within 0.00" in out
    data = json.loads((tmp_path / "impedance.json").read_text())
    assert data["gap"] < CLOSE and data["subject"]["device"]["mass"] == 0.1
    names = {f.name for f in tmp_path.iterdir()}
    assert {"impedance.png", "transparency.png", "impedance.csv", "transparency.csv"} <= names


@pytest.mark.parametrize(
    "words, told",
    [
        (["constant", "--K", "300"], "leave it out beside"),
        (["--K", "soft"], "K"),
        (["--K", "300", "--axis", "y"], "leave it out with a wall"),
        (["constnat"], "did you mean 'constant'"),
        (["constant", "--b", "-1"], "b = -1.0"),
        (["constant", "--band", "0", "3"], "band"),
    ],
)
def test_the_command_refuses(words, told, tmp_path, capsys):
    assert app.main(["impedance", *words, "--out", str(tmp_path)]) == 2
    assert told in capsys.readouterr().err


def test_nothing_rendered_has_no_ratio():
    found = measure_impedance(hc.VirtualWall(device=DEVICE), lines=3, period=2.0)
    assert math.isnan(found.felt_gap) and np.all(np.isnan(found.measured.ratio))
    assert found.gap < CLOSE
    impedance_plots.transparency_bode_plot(found)


def test_a_scenario_is_a_subject_of_every_study_of_a_loop():
    cut = replace(hc.constant_cut(b=30.0, inertia_shaping=True), operator=TH)
    kw = dict(band=(2.0, 8.0), lines=4, period=1.0)
    a, b = measure_impedance(cut, "y", **kw), measure_impedance(PushedLoop.of(cut, "y"), **kw)
    assert np.array_equal(a.measured.Z, b.measured.Z) and a.subject == b.subject
    sampled = replace(cut, control="sampled", dt=1e-3)
    a, b = (
        hc.walls.arm_mbk(x, columns=0, points=3, samples=0)
        for x in (sampled, PushedLoop.of(sampled, "x"))
    )
    assert np.array_equal(a.nominal, b.nominal) and a.loop == b.loop
    with pytest.raises(hc.ParameterError, match="axis = 'z'"):
        measure_impedance(cut, "z")
    with pytest.raises(hc.ParameterError, match="is needed: the walls are rendered at samples"):
        hc.walls.zwidth(cut)
