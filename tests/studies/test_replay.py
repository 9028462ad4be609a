"""Recordings that drive the arm: a run's own record drives it to the same motion again."""

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli.app import main
from hapticclay.studies import comparison
from hapticclay.views import compare_plots


@pytest.fixture(scope="module")
def made():
    """A run with a hand, and its record as a recording."""
    push = hc.Multisine((2.0, 1.0), low=0.3, high=3.0, period=4.0, lines=8, seed=3)
    scenario = hc.Scenario(
        clay=hc.slab(60.0), muscle=push, force=(0.0, 0.0), operator=hc.Operator(),
        length=None, t_max=4.0, dt=1e-3,
    )  # fmt: skip
    record = hc.simulate(scenario)
    assert record.outcome.code == "time limit"
    return scenario, hc.studies.Recording(record.t + 7.0, record.p, record.fh, "made")


def test_a_recorded_force_moves_the_arm_again(made):
    """The force at the handle is all that the hand is.

    The record has it at whole samples, and the muscle is the line through them.
    """
    scenario, recording = made
    found = hc.studies.replay(scenario, recording)
    assert found.off < 1e-2 * float(np.std(recording.p))
    assert found.force_off < 1e-3 * float(np.std(recording.f))


def test_the_error_of_a_recorded_force_falls_with_its_step():
    """Half the step leaves less than a half, first order at the least."""
    off = []
    for dt in (2e-3, 1e-3, 5e-4):
        push = hc.Multisine((2.0, 1.0), low=0.3, high=3.0, period=4.0, lines=8, seed=3)
        scenario = hc.Scenario(muscle=push, force=(0.0, 0.0), length=None, t_max=2.0, dt=dt)
        record = hc.simulate(scenario)
        recording = hc.studies.Recording(record.t, record.p, record.fh)
        off.append(hc.studies.replay(scenario, recording).off)
    assert off[1] < 0.55 * off[0] and off[2] < 0.55 * off[1]


def test_a_motion_with_its_force_is_followed(made):
    scenario, recording = made
    found = hc.studies.replay(scenario, recording, "motion")
    assert found.off < 1e-2 * float(np.std(recording.p))
    assert found.force_off < 1e-2 * float(np.std(recording.f))


def test_a_motion_alone_is_followed_within_the_give_of_the_spring(made):
    scenario, recording = made
    alone = hc.studies.Recording(recording.t, recording.p)
    grip = hc.Operator(mass=0.0, damper=20.0, spring=300.0)
    found = hc.studies.replay(scenario, alone, "motion", grip)
    give = np.abs(found.f).max() / 300.0
    assert 0.0 < np.abs(found.p - recording.p).max() < give and np.isnan(found.force_off)


def test_a_hand_with_a_mass_is_refused(made):
    with pytest.raises(hc.ParameterError, match="grip.mass"):
        hc.studies.replay(made[0], made[1], "motion", hc.Operator())


def test_a_softer_clay_moves_farther(made):
    """A run in other clay shows its difference from the recording."""
    scenario, recording = made
    other = hc.with_fields(scenario, {"clay": hc.slab(40.0)})
    found = hc.studies.replay(other, recording)
    assert np.ptp(found.p[:, 0]) > 1.1 * np.ptp(recording.p[:, 0])


def test_an_arm_from_a_file_begins_at_its_pose():
    """Its own record, moved elsewhere, moves it again."""
    scenario = hc.Scenario(
        arm=hc.MjcfArm("haptic_3"), controller=hc.JointPD((4.0,) * 3, (0.1,) * 3),
        control="sampled", muscle=hc.Multisine((0.6, 0.4), low=0.5, high=3.0, period=2.0, lines=5),
        force=(0.0, 0.0), length=None, t_max=0.4, dt=1e-3,
    )  # fmt: skip
    record = hc.simulate(scenario)
    recording = hc.studies.Recording(record.t, record.p[:, :2] + 0.3, record.fh[:, :2])
    for drive in ("force", "motion"):
        found = hc.studies.replay(scenario, recording, drive)
        assert found.off < 0.02 * float(np.ptp(record.p[:, 0])), found.headline()


def test_the_scene_runs_again_and_is_saved(made, tmp_path):
    scenario, recording = made
    found = hc.studies.replay(scenario, recording)
    np.testing.assert_array_equal(hc.simulate(found.scenario).p[-1], found.p[-1])
    again = hc.studies.Replayed.load(found.save(tmp_path / "replay.json"))
    assert again.headline() == found.headline()


def test_a_file_of_one_axis_in_other_units(made, tmp_path):
    _, recording = made
    file = tmp_path / "log.csv"
    table = np.column_stack((1e3 * recording.t, 1e3 * recording.p[:, 0], recording.f[:, 0]))
    np.savetxt(file, table, "%.17g", ",", header="time [ms],pos [mm],F", comments="")
    read = hc.studies.Recording.load(file, {"t": "time", "x": "pos", "fx": "F"})
    np.testing.assert_allclose(read.p[:, 0], recording.p[:, 0], rtol=1e-14)
    np.testing.assert_allclose(read.t, recording.t, rtol=1e-14)
    assert not read.p[:, 1].any() and not read.f[:, 1].any()


def test_the_command(made, tmp_path, capsys):
    _, recording = made
    file = tmp_path / "log.csv"
    table = np.column_stack((recording.t, recording.p, recording.f))[:500]
    np.savetxt(file, table, delimiter=",", header="t,x,y,fx,fy", comments="")
    out = tmp_path / "out"
    assert main(["replay", "constant", "--recording", str(file), "--out", str(out)]) == 0
    assert "off the recording" in capsys.readouterr().out
    assert {x.name for x in out.iterdir()} == {"replay.json", "replay.png"}


@pytest.mark.parametrize(
    "head, told",
    [("t,a,b", "must have a motion or a force"), ("a,x,y", "must name the column of time")],
)
def test_what_is_missing_is_named(tmp_path, head, told):
    file = tmp_path / "log.csv"
    np.savetxt(file, np.ones((5, 3)), delimiter=",", header=head, comments="")
    with pytest.raises(hc.ParameterError, match=told):
        hc.studies.Recording.load(file)


def test_a_drive_that_was_not_recorded_is_refused():
    recording = hc.studies.Recording(np.arange(3.0), np.zeros((3, 2)))
    with pytest.raises(hc.ParameterError, match="drive"):
        hc.studies.replay(hc.Scenario(), recording, "force")


def test_files_side_by_side_under_a_recording(made, tmp_path, capsys, monkeypatch):
    """The scene that made the recording is nearest to it."""
    scenario, recording = made
    file = tmp_path / "log.csv"
    table = np.column_stack((recording.t, recording.p, recording.f))[:1500]
    np.savetxt(file, table, "%.17g", ",", header="t,x,y,fx,fy", comments="")
    files = [
        str(scenario.save(tmp_path / "same.toml")),
        str(hc.with_fields(scenario, {"clay": hc.slab(40.0)}).save(tmp_path / "soft.toml")),
    ]
    out, found, compare = tmp_path / "out", [], comparison.compare_files
    # what does not depend on a recording
    monkeypatch.setattr(comparison, "worst_limit", lambda loop: np.nan)
    monkeypatch.setattr(compare_plots, "CLAY_DAMPINGS", np.geomspace(1.0, 3000.0, 4))
    monkeypatch.setattr(
        comparison, "compare_files", lambda *a, **kw: found.append(compare(*a, **kw)) or found[0]
    )
    words = ["--recording", str(file), "--dpi", "40", "--out", str(out)]
    assert main(["compare", *files, *words]) == 0
    assert "off the recorded motion" in capsys.readouterr().out
    assert (out / "recording.png").is_file()
    same, soft = (x.replayed.off for x in found[0])
    assert same < 0.05 * soft


def test_a_recording_is_not_for_walls(tmp_path):
    walls = [hc.VirtualWall(K=K).save(tmp_path / f"{K}.toml") for K in (100.0, 200.0)]
    recording = hc.studies.Recording(np.arange(3.0), np.zeros((3, 2)))
    with pytest.raises(hc.ParameterError, match="recording"):
        hc.studies.compare_files(walls, recording=recording)
