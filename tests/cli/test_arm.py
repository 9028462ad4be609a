"""`hapticclay arm`: the table, the files, and what it refuses in one line."""

import json
from pathlib import Path

import pytest

from hapticclay.cli.app import main

CARDS = Path(__file__).parents[2] / "mjcf" / "arms"
TWO = str(CARDS / "planar_2r.xml")
GAINS = ["--Kp", "100", "50", "--Kd", "1", "0.5"]


def test_limits_wall_and_poses(tmp_path, capsys):
    words = ["arm", TWO, *GAINS, "--rate", "500", "--delay", "1ms", "--wall", "x", "--B", "2"]
    assert main([*words, "--poses", "3", "--out", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "shoulder" in text and "first to change" in text and "wall along x" in text
    assert "no hand at the handle" in text and "the motors render the wall alone" in text
    assert "law: PD of 2 joints in the host, rates exact" in text
    assert {x.name for x in tmp_path.iterdir()} == {
        f"{name}.{kind}" for name in ("limits", "wall", "poses") for kind in ("json", "png")
    }
    found = json.loads((tmp_path / "limits.json").read_text())
    assert found["tables"]["joints"]["joint"] == ["shoulder", "elbow"]


def test_an_arm_without_a_name_whose_poses_are_all_alike(tmp_path, capsys, monkeypatch):
    """One joint carries the same everywhere; the folder has the name of the file."""
    monkeypatch.chdir(tmp_path)
    joint = '<joint name="pan" axis="0 0 1" armature="0.01"/>'
    mass = '<inertial pos="0.1 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/>'
    body = f"<body>{joint}{mass}</body>"
    Path("mine.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    gains = ["--Kp", "10", "--Kd", "1", "--delay", "1ms"]
    assert main(["arm", "mine.xml", *gains, "--poses", "4", "--damping", "0.1"]) == 0
    assert "worst pose: pan=" in capsys.readouterr().out
    assert Path("out/arm/mine/poses.png").exists()


def test_friction_fed_forward(tmp_path, capsys):
    gains = tmp_path / "gains.toml"
    rows = "[[4, 50, 0.1], [1.5, 50, 0.1]]"
    gains.write_text(f"Kp = [100, 50]\nKd = [1, 0.5]\nvelocity = 'difference'\nfriction = {rows}\n")
    out = tmp_path / "out"
    assert main(["arm", TWO, "--gains", str(gains), "--out", str(out)]) == 0
    assert "limit cycle of" in capsys.readouterr().out
    found = json.loads((out / "friction.json").read_text())
    assert "limit cycle" in found["tables"]["cycles"]["kind"]
    assert (out / "friction.png").exists()
    few = ["--counts", "100", "--out", str(tmp_path / "few")]
    assert main(["arm", TWO, "--gains", str(gains), *few]) == 0
    assert "100 counts a turn: no limit cycle" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words, told",
    [
        (["nothing.xml", *GAINS], "there is none"),
        (
            [TWO],
            "since the arm's file has none: --gains FILE, or --Kp and --Kd, one number for all",
        ),
        ([TWO, "--Kp", "100"], "since the arm's file has none"),
        ([TWO, "--Kp", "1", "2", "3", "--Kd", "1"], "2 numbers, one for each joint"),
        ([TWO, "--Kp", "1", "2", "--Kd", "1", "2", "3"], "as Kp (2)"),
        ([TWO, "--kp", "1"], "did you mean --Kp"),
        ([TWO, *GAINS, "--pose", "hom"], "did you mean 'home'"),
        ([TWO, *GAINS, "--pose", "shouldr=1"], "did you mean 'shoulder'"),
        ([TWO, *GAINS, "--pose", "1", "elbow=2"], "not both"),
        ([TWO, *GAINS, "--rate", "500", "--Ts", "1ms"], "give --Ts or --rate"),
        ([TWO, *GAINS, "--wall", "z"], "along which the handle can move"),
        ([TWO, "--wall", "x", "--poses", "3"], "must be given, since"),
        ([TWO, *GAINS, "--B", "2"], "give --wall"),
        ([TWO, *GAINS, "--hand", "0.2", "1", "3"], "give --wall"),
        ([TWO, *GAINS, "--seed", "2"], "--poses"),
        ([TWO, "--wall", "x", "--run"], "must be given, since"),
        ([TWO, *GAINS, "--film", "buzz.webp"], "give --run"),
        ([TWO, *GAINS, "--run", "--film", "buzz.avi"], ".webp"),
        ([TWO, *GAINS, "--counts", "4096"], "file of --gains"),
        ([TWO, *GAINS, "--velocity", "filter"], "velocity 'filter'"),
        ([TWO, *GAINS, "--dely", "1ms"], "did you mean --delay"),
        ([TWO, *GAINS, "--delay", "1mm"], "s"),
    ],
)
def test_refused_in_one_line(words, told, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["arm", *words]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_runs_beside_the_limit(tmp_path, capsys):
    words = ["arm", TWO, "--Kp", "20", "10", "--Kd", "0.3", "0.1", "--delay", "1ms", "--run"]
    assert main([*words, "--velocity", "difference", "--out", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "runs and theory agree" in text and "as built" in text
    assert {"runs.json", "runs.png", "as_built.toml"} <= {x.name for x in tmp_path.iterdir()}
    assert main(["run", str(tmp_path / "as_built.toml"), "--out", str(tmp_path / "run")]) == 0
    assert "time limit" in capsys.readouterr().out


SERVOS = """<mujoco model="servos"><compiler angle="radian"/><option integrator="implicitfast"/>
<worldbody><body><joint name="a" axis="0 1 0" damping="1"/><inertial pos=".2 0 0" mass="1"
diaginertia=".01 .01 .01"/><body pos=".4 0 0"><joint name="b" axis="0 1 0"/><inertial pos=".1 .02 0"
mass=".5" diaginertia=".003 .003 .003"/><site name="ee" pos=".2 0 0"/></body></body></worldbody>
<actuator><position joint="a" kp="2000" kv="200"/><position joint="b" kp="90" kv="9" gear="2"/>
</actuator><keyframe><key name="ready" qpos=".2 .3"/></keyframe></mujoco>"""


def gains_of(folder):
    joints = json.loads((folder / "limits.json").read_text())["tables"]["joints"]
    return joints["Kp [N.m/rad]"], joints["Kd [N.m.s/rad]"]


def test_the_file_s_own_gains(tmp_path, capsys):
    """The gains that a simulation carries, since it is implicit, are too much for a host."""
    file, out = tmp_path / "servos.xml", tmp_path / "out"
    file.write_text(SERVOS)
    assert main(["arm", str(file), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "gains: of the file, position servos at all joints" in text
    assert "each step of 2 ms (implicitfast), undelayed: stable" in text
    assert "unstable at 1000 Hz" in text
    assert gains_of(out) == ([2000.0, 360.0], [200.0, 36.0])
    words = ["--Kp", "50", "--armature", "0.1", "--pose", "ready", "--out", str(out)]
    assert main(["arm", str(file), *words]) == 0
    text = capsys.readouterr().out
    assert "gains: of the file" not in text and "pose: key frame ready" in text
    assert gains_of(out) == ([50.0, 50.0], [200.0, 36.0])
