"""Files and records written by release 0.2.0 are read, under the names of now."""

from pathlib import Path

import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.scene.earlier_names import with_present_names
from hapticclay.studies.sweep import Sweep, load_sweep

FILES = Path(__file__).parent.parent / "release_0_2"
SPRINGS = (hc.Spring(), hc.Spring(k=1e4, limit=3.0, unilateral=True), hc.Spring())
SCENE = hc.Scenario(
    name="of 0.2",
    clay=hc.Clay(
        hc.Profile((0.001, 0.15), (0.0, 20.0, 0.0), springs=SPRINGS), hc.Profile((), (0.0,))
    ),
    control="sampled",
    Ts=1.08e-3,
    dt=3.6e-4,
    inertia_shaping=True,
    stop_when_unstable=False,
    force=(40.0, 1.0),
    operator=hc.Operator(0.5),
    t_max=0.02,
    hardware=hc.Hardware(
        jitter=2e-5, dropout_probability=0.1, encoder=4096, velocity="difference",
        velocity_window=3, delay=1e-4, seed=4,
    ),
)  # fmt: skip


def test_a_scenario_file_of_0_2():
    assert hc.Scenario.load(FILES / "scenario.toml") == SCENE
    s = hc.Scenario.load(FILES / "physical.json")
    assert (s.render, s.inertia_shaping, s.stop_when_unstable) == ("physical", True, False)


def test_a_record_of_0_2():
    r = hc.Record.load(FILES)
    assert r.scenario == SCENE and r.energy["springs_dissipated"] > 0.0
    assert "springs_lost" not in r.energy and r.versions["hapticclay"].startswith("0.2")
    again = hc.simulate(r.scenario, every=4)
    assert abs(again.p - r.p).max() < 1e-12  # [m] as asked of a rebuilt step, see CONTRIBUTING.md


def test_a_wall_of_0_2(tmp_path):
    wall = hc.VirtualWall(
        K=300.0, B=2.0, device=hc.Device(0.1, 2.0), velocity="difference", velocity_window=3,
        unilateral=True, delay=1e-3,
    )  # fmt: skip
    assert hc.VirtualWall.load(FILES / "wall.toml") == wall
    assert hc.VirtualWall.load(wall.save(tmp_path / "w.toml")) == wall


def test_a_sweep_and_a_flag_of_0_2(tmp_path):
    spec = tmp_path / "spec.toml"
    spec.write_text(
        'experiment = "constant"\n[vary]\n"operator.mass" = [0.5, 1.0]\n'
        "[fixed]\nimpedance = true\nshaping = true\n"
    )
    s = Sweep(**load_sweep(spec))
    found = s.run_scenario(s.points(0, 1)[0])
    assert found.operator == hc.Operator(0.5) and found.inertia_shaping
    data = {"impedance": True, "operator": {"mass": 0.5}, "experiment": "constant"}
    assert hc.Scenario.of(with_present_names(data)).operator == hc.Operator(0.5)
    with pytest.raises(ParameterError, match="shaping.* must not stand beside inertia_shaping"):
        with_present_names({"inertia_shaping": True, "shaping": True})
