"""`hapticclay zwidth` as a newcomer would use it."""

import json
import os

import pytest

import hapticclay as hc
from hapticclay.cli import app


def run(capsys, *args):
    code = app.main(args)
    out = capsys.readouterr()
    return code, out.out, out.err


def test_a_family_is_written_with_its_numbers(capsys, tmp_path):
    words = "zwidth --damper 0.5 --Ts 1ms --B 0 2 --vary damper 0.2 1 --data --out"
    code, out, err = run(capsys, *words.split(), str(tmp_path / "z"))
    assert (code, err) == (0, "")
    names = ["zwidth-lines.csv", "zwidth-regions.csv", "zwidth.csv", "zwidth.json", "zwidth.png"]
    assert sorted(os.listdir(tmp_path / "z")) == names
    assert "b = 0.2 N.s/m" in out and "no run was unstable below a line" in out
    found = json.loads((tmp_path / "z" / "zwidth.json").read_text())
    expected = hc.walls.zwidth(hc.VirtualWall(), "damper", (0.2, 1.0), B=(0.0, 2.0))
    assert found["tables"]["runs"]["K [N/m]"] == [K for r in expected.regions for K in r.K]
    assert found["gap"] < 3e-3 and found["violations"] == []


def test_options_change_a_file(capsys, tmp_path):
    wall = hc.VirtualWall(device=hc.Device(0.2, 1.0), velocity_filter=80.0)
    file = str(wall.save(tmp_path / "w.toml"))
    args = ("--filter", "none", "--hand", "0.1", "1", "0", "--B", "0", "--out", str(tmp_path))
    code, out, err = run(capsys, "zwidth", file, *args)
    assert (code, err) == (0, "")
    told = json.loads((tmp_path / "zwidth.json").read_text())["wall"]
    assert told["velocity_filter"] is None and told["device"]["mass"] == 0.2
    assert told["operator"] == {"mass": 0.1, "damper": 1.0, "spring": 0.0}


@pytest.mark.parametrize(
    "words, told",
    [
        (("--mass", "1 s"), "mass"),
        (("--mass", "-1"), "mass"),
        (("--vary", "damper"), "--vary damper 0.2 0.5"),
        (("--vary", "damqer", "1"), "damper"),
        (("--gain", "1"), "--arm"),
        (("--arm", "x", "--mass", "1"), "bare device"),
        (("--still", "0"), "still"),
        (("none.toml",), "none.toml"),
    ],
)
def test_bad_options_are_refused_with_a_hint(capsys, tmp_path, words, told):
    code, _, err = run(capsys, "zwidth", *words, "--out", str(tmp_path))
    assert code == 2 and told in err and "Traceback" not in err
