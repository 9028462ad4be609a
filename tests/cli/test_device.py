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


@pytest.fixture
def session(tmp_path):
    """A session of 60 messages, ended by Ctrl-C: its folder, output and errors."""
    words = "device serve --port 0 --clock tick --period 5ms --hand 0.02 0 --no-plots --out s"
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
    x = 0.08
    for _ in range(60):
        force = -200.0 * (x - 0.081) if x > 0.081 else 0.0
        x = client.state(tick(x=force, z=1.0))["cursor_position"]["x"]
    client.socket.close()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0
    return tmp_path / "s", line + out, err


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


def test_nobody_came(capsys, tmp_path):
    words = ["device", "serve", "--port", "0", "--clock", "tick", "--duration", "0"]
    assert app.main([*words, "--out", str(tmp_path)]) == 0
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
        (["report"], "folder"),
        (["report", "nowhere"], "nowhere"),
    ],
)
def test_wrong_words_are_refused_in_a_line(words, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert app.main(["device", *words]) == 2
    err = capsys.readouterr().err
    assert told in err and err.count("\n") == 1
