"""`hapticclay device` as someone with a program for an Inverse3 would use it."""

import json
import os
import re
import signal
import subprocess
import sys

import pytest

from hapticclay.cli import app
from hapticclay.ports import Exchanges, LoopReport
from tests.ports.conftest import Client, tick
from tests.waiting import PATIENCE


def session_of(words, client_of, tmp_path):
    """A session ended by Ctrl-C: its folder, output and errors."""
    words = f"device serve --port 0 --clock tick --period 5ms --no-plots --out s {words}"
    process = subprocess.Popen(
        [sys.executable, "-m", "hapticclay", *words.split()],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    client = Client(re.findall(r"ws://\S+(?=;)", line)[0])
    client_of(client)
    client.socket.close()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    return tmp_path / "s", line + out, err


def wall_at_81_mm(client):
    x = 0.08
    for _ in range(60):
        force = -200.0 * (x - 0.081) if x > 0.081 else 0.0
        x = client.state(tick(x=force, z=1.0))["cursor_position"]["x"]


def wall_below(client):
    """A wall 1 mm below the rest of the cursor, at z = 139 mm."""
    z = 0.14
    for _ in range(120):
        force = 150.0 * (0.139 - z) if z < 0.139 else 0.0
        z = client.state(tick(z=force))["cursor_position"]["z"]


@pytest.fixture
def session(tmp_path):
    return session_of("--hand 0.02 0", wall_at_81_mm, tmp_path)


def test_an_arm_from_a_file_is_served_and_reported(tmp_path, monkeypatch, capsys):
    words = "--arm haptic_3 --friction 0 0 0 --hand 0 0 -0.01 --operator 0.2 4 100"
    folder, out, err = session_of(words, wall_below, tmp_path)
    assert not err
    found = LoopReport.load(folder / "loop.json")
    assert found.K == pytest.approx(150.0, rel=1e-6) and found.normal[2] == pytest.approx(1.0)
    assert found.headline() in out and "about the arm's pose" in out
    assert Exchanges.load(folder).axes == 3
    monkeypatch.chdir(tmp_path)
    assert app.main(["device", "report", "s", "--no-plots"]) == 0
    assert found.headline() in capsys.readouterr().out
    # the record's scenario, whose arm is a file's, is served as it stands
    (folder / "scenario.toml").rename(tmp_path / "arm.toml")
    words = ["device", "serve", "arm.toml", "--port", "0", "--clock", "tick", "--duration", "0"]
    assert app.main(words) == 0 and "nothing was recorded" in capsys.readouterr().out


def test_a_session_leaves_its_record_messages_and_report(session, tmp_path, monkeypatch, capsys):
    folder, out, err = session
    names = ["exchanges.csv", "loop.json", "record.npz", "scenario.toml", "summary.json"]
    assert sorted(os.listdir(folder)) == names
    assert len(Exchanges.load(folder)) == 60
    found = LoopReport.load(folder / "loop.json")
    assert found.K == pytest.approx(200.0, rel=1e-6) and found.headline() in out
    assert err == "hapticclay: force across the plane of the arm is recorded and cannot act\n"
    monkeypatch.chdir(tmp_path)
    assert app.main(["device", "report", "s"]) == 0  # again, elsewhere, with its figure
    assert found.headline() in capsys.readouterr().out
    assert sorted(os.listdir("out/loop")) == ["loop.json", "loop.png"]
    assert json.loads((tmp_path / "out/loop/loop.json").read_text())["schema"]


PAIR = """
Ts = "2 ms"
[leader]
mass = 0.5
damper = 1.0
[law]
Kp = [400.0]
Kd = [20.0]
[link]
delay = {}
"""


def test_both_ends_of_a_pair_are_served_and_their_record_is_written(tmp_path):
    (tmp_path / "pair.toml").write_text(PAIR.format("4e-3"))
    words = "device serve --pair pair.toml --port 0 --clock tick --period 10ms --no-plots --out s"
    with subprocess.Popen(
        [sys.executable, "-m", "hapticclay", *words.split()], cwd=tmp_path, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        lines = [process.stdout.readline() for _ in range(3)]
        hand, tool = (Client(re.findall(r"ws://\S+", x)[0]) for x in lines[:2])
        for _ in range(5):
            hand.state(tick(x=1.0))
            tool.state(tick(x=-0.5))
        for client in (hand, tool):
            client.socket.close()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0 and not err and "controllers and link took" in out
    assert [x.split(":")[0] for x in lines[:2]] == ["leader", "follower"]
    for end in ("leader", "follower"):
        assert len(Exchanges.load(tmp_path / "s" / end)) == 5
    found = json.loads((tmp_path / "s" / "pair_run.json").read_text())
    assert len(found["tables"]["samples"]["t [s]"]) == 25


@pytest.mark.parametrize(
    "words, told",
    [
        (["--end", "leader"], "give --pair"),
        (["arm.toml", "--pair", "good.toml"], "give one of the two"),
        (["--pair", "good.toml", "--hand", "0", "0"], "is in the file of the pair"),
        (["--pair", "good.toml", "--end", "leder"], "did you mean 'leader'"),
        (["--pair", "late.toml"], "whole parts"),
        (["--pair", "none.toml"], "can be read"),
    ],
)
def test_what_no_pair_serves_is_said_in_a_line(words, told, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.toml").write_text(PAIR.format("4e-3"))
    (tmp_path / "late.toml").write_text(PAIR.format("3.1415e-4"))
    assert app.main(["device", "serve", "--port", "0", "--duration", "0", *words]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1


@pytest.mark.parametrize(  # with --clock tick a message is about 5 ms: whole control samples
    "words", ["", "--pair good.toml", "--arm leader_7 --rate 300", "--arm leader_7 --rate 20"]
)
def test_nobody_came(words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.toml").write_text(PAIR.format("4e-3"))
    words = f"device serve --port 0 --clock tick --duration 0 --out out {words}".split()
    assert app.main(words) == 0
    assert "nothing was recorded" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["fly"], "serve"),
        (["serve", "--hand", "1", "2", "3"], "hand"),
        (["serve", "--hand", "nowhere.csv"], "nowhere.csv"),
        (["serve", "--device-id", "xyz"], "hexadecimal"),
        (["serve", "--prot", "1"], "--port"),
        (["serve", "--period", "1 m"], "period"),
        (["serve", "nowhere.toml"], "nowhere.toml"),
        (["serve", "--host", "a..b"], "host"),
        (["serve", "--host", "no.such.host.invalid"], "host"),
        (["serve", "--port", "70000"], "port"),
        (["serve", "--duration", "nan"], "duration"),
        (["serve", "--duration", "-1"], "duration"),
        (["serve", "--duration", "inf"], "duration"),
        (["serve", "--period", "nan", "--clock", "tick"], "period"),
        (["serve", "--period", "0.01"], "tick"),
        (["serve", "--largest-force", "nan"], "--largest-force"),
        (["serve", "--hand", "nan", "0"], "hand"),
        (["serve", "--hand", "0", "0", "1", "0", "1e-320"], "speed"),
        (["serve", "--hand", "0", "0", "1", "0", "1e300"], "speed"),
        (["serve", "--origin", "null"], "origin"),
        (["serve", "--hand", "0", "0", "0"], "must have x and y each"),
        (["serve", "--hand", "0", "0", "0", "0"], "z for three axes"),
        (["serve", "--arm", "nowhere.xml"], "nowhere.xml"),
        (["serve", "--arm", "haptic_9"], "haptic_3"),
        (["serve", "--arm", "haptic_3", "--site", "tip"], "site"),
        (["serve", "--arm", "haptic_3", "--joints", "turn", "wrist"], "wrist"),
        (["serve", "--arm", "haptic_3", "--pose", "turn=3"], "arm.pose.turn"),
        (["serve", "--arm", "haptic_3", "--plane", "xz"], "plane"),
        (["serve", "--arm", "haptic_3", "--rate", "0"], "--rate"),
        (["serve", "--arm", "haptic_3", "--operator", "0", "0", "-1"], "operator"),
        (["serve", "--arm", "planar_2r", "--hand", "0", "0", "0.1"], "must have x and y each"),
        (["serve", "a.toml", "--arm", "haptic_3"], "scenario file"),
        (["serve", "--pose", "0", "0", "0"], "--arm"),
        (["report"], "folder"),
        (["report", "nowhere"], "nowhere"),
    ],
)
def test_wrong_words_are_refused_in_a_line(words, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert app.main(["device", *words]) == 2
    err = capsys.readouterr().err
    assert told in err and err.count("\n") == 1
