"""`hapticclay pair`: the verdict, the files, and what it refuses in one line."""

import json

import pytest

from hapticclay.cli.app import main

PAIR = """
[leader]
mass = 6.0
damper = 0.1
[law]
Kp = [400.0]
Kd = [50.0]
[link]
delay = "10 ms"
[follower_clay]
K = 50.0
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "pair.toml"
    path.write_text(PAIR)
    return str(path)


def test_verdict_map_and_architectures(file, tmp_path, capsys):
    words = ["pair", file, "--compare", "--map", "delay-gain", "--cells", "3", "3"]
    words += ["--feel", "x", "--run", "0.1"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    for told in ("stable at position-position", "first to change: network", "waves", "factor of"):
        assert told in text
    assert {x.name for x in (tmp_path / "out").iterdir()} == {
        f"{name}.{kind}"
        for name in ("pair", "architectures", "delay_gain", "transparency", "pair_run")
        for kind in ("json", "png")
    }
    found = json.loads((tmp_path / "out" / "pair.json").read_text())
    assert found["tables"]["pair"]["stable"] == [True]


SCENE = """
t_max = 0.1
[leader]
l1 = 0.3
[law]
Kp = [20.0, 10.0]
Kd = [1.0, 0.5]
[follower_clay]
x = {edges = [0.001], values = [0, 20], Fy = [0, 0.5]}
y = {edges = [], values = [3]}
[leader_hardware]
encoder = 4096
"""


def test_arms_in_closed_form_with_clay_and_hardware_run(tmp_path, capsys):
    path = tmp_path / "pair.toml"
    path.write_text(SCENE)
    words = ["pair", str(path), "--run", "0.05", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    text = capsys.readouterr().out
    assert "to its end" in text
    assert "follower: clay: as its largest damping" in text and "leader: encoder: left out" in text


@pytest.mark.parametrize(
    "change, told",
    [
        (("encoder = 4096", "encodr = 4096"), "encoder"),
        (("encoder = 4096", "delay = 0.001"), "Pair(delay)"),
        (("encoder = 4096", "encoder = 3"), "leader_hardware.encoder = 3: must be"),
        (("Fy = [0, 0.5]", "Fy = [0, -1]"), "Fy"),
        (("edges = []", "edge = []"), "edges"),
    ],
)
def test_scenes_of_pairs_are_refused_in_one_line(change, told, tmp_path, capsys):
    path = tmp_path / "pair.toml"
    path.write_text(SCENE.replace(*change))
    assert main(["pair", str(path), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1, error


def test_options_replace_what_the_file_says(file, tmp_path, capsys):
    words = ["pair", file, "--delay", "0.4", "--Ts", "2ms", "--kind", "four-channel"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    assert "unstable" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words, told",
    [
        (["nothing.toml"], "can be read"),
        (["{}", "--delay", "1", "2", "3"], "2 numbers (there, back)"),
        (["{}", "--kind", "wave"], "did you mean 'waves'"),
        (["{}", "--cells", "3", "3"], "give --map"),
        (["{}", "--map", "gain"], "delay-gain"),
        (["{}", "--film", "pair.mp4"], "give --run"),
        (["{}", "--view", "--run", "0.1"], "leave out --view"),
        (["{}", "--port", "0"], "give --view"),
        (["{}", "--view", "--delay", "0.00031415"], "whole parts"),
        (["{}", "--run", "0.1", "--film", "pair.avi"], "must be one of .mp4, .webp, .gif"),
        (["{}", "--run", "0.1", "--delay", "0.00031415", "--film", "x.webp"], "whole parts"),
        (["{}", "--dely", "1ms"], "did you mean --delay"),
    ],
)
def test_refused_in_one_line(words, told, file, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["pair", *(word.format(file) for word in words)]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1
    assert [x.name for x in tmp_path.iterdir()] == ["pair.toml"]


@pytest.mark.parametrize(
    "text, told",
    [
        ("x = 1\n" + PAIR, "x"),
        (PAIR.replace("[law]", "[lw]"), "lw"),
        (PAIR.replace("mass", "mas"), "mass"),
        (PAIR + "[leader_operator]\nmas = 1\n", "mass"),
    ],
)
def test_a_file_that_is_no_pair(text, told, tmp_path, capsys):
    path = tmp_path / "pair.toml"
    path.write_text(text)
    assert main(["pair", str(path), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1


@pytest.mark.parametrize("command", ["run", "view", "video"])
def test_commands_of_scenarios_name_the_one_for_pairs(command, file, capsys):
    assert main([command, file]) == 2
    error = capsys.readouterr().err
    assert "are for hapticclay pair" in error and error.count("\n") == 1
